"""How far rounding can move the results of a list of operations."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.codegen.operations import Argument, Literal, Program

Float = npt.NDArray[np.float64]

EPSILON = 2.0**-24  # of a rounding to float32, relative
TINY = 2.0**-149
SINE = 1.3e-7  # error of sine and cosine below 1000 rad, pvid/elementary.h


def bounds_of(program: Program, given: npt.NDArray[np.float32]) -> list[Float]:
    """Largest error of each result [vectors] in float32, from first-order error propagation with the largest factors.

    given: [arguments, vectors], exact.
    """
    values: list[Float] = []
    errors: list[Float] = []
    nothing = np.zeros(given.shape[1])
    for one in program.values:
        if isinstance(one, Literal):
            value = nothing + float(one.value)
            error = np.abs(value) * EPSILON
        elif isinstance(one, Argument):
            value, error = given[one.place].astype(np.float64), nothing
        else:
            value, error = _after(one.kind, [values[k] for k in one.operands], [errors[k] for k in one.operands])
        values.append(value)
        errors.append(error)
    return [errors[k] for k in program.results]


def _after(kind: str, x: list[Float], e: list[Float]) -> tuple[Float, Float]:
    a, da = x[0], e[0]
    b, db = (x[1], e[1]) if len(x) > 1 else (a, da)
    if kind in "+-":
        value = a + b if kind == "+" else a - b
        spread = da + db
    elif kind == "*":
        value, spread = a * b, np.abs(a) * db + np.abs(b) * da + da * db
    elif kind == "/":
        value = a / b
        spread = (da + np.abs(value) * db) / np.maximum(np.abs(b) - db, 1e-300)
    elif kind in ("sin", "cos"):
        value = np.sin(a) if kind == "sin" else np.cos(a)
        return value, da + SINE
    elif kind == "sign":
        return np.sign(a), np.where(np.abs(a) <= da, 2.0 * (da > 0), 0.0)
    elif kind == "sqrt":
        value = np.sqrt(a)
        spread = da / np.maximum(value, 1e-300)
    else:
        value, spread = (np.abs(a) if kind == "abs" else -a), da
        return value, spread
    return value, spread + (np.abs(value) + spread) * EPSILON + TINY
