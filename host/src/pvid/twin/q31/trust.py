"""Twin of trust_q31.c: which estimate is published, in every lane."""

from __future__ import annotations

import numpy as np

from pvid.settings.q31 import TrustConfigQ31
from pvid.twin import estimates
from pvid.twin.q31.estimator import ONE, SIZE_BITS, EstimatorQ31
from pvid.twin.q31.integer import Int, clamp, round_shift, square_root
from pvid.twin.record import Mask
from pvid.twin.trust import LONG, LONG_MEMORY, SHORT, Candidate, TrustTwin

VARIANCE_RATIO_BITS = 24
_ARRIVED = 19661  # 0.3 in Q16
_SMALL_STEP = (1 << SIZE_BITS) // 10000
_VARIANCE_RATIO_MAX = 1_000_000 << VARIANCE_RATIO_BITS
_ERROR_BITS = 24


class TrustQ31(TrustTwin):
    """pvid_trust_q31 of every lane of an estimator."""

    number = np.int64
    settled_step, small_error = (1 << SIZE_BITS) // 50, (1 << _ERROR_BITS) // 10
    fade, remains, keep = 644245094, 214748, 0  # 0.3 and 1e-4 in Q31; 0: no fading

    def __init__(self, config: TrustConfigQ31, estimator: EstimatorQ31) -> None:
        long_memory = np.clip((estimator.block << 31) // (2**31 - estimator.retention), LONG, LONG_MEMORY)
        super().__init__(config, estimator, long_memory, estimates.q31_of(len(estimator.p)))
        for a in range(len(estimator.p)):
            self.estimate["correlation"][:, a, a] = ONE

    def _relative_error(self, candidate: Candidate, a: int) -> Int:
        return np.asarray((candidate["se"][:, a].astype(np.int64) << _ERROR_BITS) // candidate["p"][:, a])

    def _has_arrived(self, size: Int, error: Int) -> Mask:
        part = round_shift(clamp(error, 1 << 44) * _ARRIVED, 16 + (_ERROR_BITS - SIZE_BITS))
        return size <= np.maximum(part, _SMALL_STEP)

    def _all_agree(self, candidate: Candidate) -> Mask:
        freedom = np.maximum(candidate["weight"].astype(np.int64) - self.estimator.model.n_p, 1)
        chance = square_root((1 << 33) // freedom)
        limit = self.config.misfit_max * ((1 << 16) + 3 * chance)
        return np.asarray((candidate["misfit"].astype(np.int64) << 16) <= limit)

    def _capped(self, variance_ratio: Int) -> Int:
        return clamp(variance_ratio, _VARIANCE_RATIO_MAX)

    def _mean_with(self, x: Int) -> Int:
        change = x - self.long_mean
        step = np.sign(change) * (np.abs(change) // np.maximum(self.judged, 1))
        return clamp(self.long_mean + step, _VARIANCE_RATIO_MAX)

    def _means_exceed(self) -> tuple[Mask, Mask]:
        limit = self.config.misfit_max << (VARIANCE_RATIO_BITS - 16)
        return np.asarray(2 * np.sum(self.recent, axis=0) > 3 * limit * SHORT), np.asarray(self.long_mean > limit)

    def _has_moved(self, a: int) -> Mask:
        way = np.abs(self.estimator.p[a] - self.anchor[a])
        return np.asarray((way << 16) > self.anchor[a] * self.config.renewal)

    def _with_neglected(self, candidate: Candidate) -> Candidate:
        found = candidate.copy()
        own, more = [], []
        for a, positive in enumerate(self.estimator.model.positive):
            p, before = (found[name][:, a].astype(np.int64) for name in ("p", "se"))
            error = round_shift(self.config.neglected * p, 30) if positive else np.zeros_like(p)
            after = clamp(square_root(before * before + error * error), 2**31 - 1)
            some = np.maximum(after, 1)
            own.append(np.where(after > 0, before * ONE // some, ONE))
            more.append(error * ONE // some)
            found["se"][:, a] = after
        correlation = found["correlation"]
        for a in range(len(own)):
            for b in range(a + 1, len(own)):
                part = round_shift(own[a] * own[b], 30) * correlation[:, a, b].astype(np.int64)
                total = clamp(round_shift(part, 30) + round_shift(more[a] * more[b], 30), ONE)
                correlation[:, a, b] = correlation[:, b, a] = total
        return found
