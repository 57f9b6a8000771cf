"""Twin of trust_f32.c: which estimate is published, in every lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.f32 import TrustConfig
from pvid.twin import estimates
from pvid.twin.f32.estimator import RelativeEstimator

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

_SHORT, _LONG, _LONG_MEMORY = 8, 16, np.float32(4096)
_ARRIVED, _SMALL_STEP, _VARIANCE_RATIO_MAX = np.float32(0.3), np.float32(1e-4), np.float32(1e6)
_SETTLED_STEP, _SMALL_ERROR = np.float32(0.02), np.float32(0.1)
_FADE, _FADE_GROUPS = np.float32(0.3), 4
_COUNT_MAX = 0xFFFF


def uninformative_groups(uninformative: npt.NDArray[np.int64], stepped: Mask, is_back: Mask) -> npt.NDArray[np.int64]:
    """Consecutive groups without a step [lanes]: pvid_trust_count_uninformative of verdict.h."""
    return np.where(stepped | is_back, 0, np.minimum(uninformative + 1, _COUNT_MAX))


def report(
    counters: dict[str, npt.NDArray[np.int64]],
    reason: npt.NDArray[np.uint8],
    excited: Mask,
    sure: Mask,
    misfit: Mask,
) -> npt.NDArray[np.uint8]:
    """pvid_trust_report of verdict.h: counts the verdicts and returns the reasons to report [lanes]."""
    stepped = reason == Reason.UPDATED
    reported = reason.copy()
    reported[stepped & ~excited] = Reason.HELD_NOT_EXCITED
    reported[stepped & excited & ~sure] = Reason.HELD_UNCERTAIN
    reported[stepped & excited & sure & misfit] = Reason.MISFIT
    counters["misfits"] += reported == Reason.MISFIT
    counters["held_uncertain"] += reported == Reason.HELD_UNCERTAIN
    counters["held_not_excited"] += stepped & ~excited
    return reported


class Trust:
    """pvid_trust_f32 of every lane of an estimator; `estimate` is what is published, estimates.F32 [lanes]."""

    def __init__(self, config: TrustConfig, estimator: RelativeEstimator) -> None:
        self.config = replace(config)
        self.estimator = estimator
        lanes = estimator.p.shape[1]
        self.groups = 0
        self.uninformative = np.zeros(lanes, np.int64)
        self.judged = np.zeros(lanes, np.int64)
        information = estimator.information
        with np.errstate(all="ignore"):
            memory = information.block.astype(np.float32) / (np.float32(1) - information.retention)
        memory = np.where((information.retention < 1) & (memory < _LONG_MEMORY), memory, _LONG_MEMORY)
        self.long_memory = np.maximum(memory, np.float32(_LONG)).astype(np.int64)
        self.next = np.zeros(lanes, np.int64)
        self.groups_to_fade = np.zeros(lanes, np.int64)
        self.errors_small = np.zeros(lanes, np.bool_)
        self.converged = np.zeros(lanes, np.bool_)
        self.published = np.zeros(lanes, np.bool_)
        self.misfit = np.zeros(lanes, np.bool_)
        self.long_mean = np.zeros(lanes, np.float32)
        self.recent = np.zeros((_SHORT, lanes), np.float32)
        self.estimate = np.zeros(lanes, estimates.F32)
        self.place()
        for a, sd in enumerate(estimator.start_sd):
            self.estimate["se"][:, a] = sd
            self.estimate["covariance"][:, a, a] = sd * sd

    def place(self) -> None:
        """Publishes the start again."""
        self.estimate["p"][:, : len(self.estimator.p)] = self.estimator.p.T
        self.anchor = self.estimator.p.copy()

    @property
    def fallback(self) -> tuple[Mask, Float32]:
        """Lanes in which p may revert, and the p to revert to [n_p, lanes]."""
        some = (self.config.revert_after > 0) & (self.uninformative >= self.config.revert_after)
        return some, np.ascontiguousarray(self.estimate["p"][:, : len(self.estimator.p)].T)

    def _add_variance_ratio(self, lanes: Mask, variance_ratio: Float32) -> Mask:
        """Lanes in which the short or the long mean exceeds its limit."""
        x = np.where(variance_ratio <= _VARIANCE_RATIO_MAX, variance_ratio, _VARIANCE_RATIO_MAX)
        self.judged = np.where(lanes & (self.judged < self.long_memory), self.judged + 1, self.judged)
        with np.errstate(all="ignore"):
            mean = self.long_mean + (x - self.long_mean) / self.judged.astype(np.float32)
        self.long_mean = np.where(lanes, mean, self.long_mean)
        places = np.flatnonzero(lanes)
        self.recent[self.next[places], places] = x[places]
        self.next = np.where(lanes, (self.next + 1) % _SHORT, self.next)
        total = np.zeros(len(x), np.float32)
        for i in range(_SHORT):
            total = total + self.recent[i]
        limit = np.float32(self.config.misfit_max)
        short_exceeds = (self.judged >= _SHORT) & (total > np.float32(1.5) * (limit * np.float32(_SHORT)))
        long_exceeds = (self.judged >= _LONG) & (self.long_mean > limit)
        return lanes & (short_exceeds | long_exceeds)

    def _restart_alarm(self, lanes: Mask) -> None:
        self.judged = np.where(lanes, 0, self.judged)
        self.next = np.where(lanes, 0, self.next)
        self.long_mean = np.where(lanes, np.float32(0), self.long_mean)
        self.recent = np.where(lanes, np.float32(0), self.recent)

    def _all_agree(self, candidate: npt.NDArray[np.void]) -> Mask:
        freedom = candidate["weight"] - np.float32(len(self.estimator.p))
        chance = np.sqrt(np.float32(2) / np.where(freedom >= 1, freedom, np.float32(1)))
        limit = np.float32(self.config.misfit_max)
        return np.asarray(candidate["misfit"] <= limit * (np.float32(1) + np.float32(3) * chance))

    def renew(self, lanes: Mask) -> None:
        """pvid_trust_renew_f32 in the given lanes."""
        self.groups_to_fade = np.where(lanes, _FADE_GROUPS, self.groups_to_fade)
        self.anchor = np.where(lanes, self.estimator.p, self.anchor)
        self._restart_alarm(lanes)

    def next_fade_factor(self) -> Float32:
        """pvid_trust_fade_factor_f32 [lanes]."""
        fading = (self.groups_to_fade > 0) & self.errors_small
        factor = np.where(fading, _FADE, np.float32(1))
        self.groups_to_fade = np.where(fading, self.groups_to_fade - 1, self.groups_to_fade)
        return factor.astype(np.float32, copy=False)

    def _renew_if_stale(self, lanes: Mask, errors_small: Mask, agrees: Mask) -> None:
        renewal = np.float32(self.config.renewal)
        moved = np.zeros(len(lanes), np.bool_)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                part = self.estimator.p[a] / self.anchor[a] - np.float32(1)
                moved = moved | (part > renewal) | (part < -renewal)
        stale = lanes & ((errors_small & ~agrees & moved) | self.estimator.rounded)
        self.renew(stale)
        self.anchor = np.where(lanes & ~stale & errors_small & agrees, self.estimator.p, self.anchor)

    def largest_error(self, candidate: npt.NDArray[np.void]) -> Float32:
        """pvid_trust_largest_error_f32 [lanes]."""
        largest_error = np.zeros(len(candidate), np.float32)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                relative = candidate["se"][:, a] / candidate["p"][:, a]
                largest_error = np.where(relative <= largest_error, largest_error, relative)
        return largest_error

    def _raise_alarm(
        self, settled: Mask, errors_small: Mask, variance_ratio: Float32, candidate: npt.NDArray[np.void]
    ) -> None:
        """Sets the alarm and renews the sums if they are stale; settled: the last step was small [lanes]."""
        agrees = self._all_agree(candidate)
        renewing = self.groups_to_fade > 0
        self.errors_small = errors_small
        self._restart_alarm(renewing)
        short_exceeds = self._add_variance_ratio(~renewing & self.converged, variance_ratio)
        self.misfit = (self.config.misfit_max > 0) & (~agrees | short_exceeds)
        self.converged = self.converged | (~renewing & settled & errors_small & (self.groups >= self.config.groups_min))
        if self.config.renewal > 0:
            self._renew_if_stale(settled & ~renewing, errors_small, agrees)

    def judge(
        self,
        reason: npt.NDArray[np.uint8],
        size: Float32,
        above_noise: Mask,
        variance_ratio: Float32,
        candidate: npt.NDArray[np.void],
    ) -> npt.NDArray[np.uint8]:
        """pvid_trust_judge_f32 in every lane; shapes [lanes]."""
        self.groups = min(self.groups + 1, _COUNT_MAX)
        if (reason == Reason.ACCUMULATED).all():
            return reason
        stepped = reason == Reason.UPDATED
        self.uninformative = uninformative_groups(self.uninformative, stepped, self.fallback[0])
        with np.errstate(all="ignore"):
            error = self.largest_error(candidate)
            part = _ARRIVED * error
            arrived = size <= np.where(part > _SMALL_STEP, part, _SMALL_STEP)
            self._raise_alarm(stepped & (size <= _SETTLED_STEP), error <= _SMALL_ERROR, variance_ratio, candidate)
        enough_kappa = np.float32(self.config.kappa_min)
        excited = above_noise & (candidate["kappa"] >= enough_kappa) & (candidate["least_pivot"] >= enough_kappa)
        enough = self.groups >= self.config.groups_min
        sure = enough & (error <= np.float32(self.config.se_max)) & arrived
        good = stepped & excited & sure
        self.estimate = np.where(good, candidate, self.estimate)
        self.published = self.published | good
        return report(self.estimator.counters, reason, excited, sure, self.misfit)
