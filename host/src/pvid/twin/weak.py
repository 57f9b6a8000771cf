"""Twin of weak_f32.c: the weak form of any compiled mechanism, samples in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.f32 import EstimatorConfig
from pvid.settings.weak import WeakConfig
from pvid.twin.f32 import weak_front, weak_step, weak_sums, weak_watch
from pvid.twin.f32.differentiator import segments
from pvid.twin.f32.estimator import RelativeEstimator
from pvid.twin.f32.trust import Trust
from pvid.twin.f32.weak_finish import Finish, Stages
from pvid.twin.f32.weak_front import front_ticks
from pvid.twin.record import After, Progress, Reasons, Recorder, TwinRecord

Float32 = npt.NDArray[np.float32]

_F = np.float32
_BLOCK = 8


@dataclass(frozen=True)
class WeakSchedule:
    """Twin of weak/ticks_f32.h: harmonics and stages of a free tick.

    free_ticks: those of a block of steps
    """

    free_ticks: int
    hop: int
    harmonics: int

    @property
    def items_per_tick(self) -> int:
        """Harmonics that a tick adds or joins."""
        return -(-2 * self.harmonics // self.free_ticks)

    def room_for(self, stages: int, stages_per_tick: int) -> bool:
        """Whether so many stages of a window end before the next half's first block is added to the sums."""
        joining = -(-2 * self.harmonics // self.items_per_tick)
        return stages <= stages_per_tick * (self.free_ticks - joining)

    def stages_per_tick(self, stages: int) -> int:
        """Fewest stages per tick that finish a window before the next one is joined."""
        adding = -(-self.harmonics // self.items_per_tick)
        ticks = (self.hop // _BLOCK - 1) * (self.free_ticks - adding)
        return -(-stages // ticks)


@dataclass(frozen=True)
class Stretch:
    """A part of a run without missing samples.

    Attributes
    ----------
    steps : step that each tick takes, counted from the stretch's start; -1: none [ticks]
    free : ticks that add harmonics or run stages [ticks]
    windows : sums of every window [windows, channels, 2, harmonics]
    drop_reason : why a window is dropped; ACCUMULATED: it is used [windows]
    """

    steps: npt.NDArray[np.int64]
    free: npt.NDArray[np.bool_]
    windows: Float32
    drop_reason: Sequence[Reason]


class WeakTwin:
    """The identifier of any mechanism in several lanes that share samples, design and rate.

    Parameters
    ----------
    config
        Its estimator settings are used when `estimators` is not given.
    estimators
        Settings of each lane; all share law, feedback and divider.

    Attributes
    ----------
    frozen : complete windows are dropped [ticks]; set before a run
    busy : the last tick did more than to take its samples
    """

    frozen: npt.NDArray[np.bool_] | None = None
    busy: bool = False

    def __init__(self, config: WeakConfig, estimators: Sequence[EstimatorConfig] | None = None) -> None:
        self.config = config
        design = self.design = config.design
        model = design.model
        functions = _F(design.functions) * _F(model.kinds)
        nuisances = _F(sum(one.nuisances for one in model.kind))
        weight = (functions - nuisances) / functions
        rate = _F(config.sample_rate) / (_F(design.decimation) * _F(design.hop))
        lanes = [
            replace(e, row_weight=float(weight), correlation=design.overlap) for e in estimators or [config.estimator]
        ]
        pattern: Any = model.model
        self.estimator = RelativeEstimator(lanes, float(rate), pattern)
        self.trust = Trust(config.trust, self.estimator)
        self.dt = _F(design.decimation) / _F(config.sample_rate)
        self.finish = Finish(config, self.dt, self.estimator, self.trust)
        self.ticks = front_ticks(design)
        self.schedule = WeakSchedule(_BLOCK * self.ticks.free_ticks, design.hop, design.highest + 1)
        self.stages_per_tick = self.schedule.stages_per_tick(self.finish.stages)
        self.runs = weak_step.Runs.of(design, _F(self.ticks.first) / _F(config.sample_rate))

    @property
    def _delay(self) -> int:
        return 2 * self.design.half_steps + 8

    def stretch(self, samples: Float32) -> Stretch:
        """All that comes of a stretch of finite samples [ticks, samples] but the estimate; moves the runs."""
        design, hop = self.design, self.design.hop
        jets = weak_front.jets(samples, design, self.config.sample_rate)
        early = weak_front.early_jets(samples, design, self.config.sample_rate)
        values = weak_step.values(jets, design, self.runs, self.dt, early)
        steps = np.full(len(samples), -1)
        ticks = np.array([self.ticks.tick_of(step) for step in range(jets.shape[1])], np.int64)
        steps[ticks] = np.arange(len(ticks))
        free = self.ticks.free(len(samples))
        windows = weak_sums.windows(values, design, self.dt) if len(values.channels) >= 2 * hop else None
        if windows is None:
            return Stretch(steps, free, np.zeros((0, 0, 2, 0), np.float32), [])
        count = len(windows)
        drop = np.full(count, Reason.ACCUMULATED)
        later = ticks[2:] - self.ticks.apart  # of the steps whose channels follow
        if self.config.drive_min is not None:
            still = weak_watch.windows_still(samples[later], np.asarray(self.config.drive_min, np.float32), hop)
            drop[still] = Reason.HELD_NOT_EXCITED
        if self.config.range is not None:
            limit = np.asarray(self.config.range, np.float32)
            beyond = weak_watch.halves_beyond(samples, limit, later, self._delay, hop)
            drop[beyond[:-1] | beyond[1:]] = Reason.HELD_OUT_OF_RANGE
        return Stretch(steps, free, windows, [Reason(one) for one in drop])

    def _drop(self, reason: Reason) -> None:
        counter = {Reason.HELD_NOT_EXCITED: "held_not_excited", Reason.HELD_OUT_OF_RANGE: "held_out_of_range"}
        if reason in counter:
            self.estimator.counters[counter[reason]] += 1
        self.finish.alone = True

    def _play(self, stretch: Stretch, first: int, reason: Reasons, work: Stages, after: After) -> Stages:
        """Steps through a stretch whose first tick is `first`; returns the work that is left."""
        hop, schedule = self.design.hop, self.schedule
        warm, pending, joining = False, 0, -1
        for tick, step in enumerate(stretch.steps, first):
            dropped, self.busy = None, step >= 0
            if step >= 2:
                done = int(step) - 1  # channels of steps that are known
                if done % _BLOCK == 0:
                    pending, joining = schedule.harmonics, -1
                if done % hop == 0 and done >= 2 * hop:
                    warm = True
                    window = done // hop - 2
                    verdict = stretch.drop_reason[window]
                    if self.frozen is not None and self.frozen[tick]:
                        verdict = Reason.HELD_FROZEN
                    if verdict == Reason.ACCUMULATED:
                        pending, joining = 2 * schedule.harmonics, window
                    else:
                        self._drop(verdict)
                        dropped = verdict
            reason[tick] = Reason.ACCUMULATED if warm else Reason.WARMING_UP
            if stretch.free[tick - first]:
                if pending > 0:
                    self.busy = True
                    pending -= schedule.items_per_tick
                    if pending <= 0 and joining >= 0:
                        work = self.finish.process(stretch.windows[joining])
                else:
                    for latest in islice(work, self.stages_per_tick):
                        self.busy = True
                        if latest is not None:
                            reason[tick] = latest
            if dropped is not None:
                reason[tick] = dropped
            after(tick, reason[tick])
        return work

    @property
    def samples(self) -> int:
        """Of a tick."""
        return self.config.design.model.samples

    @property
    def reach(self) -> int:
        """Ticks from a sample until the identifier has processed it completely, at most."""
        return self.config.ticks_needed

    def follow(self, samples: npt.ArrayLike, after: After) -> Reasons:
        """Like `run` without a record: calls `after` after every tick.

        Returns the reason of every tick [ticks, lanes].
        """
        given = np.asarray(samples, np.float32)
        finite: npt.NDArray[np.bool_] = np.all(np.isfinite(given), axis=1)
        reason = np.empty((len(given), self.estimator.p.shape[1]), np.uint8)
        work: Stages = iter(())
        parts: Iterator[tuple[int, int]] = iter(segments(finite))
        behind = 0
        self.finish.alone = True
        for first, last in (*parts, (len(given), len(given))):
            for tick in range(behind, first):
                self.estimator.counters["rejected_not_finite"] += 1
                self.finish.alone, self.busy = True, False
                reason[tick] = Reason.REJECTED_NOT_FINITE
                after(tick, reason[tick])
            if last > first:
                work = self._play(self.stretch(given[first:last]), first, reason, work, after)
            behind = last
        return reason

    def run(self, samples: npt.ArrayLike, *, sums: bool = True, progress: Progress | None = None) -> TwinRecord:
        """Steps all lanes through a run [ticks, samples] from its first sample."""
        recorder = Recorder(self.estimator, len(np.asarray(samples)), sums, progress, self.trust)
        return recorder.finished(self.follow(samples, recorder))
