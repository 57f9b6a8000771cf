"""Twin of trust_q31.c: which estimate is published, in every lane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.native import Reason
from pvid.native_q31 import ESTIMATE_DTYPE, TrustConfigQ31
from pvid.twin.estimator_q31 import ONE, SIZE_BITS, EstimatorQ31
from pvid.twin.integer_q31 import Int, clamp, round_shift
from pvid.twin.trust import shut_after, tell

Mask = npt.NDArray[np.bool_]
Reasons = npt.NDArray[np.uint8]

SURPLUS_BITS = 24
_SHORT, _LONG, _LONG_MEMORY = 8, 16, 4096
_ARRIVED = 19661  # 0.3 in Q16
_SMALL_STEP = (1 << SIZE_BITS) // 10000
_SURPLUS_MAX = 1_000_000 << SURPLUS_BITS
_ERROR_BITS = 24
_COUNT_MAX = 0xFFFF


class TrustQ31:
    """pvid_trust_q31 of every lane of an estimator; `estimate` is what is published, ESTIMATE_DTYPE [lanes]."""

    def __init__(self, config: TrustConfigQ31, estimator: EstimatorQ31) -> None:
        self.config = config
        self.estimator = estimator
        lanes = estimator.lanes
        self.groups = 0
        self.shut = np.zeros(lanes, np.int64)
        self.judged = np.zeros(lanes, np.int64)
        self.long_memory = np.clip((estimator.block << 31) // (2**31 - estimator.retention), _LONG, _LONG_MEMORY)
        self.next = np.zeros(lanes, np.int64)
        self.published = np.zeros(lanes, np.bool_)
        self.misfit = np.zeros(lanes, np.bool_)
        self.long_mean = np.zeros(lanes, np.int64)
        self.recent = np.zeros((_SHORT, lanes), np.int64)
        self.estimate = np.zeros(lanes, ESTIMATE_DTYPE)
        self.place()
        for a, sd in enumerate(estimator.start_sd):
            self.estimate["se"][:, a] = sd
            self.estimate["correlation"][:, a, a] = ONE

    def place(self) -> None:
        """Publishes the start again."""
        self.estimate["p"][:, : len(self.estimator.p)] = self.estimator.p.T

    @property
    def refuge(self) -> tuple[Mask, Int]:
        """In which lanes p has one, and where [n_p, lanes]."""
        some = (self.config.shut_max > 0) & (self.shut >= self.config.shut_max)
        return some, self.estimate["p"][:, : len(self.estimator.p)].T.astype(np.int64)

    def _take_surplus(self, lanes: Mask, surplus: Int) -> None:
        x = clamp(surplus, _SURPLUS_MAX)
        self.judged = np.where(lanes & (self.judged < self.long_memory), self.judged + 1, self.judged)
        change = x - self.long_mean
        step = np.sign(change) * (np.abs(change) // np.maximum(self.judged, 1))
        self.long_mean = np.where(lanes, clamp(self.long_mean + step, _SURPLUS_MAX), self.long_mean)
        places = np.flatnonzero(lanes)
        self.recent[self.next[places], places] = x[places]
        self.next = np.where(lanes, (self.next + 1) % _SHORT, self.next)
        limit = self.config.misfit_max << (SURPLUS_BITS - 16)
        lately = (self.judged >= _SHORT) & (2 * np.sum(self.recent, axis=0) > 3 * limit * _SHORT)
        at_length = (self.judged >= _LONG) & (self.long_mean > limit)
        self.misfit = np.where(lanes, (limit > 0) & (lately | at_length), self.misfit)

    def _widest(self, candidate: npt.NDArray[np.void]) -> Int:
        widest = np.zeros(len(candidate), np.int64)
        for a, positive in enumerate(self.estimator.model.positive):
            if positive:
                relative = (candidate["se"][:, a].astype(np.int64) << _ERROR_BITS) // candidate["p"][:, a]
                widest = np.maximum(widest, relative)
        return widest

    def judge(
        self, reason: Reasons, size: Int, informed: Mask, surplus: Int, candidate: npt.NDArray[np.void]
    ) -> Reasons:
        """pvid_trust_judge_q31 in every lane; shapes [lanes]."""
        self.groups = min(self.groups + 1, _COUNT_MAX)
        if (reason == Reason.ACCUMULATED).all():
            return reason
        stepped = reason == Reason.UPDATED
        self.shut = shut_after(self.shut, stepped, self.refuge[0])
        self._take_surplus(self.published, surplus)
        error = self._widest(candidate)
        near = round_shift(clamp(error, 1 << 44) * _ARRIVED, 16 + (_ERROR_BITS - SIZE_BITS))
        arrived = size <= np.maximum(near, _SMALL_STEP)
        enough_kappa = self.config.kappa_min
        excited = informed & (candidate["kappa"] >= enough_kappa) & (candidate["least_pivot"] >= enough_kappa)
        sure = (self.groups >= self.config.groups_min) & (error <= self.config.se_max) & arrived
        good = stepped & excited & sure
        self.estimate = np.where(good, candidate, self.estimate)
        self.published = self.published | good
        return tell(self.estimator.counters, reason, excited, sure, self.misfit)
