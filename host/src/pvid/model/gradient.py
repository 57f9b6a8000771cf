"""Gradients of functions of the unknowns at random rational points, and ranks over the rationals."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from pvid.model.modular import echelon, residue
from pvid.model.zero import RationalPoint


def jacobian_at(
    theta: Sequence[sp.Expr], p: Sequence[sp.Symbol], seed: int = 1, constants: Sequence[sp.Symbol] = ()
) -> tuple[sp.Matrix, list[sp.Expr]]:
    """d theta / d p [theta, p] and p itself at a random point; `constants` stay symbols."""
    point = RationalPoint(random.Random(seed))
    point.values.update({one: one for one in constants})
    at = [point.of(one) for one in p]
    whole = sp.Matrix(len(theta), len(p), lambda i, j: point.of(sp.diff(theta[i], p[j])))
    return whole, at


def rank(matrix: sp.Matrix) -> int:
    """Over the rationals."""
    if 0 in matrix.shape:
        return 0
    if all(one.is_Rational for one in matrix):
        rows = [[residue(Fraction(int(one.p), int(one.q))) for one in matrix.row(k)] for k in range(matrix.rows)]
        return len(echelon(rows)[1])
    return int(DomainMatrix.from_Matrix(matrix).to_field().rank())


def null_space(matrix: sp.Matrix) -> list[list[sp.Expr]]:
    """A basis of the vectors that the matrix maps to 0."""
    if matrix.rows == 0:
        return [[sp.Integer(int(i == j)) for j in range(matrix.cols)] for i in range(matrix.cols)]
    basis = DomainMatrix.from_Matrix(matrix).to_field().nullspace().to_Matrix()
    return [list(basis.row(k)) for k in range(basis.rows)]
