"""Numbers as a person reads them: a value to the second digit of its standard error."""

from __future__ import annotations

import math

_MOST_DECIMALS = 6
_MOST_ZEROS = 4  # that stand in front of the point for digits that are not known


def with_error(value: float, error: float) -> tuple[str, str]:
    """Value and standard error to the error's second digit: 9.50069, 0.0011 is ("9.5007", "0.0011")."""
    if not (math.isfinite(value) and math.isfinite(error) and error > 0):
        return f"{value:.6g}", f"{error:.2g}"
    decimals = 1 - math.floor(math.log10(error))
    if decimals > _MOST_DECIMALS or decimals < -_MOST_ZEROS:
        known = math.floor(math.log10(abs(value))) + decimals if value else 0
        return f"{value:.{min(max(known, 0), 15)}e}", f"{error:.1e}"
    if decimals < 0:
        return f"{round(value, decimals):.0f}", f"{round(error, decimals):.0f}"
    return f"{value:.{decimals}f}", f"{error:.{decimals}f}"


def percent(part: float) -> str:
    """A part of 1 to two digits: 0.00312 is "0.31 %"."""
    shown = 100.0 * part
    return f"{shown:.2g} %" if abs(shown) < 100.0 else f"{shown:.0f} %"
