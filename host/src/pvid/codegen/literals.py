"""Constants as text that reads back as the same float32, in C and in Python."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from pvid.base.errors import PvidError
from pvid.codegen.operations import Literal, Program
from pvid.design.c_tables import float_literal


def float32_of(value: Fraction) -> np.float32:
    """The nearest float32, rounded once.

    Raises
    ------
    PvidError
        Where it is beyond the range of float32, or rounds to 0 and is not 0.
    """
    try:
        near = np.float32(float(value))
    except OverflowError:
        near = np.float32(np.inf)
    if not np.isfinite(near) or (near == 0 and value != 0):
        raise PvidError(f"the constant {float(value):.9g} is beyond the range of float32: choose other units")
    candidates = [near, np.nextafter(near, np.float32(np.inf)), np.nextafter(near, np.float32(-np.inf))]
    return min(candidates, key=lambda one: abs(Fraction(float(one)) - value))


def c_literal(value: Fraction) -> str:
    """As in 0.25f."""
    return float_literal(float32_of(value))


def python_literal(value: Fraction) -> str:
    """As in _F(0.25)."""
    return f"_F({float_literal(float32_of(value)).removesuffix('f')})"


def check_literals(program: Program) -> None:
    """PvidError for a constant of the list that float32 does not have."""
    for one in program.values:
        if isinstance(one, Literal):
            float32_of(one.value)
