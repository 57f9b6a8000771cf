"""Twin of estimator_f32.c: one tick of every lane at a time.

`Estimator` is the twin of direct_f32.c, the engine of the strong form. `RelativeEstimator` is the twin of staged_f32.c,
the engine of the weak form, with b = B - M theta and rr.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig
from pvid.twin import estimates
from pvid.twin.f32 import cholesky
from pvid.twin.f32.information import Information
from pvid.twin.f32.pattern import PatternModel
from pvid.twin.record import COUNTERS

Float32 = npt.NDArray[np.float32]

ROW_LIMIT = np.float32(1.0e14)
RESIDUAL_FLOOR = np.float32(4.8e-7)
RESIDUAL_MAX = np.float32(1e30)
ROUNDING = np.float32(2.4e-7)  # of a step's terms


def capped(residual: Float32) -> Float32:
    """At most RESIDUAL_MAX; NaN becomes RESIDUAL_MAX."""
    return np.where(residual <= RESIDUAL_MAX, residual, RESIDUAL_MAX)


def _squares(n: Float32, y: Float32) -> Float32:
    """Y^2 + N_0^2 + N_1^2 + .., summed in this order [lanes]."""
    each = np.concatenate([y[None], n])
    total: Float32 = np.add.accumulate(each * each)[-1]
    return total


def _lanes(values: Sequence[float]) -> Float32:
    return np.array(values, np.float32)


class Estimator:
    """pvid_estimator_f32 in every lane; one EstimatorConfig a lane.

    p float32 [n_p, lanes], counters: name -> int64 [lanes].
    """

    def __init__(
        self,
        configs: Sequence[EstimatorConfig],
        update_rate: float,
        n_p: int,
        n_sums: int,
    ) -> None:
        rate = np.float32(update_rate)
        stack = {
            name: np.stack([np.asarray(getattr(c, name), np.float32)[:n_p] for c in configs], axis=1)
            for name in ("start", "start_sd", "lower", "upper")
        }
        row_sd = _lanes([c.row_sd for c in configs])
        ratio = row_sd / stack["start_sd"]
        self.p = stack["start"].copy()
        self.prior = ratio * ratio
        self.start_sd = stack["start_sd"]
        self.lower = stack["lower"]
        self.upper = stack["upper"]
        self.row_variance = row_sd * row_sd
        self.correlation = _lanes([c.correlation for c in configs])
        self.step_limit = _lanes([c.step_limit for c in configs])
        self.kappa_min = _lanes([c.kappa_min for c in configs])
        dead_zone = _lanes([c.dead_zone for c in configs])
        self.dead_zone = dead_zone * dead_zone
        self.divider = np.array([c.divider for c in configs])
        self.phase = np.zeros(len(configs), np.int64)
        self.gain = np.array([self._gain(c, rate) for c in configs], np.float32)
        self.innovation = np.zeros_like(self.p)
        self.forgetting_s = _lanes([c.forgetting_s for c in configs])
        self.information = Information(n_sums, self.forgetting_s * rate)
        self.sums = self.information.read()
        self.counters = {name: np.zeros(len(configs), np.int64) for name in COUNTERS}
        self.size = np.zeros(len(configs), np.float32)

    @staticmethod
    def _gain(config: EstimatorConfig, rate: np.float32) -> np.float32:
        if config.law is Law.PSEUDOVELOCITY:
            return np.float32(0)
        gain = (np.float32(config.feedback_hz) * np.float32(config.divider)) / rate
        return np.float32(gain if config.feedback_hz > 0 and gain < 1 else 1)

    def _reference(self) -> Float32:
        """Reference of the relative size of a step [n_p, lanes]."""
        return self.p

    def _step_from(
        self,
        s: Float32,
        force: Float32,
        gain: Float32,
        due: npt.NDArray[np.bool_],
        above_noise: npt.NDArray[np.bool_],
    ) -> tuple[Float32, npt.NDArray[np.uint8], npt.NDArray[np.bool_]]:
        """p after a step from S and F, the reason (UPDATED, or why p is held), and whether p is within its dead zone
        [lanes]."""
        for a in range(len(self.p)):
            s[a, a] = s[a, a] + self.prior[a]
        rhs = gain * force + (np.float32(1) - gain) * self.innovation
        self.innovation = np.where(due, np.float32(0), self.innovation)
        f = cholesky.factor(s)
        own = (f.first_pivot * s[0, 0]) >= (np.float32(2) * self.prior[0])
        excited = above_noise & (f.first_pivot >= self.kappa_min) & (own | ~(self.kappa_min > 0))
        in_dead_zone = due & f.ok & excited & self._at_rest(f, force)
        dp = cholesky.solve(f, rhs)
        magnitudes = (dp / self._reference()).view(np.uint32) & np.uint32(0x7FFFFFFF)
        size = magnitudes.max(axis=0).view(np.float32)
        moving = due & f.ok & excited & np.isfinite(size) & ~in_dead_zone
        self.size = np.where(moving, size, np.float32(0))
        limited = size > self.step_limit
        factor = np.where(limited, self.step_limit / size, np.float32(1)).astype(np.float32, copy=False)
        x = self.p + factor * dp
        above = x > self.upper
        x = np.where(above, self.upper, x)
        below = x < self.lower
        x = np.where(below, self.lower, x)
        reason = np.full(len(due), Reason.UPDATED, np.uint8)
        reason[~np.isfinite(size) & ~in_dead_zone] = Reason.HELD_SINGULAR
        reason[~excited] = Reason.HELD_NOT_EXCITED
        reason[~f.ok] = Reason.HELD_SINGULAR
        self.counters["limited"] += moving & limited
        self.counters["bounded"] += moving & (above | below).any(axis=0)
        self.counters["held_not_excited"] += due & (reason == Reason.HELD_NOT_EXCITED)
        self.counters["held_singular"] += due & (reason == Reason.HELD_SINGULAR)
        self.counters["in_dead_zone"] += in_dead_zone
        return x, reason, in_dead_zone

    def _at_rest(self, f: cholesky.Factor, force: Float32) -> npt.NDArray[np.bool_]:
        """Where p is within the dead zone: f the factor of S + H0."""
        if not (self.dead_zone > 0).any():
            return np.zeros(len(self.dead_zone), np.bool_)
        sums = self.information.read()
        found = self._variance(sums, self._assessed(sums)[1])
        x = cholesky.solve(f, force)
        square = np.zeros(len(found), np.float32)
        for a in range(len(x)):
            square = square + force[a] * x[a]
        noise = np.where(found < self.row_variance, found, self.row_variance)
        return (self.dead_zone > 0) & (square <= self.dead_zone * (self.correlation * noise))

    def _assessed(self, sums: Float32) -> tuple[Float32, Float32]:
        """S [n_p, n_p, lanes] and the sum of squared residuals [lanes], not below its rounding."""
        raise NotImplementedError

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimator_assess_f32 of every lane, dtype estimates.F32 [lanes]."""
        with np.errstate(all="ignore"):
            sums = self.information.read()
            s, residual = self._assessed(sums)
            return self._assess(sums, s, self._variance(sums, residual))

    def misfit(self, sums: Float32) -> Float32:
        """Residual variance over its expectation [lanes]; 0: the strong form has no expectation."""
        return np.zeros(sums.shape[1], np.float32)

    def _variance(self, sums: Float32, residual: Float32) -> Float32:
        """s^2 of a row [lanes]."""
        freedom = sums[-1] - np.float32(len(self.p))
        return np.where(freedom >= 1, residual / freedom, self.row_variance)

    def _assess(self, sums: Float32, s: Float32, variance: Float32) -> npt.NDArray[np.void]:
        n_p = len(self.p)
        weight = sums[-1]
        kappa = cholesky.factor(s)
        most = np.ones(len(weight), np.float32)
        for j in range(len(kappa.u)):
            scaled = kappa.u[j, j] * kappa.scale[j]
            inflation = (scaled * scaled) * s[j, j]
            most = np.where(inflation > most, inflation, most)
        wide = variance * self.correlation
        for a in range(n_p):
            s[a, a] = s[a, a] + wide / (self.start_sd[a] * self.start_sd[a])
        f = cholesky.factor(s)
        covariance = cholesky.inverse(f) * wide
        se = np.sqrt(np.stack([covariance[a, a] for a in range(n_p)]))
        known = f.ok & np.isfinite(covariance).all(axis=(0, 1)) & np.isfinite(se).all(axis=0)
        out = np.zeros(self.p.shape[1], estimates.f32_of(n_p))
        out["p"][:, :n_p] = self.p.T
        out["kappa"] = np.where(kappa.ok, kappa.first_pivot, np.float32(0))
        out["least_pivot"] = np.where(kappa.ok, np.float32(1) / most, np.float32(0))
        out["residual_sd"] = np.sqrt(variance)
        out["weight"] = weight
        out["misfit"] = self.misfit(sums)
        for a in range(n_p):
            start_variance = self.start_sd[a] * self.start_sd[a]
            out["se"][:, a] = np.where(known, se[a], self.start_sd[a])
            for b in range(n_p):
                unknown = start_variance if a == b else np.float32(0)
                out["covariance"][:, a, b] = np.where(known, covariance[a, b], unknown)
        return out


