"""Fixed-point formats for a list of operations: int32, a value is its integer times 2^-bits.

|x| <= b gets 30 - ceil(log2 b) bits: one bit is spare. A product is shifted to its format with half added; the operands
of a sum are shifted to the coarsest format among themselves and the sum; sine, cosine and sign have 30 bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from pvid.base.errors import PvidError
from pvid.model.operations import Argument, Literal, Operation, Program

Interval = tuple[float, float]

_SLACK = 1e-12  # relative: the bounds are computed in float64


def bounds_of(program: Program, arguments: Sequence[Interval], where: str) -> list[Interval]:
    """Least and greatest value at each place of the list.

    Raises PvidError where a divisor may be 0, or the argument of a root negative.

    Parameters
    ----------
    program : the list
    arguments : bounds of the inputs
    where : what is computed, for the error
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


LEAST, MOST = -30, 60  # bits
_UNIT_KINDS = ("sin", "cos", "sign", "soft_sign")
_DIGITS = 30
_TOLERANCE = 1e-9  # of a bound: the spare bit takes it


@dataclass(frozen=True)
class FixedProgram:
    """A list of operations with the format of every value.

    Attributes
    ----------
    program : the list
    bits : format of each value
    bounds : least and greatest value of each
    """

    program: Program
    bits: tuple[int, ...]
    bounds: tuple[Interval, ...]

    def integer(self, place: int) -> int:
        """The literal at a place in its format."""
        return nearest(self.program.literal(place) * Fraction(2) ** self.bits[place])

    def alignment(self, place: int) -> list[int]:
        """Shifts to the right of the operands of a sum or difference."""
        return [self.bits[one] - self.bits[place] for one in self.program.operation(place).operands]

    @property
    def result_bits(self) -> tuple[int, ...]:
        """Format of each result."""
        return tuple(self.bits[place] for place in self.program.results)


def bits_of(interval: Interval) -> int:
    """The format of a value within bounds."""
    size = max(abs(interval[0]), abs(interval[1])) * (1 - _TOLERANCE)
    if size == 0:
        return _DIGITS
    exponent = math.frexp(size)
    power = exponent[1] - 1 if exponent[0] == 0.5 else exponent[1]  # ceil(log2 size)
    return min(max(_DIGITS - power, LEAST), MOST)


def nearest(value: Fraction) -> int:
    """The nearest integer, half up."""
    return math.floor(value + Fraction(1, 2))


def fixed(program: Program, arguments: Sequence[Interval], where: str) -> FixedProgram:
    """Formats from the bounds of the inputs.

    Raises PvidError where a divisor may be 0, a value is too large for any format, or there is a square root.

    Parameters
    ----------
    program : the list
    arguments : bounds of the inputs
    where : what is computed, for the errors
    """
    bounds = bounds_of(program, arguments, where)
    bits: list[int] = []
    for value, interval in zip(program.values, bounds, strict=True):
        if max(abs(interval[0]), abs(interval[1])) > 2.0 ** (_DIGITS - LEAST):
            raise PvidError(f"{where}: a value may reach {max(map(abs, interval)):.3g}, too large for fixed point")
        bits.append(_format(value, interval, bits, where))
    made = FixedProgram(program, tuple(bits), tuple(bounds))
    _check(made, where)
    return made


def _format(value: object, interval: Interval, bits: Sequence[int], where: str) -> int:
    if not isinstance(value, Operation):
        return bits_of(interval)
    of = [bits[one] for one in value.operands]
    if value.kind in _UNIT_KINDS:
        return _DIGITS
    if value.kind in ("neg", "abs"):
        return of[0]
    if value.kind in "+-":
        return min(bits_of(interval), *of)
    if value.kind == "sqrt":
        raise PvidError(f"{where}: a square root has no fixed-point form")
    return bits_of(interval)


def _check(made: FixedProgram, where: str) -> None:
    """Every shift is one that the integers can take."""
    for place, value in enumerate(made.program.values):
        if not isinstance(value, Operation):
            continue
        if value.kind in ("*", "/") and not 0 <= shift_of(made, place) <= (63 if value.kind == "*" else 31):
            raise PvidError(f"{where}: the ranges of its signals differ by more than fixed point can hold")
        if value.kind in ("sin", "cos") and made.bits[value.operands[0]] < 0:
            raise PvidError(f"{where}: an angle may reach 2^30 rad, too large for fixed point")
        if value.kind == "soft_sign" and width_of(made, place) < 1:
            raise PvidError(f"{where}: the width of a soft sign is below the resolution of its velocity")


def width_of(made: FixedProgram, place: int) -> int:
    """Of a soft sign, in the format of its velocity."""
    velocity, width = made.program.operation(place).operands
    return nearest(made.program.literal(width) * Fraction(2) ** made.bits[velocity])


def angle_of(made: FixedProgram, place: int) -> tuple[int, int]:
    """Of a sine or cosine: the shift of its argument to the right, and its format then."""
    bits = made.bits[made.program.operation(place).operands[0]]
    return max(bits - _DIGITS, 0), min(bits, _DIGITS)


def shift_of(made: FixedProgram, place: int) -> int:
    """Of a product to the right, of a dividend to the left."""
    operation = made.program.operation(place)
    a, b = (made.bits[one] for one in operation.operands)
    return a + b - made.bits[place] if operation.kind == "*" else made.bits[place] - a + b
