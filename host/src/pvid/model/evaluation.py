"""Numpy functions of expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.numpy import NumPyPrinter


def numpy_function(symbols: Sequence[sp.Symbol], expressions: Any) -> Callable[..., Any]:
    """A function of the symbols' values, as scalars or arrays, that gives an expression, a tuple for a list of them, or
    an array for a matrix. The last ones are kept.

    `lambdify` with "numpy" does the same, and imports all of numpy's packages, the Fortran one too, for a quarter of a
    second.
    """
    return _compiled(tuple(symbols), _fixed(expressions))


def _fixed(expressions: Any) -> Any:
    """Lists as tuples, and matrices that do not change."""
    if isinstance(expressions, list | tuple):
        return tuple(map(_fixed, expressions))
    return expressions.as_immutable() if isinstance(expressions, sp.MatrixBase) else expressions


@lru_cache(maxsize=512)
def _compiled(symbols: tuple[sp.Symbol, ...], expressions: Any) -> Callable[..., Any]:
    function: Callable[..., Any] = sp.lambdify(
        symbols, expressions, modules=[{"numpy": np}], printer=NumPyPrinter, cse=True
    )
    return function


@lru_cache(maxsize=256)
def with_slopes(
    values: tuple[sp.Expr, ...], by: tuple[sp.Symbol, ...], beside: tuple[sp.Symbol, ...] = ()
) -> Callable[..., Any]:
    """A function of two groups of symbols: values, and their slopes by those of the first group [values, by]."""
    return numpy_function([*by, *beside], [list(values), [[value.diff(one) for one in by] for value in values]])
