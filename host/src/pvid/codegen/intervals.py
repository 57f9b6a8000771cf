"""Bounds of every value of a list of operations from those of its inputs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pvid.base.errors import PvidError
from pvid.codegen.operations import Argument, Literal, Program

Interval = tuple[float, float]

_SLACK = 1e-12  # relative: the bounds are computed in float64


def bounds_of(program: Program, arguments: Sequence[Interval], where: str) -> list[Interval]:
    """Least and greatest value at each place of the list.

    Parameters
    ----------
    program
        The list.
    arguments
        Bounds of the inputs.
    where
        What is computed, for the error.

    Raises
    ------
    PvidError
        Where a divisor may be 0, or the argument of a root negative.
    """
    found: list[Interval] = []
    for value in program.values:
        if isinstance(value, Literal):
            found.append((float(value.value), float(value.value)))
        elif isinstance(value, Argument):
            found.append(arguments[value.place])
        else:
            of = [found[one] for one in value.operands]
            is_square = len(value.operands) == 2 and value.operands[0] == value.operands[1]
            found.append(_wider(_after(value.kind, of, is_square, where)))
    return found


def _wider(interval: Interval) -> Interval:
    low, high = interval
    return low - abs(low) * _SLACK, high + abs(high) * _SLACK


def _after(kind: str, of: Sequence[Interval], is_square: bool, where: str) -> Interval:
    low, high = of[0]
    if kind in "+-*/":
        return _binary(kind, of[0], of[1], is_square, where)
    if kind == "neg":
        return -high, -low
    if kind == "abs":
        return (0.0 if low <= 0 <= high else min(abs(low), abs(high))), max(abs(low), abs(high))
    if kind == "sin":
        return _sine(low, high)
    if kind == "cos":
        return _sine(low + math.pi / 2, high + math.pi / 2)
    if kind == "sqrt":
        if low < 0:
            raise PvidError(f"{where}: the argument of a square root may be as low as {low:.3g}: narrow its range")
        return math.sqrt(low), math.sqrt(high)
    return -1.0, 1.0


def _binary(kind: str, a: Interval, b: Interval, is_square: bool, where: str) -> Interval:
    if kind == "+":
        return a[0] + b[0], a[1] + b[1]
    if kind == "-":
        return a[0] - b[1], a[1] - b[0]
    if kind == "/" and b[0] <= 0 <= b[1]:
        raise PvidError(
            f"{where}: a divisor lies in {b[0]:.3g}..{b[1]:.3g} and may be 0: narrow the ranges of its signals"
        )
    corners = [x * y if kind == "*" else x / y for x in a for y in b]
    if kind == "*" and is_square:
        corners = [a[0] * a[0], a[1] * a[1], *([0.0] if a[0] <= 0 <= a[1] else [])]
    return min(corners), max(corners)


def _sine(low: float, high: float) -> Interval:
    ends = math.sin(low), math.sin(high)
    least = -1.0 if _holds(low, high, -math.pi / 2) else min(ends)
    most = 1.0 if _holds(low, high, math.pi / 2) else max(ends)
    return least, most


def _holds(low: float, high: float, phase: float) -> bool:
    """Whether phase + 2 pi k lies in the interval for a k, or nearly so."""
    first = phase + 2 * math.pi * math.ceil((low - phase) / (2 * math.pi) - 1e-9)
    return first <= high + 1e-9
