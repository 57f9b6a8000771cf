"""Would a systematic error of one sensor, or a friction, explain the residuals, and how far would it move p?

An error a f(t) in a recorded signal z moves the residuals by a c, c = (e(z + step f) - e(z))/step. Residuals e are then
fitted by J dp + a c: a and its standard error show whether the error is there, dp how far p moves with it. Errors that
are tried: a delay, a play (backlash), an eccentric encoder, the gain of an input, a friction that does not switch at
once. An error is the cause if it removes most of what the sensors' noise does not explain of the residuals: something
else that the equations lack looks like a small delay as well. Where a gain only scales p no data show it: p is then off
by what `by_gain` gives, and that belongs to its standard errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.wording import listed, with_unit
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.signals import Jet
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import clustered_variance
from pvid.oracle.weak.front import filtered, in_segments
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.polynomials import polynomial_weights
from pvid.oracle.weak.rows import WhiteRows, record_of
from pvid.oracle.weak.solve import Fit, inverse
from pvid.oracle.weak.verdict import Reason
from pvid.sim.imperfections import with_play

Kind = Literal["delay", "play", "eccentric", "gain", "friction", "lacking", "unknown"]

# An error is reported if it is this many standard errors from 0 and moves a parameter by so many of its own.
_CERTAIN = 6.0
_CERTAIN_OF_FRICTION = 8.0  # what is located wrongly near a reversal looks like a narrow soft friction
_MOVES = 1.0
# It is named if it removes this share of what the sensors do not explain; else the cause is unknown.
_MOST = 0.5
_PASSES = 2  # that improve the size of a delay
_ALIKE = 0.03  # of a share: two delays that differ by less explain the run alike

# An encoder shows an eccentricity only where it turns by this much [rad].
_TURNS = 2.0

# A column that the parameters explain but for this part of its square is theirs: no data show it.
_OWN = 1e-6

_A_GAIN = 0.01  # that a note on scale supposes
# Beyond these sizes a column is the residuals themselves: where p explains a gain, what is left of it is their noise.
_LARGEST_GAIN = 0.2
_LARGEST = 100.0  # play or eccentricity [resolutions]
_LONGEST = 0.25  # delay [windows]

_WIDTHS = (0.03, 0.055, 0.1, 0.18, 0.3, 0.55, 1.0)  # of a soft friction, over the root mean square of the speed
_WHOLE = (0.4, 2.5)  # a friction that is soft has a column of size 1
_SMOOTHED = 21  # samples, for the direction of a motion
_PLAY = 3.0  # width of the play that is tried [resolutions]
_PART = 1e-3  # of a resolution or of a signal's size: steps of the differences


@dataclass(frozen=True)
class SensorError:
    """A systematic error that explains residuals.

    Attributes
    ----------
    signal : name; of a soft friction the argument of sgn
    kind : what it is; "lacking": a friction that turns with the signal's rate; "unknown": none that is tried
    size : delay [s], width of the play or amplitude of the eccentricity [unit of the signal], gain less 1; width over
        which a friction changes its sign [unit of the argument]; a lacking friction [unit of the equation]
    certainty : size over its standard error
    unit : of the signal; of a friction that of the argument, "" where it is not one signal's rate
    shift : by how much p moves when the error is taken off [n_p]
    other : of a delay: a signal whose opposite delay explains the run alike, "" where there is none
    share : of the squared residuals beyond the sensors' noise, that the error removes; of an unknown one the largest
    row : of a lacking friction: the equation's name
    """

    signal: str
    kind: Kind
    size: float
    certainty: float
    shift: Float
    unit: str = ""
    row: str = ""
    other: str = ""
    share: float = 1.0

    @property
    def text(self) -> str:
        """In words."""
        if self.kind == "unknown":
            return (
                "the residuals exceed the sensors' noise for an unknown reason: of the errors of sensors and frictions "
                f"that are tried none removes more than {100 * self.share:.0f} % of the excess"
            )
        if self.kind == "delay":
            shifted, opposite = ("delayed", "advanced") if self.size > 0 else ("advanced", "delayed")
            text = f"{self.signal} seems to be {shifted} by {abs(self.size):.2g} s"
            return f"{text}, or {self.other} to be {opposite}" if self.other else text
        if self.kind == "friction":
            return f"the friction seems to be soft: sgn({self.signal}) changes over a width of about {self._size}"
        if self.kind == "lacking":
            term = f"{abs(self.size):.2g}*sgn({self.signal}.d())"
            return f"{self.row} seems to lack a friction of {self.signal}, of about {term}"
        if self.kind == "gain":
            than = "larger" if self.size < 0 else "smaller"
            return f"{self.signal} seems to be {100 * abs(self.size):.2g} % {than} than recorded"
        what = "a backlash of" if self.kind == "play" else "an eccentric encoder of amplitude"
        return f"{self.signal} seems to have {what} {self._size}"

    @property
    def _size(self) -> str:
        return with_unit(abs(self.size), self.unit, 2)


class SensorErrors:
    """Tests of one estimate.

    Parameters
    ----------
    run, design, fit
        As they gave the estimate.
    """

    def __init__(self, run: Mapping[str, npt.ArrayLike], design: WeakDesign, fit: Fit) -> None:
        self.model: CompiledModel = fit.rows.compiled.bare
        self.run = {name: np.asarray(values, np.float64) for name, values in run.items()}
        self.design, self.fit = design, fit
        self.theta = fit.parameters.theta(fit.p)
        self.designs = np.concatenate(fit.designs(), axis=1)  # [windows, rows of all kinds, n_p]
        self.residuals = np.concatenate(fit.residuals(), axis=1)
        information = np.einsum("wkp,wkq->pq", self.designs, self.designs) + np.diag(fit.parameters.prior(fit.start))
        self.inverse = inverse(information)
        self.unit = fit.parameters.unit(fit.p)
        self.excess = self._excess()
        self._bare = self._raw(fit.rows.columns)

    def found(self, se: Float) -> SensorError | None:
        """The error that removes most of the residuals beyond the sensors' noise, of those that are there and move p by
        more than its standard errors [n_p] allow; an unknown one where it removes less than half."""
        out = [one for one in self.tried() if one.certainty > _CERTAIN and np.any(np.abs(one.shift) > _MOVES * se)]
        best = max(out, key=lambda one: one.share, default=None)
        if best is None or best.share > _MOST:
            return best if best is None else self._in_full(_with_alternative(best, out))
        shift = np.max(np.abs([one.shift for one in out]), axis=0)
        return SensorError("", "unknown", 0.0, max(one.certainty for one in out), shift, share=best.share)

    def _in_full(self, error: SensorError) -> SensorError:
        """With the size of a delay from residuals without all of it: they are not linear in what is long."""
        if error.kind != "delay":
            return error
        signal = self.model.signal(error.signal)
        for _ in range(_PASSES):
            column = self._column({signal.name: self._late(signal, -error.size)}, -error.size)
            again = self._test(signal.name, "delay", [column], _LONGEST * self.design.window_s)
            if not again.certainty or again.share < error.share - _ALIKE:
                break
            error = replace(again, other=error.other)
        return error

    def _late(self, signal: Signal, delay: float) -> Float:
        """Samples of a signal [n], later by a delay [s]."""
        place = np.arange(len(self.run[signal.name]), dtype=np.float64)
        return np.interp(place - delay * self.design.sample_rate, place, self.run[signal.name])

    def tried(self) -> Iterator[SensorError]:
        """All tests."""
        for signal in self.model.signals:
            if signal.name not in self.run:
                continue
            name = signal.name
            yield self._test(name, "delay", [self._delay(signal)], _LONGEST * self.design.window_s)
            if signal.kind == "input":
                yield self._test(name, "gain", [self._gain(signal)], _LARGEST_GAIN)
            if signal.kind == "sensor" and not signal.driven and signal.resolution:
                yield self._test(name, "play", [self._play(signal)], _LARGEST * signal.resolution)
                if signal.unit == "rad" and _reach(self.run[signal.name]) > _TURNS:
                    yield self._test(name, "eccentric", self._eccentric(signal), _LARGEST * signal.resolution)
        yield from self._frictions()
        yield from self._lacking()

    def _excess(self) -> float:
        """Sum of the squared residuals beyond what the sensors' noise explains."""
        total = float(np.sum(self.residuals**2))
        functions, errors = self.fit.rows.functions, self.fit.errors
        for white, e in zip(self.fit.white, self.fit.residuals(), strict=True):
            count = functions.count
            own = np.zeros((len(white.kinds) * count,) * 2)
            for place, kind in enumerate(white.kinds):
                rows = slice(place * count, (place + 1) * count)
                own[rows, rows] = errors[kind].variance * functions.gram(errors[kind].order, errors[kind].order)
            total -= white.free * (1 - white.whitener.trace(own) / e.size)
        return total

    def by_gain(self, signal: Signal) -> Float:
        """What p is off by if a signal is recorded (1 + g) times as large as it is, over g [n_p]."""
        return np.asarray(self.unit * (self.inverse @ np.einsum("wkp,wk->p", self.designs, self._gain(signal))))

    def _gain(self, signal: Signal) -> Float:
        """Column of a gain less 1."""
        return self._column({signal.name: self.run[signal.name] * (1 + _PART)}, _PART)

    def _frictions(self) -> Iterator[SensorError]:
        """Signs that are soft, of several widths; only one that is soft in full counts."""
        channels, grid = self.fit.rows.compiled.channels, self.fit.rows.record.grid
        if not channels.signs or self.design.reversals == "soft":
            return
        argument = channels.signs[0]
        symbols = sorted(argument.free_symbols, key=str)
        speed = sp.lambdify(symbols, argument, "numpy")(*[grid.jets[one] for one in symbols])
        for part in _WIDTHS:
            width = part * float(np.sqrt(np.mean(np.square(speed))))
            soft = replace(self.design, reversals="soft", soft=width)
            found = self._test(str(argument), "friction", [self._column({}, -1.0, soft)], _WHOLE[1])
            whole = _WHOLE[0] < found.size < _WHOLE[1]
            yield replace(
                found,
                size=width,
                certainty=found.certainty if whole and found.certainty > _CERTAIN_OF_FRICTION else 0.0,
            )

    def _lacking(self) -> Iterator[SensorError]:
        """A dry friction in each equation, of each coordinate whose sign the model does not have."""
        functions, grid = self.fit.rows.functions, self.fit.rows.record.grid
        known = set[Jet]().union(*(one.atoms(Jet) for one in self.fit.rows.compiled.channels.signs))
        rate = polynomial_weights(_SMOOTHED, 2, 1)
        for signal in self.model.signals:
            if signal.kind != "sensor" or signal.driven or Jet(signal.name, 1) in known or signal.name not in self.run:
                continue
            turns = np.nan_to_num(np.sign(filtered(self.run[signal.name], rate)))[grid.places]
            whole = functions.window_sums(turns) @ functions.combine(0)
            for kind, row in enumerate(self.model.rows):
                change = [np.zeros((self.fit.rows.windows, functions.count)) for _ in self.model.rows]
                change[kind] = whole[self.fit.rows.numbers]
                found = self._test(signal.name, "lacking", [self._whitened(change)], np.inf)
                certain = found.certainty > _CERTAIN_OF_FRICTION and found.size * self._inertia(signal.name, kind) >= 0
                yield replace(found, row=row.name, certainty=found.certainty if certain else 0.0)

    def _inertia(self, name: str, kind: int) -> float:
        """Factor of the highest derivative of a signal in a row, whose sign a friction has; 0: none."""
        row = self.fit.rows.compiled.model.rows[kind]  # with the corners of held inputs
        place = {
            order: theta
            for part, theta in zip(row.regressors, self.theta[kind], strict=True)
            for order, psi in part.items()
            if psi == Jet(name)
        }
        return float(place[max(place)]) if place and max(place) else 0.0

    def _test(self, signal: str, kind: Kind, columns: list[Float], largest: float) -> SensorError:
        c = np.stack(columns, axis=-1)
        mixed = np.einsum("wkp,wkc->pc", self.designs, c)
        rest = c - self.designs @ (self.inverse @ mixed)
        normal = np.einsum("wkc,wkd->cd", rest, rest)
        whole = np.einsum("wkc,wkc->c", c, c)
        if not np.all(np.diag(normal) > _OWN * np.maximum(whole, 1e-300)):
            return SensorError(signal, kind, 0.0, 0.0, np.zeros(len(self.unit)))
        back = inverse(normal)
        size = back @ np.einsum("wkc,wk->c", rest, self.residuals)
        left = self.residuals - rest @ size
        variance = clustered_variance(np.einsum("wkc,wk->wc", rest, left), back)
        shift = -self.unit * (self.inverse @ (mixed @ size))
        amount = float(size[0]) if len(size) == 1 else float(np.hypot(*size))
        certainty = float(np.max(np.abs(size) / np.sqrt(variance))) if abs(amount) < largest else 0.0
        removed = float(np.sum(self.residuals**2) - np.sum(left**2))
        share = min(removed / self.excess, 1.0) if self.excess > 0 else 0.0
        return SensorError(signal, kind, amount, certainty, shift, self._unit(signal), share=share)

    def _unit(self, name: str) -> str:
        """Of a signal or of a signal's rate, as in q1_1."""
        units = {one.name: one.unit for one in self.model.signals}
        units |= {str(Jet(one.name, 1)): f"{one.unit or '1'}/s" for one in self.model.signals}
        return units.get(name, "")

    def _delay(self, signal: Signal) -> Float:
        """Column of a delay [s]."""
        values = self.run[signal.name]
        step = 1 / self.design.sample_rate
        return self._column({signal.name: in_segments(values, _later)}, step)

    def _play(self, signal: Signal) -> Float:
        """Column of a play's width."""
        values = self.run[signal.name]
        weights, width = polynomial_weights(_SMOOTHED, 2, 0), _PLAY * signal.resolution

        def played(x: Float) -> Float:
            smooth = filtered(x, weights) if len(x) >= len(weights) else x
            return np.asarray(x + _PART * (with_play(smooth, width) - smooth))

        return self._column({signal.name: in_segments(values, played)}, _PART * width)

    def _eccentric(self, signal: Signal) -> list[Float]:
        """Columns of an error once a turn."""
        values = self.run[signal.name]
        step = _PART * (signal.resolution or 1.0)
        return [self._column({signal.name: values + step * wave(values)}, step) for wave in (np.sin, np.cos)]

    def _column(self, changed: Mapping[str, Float], step: float, design: WeakDesign | None = None) -> Float:
        """How the whitened residuals move [windows, rows of all kinds] per unit of an error."""
        record = record_of(self.fit.rows.compiled, {**self.run, **changed}, design or self.design)
        moved = self._raw([one[self.fit.rows.numbers] for one in record.columns(self.fit.rows.functions)])
        return self._whitened([(now - before) / step for now, before in zip(moved, self._bare, strict=True)])

    def _whitened(self, change: list[Float]) -> Float:
        """Of the change of each kind's raw residuals [windows, K]."""
        out = []
        for white in self.fit.white:
            own = np.concatenate([change[kind] for kind in white.kinds], axis=1)
            out.append(self._without_nuisances(white, white.whitener.of(own[:, np.newaxis, :])[:, 0]))
        return np.concatenate(out, axis=1)

    def _raw(self, whole: list[Float]) -> list[Float]:
        """Residuals at p before whitening, of each kind [windows, K]."""
        return [
            columns[:, len(th)] - np.einsum("wjk,j->wk", columns[:, : len(th)], th)
            for columns, th in zip(whole, self.theta, strict=True)
        ]

    def _without_nuisances(self, white: WhiteRows, rows: Float) -> Float:
        nuisances = self.fit.rows.white_nuisances(white.kinds, white.whitener)
        if not nuisances.shape[1]:
            return rows
        q = np.linalg.qr(nuisances.transpose(0, 2, 1))[0]
        return np.asarray(rows - np.einsum("wkn,wn->wk", q, np.einsum("wkn,wk->wn", q, rows)))


