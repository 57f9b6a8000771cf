"""Twin of refine_pass_f32.c: one pass of the refinement over one block, in jobs."""

from __future__ import annotations

from enum import IntEnum
from fractions import Fraction

import numpy as np

from pvid.settings.refine import BIG_STEP
from pvid.twin.f32.refine_model import Float32, RefineModel

_F = np.float32
_POSITION = "139849/120960 -4511/2240 123133/40320 -88547/30240 1537/896 -11351/20160 275/3456"
_VELOCITY = "198721/60480 -18637/2520 235183/20160 -10754/945 135713/20160 -5603/2520 19087/60480"
_DIFFERENCE = "-7/1 21/1 -35/1 35/1 -21/1 7/1 -1/1"
_CORRECTED_POSITION = _F(33953) / _F(453600)
_CORRECTED_VELOCITY = _F(5257) / _F(17280)
_STARTS = 3

Signals = tuple[Float32, Float32]
"""Inputs [steps + 2 reach, inputs] and outputs [steps, outputs] of up to three neighbouring steps."""


class Job(IntEnum):
    """Jobs of a pass in their order."""

    CLEAR = 0
    FIRST_A = 1
    FIRST_B = 2
    FIRST = 3
    MIDDLE = 4
    SECOND_A = 5
    SECOND_B = 6
    SECOND = 7
    END = 8
    COLUMNS = 9
    ROWS = 10


_NEEDED = {
    **dict.fromkeys((Job.FIRST_A, Job.FIRST_B, Job.SECOND_A, Job.SECOND_B), 3),
    **dict.fromkeys((Job.FIRST, Job.MIDDLE, Job.SECOND, Job.END), 1),
}
_BEGINS = {Job.FIRST: 1, Job.MIDDLE: 2, Job.SECOND_A: 2, Job.SECOND_B: 2, Job.SECOND: 3, Job.END: 4}


def _weights(text: str) -> Float32:
    quotients = [Fraction(one) for one in text.split()]
    given = [tuple(map(int, one.split("/"))) for one in text.split()]
    assert len(quotients) == len(given)
    return np.array([_F(a) / _F(b) for a, b in given], _F)


