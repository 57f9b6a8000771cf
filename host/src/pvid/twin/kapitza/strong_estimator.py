"""Twin of kapitza_estimator_f32.c, kapitza_solve_f32.h and the step in strong_f32.c: the estimator of the
strong form, one tick of every lane at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig
from pvid.twin.f32.estimator import RESIDUAL_FLOOR, ROW_LIMIT, Estimator, capped
from pvid.twin.f32.gate import Gate
from pvid.twin.f32.information import decay
from pvid.twin.f32.misfit import Misfit
from pvid.twin.kapitza import strong as model

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Reasons = npt.NDArray[np.uint8]

_F = np.float32
_FOLD_MAX = 64
_EXACT_EVERY = 8
_THIRDS = (0, 19, 38, 58)
_PIVOT_MIN = np.float32(1e-6)
_LEAST_NORMAL = np.finfo(np.float32).tiny


@dataclass
class _Factor:
    """L D L^T of S + H0 [lanes] each, and why it could not be found."""

    l01: Float32
    l02: Float32
    l12: Float32
    inverse1: Float32
    inverse2: Float32
    pivot0: Float32
    reason: Reasons

    def back(self, rhs: Float32) -> Float32:
        """(S + H0)^-1 rhs [3, lanes]."""
        z1 = rhs[1] - (self.l12 * rhs[2])
        z0 = (rhs[0] - (self.l02 * rhs[2])) - (self.l01 * z1)
        x0 = z0 / self.pivot0
        x1 = (z1 * self.inverse1) - (self.l01 * x0)
        return np.stack([x0, x1, ((rhs[2] * self.inverse2) - (self.l02 * x0)) - (self.l12 * x1)])


def _positive_normal(x: Float32) -> Mask:
    normal: Mask = (x >= _LEAST_NORMAL) & np.isfinite(x)
    return normal


class StrongEstimator(Estimator):
    """pvid_strong_estimator_f32 in every lane; one EstimatorConfig a lane, exact_every in common."""

    def __init__(self, configs: Sequence[EstimatorConfig], rate: float, exact_every: int) -> None:
        super().__init__(configs, rate, model.N_P, model.SUMS)
        lanes, rate32 = len(configs), _F(rate)
        self.prior = np.maximum(self.prior, _LEAST_NORMAL)
        self.start_sd = np.sqrt(self.row_variance / self.prior)
        zone = self.dead_zone > 0
        paper = np.array([c.law is Law.PSEUDOVELOCITY for c in configs])
        self.exact_every = np.full(lanes, exact_every) if exact_every else np.where(paper, 1, _EXACT_EVERY)
        self.exact_every[zone] = 0
        interval = np.where(self.divider > 1, self.divider, np.maximum(self.exact_every, 1))
        self.gain = np.array([self._gain_of(c, rate32, int(n)) for c, n in zip(configs, interval, strict=True)], _F)
        forgetting = self.forgetting_s * rate32
        fits = (forgetting <= 0) | (forgetting >= self.divider.astype(np.float32))
        self.staged = (self.divider % model.ROWS == 0) & (self.divider >= 8) & (self.divider <= _FOLD_MAX)
        self.staged = self.staged & ~zone & fits
        self.fold_every = np.array([self._fold_rows(i, f) for i, f in enumerate(forgetting)])
        decays = [decay(_F(n) / f) if f > 0 else _F(1) for n, f in zip(self.fold_every, forgetting, strict=True)]
        self.retention = np.array(decays, np.float32)
        self.s = np.zeros((6, lanes), np.float32)
        self.force = np.zeros((3, lanes), np.float32)
        self.block = np.zeros((model.ROWS, 6, lanes), np.float32)
        self.in_block = np.zeros(lanes, np.int64)
        self.age = np.zeros(lanes, np.int64)
        self.high = np.zeros((model.SUMS, lanes), np.float32)
        self.low = np.zeros((model.SUMS, lanes), np.float32)

    def _fold_rows(self, lane: int, forgetting: np.float32) -> int:
        rows = _FOLD_MAX
        if 0 < forgetting < _F(16 * _FOLD_MAX):
            rows = int(forgetting / _F(16))
        unit = int(self.divider[lane]) if self.staged[lane] else model.ROWS
        return unit if rows < unit else rows - rows % unit

    @staticmethod
    def _gain_of(config: EstimatorConfig, rate: np.float32, interval: int) -> np.float32:
        if config.law is Law.PSEUDOVELOCITY:
            return _F(0)
        gain = (_F(config.feedback_hz) * _F(interval)) / rate
        return _F(gain if config.feedback_hz > 0 and gain < 1 else 1)

    # ---- a row

    def row(self, row: Float32, gate: Gate, misfit: Misfit) -> Reasons:
        """A row [6, lanes]. Returns the reasons [lanes]; `sums` is up to date after it."""
        with np.errstate(all="ignore"):
            e, g = model.innovate(self.p, row)
            misfit.add(e, g[0] * self.p[0])
            place = self.in_block.copy()
            for i in range(model.ROWS):
                self.block[i] = np.where(place == i, row, self.block[i])
            passed = gate.passes(e * e)
            usable = model.squares(row) <= ROW_LIMIT * ROW_LIMIT
            taken = passed & usable
            reason = np.full(len(e), Reason.ACCUMULATED, np.uint8)
            if not taken.all():
                self._refuse(reason, row, passed, usable)
            self.counters["rows"] += taken
            self._every_row(taken & (self.divider == 1), g, e, reason)
            self._at_divider(taken & (self.divider > 1), g, e, reason)
            complete = taken & (place == model.ROWS - 1)
            self.in_block = np.where(taken, np.where(complete, 0, place + 1), place)
            if complete.any():
                self._end_block(complete)
            misfit.end_row(complete)
            alarmed = misfit.alarm & taken & (reason == Reason.UPDATED)
            reason[alarmed] = Reason.MISFIT
            self.counters["misfits"] += alarmed
            self.sums = self.high + self.low
        return reason

    def _refuse(self, reason: Reasons, row: Float32, passed: Mask, usable: Mask) -> None:
        not_finite = passed & ~usable & ~np.isfinite(row).all(axis=0)
        saturated = passed & ~usable & ~not_finite
        for refused, why in (
            (not_finite, Reason.REJECTED_NOT_FINITE),
            (saturated, Reason.REJECTED_SATURATED),
            (~passed, Reason.REJECTED_OUTLIER),
        ):
            reason[refused] = why
            self.counters[why.name.lower()] += refused

    def _end_block(self, complete: Mask) -> None:
        low = self.low.copy()
        for i in range(model.ROWS):
            low[: model.WEIGHT] = low[: model.WEIGHT] + model.terms(self.block[i])
        low[model.WEIGHT] = low[model.WEIGHT] + _F(model.ROWS)
        self.low = np.where(complete, low, self.low)
        self.age = np.where(complete, self.age + model.ROWS, self.age)
        due = complete & ~self.staged & (self.age >= self.fold_every)
        if due.any():
            self.age[due] = 0
            self._fold(due, slice(0, model.SUMS))

    def _fold(self, due: Mask, part: slice) -> None:
        high = self.high[part] * self.retention
        low = self.low[part] * self.retention
        total = high + low
        rest = total - high
        error = (high - (total - rest)) + (low - rest)
        self.high[part] = np.where(due, total, self.high[part])
        self.low[part] = np.where(due, error, self.low[part])

    # ---- solves

    def _gather(self) -> tuple[Float32, Float32, Float32]:
        """S, F and rss - yy of all rows before this one; rss - yy without those in the block."""
        s, force, rss = model.project(self.p, self.high + self.low)
        for i in range(model.ROWS - 1):
            pending = self.in_block > i
            if pending.any():
                e, g = model.innovate(self.p, self.block[i])
                s = np.where(pending, s + model.squared(g), s)
                force = np.where(pending, force + g * e, force)
        return s, force, rss

    def _residual(self, rss: Float32) -> tuple[Float32, Float32, Float32]:
        """Residual sum, its floor and the number of rows, from rss - yy of the sums."""
        values = self.high + self.low
        squares = np.zeros_like(rss)
        for i in range(model.ROWS - 1):
            e, _ = model.innovate(self.p, self.block[i])
            squares = np.where(self.in_block > i, squares + e * e, squares)
        yy = values[model.YY]
        weight = values[model.WEIGHT] + self.in_block.astype(np.float32)
        return (yy + rss) + squares, RESIDUAL_FLOOR * yy, weight

    def _every_row(self, taken: Mask, g: Float32, e: Float32, reason: Reasons) -> None:
        if not taken.any():
            return
        rhs = g * e
        exact = taken & (self.phase == 0)
        zone = exact & (self.exact_every == 0)
        taken, exact = taken & ~zone, exact & ~zone
        self._in_zone(zone, g, e, rhs, reason)
        if exact.any():
            s, force, _ = self._gather()
            self.s = np.where(exact, s, self.s)
            mixed = (self.gain * (force + rhs)) + ((_F(1) - self.gain) * rhs)
            rhs = np.where(exact, mixed, rhs)
            self.phase[exact] = self.exact_every[exact]
        self.phase -= taken
        self.s = np.where(taken, self.s + model.squared(g), self.s)
        self._solve_system(taken, self.s, rhs, reason)

    def _at_divider(self, taken: Mask, g: Float32, e: Float32, reason: Reasons) -> None:
        if not taken.any():
            return
        self.phase += taken
        self.phase[taken & (self.phase == self.divider)] = 0
        mixes = taken & (self.gain < 1)
        self.innovation = np.where(mixes, self.innovation + g * e, self.innovation)
        projects = taken & (self.phase == np.where(self.staged, 1, 0))
        if projects.any():
            innovation = self.innovation
            self.innovation = np.where(projects, _F(0), innovation)
            zone = projects & (self.dead_zone > 0)
            self._in_zone(zone, g, e, innovation, reason)
            plain = projects & ~zone
            s, force, _ = self._gather()
            s, force = s + model.squared(g), force + g * e
            force = (self.gain * force) + ((_F(1) - self.gain) * innovation)
            self.s = np.where(plain, s, self.s)
            self.force = np.where(plain, force, self.force)
            self._solve_system(plain & ~self.staged, self.s, self.force, reason)
        staged = taken & self.staged & ~projects
        self._solve_system(staged & (self.phase == 2), self.s, self.force, reason)
        folds = staged & (self.phase >= 5) & (self.phase <= 7) & (self.in_block < 3) & (self.age >= self.fold_every)
        for third in range(3):
            due = folds & (self.in_block == third)
            if due.any():
                self._fold(due, slice(_THIRDS[third], _THIRDS[third + 1]))
                if third == 2:
                    self.age = np.where(due, self.age - self.fold_every, self.age)

    def _factor(self, s: Float32) -> _Factor:
        s00, s11, s22 = s[0] + self.prior[0], s[3] + self.prior[1], s[5] + self.prior[2]
        inverse2 = _F(1) / s22
        l02, l12 = s[2] * inverse2, s[4] * inverse2
        pivot1 = s11 - (l12 * s[4])
        c01 = s[1] - (l02 * s[4])
        inverse1 = _F(1) / pivot1
        l01 = c01 * inverse1
        pivot0 = (s00 - (l02 * s[2])) - (l01 * c01)
        solvable = _positive_normal(s22) & _positive_normal((s00 + s11) + s22)
        solvable &= (pivot1 >= _PIVOT_MIN * s11) & (pivot0 >= _PIVOT_MIN * s00)
        own = pivot0 >= _F(2) * self.prior[0]
        excited = (pivot0 >= self.kappa_min * s00) & (own | ~(self.kappa_min > 0))
        reason = np.where(excited, Reason.UPDATED, Reason.HELD_NOT_EXCITED)
        reason = np.where(solvable, reason, Reason.HELD_SINGULAR).astype(np.uint8)
        return _Factor(l01, l02, l12, inverse1, inverse2, pivot0, reason)

    def _solve_system(self, due: Mask, s: Float32, rhs: Float32, reason: Reasons) -> None:
        """Solves and moves p in the lanes that are due; writes their reasons."""
        if not due.any():
            return
        factor = self._factor(s)
        dp = factor.back(rhs)
        size = (dp / self.p).view(np.uint32) & np.uint32(0x7FFFFFFF)
        largest = size.max(axis=0)
        limited = largest > self.step_limit.view(np.uint32)
        found = factor.reason.copy()
        finite = largest < np.uint32(0x7F800000)
        found[(found == Reason.UPDATED) & ~finite] = Reason.HELD_SINGULAR
        moving = due & (found == Reason.UPDATED)
        part = np.where(limited, self.step_limit / largest.view(np.float32), _F(1)).astype(np.float32, copy=False)
        x = self.p + part * dp
        slack = (x - self.lower) * (self.upper - x)
        bounded = (slack.view(np.int32) < 0).any(axis=0)
        clamped = np.where(x > self.upper, self.upper, x)
        clamped = np.where(clamped < self.lower, self.lower, clamped)
        self.p = np.where(moving, np.where(bounded, clamped, x), self.p)
        reason[due] = found[due]
        self.counters["limited"] += moving & limited
        self.counters["bounded"] += moving & bounded
        self.counters["updates"] += moving
        self.counters["held_singular"] += due & (found == Reason.HELD_SINGULAR)
        self.counters["held_not_excited"] += due & (found == Reason.HELD_NOT_EXCITED)

    def _in_zone(self, due: Mask, g: Float32, e: Float32, innovation: Float32, reason: Reasons) -> None:
        """A solve with a dead zone, from all rows."""
        if not due.any():
            return
        s, force, rss = self._gather()
        residual, floor, weight = self._residual(rss)
        s, force = s + model.squared(g), force + g * e
        residual, weight = residual + e * e, weight + _F(1)
        factor = self._factor(s)
        x = factor.back(force)
        square = ((force[0] * x[0]) + (force[1] * x[1])) + (force[2] * x[2])
        found = self._variance_of(residual, floor, weight)
        noise = np.where(found < self.row_variance, found, self.row_variance)
        rests = due & (factor.reason == Reason.UPDATED) & (square <= self.dead_zone * (self.correlation * noise))
        reason[rests] = Reason.UPDATED
        self.counters["in_dead_zone"] += rests
        force = (self.gain * force) + ((_F(1) - self.gain) * innovation)
        self._solve_system(due & ~rests, s, force, reason)

    # ---- accuracy

    def _variance_of(self, residual: Float32, floor: Float32, weight: Float32) -> Float32:
        freedom = weight - _F(model.N_P)
        total = capped(residual)
        return np.where(freedom >= 1, np.where(total > floor, total, floor) / freedom, self.row_variance)

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_strong_assess_f32 of every lane."""
        with np.errstate(all="ignore"):
            packed, _, rss = self._gather()
            residual, floor, weight = self._residual(rss)
            s = np.zeros((3, 3, len(weight)), np.float32)
            s[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]] = packed
            return self._assess(weight[None], s, self._variance_of(residual, floor, weight))
