"""Units of quantities, and of every term of an equation.

Equations are in SI: only coherent units are accepted (m, not mm; rad, not deg), so that a right dimension is a right
scale. rad is a pure number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import sympy as sp

from pvid.base.units import BASE, unit_of
from pvid.model.readable import readable
from pvid.model.refusal import ModelError
from pvid.model.signals import TIME, Integral, Jet, sgn

_BASE_NAMES = BASE[:-1]


@dataclass(frozen=True)
class Dimension:
    """Exponents of kg, m, s, A, K, mol, cd."""

    of: tuple[sp.Rational, ...] = (sp.Integer(0),) * len(_BASE_NAMES)

    def __mul__(self, other: Dimension) -> Dimension:
        return Dimension(tuple(a + b for a, b in zip(self.of, other.of, strict=True)))

    def power(self, exponent: sp.Rational) -> Dimension:
        """This to a power."""
        return Dimension(tuple(one * exponent for one in self.of))

    def __str__(self) -> str:
        return _named(self) or self.in_base_units

    @property
    def in_base_units(self) -> str:
        """As in "kg*m^2*s^-2"."""
        named = [(name, one) for name, one in zip(_BASE_NAMES, self.of, strict=True) if one != 0]
        return "*".join(_power(name, one) for name, one in named) or "1"

    @property
    def unit(self) -> str:
        """The shortest text of it that is a unit of SI; "" of a number."""
        over = [_power(name, one) for name, one in zip(_BASE_NAMES, self.of, strict=True) if one > 0]
        under = [_power(name, -one) for name, one in zip(_BASE_NAMES, self.of, strict=True) if one < 0]
        below = f"/({'*'.join(under)})" if len(under) > 1 else f"/{under[0]}" if under else ""
        texts = [f"{'*'.join(over) or '1'}{below}", *([_named(self)] if _named(self) else [])]
        return "" if self == NUMBER else min(texts, key=len)


def _power(name: str, exponent: sp.Rational) -> str:
    text = f"{exponent}" if exponent.is_Integer else f"({exponent})"
    return name if exponent == 1 else f"{name}^{text}"


NUMBER = Dimension()

# Derived units by which errors name a dimension, alone or with a power of s, m or A.
_DERIVED = ("N", "N*m", "V", "ohm", "H", "F", "W", "A", "m", "kg", "s", "C", "Pa", "K", "kg*m", "kg*m^2")
_WITH = ("", "*s", "/s", "/s^2", "*s^2", "/m", "/m^2", "*m", "*m^2", "/A", "*A", "*s/m", "/(A*s)", "/K")


def _named(dimension: Dimension) -> str:
    """The shortest of a derived unit and a power; "" where there is none, "1" of a number."""
    return _names().get(dimension, "")


@cache
def _names() -> dict[Dimension, str]:
    out = {NUMBER: "1", dimension_of_unit("1/s"): "1/s", dimension_of_unit("1/s^2"): "1/s^2"}
    for text in sorted((one + other for one in _DERIVED for other in _WITH), key=len):
        out.setdefault(dimension_of_unit(text), text)
    return out


PER_SECOND = Dimension(tuple(sp.Integer(-1 if name == "s" else 0) for name in _BASE_NAMES))


@cache
def dimension_of_unit(text: str) -> Dimension:
    """Of a unit such as "N*m/A", "1/s^2" or "".

    Raises ModelError where the text is no unit, or not one of the coherent units of SI.
    """
    if not text.strip():
        return NUMBER
    unit = unit_of(text.strip().replace("**", "^"))
    if unit is None or text.strip()[0] in "*/":
        raise ModelError(f'"{text}" is no unit: write it as in "kg*m^2/s", with units of SI')
    dimension = Dimension(tuple(map(sp.Rational, unit.dimension[:-1])))
    scale = float(unit.scale) * math.pi**unit.turns
    if scale != 1:
        coherent = "rad" if dimension == NUMBER and unit.turns else str(dimension)
        raise ModelError(f'the unit "{text}" is {scale:.6g} {coherent}: equations are in SI, use "{coherent}"')
    return dimension


def dimension_of(expression: sp.Expr, of: Mapping[str, Dimension]) -> Dimension | None:
    """Of an expression; None of 0. `of` contains signals and symbols by name.

    Raises ModelError where terms of a sum, or the argument of a sine, have the wrong unit.
    """
    if expression == 0:
        return None
    if isinstance(expression, Jet):
        return of[expression.of] * PER_SECOND.power(sp.Integer(expression.order))
    if expression == TIME:
        return PER_SECOND.power(sp.Integer(-1))
    if isinstance(expression, sp.Symbol):
        return of[expression.name]
    if expression.is_number:
        return NUMBER
    if expression.is_Add:
        return _of_sum(expression, of)
    if expression.is_Mul:
        total = NUMBER
        for factor in expression.args:
            total = total * (dimension_of(factor, of) or NUMBER)
        return total
    if expression.is_Pow:
        base = dimension_of(expression.base, of) or NUMBER
        if not expression.exp.is_number:
            _must_be_number(expression.exp, of, expression)
            _must_be_number(expression.base, of, expression)
            return NUMBER
        return base.power(expression.exp)
    if isinstance(expression, sp.Abs):
        return dimension_of(expression.args[0], of)
    if isinstance(expression, sgn):
        dimension_of(expression.args[0], of)
        return NUMBER
    if isinstance(expression, Integral):
        inner = dimension_of(expression.args[0], of) or NUMBER
        return inner * PER_SECOND.power(-expression.args[1])
    for argument in expression.args:
        _must_be_number(argument, of, expression)
    return NUMBER


def _must_be_number(argument: sp.Expr, of: Mapping[str, Dimension], whole: sp.Expr) -> None:
    found = dimension_of(argument, of)
    if found is not None and found != NUMBER:
        raise ModelError(
            f"{readable(argument)} inside {readable(whole)} has the unit {found}, it must be a pure number (or rad)"
        )


def _unsigned(term: sp.Expr) -> sp.Expr:
    return -term if term.could_extract_minus_sign() else term


def _of_sum(expression: sp.Expr, of: Mapping[str, Dimension]) -> Dimension | None:
    by_unit: dict[Dimension, list[sp.Expr]] = {}
    for term in expression.args:
        found = dimension_of(term, of)
        if found is not None:
            by_unit.setdefault(found, []).append(term)
    if len(by_unit) > 1:
        usual, *_, odd = sorted(by_unit, key=lambda one: -len(by_unit[one]))
        wrong, right = (readable(_unsigned(by_unit[one][0])) for one in (odd, usual))
        bare = any(not one.as_coeff_Mul()[0].is_Integer for terms in by_unit.values() for one in terms)
        more = "; a number has no unit: a constant that has one is a model.known(NAME, UNIT, VALUE)" if bare else ""
        raise ModelError(f"the term {wrong} has the unit {odd}, but {right}, which is added to it, has {usual}{more}")
    return next(iter(by_unit), None)
