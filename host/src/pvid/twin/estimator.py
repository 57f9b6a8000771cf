"""Twin of estimator_f32.c on the strong form's model: one tick of every lane at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.native import ESTIMATE_DTYPE, EstimatorConfig, Law, Reason
from pvid.twin import cholesky
from pvid.twin import kapitza_strong as model
from pvid.twin.information import Information

Float32 = npt.NDArray[np.float32]

ROW_LIMIT = np.float32(1.0e14)
RESIDUAL_FLOOR = np.float32(4.8e-7)
_COUNTERS = (
    "rows",
    "updates",
    "limited",
    "bounded",
    "held_not_excited",
    "held_pivot",
    "rejected_not_finite",
    "rejected_saturated",
)


def _lanes(values: Sequence[float]) -> Float32:
    return np.array(values, np.float32)


class Estimator:
    """pvid_estimator_f32 in every lane; one EstimatorConfig a lane.

    p float32 [3, lanes], counters: name -> int64 [lanes].
    """

    def __init__(self, configs: Sequence[EstimatorConfig], update_rate: float) -> None:
        rate = np.float32(update_rate)
        stack = {
            name: np.stack([np.asarray(getattr(c, name), np.float32)[: model.N_P] for c in configs], axis=1)
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
        self.divider = np.array([c.divider for c in configs])
        self.phase = np.zeros(len(configs), np.int64)
        self.gain = np.array([self._gain(c, rate) for c in configs], np.float32)
        self.innovation = np.zeros_like(self.p)
        self.information = Information(model.SUMS, _lanes([c.forgetting_s for c in configs]) * rate)
        self.sums = self.information.read()
        self.counters = {name: np.zeros(len(configs), np.int64) for name in _COUNTERS}

    @staticmethod
    def _gain(config: EstimatorConfig, rate: np.float32) -> np.float32:
        if config.law is Law.PSEUDOVELOCITY:
            return np.float32(0)
        gain = (np.float32(config.feedback_hz) * np.float32(config.divider)) / rate
        return np.float32(gain if config.feedback_hz > 0 and gain < 1 else 1)

    def step(self, n: Float32, y: Float32) -> npt.NDArray[np.uint8]:
        """One row a lane: N [11, lanes], Y [lanes]. Returns the reasons [lanes]; `sums` is up to date after it."""
        with np.errstate(all="ignore"):
            return self._step(n, y)

    def _step(self, n: Float32, y: Float32) -> npt.NDArray[np.uint8]:
        squares = y * y
        for entry in n:
            squares = squares + entry * entry
        usable = squares <= ROW_LIMIT * ROW_LIMIT
        not_finite = ~usable & ~(np.isfinite(n).all(axis=0) & np.isfinite(y))
        saturated = ~usable & ~not_finite
        taken = ~not_finite & ~saturated
        reason = np.full(len(y), Reason.ACCUMULATED, np.uint8)
        reason[not_finite] = Reason.REJECTED_NOT_FINITE
        reason[saturated] = Reason.REJECTED_SATURATED
        self.counters["rejected_not_finite"] += not_finite
        self.counters["rejected_saturated"] += saturated
        if not taken.any():
            return reason
        listening = taken & (self.gain < 1)
        if listening.any():
            e, gradient = model.innovate(self.p, n, y)
            self.innovation = np.where(listening, self.innovation + gradient * e, self.innovation)
        self.sums = self.information.add(model.terms(n, y), taken)
        self.counters["rows"] += taken
        self.phase += taken
        due = taken & (self.phase >= self.divider)
        if due.any():
            self.phase[due] = 0
            reason[due] = self._solve(due)[due]
        self.information.end_group(taken)
        self.sums = self.information.read()
        return reason

    def _solve(self, due: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
        s, force, _ = model.project(self.p, self.sums)
        for a in range(model.N_P):
            s[a, a] = s[a, a] + self.prior[a]
        rhs = self.gain * force + (np.float32(1) - self.gain) * self.innovation
        self.innovation = np.where(due, np.float32(0), self.innovation)
        f = cholesky.factor(s)
        own = (f.first_pivot * s[0, 0]) >= (np.float32(2) * self.prior[0])
        excited = (f.first_pivot >= self.kappa_min) & (own | ~(self.kappa_min > 0))
        dp = cholesky.solve(f, rhs)
        ratio = dp / self.p
        size = np.zeros(len(due), np.float32)
        for a in range(model.N_P):
            one = np.where(ratio[a] < 0, -ratio[a], ratio[a])
            size = np.where(one <= size, size, one)
        moving = due & f.ok & excited & np.isfinite(size)
        limited = size > self.step_limit
        factor = np.where(limited, self.step_limit / size, np.float32(1))
        x = self.p + factor * dp
        above = x > self.upper
        x = np.where(above, self.upper, x)
        below = x < self.lower
        x = np.where(below, self.lower, x)
        self.p = np.where(moving, x, self.p)
        reason = np.full(len(due), Reason.UPDATED, np.uint8)
        reason[~np.isfinite(size)] = Reason.HELD_PIVOT
        reason[~excited] = Reason.HELD_NOT_EXCITED
        reason[~f.ok] = Reason.HELD_PIVOT
        self.counters["updates"] += moving
        self.counters["limited"] += moving & limited
        self.counters["bounded"] += moving & (above | below).any(axis=0)
        self.counters["held_not_excited"] += due & (reason == Reason.HELD_NOT_EXCITED)
        self.counters["held_pivot"] += due & (reason == Reason.HELD_PIVOT)
        return reason

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimator_assess_f32 of every lane, dtype ESTIMATE_DTYPE [lanes]."""
        with np.errstate(all="ignore"):
            return self._assess()

    def _assess(self) -> npt.NDArray[np.void]:
        n_p = model.N_P
        sums = self.information.read()
        s, _, energy = model.project(self.p, sums)
        yy, weight = sums[-2], sums[-1]
        freedom = weight - np.float32(n_p)
        floor = RESIDUAL_FLOOR * yy
        residual = yy + energy
        variance = np.where(
            freedom >= 1, np.where(residual > floor, residual, floor) / freedom, self.row_variance
        )
        kappa = cholesky.factor(s)
        wide = variance * self.correlation
        for a in range(n_p):
            s[a, a] = s[a, a] + wide / (self.start_sd[a] * self.start_sd[a])
        f = cholesky.factor(s)
        covariance = cholesky.inverse(f) * wide
        se = np.sqrt(np.stack([covariance[a, a] for a in range(n_p)]))
        known = f.ok & np.isfinite(covariance).all(axis=(0, 1)) & np.isfinite(se).all(axis=0)
        out = np.zeros(self.p.shape[1], ESTIMATE_DTYPE)
        out["p"][:, :n_p] = self.p.T
        out["kappa"] = np.where(kappa.ok, kappa.first_pivot, np.float32(0))
        out["residual_sd"] = np.sqrt(variance)
        out["weight"] = weight
        for a in range(n_p):
            start_variance = self.start_sd[a] * self.start_sd[a]
            out["se"][:, a] = np.where(known, se[a], self.start_sd[a])
            for b in range(n_p):
                unknown = start_variance if a == b else np.float32(0)
                out["covariance"][:, a, b] = np.where(known, covariance[a, b], unknown)
        return out