class RelativeEstimator(Estimator):
    """pvid_estimator_f32 on a model known by its pattern. All lanes share law, feedback and divider.

    theta float32 [n_theta, lanes] is f(p); B and yy are b = B - M theta and the sum of squared residuals.
    """

    _ROWS_PER_STAGE = 3
    _COLUMNS_PER_STAGE = 2

    def __init__(self, configs: Sequence[EstimatorConfig], update_rate: float, pattern: PatternModel) -> None:
        super().__init__(configs, update_rate, pattern.n_p, pattern.n_sums)
        schedules = {(c.law, c.feedback_hz, c.divider) for c in configs}
        if len(schedules) != 1:
            raise PvidError("lanes of one twin must share law, feedback and divider: their schedules differ")
        self.model = pattern
        with np.errstate(all="ignore"):
            self.theta = pattern.theta(self.p)
        self.row_weight = _lanes([c.row_weight for c in configs])
        self.noise_margin = _lanes([c.noise_margin for c in configs])
        self.rss = np.zeros(len(configs), np.float32)
        self.expected = np.zeros(len(configs), np.float32)
        self.everywhere = np.ones(len(configs), np.bool_)
        self.was_due = True

    @property
    def is_rate(self) -> bool:
        """Whether the law is a rate (g < 1) that does not iterate."""
        return bool(self.gain[0] < 1)

    def add(self, n: Float32, y: Float32, kind: int = 0) -> npt.NDArray[np.uint8]:
        """One row of a group: N [theta of this kind, lanes], Y [lanes]."""
        block = self.model.blocks.of_kind[kind]
        with np.errstate(all="ignore"):
            fits = _squares(n, y) <= ROW_LIMIT * ROW_LIMIT
            not_finite = ~fits & ~(np.isfinite(n).all(axis=0) & np.isfinite(y))
            e = y
            for entry, theta in zip(n, self.theta[block], strict=True):
                e = e - entry * theta
            fits = fits & (e * e <= ROW_LIMIT * ROW_LIMIT)
            if self.is_rate:
                gradient = self.model.transpose_times(self.model.jacobian(self.p), n, kind)
                self.innovation = np.where(fits, self.innovation + gradient * e, self.innovation)
            self.rss = np.where(fits, self.rss + e * e, self.rss)
            self.sums = self.information.add(self.model.terms(kind, n, e, self.row_weight), fits)
        reason = np.full(len(y), Reason.ACCUMULATED, np.uint8)
        reason[~fits] = Reason.REJECTED_SATURATED
        reason[not_finite] = Reason.REJECTED_NOT_FINITE
        self.counters["rows"] += fits
        self.counters["rejected_saturated"] += reason == Reason.REJECTED_SATURATED
        self.counters["rejected_not_finite"] += not_finite
        return reason

    def add_to_b(self, g: Float32) -> npt.NDArray[np.uint8]:
        """pvid_estimator_add_to_b_f32: g [n_theta, lanes]."""
        finite = np.isfinite(g).all(axis=0)
        fits = finite & (np.abs(g) <= ROW_LIMIT * ROW_LIMIT).all(axis=0)
        places = slice(self.model.moments, -2)
        with np.errstate(all="ignore"):
            low = self.information.low.copy()
            low[places] = np.where(fits, low[places] + g, low[places])
            self.information.low = low
            if self.is_rate:
                gradient = self.model.transpose_times(self.model.jacobian(self.p), g)
                self.innovation = np.where(fits, self.innovation + gradient, self.innovation)
            self.sums = self.information.read()
        reason = np.full(g.shape[1], Reason.ACCUMULATED, np.uint8)
        reason[~fits] = Reason.REJECTED_SATURATED
        reason[~finite] = Reason.REJECTED_NOT_FINITE
        self.counters["rejected_saturated"] += finite & ~fits
        self.counters["rejected_not_finite"] += ~finite
        return reason

    def solve(
        self, ends_group: bool, fallback: tuple[npt.NDArray[np.bool_], Float32] | None = None
    ) -> Iterator[npt.NDArray[np.uint8] | None]:
        """The stages of a solve: None while it is in progress, the reasons [lanes] at the last one.

        fallback: lanes in which p reverts if no step is allowed, and the p to revert to.
        """
        reason = np.full(len(self.phase), Reason.ACCUMULATED, np.uint8)
        self.was_due = True
        self.size = np.zeros(len(reason), np.float32)
        if ends_group:
            self.rss = np.zeros_like(self.rss)
            self.phase += 1
            self.was_due = bool(self.phase[0] >= self.divider[0])
        elif self.is_rate:
            yield reason
            return
        if self.was_due:
            if ends_group:
                self.phase[:] = 0
            for _ in range(self.solve_stages(False) - 1):
                yield None
            with np.errstate(all="ignore"):
                reason = self._commit(self.gain if ends_group else np.ones_like(self.gain), fallback)
            self.sums = self.information.read()
            yield None if ends_group else reason
        if ends_group:
            self.information.end_group(self.everywhere)
            self.sums = self.information.read()
            yield reason

    @property
    def _projection_stages(self) -> int:
        columns = self.model.c_column
        return 2 + sum(1 + -(-columns.count(a) // self._COLUMNS_PER_STAGE) for a in range(self.model.n_p))

    def solve_stages(self, ends_group: bool) -> int:
        """Stages of a solve that is due."""
        return self._projection_stages + 5 + -(-self.model.n_theta // self._ROWS_PER_STAGE) + ends_group

    @property
    def assess_solved_stages(self) -> int:
        """Stages of an assessment behind a solve."""
        return 4 + self.model.n_p

    def _commit(self, gain: Float32, fallback: tuple[npt.NDArray[np.bool_], Float32] | None) -> npt.NDArray[np.uint8]:
        pattern = self.model
        sums = self.information.read()
        matrix = pattern.matrix(sums)
        b = sums[pattern.moments : pattern.moments + pattern.n_theta]
        c = pattern.jacobian(self.p)
        force = pattern.transpose_times(c, b)
        s = pattern.project(c, matrix)
        x, reason, in_dead_zone = self._step_from(s, force, gain, self.everywhere, self.everywhere)
        stepping = (reason == Reason.UPDATED) & ~in_dead_zone
        x = np.where(stepping, x, self.p)
        falls_back = np.zeros_like(stepping)
        if fallback is not None:
            falls_back = ~stepping & ~in_dead_zone & fallback[0]
            x = np.where(falls_back, fallback[1], x)
        theta = pattern.theta(x)
        step = theta - self.theta
        moved = pattern.times(matrix, step)
        fall = np.zeros(len(reason), np.float32)
        size = np.zeros(len(reason), np.float32)
        for i in range(pattern.n_theta):
            fall = fall + step[i] * (b[i] + (b[i] - moved[i]))
            size = size + matrix[i, i] * (step[i] * step[i])
        residual = self.information.low[-2] - fall
        finite = np.isfinite(fall) & np.isfinite(residual)
        overflow = stepping & ~finite
        reason[overflow] = Reason.HELD_SINGULAR
        self.counters["held_singular"] += overflow
        moving = (stepping | falls_back) & finite
        places = slice(pattern.moments, pattern.moments + pattern.n_theta)
        low = self.information.low.copy()
        low[places] = low[places] - moved
        low[-2] = residual
        self.information.low = np.where(moving, low, self.information.low)
        lost = capped(self.information.rounding + ROUNDING * size)
        self.information.rounding = np.where(moving, lost, self.information.rounding)
        self.theta = np.where(moving, theta, self.theta)
        self.p = np.where(moving, x, self.p)
        self.counters["updates"] += moving & stepping
        return reason

    def place(self, p: Float32) -> None:
        """Sets p [n_p, lanes] before the first row, within its bounds; an entry that is not finite is ignored."""
        x = np.where(p < self.lower, self.lower, p)
        self.p = np.where(np.isfinite(p), np.where(x > self.upper, self.upper, x), self.p)
        with np.errstate(all="ignore"):
            self.theta = self.model.theta(self.p)

    def _reference(self) -> Float32:
        positive = np.array(self.model.positive)[:, None]
        return np.where(positive, self.p, self.start_sd)

    def _assessed(self, sums: Float32) -> tuple[Float32, Float32]:
        s = self.model.project(self.model.jacobian(self.p), self.model.matrix(sums))
        return s, self._residual(sums, self.information.rounding)

    def _residual(self, sums: Float32, rounding: Float32) -> Float32:
        """The sum of squared residuals [lanes], not below its rounding and its expectation."""
        floor = self.expected * (sums[-1] - np.float32(len(self.p)))
        residual = capped(sums[-2] + rounding)
        return np.where(residual > floor, residual, floor)

    def misfit(self, sums: Float32) -> Float32:
        """pvid_estimator_misfit_f32 [lanes]."""
        freedom = sums[-1] - np.float32(len(self.p))
        explained = freedom * self.expected
        known = (freedom >= 1) & (explained > 0) & (sums[-2] > 0)
        return np.where(known, capped(sums[-2] / explained), np.float32(0))