_OF_POSITION, _OF_VELOCITY, _OF_DIFFERENCE = map(_weights, (_POSITION, _VELOCITY, _DIFFERENCE))
ORDER = len(_OF_POSITION)


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
        self.rate = np.zeros((ORDER, self.q), _F)
        self.column = np.zeros((shape.columns, shape.states), _F)
        self.sum = np.zeros((shape.width, shape.width), _F)
        self.row = np.zeros((shape.rows, shape.width), _F)
        self.last = np.zeros(shape.outputs, _F)
        self.mean: Float32 = np.zeros(shape.outputs, _F)
        self.used = self.step = 0
        self.job = Job.CLEAR

    def begin(self, r: Float32, start: Float32, h: np.float32, gate: np.float32) -> None:
        """pvid_refine_pass_begin_f32."""
        self.h, self.gate = h, gate
        if self.shape.skew:
            self._delay(r[self.shape.moving - 1])
        self.constants = self.model.constants(r)
        self.state = start.copy()
        self.job, self.head, self.rows, self.starts, self.step, self.used = Job.CLEAR, 0, 0, _STARTS, 0, 0

    def needs(self) -> tuple[int, int]:
        """First step of the block whose signals the next job needs, and how many steps; 0: none."""
        return self.step * BIG_STEP + _BEGINS.get(self.job, 0), _NEEDED.get(self.job, 0)

    def ends(self, length: int) -> bool:
        """Whether the pass is complete."""
        return self.step >= length and self.job != Job.ROWS

    def _clear(self) -> None:
        self.column[:] = 0
        self.sum[:] = 0
        states = range(self.shape.states)
        self.column[states, states] = 1
        self.mean[:] = 0

    # ---- the motion ----

    def _adams_bashforth(self) -> None:
        q, h = self.q, self.h
        position, velocity = np.zeros(q, _F), np.zeros(q, _F)
        for j in range(ORDER):
            age = (j - self.head) % ORDER
            position = position + _OF_POSITION[age] * self.rate[j]
            velocity = velocity + _OF_VELOCITY[age] * self.rate[j]
        if self.shape.order == 1:
            self.state = np.asarray(self.state + h * velocity)
            return
        x, v = self.state[:q], self.state[q:]
        self.state = np.concatenate([x + h * (v + h * position), v + h * velocity])

    def _correct(self, a: Float32) -> None:
        difference = a
        for j in range(ORDER):
            difference = difference + _OF_DIFFERENCE[(j - self.head) % ORDER] * self.rate[j]
        kick = self.h * difference
        corrected = _CORRECTED_VELOCITY * kick
        if self.shape.order == 2:
            corrected = np.concatenate([(self.h * _CORRECTED_POSITION) * kick, corrected])
        self.state = np.asarray(self.state + corrected)

    def _push(self, a: Float32) -> None:
        self.head = ORDER - 1 if self.head == 0 else self.head - 1
        self.rate[self.head] = a

    def _motion(self, state: Float32, u: Float32) -> Float32:
        return self.model.motion(self.constants, state[: self.q], state[self.q :], u)

    def _delay(self, skew: np.float32) -> None:
        s, scale = skew / self.h, _F(1) / self.h
        z = s * s
        one, two, three, four = _F(1), _F(2), _F(3), _F(4)
        self.late = (
            ((s * (z - one)) * (s - two)) / _F(24),
            ((s * (s - one)) * (four - z)) / _F(6),
            ((one - z) * (four - z)) * _F(0.25),
            ((s * (s + one)) * (four - z)) / _F(6),
            ((s * (z - one)) * (s + two)) / _F(24),
        )
        self.slope = (
            (scale / _F(12)) * ((s * (two * z - three * s)) - (s - one)),
            (scale / _F(6)) * ((s * (three * s - four * z)) + (_F(8) * s - four)),
            ((scale * s) * (two * z - _F(5))) * _F(0.5),
            (scale / _F(6)) * ((four + _F(8) * s) - s * (three * s + four * z)),
            (scale / _F(12)) * ((s * (two * z + three * s)) - (s + one)),
        )

    def _weighted(self, weights: tuple[np.float32, ...], signals: Signals, at: int) -> Float32:
        total = weights[0] * signals[0][at]
        for k, weight in enumerate(weights[1:], 1):
            total = total + weight * signals[0][at + k]
        return np.asarray(total, _F)

    def _input(self, signals: Signals, at: int) -> Float32:
        return self._weighted(self.late, signals, at) if self.shape.skew else np.asarray(signals[0][at])

    def _first_half(self, r: Float32, signals: Signals) -> None:
        h, q = self.h, self.q
        x, v = self.state[:q], self.state[q:]
        if self.starts == _STARTS:
            u = self._input(signals, 0)
            self._push(self._motion(self.state, u))
            self.last = signals[1][0] - self.model.output(self.constants, x, v, u, r)
        u, k0 = self._input(signals, 1), self.rate[self.head]
        if self.shape.order == 1:
            self.k1 = self._motion(x + h * k0, u)
            self.k2 = self._motion(x + h * self.k1, u)
            return
        self.k1 = self._motion(np.concatenate([x + h * v, v + h * k0]), u)
        self.k2 = self._motion(np.concatenate([x + h * (v + h * k0), v + h * self.k1]), u)

    def _second_half(self, signals: Signals) -> None:
        h, q, k1, k2 = self.h, self.q, self.k1, self.k2
        h2, sixth = _F(2) * h, (_F(2) * h) / _F(6)
        x, v = self.state[:q], self.state[q:]
        u, k0 = self._input(signals, 2), self.rate[self.head]
        if self.shape.order == 1:
            k3 = self._motion(x + h2 * k2, u)
            dx = sixth * ((k0 + _F(2) * (k1 + k2)) + k3)
            self.end = np.asarray(x + dx)
            a = self._motion(self.end, u)
            self.middle = (x + _F(0.5) * dx) + (h2 * _F(0.125)) * (k0 - a)
            return
        k3 = self._motion(np.concatenate([x + h2 * (v + h * k1), v + h2 * k2]), u)
        mean = k1 + k2
        dx = h2 * (v + sixth * (k0 + mean))
        dv = sixth * ((k0 + _F(2) * mean) + k3)
        x1, v1 = x + dx, v + dv
        self.end = np.concatenate([x1, v1])
        a = self._motion(self.end, u)
        middle = ((x + _F(0.5) * dx) - (h2 * _F(0.15625)) * dv) + ((h2 * h2) * _F(0.015625)) * (k0 + a)
        rate = ((_F(1.875) * dx) / h2 - _F(0.4375) * (v + v1)) + (h2 * _F(0.03125)) * (a - k0)
        self.middle = np.concatenate([middle, rate])

    def _residuals(self, r: Float32, state: Float32, u: Float32, measured: Float32) -> None:
        e = measured - self.model.output(self.constants, state[: self.q], state[self.q :], u, r)
        self.mean = np.asarray(self.mean + _F(0.5) * (self.last + e), _F)
        self.last = e

    def _derivatives(self, r: Float32, signals: Signals, u: Float32) -> Float32:
        q, shape = self.q, self.shape
        x, v = self.state[:q], self.state[q:]
        found = self.model.jacobian(self.constants, x, v, u)
        B = found.B.copy()
        if shape.skew:
            rate = self._weighted(self.slope, signals, 0)
            total: Float32 = np.zeros(q, _F)
            for j in range(shape.inputs):
                total = total + found.U[:, j] * rate[j]
            B[-1] = total
        self.output_column = self.model.output_jacobian(self.constants, x, v, u, r)
        if shape.order == 1:
            self._first_order_kick(found.K, B)
        else:
            self._second_order_kick(found.K, found.D, B)
        return found.a

    def _first_order_kick(self, K: Float32, B: Float32) -> None:
        big = _F(BIG_STEP) * self.h
        unit = np.eye(self.q, dtype=_F)
        factor = unit
        for n in (4, 3, 2):
            factor = np.asarray((big / _F(n)) * _product(K, factor) + unit)
        self.kick_q = big * _product(factor, K)
        self.kick_r = big * _product(factor, B.T)

    def _second_order_kick(self, K: Float32, D: Float32, B: Float32) -> None:
        big = _F(BIG_STEP) * self.h
        g = (big * big) * (_F(1) / _F(12))
        square = _product(K, K)
        half = _F(0.5) * big
        self.kick_q = _damped(D, half, big * (K + g * square))
        self.kick_v = _damped(D, half, big * D)
        self.kick_r = _damped(D, half, (big * B).T)

    def _step(self, r: Float32, signals: Signals) -> None:
        u, x, started = self._input(signals, 0), self.middle, self.starts == 0
        if started:
            if self.job != Job.MIDDLE:
                self._adams_bashforth()
            x = self.state
        elif self.job in (Job.MIDDLE, Job.END):
            x = self.state = self.end
            self.starts -= 1
        self._residuals(r, x, u, signals[1][0])
        a = self._derivatives(r, signals, u) if self.job == Job.MIDDLE else self._motion(x, u)
        if started:
            self._correct(a)
        self._push(a)
        if started and self.job == Job.FIRST:
            self._adams_bashforth()

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
        following = np.empty_like(v)
        for i in range(q):
            total = v[:, i].copy()
            for k in range(q):
                total = total + self.kick_q[i, k] * x[:, k]
            for k in range(q):
                total = total + self.kick_v[i, k] * v[:, k]
            total[shape.states :] = total[shape.states :] + self.kick_r[i]
            following[:, i] = total
        rate = _F(0.5) * (v + following)
        self.column = np.concatenate([x + half * following, following], 1)
        return x, rate

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
            row[shape.columns : -1] = of_r[i]
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
        self.step += 1

    def _add_rows(self) -> None:
        products = np.multiply.outer(self.row[0], self.row[0])
        for row in self.row[1:]:
            products = products + np.multiply.outer(row, row)
        self.sum = self.sum + products
        self.rows = 0

    # ---- jobs ----

    def do(self, r: Float32, weight: Float32, signals: Signals | None) -> None:
        """pvid_refine_pass_job_f32."""
        job = self.job
        if job == Job.CLEAR:
            self._clear()
            self.job = Job.FIRST_A
        elif job in (Job.COLUMNS, Job.ROWS):
            if job == Job.COLUMNS:
                self._end_big_step(weight)
            else:
                self._add_rows()
            full = job == Job.COLUMNS and self.rows == self.shape.rows
            self.job = Job.ROWS if full else Job.FIRST_A if self.starts else Job.FIRST
        else:
            assert signals is not None
            if job in (Job.FIRST_A, Job.SECOND_A):
                self._first_half(r, signals)
                self.job = Job(job + 1)
            elif job in (Job.FIRST_B, Job.SECOND_B):
                self._second_half(signals)
                self.job = Job(job + 1)
            else:
                self._step(r, signals)
                if job in (Job.FIRST, Job.SECOND):
                    self.job = Job(job + 1)
                else:
                    self.job = Job.COLUMNS if job == Job.END else Job.SECOND_A if self.starts else Job.SECOND
