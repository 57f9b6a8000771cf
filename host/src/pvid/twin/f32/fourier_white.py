"""Twin of fourier/white_f32.c: noise of a kind's rows at p, its Cholesky factors, and what follows from its inverse.

Rows are those of two families, cosines and sines, that are factored at once: arrays have an axis [2] for them, and the
sines, of which there are fewer, have empty rows behind them.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.settings.fourier import FourierDesign32

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

_F = np.float32
_TURN = _F(6.28318531)
_FLOOR = _F(1e-10)
_PIVOT = _F(1e-6)


class Shapes:
    """T of a design: the harmonics of its rows, and their factors W_h omega_h^(2 j).

    Attributes
    ----------
    harmonics : H + 1
    rows : of each family
    power : n
    omega : of h = 1 [rad/s]
    """

    def __init__(self, design: FourierDesign32, dt: np.float32) -> None:
        self.design = design
        self.power = design.power
        self.harmonics = design.highest + 1
        cosines = design.functions // 2 + 1
        self.rows = (cosines, design.functions - cosines)
        self.omega = _TURN / (_F(2) * (_F(design.hop) * dt))
        orders = [one.power for one in design.noise] + [int(one) for one in design.error_order]
        self.powers = max(orders, default=0) + 1
        self.square = (np.arange(self.harmonics, dtype=np.float32) * self.omega) ** 2  # of numpy: x * x
        self.samples = np.full(self.harmonics, design.hop, np.float32)
        self.samples[0] = _F(2) * _F(design.hop)

    @cached_property
    def bell(self) -> Float32:
        """(-1)^d binomial(n, n/2 + d) / 2^n as the core computes it [n/2 + 1]."""
        n, binomial = self.power, _F(1)
        for _ in range(n):
            binomial = binomial * _F(0.5)
        for i in range(n // 2):
            binomial = binomial * (_F(n - i) / _F(i + 1))
        out = np.empty(n // 2 + 1, np.float32)
        for d in range(n // 2 + 1):
            out[d] = -binomial if d % 2 else binomial
            binomial = binomial * (_F(n // 2 - d) / _F(n // 2 + d + 1))
        return out

    @cached_property
    def table(self) -> Float32:
        """T [2, rows, harmonics]."""
        half = self.power // 2
        out = np.zeros((2, self.rows[0], self.harmonics), np.float32)
        for family, rows in enumerate(self.rows):
            for row in range(rows):
                frequency = row + family
                for h in range(family, self.harmonics):
                    apart, folded = abs(h - frequency), h + frequency
                    value = self.bell[apart] if apart <= half else _F(0)
                    if h > 0 and folded <= half:
                        value = value + (-self.bell[folded] if family else self.bell[folded])
                    out[family, row, h] = value
        return out

    @cached_property
    def first_row(self) -> npt.NDArray[np.int64]:
        """The first row of each family that has a harmonic [2, harmonics]."""
        below = np.arange(self.harmonics) - self.power // 2
        return np.maximum(np.stack([below, below - 1]), 0)

    @cached_property
    def weights(self) -> Float32:
        """W_h omega_h^(2 j) [powers, harmonics]."""
        out = np.empty((self.powers, self.harmonics), np.float32)
        out[0] = self.samples
        for j in range(1, self.powers):
            out[j] = out[j - 1] * self.square
        return out


class White:
    """Noise of the rows of a kind at its theta [thetas, lanes], and its factors."""

    def __init__(self, shapes: Shapes, kind: int, theta: Float32) -> None:
        self.shapes, self.kind, self.theta = shapes, kind, theta
        with np.errstate(all="ignore"):
            self.weight = self._weighed()
            self.spectrum = self._spectrum()
            self.factor = _factored(_gram(shapes, self.spectrum), shapes)

    @cached_property
    def _full(self) -> Float32:
        return np.concatenate([self.theta, np.full((1, self.theta.shape[1]), _F(-1))])

    def _weighed(self) -> Float32:
        """c_j [powers, lanes]."""
        weight = np.zeros((self.shapes.powers, self.theta.shape[1]), np.float32)
        for one in self.shapes.design.noise_of(self.kind):
            weight[one.power] = weight[one.power] + one.factor * (self._full[one.a] * self._full[one.b])
        return weight

    def _spectrum(self) -> Float32:
        """D_h [harmonics, lanes]."""
        shapes, design = self.shapes, self.shapes.design
        own = self.weight.copy()
        order = int(design.error_order[self.kind])
        own[order] = own[order] + _F(design.error_variance[self.kind])
        total = np.zeros((shapes.harmonics, own.shape[1]), np.float32)
        for j in reversed(range(shapes.powers)):
            total = total * shapes.square[:, None] + own[j]
        spectrum = shapes.samples[:, None] * total
        mean = np.add.accumulate(spectrum)[-1]
        least = (_FLOOR * mean) / _F(shapes.harmonics)
        return np.where(spectrum > least, spectrum, least)

    def forward(self, x: Float32) -> Float32:
        """L^-1 x [..., 2, rows, lanes] of columns."""
        out = np.empty_like(x)
        band = self.shapes.power
        with np.errstate(all="ignore"):
            for i in range(x.shape[-2]):
                value = x[..., i, :]
                for k in range(max(0, i - band), i):
                    value = value - self.factor[:, i, k] * out[..., k, :]
                out[..., i, :] = value * self.factor[:, i, i]
        return out

    def _directions(self) -> Float32:
        """L^-1 t_h of every harmonic [harmonics, 2, rows, lanes]; 0 where t_h has no row yet, and behind the rows."""
        shapes = self.shapes
        band, lanes = shapes.power, self.theta.shape[1]
        begun = np.arange(shapes.rows[0])[:, None, None] >= shapes.first_row.T  # [rows, harmonics, 2]
        shape = np.moveaxis(shapes.table, 2, 0)[..., None]  # [harmonics, 2, rows, 1]
        out = np.zeros((shapes.harmonics, 2, shapes.rows[0], lanes), np.float32)
        for i in range(shapes.rows[0]):
            value = np.broadcast_to(shape[:, :, i], out[:, :, i].shape)
            for k in range(max(0, i - band), i):
                value = np.where(begun[k][..., None], value - self.factor[:, i, k] * out[:, :, k], value)
            out[:, :, i] = np.where(begun[i][..., None], value * self.factor[:, i, i], _F(0))
        out[:, 1, shapes.rows[1] :] = 0
        return out

    @cached_property
    def share(self) -> Float32:
        """Q_j [powers, lanes]."""
        shapes = self.shapes
        with np.errstate(all="ignore"):
            y = self._directions()
            squares = np.add.accumulate(y * y, axis=2)[:, :, -1]  # [harmonics, 2, lanes]
            each = shapes.weights[:, :, None, None] * squares
            ordered = np.concatenate([each[:, :, 0], each[:, 1:, 1]], axis=1)  # cosines, then sines
            return np.add.accumulate(ordered, axis=1)[:, -1]

    def pull(self) -> Float32:
        """g = 1/2 sum_j dc_j/dtheta Q_j [thetas, lanes]."""
        g = np.zeros_like(self.theta)
        with np.errstate(all="ignore"):
            for one in self.shapes.design.noise_of(self.kind):
                half = (_F(0.5) * one.factor) * self.share[one.power]
                if one.a < len(g):
                    g[one.a] = g[one.a] + half * self._full[one.b]
                if one.b < len(g):
                    g[one.b] = g[one.b] + half * self._full[one.a]
        return g

    def sensors(self) -> Float32:
        """Mean variance of the white rows by the sensors alone [lanes]."""
        total = np.zeros(self.theta.shape[1], np.float32)
        with np.errstate(all="ignore"):
            for j in range(self.shapes.powers):
                total = total + self.weight[j] * self.share[j]
            return total / _F(self.shapes.design.functions)


def _gram(shapes: Shapes, spectrum: Float32) -> Float32:
    """R = T diag(D) T^T [2, rows, rows, lanes], lower triangle within the band; 1 on the diagonal behind the rows."""
    half, lanes = shapes.power // 2, spectrum.shape[1]
    r = np.zeros((2, shapes.rows[0], shapes.rows[0], lanes), np.float32)
    for family, rows in enumerate(shapes.rows):
        table = shapes.table[family]
        i, j = np.tril_indices(rows)
        near = i - j <= shapes.power
        i, j = i[near], j[near]
        begin = np.maximum(i + family - half, family)
        total = np.zeros((len(i), lanes), np.float32)
        for step in range(shapes.power + 1):
            h = begin + step
            inside = h <= j + family + half
            at = np.minimum(h, shapes.harmonics - 1)
            product = (spectrum[at] * table[i, at][:, None]) * table[j, at][:, None]
            total = np.where(inside[:, None], total + product, total)
        r[family, i, j] = total
        behind = np.arange(rows, shapes.rows[0])
        r[family, behind, behind] = 1
    return r


def _factored(r: Float32, shapes: Shapes) -> Float32:
    """L of R = L L^T [2, rows, rows, lanes], its diagonal inverted."""
    low = np.zeros_like(r)
    for i in range(r.shape[1]):
        first = max(0, i - shapes.power)
        diagonal = r[:, i, i]
        for j in range(first, i):
            value = r[:, i, j]
            for k in range(first, j):
                value = value - low[:, i, k] * low[:, j, k]
            low[:, i, j] = value * low[:, j, j]
        pivot = diagonal
        for k in range(first, i):
            pivot = pivot - low[:, i, k] * low[:, i, k]
        least = _PIVOT * diagonal
        low[:, i, i] = _F(1) / np.sqrt(np.where(pivot > least, pivot, least))
    return low
