"""Twin of refine_pass_f32.c: one pass of the refinement over one block, in jobs."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from pvid.settings.refine import BIG_STEP
from pvid.twin.f32.refine_model import Float32, RefineModel

_F = np.float32
_POSITION = "1/2 1/6 1/8 19/180 3/32 863/10080 275/3456 33953/453600"
_VELOCITY = "1/1 1/2 5/12 3/8 251/720 95/288 19087/60480 5257/17280"
_STARTS = 3

_REACH = _F(2)  # changes of a sign's argument in a step, within which it may change
_DOUBLED = 64 * BIG_STEP  # parts of a big step that the factor of its columns is made from

Signals = tuple[Float32, Float32]
"""Inputs [inputs] and outputs [outputs] of a step."""


class PartSignals(NamedTuple):
    """Of a part of a step of Runge-Kutta: inputs at its beginning, its middle and its end [inputs], outputs at the
    end of the step."""

    u: Float32
    middle: Float32
    end: Float32
    z: Float32


class Job(IntEnum):
    """Jobs of a pass."""

    CLEAR = 0
    START = 1
    MEAN = 2
    MEAN_AGAIN = 3
    FULL = 4
    END = 5
    STEP = 6
    KICK = 7
    COLUMNS = 8
    MORE_COLUMNS = 9
    ROWS = 10
    MORE_ROWS = 11
    SLOPES = 12
    DOUBLE = 13
    SPREAD = 14


_AHEAD_OF_RUNGE_KUTTA = {Job.START: 0, Job.SLOPES: 2, Job.STEP: 2}
_AHEAD = {Job.START: 0, Job.MEAN: 1, Job.MEAN_AGAIN: 1, Job.FULL: 2, Job.END: 2, Job.STEP: 1}


def _weights(text: str) -> Float32:
    given = [tuple(map(int, one.split("/"))) for one in text.split()]
    return np.array([_F(a) / _F(b) for a, b in given], _F)


_OF_POSITION, _OF_VELOCITY = map(_weights, (_POSITION, _VELOCITY))
ORDER = len(_OF_POSITION) - 1


def turned(difference: Float32, turn: Float32) -> Float32:
    """pvid_refine_turned of each output."""
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.where(turn > 0, difference / turn, _F(0))
        countable = np.abs(turns) < _F(1e9)
        whole = np.where(countable, np.trunc(turns + np.where(turns < 0, _F(-0.5), _F(0.5))), _F(0))
        return np.asarray(np.where(countable, difference - turn * whole.astype(_F), difference), _F)


def _product(a: Float32, b: Float32) -> Float32:
    """Of two matrices, summed in the order of the core."""
    total = np.multiply.outer(a[:, 0], b[0])
    for k in range(1, a.shape[1]):
        total = total + np.multiply.outer(a[:, k], b[k])
    return np.asarray(total)


def _damped(D: Float32, half: np.float32, x: Float32) -> Float32:
    """x + half D x of columns x [q, n]."""
    return np.asarray(x + half * _product(D, x))


class Pass:
    """pvid_refine_pass_f32."""

    def __init__(self, model: RefineModel) -> None:
        shape = self.shape = model.shape
        self.model = model
        self.q = shape.coordinates
        self.state = np.zeros(shape.states, _F)
        self.difference = np.zeros((ORDER, self.q), _F)
        self.column = np.zeros((shape.columns, shape.states), _F)
        self.sum = np.zeros((shape.width, shape.width), _F)
        self.row = np.zeros((shape.rows, shape.width), _F)
        self.last = np.zeros(shape.outputs, _F)
        self.mean: Float32 = np.zeros(shape.outputs, _F)
        self.used = self.step = 0
        self.middle = np.zeros(shape.states, _F)
        self.job = Job.CLEAR

    def begin(
        self,
        r: Float32,
        start: Float32,
        h: np.float32,
        parts: tuple[int, int],
        gate: np.float32,
        turn: Float32,
        observer: Float32 | None = None,
    ) -> None:
        """pvid_refine_pass_begin_f32; observer [outputs, states]."""
        self.h, self.gate, self.turn = h, gate, turn
        if observer is not None:
            self.observer = observer
        self.some_parts, self.fine_parts = parts
        self.parts = self.fine_parts if self.shape.signs else self.some_parts
        self.part, self.part_s = 0, h / _F(self.parts)
        if self.shape.skew:
            skew = r[self.shape.moving]
            square = (_F(0.5) * skew) * skew
            self.skew = skew, square, (square * skew) / (_F(3) * h)
        self.constants = self.model.constants(r)
        self.state = start.copy()
        self.job, self.at, self.rows, self.starts, self.step, self.used = Job.CLEAR, 0, 0, _STARTS, 0, 0

    def awaited(self) -> int | None:
        """The step of the block whose signals the next job needs; None: none."""
        ahead = _AHEAD_OF_RUNGE_KUTTA if self.shape.runge_kutta else _AHEAD
        return None if self.job not in ahead else self.step * BIG_STEP + self.at + ahead[self.job]

    def ends(self, length: int) -> bool:
        """Whether the pass is complete."""
        return self.step >= length and (self.job <= Job.STEP or self.job == Job.SLOPES)

    def _clear(self) -> None:
        self.difference[:] = 0
        self.column[:] = 0
        self.sum[:] = 0
        states = range(self.shape.states)
        self.column[states, states] = 1
        self.mean[:] = 0

    # ---- the motion ----

    def _predict(self) -> None:
        q, h = self.q, self.h
        position, velocity = (of[ORDER - 1] * self.difference[-1] for of in (_OF_POSITION, _OF_VELOCITY))
        for k in range(ORDER - 2, -1, -1):
            position = position + _OF_POSITION[k] * self.difference[k]
            velocity = velocity + _OF_VELOCITY[k] * self.difference[k]
        if self.shape.order == 1:
            self.state = np.asarray(self.state + h * velocity)
            return
        x, v = self.state[:q], self.state[q:]
        self.state = np.concatenate([x + h * (v + h * position), v + h * velocity])

    def _renew(self, a: Float32, corrects: bool) -> None:
        newest = a
        for k in range(ORDER):
            before = self.difference[k].copy()
            self.difference[k] = newest
            newest = newest - before
        if not corrects:
            return
        kick = self.h * newest
        corrected = _OF_VELOCITY[ORDER] * kick
        if self.shape.order == 2:
            corrected = np.concatenate([(self.h * _OF_POSITION[ORDER]) * kick, corrected])
        self.state = np.asarray(self.state + corrected)

    def _motion(self, state: Float32, u: Float32) -> Float32:
        return self.model.motion(self.constants, state[: self.q], state[self.q :], u)

    def _mean_slope(self, u: Float32) -> Float32:
        h, q, k0 = self.h, self.q, self.difference[0]
        x, v = self.state[:q], self.state[q:]
        again = self.job == Job.MEAN_AGAIN
        k = self.k1 if again else k0
        if self.shape.order == 1:
            return self._motion(x + h * k, u)
        rates = v + h * k0 if again else v
        return self._motion(np.concatenate([x + h * rates, v + h * k]), u)

    def _full_slope(self, u: Float32) -> Float32:
        h, h2, q = self.h, _F(2) * self.h, self.q
        x, v = self.state[:q], self.state[q:]
        if self.shape.order == 1:
            return self._motion(x + h2 * self.k2, u)
        return self._motion(np.concatenate([x + h2 * (v + h * self.k1), v + h2 * self.k2]), u)

    def _end_double(self, u: Float32) -> None:
        h2, sixth, q, k0 = _F(2) * self.h, (_F(2) * self.h) / _F(6), self.q, self.difference[0]
        mean = self.k1 + self.k2
        if self.shape.order == 1:
            x = self.state
            dx = sixth * ((k0 + _F(2) * mean) + self.k3)
            self.end = np.asarray(x + dx)
            a = self._motion(self.end, u)
            self.middle = (x + _F(0.5) * dx) + (h2 * _F(0.125)) * (k0 - a)
            return
        x, v = self.state[:q], self.state[q:]
        dx = h2 * (v + sixth * (k0 + mean))
        dv = sixth * ((k0 + _F(2) * mean) + self.k3)
        x1, v1 = x + dx, v + dv
        self.end = np.concatenate([x1, v1])
        a = self._motion(self.end, u)
        middle = ((x + _F(0.5) * dx) - (h2 * _F(0.15625)) * dv) + ((h2 * h2) * _F(0.015625)) * (k0 + a)
        rate = ((_F(1.875) * dx) / h2 - _F(0.4375) * (v + v1)) + (h2 * _F(0.03125)) * (a - k0)
        self.middle = np.concatenate([middle, rate])

    def _residuals(self, r: Float32, state: Float32, signals: Signals) -> Float32:
        q, (u, measured) = self.q, signals
        late = state
        if self.shape.skew:
            a, jerk = self.difference[0], self.difference[1]
            first, second, third = self.skew
            v = state[-q:]
            if self.shape.order == 1:
                late = state + (first * a + (second / self.h) * jerk)
            else:
                late = np.concatenate([state[:q] + (first * v + (second * a + third * jerk)), v + first * a])
        return turned(measured - self.model.output(self.constants, late[:q], late[-q:], u, r), self.turn)

    def _start(self, r: Float32, signals: Signals) -> None:
        if self.shape.signs:
            self.argument = self.model.signs(self.constants, self.state, self.state, signals[0])
        if not self.shape.runge_kutta:
            self.difference[0] = self._motion(self.state, signals[0])
        elif self.shape.skew:
            self._renew(self._motion(self.state, signals[0]), False)
            self.difference[1] = 0
        self.last = self._residuals(r, self.state, signals)

    def _derivatives(self, r: Float32, u: Float32) -> Float32:
        q = self.q
        x, v = self.state[:q], self.state[q:]
        self.found = self.model.jacobian(self.constants, x, v, u)
        self.output_column = self.model.output_jacobian(self.constants, x, v, u, r)
        return self.found.a

    def _slip(self) -> Float32:
        """Derivatives of the outputs by the skew."""
        of_q, of_v, _ = self.output_column
        a, v = self.difference[0], self.state[-self.q :]
        total: Float32 = np.zeros(self.shape.outputs, _F)
        for k in range(self.q):
            total = total + of_q[:, k] * (a[k] if self.shape.order == 1 else v[k] + self.skew[0] * a[k])
            if self.shape.rates:
                total = total + of_v[:, k] * a[k]
        return total

    def _make_kick(self) -> None:
        if self.shape.runge_kutta:
            self._first_order_kick(self.mean_K, self.mean_B)
            return
        found = self.found
        if self.shape.order == 1:
            self._first_order_kick(found.K, found.B)
        else:
            self._second_order_kick(found.K, found.D, found.B)

    def _first_order_kick(self, K: Float32, B: Float32) -> None:
        big = _F(BIG_STEP) * self.h
        t = big / _F(_DOUBLED) if self.shape.runge_kutta else big
        unit = t * np.eye(self.q, dtype=_F)
        factor = unit
        for n in (4, 3, 2):
            factor = np.asarray((t / _F(n)) * _product(K, factor) + unit)
        if self.shape.runge_kutta:
            for _ in range(_DOUBLED.bit_length() - 1):
                factor = np.asarray(_F(2) * factor + _product(factor, _product(K, factor)))
        self.kick_q = _product(factor, K)
        self.kick_r = _product(factor, B.T)

    def _second_order_kick(self, K: Float32, D: Float32, B: Float32) -> None:
        big = _F(BIG_STEP) * self.h
        g = (big * big) * (_F(1) / _F(12))
        square = _product(K, K)
        half = _F(0.5) * big
        self.kick_q = _damped(D, half, big * (K + g * square))
        self.kick_v = _damped(D, half, big * D)
        self.kick_r = _damped(D, half, (big * B).T)

    def _step(self, r: Float32, signals: Signals) -> None:
        x, started, middle = self.middle, self.starts == 0, self.at == BIG_STEP // 2 - 1
        if started:
            if not middle:
                self._predict()
        elif self.at % 2:
            x = self.state = self.end
            self.starts -= 1
        a = self._derivatives(r, signals[0]) if middle else self._motion(self.state if started else x, signals[0])
        self._renew(a, started)
        self._add_residuals(self._residuals(r, self.state if started else x, signals))
        if middle and self.shape.skew:
            self.slip = self._slip()
        self.at += 1
        if started and self.at == BIG_STEP // 2 - 1:
            self._predict()

    def _add_residuals(self, e: Float32) -> None:
        self.mean = np.asarray(self.mean + _F(0.5) * (self.last + e), _F)
        self.last = e

    def _slopes(self, r: Float32, signals: PartSignals) -> None:
        if self.at == BIG_STEP // 2 and self.part == 0:
            self.output_column = self.model.output_jacobian(self.constants, self.state, self.state, signals.u, r)
            if self.shape.skew:
                self.slip = self._slip()
        found = self.model.jacobian(self.constants, self.state, self.state, signals.u)
        share = _F(1) / _F(BIG_STEP * self.parts)
        if self.at == 0 and self.part == 0:
            self.mean_K, self.mean_B = np.zeros_like(found.K), np.zeros_like(found.B)
        self.mean_K, self.mean_B = self.mean_K + share * found.K, self.mean_B + share * found.B
        self.k0: Float32 = found.a
        self.k1: Float32 = self._motion(self.state + (_F(0.5) * self.part_s) * self.k0, signals.middle)

    def _divide(self, u: Float32) -> None:
        """How many parts the next step has."""
        self.part = 0
        if self.shape.signs:
            argument = self.model.signs(self.constants, self.state, self.state, u)
            change = _REACH * (argument - self.argument)
            self.argument = argument
            self.parts = self.fine_parts if np.any(argument * argument <= change * change) else self.some_parts
            self.part_s = self.h / _F(self.parts)

    def _part_of_step(self, r: Float32, signals: PartSignals) -> None:
        h = self.part_s
        k2 = self._motion(self.state + (_F(0.5) * h) * self.k1, signals.middle)
        k3 = self._motion(self.state + h * k2, signals.end)
        mean = self.k1 + k2
        self.state = self.state + (h / _F(6)) * ((self.k0 + _F(2) * mean) + k3)
        self.part += 1
        if self.part < self.parts:
            return
        self._divide(signals.end)
        if self.shape.skew:
            self._renew(self._motion(self.state, signals.end), False)
        self._add_residuals(self._residuals(r, self.state, (signals.end, signals.z)))
        self.at += 1

    # ---- columns and rows ----

    def _end_big_step(self, weight: Float32) -> None:
        x, rate = self._first_order_columns() if self.shape.order == 1 else self._second_order_columns()
        self._end_rows(x, rate, weight)

    def _first_order_columns(self) -> tuple[Float32, Float32]:
        """The columns over a big step; at its middle."""
        s, states = self.column, self.shape.states
        change = np.zeros_like(s)
        change[states:] = self.kick_r.T
        for k in range(self.q):
            change = change + np.multiply.outer(s[:, k], self.kick_q[:, k])
        self.column = s + change
        return s + _F(0.5) * change, s

    def _second_order_columns(self) -> tuple[Float32, Float32]:
        """Likewise; and their rates."""
        shape, q = self.shape, self.q
        half = _F(0.5 * BIG_STEP) * self.h
        s, v = self.column[:, :q], self.column[:, q:]
        x = s + half * v
        late = s + (half + self.skew[0]) * v if shape.skew else x
        following = np.empty_like(v)
        for i in range(q):
            total = v[:, i].copy()
            for k in range(q):
                total = total + self.kick_q[i, k] * x[:, k]
            for k in range(q):
                total = total + self.kick_v[i, k] * v[:, k]
            total[shape.states :] = total[shape.states :] + self.kick_r[i]
            following[:, i] = total
        twice = v + following
        rate = _F(0.5) * twice
        self.column = np.concatenate([s + half * twice, following], 1)
        return late, rate

    def _end_rows(self, x: Float32, rate: Float32, weight: Float32) -> None:
        shape, q = self.shape, self.q
        of_q, of_v, of_r = self.output_column
        for i in range(shape.outputs):
            row = np.zeros(shape.width, _F)
            total = of_q[i, 0] * x[:, 0]
            for k in range(1, q):
                total = total + of_q[i, k] * x[:, k]
            if shape.rates:
                for k in range(q):
                    total = total + of_v[i, k] * rate[:, k]
            row[: shape.columns] = total
            if shape.skew:
                row[shape.columns] = self.slip[i]
            row[-1 - of_r.shape[1] : -1] = of_r[i]
            row[-1] = self.mean[i] * (_F(1) / _F(BIG_STEP))
            if i > 0:
                row = weight[i] * row
            self.mean[i] = 0
            if -self.gate <= row[-1] <= self.gate:
                self.used += 1
            else:
                row[:] = 0
            self.row[self.rows + i] = row
        self.rows += shape.outputs
        if shape.observer:
            self._correct()
        self.at = 0
        self.step += 1

    def _correct(self) -> None:
        """The observer's states and columns behind a big step."""
        shape = self.shape
        rows = self.row[self.rows - shape.outputs : self.rows]
        correction = np.zeros(shape.states, _F)
        for gain, row in zip(self.observer, rows, strict=True):
            correction = correction + gain * row[-1]
            self.column = self.column - np.multiply.outer(row[: shape.columns], gain)
        self.state = self.state + correction
        for i in range(self.q):
            self.last = self.last - self.output_column[0][:, i] * correction[i]

    def _add_rows(self) -> None:
        products = np.multiply.outer(self.row[0], self.row[0])
        for row in self.row[1:]:
            products = products + np.multiply.outer(row, row)
        self.sum = self.sum + products
        self.rows = 0

    # ---- jobs ----

    def _job_of_step(self) -> Job:
        if self.shape.runge_kutta:
            return Job.SLOPES
        return Job.MEAN if self.starts and self.at % 2 == 0 else Job.STEP

    def do(self, r: Float32, weight: Float32, signals: Signals | PartSignals | None) -> None:
        """The next job of pvid_refine_pass_run_f32. Columns and sums are those of the second of their two jobs."""
        match self.job:
            case Job.CLEAR:
                self._clear()
                self.job = Job.START
            case Job.KICK:
                self._make_kick()
                self.doubled = _DOUBLED
                self.job = Job.DOUBLE if self.shape.runge_kutta else self._job_of_step()
            case Job.DOUBLE:
                self.doubled //= 2
                self.job = Job.DOUBLE if self.doubled > 1 else Job.SPREAD
            case Job.SPREAD:
                self.job = Job.COLUMNS
            case Job.SLOPES:
                assert isinstance(signals, PartSignals)
                self._slopes(r, signals)
                self.job = Job.STEP
            case Job.COLUMNS | Job.ROWS:
                self.job = Job(self.job + 1)
            case Job.MORE_COLUMNS:
                self._end_big_step(weight)
                self.job = Job.ROWS if self.rows == self.shape.rows else self._job_of_step()
            case Job.MORE_ROWS:
                self._add_rows()
                self.job = self._job_of_step()
            case Job.STEP:
                if isinstance(signals, PartSignals):
                    self._part_of_step(r, signals)
                else:
                    assert signals is not None
                    self._step(r, signals)
                at_middle = {BIG_STEP // 2: Job.KICK, BIG_STEP: Job.COLUMNS}
                behind = {BIG_STEP: Job.KICK} if self.shape.runge_kutta else at_middle
                self.job = self._job_of_step() if self.part else behind.get(self.at, self._job_of_step())
            case _:
                assert signals is not None and not isinstance(signals, PartSignals)
                self._first_job(r, signals)
                starts = self.job == Job.START
                self.job = self._job_of_step() if starts else Job(self.job + 1)

    def _first_job(self, r: Float32, signals: Signals) -> None:
        match self.job:
            case Job.START:
                self._start(r, signals)
            case Job.MEAN:
                self.k1 = self._mean_slope(signals[0])
            case Job.MEAN_AGAIN:
                self.k2 = self._mean_slope(signals[0])
            case Job.FULL:
                self.k3 = self._full_slope(signals[0])
            case _:
                self._end_double(signals[0])
