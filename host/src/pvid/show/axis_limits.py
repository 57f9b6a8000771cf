"""How much of an estimate's history an axis shows, and the numbers on it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from pvid.base.rounding import with_error

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


def draw_answer(axis: Axes, value: float, se: float) -> None:
    """The answer of a whole run: a line with +-2 of its standard errors, and its number as a title."""
    axis.axhspan(value - 2 * se, value + 2 * se, color="C1", alpha=0.4, label="answer ±2 s.e.")
    axis.axhline(value, color="C1", linewidth=1.0, label="answer")
    axis.set_title(" ± ".join(with_error(value, se)), fontsize="medium", loc="left")


def plain_ticks(axis: Axes) -> None:
    """Whole numbers at the y axis in place of an offset above it, with the digits that the axis resolves."""

    def text(value: float, _: object) -> str:
        low, high = axis.get_ylim()
        largest, span = max(abs(low), abs(high)), abs(high - low)
        digits = 3 + max(0, math.ceil(math.log10(largest / span))) if span > 0 else 6
        return f"{0.0 if abs(value) < 1e-9 * span else value:.{digits}g}"

    axis.yaxis.set_major_formatter(FuncFormatter(text))
