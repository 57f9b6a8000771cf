"""Twin of weak/schedule.h: the work of each tick of the weak form, for both cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.settings.tables import WeakSizes
from pvid.twin.record import Mask, Reasons

Work = Iterator[Reasons | None]
WindowT = TypeVar("WindowT")


@dataclass(frozen=True)
class Schedule:
    """Ticks of a design. A stretch is a part of a run without missing samples; its ticks count from its start."""

    taps: int
    decimation: int
    window: int
    functions: int

    @classmethod
    def of(cls, design: WeakSizes) -> Schedule:
        """The schedule of a design's tables."""
        return cls(design.taps, design.decimation, design.window, design.functions)

    @property
    def hop(self) -> int:
        """Decimated samples from the start of a window to the start of the next."""
        return (self.window - 1) // 2

    @property
    def job_ticks(self) -> int:
        """Ticks that the FIR job of a block takes."""
        half = (self.taps - 1) // 2
        slice_pairs = -(-half // max(1, self.decimation // 2))
        return -(-half // slice_pairs)

    def outputs(self, samples: int) -> int:
        """Decimated samples that come out of a stretch of `samples`."""
        return max(0, (samples - self.taps - self.job_ticks + 1) // self.decimation + 1)

    def centres(self, samples: int) -> npt.NDArray[np.int64]:
        """Ticks of the stretch to whose instants the decimated samples refer."""
        return (self.taps - 1) // 2 + self.decimation * np.arange(self.outputs(samples))

    def tick_of(self, index: int) -> int:
        """Tick at which decimated sample `index` comes out."""
        return self.taps - 1 + index * self.decimation + self.job_ticks - 1

    def tick_of_window(self, index: int) -> int:
        """Tick at which window `index` is handed over."""
        return self.tick_of((index + 2) * self.hop)

    @property
    def window_ticks(self) -> int:
        """Ticks that add a decimated sample to the windows, after the tick that completes it."""
        if self.decimation <= 2:
            return self.decimation - 1
        second_half = self.decimation - self.decimation // 2
        functions = -(-self.functions // max(1, second_half // 2))
        return 2 * -(-self.functions // functions)

    @property
    def reach(self) -> int:
        """Ticks from a sample to the end of the work on the last window that it is part of."""
        return self.taps + self.job_ticks + self.window_ticks + 3 * self.hop * self.decimation

    def occupy(self, free: Mask, first: int, last: int, outputs: int) -> None:
        """Marks in `free` the ticks at which a stretch first..last-1 adds its decimated samples to the windows."""
        for index in range(outputs):
            start = first + self.tick_of(index) + 1
            free[start : min(start + self.window_ticks, last)] = False

    def stages_per_tick(self, stages: int) -> int:
        """Fewest stages per tick that finish a window before the next one is complete."""
        free_ticks = 1 if self.decimation <= 2 else self.decimation - self.window_ticks
        return -(-stages // (self.hop * free_ticks))


def play(
    usable: Mask,
    free: Mask,
    complete: Mapping[int, WindowT],
    stages_per_tick: int,
    lanes: int,
    *,
    reject: Callable[[], Reason],
    take: Callable[[WindowT], Reasons | Work],
    record: Callable[[int, Reasons], None],
) -> Reasons:
    """Steps through a run and returns the reason of every tick [ticks, lanes].

    Parameters
    ----------
    usable, free
        Usable samples, and ticks that are free for the stages of a window, both [ticks].
    complete
        Every whole window, by the tick of its handing over.
    stages_per_tick
        Stages of a window per tick.
    reject
        Counts an unusable sample and returns its reason.
    take
        Begins a window: returns the reason why it is dropped, or its stages.
    record
        Called after every tick with its reason [lanes].
    """
    reason = np.empty((len(usable), lanes), np.uint8)
    warm = False
    work: Work = iter(())
    for tick in range(len(usable)):
        if not usable[tick]:
            warm = False
            reason[tick] = reject()
        else:
            reported = None
            if tick in complete:
                warm = True
                taken = take(complete[tick])
                if isinstance(taken, np.ndarray):
                    reported = taken
                else:
                    work = taken
            if reported is None and free[tick]:
                for _ in range(stages_per_tick):
                    latest = next(work, None)
                    reported = reported if latest is None else latest
            usual = Reason.ACCUMULATED if warm else Reason.WARMING_UP
            reason[tick] = usual if reported is None else reported
        record(tick, reason[tick])
    return reason
