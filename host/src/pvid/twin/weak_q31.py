"""Twin of weak_q31.c: counts in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31, WeakConfigQ31
from pvid.twin.f32.differentiator import segments
from pvid.twin.kapitza import weak_q31 as kapitza_weak_q31
from pvid.twin.q31 import weak_finish as weak_finish_q31
from pvid.twin.q31 import weak_front as weak_front_q31
from pvid.twin.q31 import weak_window as weak_window_q31
from pvid.twin.q31.estimator import EstimatorQ31
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.integer import Int, integers, scale
from pvid.twin.q31.scaled import Scaled, scaled
from pvid.twin.q31.trust import TrustQ31
from pvid.twin.q31.weak_window import Window
from pvid.twin.record import After, Mask, Reasons, Twin
from pvid.twin.weak_schedule import Schedule, Work, play


class WeakTwinQ31(Twin):
    """The weak-form identifier in several lanes that share samples and design."""

    def __init__(self, config: WeakConfigQ31, estimators: Sequence[EstimatorConfigQ31] | None = None) -> None:
        self.config = config
        model = kapitza_weak_q31.WEAK if config.zero_unknown else kapitza_weak_q31.ZEROED
        self.estimator = EstimatorQ31(estimators or [config.estimator], model)
        self.trust = TrustQ31(config.trust, self.estimator)
        self.gate = GateQ31(config.gate, 4, scaled(np.ones(self.estimator.lanes, np.int64), 0))
        self.pivot_noise = Scaled(*map(integers, config.pivot_noise))
        self.iterations = 1 if self.estimator.is_rate else config.iterations
        self.schedule = Schedule.of(config.design)
        self.stages_per_tick = self.schedule.stages_per_tick(
            weak_finish_q31.number_of_stages(config.design, self.iterations, self.estimator)
        )

    def window_sums(self, phi: Int, y: Int) -> tuple[dict[int, Window | Reason], Mask, Mask]:
        """Every complete window, or the reason why it is dropped, by the tick that completes it.

        Also which samples were within full scale, and which ticks are free for the stages of a window.
        """
        config, design = self.config, self.config.design
        phi = phi - config.phi_offset
        y = y - config.y_offset
        within = (np.abs(phi) <= design.phi_max) & (np.abs(y) <= design.y_max)
        threshold = (config.drive_min * (design.window - 1)) ** 2
        complete: dict[int, Window | Reason] = {}
        free = within.copy()
        for first, last in segments(within):
            while first < last:
                first = self._stretch(phi, y, first, last, complete, within, free, threshold)
        return complete, within, free

    def _stretch(
        self,
        phi: Int,
        y: Int,
        first: int,
        last: int,
        complete: dict[int, Window | Reason],
        within: Mask,
        free: Mask,
        threshold: int,
    ) -> int:
        """Windows from tick `first` on, up to `last` or the first U beyond its full scale; returns the next tick."""
        design = self.config.design
        f, u = weak_front_q31.decimate(phi[first:last], y[first:last], design)
        beyond = np.flatnonzero(np.abs(u) > design.u_max)
        if len(beyond):
            f, u = f[: beyond[0]], u[: beyond[0]]
            last = first + self.schedule.tick_of(int(beyond[0]))
            within[last] = free[last] = False
        driven = weak_window_q31.drives(u, design) >= threshold
        angles = weak_window_q31.angle_sums(f, design)
        curvatures = weak_window_q31.curvatures(f, design)
        for m, sums in enumerate(weak_window_q31.sums(f, u, design)):
            tick = first + self.schedule.tick_of_window(m)
            curvature = Scaled(curvatures.m[m], curvatures.e[m])
            if self.frozen is not None and self.frozen[tick]:
                complete[tick] = Reason.HELD_FROZEN
            elif not driven[m]:
                complete[tick] = Reason.HELD_NOT_EXCITED
            else:
                complete[tick] = Window(sums, int(angles[m]), curvature)
        self.schedule.occupy(free, first, last, len(f))
        return last + 1

    def _place_offset(self, window: Window) -> None:
        """The first window's mean angle as the start of c."""
        if not self.config.zero_unknown or self.estimator.counters["rows"].any():
            return
        total = abs(int(scale(integers(window.angle_sum), -self.config.estimator.p_bits[3])))
        mean = total // (self.config.design.window - 1)
        self.estimator.place(3, -mean if window.angle_sum < 0 else mean)
        self.trust.place()

    def _take(self, window: Window | Reason) -> Reasons | Work:
        """The reason why a window is dropped, or its stages."""
        if isinstance(window, Reason):
            self.estimator.counters["held_not_excited"] += window is Reason.HELD_NOT_EXCITED
            return np.full(self.estimator.lanes, window, np.uint8)
        self._place_offset(window)
        return weak_finish_q31.stages(
            window, self.config.design, self.iterations, self.estimator, self.trust, self.pivot_noise, self.gate
        )

    def _reject(self) -> Reason:
        self.estimator.counters["rejected_saturated"] += 1
        return Reason.REJECTED_SATURATED

    @property
    def reach(self) -> int:
        """Ticks from a sample until the identifier has processed it completely."""
        return self.schedule.reach

    def follow(self, phi: npt.ArrayLike, y: npt.ArrayLike, after: After) -> Reasons:
        """See Twin."""
        complete, usable, free = self.window_sums(integers(phi), integers(y))
        lanes = self.estimator.lanes
        return play(
            usable, free, complete, self.stages_per_tick, lanes, reject=self._reject, take=self._take, record=after
        )