def _later(x: Float) -> Float:
    """Half the difference of the sample before and the one behind on top of each [n]."""
    return np.asarray(x + (np.concatenate([x[:1], x[:-1]]) - np.concatenate([x[1:], x[-1:]])) / 2)


def _reach(x: Float) -> float:
    return float(np.nanmax(x) - np.nanmin(x))


def _with_alternative(best: SensorError, found: list[SensorError]) -> SensorError:
    """Of the errors that explain a run alike the one that is usual: a delay, in place of another signal that is ahead;
    then the surest."""
    alike = [one for one in found if one.kind == best.kind and one.share > best.share - _ALIKE]
    first = max(alike, key=lambda one: (one.kind == "delay" and one.size > 0, one.certainty))
    if first.kind != "delay":
        return first
    others = [one for one in alike if one.size * first.size < 0]
    return replace(first, other=max(others, key=lambda one: one.certainty).signal) if others else first


def of_sensors(model: CompiledModel, error: SensorError | None, se: Float) -> list[Reason]:
    """An error explains the residuals."""
    if error is None:
        return []
    order = np.argsort(-np.abs(error.shift) / se)
    names = [model.p_names[k] for k in order if k == order[0] or abs(error.shift[k]) > _MOVES * se[k]]
    if error.kind == "unknown":
        return [Reason("unexplained", f"{error.text[0].upper()}{error.text[1:]}. It may bias {listed(names)}.")]
    sure = f"{error.certainty:.0f} standard errors from 0"
    text = f"{error.text} ({sure}; it removes {100 * error.share:.0f} % of what the sensors' noise does not explain)"
    text += f". This error biases {listed(names)}."
    return [Reason("friction" if error.kind in ("friction", "lacking") else "sensor", text)]


def of_scale(model: CompiledModel, by_gain: Mapping[str, Float], p: Float, se: Float) -> list[Reason]:
    """Gains that scale p and of which the description gives no error."""
    scales = []
    for signal in model.signals:
        moved = np.abs(by_gain.get(signal.name, np.zeros(len(p)))) * _A_GAIN
        if signal.gain_sd == 0 and np.any(moved > 2 * se):
            k = int(np.argmax(moved / np.maximum(np.abs(p), 1e-300) * (moved > 2 * se)))
            scales.append(f"{signal.name} ({100 * moved[k] / abs(p[k]):.2g} % of {model.p_names[k]})")
    if not scales:
        return []
    text = "The standard errors include no gain error (gain_sd = 0). A gain error of 1 % changes the estimate: "
    text += ", ".join(scales) + "."
    return [Reason("scale", text, alarm=False)]
