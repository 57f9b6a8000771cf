"""How much of an estimate's history an axis shows."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]


def interesting(value: Float, band: Float) -> tuple[float, float]:
    """Limits that show where the estimate ends and how it got there: twice the last band, and the last 3/4."""
    known = np.flatnonzero(np.isfinite(value) & np.isfinite(band))
    if not len(known):
        return math.nan, math.nan
    last = known[-1]
    settled = value[known[len(known) // 4 :]]
    low = min(float(settled.min()), float(value[last] - 2 * band[last]))
    high = max(float(settled.max()), float(value[last] + 2 * band[last]))
    margin = 0.05 * (high - low)
    return low - margin, high + margin
