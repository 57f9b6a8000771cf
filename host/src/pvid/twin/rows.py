"""Rows of the strong form through an estimator, in either arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.twin.record import After, Progress, Reasons, Recorder, TwinRecord

Array = npt.NDArray[Any]
Step = Callable[[Array, Array], Reasons]


def run_rows(
    estimator: Any,
    step: Step,
    n: Array,
    y: Array,
    row_reason: Reasons | None = None,
    *,
    sums: bool = True,
    progress: Progress | None = None,
) -> TwinRecord:
    """Steps an estimator through rows N [ticks, 11], Y [ticks] that all lanes share, or with an axis of lanes more.

    Parameters
    ----------
    step
        Takes a row of all lanes and returns its reasons [lanes].
    row_reason
        Outcome of a tick before it reached the estimator [ticks]: ACCUMULATED where it has a row, as all by default.
    """
    recorder = Recorder(estimator, len(y), sums, progress)
    return recorder.finished(follow_rows(estimator, step, n, y, row_reason, recorder))


def follow_rows(estimator: Any, step: Step, n: Array, y: Array, row_reason: Reasons | None, after: After) -> Reasons:
    """Like `run_rows` without a record: calls `after` after every tick.

    Returns the reason of every tick [ticks, lanes].
    """
    ticks, lanes = len(y), estimator.p.shape[1]
    reason = np.empty((ticks, lanes), np.uint8)
    wide_n = np.broadcast_to(n if n.ndim == 3 else n[:, :, None], (ticks, n.shape[1], lanes))
    wide_y = np.broadcast_to(y if y.ndim == 2 else y[:, None], (ticks, lanes))
    for tick in range(ticks):
        if row_reason is None or row_reason[tick] == Reason.ACCUMULATED:
            reason[tick] = step(wide_n[tick], wide_y[tick])
        else:
            reason[tick] = row_reason[tick]
            if row_reason[tick] not in (Reason.WARMING_UP, Reason.HELD_FROZEN):
                estimator.counters[Reason(row_reason[tick]).name.lower()] += 1
        after(tick, reason[tick])
    return reason
