"""Channels of a model: what is summed over a window, once each, and the table that makes columns of the sums.

A channel is gain(signals) I^n[integrand(signals)]; most have n = 0. A column (N_j, Y or a nuisance) is
sum_terms factor (-1)^order sum chi^(order) channel.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Part
from pvid.model.evaluation import numpy_function
from pvid.model.signals import TIME, Integral, Jet, jets, sgn
from pvid.oracle.weak import reversals
from pvid.oracle.weak.filters import polynomial_weights
from pvid.oracle.weak.front import Grid, filtered
from pvid.oracle.weak.functions import Float, TestFunctions

_ONE = sp.Integer(1)

# A sign in doubt is one direction in the rows while the fastest test function turns by less than this [rad].
_PIECE = 0.5
_KEPT = 8  # located signs


@dataclass(frozen=True)
class Channel:
    """gain I^fold[integrand]; fold 0: the gain alone."""

    gain: sp.Expr
    integrand: sp.Expr = _ONE
    fold: int = 0


@dataclass(frozen=True)
class Term:
    """column += factor D^order[channel]; both are places in their lists."""

    order: int
    channel: int
    column: int
    factor: float


@dataclass(frozen=True)
class RowPlan:
    """Terms of one row kind. Columns: theta's in order, then Y, then the nuisances."""

    name: str
    terms: tuple[Term, ...]
    thetas: int
    nuisances: int

    @property
    def columns(self) -> int:
        """With Y and the nuisances."""
        return self.thetas + 1 + self.nuisances


def split(psi: sp.Expr, row: str) -> list[tuple[float, Channel]]:
    """psi as a sum of factors times channels."""
    out = []
    for addend in sp.Add.make_args(sp.expand(psi)):
        factor, rest = addend.as_coeff_Mul()
        integrals = sorted(rest.atoms(Integral), key=str)
        power = sp.Poly(rest, TIME).degree() if rest.has(TIME) and not integrals else 0
        if integrals:
            gain = sp.cancel(rest / integrals[0]) if len(integrals) == 1 else rest
            if gain.has(Integral) or gain.has(TIME):
                raise PvidError(f"row {row}: {rest} is not linear in one running integral, which no window can sum")
            out.append((float(factor), Channel(gain, integrals[0].args[0], int(integrals[0].args[1]))))
        elif power:
            gain = sp.cancel(rest / TIME**power)
            if gain.has(TIME):
                raise PvidError(f"row {row}: {rest} is not a polynomial of the time")
            out.append((float(factor * sp.factorial(power)), Channel(gain, _ONE, power)))
        elif rest != 0:
            out.append((float(factor), Channel(rest)))
    return out


