"""Exact tests on expressions with sines and cosines: is it zero, are functions linearly dependent.

Each distinct angle becomes a rational parameter: sin a = 2 r / (1 + r^2), cos a = (1 - r^2) / (1 + r^2), so that
sin^2 + cos^2 = 1 and the sums of angles hold at every rational point. The angle itself is a number of its own.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from pvid.model.modular import echelon, rational, residue
from pvid.model.refusal import ModelError
from pvid.model.signals import Integral

_LONGEST_SUM, _LARGEST_MULTIPLE = 4, 6  # of the angles that are split
_ATTEMPTS = 5  # at a point where no denominator is 0


def _angles_apart(expression: sp.Expr) -> sp.Expr:
    """Sines of short sums by those of their terms; a long sum stays an angle of its own."""
    sines = [one for one in expression.atoms(sp.sin, sp.cos) if _is_short(sp.expand(one.args[0]))]
    return expression.xreplace({one: sp.expand_trig(one) for one in sines}) if sines else expression


def _is_short(angle: sp.Expr) -> bool:
    terms = sp.Add.make_args(angle)
    return len(terms) <= _LONGEST_SUM and all(abs(term.as_coeff_Mul()[0]) <= _LARGEST_MULTIPLE for term in terms)


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
        whole = _angles_apart(sp.sympify(expression))
        for one in whole.atoms(Integral):
            self.values.setdefault(one, self.number())
        for one in whole.atoms(sp.sin, sp.cos):
            angle, sign = _base_angle(one.args[0])
            r = self.slopes.setdefault(angle, self.number() / 97)
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


class _FractionPrinter(PythonCodePrinter):  # type: ignore[misc]
    def _print_Rational(self, number: sp.Rational) -> str:
        return f"Fraction({number.p}, {number.q})"


def function_of_fractions(arguments: Sequence[sp.Symbol], values: Sequence[sp.Expr]) -> Any:
    """A Python function, exact on fractions, of rational functions."""
    names = {one: sp.Dummy() for one in arguments}
    whole = [one.xreplace(names) for one in values]
    printer = _FractionPrinter({"fully_qualified_modules": False})
    return sp.lambdify(list(names.values()), whole, modules=[{"Fraction": Fraction}], printer=printer, cse=True)


class Sampler:
    """Many functions at once at random rational points; fast, and exact."""

    def __init__(self, functions: Sequence[sp.Expr]) -> None:
        apart = [_angles_apart(one) for one in functions]
        whole = sp.Tuple(*apart)
        self.integrals = sorted(whole.atoms(Integral), key=str)
        marks: dict[sp.Expr, sp.Symbol] = {one: sp.Dummy() for one in self.integrals}
        apart = [one.xreplace(marks) for one in apart]
        whole = sp.Tuple(*apart)
        self.sines = sorted(whole.atoms(sp.sin, sp.cos), key=str)
        sine_marks = {one: sp.Dummy() for one in self.sines}
        apart = [one.xreplace(sine_marks) for one in apart]
        self.plain = sorted(sp.Tuple(*apart).free_symbols - set(sine_marks.values()), key=lambda one: one.sort_key())
        self.function = function_of_fractions([*self.plain, *sine_marks.values()], apart)

    def at_random(self, source: random.Random) -> list[Fraction]:
        """Values at a new point, at which nothing is divided by 0.

        Raises ModelError where a denominator is always 0.
        """
        for _ in range(_ATTEMPTS):
            try:
                return self._at_random(source)
            except ZeroDivisionError:
                continue
        raise ModelError("an equation is divided by an expression that is 0")

    def _at_random(self, source: random.Random) -> list[Fraction]:
        numbers = [_fraction(source) for _ in self.plain]
        slopes: dict[sp.Expr, Fraction] = {}
        values = []
        for one in self.sines:
            angle, sign = _base_angle(one.args[0])
            r = slopes.setdefault(angle, _fraction(source) / 97)
            values.append(sign * 2 * r / (1 + r**2) if isinstance(one, sp.sin) else (1 - r**2) / (1 + r**2))
        return [Fraction(one) for one in self.function(*numbers, *values)]


def _fraction(source: random.Random) -> Fraction:
    return Fraction(source.randint(2, 97), source.randint(2, 97))


def dependent(functions: Sequence[sp.Expr]) -> dict[int, Mapping[int, sp.Rational]]:
    """Functions that are linear combinations of earlier ones, with the coefficients of those, over the rationals."""
    if len(functions) == 0:
        return {}
    sampler, source = Sampler(functions), random.Random(1)
    rows = [sampler.at_random(source) for _ in range(len(functions) + 2)]
    found, pivots = echelon([list(map(residue, row)) for row in rows])
    out: dict[int, Mapping[int, sp.Rational]] = {}
    for j in range(len(functions)):
        if j not in pivots:
            shares = {pivot: rational(row[j]) for row, pivot in zip(found, pivots, strict=True) if row[j]}
            out[j] = {pivot: sp.Rational(one.numerator, one.denominator) for pivot, one in shares.items()}
    return out
