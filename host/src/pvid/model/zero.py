"""Exact tests on expressions with sines and cosines: is it zero, are functions linearly dependent.

Each distinct angle becomes a rational parameter: sin a = 2 r / (1 + r^2), cos a = (1 - r^2) / (1 + r^2), so that
sin^2 + cos^2 = 1 and the sums of angles hold at every rational point. The angle itself is a number of its own.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from pvid.model.signals import Integral


def _angles_apart(expression: sp.Expr) -> sp.Expr:
    return sp.expand_trig(expression) if expression.has(sp.sin, sp.cos) else expression


def _base_angle(argument: sp.Expr) -> tuple[sp.Expr, int]:
    """The angle and its sign, so that sin(-a) and sin(a) share a parameter."""
    return (-argument, -1) if argument.could_extract_minus_sign() else (argument, 1)


@dataclass
class RationalPoint:
    """A random rational value for every symbol, angle and running integral that is met."""

    source: random.Random
    values: dict[sp.Expr, sp.Expr] = field(default_factory=dict)
    slopes: dict[sp.Expr, sp.Expr] = field(default_factory=dict)

    def number(self) -> sp.Rational:
        """Never 0."""
        return sp.Rational(self.source.randint(2, 97), self.source.randint(2, 97))

    def of(self, expression: sp.Expr) -> sp.Expr:
        """The expression's value: a rational number where it is a rational function of symbols, sines and cosines."""
        whole = sp.expand_trig(expression) if expression.has(sp.sin, sp.cos) else sp.sympify(expression)
        for one in whole.atoms(Integral):
            self.values.setdefault(one, self.number())
        for one in whole.atoms(sp.sin, sp.cos):
            angle, sign = _base_angle(one.args[0])
            r = self.slopes.setdefault(angle, self.number())
            sine, cosine = 2 * r / (1 + r**2), (1 - r**2) / (1 + r**2)
            self.values.setdefault(one, sign * sine if isinstance(one, sp.sin) else cosine)
        for one in sorted(whole.free_symbols, key=str):
            self.values.setdefault(one, self.number())
        return whole.xreplace(self.values)


def is_zero(expression: sp.Expr) -> bool:
    """Whether it vanishes identically: by expansion, else by the rational parameters of its angles."""
    whole = sp.expand(expression)
    if whole == 0:
        return True
    if not whole.has(sp.sin, sp.cos):
        return bool(sp.cancel(sp.together(whole)) == 0)
    apart = sp.expand(_angles_apart(whole))
    if apart == 0:
        return True
    slopes: dict[sp.Expr, sp.Symbol] = {}
    values = {}
    for one in apart.atoms(sp.sin, sp.cos):
        angle, sign = _base_angle(one.args[0])
        r = slopes.setdefault(angle, sp.Dummy())
        values[one] = sign * 2 * r / (1 + r**2) if isinstance(one, sp.sin) else (1 - r**2) / (1 + r**2)
    numerator, _ = sp.fraction(sp.together(apart.xreplace(values)))
    return bool(sp.expand(numerator) == 0)


def dependent(functions: Sequence[sp.Expr], seed: int = 1) -> dict[int, Mapping[int, sp.Rational]]:
    """Functions that are linear combinations of earlier ones, with the coefficients of those, over the rationals."""
    if len(functions) == 0:
        return {}
    source = random.Random(seed)
    rows = []
    for _ in range(len(functions) + 2):
        point = RationalPoint(source)
        rows.append([point.of(one) for one in functions])
    matrix = sp.Matrix(rows)
    if not all(one.is_Rational for one in matrix):
        return {}
    reduced, pivots = sp.polys.matrices.DomainMatrix.from_Matrix(matrix).to_field().rref()
    reduced = reduced.to_Matrix()
    out: dict[int, Mapping[int, sp.Rational]] = {}
    for j in range(len(functions)):
        if j not in pivots:
            out[j] = {pivot: reduced[i, j] for i, pivot in enumerate(pivots) if reduced[i, j] != 0}
    return out
