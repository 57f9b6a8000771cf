"""Twin of trust_f32.c: which estimate is published, in every lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.core.native import ESTIMATE_DTYPE, Reason, TrustConfig
from pvid.twin.f32.estimator import RelativeEstimator

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

_SHORT, _LONG, _LONG_MEMORY = 8, 16, np.float32(4096)
_ARRIVED, _SMALL_STEP, _SURPLUS_MAX = np.float32(0.3), np.float32(1e-4), np.float32(1e6)
_SETTLED_STEP, _NEAR = np.float32(0.02), np.float32(0.1)
_AGEING, _AGEING_GROUPS = np.float32(0.3), 4
_COUNT_MAX = 0xFFFF


def shut_after(shut: npt.NDArray[np.int64], stepped: Mask, is_back: Mask) -> npt.NDArray[np.int64]:
    """Groups in a row that said too little for a step [lanes]; of trust_tell.h, as `tell`."""
    return np.where(stepped | is_back, 0, np.minimum(shut + 1, _COUNT_MAX))


def tell(
    counters: dict[str, npt.NDArray[np.int64]],
    reason: npt.NDArray[np.uint8],
    excited: Mask,
    sure: Mask,
    misfit: Mask,
) -> npt.NDArray[np.uint8]:
    """Counts the verdicts on what solves with these reasons left, and says what is told of them [lanes]."""
    stepped = reason == Reason.UPDATED
    told = reason.copy()
    told[stepped & ~excited] = Reason.HELD_NOT_EXCITED
    told[stepped & excited & ~sure] = Reason.HELD_UNCERTAIN
    told[stepped & excited & sure & misfit] = Reason.MISFIT
    counters["misfits"] += told == Reason.MISFIT
    counters["held_uncertain"] += told == Reason.HELD_UNCERTAIN
    counters["held_not_excited"] += stepped & ~excited
    return told


class Trust:
    """pvid_trust_f32 of every lane of an estimator; `estimate` is what is published, ESTIMATE_DTYPE [lanes]."""

    def __init__(self, config: TrustConfig, estimator: RelativeEstimator) -> None:
        self.config = replace(config)
        self.estimator = estimator
        lanes = estimator.p.shape[1]
        self.groups = 0
        self.shut = np.zeros(lanes, np.int64)
        self.judged = np.zeros(lanes, np.int64)
        information = estimator.information
        with np.errstate(all="ignore"):
            memory = information.block.astype(np.float32) / (np.float32(1) - information.retention)
        memory = np.where((information.retention < 1) & (memory < _LONG_MEMORY), memory, _LONG_MEMORY)
        self.long_memory = np.maximum(memory, np.float32(_LONG)).astype(np.int64)
        self.next = np.zeros(lanes, np.int64)
        self.ageing = np.zeros(lanes, np.int64)
        self.known = np.zeros(lanes, np.bool_)
        self.near = np.zeros(lanes, np.bool_)
        self.published = np.zeros(lanes, np.bool_)
        self.misfit = np.zeros(lanes, np.bool_)
        self.long_mean = np.zeros(lanes, np.float32)
        self.recent = np.zeros((_SHORT, lanes), np.float32)
        self.estimate = np.zeros(lanes, ESTIMATE_DTYPE)
        self.place()
        for a, sd in enumerate(estimator.start_sd):
            self.estimate["se"][:, a] = sd
            self.estimate["covariance"][:, a, a] = sd * sd

    def place(self) -> None:
        """Publishes the start again."""
        self.estimate["p"][:, : len(self.estimator.p)] = self.estimator.p.T
        self.anchor = self.estimator.p.copy()

    @property
    def refuge(self) -> tuple[Mask, Float32]:
        """In which lanes p has one, and where [n_p, lanes]."""
        some = (self.config.shut_max > 0) & (self.shut >= self.config.shut_max)
        return some, np.ascontiguousarray(self.estimate["p"][:, : len(self.estimator.p)].T)

    def _take_surplus(self, lanes: Mask, surplus: Float32) -> Mask:
        """Where the windows alone raise the alarm, of the given lanes."""
        x = np.where(surplus <= _SURPLUS_MAX, surplus, _SURPLUS_MAX)
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
        lately = (self.judged >= _SHORT) & (total > np.float32(1.5) * (limit * np.float32(_SHORT)))
        at_length = (self.judged >= _LONG) & (self.long_mean > limit)
        return lanes & (lately | at_length)

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

    def age(self, lanes: Mask) -> None:
        """pvid_trust_age_f32 in the given lanes."""
        self.ageing = np.where(lanes, _AGEING_GROUPS, self.ageing)
        self.anchor = np.where(lanes, self.estimator.p, self.anchor)
        self._restart_alarm(lanes)

    def next_ageing(self) -> Float32:
        """pvid_trust_ageing_f32 [lanes]."""
        fading = (self.ageing > 0) & self.known
        factor = np.where(fading, _AGEING, np.float32(1))
        self.ageing = np.where(fading, self.ageing - 1, self.ageing)
        return factor.astype(np.float32, copy=False)

    def _settle(self, lanes: Mask, known: Mask, agrees: Mask) -> None:
        renewal = np.float32(self.config.renewal)
        moved = np.zeros(len(lanes), np.bool_)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                part = self.estimator.p[a] / self.anchor[a] - np.float32(1)
                moved = moved | (part > renewal) | (part < -renewal)
        stale = lanes & ((known & ~agrees & moved) | self.estimator.rounded)
        self.age(stale)
        self.anchor = np.where(lanes & ~stale & known & agrees, self.estimator.p, self.anchor)

    def widest(self, candidate: npt.NDArray[np.void]) -> Float32:
        """pvid_trust_widest_f32 [lanes]."""
        widest = np.zeros(len(candidate), np.float32)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                relative = candidate["se"][:, a] / candidate["p"][:, a]
                widest = np.where(relative <= widest, widest, relative)
        return widest

    def _raise_alarm(self, settled: Mask, known: Mask, surplus: Float32, candidate: npt.NDArray[np.void]) -> None:
        """The alarm, and the renewal that may follow from it; where p has settled, and where it is known well."""
        agrees = self._all_agree(candidate)
        renewing = self.ageing > 0
        self.known = known
        self._restart_alarm(renewing)
        lately = self._take_surplus(~renewing & self.near, surplus)
        self.misfit = (self.config.misfit_max > 0) & (~agrees | lately)
        self.near = self.near | (~renewing & settled & known & (self.groups >= self.config.groups_min))
        if self.config.renewal > 0:
            self._settle(settled & ~renewing, known, agrees)

    def judge(
        self,
        reason: npt.NDArray[np.uint8],
        size: Float32,
        informed: Mask,
        surplus: Float32,
        candidate: npt.NDArray[np.void],
    ) -> npt.NDArray[np.uint8]:
        """pvid_trust_judge_f32 in every lane; shapes [lanes]."""
        self.groups = min(self.groups + 1, _COUNT_MAX)
        if (reason == Reason.ACCUMULATED).all():
            return reason
        stepped = reason == Reason.UPDATED
        self.shut = shut_after(self.shut, stepped, self.refuge[0])
        with np.errstate(all="ignore"):
            error = self.widest(candidate)
            part = _ARRIVED * error
            arrived = size <= np.where(part > _SMALL_STEP, part, _SMALL_STEP)
            self._raise_alarm(stepped & (size <= _SETTLED_STEP), error <= _NEAR, surplus, candidate)
        enough_kappa = np.float32(self.config.kappa_min)
        excited = informed & (candidate["kappa"] >= enough_kappa) & (candidate["least_pivot"] >= enough_kappa)
        enough = self.groups >= self.config.groups_min
        sure = enough & (error <= np.float32(self.config.se_max)) & arrived
        good = stepped & excited & sure
        self.estimate = np.where(good, candidate, self.estimate)
        self.published = self.published | good
        return tell(self.estimator.counters, reason, excited, sure, self.misfit)
