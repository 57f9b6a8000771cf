"""Twin of estimator_f32.c: one tick of every lane at a time.

`Estimator` is the twin of direct_f32.c, the engine of the strong form.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig
from pvid.twin import estimates
from pvid.twin.f32 import cholesky
from pvid.twin.f32.information import Information
from pvid.twin.record import COUNTERS

Float32 = npt.NDArray[np.float32]

ROW_LIMIT = np.float32(1.0e14)
RESIDUAL_FLOOR = np.float32(4.8e-7)
RESIDUAL_MAX = np.float32(1e30)


def capped(residual: Float32) -> Float32:
    """At most RESIDUAL_MAX; NaN becomes RESIDUAL_MAX."""
    return np.where(residual <= RESIDUAL_MAX, residual, RESIDUAL_MAX)


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
