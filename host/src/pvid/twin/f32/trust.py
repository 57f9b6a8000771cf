"""Twin of trust_f32.c: which estimate is published, in every lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.settings.f32 import TrustConfig
from pvid.twin import estimates
from pvid.twin.f32.estimator import RelativeEstimator
from pvid.twin.record import Mask, Reasons
from pvid.twin.trust import LONG, LONG_MEMORY, SHORT, Candidate, TrustTwin

Float32 = npt.NDArray[np.float32]

_ARRIVED, _SMALL_STEP, _VARIANCE_RATIO_MAX = np.float32(0.3), np.float32(1e-4), np.float32(1e6)
_VARIANCE_MAX = np.float32(1e36)
_SINGLES = ("kappa_min", "se_max", "misfit_max", "renewal", "neglected")


class Trust(TrustTwin):
    """pvid_trust_f32 of every lane of an estimator."""

    number = np.float32
    settled_step, small_error = np.float32(0.02), np.float32(0.1)
    fade, remains, keep = np.float32(0.3), np.float32(1e-4), np.float32(1)

    def __init__(self, config: TrustConfig, estimator: RelativeEstimator) -> None:
        information = estimator.information
        with np.errstate(all="ignore"):
            memory = information.block.astype(np.float32) / (np.float32(1) - information.retention)
        longest = np.float32(LONG_MEMORY)
        memory = np.where((information.retention < 1) & (memory < longest), memory, longest)
        singles = {name: np.float32(getattr(config, name)) for name in _SINGLES}
        long_memory = np.maximum(memory, np.float32(LONG)).astype(np.int64)
        super().__init__(replace(config, **singles), estimator, long_memory, estimates.f32_of(len(estimator.p)))  # type: ignore[arg-type]
        for a, sd in enumerate(estimator.start_sd):
            self.estimate["covariance"][:, a, a] = sd * sd

    def decide(
        self, reason: Reasons, size: Float32, above_noise: Mask, variance_ratio: Float32, candidate: Candidate
    ) -> Reasons:
        with np.errstate(all="ignore"):
            return super().decide(reason, size, above_noise, variance_ratio, candidate)

    def publish(self, verdict: Reasons, reason: Reasons, candidate: Candidate) -> Reasons:
        with np.errstate(all="ignore"):
            return super().publish(verdict, reason, candidate)

    def _relative_error(self, candidate: Candidate, a: int) -> Float32:
        return np.asarray(candidate["se"][:, a] / candidate["p"][:, a])

    def _has_arrived(self, size: Float32, error: Float32) -> Mask:
        part = _ARRIVED * error
        return size <= np.where(part > _SMALL_STEP, part, _SMALL_STEP)

    def _all_agree(self, candidate: Candidate) -> Mask:
        freedom = candidate["weight"] - np.float32(len(self.estimator.p))
        chance = np.sqrt(np.float32(2) / np.where(freedom >= 1, freedom, np.float32(1)))
        return np.asarray(candidate["misfit"] <= self.config.misfit_max * (np.float32(1) + np.float32(3) * chance))

    def _capped(self, variance_ratio: Float32) -> Float32:
        return np.where(variance_ratio <= _VARIANCE_RATIO_MAX, variance_ratio, _VARIANCE_RATIO_MAX)

    def _mean_with(self, x: Float32) -> Float32:
        return np.asarray(self.long_mean + (x - self.long_mean) / self.judged.astype(np.float32))

    def _means_exceed(self) -> tuple[Mask, Mask]:
        total = np.zeros(len(self.judged), np.float32)
        for i in range(SHORT):
            total = total + self.recent[i]
        limit = self.config.misfit_max
        return total > np.float32(1.5) * (limit * np.float32(SHORT)), self.long_mean > limit

    def _has_moved(self, a: int) -> Mask:
        part = self.estimator.p[a] / self.anchor[a] - np.float32(1)
        return np.asarray((part > self.config.renewal) | (part < -self.config.renewal))

    def _with_neglected(self, candidate: Candidate) -> Candidate:
        found = candidate.copy()
        errors = []
        for a, positive in enumerate(self.estimator.model.positive):
            zero = np.zeros(len(found), np.float32)
            error = self.config.neglected * found["p"][:, a] if positive else zero
            variance = found["se"][:, a] * found["se"][:, a] + error * error
            small = variance <= _VARIANCE_MAX
            found["se"][:, a] = np.where(small, np.sqrt(variance), found["se"][:, a])
            errors.append(np.where(small, error, zero))
        for a, one in enumerate(errors):
            for b, other in enumerate(errors):
                found["covariance"][:, a, b] += one * other
        return found

    def _is_rounded(self) -> Mask:
        return np.asarray(self.estimator.rounded)
