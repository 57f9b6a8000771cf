"""Rows of the strong form through an estimator, in either arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Reason
from pvid.twin.record import After, Reasons

Array = npt.NDArray[Any]


def follow_rows(
    estimator: Any, step: Callable[[Array], Reasons], rows: Array, row_reason: Reasons | None, after: After
) -> Reasons:
    """Steps an estimator through rows [ticks, ...]; calls `after` after every tick.

    Parameters
    ----------
    step
        Takes a row and returns its reasons [lanes].
    row_reason
        Outcome of a tick before it reached the estimator [ticks]: UPDATED where it has a row, as all by default;
        ACCUMULATED within a block of samples.

    Returns
    -------
    The reason of every tick [ticks, lanes].
    """
    reason = np.empty((len(rows), estimator.p.shape[1]), np.uint8)
    for tick, row in enumerate(rows):
        if row_reason is None or row_reason[tick] == Reason.UPDATED:
            reason[tick] = step(row)
        else:
            reason[tick] = row_reason[tick]
            if row_reason[tick] not in (Reason.WARMING_UP, Reason.ACCUMULATED, Reason.HELD_FROZEN):
                estimator.counters[Reason(row_reason[tick]).name.lower()] += 1
        after(tick, reason[tick])
    return reason
