"""Twin of models/kapitza/refine_model_f32.h: the pendulum's full equations for the refinement."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvid.twin.f32.elementary import sincos
from pvid.twin.f32.refine_model import Derivatives, Float32, RefineShape

_F = np.float32
_SHAPE = RefineShape(
    coordinates=2,
    inputs=1,
    outputs=1,
    moving=6,
    parameters=7,
    skew=True,
    rates=False,
    logarithmic=(True, True, True, False, False, False, False),
    place_of_p=(0, 1, 2, 6),
)


def _ratio(r: Float32) -> np.float32:
    return _F((r[1] - r[2]) - _F(1))


class _Common(NamedTuple):
    gravity: np.float32
    vr: np.float32
    s1: np.float32
    c1: np.float32
    s2: np.float32
    c2: np.float32
    sf: np.float32
    cf: np.float32
    lv: np.float32
    vv: np.float32
    i11: np.float32
    i12: np.float32
    i22: np.float32
    a1: np.float32
    big: np.float32
    a2: np.float32


def _common(m: Float32, q: Float32, v: Float32, u: Float32) -> _Common:
    w, lam, sig, k1, k2, one_sig, inverse_lam, k2_lam = m
    vr, gravity = v[1] - v[0], w + u[0]
    (s1, s2), (c1, c2) = sincos(q)
    sf, cf = s2 * c1 - c2 * s1, c2 * c1 + s2 * s1
    lv, vv = (lam * v[1]) * v[1], v[0] * v[0]
    b1 = ((sf * lv - gravity * s1) + k2 * vr) - k1 * v[0]
    b2 = (-(sf * vv) - gravity * s2) - k2_lam * vr
    i22 = _F(1) / (sig + sf * sf)
    i11, i12 = one_sig * i22, -(cf * i22)
    a1, big = i11 * b1 + i12 * b2, i12 * b1 + i22 * b2
    return _Common(gravity, vr, s1, c1, s2, c2, sf, cf, lv, vv, i11, i12, i22, a1, big, big * inverse_lam)


class KapitzaRefine:
    """pvid.twin.f32.refine_model.RefineModel of the pendulum."""

    @property
    def shape(self) -> RefineShape:
        """Of refine_shape.h."""
        return _SHAPE

    def region(self, r: Float32) -> bool:
        """l2 is positive."""
        return bool(_ratio(r) > _F(0.02))

    def constants(self, r: Float32) -> Float32:
        """w, lam, sig, k1, k2, 1 + sig, 1 / lam, k2 / lam."""
        ratio = _ratio(r)
        sig, inverse_lam = _F(1) / ratio, r[2] / ratio
        lam = _F(1) / inverse_lam
        return np.array([r[0], lam, sig, r[3], r[4], _F(1) + sig, inverse_lam, r[4] * inverse_lam], _F)

    def motion(self, m: Float32, q: Float32, v: Float32, u: Float32) -> Float32:
        """q''"""
        x = _common(m, q, v, u)
        return np.array([x.a1, x.a2], _F)

    def jacobian(self, m: Float32, q: Float32, v: Float32, u: Float32) -> Derivatives:
        """q'' and its derivatives."""
        w, lam, sig, k1, k2, _, inverse_lam, k2_lam = m
        x = _common(m, q, v, u)
        j12, j22 = x.i12 * inverse_lam, x.i22 * inverse_lam
        f1, f2 = x.cf * x.lv + x.sf * x.big, x.sf * x.a1 - x.cf * x.vv
        e11, e22 = -f1 - x.gravity * x.c1, f2 - x.gravity * x.c2
        g11 = -(k1 + k2)
        g12 = (_F(2) * lam) * (x.sf * v[1]) + k2
        g21 = k2_lam - _F(2) * (x.sf * v[0])
        u1, u2 = -(x.i11 * x.s1 + x.i12 * x.s2), -(j12 * x.s1 + j22 * x.s2)
        l1, l2 = x.sf * x.lv, k2_lam * x.vr
        g, s = -(sig * x.big), -(x.vr * inverse_lam)
        return Derivatives(
            a=np.array([x.a1, x.a2], _F),
            K=np.array(
                [
                    [x.i11 * e11 - x.i12 * f2, x.i11 * f1 + x.i12 * e22],
                    [j12 * e11 - j22 * f2, j12 * f1 + j22 * e22],
                ],
                _F,
            ),
            D=np.array(
                [
                    [x.i11 * g11 + x.i12 * g21, x.i11 * g12 - x.i12 * k2_lam],
                    [j12 * g11 + j22 * g21, j12 * g12 - j22 * k2_lam],
                ],
                _F,
            ),
            U=np.array([[u1], [u2]], _F),
            B=np.array(
                [
                    [w * u1, w * u2],
                    [x.i11 * l1 + x.i12 * l2, (j12 * l1 + j22 * l2) - x.a2],
                    [x.i12 * g, j22 * g],
                    [-(x.i11 * v[0]), -(j12 * v[0])],
                    [x.i11 * x.vr + x.i12 * s, j12 * x.vr + j22 * s],
                    [0, 0],
                ],
                _F,
            ),
        )

    def output(self, m: Float32, r: Float32, q: Float32, v: Float32) -> Float32:
        """phi"""
        return np.array([(q[1] - q[0]) + r[6]], _F)

    def output_jacobian(self, m: Float32, r: Float32, q: Float32, v: Float32) -> tuple[Float32, Float32, Float32]:
        """By q, v and c."""
        return np.array([[-1, 1]], _F), np.zeros((1, 2), _F), np.array([[1]], _F)

    def chart(self, r: Float32, row: Float32) -> Float32:
        """Derivatives by the motion's columns to those by the steps of r."""
        inverse = _F(1) / _ratio(r)
        out = row.copy()
        out[1] = (r[1] * inverse) * (row[1] - row[2])
        out[2] = (r[2] * inverse) * (row[2] - row[1]) - row[1]
        return out

    def from_p(self, p: Float32) -> Float32:
        """r of (w, d1, d2, c)."""
        return np.array([p[0], p[1], p[2], 0, 0, 0, p[3]], _F)
