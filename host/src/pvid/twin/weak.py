"""Twin of weak_f32.c: samples in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.settings.enums import Reason
from pvid.settings.f32 import EstimatorConfig, WeakConfig
from pvid.twin.f32 import weak_finish, weak_front, weak_window
from pvid.twin.f32.differentiator import segments
from pvid.twin.f32.estimator import RelativeEstimator
from pvid.twin.f32.gate import Gate
from pvid.twin.f32.trust import Trust
from pvid.twin.f32.weak_window import Window
from pvid.twin.kapitza import weak as kapitza_weak
from pvid.twin.kapitza.full_angle import Angle
from pvid.twin.record import After, Mask, Reasons, Twin
from pvid.twin.weak_schedule import Schedule, Work, play

Float32 = npt.NDArray[np.float32]


class WeakTwin(Twin):
    """The weak-form identifier in several lanes that share samples, design and rate.

    Parameters
    ----------
    config
        Design, rate and l1; its estimator settings are used when `estimators` is not given.
    estimators
        Settings of each lane; all share law, feedback and divider.
    """

    def __init__(self, config: WeakConfig, estimators: Sequence[EstimatorConfig] | None = None) -> None:
        self.config = config
        design = config.design
        functions = np.float32(design.functions)
        weight = (functions - np.float32(2)) / functions
        rate = np.float32(config.sample_rate) / (np.float32(design.decimation) * np.float32(config.hop))
        lanes = [
            replace(e, row_weight=float(weight), correlation=design.overlap) for e in estimators or [config.estimator]
        ]
        pattern = kapitza_weak.WEAK if config.zero_unknown else kapitza_weak.ZEROED
        pattern = kapitza_weak.FRICTION if config.friction else pattern
        self.estimator = RelativeEstimator(lanes, float(rate), pattern)
        self.iterations = 1 if self.estimator.is_rate else config.iterations
        self.angle = Angle(config, len(lanes)) if config.full_angle or config.friction else None
        self.schedule = Schedule.of(design)
        self.stages_per_tick = self.schedule.stages_per_tick(
            weak_finish.number_of_stages(design, self.iterations, self.estimator, self.angle)
        )
        self.trust = Trust(config.trust, self.estimator)
        row_sd = np.array([e.row_sd for e in lanes], np.float32)
        self.row_variance = row_sd * row_sd
        lag = (np.float32(design.decimation) / np.float32(config.sample_rate)) * np.float32(design.lag)
        self.gate = Gate(config.gate, rate, np.float32(4), np.ones(len(lanes), np.float32))
        self.pivot_noise = np.float32(config.pivot_noise) / ((lag * lag) * (lag * lag))

    def _driven(self, variance: Float32) -> Mask:
        threshold = np.float32(self.config.drive_min) * np.float32(self.config.drive_min)
        return ~((threshold > 0) & (variance < threshold))

    def windows(self, phi: npt.ArrayLike, y: npt.ArrayLike) -> tuple[dict[int, Window], Mask, Mask]:
        """Every complete window, by the tick that completes it.

        Also which samples are finite, and which ticks are free for the stages of a window, both [ticks].
        """
        config, design = self.config, self.config.design
        phi32 = np.asarray(phi, np.float32)
        y32 = np.asarray(y, np.float32)
        finite = np.isfinite(phi32) & np.isfinite(y32)
        dt = np.float32(design.decimation) / np.float32(config.sample_rate)
        complete: dict[int, Window] = {}
        free = finite.copy()
        for first, last in segments(finite):
            part = weak_front.decimate(phi32[first:last], y32[first:last], design, config.sample_rate, config.l1)
            seen = weak_window.observe(*part, design)
            driven = self._driven(seen.drive)
            for m, sums in enumerate(weak_window.sums(*part, design, dt)):
                tick = first + self.schedule.tick_of_window(m)
                samples = slice(m * config.hop, m * config.hop + design.window)
                complete[tick] = Window(
                    sums=sums,
                    phi=part[0][samples],
                    u=part[1][samples],
                    driven=bool(driven[m]),
                    frozen=self.frozen is not None and bool(self.frozen[tick]),
                    mean=seen.mean[m],
                    lowest=seen.lowest[m],
                    highest=seen.highest[m],
                    curvature=seen.curvature[m],
                )
            self.schedule.occupy(free, first, last, len(part[0]))
        return complete, finite, free

    def _drop_reason(self, window: Window) -> Reasons | None:
        """The reason why a window is dropped [lanes], None if it is used; all lanes must agree."""
        estimator = self.estimator
        lanes = estimator.p.shape[1]
        if window.frozen:
            return np.full(lanes, Reason.HELD_FROZEN, np.uint8)
        if not window.driven:
            estimator.counters["held_not_excited"] += 1
            return np.full(lanes, Reason.HELD_NOT_EXCITED, np.uint8)
        offset_known = len(estimator.p) <= 3
        if not offset_known and not estimator.counters["rows"].any():
            estimator.place(np.concatenate([estimator.p[:3], np.full((1, lanes), window.mean), estimator.p[4:]]))
            self.trust.place()
        limit = np.float32(self.config.angle_limit)
        offset = np.zeros(lanes, np.float32) if offset_known else estimator.p[3]
        up, down = window.highest - offset, offset - window.lowest
        beyond = (limit > 0) & (np.where(up > down, up, down) > limit)
        if beyond.any():
            if not beyond.all():
                raise PvidError("lanes of one twin must drop the same windows: their zeros differ too much")
            estimator.counters["held_out_of_range"] += 1
            return np.full(lanes, Reason.HELD_OUT_OF_RANGE, np.uint8)
        return None

    def _take(self, window: Window) -> Reasons | Work:
        """The reason why a window is dropped, or its stages."""
        drop_reason = self._drop_reason(window)
        if drop_reason is not None:
            return drop_reason
        with np.errstate(all="ignore"):
            expected = self.row_variance + self.pivot_noise * window.curvature
        return weak_finish.stages(
            window, self.config.design, self.iterations, self.estimator, self.trust, self.angle, expected, self.gate
        )

    def _reject(self) -> Reason:
        self.estimator.counters["rejected_not_finite"] += 1
        return Reason.REJECTED_NOT_FINITE

    @property
    def reach(self) -> int:
        """Ticks from a sample until the identifier has processed it completely."""
        return self.schedule.reach

    def follow(self, phi: npt.ArrayLike, y: npt.ArrayLike, after: After) -> Reasons:
        """See Twin."""
        complete, usable, free = self.windows(phi, y)
        lanes = self.estimator.p.shape[1]
        return play(
            usable, free, complete, self.stages_per_tick, lanes, reject=self._reject, take=self._take, record=after
        )
