"""Twin of weak_q31.c: readings in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31
from pvid.settings.weak_q31 import WeakConfigQ31
from pvid.twin.play import Work, play
from pvid.twin.q31 import weak_finish
from pvid.twin.q31.estimator import EstimatorQ31
from pvid.twin.q31.gate import GateQ31
from pvid.twin.q31.integer import Int, clamp, integers
from pvid.twin.q31.model import ModelQ31
from pvid.twin.q31.scaled import scaled
from pvid.twin.q31.trust import TrustQ31
from pvid.twin.q31.weak_collect import Schedule, Tick, collect
from pvid.twin.q31.weak_scores import Scores
from pvid.twin.record import After, Mask, Reasons, Recorder, TwinRecord

_GATE_MEMORY = 4
_BEYOND = 2**25  # a reading beyond full scale stays beyond it


class WeakTwinQ31:
    """The identifier in several lanes that share readings and design. `frozen` [ticks] is set before a run."""

    def __init__(
        self, config: WeakConfigQ31, model: ModelQ31, estimators: Sequence[EstimatorConfigQ31] | None = None
    ) -> None:
        self.config = config
        design = config.design
        own = [replace(one, row_weight=2**16) for one in estimators or [config.estimator]]
        self.estimator = EstimatorQ31(own, model)
        self.trust = TrustQ31(config.trust, self.estimator)
        floor = scaled(np.ones(self.estimator.lanes, np.int64), 0)
        self.gates = [GateQ31(config.gate, _GATE_MEMORY, floor) for _ in design.model.kind]
        self.iterations = 1 if self.estimator.is_rate else config.iterations
        self.noise = weak_finish.NoiseOfWindows(design, self.estimator, config.compensation)
        self.scores = Scores(model.n_p, self.estimator.lanes)
        stages = weak_finish.number_of_stages(design, self.iterations, self.estimator, self.noise.is_used)
        self.stages_per_tick = -(-stages // Schedule.of(design).free_ticks)
        self.frozen: Mask | None = None

    def _complete(self, readings: Int) -> tuple[dict[int, Int | Reason], Int]:
        """Every complete window, or the reason why it is dropped, by its tick; and what each tick did."""
        config = self.config
        counts = clamp(readings - integers(config.offset)[:, np.newaxis], _BEYOND)
        found = collect(counts, config.design)
        n = 2 * config.design.hop
        complete: dict[int, Int | Reason] = {}
        for place, tick in enumerate(np.flatnonzero(found.ticks == Tick.WINDOW).tolist()):
            least = integers(config.drive_min) if config.drive_min else np.zeros(len(counts), np.int64)
            if self.frozen is not None and self.frozen[tick]:
                complete[tick] = Reason.HELD_FROZEN
            elif np.any(found.spreads[place] < n * (least * least)):
                complete[tick] = Reason.HELD_NOT_EXCITED
            else:
                complete[tick] = found.windows[place]
        return complete, found.ticks

    def _take(self, window: Int | Reason) -> Reasons | Work:
        if isinstance(window, Reason):
            self.scores.alone = True
            self.estimator.counters["held_not_excited"] += window is Reason.HELD_NOT_EXCITED
            return np.full(self.estimator.lanes, window, np.uint8)
        own = self.config.estimator
        return weak_finish.stages(
            window,
            self.config.design,
            self.iterations,
            self.estimator,
            self.trust,
            self.gates,
            (own.n_bits, own.y_bits),
            self.noise,
            self.scores,
        )

    def _reject(self) -> Reason:
        self.scores.alone = True
        self.estimator.counters["rejected_saturated"] += 1
        return Reason.REJECTED_SATURATED

    @property
    def samples(self) -> int:
        """Of a tick."""
        return self.config.design.model.samples

    @property
    def reach(self) -> int:
        """Ticks from a sample until the identifier has processed it completely, at most."""
        return self.config.design.ticks_needed

    def follow(self, samples: npt.ArrayLike, after: After) -> Reasons:
        """Steps all lanes through readings [ticks, samples]; calls `after` after every tick.

        Returns the reason of every tick [ticks, lanes].
        """
        complete, ticks = self._complete(integers(samples).T)
        return play(
            ticks != Tick.REJECTED,
            ticks == Tick.FREE,
            complete,
            self.stages_per_tick,
            self.estimator.lanes,
            reject=self._reject,
            take=self._take,
            record=after,
        )

    def run(self, readings: npt.ArrayLike) -> TwinRecord:
        """Steps all lanes through readings [samples, ticks]."""
        given = integers(readings)
        recorder = Recorder(self.estimator, given.shape[1], True, None, self.trust)
        return recorder.finished(self.follow(given.T, recorder))
