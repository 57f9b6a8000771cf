"""The columns of all candidate terms of a run."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.model.compiled import CompiledModel, Signal
from pvid.model.evaluation import numpy_function
from pvid.model.signals import Integral, jets, order_of
from pvid.oracle.weak.channels import Record
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.filters import polynomial_weights
from pvid.oracle.weak.front import filtered, largest
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import record_of
from pvid.oracle.weak.scores import Scores, between
from pvid.oracle.weak.solve import Fit
from pvid.oracle.weak.terms import (
    ACTS,
    CONSTANT,
    GAIN,
    GRADUAL,
    JUMPS,
    LAWS,
    OF_GAIN,
    OF_LOAD,
    OF_OFFSET,
    OF_PARAMETER,
    OFFSET,
    SOFT,
    SOFT_WIDTHS,
    Act,
    Candidate,
    Change,
    Course,
    Law,
    Recorded,
    is_measured,
)

_RATE = (21, 2)  # samples and degree that give a sensor's rate in a law

# A law that an equation has already is there in another size: this part of the term is the most that is believed.
_ALIKE = 0.99  # cosine of the two columns
_PART = 0.3

# What is a candidate as it is, and as it changes during the run.
_COURSES = ((GAIN, OF_GAIN), (OFFSET, OF_OFFSET), (CONSTANT, OF_LOAD))
_MOST_GAIN = 0.6  # largest believable change of a gain

_STEP = 1e-3  # of a signal's size: of the differences that give a column


@dataclass(frozen=True)
class Moving:
    """A motion.

    Attributes
    ----------
    x, v : of a sensor, a deflection or a running integral, and its rate, at the steps [K]
    unit : of x
    names : of the sensors that it is made of
    rows : in which a force of the deflection acts, with its factor in each; {}: in any
    is_integral : a running integral, whose rate is another signal
    """

    x: Float
    v: Float
    unit: str
    names: Sequence[str]
    rows: dict[int, float] = field(default_factory=dict)
    is_integral: bool = False


@dataclass(frozen=True)
class Library:
    """Candidates for what an estimate leaves unexplained.

    Attributes
    ----------
    run : name -> samples [n]
    design, fit : of the estimate
    """

    run: Mapping[str, npt.ArrayLike]
    design: WeakDesign
    fit: Fit

    @property
    def model(self) -> CompiledModel:
        """As compiled."""
        return self.fit.rows.compiled.bare

    @cached_property
    def scores(self) -> Scores:
        """Of the estimate."""
        return Scores(self.fit)

    def by_gain(self, name: str) -> Float:
        """Change of p per relative gain error of the signal [n_p]."""
        if name not in self._by_gain:
            recorded, none = self.recorded(name), np.zeros(len(self.fit.p))
            self._by_gain[name] = self.scores.shift(self.act(recorded, GAIN, 0.0)) if recorded.top else none
        return self._by_gain[name]

    @cached_property
    def _by_gain(self) -> dict[str, Float]:
        return {}

    @cached_property
    def by_clock(self) -> Float:
        """What p is off by if samples come (1 + g) times as fast as the sample rate is said to be, over g [n_p]."""
        whole = replace(self.design, window_s=2 * self.design.hop * self.design.dt)  # as many steps at any rate
        factor = 1 + _STEP
        faster = replace(whole, sample_rate=whole.sample_rate * factor, window_s=whole.window_s / factor)
        before, after = (record_of(self.fit.rows.compiled, self.run, one) for one in (whole, faster))
        change = between(before, after, self.fit.rows.numbers, _STEP)
        return self.scores.shift_by(change(self.scores.theta))

    @cached_property
    def candidates(self) -> list[Candidate]:
        """All, without scores."""
        return [*self._steady, *(one for whole in self._changing for one in self._in_time(whole))]

    @cached_property
    def _steady(self) -> list[Candidate]:
        """What is the same all the time."""
        return [*self._laws(), *self._soft_frictions(), *self._acts()]

    def _sums(self, laws: Sequence[Law], values: Sequence[Float]) -> Float:
        """Of laws, from their values at the steps [laws, windows, K]."""
        functions = self.fit.rows.functions
        sums = functions.window_sums(np.array(values))[:, self.fit.rows.numbers]
        tables = {law.order: (-1.0) ** law.order * functions.combine(law.order) for law in laws}
        return np.array([own @ tables[law.order] for own, law in zip(sums, laws, strict=True)])

    def _motion(self, one: Recorded) -> tuple[Float, Float]:
        """A signal and its rate at the steps."""
        places, rate = self.fit.rows.record.grid.places, polynomial_weights(*_RATE, 1) * self.design.sample_rate
        return np.nan_to_num(one.values[places]), np.nan_to_num(filtered(one.values, rate)[places])

    def _laws(self) -> Iterator[Candidate]:
        grid, rows = self.fit.rows.record.grid, self.fit.rows
        named: list[tuple[str, Law, float, dict[int, float]]] = [("", CONSTANT, 0.0, {})]
        values: list[Float] = [np.ones(grid.size)]
        for name, one in self._moving.items():
            x, v = one.x, one.v
            second = any(order_of(equation, one.names) > 1 for equation in self.model.equations)
            turns = one.unit == "rad" and float(np.ptp(x)) > np.pi / 2
            changes = float(np.min(x)) < 0 < float(np.max(x))
            for law in LAWS:
                if law.angle > turns or law.signs > changes or law.inertia > second:
                    continue
                if one.is_integral and ".d(" in law.text:
                    continue
                width = law.part * float(np.max(np.abs(x))) or law.width * float(np.sqrt(np.mean(v**2)))
                width = float(f"{width:.2g}")
                named.append((name, law, width, one.rows))
                values.append(law.of(x, v, width))
        sums = self._sums([law for _, law, _, _ in named], values)
        theta = self.fit.parameters.theta(self.fit.p)
        largest = [_believable(columns, th, sums) for columns, th in zip(rows.columns, theta, strict=True)]
        for place, (name, law, width, acts) in enumerate(named):
            for where in [acts] if acts else [{kind: 1.0} for kind in range(rows.kinds)]:
                signs = tuple((self.model.rows[kind].name, sign) for kind, sign in where.items())
                change = self._in_rows(signs, sums[place])
                most = min(float(largest[kind][place]) / abs(factor) for kind, factor in where.items())
                yield Candidate(signs[0][0], name, law, width, change, most=most, rows=signs)

    def _soft_frictions(self) -> Iterator[Candidate]:
        """Signs that do not switch at once."""
        channels, grid = self.fit.rows.compiled.channels, self.fit.rows.record.grid
        if not channels.signs or self.design.reversals == "soft":
            return
        argument = channels.signs[0]
        symbols = sorted(argument.free_symbols, key=str)
        speed = numpy_function(symbols, argument)(*[grid.jets[one] for one in symbols])
        rms = float(np.sqrt(np.mean(np.square(speed))))
        for part in SOFT_WIDTHS:
            yield Candidate(str(argument), str(argument), SOFT, part * rms, self._softened(part * rms))

    def _softened(self, width: float) -> Change:
        soft = replace(self.design, reversals="soft", soft=width)
        return self.scores.change_to(record_of(self.fit.rows.compiled, self.run, soft), -1.0)

    def _acts(self) -> Iterator[Candidate]:
        for one in self._recorded():
            for act in ACTS:
                if act.applies(one):
                    for level in act.tried(one):
                        yield self.act(one, act, level)

    @cached_property
    def _changing(self) -> list[Candidate]:
        """What may change during the run, as if it did so all the time: parameters, and of the other candidates gains,
        offsets and constants."""
        rows, parameters = self.fit.rows, self.fit.parameters
        slopes, unit = parameters.jacobian(self.fit.p), parameters.unit(self.fit.p)
        out = []
        for k, name in enumerate(parameters.names):
            change = [
                np.einsum("wjk,j->wk", own[:, : len(of)], of[:, k])
                for own, of in zip(rows.columns, slopes, strict=True)
            ]
            out.append(Candidate(name, "", OF_PARAMETER, 0.0, _fixed(change), float(unit[k])))
        for one in self._steady:
            course = next((course for kind, course in _COURSES if one.kind is kind), None)
            if course is not None:
                out.append(replace(one, kind=course, top=1.0, most=_MOST_GAIN if course is OF_GAIN else one.most))
        return out

    def _in_time(self, one: Candidate) -> Iterator[Candidate]:
        """Gradually and at once."""
        for level, weights in self._courses:
            yield replace(one, level=level, weights=weights)

    @cached_property
    def _courses(self) -> list[tuple[float, Float]]:
        """Times of the jumps [s], 0 of what is gradual, and how far each is there [windows]."""
        begin, end, last = self._spans
        gradual = [(0.0, course((begin + end) / 2)) for course in GRADUAL]
        return gradual + [(part * last, self._jumped(part * last)) for part in JUMPS]

    def _jumped(self, at: float) -> Float:
        """How much of each window is behind a time [s] [windows]."""
        begin, end, last = self._spans
        return np.clip((end - at / last) / (end - begin), 0, 1)

    def jumps_near(self, one: Candidate, part: float) -> list[Candidate]:
        """The same a part of the run earlier, and later."""
        times = [one.level + part * sign * self._spans[2] for sign in (-1, 0, 1)]
        return [replace(one, level=at, weights=self._jumped(at)) for at in times]

    @cached_property
    def _spans(self) -> tuple[Float, Float, float]:
        """Begin and end of each window, in parts of its recording [windows], and the longest recording [s]."""
        rows = self.fit.rows
        end, length = rows.end_times(), 2 * rows.functions.hop * rows.functions.dt
        begin, last = end - length, 0.0
        for number in np.unique(rows.recordings):
            own = rows.recordings == number
            first, whole = begin[own].min(), end[own].max() - begin[own].min()
            begin[own], end[own], last = (begin[own] - first) / whole, (end[own] - first) / whole, max(last, whole)
        return begin, end, last

    def act(self, recorded: Recorded, act: Act, level: float) -> Candidate:
        """One at a level."""
        other = recorded.under(act, level)
        step = -1.0
        if act.levels is None:
            step = -_STEP * recorded.top / max(largest(other), 1e-300)
            other = recorded.values - step * other
        name = recorded.signal.name
        change = self.scores.change_to(self._record({**self.run, name: other}), step)
        return Candidate(name, name, act, level, change, recorded.top, act.most(recorded))

    def _record(self, run: Mapping[str, npt.ArrayLike]) -> Record:
        """Channels of another run."""
        return record_of(self.fit.rows.compiled, run, self.design, like=self.fit.rows.record)

    @cached_property
    def _again(self) -> Library:
        """Of the run with as much noise of the sensors again."""
        random, run = np.random.default_rng(0), dict(self.run)
        for one in self.model.signals:
            if one.sd:
                run[one.name] = np.asarray(run[one.name]) + one.sd * random.normal(size=np.size(run[one.name]))
        rows = copy.copy(self.fit.rows)
        rows.record = self._record(run)
        return Library(run, self.design, replace(self.fit, rows=rows))

    @cached_property
    def noise(self) -> Change:
        """What as much noise again adds to the residuals."""
        return self.scores.change_to(self._again.fit.rows.record, 1.0)

    def noise_in(self, one: Candidate) -> Change:
        """What as much noise again adds to a candidate's change."""
        other = self._again._remade(one).changed
        return lambda theta: [now - before for now, before in zip(other(theta), one.changed(theta), strict=True)]

    def _remade(self, one: Candidate) -> Candidate:
        """A candidate of another run, from this one."""
        if isinstance(one.kind, Act):
            return self.act(self.recorded(one.signal), one.kind, one.level)
        if isinstance(one.kind, Course):
            return replace(one, change=next(other for other in self._changing if other.family == one.family).change)
        if one.kind is SOFT:
            return replace(one, change=self._softened(one.level))
        x, v = (np.ones(self.fit.rows.record.grid.size),) * 2
        if one.signal:
            x, v = self._moving[one.signal].x, self._moving[one.signal].v
        return replace(one, change=self._in_rows(one.rows, self._sums([one.kind], [one.kind.of(x, v, one.level)])[0]))

    def _in_rows(self, signs: Sequence[tuple[str, float]], sums: Float) -> Change:
        own = dict(signs)
        return _fixed([own.get(row.name, 0.0) * sums for row in self.model.rows])

    def recorded(self, name: str) -> Recorded:
        """A signal as recorded."""
        return self._as_recorded(self.model.signal(name), np.asarray(self.run[name], np.float64))

    def _as_recorded(self, signal: Signal, values: Float) -> Recorded:
        return Recorded(signal, values, self.design.sample_rate, self.design.window_s, largest(values))

    @cached_property
    def _moving(self) -> dict[str, Moving]:
        """Sensors of the motion, running integrals, and deflections: what a spring or a damper has between two sensors.

        A force of a deflection acts in each row by the deflection's slope, behind a gear by its ratio.
        """
        seen = {one.signal.name: one for one in self._recorded() if is_measured(one)}
        out = {name: Moving(*self._motion(one), one.signal.unit, [name]) for name, one in seen.items()}
        record = self.fit.rows.record
        at_steps = dict(zip(record.channels.plain, record.arguments, strict=False))
        for jet, expression in record.channels.opaque.items():
            if expression.has(Integral) and len(x := np.nan_to_num(at_steps[jet])):
                out[jet.of] = Moving(x, np.zeros(len(x)), "", [jet.of], is_integral=True)
        sensors = {one.jet for one in self.model.signals if one.kind == "sensor" and one.name in self.run}
        parts = ((kind, part) for kind, row in enumerate(self.model.rows) for part in row.regressors)
        for kind, psi in ((kind, sp.sympify(psi)) for kind, part in parts for n, psi in part.items() if n < 2):
            psi = self.model.with_knowns(psi)
            slopes = {jet: psi.diff(jet) for jet in sorted(jets(psi), key=str)}
            if len(slopes) < 2 or not sensors.issuperset(slopes) or not all(k.is_number for k in slopes.values()):
                continue
            factor = float(max(map(abs, slopes.values())) * sp.sign(next(iter(slopes.values()))))
            ratios = {jet: float(k) / factor for jet, k in slopes.items()}
            name = f"({sum(sp.nsimplify(f'{ratio:.9g}') * jet for jet, ratio in ratios.items())})"
            names = [jet.of for jet in slopes]
            if name not in out:
                values = np.asarray(sum(ratio * np.asarray(self.run[jet.of]) for jet, ratio in ratios.items()))
                signal = self.model.signal(names[0])
                out[name] = Moving(*self._motion(self._as_recorded(signal, values)), signal.unit, names)
            out[name].rows[kind] = factor
        return out

    def _recorded(self) -> Iterator[Recorded]:
        for signal in self.model.signals:
            if signal.name in self.run and (one := self.recorded(signal.name)).top:
                yield one


def _fixed(change: list[Float]) -> Change:
    return lambda theta: change


def _believable(columns: Float, theta: Float, sums: Float) -> Float:
    """Largest sizes of laws, from their sums [laws, windows, K]: inf but for those that the equation has already."""
    terms = columns[:, : len(theta) + 1] * np.append(theta, 1.0)[:, np.newaxis]
    inner = np.abs(np.einsum("lwk,wjk->lj", sums, terms))
    laws, sizes = np.sum(sums**2, axis=(1, 2)), np.sum(terms**2, axis=(0, 2))
    alike = inner > _ALIKE * np.sqrt(np.outer(laws, sizes))
    ratio = np.sqrt(sizes / np.maximum(laws, 1e-300)[:, np.newaxis])
    return np.asarray(np.min(np.where(alike, _PART * ratio, np.inf), axis=1))
