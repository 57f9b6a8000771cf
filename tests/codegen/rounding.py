"""How far rounding can move the results of a list of operations, to first order and with the products of errors."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.codegen.formats import FixedProgram
from pvid.model.operations import Argument, Literal, Program

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Arithmetic:
    """Relative error of an operation, the least absolute one, and that of sine and cosine (and for each radian)."""

    relative: float
    least: float
    sine: float
    radian: float = 0.0


FLOAT32 = Arithmetic(2.0**-24, 2.0**-149, 1.3e-7)  # sine: pvid/elementary.h, below 1000 rad
SCALED = Arithmetic(2.0**-28, 0.0, 4e-9, 1.2e-10)  # pvid/scaled_q31.h, pvid/elementary_q31.h


def bounds_of(program: Program, given: Float, arithmetic: Arithmetic) -> list[Float]:
    """Largest error of each result [vectors] for exact inputs [arguments, vectors]."""
    values: list[Float] = []
    errors: list[Float] = []
    nothing = np.zeros(given.shape[1])
    for one in program.values:
        if isinstance(one, Literal):
            value = nothing + float(one.value)
            error = np.abs(value) * arithmetic.relative
        elif isinstance(one, Argument):
            value, error = given[one.place], nothing
        else:
            x, e = [values[k] for k in one.operands], [errors[k] for k in one.operands]
            value, error = _after(one.kind, x, e)
            if one.kind in ("sin", "cos"):
                error = error + arithmetic.sine + arithmetic.radian * np.abs(x[0])
            elif one.kind not in ("sign", "abs", "neg"):
                error = error + (np.abs(value) + error) * arithmetic.relative + arithmetic.least
        values.append(value)
        errors.append(error)
    return [errors[k] for k in program.results]


def fixed_bounds_of(made: FixedProgram, given: Float) -> list[Float]:
    """The same for fixed point: half a unit of its format for each rounding, one for a quotient."""
    program = made.program
    values: list[Float] = []
    errors: list[Float] = []
    nothing = np.zeros(given.shape[1])
    for place, one in enumerate(program.values):
        unit = 2.0 ** -made.bits[place]
        if isinstance(one, Literal):
            value, error = nothing + float(one.value), nothing + unit / 2
        elif isinstance(one, Argument):
            value, error = given[one.place], nothing
        else:
            x, e = [values[k] for k in one.operands], [errors[k] for k in one.operands]
            value, error = _after(one.kind, x, e)
            if one.kind in ("sin", "cos"):
                error = error + SCALED.sine + SCALED.radian * np.abs(x[0]) + 2.0**-31
            elif one.kind not in ("sign", "abs", "neg"):
                error = error + unit
        values.append(value)
        errors.append(error)
    return [errors[k] for k in program.results]


def _after(kind: str, x: list[Float], e: list[Float]) -> tuple[Float, Float]:
    """Value, and what the operands' errors make of it."""
    a, da = x[0], e[0]
    b, db = (x[1], e[1]) if len(x) > 1 else (a, da)
    if kind == "+":
        return a + b, da + db
    if kind == "-":
        return a - b, da + db
    if kind == "*":
        return a * b, np.abs(a) * db + np.abs(b) * da + da * db
    if kind == "/":
        value = a / b
        return value, (da + np.abs(value) * db) / np.maximum(np.abs(b) - db, 1e-300)
    if kind == "sin":
        return np.sin(a), da
    if kind == "cos":
        return np.cos(a), da
    if kind == "sign":
        return np.sign(a), np.where(np.abs(a) <= da, 2.0 * (da > 0), 0.0)
    if kind == "sqrt":
        return np.sqrt(a), da / np.maximum(np.sqrt(a), 1e-300)
    return (np.abs(a) if kind == "abs" else -a), da
