"""A run through an identifier whose windows are processed in stages, some a tick."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

import numpy as np

from pvid.settings.enums import Reason
from pvid.twin.record import Mask, Reasons

Work = Iterator[Reasons | None]
WindowT = TypeVar("WindowT")


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
