"""Twin of fourier/white_f32.c: noise of a kind's rows at p, and the directions that the test functions leave out.

Rows are parts of the sums S_h: real ones of the harmonics 0.., then imaginary ones of the harmonics 1...
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.settings.fourier import FourierDesign32

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
    count : with the imaginary parts, K + n
    omega : of h = 1 [rad/s]
    powers : of omega^2 in the noise
    harmonic : of each row [rows]
    """

    def __init__(self, design: FourierDesign32, dt: np.float32) -> None:
        self.design = design
        self.harmonics = design.highest + 1
        self.cosines = self.harmonics
        self.count = design.functions + design.power
        self.omega = _TURN / (_F(2) * (_F(design.hop) * dt))
        orders = [one.power for one in design.noise] + [int(one) for one in design.error_order]
        self.powers = max(orders, default=0) + 1
        self.harmonic = np.concatenate([np.arange(self.cosines), np.arange(1, 1 + self.count - self.cosines)])
        rate = np.arange(self.harmonics).astype(np.float32) * self.omega
        self.square = rate * rate
        self.samples = np.full(self.harmonics, design.hop, np.float32)
        self.samples[0] = _F(2) * _F(design.hop)

    @property
    def families(self) -> tuple[slice, slice]:
        """Places of the real parts and of the imaginary parts."""
        return slice(0, self.cosines), slice(self.cosines, self.count)


class White:
    """Noise of the rows of a kind at its theta [thetas, lanes]."""

    def __init__(self, rows: Rows, kind: int, theta: Float32) -> None:
        self.rows, self.kind, self.theta = rows, kind, theta
        self._full = np.concatenate([theta, np.full((1, theta.shape[1]), _F(-1))])
        with np.errstate(all="ignore"):
            self.weight = self._weighed()
            self.scale = self._scale()
            self.basis = self._basis()

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

    def _basis(self) -> list[Float32]:
        """The directions, each [rows, lanes]: one of the real parts above one of the imaginary parts."""
        rows = self.rows
        x = (rows.harmonic.astype(np.float32) / _F(rows.cosines - 1))[:, None]
        basis: list[Float32] = []
        for k in range(rows.design.power // 2):
            if k == 0:
                scale = self.scale[rows.harmonic]
                u = np.where(np.arange(rows.count)[:, None] < rows.cosines, scale, x * scale)
            else:
                u = (x * x) * basis[-1]
            for turn in range(2 * k):
                u = self._without(basis[turn % k], u)
            for family in rows.families:
                u[family] = u[family] * (_F(1) / np.sqrt(total(u[family] * u[family])))
            basis.append(u)
        return basis

    def _without(self, u: Float32, x: Float32) -> Float32:
        """x [rows, ..., lanes] less its components along the two vectors in u [rows, lanes]."""
        out = x.copy()
        wide = u.reshape(len(u), *(1,) * (x.ndim - 2), u.shape[-1])
        for family in self.rows.families:
            out[family] = x[family] - total(wide[family] * x[family]) * wide[family]
        return out

    def columns(self, sums: Float32) -> Float32:
        """White columns [columns, rows, lanes] from their sums [columns, 2, harmonics]."""
        rows = self.rows
        with np.errstate(all="ignore"):
            parts = np.concatenate([sums[:, 0], sums[:, 1, 1 : 1 + rows.count - rows.cosines]], axis=1)
            x = self.scale[rows.harmonic][:, None] * parts.T[:, :, None]
            for u in self.basis:
                x = self._without(u, x)
        return np.moveaxis(x, 0, 1)

    @cached_property
    def share(self) -> Float32:
        """Q_j = tr(R^-1 dR/dc_j) [powers, lanes]."""
        rows = self.rows
        scale = self.scale[rows.harmonic]
        left = np.ones_like(scale)
        with np.errstate(all="ignore"):
            for u in self.basis:
                left = left - u * u
            weight = rows.samples[rows.harmonic][:, None] * (left * (scale * scale))
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
