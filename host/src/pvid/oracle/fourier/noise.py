"""The noise of a window's rows: filters from the channels' symbolic derivatives, covariances by harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.model.signals import Integral, jets
from pvid.oracle.fourier.channels import Channels, Record, broadcast
from pvid.oracle.fourier.front import density
from pvid.oracle.fourier.functions import Float


@dataclass(frozen=True)
class Gain:
    """A sensor's noise n enters column `column` as sum chi^(order) gain(t) n."""

    column: int
    order: int
    values: Float


class NoiseFilters:
    """How the noise of each sensor enters the columns of each row kind, to first order, from the symbolic derivatives.

    D^m[psi(z, z')] with noise n in z: sum over d of (-1)^m (-D)^d [chi^(m) dpsi/dz^(d)] n. Running integrals smooth
    their noise away and are left out; so is what noise in a velocity does inside sgn but for the times of reversals.
    """

    def __init__(self, channels: Channels) -> None:
        self.channels = channels
        self.entries: list[tuple[int, str, int]] = []  # channel, sensor, order of the jet
        expressions: list[sp.Expr] = []
        auxiliary = {jet: expression for jet, expression in channels.opaque.items() if not expression.has(Integral)}
        for place, one in enumerate(channels.channels):
            if one.fold:
                continue
            full = one.gain.xreplace(auxiliary).xreplace(channels.sign_marks)
            for jet in sorted(jets(full), key=str):
                slope = sp.diff(full, jet)
                if slope != 0 and jet.of not in {a.of for a in channels.model.opaque}:
                    if channels.model.signal(jet.of).sd > 0:
                        self.entries.append((place, jet.of, jet.order))
                        expressions.append(slope)
        self._function = sp.lambdify(channels.plain, expressions, "numpy", cse=True)

    def gains(self, record: Record) -> list[dict[str, list[Gain]]]:
        """Of each row kind: sensor -> gains. (Nuisances are left out: their noise is second order.)"""
        size, design = record.grid.size, record.grid.design
        slopes = [broadcast(one, size) for one in self._function(*record.arguments)]
        smooth = max(design.rate_taps // (2 * design.decimation), 1)
        out = []
        for row in self.channels.rows:
            found: dict[tuple[str, int, int], Float] = {}
            for term in row.terms:
                if term.column > row.thetas:
                    continue
                for (place, sensor, depth), slope in zip(self.entries, slopes, strict=True):
                    if place != term.channel:
                        continue
                    # (-1)^m (-D)^d [chi^(m) g] = (-1)^(m + d) sum_i C(d, i) chi^(m + d - i) g^(i)
                    g = slope
                    for i in range(depth + 1):
                        factor = (-1.0) ** (term.order + depth) * float(sp.binomial(depth, i)) * term.factor
                        key = (sensor, term.column, term.order + depth - i)
                        found[key] = found.get(key, np.zeros(size)) + factor * g
                        g = slope_of(g, smooth, design.dt)
            of_row: dict[str, list[Gain]] = {}
            for (sensor, column, order), values in found.items():
                if values.any():
                    of_row.setdefault(sensor, []).append(Gain(column, order, values))
            out.append(of_row)
        return out


def slope_of(g: Float, reach: int, dt: float) -> Float:
    """Derivative over +-reach steps; at the ends over what there is."""
    if not np.any(g != g[0]):
        return np.zeros(g.shape)
    k = np.arange(len(g))
    high, low = np.minimum(k + reach, len(g) - 1), np.maximum(k - reach, 0)
    return np.asarray((g[high] - g[low]) / (dt * (high - low)))


class NoiseModel:
    """Covariances of the rows of a window, R0(p), and of neighbours, R1(p), for each row kind.

    With gains averaged over the run, R0 = sum over pairs of orders P_mn(theta) gram(m, n), gram from the harmonics.
    """

    def __init__(self, filters: NoiseFilters, record: Record) -> None:
        self.functions = record.grid.design.test_functions
        self.model = filters.channels.model
        self._pairs: list[list[tuple[Float, list[tuple[int, int]]]]] = []
        for sensors in filters.gains(record):
            of_row = []
            for sensor, gains in sensors.items():
                stack = np.array([one.values for one in gains])
                stack = stack[:, np.isfinite(stack).all(axis=0)]
                variance = density(self.model.signal(sensor), record.grid.design)
                of_row.append((variance * (stack @ stack.T) / stack.shape[1], [(g.column, g.order) for g in gains]))
            self._pairs.append(of_row)
        self._gram: dict[tuple[int, int], Float] = {}
        self._overlap: dict[tuple[int, int], Float] = {}

    def _of_orders(self, kind: int, theta: Float, other: Float | None = None) -> dict[tuple[int, int], float]:
        """Weights P of the pairs of orders at theta, with Y's factor -1 behind; `other` stands for it on one side."""
        left = np.append(theta, -1.0)
        right = left if other is None else other
        out: dict[tuple[int, int], float] = {}
        for products, places in self._pairs[kind]:
            a = np.array([left[column] for column, _ in places])
            b = np.array([right[column] for column, _ in places])
            weights = a[:, np.newaxis] * products * b
            for i, (_, m) in enumerate(places):
                for j, (_, n) in enumerate(places):
                    out[m, n] = out.get((m, n), 0.0) + float(weights[i, j])
        return out

    def gram(self, m: int, n: int) -> Float:
        """Of the test functions."""
        if (m, n) not in self._gram:
            self._gram[m, n] = self.functions.gram(m, n)
        return self._gram[m, n]

    def overlap(self, m: int, n: int) -> Float:
        """Of the test functions of neighbours."""
        if (m, n) not in self._overlap:
            self._overlap[m, n] = self.functions.overlap(m, n)
        return self._overlap[m, n]

    def covariance(self, kind: int, theta: Float) -> Float:
        """R0 [K, K] of a row kind."""
        k = self.functions.count
        return sum((w * self.gram(*mn) for mn, w in self._of_orders(kind, theta).items()), np.zeros((k, k)))

    def with_next(self, kind: int, theta: Float) -> Float:
        """R1 [K, K]: of a window's rows with the next one's."""
        k = self.functions.count
        return sum((w * self.overlap(*mn) for mn, w in self._of_orders(kind, theta).items()), np.zeros((k, k)))

    def slope(self, kind: int, theta: Float, entry: int) -> Float:
        """Half of dR0 / d theta_entry [K, K], up to its antisymmetric part."""
        unit = np.zeros(len(theta) + 1)
        unit[entry] = 1.0
        k = self.functions.count
        return sum((w * self.gram(*mn) for mn, w in self._of_orders(kind, theta, unit).items()), np.zeros((k, k)))


class ReversalNoise:
    """The errors of the located times of reversals in the rows of one kind.

    A time that is off by dt moves the sum of a test function times sgn(v) by 2 chi dt: one direction in the rows of
    each window that holds the reversal.

    Attributes
    ----------
    windows : of each entry, rising [entries]
    events : reversal of each entry [entries]
    shapes : 2 sd chi^(order) of the columns that hold sgn [entries, columns, K]
    """

    def __init__(self, channels: Channels, record: Record, kind: int) -> None:
        row, functions = channels.rows[kind], record.grid.design.test_functions
        auxiliary = dict(channels.opaque)
        count = row.thetas + 1
        windows, events, shapes = (
            [np.zeros(0, np.int64)],
            [np.zeros(0, np.int64)],
            [np.zeros((0, count, functions.count))],
        )
        first = 0
        for mark, signs in zip(channels.sign_marks.values(), record.signs, strict=True):
            full = [one.gain.xreplace(auxiliary).xreplace(channels.sign_marks) for one in channels.channels]
            holders = {k: sp.diff(one, mark) for k, one in enumerate(full) if one.has(mark)}
            terms = [term for term in row.terms if term.channel in holders and term.column <= row.thetas]
            if not len(signs.times) or not terms:
                continue
            slopes = sp.lambdify(channels.plain, list(holders.values()), "numpy", cse=True)(*record.arguments)
            at = np.clip(np.round(signs.times).astype(np.int64), 0, record.grid.size - 1)
            weight = {k: broadcast(one, record.grid.size)[at] for k, one in zip(holders, slopes, strict=True)}
            half = np.floor(signs.times / functions.hop).astype(np.int64)
            for back in (0, 1):
                window = half - back
                inside = (window >= 0) & (window < record.grid.size // functions.hop - 1)
                t = functions.dt * (signs.times - functions.hop * window)[inside]
                turns = np.exp(1j * np.outer(t, functions.rates))
                shape = np.zeros((len(t), count, functions.count))
                for term in terms:
                    rates = ((1j * functions.rates) ** term.order)[:, np.newaxis]
                    chi = np.real(turns @ (functions.coefficients * rates))
                    factor = (-1.0) ** term.order * term.factor * weight[term.channel][inside]
                    shape[:, term.column] += factor[:, np.newaxis] * chi
                windows.append(window[inside])
                events.append(first + np.flatnonzero(inside))
                shapes.append(2 * np.sqrt(signs.variances[inside])[:, np.newaxis, np.newaxis] * shape)
            first += len(signs.times)
        order = np.argsort(np.concatenate(windows), kind="stable")
        self.windows, self.events = np.concatenate(windows)[order], np.concatenate(events)[order]
        self.shapes = np.concatenate(shapes)[order]

    def directions(self, theta: Float) -> Float:
        """In the rows, one standard deviation long [entries, K]."""
        return np.asarray(np.einsum("ejk,j->ek", self.shapes, np.append(theta, -1.0)))

    def covariance(self, theta: Float, windows: npt.NDArray[np.int64]) -> Float:
        """Of each of some windows, by their numbers [windows, K, K]."""
        u = self.directions(theta)
        out = np.zeros((len(windows), u.shape[1], u.shape[1]))
        for k, window in enumerate(windows):
            own = u[self._of(window)]
            if len(own):
                out[k] = own.T @ own
        return out

    def with_next(self, theta: Float, windows: npt.NDArray[np.int64]) -> Float:
        """Of each of some windows with the one after it [windows, K, K]."""
        u = self.directions(theta)
        out = np.zeros((len(windows), u.shape[1], u.shape[1]))
        for k, window in enumerate(windows):
            here, next_ = self._of(window), self._of(window + 1)
            _, a, b = np.intersect1d(self.events[here], self.events[next_], return_indices=True)
            if len(a):
                out[k] = u[here][a].T @ u[next_][b]
        return out

    def _of(self, window: int) -> slice:
        """Entries of a window."""
        return slice(*np.searchsorted(self.windows, [window, window + 1]))
