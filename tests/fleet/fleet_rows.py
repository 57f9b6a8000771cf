"""Rows of a fleet, as of recordings."""

from dataclasses import replace
from typing import Any

from pvid.fleet.row import Row

DAY = 86400.0


def row(board: str, day: float, value: float, se: float = 0.01, **other: Any) -> Row:
    made = Row(f"{board}{day}", f"{board}/{day}", board, day * DAY, 100, True, "good", "good")
    return replace(made, parameters={"g": (value, se, "m/s^2")}, **other)