class Channels:
    """The channels of a model and its rows' tables.

    Attributes
    ----------
    model : its knowns have their values
    channels : distinct ones, of all rows
    rows : a plan each
    """

    def __init__(self, model: CompiledModel) -> None:
        self.model = model
        self.last: Record | None = None  # of a run: what another one has in common is taken from it
        self._located: dict[tuple[object, ...], reversals.Signs] = {}
        self._positions: dict[tuple[object, ...], tuple[reversals.Position, Float]] = {}
        self._of_changed: dict[frozenset[str], tuple[list[int], Any]] = {}
        found: dict[Channel, int] = {}
        plans = []
        for row in model.rows:
            terms: dict[tuple[int, int, int], float] = {}
            parts: Sequence[Part] = [*row.regressors, row.known, *row.nuisances]
            for column, part in enumerate(parts):
                for order, psi in part.items():
                    for factor, channel in split(model.with_knowns(sp.sympify(psi)), row.name):
                        key = (order, found.setdefault(channel, len(found)), column)
                        terms[key] = terms.get(key, 0.0) + factor
            plans.append(
                RowPlan(
                    row.name,
                    tuple(Term(*key, factor) for key, factor in terms.items()),
                    len(row.theta),
                    len(row.nuisances),
                )
            )
        self.channels = tuple(found)
        self.rows = tuple(plans)

    @cached_property
    def top(self) -> int:
        """Highest order of the rows."""
        return max((term.order for row in self.rows for term in row.terms), default=0)

    def rows_top(self, kind: int) -> int:
        """Highest order of one row kind."""
        return max((term.order for term in self.rows[kind].terms), default=0)

    @cached_property
    def expressions(self) -> tuple[sp.Expr, ...]:
        """All gains, then all integrands."""
        return tuple(one.gain for one in self.channels) + tuple(one.integrand for one in self.channels)

    @cached_property
    def opaque(self) -> dict[Jet, sp.Expr]:
        """The auxiliary signals in the rows."""
        used = set().union(*(jets(one) for one in self.expressions))
        return {
            jet: self.model.with_knowns(expression)
            for jet, expression in self.model.opaque.items()
            if any(one.of == jet.of for one in used)
        }

    @cached_property
    def signs(self) -> tuple[sp.Expr, ...]:
        """Arguments of sgn, in a fixed order."""
        atoms = set().union(*(one.atoms(sgn) for one in (*self.expressions, *self.opaque.values())))
        return tuple(sorted({one.args[0] for one in atoms}, key=str))

    @cached_property
    def signs_of_rows(self) -> list[set[int]]:
        """Places of the signs in each row kind, those of its auxiliary signals included."""

        def within(one: sp.Expr) -> set[int]:
            inside = one.xreplace(dict(self.opaque))
            return {place for place, argument in enumerate(self.signs) if inside.has(sgn(argument))}

        own = [within(one.gain) | within(one.integrand) for one in self.channels]
        return [set().union(*(own[term.channel] for term in row.terms)) for row in self.rows]

    @cached_property
    def needed(self) -> set[Jet]:
        """Jets of signals that the channels, auxiliary signals and signs need."""
        found = set().union(*(jets(one) for one in (*self.expressions, *self.opaque.values(), *self.signs)))
        auxiliary = {jet.of for jet in self.model.opaque}
        wrong = sorted(str(jet) for jet in found if jet.of in auxiliary and jet.order > 0)
        if wrong:
            raise PvidError(
                f"the derivative {wrong[0]} of an auxiliary signal stands in a channel: it cannot be formed"
            )
        return {jet for jet in found if jet.of not in auxiliary}

    @cached_property
    def sign_marks(self) -> dict[sp.Expr, sp.Symbol]:
        """sgn(argument) -> its symbol in code."""
        return {sgn(one): sp.Symbol(f"sgn_of_{place}", real=True) for place, one in enumerate(self.signs)}

    @cached_property
    def plain(self) -> tuple[sp.Symbol, ...]:
        """Arguments of the functions below: jets, auxiliary signals, signs."""
        return (*sorted(self.needed, key=str), *self.opaque, *self.sign_marks.values())

    def function(self, expressions: Sequence[sp.Expr]) -> Any:
        """A numpy function of `plain`."""
        return numpy_function(self.plain, [one.xreplace(self.sign_marks) for one in expressions])

    @cached_property
    def _values(self) -> Any:
        return self.function(self.expressions)

    def _auxiliary(self, values: dict[sp.Symbol, Float], grid: Grid) -> None:
        """Adds the auxiliary signals; a running integral in one of them begins at the run's first sample."""
        for jet, expression in self.opaque.items():
            known = dict(values)
            for place, one in enumerate(sorted(expression.atoms(Integral), key=sp.default_sort_key)):
                mark = sp.Dummy("integral", dummy_index=place)
                integrand, fold = one.args
                inside = broadcast(evaluated(integrand.xreplace(self.sign_marks), known), grid.size)
                known[mark] = running_integrals(inside, grid.size - 1, int(fold), grid.design.dt)[int(fold)][0]
                if fold == 1:
                    known[mark] = known[mark] + self._before(integrand, grid, inside)
                expression = expression.xreplace({one: mark})
            values[jet] = broadcast(evaluated(expression.xreplace(self.sign_marks), known), grid.size)

    def _before(self, integrand: sp.Expr, grid: Grid, inside: Float) -> float:
        """Integral from the run's first sample to the first step, from raw samples; else by the first step's value."""
        last, rate = int(grid.places[0]), grid.design.sample_rate
        if any(jet.order or jet.of not in grid.raw for jet in jets(integrand)) or integrand.has(sgn):
            return float(inside[0]) * last / rate
        raw = {jet: grid.raw[jet.of][: last + 1] for jet in jets(integrand)}
        f = broadcast(evaluated(integrand, raw), last + 1)
        return float(np.sum(f[1:] + f[:-1])) / (2 * rate)

    @cached_property
    def _sign_arguments(self) -> Any:
        return numpy_function(sorted(self.needed, key=str), list(self.signs))

    @cached_property
    def rates(self) -> set[Jet]:
        """Derivatives of signals that terms contain otherwise than in signs."""
        inside = (one for channel in self.channels for one in (channel.gain, channel.integrand))
        plain = (one.xreplace(dict.fromkeys(one.atoms(sgn), _ONE)) for one in inside)
        return {jet for one in plain for jet in jets(one) if jet.order} & self.needed

    @cached_property
    def _signals(self) -> dict[sp.Symbol, frozenset[str]]:
        """By auxiliary signal and by mark of a sign: signals that it depends on."""
        found: dict[sp.Symbol, frozenset[str]] = {}
        for jet, expression in self.opaque.items():
            found[jet] = self._signals_of(expression, found)
        marks = zip(self.signs, self.sign_marks.values(), strict=True)
        return found | {mark: self._signals_of(one, found) for one, mark in marks}

    @staticmethod
    def _signals_of(expression: sp.Expr, auxiliary: Mapping[sp.Symbol, frozenset[str]]) -> frozenset[str]:
        return frozenset().union(*(auxiliary.get(jet, frozenset({jet.of})) for jet in jets(expression)))

    def _values_of(self, changed: frozenset[str]) -> tuple[list[int], Any]:
        """Places of the expressions that depend on these signals, and their function."""
        if changed not in self._of_changed:
            auxiliary = self._signals
            own = [k for k, one in enumerate(self.expressions) if changed & self._signals_of(one, auxiliary)]
            self._of_changed[changed] = own, self.function([self.expressions[k] for k in own])
        return self._of_changed[changed]

    def record_like(self, grid: Grid, like: Record) -> Record:
        """Values of all channels at the steps of a grid; those in which it does not differ from another record's are
        taken from there."""
        alike = grid.design == like.grid.design or not (self.signs or self.opaque)
        if not alike or not np.array_equal(grid.places, like.grid.places):
            return self.record(grid)
        changed = frozenset(jet.of for jet in self.needed if grid.jets[jet] is not like.grid.jets[jet])
        moved = {mark for mark, names in self._signals.items() if names & changed}
        ordered = [grid.jets[jet] for jet in sorted(self.needed, key=str)]
        of_signs = zip(self.signs, self.sign_marks.values(), self._sign_arguments(*ordered), like.signs, strict=True)
        signs = [
            self._signs(grid, argument, broadcast(v, grid.size)) if mark in moved else one
            for argument, mark, v, one in of_signs
        ]
        values: dict[sp.Symbol, Float] = dict(zip(self.plain, like.arguments, strict=True)) | dict(grid.jets)
        values |= {mark: one.values for mark, one in zip(self.sign_marks.values(), signs, strict=True)}
        if moved.intersection(self.opaque):
            self._auxiliary(values, grid)
        arguments = [values[one] for one in self.plain]
        places, function = self._values_of(changed)
        whole, count = [*like.gains, *like.integrands], len(self.channels)
        for place, x in zip(places, function(*arguments) if places else (), strict=True):
            whole[place] = broadcast(x, grid.size)
        fresh = sorted({place % count for place in places})
        return Record(self, grid, whole[:count], whole[count:], tuple(signs), arguments, (like, fresh))

    def record(self, grid: Grid, times: Mapping[Jet, float] | None = None) -> Record:
        """Values of all channels at the steps of a grid; `times`: with these jets so many times as large, but for the
        signs."""
        ordered = [grid.jets[jet] for jet in sorted(self.needed, key=str)]
        signs = [
            self._signs(grid, argument, broadcast(values, grid.size))
            for argument, values in zip(self.signs, self._sign_arguments(*ordered), strict=True)
        ]
        values = dict(zip(self.plain, ordered, strict=False))
        values |= {jet: factor * grid.jets[jet] for jet, factor in (times or {}).items()}
        values |= {mark: one.values for mark, one in zip(self.sign_marks.values(), signs, strict=True)}
        self._auxiliary(values, grid)
        arguments = [values[one] for one in self.plain]
        whole = [broadcast(one, grid.size) for one in self._values(*arguments)]
        count = len(self.channels)
        return Record(self, grid, whole[:count], whole[count:], tuple(signs), arguments)

    @cached_property
    def _sign_slopes(self) -> dict[sp.Expr, dict[Jet, sp.Expr]]:
        """Derivatives of each argument by its jets."""
        return {one: {jet: sp.diff(one, jet) for jet in jets(one)} for one in self.signs}

    def _signs(self, grid: Grid, argument: sp.Expr, v: Float) -> reversals.Signs:
        design = grid.design
        if design.reversals == "soft":
            return reversals.soft(v, design.soft)
        of_core = design.reversals in ("averaged", "decided")
        weights = self._sign_slopes[argument]
        straight = all(one.is_number for one in weights.values()) and all(jet.order == 1 for jet in weights)
        gain = design.weights(1)
        per_sensor = float(np.sum(gain**2)) ** 0.5
        piece = max(2, round(_PIECE * 2 * design.hop / (2 * np.pi * design.highest)))
        if straight:
            position = sum((float(one) * grid.raw[jet.of] for jet, one in weights.items()), np.zeros(1))
            sd = sum(float(one) ** 2 * self.model.signal(jet.of).sd ** 2 for jet, one in weights.items()) ** 0.5
            same = hashlib.blake2b()
            for one in (v, position, gain):
                same.update(np.ascontiguousarray(one).data)
            degrees = (design.rate_taps, design.rate_degree, design.degree)
            # Many changes of another signal, and of the design, leave the motion as it is.
            key = (sd, degrees, design.decimation, int(grid.places[0]), same.digest())
            if key not in self._positions:
                half = max(len(gain) // 2, 6)
                raw = reversals.Position(position, grid.places, half, sd)
                self._positions[key] = raw, blur_of(position, grid, v)
                while len(self._positions) > _KEPT:
                    del self._positions[next(iter(self._positions))]
            raw, blur = self._positions[key]
            if of_core:
                return reversals.averaged(v, sd * per_sensor, blur)
            if (*key, piece) not in self._located:
                self._located[*key, piece] = reversals.located(v, sd * per_sensor, blur, piece, raw)
                while len(self._located) > _KEPT:
                    del self._located[next(iter(self._located))]
            return self._located[*key, piece]
        variance = 0.0
        for jet, one in weights.items():
            if not jet.order and design.reversals == "decided":
                continue  # the limits of doubt in C are of derivatives alone
            slope = self.function([one])(*[grid.jets.get(x, 0.0) for x in self.plain])[0]
            of_signal = float(np.sum(design.weights(jet.order) ** 2)) * self.model.signal(jet.of).sd ** 2
            variance += float(np.mean(np.square(slope))) * of_signal
        if of_core:
            return reversals.averaged(v, variance**0.5, np.zeros(v.shape))
        return reversals.located(v, variance**0.5, np.zeros(v.shape), piece)


def blur_of(position: Float, grid: Grid, v: Float) -> Float:
    """How far the smoothing of a velocity may be off [n]: its distance from that of twice the length, near by."""
    taps = len(grid.design.weights(1))
    degree = grid.design.rate_degree if grid.design.rate_taps > 1 else grid.design.degree
    if len(position) <= 4 * taps:
        return np.zeros(v.shape)
    long = filtered(position, polynomial_weights(2 * taps + 1, degree, 1) * grid.design.sample_rate)[grid.places]
    off = np.abs(long - v)
    off[grid.places < taps] = 0.0
    off[grid.places >= len(position) - taps] = 0.0
    reach = max(taps // (4 * grid.design.decimation), 1)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(off, reach), 2 * reach + 1)
    return np.asarray(np.fmax.reduce(near, axis=1))


def evaluated(expression: sp.Expr, values: dict[sp.Symbol, Float]) -> Any:
    """An expression at values of its symbols."""
    symbols = sorted(expression.free_symbols, key=str)
    return numpy_function(symbols, expression)(*[values[one] for one in symbols])


def broadcast(x: Any, size: int) -> Float:
    """An array [size] of what a generated function returned: an array or a number."""
    return np.broadcast_to(np.asarray(x, np.float64), (size,))


class Record:
    """A run's channels: values at every step.

    Attributes
    ----------
    channels : of the model
    grid : the run's steps
    gains : [channels, n]
    integrands : of each channel [n]
    signs : of each argument of sgn
    arguments : values of `channels.plain`
    like : another record, and the channels that differ from its own
    """

    def __init__(
        self,
        channels: Channels,
        grid: Grid,
        gains: list[Float],
        integrands: list[Float],
        signs: tuple[reversals.Signs, ...],
        arguments: list[Float],
        like: tuple[Record, list[int]] | None = None,
    ) -> None:
        self.channels, self.grid, self.gains, self.integrands = channels, grid, gains, integrands
        self.signs, self.arguments = signs, arguments
        self._fresh: Sequence[int] = range(len(gains)) if like is None else like[1]
        # Test functions, sums of every channel, and rows of some, by channel and order.
        self._known: tuple[TestFunctions | None, list[Float], dict[tuple[int, int], Float]]
        self._known = (None, [], {}) if like is None else like[0]._known

    @classmethod
    def joined(cls, records: Sequence[Record], firsts: Sequence[int], samples: int) -> Record:
        """Of a run of so many samples from those of its segments, which begin at `firsts`."""
        if len(records) == 1 and records[0].grid.raw_size == samples:
            return records[0]
        hop = records[0].grid.design.hop
        sizes = [one.grid.size // hop * hop for one in records[:-1]] + [records[-1].grid.size]
        ends = np.cumsum(sizes)
        starts = ends - sizes
        cut = [slice(0, size) for size in sizes]

        def together(arrays: Iterable[Float]) -> Float:
            return np.concatenate([one[part] for one, part in zip(arrays, cut, strict=True)])

        grids = [one.grid for one in records]
        raw = {name: np.full(samples, np.nan) for name in grids[0].raw}
        for grid, first in zip(grids, firsts, strict=True):
            for name, values in grid.raw.items():
                raw[name][first : first + len(values)] = values
        jets = {jet: together(grid.jets[jet] for grid in grids) for jet in grids[0].jets}
        places = np.concatenate(
            [grid.places[part] + first for grid, part, first in zip(grids, cut, firsts, strict=True)]
        )
        parts = tuple(slice(int(first), int(end)) for first, end in zip(starts, ends, strict=True))
        return cls(
            records[0].channels,
            Grid(grids[0].design, jets, raw, places, parts),
            [together(one.gains[k] for one in records) for k in range(len(records[0].gains))],
            [together(one.integrands[k] for one in records) for k in range(len(records[0].integrands))],
            tuple(reversals.joined([one.signs[k] for one in records], sizes) for k in range(len(records[0].signs))),
            [together(one.arguments[k] for one in records) for k in range(len(records[0].arguments))],
        )

    def sums(self, functions: TestFunctions) -> list[Float]:
        """(S_0, Re S_1, Im S_1, ...) of every channel [windows, 2 H + 1]."""
        of, known, products = self._known
        if of is functions and not self._fresh:
            return known
        fresh = self._fresh if of is functions else range(len(self.gains))
        out = list(known) if of is functions else [np.zeros(0)] * len(self.gains)
        channels = self.channels.channels
        if plain := [k for k in fresh if channels[k].fold == 0]:
            for k, one in zip(plain, functions.window_sums(np.array([self.gains[k] for k in plain])), strict=True):
                out[k] = one
        for k in fresh:
            if channels[k].fold:
                out[k] = np.zeros((self.grid.size // functions.hop - 1, 2 * functions.highest + 1))
                for part in self.grid.parts:
                    first = part.start // functions.hop
                    own = self._integral_sums(k, channels[k].fold, functions, part)
                    out[k][first : first + len(own)] = own
        kept = {key: one for key, one in products.items() if of is functions and key[0] not in fresh}
        self._fresh, self._known = [], (functions, out, kept)
        return out

    def _integral_sums(self, k: int, fold: int, functions: TestFunctions, part: slice) -> Float:
        """Sums of gain I^fold[integrand], the integral from each window's start [windows of a segment, 2 H + 1].

        Each half has integrals from its own start; those of the first half at its end give the polynomial that the
        second half's lack: sum_m E_(fold - m) t^m / m!.
        """
        f = np.asarray(self.integrands[k])[part]
        gain = functions.halves(self.gains[k][part])
        running = running_integrals(f, functions.hop, fold, functions.dt)
        own = functions.half_sums(gain * running[fold][:, :-1])
        second = own[1:].copy()
        shape: Float = np.ones(functions.hop)
        t = functions.dt * np.arange(functions.hop)
        for m in range(fold):
            shape = shape * t / m if m else shape
            second += running[fold - m][:-1, -1:] * functions.half_sums(gain * shape)[1:]
        return functions.joined(own[:-1], second)

    def rows(self, functions: TestFunctions, term: Term) -> Float:
        """(-1)^order sum chi^(order) channel of a term [windows, K]; the same object where a channel is the same."""
        sums, products, key = self.sums(functions), self._known[2], (term.channel, term.order)
        if key not in products:
            products[key] = (-1.0) ** term.order * (sums[term.channel] @ functions.combine(term.order))
        return products[key]

    def columns(self, functions: TestFunctions) -> list[Float]:
        """Columns of each row kind [windows, columns, K]."""
        out = []
        for row in self.channels.rows:
            columns = np.zeros((self.grid.size // functions.hop - 1, row.columns, functions.count))
            for term in row.terms:
                columns[:, term.column] += term.factor * self.rows(functions, term)
            out.append(columns)
        return out


def running_integrals(f: Float, hop: int, fold: int, dt: float) -> list[Float]:
    """I^0..I^fold of f [n] from the start of each half window: [halves, hop + 1] each, the last place is the end.

    I^1 by the cubic through four samples. Further ones by the trapezoid rule with its end correction, for which the
    derivative of I^n is I^(n - 1); that of I^2 has the third difference of f as well, which removes the error of I^1.
    """
    count = len(f) // hop
    e = np.concatenate([2 * f[:1] - f[1:2], f, 2 * f[-1:] - f[-2:-1]])
    step = np.concatenate([dt / 24 * (-e[:-3] + 13 * e[1:-2] + 13 * e[2:-1] - e[3:]), dt * f[-1:]])
    third = np.append(e[3:] - e[:-3] - 3 * (e[2:-1] - e[1:-2]), 0.0)
    values = np.empty((count, hop + 1))
    values[:, :-1] = f[: count * hop].reshape(count, hop)
    values[:-1, -1] = values[1:, 0]
    values[-1:, -1] = f[min(count * hop, len(f) - 1)]
    out = [values, from_steps(step[: count * hop].reshape(count, hop))]
    for n in range(2, fold + 1):
        last, slope = out[n - 1], out[n - 2]
        rise = dt / 2 * (last[:, 1:] + last[:, :-1]) - dt**2 / 12 * (slope[:, 1:] - slope[:, :-1])
        if n == 2:
            rise += dt**2 / 60 * third[: count * hop].reshape(count, hop)
        out.append(from_steps(rise))
    return out


def from_steps(steps: Float) -> Float:
    """0, then the running sum [..., n + 1] of steps [..., n]."""
    return np.concatenate([np.zeros((*steps.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)
