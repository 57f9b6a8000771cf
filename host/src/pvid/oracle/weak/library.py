"""The columns of all candidate terms of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel
from pvid.model.evaluation import numpy_function
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.filters import polynomial_weights
from pvid.oracle.weak.front import filtered, largest
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import record_of
from pvid.oracle.weak.scores import Scores, between
from pvid.oracle.weak.solve import Fit
from pvid.oracle.weak.terms import ACTS, CONSTANT, GAIN, LAWS, SOFT, SOFT_WIDTHS, Act, Candidate, Change, Law, Recorded

_RATE = (21, 2)  # samples and degree that give a sensor's rate in a law

# A law that an equation has already is there in another size: this part of the term is the most that is believed.
_ALIKE = 0.99  # cosine of the two columns
_PART = 0.3

_STEP = 1e-3  # of a signal's size: of the differences that give a column


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
        """What p is off by if a signal is recorded (1 + g) times as large as it is, over g [n_p]."""
        recorded = self.recorded(name)
        if not recorded.top:
            return np.zeros(len(self.fit.p))
        return self.scores.shift(self.act(recorded, GAIN, 0.0))

    def by_clock(self) -> Float:
        """What p is off by if samples come (1 + g) times as fast as the sample rate is said to be, over g [n_p]."""
        whole = replace(self.design, window_s=2 * self.design.hop * self.design.dt)  # as many steps at any rate
        factor = 1 + _STEP
        faster = replace(whole, sample_rate=whole.sample_rate * factor, window_s=whole.window_s / factor)
        before, after = (
            self.scores.columns_of(record_of(self.fit.rows.compiled, self.run, one)) for one in (whole, faster)
        )
        return self.scores.shift_by(between(before, after, _STEP)(self.scores.theta))

    @cached_property
    def candidates(self) -> list[Candidate]:
        """All, without scores."""
        return [*self._laws(), *self._soft_frictions(), *self._acts()]

    def _laws(self) -> Iterator[Candidate]:
        grid, functions, rows = self.fit.rows.record.grid, self.fit.rows.functions, self.fit.rows
        rate = polynomial_weights(*_RATE, 1) * self.design.sample_rate
        named: list[tuple[str, Law, float]] = [("", CONSTANT, 0.0)]
        values: list[Float] = [np.ones(grid.size)]
        for one in self._recorded():
            if one.signal.kind != "sensor" or one.signal.driven:
                continue
            x, v = (np.nan_to_num(each[grid.places]) for each in (one.values, filtered(one.values, rate)))
            turns = one.signal.unit == "rad" and float(np.ptp(x)) > np.pi / 2
            changes = float(np.min(x)) < 0 < float(np.max(x))
            for law in LAWS:
                if (law.angle and not turns) or (law.signs and not changes):
                    continue
                width = float(f"{law.width * float(np.sqrt(np.mean(v**2))):.2g}")
                named.append((one.signal.name, law, width))
                values.append(law.of(x, v, width))
        sums = functions.window_sums(np.array(values))[:, rows.numbers]
        tables = {law.order: (-1.0) ** law.order * functions.combine(law.order) for _, law, _ in named}
        sums = np.array([own @ tables[law.order] for own, (_, law, _) in zip(sums, named, strict=True)])
        theta = self.fit.parameters.theta(self.fit.p)
        for kind, row in enumerate(self.model.rows):
            largest = _believable(rows.columns[kind], theta[kind], sums)
            for (name, law, width), own, most in zip(named, sums, largest, strict=True):
                yield Candidate(row.name, name, law, width, _in_row(own, kind, rows.kinds), most=float(most))

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
            soft = replace(self.design, reversals="soft", soft=part * rms)
            change = self.scores.change_to(record_of(self.fit.rows.compiled, self.run, soft), -1.0)
            yield Candidate(str(argument), str(argument), SOFT, part * rms, change)

    def _acts(self) -> Iterator[Candidate]:
        for one in self._recorded():
            for act in ACTS:
                if act.applies(one):
                    for level in act.tried(one):
                        yield self.act(one, act, level)

    def act(self, recorded: Recorded, act: Act, level: float) -> Candidate:
        """One at a level."""
        other = recorded.under(act, level)
        step = -1.0
        if act.levels is None:
            step = -_STEP * recorded.top / max(largest(other), 1e-300)
            other = recorded.values - step * other
        name = recorded.signal.name
        record = record_of(self.fit.rows.compiled, {**self.run, name: other}, self.design)
        return Candidate(name, name, act, level, self.scores.change_to(record, step), recorded.top, act.most(recorded))

    def recorded(self, name: str) -> Recorded:
        """A signal as recorded."""
        values, design = np.asarray(self.run[name], np.float64), self.design
        return Recorded(self.model.signal(name), values, design.sample_rate, design.window_s, largest(values))

    def _recorded(self) -> Iterator[Recorded]:
        for signal in self.model.signals:
            if signal.name in self.run and (one := self.recorded(signal.name)).top:
                yield one


def _in_row(sums: Float, kind: int, kinds: int) -> Change:
    whole = [sums if kind == other else np.zeros(sums.shape) for other in range(kinds)]
    return lambda theta: whole


def _believable(columns: Float, theta: Float, sums: Float) -> Float:
    """Largest sizes of laws, from their sums [laws, windows, K]: inf but for those that the equation has already."""
    terms = columns[:, : len(theta) + 1] * np.append(theta, 1.0)[:, np.newaxis]
    inner = np.abs(np.einsum("lwk,wjk->lj", sums, terms))
    laws, sizes = np.sum(sums**2, axis=(1, 2)), np.sum(terms**2, axis=(0, 2))
    alike = inner > _ALIKE * np.sqrt(np.outer(laws, sizes))
    ratio = np.sqrt(sizes / np.maximum(laws, 1e-300)[:, np.newaxis])
    return np.asarray(np.min(np.where(alike, _PART * ratio, np.inf), axis=1))
