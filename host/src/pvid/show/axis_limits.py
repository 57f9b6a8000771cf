"""How much of an estimate's history an axis shows, and the numbers on it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

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


def plain_ticks(axis: Axes) -> None:
    """Whole numbers at the y axis in place of an offset above it, with the digits that the axis resolves."""

    def text(value: float, _: object) -> str:
        low, high = axis.get_ylim()
        largest, span = max(abs(low), abs(high)), abs(high - low)
        digits = 3 + max(0, math.ceil(math.log10(largest / span))) if span > 0 else 6
        shown = f"{0.0 if abs(value) < 1e-9 * span else value:.{digits}g}"
        return f"{value:.0f}" if "e+0" in shown else shown

    axis.yaxis.set_major_formatter(FuncFormatter(text))
