"""The noise of a window's rows: filters from the channels' symbolic derivatives, covariances by harmonics."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.model.evaluation import numpy_function
from pvid.model.signals import Integral, Jet, jets
from pvid.oracle.weak.channels import Channels, Record, broadcast
from pvid.oracle.weak.front import density
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.walks import Walks
from pvid.oracle.weak.whitener import Holders, holders


@dataclass(frozen=True)
class Gain:
    """A sensor's noise n enters column `column` as sum chi^(order) gain(t) n."""

    column: int
    order: int
    values: Float


class NoiseFilters:
    """How the noise of each sensor enters the columns of each row kind, to first order, from the symbolic derivatives.

    D^m[psi(z, z')] with noise n in z: sum over d of (-1)^m (-D)^d [chi^(m) dpsi/dz^(d)] n. In an integral since the
    start of the run d is negative: it walks. Integrals from the start of a window smooth their noise away and are left
    out. Noise of a velocity enters through a soft sign by its slope; where reversals are located it is in their times
    (`ReversalNoise`).
    """

    def __init__(self, channels: Channels) -> None:
        self.channels = channels
        marks = channels.sign_marks.values()
        self._arguments = dict(zip(marks, channels.signs, strict=True))
        self._sign_slopes = {mark: sp.Symbol(f"slope_of_{mark}", real=True) for mark in marks}
        self.entries: list[tuple[int, str, int]] = []  # channel, sensor, order of the jet
        expressions: list[sp.Expr] = []
        integrals = {jet: expression for jet, expression in channels.opaque.items() if expression.has(Integral)}
        auxiliary = {jet: expression for jet, expression in channels.opaque.items() if jet not in integrals}
        for place, one in enumerate(channels.channels):
            if one.fold:
                continue
            full = one.gain.xreplace(auxiliary).xreplace(channels.sign_marks)
            inside = {mark: sp.diff(full, mark) * slope for mark, slope in self._sign_slopes.items() if full.has(mark)}
            arguments = {mark: argument for mark, argument in self._arguments.items() if mark in inside}
            for jet in sorted(jets(full).union(*(jets(one) for one in arguments.values())), key=str):
                slope = sp.diff(full, jet)
                slope += sum(inside[mark] * sp.diff(argument, jet) for mark, argument in arguments.items())
                if slope != 0 and jet.of not in {a.of for a in channels.model.opaque}:
                    if channels.model.signal(jet.of).sd > 0:
                        self.entries.append((place, jet.of, jet.order))
                        expressions.append(slope)
            for jet, expression in integrals.items():
                for inner, depth, slope in _within(expression) if full.has(jet) else ():
                    if channels.model.signal(inner.of).sd > 0:
                        self.entries.append((place, inner.of, depth))
                        expressions.append(sp.diff(full, jet) * slope)
        given = (*channels.plain, *self._sign_slopes.values())
        self._function = numpy_function(given, expressions)

    def gains(self, record: Record) -> list[dict[str, list[Gain]]]:
        """Of each row kind: sensor -> gains. (Nuisances are left out: their noise is second order.)"""
        size, design, parts = record.grid.size, record.grid.design, record.grid.parts
        slopes = [
            broadcast(one, size) for one in self._function(*record.arguments, *(one.slopes for one in record.signs))
        ]
        smooth = max(design.rate_taps // (2 * design.decimation), 1)
        chains = []
        for (_, _, depth), slope in zip(self.entries, slopes, strict=True):
            chain = [slope]
            for _ in range(max(depth, 0)):
                slopes_of_parts = [slope_of(chain[-1][part], smooth, design.dt) for part in parts]
                chain.append(slopes_of_parts[0] if len(parts) == 1 else np.concatenate(slopes_of_parts))
            chains.append(chain)
        out = []
        for row in self.channels.rows:
            found: dict[tuple[str, int, int], Float] = {}
            for term in row.terms:
                if term.column > row.thetas:
                    continue
                for (place, sensor, depth), chain in zip(self.entries, chains, strict=True):
                    if place != term.channel:
                        continue
                    # (-1)^m (-D)^d [chi^(m) g] = (-1)^(m + d) sum_i C(d, i) chi^(m + d - i) g^(i)
                    for i, g in enumerate(chain):
                        binomial = float(sp.binomial(depth, i)) if i else 1.0
                        factor = (-1.0) ** (term.order + depth) * binomial * term.factor
                        key = (sensor, term.column, term.order + depth - i)
                        share = factor * g
                        found[key] = found[key] + share if key in found else share
            of_row: dict[str, list[Gain]] = {}
            for (sensor, column, order), values in found.items():
                if values.any():
                    of_row.setdefault(sensor, []).append(Gain(column, order, values))
            out.append(of_row)
        return out


def slope_of(g: Float, reach: int, dt: float) -> Float:
    """Derivative over +-reach steps; at the ends over what there is."""
    if g.strides == (0,) or not np.any(g != g[0]):
        return np.zeros(g.shape)
    k = np.arange(len(g))
    high, low = np.minimum(k + reach, len(g) - 1), np.maximum(k - reach, 0)
    return np.asarray((g[high] - g[low]) / (dt * (high - low)))


def _within(expression: sp.Expr) -> list[tuple[Jet, int, sp.Expr]]:
    """Jets in a signal that is made of running integrals, how often each is differentiated (negative: integrated), and
    the signal's slope; of an integral inside a curve nothing. Of an integrand that is no line it is the slope at the
    time of the row, not of the sample: an approximation."""
    marks = {one: sp.Dummy() for one in sorted(expression.atoms(Integral), key=sp.default_sort_key)}
    outside = expression.xreplace(marks)
    found = [(jet, jet.order, sp.diff(outside, jet)) for jet in sorted(jets(outside), key=str)]
    for one, mark in marks.items():
        integrand, fold = one.args
        inside = sorted(jets(integrand), key=str)
        found += [(jet, jet.order - int(fold), sp.diff(outside, mark) * sp.diff(integrand, jet)) for jet in inside]
    return [one for one in found if not one[2].free_symbols & set(marks.values())]


class NoiseModel:
    """Covariances of the rows of a window, R0(p), and of neighbours, R1(p), of each pair of row kinds.

    With gains averaged over the run, R0 = sum over pairs of orders P_mn(theta) gram(m, n), gram from the harmonics.

    The noise in an integral since the start of the run is that of the window, of negative order, and a walk up to its
    start, which all later windows have in common: in a window of the weights it has the trace of its covariance over
    all windows, which is no less than its largest eigenvalue. Independent windows with that have larger errors than
    those that walk, whatever the motion.
    """

    def __init__(self, filters: NoiseFilters, record: Record) -> None:
        self.functions = record.grid.design.test_functions
        self._walks = Walks(self.functions, record.grid.parts)
        of_kinds = filters.gains(record)
        self._columns = max(row.thetas + 1 for row in filters.channels.rows)
        self._sensors: list[_SensorGains] = []
        for sensor in sorted(set().union(*of_kinds)):
            own = [(kind, self._numbered(gain)) for kind, row in enumerate(of_kinds) for gain in row.get(sensor, [])]
            stack = np.array([gain.values for _, gain in own])
            there = np.isfinite(stack).all(axis=0)
            stack = stack if there.all() else stack[:, there]
            variance = density(filters.channels.model.signal(sensor), record.grid.design)
            self._sensors.append(
                _SensorGains(
                    variance * (stack @ stack.T) / stack.shape[1],
                    np.array([kind for kind, _ in own]),
                    np.array([gain.column for _, gain in own]),
                    np.array([gain.order for _, gain in own]),
                )
            )
        self._orders = len(self._walks) + 1 + max((int(np.max(one.orders)) for one in self._sensors), default=0)
        self._pairs: dict[tuple[int, int], list[_Pairs]] = {}

    def _numbered(self, gain: Gain) -> Gain:
        """One of a negative order as a walk's, whose kernel holds the values."""
        if gain.order >= 0:
            return gain
        self._walks.add(-gain.order, gain.values)
        return Gain(gain.column, -len(self._walks), np.ones(gain.values.shape))

    def _of_orders(self, a: int, theta_a: Float, b: int, theta_b: Float, of_y: float = -1.0) -> Float:
        """Weights P of the pairs of orders of two kinds [orders, orders]."""
        left, right = np.append(theta_a, of_y), np.append(theta_b, of_y)
        out = np.zeros(self._orders**2)
        for one in self._pairs_of(a, b):
            weights = left[one.first][:, np.newaxis] * one.products * right[one.second]
            out += np.bincount(one.places, weights.reshape(-1), len(out))
        return out.reshape(self._orders, self._orders)

    def _pairs_of(self, a: int, b: int) -> list[_Pairs]:
        """Pairs of gains of two kinds, of each sensor."""
        if (a, b) not in self._pairs:
            found = []
            for one in self._sensors:
                i, j = np.flatnonzero(one.kinds == a), np.flatnonzero(one.kinds == b)
                left, right = one.orders[i] + len(self._walks), one.orders[j] + len(self._walks)
                places = left[:, np.newaxis] * self._orders + right
                found.append(_Pairs(one.columns[i], one.columns[j], one.products[np.ix_(i, j)], places.reshape(-1)))
            self._pairs[a, b] = found
        return self._pairs[a, b]

    def of_harmonics(self, kind: int) -> Float:
        """P [powers, columns, columns] with D_h = sum_j omega_h^(2 j) theta^T P_j theta, theta = -1 for Y's column.

        D_h is the variance a step of the noise at harmonic h. It is that of `covariance`, because gram(m, n) is
        (-1)^((m - n)/2) times the one of m + n halved, and those of odd sums cancel. That of running integrals is left
        out.
        """
        out = np.zeros((self._orders - len(self._walks), self._columns, self._columns))
        for one in self._sensors:
            own = np.flatnonzero(one.kinds == kind)
            for i in own:
                for j in own:
                    m, n = int(one.orders[i]), int(one.orders[j])
                    if (m + n) % 2 == 0 and min(m, n) >= 0:
                        sign = (-1.0) ** ((m - n) // 2)
                        out[(m + n) // 2, one.columns[i], one.columns[j]] += sign * one.products[i, j]
        return out

    def covariance(self, a: int, theta_a: Float, b: int, theta_b: Float, of_y: float = -1.0) -> Float:
        """R0 [K, K] of two row kinds in one window; with of_y 0, of what a change of their thetas adds to the rows."""
        with np.errstate(over="ignore", invalid="ignore"):  # an iteration that runs away is judged by its residuals
            return np.tensordot(self._of_orders(a, theta_a, b, theta_b, of_y), self._grams)

    def with_next(self, a: int, theta_a: Float, b: int, theta_b: Float) -> Float:
        """R1 [K, K]: of the rows of a kind with those of another in the next window."""
        return np.tensordot(self._of_orders(a, theta_a, b, theta_b), self._overlaps)

    def within(self, a: int, b: int, weight: Float) -> Float:
        """tr(weight E[n_i n_j^T]) of the noises n_i in each column of kind a and n_j in each of kind b
        [columns, columns]; weight [K, K] stands at the rows of a and b."""
        out = np.zeros(self._columns**2)
        traces = np.einsum("mnkl,kl->mn", self._grams_of_run, weight, optimize=True).reshape(-1)
        for one in self._pairs_of(a, b):
            shares = one.products.reshape(-1) * traces[one.places]
            places = one.first[:, np.newaxis] * self._columns + one.second
            out += np.bincount(places.reshape(-1), shares, len(out))
        return out.reshape(self._columns, self._columns)

    def pull(self, a: int, b: int, theta_b: Float, weight: Float) -> Float:
        """1/2 tr(weight dR0/d theta) with the thetas of kind a; weight as of `within`."""
        right = np.append(theta_b, -1.0)
        return np.asarray(self.within(a, b, weight)[:, : len(right)] @ right)

    def size(self, kind: int, theta: Float) -> float:
        """Sum of squares of the noise in the rows of a kind in one window, on average over the run."""
        weight = np.eye(self.functions.count)
        of_y = np.append(theta, -1.0)
        return float(of_y @ self.within(kind, kind, weight)[: len(of_y), : len(of_y)] @ of_y)

    @cached_property
    def _grams(self) -> Float:
        """Of all pairs of orders [orders, orders, K, K]; of a walk its sum over the windows."""
        return self._of_run(1)

    @cached_property
    def _grams_of_run(self) -> Float:
        """The same with the mean of a walk."""
        return self._of_run(0) if len(self._walks) else self._grams

    def _of_run(self, windows: int) -> Float:
        out = self._of_all(self.functions.gram, self._walks.gram)
        walks = range(len(self._walks))
        for m, n in itertools.product(walks, walks):
            out[m, n] += self._walks.before(m - len(walks), n - len(walks), windows)
        return out

    @cached_property
    def _overlaps(self) -> Float:
        """The same of neighbours, within the half that they share."""
        return self._of_all(self.functions.overlap, self._walks.overlap)

    def _of_all(self, plain: Callable[[int, int], Float], of_walks: Callable[[int, int], Float]) -> Float:
        orders = range(-len(self._walks), self._orders - len(self._walks))
        return np.array([[(plain if min(m, n) >= 0 else of_walks)(m, n) for n in orders] for m in orders])


@dataclass(frozen=True)
class _SensorGains:
    """Mean products of the gains of one sensor [gains, gains] times its noise, and where each gain belongs."""

    products: Float
    kinds: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int64]
    orders: npt.NDArray[np.int64]


@dataclass(frozen=True)
class _Pairs:
    """Pairs of gains of one sensor in two kinds [gains, gains]: their columns, mean products, and flat places in a
    table of the pairs of orders."""

    first: npt.NDArray[np.int64]
    second: npt.NDArray[np.int64]
    products: Float
    places: npt.NDArray[np.int64]


class ReversalNoise:
    """The errors of the located times of reversals in the rows.

    A time that is off by dt moves the sum of a test function times sgn(v) by 2 chi dt: one direction in the rows of
    each window that holds the reversal.

    Attributes
    ----------
    windows : of each entry, rising [entries]; an entry is a reversal in one of the two windows that hold it
    events : reversal of each entry [entries]
    columns : of each row kind, those that hold sgn
    shapes : of each row kind, 2 sd chi^(order) of these [entries, columns, K]
    """

    def __init__(self, channels: Channels, record: Record) -> None:
        functions = record.grid.design.test_functions
        auxiliary = dict(channels.opaque)
        full = [one.gain.xreplace(auxiliary).xreplace(channels.sign_marks) for one in channels.channels]
        windows, events = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        shapes = [[np.zeros((0, row.thetas + 1, functions.count))] for row in channels.rows]
        first = 0
        for mark, signs in zip(channels.sign_marks.values(), record.signs, strict=True):
            holders = {k: sp.diff(one, mark) for k, one in enumerate(full) if one.has(mark)}
            if not len(signs.times) or not holders:
                continue
            slopes = numpy_function(channels.plain, list(holders.values()))(*record.arguments)
            at = np.clip(np.round(signs.times).astype(np.int64), 0, record.grid.size - 1)
            weight = {k: broadcast(one, record.grid.size)[at] for k, one in zip(holders, slopes, strict=True)}
            half = np.floor(signs.times / functions.hop).astype(np.int64)
            for back in (0, 1):
                window = half - back
                inside = (window >= 0) & (window < record.grid.size // functions.hop - 1)
                t = functions.dt * (signs.times - functions.hop * window)[inside]
                turns = np.exp(1j * np.outer(t, functions.rates))
                scale = 2 * np.sqrt(signs.variances[inside])
                for row, own in zip(channels.rows, shapes, strict=True):
                    shape = np.zeros((len(t), row.thetas + 1, functions.count))
                    for term in row.terms:
                        if term.channel not in holders or term.column > row.thetas:
                            continue
                        rates = ((1j * functions.rates) ** term.order)[:, np.newaxis]
                        chi = np.real(turns @ (functions.coefficients * rates))
                        factor = (-1.0) ** term.order * term.factor * weight[term.channel][inside] * scale
                        shape[:, term.column] += factor[:, np.newaxis] * chi
                    own.append(shape)
                windows.append(window[inside])
                events.append(first + np.flatnonzero(inside))
            first += len(signs.times)
        order = np.argsort(np.concatenate(windows), kind="stable")
        self.windows, self.events = np.concatenate(windows)[order], np.concatenate(events)[order]
        whole = [np.concatenate(own)[order] for own in shapes]
        self.columns = [np.flatnonzero(own.any(axis=(0, 2))) for own in whole]
        self._thetas = [row.thetas for row in channels.rows]
        self.shapes = [own[:, columns] for own, columns in zip(whole, self.columns, strict=True)]

    def directions(self, kinds: Sequence[int], theta: Sequence[Float]) -> Float:
        """In the rows of some kinds, one standard deviation long [entries, K of each kind]."""
        return np.concatenate(
            [
                np.einsum("ejk,j->ek", self.shapes[kind], np.append(theta[kind], -1.0)[self.columns[kind]])
                for kind in kinds
            ],
            axis=1,
        )

    def holders(self, kinds: Sequence[int], numbers: npt.NDArray[np.int64]) -> list[Holders]:
        """Which of some windows, by their numbers, hold which entries that stand in the rows of some kinds."""
        there = np.any([self.shapes[kind].any(axis=(1, 2)) for kind in kinds], axis=0)
        there &= np.isin(self.windows, numbers)
        entries = np.flatnonzero(there)
        return holders(np.searchsorted(numbers, self.windows[entries]), entries)

    def slopes(self, kinds: Sequence[int], entries: npt.NDArray[np.int64], pulled: Float) -> Float:
        """1/2 tr(R^-1 d covariance / d theta) over some windows [thetas of the kinds].

        Parameters
        ----------
        pulled : R^-1 times the directions of these entries [n, R]
        """
        k = self.shapes[0].shape[2]
        out = [np.zeros(self._thetas[kind] + 1) for kind in kinds]
        for place, (kind, own) in enumerate(zip(kinds, out, strict=True)):
            pull = pulled[:, place * k : (place + 1) * k]
            own[self.columns[kind]] = np.einsum("ejk,ek->j", self.shapes[kind][entries], pull)
        return np.concatenate([own[:-1] for own in out])

    def shared(self, entries: npt.NDArray[np.int64], scores: Float) -> Float:
        """Sum over the reversals that two neighbours hold of the earlier's score times the later's [n, n].

        Parameters
        ----------
        scores : of these entries [entries, n]
        """
        order = np.lexsort((self.windows[entries], self.events[entries]))
        entries, own = entries[order], scores[order]
        pairs = np.flatnonzero(self.events[entries][1:] == self.events[entries][:-1])
        return np.asarray(own[pairs].T @ own[pairs + 1])
