"""Twin of weak/white_f32.c: noise of a kind's rows at p, and the directions that the test functions leave out.

Rows are made of parts of the sums S_h, in two families: real parts of the harmonics 0.., imaginary parts of the
harmonics 1...; both are arrays over all harmonics, with zeros where there is no part.
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
    omega : of h = 1 [rad/s]
    powers : of omega^2 in the noise
    vectors : n/2, reflections of each family
    families : harmonics of the real parts and of the imaginary parts
    """

    def __init__(self, design: WeakDesign32, dt: np.float32) -> None:
        self.design = design
        self.harmonics = design.highest + 1
        self.vectors = design.power // 2
        sines = (design.functions - 1) // 2 + self.vectors
        self.families = slice(0, self.harmonics), slice(1, sines + 1)
        self.omega = _TURN / (_F(2) * (_F(design.hop) * dt))
        orders = [one.power for one in design.noise] + [int(one) for one in design.error_order]
        self.powers = max(orders, default=0) + 1
        rate = np.arange(self.harmonics).astype(np.float32) * self.omega
        self.square = rate * rate
        self.samples = np.full(self.harmonics, design.hop, np.float32)
        self.samples[0] = _F(2) * _F(design.hop)


class White:
    """Noise of the rows of a kind at its theta [thetas, lanes], with the variance of its own error [lanes].

    Attributes
    ----------
    full : theta, and -1 of Y [thetas + 1, lanes]
    """

    def __init__(self, rows: Rows, kind: int, theta: Float32, error_variance: Float32) -> None:
        self.rows, self.kind = rows, kind
        self._error_variance = error_variance
        self.full = np.concatenate([theta, np.full((1, theta.shape[1]), _F(-1))])
        with np.errstate(all="ignore"):
            self.weight = self._weighed()
            self.scale = self._scale()
            self.reflections: list[Float32] = []
            self.leverage = self._leverage()

    def _weighed(self) -> Float32:
        """c_j of the sensors [powers, lanes]."""
        weight = np.zeros((self.rows.powers, self.full.shape[1]), np.float32)
        for one in self.rows.design.noise_of(self.kind):
            weight[one.power] = weight[one.power] + one.factor * (self.full[one.a] * self.full[one.b])
        return weight

    def _scale(self) -> Float32:
        """1 / sqrt(D_h) [harmonics, lanes]."""
        rows, design = self.rows, self.rows.design
        own = self.weight.copy()
        order = int(design.error_order[self.kind])
        own[order] = own[order] + self._error_variance
        spectrum = np.zeros((rows.harmonics, own.shape[1]), np.float32)
        for j in reversed(range(rows.powers)):
            spectrum = spectrum * rows.square[:, None] + own[j]
        spectrum = rows.samples[:, None] * spectrum
        part = (_FLOOR * total(spectrum)) / _F(rows.harmonics)
        least = np.where(part > _SPECTRUM_MIN, part, _SPECTRUM_MIN)
        return np.asarray(_F(1) / np.sqrt(np.where(spectrum > least, spectrum, least)), np.float32)

    def _leverage(self) -> Float32:
        """Sum of the squares of the directions [2, harmonics, lanes]; finds their reflections."""
        rows = self.rows
        x = (np.arange(rows.harmonics).astype(np.float32) * (_F(1) / _F(rows.harmonics - 1)))[:, None]
        leverage: Float32 = np.zeros((2, *self.scale.shape), np.float32)
        u, before = np.zeros_like(leverage), np.zeros_like(leverage)
        for place, family in enumerate(rows.families):
            u[place, family] = self.scale[family]
        lanes = self.scale.shape[1]
        norm, slope = np.zeros((2, lanes), np.float32), np.zeros((2, lanes), np.float32)
        for k in range(rows.vectors):
            following = np.zeros_like(u)
            for place, family in enumerate(rows.families):
                own, square = u[place, family], x[family] * x[family]
                if k:
                    y = (square - slope[place]) * own - norm[place] * before[place, family]
                else:
                    y = own * x[family] if place else own
                norm[place] = np.sqrt(total(y * y))
                following[place, family] = y * (_F(1) / norm[place])
                part = following[place, family] * following[place, family]
                leverage[place, family] = leverage[place, family] + part if k else part
                slope[place] = total(square * part)
            u, before = following, u if k else before
            self.reflections.append(self._reflections_of(u))
        return leverage

    def _reflections_of(self, u: Float32) -> Float32:
        """Those of both families that follow from the next direction [2, harmonics, lanes]."""
        v = self._reflected(u)
        out: Float32 = np.zeros(v.shape, np.float32)
        for place, family in enumerate(self.rows.families):
            own = slice(family.start + len(self.reflections), family.stop)
            out[place, own] = _reflection(v[place, own])
        return out

    def _reflected(self, x: Float32) -> Float32:
        """x [2, harmonics, ..., lanes] behind all reflections of both families."""
        out = x.copy()
        for v in self.reflections:
            wide = v.reshape(*v.shape[:2], *(1,) * (x.ndim - 3), v.shape[-1])
            for place in range(2):
                out[place] = out[place] - total(wide[place] * out[place]) * wide[place]
        return out

    def columns(self, parts: Float32) -> Float32:
        """White columns [columns, rows, lanes] from their parts in standard deviations
        [columns, 2, harmonics, lanes]."""
        with np.errstate(all="ignore"):
            x = self._reflected(np.moveaxis(parts, 0, 2))
        kept = [x[place, one.start + self.rows.vectors : one.stop] for place, one in enumerate(self.rows.families)]
        return np.moveaxis(np.concatenate(kept), 0, 1)

    @cached_property
    def share(self) -> Float32:
        """Q_j = tr(R^-1 dR/dc_j) [powers, lanes]."""
        rows, sines = self.rows, self.rows.families[1]
        with np.errstate(all="ignore"):
            left = _F(1) - self.leverage[0]
            left[sines] = left[sines] + (_F(1) - self.leverage[1, sines])
            weight = rows.samples[:, None] * (left * (self.scale * self.scale))
            share = []
            for _ in range(rows.powers):
                share.append(total(weight))
                weight = weight * rows.square[:, None]
        return np.array(share)

    def pull(self, x: Float32) -> Float32:
        """V x, V the covariance that the sensors' noise has in the columns of the kind; x: of theta's columns and of Y
        [thetas + 1, lanes]."""
        out = np.zeros_like(x)
        with np.errstate(all="ignore"):
            for one in self.rows.design.noise_of(self.kind):
                half = (_F(0.5) * one.factor) * self.share[one.power]
                out[one.a] = out[one.a] + half * x[one.b]
                out[one.b] = out[one.b] + half * x[one.a]
        return out[:-1]

    def sensors(self) -> Float32:
        """Mean variance of the white rows by the sensors alone [lanes]."""
        with np.errstate(all="ignore"):
            return total(self.weight * self.share) / _F(self.rows.design.functions)

    def error_share(self) -> Float32:
        """The same for each unit of the variance of the own error [lanes]."""
        with np.errstate(all="ignore"):
            return np.asarray(self.share[int(self.rows.design.error_order[self.kind])] / _F(self.rows.design.functions))


def _reflection(x: Float32) -> Float32:
    """v with v^T v = 2, such that x - v (v^T x) has nothing behind its first entry [entries, lanes]."""
    size, head = np.sqrt(total(x * x)), x[0]
    negative = head < 0
    scale = _F(1) / np.sqrt(size * (size + np.where(negative, -head, head)))
    v = x.copy()
    v[0] = np.where(negative, head - size, head + size)
    return np.asarray(v * scale, np.float32)
