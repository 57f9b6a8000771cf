"""Twin of weak/white_f32.c: noise of a kind's rows at p, and the directions that the test functions leave out.

Rows are made of parts of the sums S_h: real ones of the harmonics 0.., then imaginary ones of the harmonics 1...
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import WeakDesign32

Float32 = npt.NDArray[np.float32]

_F = np.float32
_TURN = _F(6.28318531)
_FLOOR, _SPECTRUM_MIN = _F(1e-10), _F(1e-30)


def total(x: Float32) -> Float32:
    """0 + x[0] + x[1] + .., in this order, of x [n, ...]."""
    found: Float32 = np.add.accumulate(x)[-1] + _F(0)
    return found


class Rows:
    """The rows of a design.

    Attributes
    ----------
    harmonics : H + 1
    cosines : real parts
    parts : with the imaginary parts, K + n
    omega : of h = 1 [rad/s]
    powers : of omega^2 in the noise
    harmonic : of each part [parts]
    vectors : n/2, reflections of each family
    """

    def __init__(self, design: WeakDesign32, dt: np.float32) -> None:
        self.design = design
        self.harmonics = design.highest + 1
        self.cosines = self.harmonics
        self.parts = design.functions + design.power
        self.vectors = design.power // 2
        self.omega = _TURN / (_F(2) * (_F(design.hop) * dt))
        orders = [one.power for one in design.noise] + [int(one) for one in design.error_order]
        self.powers = max(orders, default=0) + 1
        self.harmonic = np.concatenate([np.arange(self.cosines), np.arange(1, 1 + self.parts - self.cosines)])
        rate = np.arange(self.harmonics).astype(np.float32) * self.omega
        self.square = rate * rate
        self.samples = np.full(self.harmonics, design.hop, np.float32)
        self.samples[0] = _F(2) * _F(design.hop)

    @property
    def families(self) -> tuple[slice, slice]:
        """Places of the real parts and of the imaginary parts."""
        return slice(0, self.cosines), slice(self.cosines, self.parts)


class White:
    """Noise of the rows of a kind at its theta [thetas, lanes]."""

    def __init__(self, rows: Rows, kind: int, theta: Float32) -> None:
        self.rows, self.kind, self.theta = rows, kind, theta
        self._full = np.concatenate([theta, np.full((1, theta.shape[1]), _F(-1))])
        with np.errstate(all="ignore"):
            self.weight = self._weighed()
            self.scale = self._scale()
            self.reflections: list[Float32] = []
            self.leverage = self._leverage()

    def _weighed(self) -> Float32:
        """c_j of the sensors [powers, lanes]."""
        weight = np.zeros((self.rows.powers, self.theta.shape[1]), np.float32)
        for one in self.rows.design.noise_of(self.kind):
            weight[one.power] = weight[one.power] + one.factor * (self._full[one.a] * self._full[one.b])
        return weight

    def _scale(self) -> Float32:
        """1 / sqrt(D_h) [harmonics, lanes]."""
        rows, design = self.rows, self.rows.design
        own = self.weight.copy()
        order = int(design.error_order[self.kind])
        own[order] = own[order] + _F(design.error_variance[self.kind])
        spectrum = np.zeros((rows.harmonics, own.shape[1]), np.float32)
        for j in reversed(range(rows.powers)):
            spectrum = spectrum * rows.square[:, None] + own[j]
        spectrum = rows.samples[:, None] * spectrum
        part = (_FLOOR * total(spectrum)) / _F(rows.harmonics)
        least = np.where(part > _SPECTRUM_MIN, part, _SPECTRUM_MIN)
        return np.asarray(_F(1) / np.sqrt(np.where(spectrum > least, spectrum, least)), np.float32)

    def _leverage(self) -> Float32:
        """Sum of the squares of the directions [parts, lanes]; finds their reflections."""
        rows = self.rows
        x = (rows.harmonic.astype(np.float32) * (_F(1) / _F(rows.cosines - 1)))[:, None]
        scale = self.scale[rows.harmonic]
        lanes = scale.shape[1]
        leverage: Float32 = np.zeros(scale.shape, np.float32)
        u, before = scale, np.zeros_like(scale)
        norm, slope = np.zeros((2, lanes), np.float32), np.zeros((2, lanes), np.float32)
        for k in range(rows.vectors):
            following = np.zeros_like(u)
            for place, family in enumerate(rows.families):
                own, square = u[family], x[family] * x[family]
                if k:
                    y = (square - slope[place]) * own - norm[place] * before[family]
                else:
                    y = own * x[family] if place else own
                norm[place] = np.sqrt(total(y * y))
                following[family] = y * (_F(1) / norm[place])
                part = following[family] * following[family]
                leverage[family] = leverage[family] + part if k else part
                slope[place] = total(square * part)
            u, before = following, u if k else before
            self.reflections.append(self._reflections_of(u))
        return np.asarray(leverage, np.float32)

    def _reflections_of(self, u: Float32) -> Float32:
        """Those of both families that follow from the next direction [parts, lanes]."""
        v = u
        for place in range(len(self.reflections)):
            v = self._reflected(place, v)
        out: Float32 = np.zeros(v.shape, np.float32)
        for family in self.rows.families:
            own = slice(family.start + len(self.reflections), family.stop)
            out[own] = _reflection(v[own])
        return out

    def _reflected(self, place: int, x: Float32) -> Float32:
        """x [parts, ..., lanes] behind a reflection of both families."""
        out, v = x.copy(), self.reflections[place]
        wide = v.reshape(len(v), *(1,) * (x.ndim - 2), v.shape[-1])
        for family in self.rows.families:
            own = slice(family.start + place, family.stop)
            out[own] = x[own] - total(wide[own] * x[own]) * wide[own]
        return out

    def columns(self, parts: Float32) -> Float32:
        """White columns [columns, rows, lanes] from their parts in standard deviations [columns, parts, lanes]."""
        x = np.moveaxis(parts, 0, 1)
        with np.errstate(all="ignore"):
            for place in range(self.rows.vectors):
                x = self._reflected(place, x)
        kept = np.concatenate([x[one.start + self.rows.vectors : one.stop] for one in self.rows.families])
        return np.moveaxis(kept, 0, 1)

    @cached_property
    def share(self) -> Float32:
        """Q_j = tr(R^-1 dR/dc_j) [powers, lanes]."""
        rows = self.rows
        scale = self.scale[rows.harmonic]
        with np.errstate(all="ignore"):
            weight = rows.samples[rows.harmonic][:, None] * ((_F(1) - self.leverage) * (scale * scale))
            share = []
            for _ in range(rows.powers):
                share.append(total(weight))
                weight = weight * rows.square[rows.harmonic][:, None]
        return np.array(share)

    def pull(self) -> Float32:
        """g = 1/2 sum_j dc_j/dtheta Q_j [thetas, lanes]."""
        g = np.zeros_like(self.theta)
        with np.errstate(all="ignore"):
            for one in self.rows.design.noise_of(self.kind):
                half = (_F(0.5) * one.factor) * self.share[one.power]
                if one.a < len(g):
                    g[one.a] = g[one.a] + half * self._full[one.b]
                if one.b < len(g):
                    g[one.b] = g[one.b] + half * self._full[one.a]
        return g

    def sensors(self) -> Float32:
        """Mean variance of the white rows by the sensors alone [lanes]."""
        with np.errstate(all="ignore"):
            return total(self.weight * self.share) / _F(self.rows.design.functions)


def _reflection(x: Float32) -> Float32:
    """v with v^T v = 2, such that x - v (v^T x) has nothing behind its first entry [entries, lanes]."""
    size, head = np.sqrt(total(x * x)), x[0]
    negative = head < 0
    scale = _F(1) / np.sqrt(size * (size + np.where(negative, -head, head)))
    v = x.copy()
    v[0] = np.where(negative, head - size, head + size)
    return np.asarray(v * scale, np.float32)
