"""What the twins of trust_f32.c and trust_q31.c share: which estimate is published, in every lane."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.record import Array
from pvid.twin.record import Mask, Reasons

Candidate = npt.NDArray[np.void]

SHORT, LONG, LONG_MEMORY = 8, 16, 4096
_FADE_GROUPS = 4
_COUNT_MAX = 0xFFFF
EARLY_WINDOWS = 8


class TrustTwin(ABC):
    """The verdict on every lane of an estimator; `estimate` is what is published [lanes].

    Parameters
    ----------
    config, estimator
        Of one core.
    long_memory
        Windows in the long mean [lanes].
    layout
        Type of an estimate.
    """

    number: ClassVar[type[np.generic]]  # of p and of the means
    settled_step: ClassVar[Any]  # largest step of a settled p
    small_error: ClassVar[Any]
    fade: ClassVar[Any]  # factor of the sums while they fade
    remains: ClassVar[Any]  # and when they begin anew
    keep: ClassVar[Any]  # and while they do not

    def __init__(self, config: Any, estimator: Any, long_memory: Array, layout: np.dtype[np.void]) -> None:
        self.config = config
        self.estimator = estimator
        self.long_memory = long_memory
        lanes = estimator.p.shape[1]
        self.groups = 0
        self.uninformative = np.zeros(lanes, np.int64)
        self.judged = np.zeros(lanes, np.int64)
        self.next = np.zeros(lanes, np.int64)
        self.groups_to_fade = np.zeros(lanes, np.int64)
        self.anew = np.zeros(lanes, np.bool_)
        self.errors_small = np.zeros(lanes, np.bool_)
        self.converged = np.zeros(lanes, np.bool_)
        self.arrived = np.zeros(lanes, np.bool_)
        self.published = np.zeros(lanes, np.bool_)
        self.misfit = np.zeros(lanes, np.bool_)
        self.long_mean: Array = np.zeros(lanes, self.number)
        self.recent: Array = np.zeros((SHORT, lanes), self.number)
        self.estimate = np.zeros(lanes, layout)
        self.place()
        for a, sd in enumerate(estimator.start_sd):
            self.estimate["se"][:, a] = sd

    def steps(self, iterations: int) -> int:
        """Gauss-Newton steps of the present window: pvid_weak_steps of steps.h."""
        return iterations if self.groups < EARLY_WINDOWS else 1

    def place(self) -> None:
        """Publishes the start again."""
        self.estimate["p"][:, : len(self.estimator.p)] = self.estimator.p.T
        self.anchor = self.estimator.p.copy()

    @property
    def fallback(self) -> tuple[Mask, Array]:
        """Lanes in which p may revert, and the p to revert to [n_p, lanes]."""
        some = (self.config.revert_after > 0) & (self.uninformative >= self.config.revert_after)
        return some, np.ascontiguousarray(self.estimate["p"][:, : len(self.estimator.p)].T, self.number)

    def renew(self, lanes: Mask) -> None:
        """Begins to fade the sums in the given lanes, and judges p against its present value."""
        self.groups_to_fade = np.where(lanes, _FADE_GROUPS, self.groups_to_fade)
        self.anchor = np.where(lanes, self.estimator.p, self.anchor)
        self._restart_alarm(lanes)

    def begin_anew(self) -> None:
        """pvid_trust_begin_anew of the core, in all lanes."""
        self.anew = np.ones_like(self.anew)
        self.groups = 0
        self.groups_to_fade = np.zeros_like(self.groups_to_fade)
        self.converged = np.zeros_like(self.converged)
        self.arrived = np.zeros_like(self.arrived)
        self.anchor = self.estimator.p.copy()
        self._restart_alarm(self.anew)

    def next_fade_factor(self) -> Array:
        """pvid_trust_fade_factor of the core [lanes]."""
        fading = ~self.anew & (self.groups_to_fade > 0) & self.errors_small
        self.groups_to_fade = np.where(fading, self.groups_to_fade - 1, self.groups_to_fade)
        factor = np.where(self.anew, self.remains, np.where(fading, self.fade, self.keep))
        self.anew = np.zeros_like(self.anew)
        return np.asarray(factor)

    def largest_error(self, candidate: Candidate) -> Array:
        """Largest relative standard error of a positive parameter [lanes]."""
        largest: Array = np.zeros(len(candidate), self.number)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                relative = self._relative_error(candidate, a)
                largest = np.where(relative <= largest, largest, relative)  # NaN is larger than any number
        return largest

    def judge(
        self, reason: Reasons, size: Array, above_noise: Mask, variance_ratio: Array, candidate: Candidate
    ) -> Reasons:
        """pvid_trust_judge of the core in every lane; shapes [lanes]."""
        verdict = self.decide(reason, size, above_noise, variance_ratio, candidate)
        return self.publish(verdict, reason, candidate)

    def decide(
        self, reason: Reasons, size: Array, above_noise: Mask, variance_ratio: Array, candidate: Candidate
    ) -> Reasons:
        """The verdict on every lane's candidate [lanes]."""
        self.groups = min(self.groups + 1, _COUNT_MAX)
        if (reason == Reason.ACCUMULATED).all():
            return reason
        stepped = reason == Reason.UPDATED
        self._count_uninformative(stepped)
        error = self.largest_error(candidate)
        settled = stepped & (size <= self.settled_step)
        self.arrived = stepped & self._has_arrived(size, error)
        self._raise_alarm(settled, error <= self.small_error, variance_ratio, candidate)
        enough_kappa = self.config.kappa_min
        excited = above_noise & (candidate["kappa"] >= enough_kappa) & (candidate["least_pivot"] >= enough_kappa)
        enough = self.groups >= self.config.groups_min
        sure = enough & (error <= self.config.se_max) & self.arrived
        verdict = reason.copy()
        verdict[stepped & ~excited] = Reason.HELD_NOT_EXCITED
        verdict[stepped & excited & ~sure] = Reason.HELD_UNCERTAIN
        return verdict

    def publish(self, verdict: Reasons, reason: Reasons, candidate: Candidate) -> Reasons:
        """Publishes what is good; reason: of the solve. Returns the reasons to report [lanes]."""
        good = verdict == Reason.UPDATED
        published = self._with_neglected(candidate) if self.config.neglected > 0 else candidate
        self.estimate = np.where(good, published, self.estimate)
        self.published = self.published | good
        return self._report(verdict, reason)

    def _count_uninformative(self, stepped: Mask) -> None:
        """Consecutive groups without a step: pvid_trust_count_uninformative of verdict.h."""
        counted = np.minimum(self.uninformative + 1, _COUNT_MAX)
        self.uninformative = np.where(stepped | self.fallback[0], 0, counted)

    def _report(self, verdict: Reasons, reason: Reasons) -> Reasons:
        """pvid_trust_report of verdict.h: counts the verdicts and returns the reasons to report [lanes]."""
        counters = self.estimator.counters
        reported = verdict.copy()
        reported[(verdict == Reason.UPDATED) & self.misfit] = Reason.MISFIT
        counters["misfits"] += reported == Reason.MISFIT
        counters["held_uncertain"] += reported == Reason.HELD_UNCERTAIN
        counters["held_not_excited"] += (verdict == Reason.HELD_NOT_EXCITED) & (reason == Reason.UPDATED)
        return reported

    # ---- the alarm

    def _raise_alarm(self, settled: Mask, errors_small: Mask, variance_ratio: Array, candidate: Candidate) -> None:
        """Sets the alarm and renews the sums if they are stale; settled: the last step was small [lanes]."""
        agrees = self._all_agree(candidate)
        renewing = self.groups_to_fade > 0
        self.errors_small = errors_small
        self._restart_alarm(renewing)
        exceeds = self._add_variance_ratio(~renewing & self.converged, self._capped(variance_ratio))
        self.misfit = (self.config.misfit_max > 0) & (~agrees | exceeds)
        self.converged = self.converged | (~renewing & settled & errors_small & (self.groups >= self.config.groups_min))
        if self.config.renewal > 0:
            self._renew_if_stale(settled & ~renewing, errors_small, agrees)

    def _restart_alarm(self, lanes: Mask) -> None:
        self.judged = np.where(lanes, 0, self.judged)
        self.next = np.where(lanes, 0, self.next)
        self.long_mean = np.where(lanes, self.number(0), self.long_mean)
        self.recent = np.where(lanes, self.number(0), self.recent)

    def _add_variance_ratio(self, lanes: Mask, x: Array) -> Mask:
        """Lanes in which the short or the long mean, with x, exceeds its limit."""
        self.judged = np.where(lanes & (self.judged < self.long_memory), self.judged + 1, self.judged)
        self.long_mean = np.where(lanes, self._mean_with(x), self.long_mean)
        places = np.flatnonzero(lanes)
        self.recent[self.next[places], places] = x[places]
        self.next = np.where(lanes, (self.next + 1) % SHORT, self.next)
        short, long = self._means_exceed()
        return np.asarray(lanes & (((self.judged >= SHORT) & short) | ((self.judged >= LONG) & long)))

    def _renew_if_stale(self, lanes: Mask, errors_small: Mask, agrees: Mask) -> None:
        moved = np.zeros(len(lanes), np.bool_)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                moved = moved | self._has_moved(a)
        stale = lanes & ((errors_small & ~agrees & moved) | self._is_rounded())
        self.renew(stale)
        self.anchor = np.where(lanes & ~stale & errors_small & agrees, self.estimator.p, self.anchor)

    # ---- in the arithmetic of a core, all [lanes]

    @abstractmethod
    def _relative_error(self, candidate: Candidate, a: int) -> Array:
        """Standard error of p[a] over p[a]."""

    @abstractmethod
    def _has_arrived(self, size: Array, error: Array) -> Mask:
        """Whether the last step was small against the standard errors."""

    @abstractmethod
    def _all_agree(self, candidate: Candidate) -> Mask:
        """Whether all rows in the sums fit the sensors' noise."""

    @abstractmethod
    def _capped(self, variance_ratio: Array) -> Array:
        """At most the largest ratio that is counted."""

    @abstractmethod
    def _mean_with(self, x: Array) -> Array:
        """The long mean with x as the last of `judged`."""

    @abstractmethod
    def _means_exceed(self) -> tuple[Mask, Mask]:
        """Whether the short, and the long mean exceeds its limit."""

    @abstractmethod
    def _has_moved(self, a: int) -> Mask:
        """Whether p[a] is further from its anchor than `renewal` allows."""

    @abstractmethod
    def _with_neglected(self, candidate: Candidate) -> Candidate:
        """With the errors from neglected terms."""

    def _is_rounded(self) -> Mask | bool:
        """Whether rounding dominates the sums."""
        return False
