"""Numbers as a person reads them: a value to the second digit of its standard error."""

from __future__ import annotations

import math

_MOST_DECIMALS = 6
_FIXED = (1e-3, 1e4, 9)  # values without an exponent, and the decimals that they have at most
_MOST_PERCENT = 10_000
_MOST_ZEROS = 4  # that stand in front of the point for digits that are not known


def with_error(value: float, error: float) -> tuple[str, str]:
    """Value and standard error to the error's second digit: 9.50069, 0.0011 is ("9.5007", "0.0011").

    Values from 0.001 to 9999 have up to nine decimals, others of more than six an exponent.
    """
    if not (math.isfinite(value) and math.isfinite(error) and error > 0):
        return f"{value:.6g}", f"{error:.2g}"
    decimals = 1 - math.floor(math.log10(error))
    most = _FIXED[2] if _FIXED[0] <= abs(value) < _FIXED[1] else _MOST_DECIMALS
    if decimals > most or decimals < -_MOST_ZEROS:
        known = math.floor(math.log10(abs(value))) + decimals if value else 0
        return f"{value:.{min(max(known, 0), 15)}e}", f"{error:.1e}"
    if decimals < 0:
        return f"{round(value, decimals):.0f}", f"{round(error, decimals):.0f}"
    return f"{value:.{decimals}f}", f"{error:.{decimals}f}"


def part_of_one(r2: float, decimals: int) -> str:
    """R^2, which has no digits where predictions are far worse than none."""
    return f"{r2:.{decimals}f}" if r2 >= -_MOST_PERCENT / 100 else f"below -{_MOST_PERCENT // 100}"


def percent(part: float) -> str:
    """A part of 1 to two digits: 0.00312 is "0.31 %"; what is beyond all measure has no digits."""
    shown = 100.0 * part
    if shown > _MOST_PERCENT:
        return f"more than {_MOST_PERCENT} %"
    return f"{shown:.2g} %" if abs(shown) < 99.5 else f"{shown:.0f} %"


# Units that take a prefix, and prefixes by the power of 1000.
_PREFIXED = {"m", "s", "A", "V", "ohm", "H", "F", "N", "W", "J", "Pa", "Hz"}
_PREFIXES = {-3: "n", -2: "u", -1: "m", 0: "", 1: "k", 2: "M"}
_PLAIN = (1.0, 1e4)  # values that need none


def prefix_of(size: float, unit: str) -> tuple[str, float]:
    """The unit with the SI prefix for numbers up to `size`, where it takes one, and what a number in it is multiplied
    with: 0.0146, "m" is ("mm", 1e-3)."""
    power = 0
    if unit in _PREFIXED and 0 < size < math.inf and not _PLAIN[0] <= size < _PLAIN[1]:
        power = min(max(math.floor(math.log10(size) / 3), min(_PREFIXES)), max(_PREFIXES))
    return f"{_PREFIXES[power]}{unit}", 1000.0**power


def with_prefix(value: float, error: float, unit: str) -> tuple[str, str, str, float]:
    """Value and error to the error's second digit, their unit with an SI prefix where the unit takes one, and what a
    number in that unit is multiplied with: 0.0030002, 8e-7, "H" is ("3.00020", "0.00080", "mH", 1e-3).
    """
    unit, scale = prefix_of(abs(value), unit)
    return *with_error(value / scale, error / scale), unit, scale
