"""Twin of trust_q31.c: which estimate is published, in every lane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.q31 import TrustConfigQ31
from pvid.twin import estimates
from pvid.twin.f32.trust import report, uninformative_groups
from pvid.twin.q31.estimator import ONE, SIZE_BITS, EstimatorQ31
from pvid.twin.q31.integer import Int, clamp, round_shift, square_root

Mask = npt.NDArray[np.bool_]
Reasons = npt.NDArray[np.uint8]

VARIANCE_RATIO_BITS = 24
_SHORT, _LONG, _LONG_MEMORY = 8, 16, 4096
_ARRIVED = 19661  # 0.3 in Q16
_SMALL_STEP = (1 << SIZE_BITS) // 10000
_VARIANCE_RATIO_MAX = 1_000_000 << VARIANCE_RATIO_BITS
_ERROR_BITS = 24
_COUNT_MAX = 0xFFFF
_SETTLED_STEP = (1 << SIZE_BITS) // 50
_SMALL_ERROR = (1 << _ERROR_BITS) // 10
_FADE, _FADE_GROUPS = 644245094, 4  # 0.3 in Q31


class TrustQ31:
    """pvid_trust_q31 of every lane of an estimator; `estimate` is what is published, estimates.Q31 [lanes]."""

    def __init__(self, config: TrustConfigQ31, estimator: EstimatorQ31) -> None:
        self.config = config
        self.estimator = estimator
        lanes = estimator.lanes
        self.groups = 0
        self.uninformative = np.zeros(lanes, np.int64)
        self.judged = np.zeros(lanes, np.int64)
        self.long_memory = np.clip((estimator.block << 31) // (2**31 - estimator.retention), _LONG, _LONG_MEMORY)
        self.next = np.zeros(lanes, np.int64)
        self.groups_to_fade = np.zeros(lanes, np.int64)
        self.errors_small = np.zeros(lanes, np.bool_)
        self.converged = np.zeros(lanes, np.bool_)
        self.published = np.zeros(lanes, np.bool_)
        self.misfit = np.zeros(lanes, np.bool_)
        self.long_mean = np.zeros(lanes, np.int64)
        self.recent = np.zeros((_SHORT, lanes), np.int64)
        self.estimate = np.zeros(lanes, estimates.Q31)
        self.place()
        for a, sd in enumerate(estimator.start_sd):
            self.estimate["se"][:, a] = sd
            self.estimate["correlation"][:, a, a] = ONE

    def place(self) -> None:
        """Publishes the start again."""
        self.estimate["p"][:, : len(self.estimator.p)] = self.estimator.p.T
        self.anchor = self.estimator.p.copy()

    @property
    def fallback(self) -> tuple[Mask, Int]:
        """Lanes in which p may revert, and the p to revert to [n_p, lanes]."""
        some = (self.config.revert_after > 0) & (self.uninformative >= self.config.revert_after)
        return some, self.estimate["p"][:, : len(self.estimator.p)].T.astype(np.int64)

    def _add_variance_ratio(self, lanes: Mask, variance_ratio: Int) -> Mask:
        """Lanes in which the short or the long mean exceeds its limit."""
        x = clamp(variance_ratio, _VARIANCE_RATIO_MAX)
        self.judged = np.where(lanes & (self.judged < self.long_memory), self.judged + 1, self.judged)
        change = x - self.long_mean
        step = np.sign(change) * (np.abs(change) // np.maximum(self.judged, 1))
        self.long_mean = np.where(lanes, clamp(self.long_mean + step, _VARIANCE_RATIO_MAX), self.long_mean)
        places = np.flatnonzero(lanes)
        self.recent[self.next[places], places] = x[places]
        self.next = np.where(lanes, (self.next + 1) % _SHORT, self.next)
        limit = self.config.misfit_max << (VARIANCE_RATIO_BITS - 16)
        short_exceeds = (self.judged >= _SHORT) & (2 * np.sum(self.recent, axis=0) > 3 * limit * _SHORT)
        long_exceeds = (self.judged >= _LONG) & (self.long_mean > limit)
        return np.asarray(lanes & (short_exceeds | long_exceeds))

    def _restart_alarm(self, lanes: Mask) -> None:
        self.judged = np.where(lanes, 0, self.judged)
        self.next = np.where(lanes, 0, self.next)
        self.long_mean = np.where(lanes, 0, self.long_mean)
        self.recent = np.where(lanes, 0, self.recent)

    def _all_agree(self, candidate: npt.NDArray[np.void]) -> Mask:
        freedom = np.maximum(candidate["weight"].astype(np.int64) - self.estimator.model.n_p, 1)
        chance = square_root((1 << 33) // freedom)
        limit = self.config.misfit_max * ((1 << 16) + 3 * chance)
        return np.asarray((candidate["misfit"].astype(np.int64) << 16) <= limit)

    def next_fade_factor(self) -> Int:
        """pvid_trust_fade_factor_q31 [lanes]."""
        fading = (self.groups_to_fade > 0) & self.errors_small
        self.groups_to_fade = np.where(fading, self.groups_to_fade - 1, self.groups_to_fade)
        return np.where(fading, _FADE, 0)

    def _renew_if_stale(self, lanes: Mask, agrees: Mask) -> None:
        moved = np.zeros(len(lanes), np.bool_)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                way = np.abs(self.estimator.p[a] - self.anchor[a])
                moved = moved | ((way << 16) > self.anchor[a] * self.config.renewal)
        stale = lanes & ~agrees & moved
        self.groups_to_fade = np.where(stale, _FADE_GROUPS, self.groups_to_fade)
        self._restart_alarm(stale)
        self.anchor = np.where(stale | (lanes & agrees), self.estimator.p, self.anchor)

    def _raise_alarm(
        self, settled: Mask, errors_small: Mask, variance_ratio: Int, candidate: npt.NDArray[np.void]
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
            self._renew_if_stale(settled & errors_small & ~renewing, agrees)

    def _largest_error(self, candidate: npt.NDArray[np.void]) -> Int:
        largest_error = np.zeros(len(candidate), np.int64)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                relative = (candidate["se"][:, a].astype(np.int64) << _ERROR_BITS) // candidate["p"][:, a]
                largest_error = np.maximum(largest_error, relative)
        return largest_error

    def judge(
        self, reason: Reasons, size: Int, above_noise: Mask, variance_ratio: Int, candidate: npt.NDArray[np.void]
    ) -> Reasons:
        """pvid_trust_judge_q31 in every lane; shapes [lanes]."""
        self.groups = min(self.groups + 1, _COUNT_MAX)
        if (reason == Reason.ACCUMULATED).all():
            return reason
        stepped = reason == Reason.UPDATED
        self.uninformative = uninformative_groups(self.uninformative, stepped, self.fallback[0])
        error = self._largest_error(candidate)
        self._raise_alarm(stepped & (size <= _SETTLED_STEP), error <= _SMALL_ERROR, variance_ratio, candidate)
        converged = round_shift(clamp(error, 1 << 44) * _ARRIVED, 16 + (_ERROR_BITS - SIZE_BITS))
        arrived = size <= np.maximum(converged, _SMALL_STEP)
        enough_kappa = self.config.kappa_min
        excited = above_noise & (candidate["kappa"] >= enough_kappa) & (candidate["least_pivot"] >= enough_kappa)
        sure = (self.groups >= self.config.groups_min) & (error <= self.config.se_max) & arrived
        good = stepped & excited & sure
        self.estimate = np.where(good, candidate, self.estimate)
        self.published = self.published | good
        return report(self.estimator.counters, reason, excited, sure, self.misfit)
