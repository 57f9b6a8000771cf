"""Units of quantities, and of every term of an equation.

Equations are in SI: only coherent units are accepted (m, not mm; rad, not deg), so that a right dimension is a right
scale. rad is a pure number.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import sympy as sp

from pvid.model.readable import readable
from pvid.model.refusal import ModelError
from pvid.model.signals import TIME, Integral, Jet, sgn

_BASE_NAMES = ("kg", "m", "s", "A", "K", "mol", "cd")
_DIMENSIONS = ("mass", "length", "time", "current", "temperature", "amount_of_substance", "luminous_intensity")
# Exponents of the base units in the usual coherent ones. All others are those of sympy, whose units take a seventh of a
# second to load.
_COHERENT: dict[str, tuple[int, ...]] = {
    **{name: tuple(int(name == one) for one in _BASE_NAMES) for name in _BASE_NAMES},
    **{"rad": (), "count": (), "Hz": (0, 0, -1), "N": (1, 1, -2), "Pa": (1, -1, -2), "J": (1, 2, -2), "W": (1, 2, -3)},
    **{"C": (0, 0, 1, 1), "V": (1, 2, -3, -1), "ohm": (1, 2, -3, -2), "Ohm": (1, 2, -3, -2), "H": (1, 2, -2, -2)},
    **{"F": (-1, -2, 4, 2), "S": (-1, -2, 3, 2), "Wb": (1, 2, -2, -1), "T": (1, 0, -2, -1)},
}
_ALSO = {"pct": "percent", "min": "minute", "deg": "degree"}


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
        return "*".join(name if one == 1 else f"{name}^{one}" for name, one in named) or "1"

    @property
    def unit(self) -> str:
        """The shortest text of it that is a unit of SI; "" of a number."""
        over = [_power(name, one) for name, one in zip(_BASE_NAMES, self.of, strict=True) if one > 0]
        under = [_power(name, -one) for name, one in zip(_BASE_NAMES, self.of, strict=True) if one < 0]
        below = f"/({'*'.join(under)})" if len(under) > 1 else f"/{under[0]}" if under else ""
        texts = [f"{'*'.join(over) or '1'}{below}", *([_named(self)] if _named(self) else [])]
        return "" if self == NUMBER else min(texts, key=len)


def _power(name: str, exponent: sp.Rational) -> str:
    return name if exponent == 1 else f"{name}^{exponent}"


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

    Raises
    ------
    ModelError
        Where the text is no unit, or not one of the coherent units of SI.
    """
    if not text.strip():
        return NUMBER
    try:
        dimension, scale = _measured(ast.parse(text.replace("^", "**").strip(), mode="eval").body)
    except (SyntaxError, ValueError, TypeError) as error:
        raise ModelError(f'"{text}" is no unit: write it as in "kg*m^2/s", with units of SI') from error
    if scale != 1:
        coherent = "rad" if dimension == NUMBER else str(dimension)
        raise ModelError(f'the unit "{text}" is {_plain(scale)} {coherent}: equations are in SI, use "{coherent}"')
    return dimension


def _plain(scale: sp.Expr) -> str:
    return f"{float(scale):.6g}"


def _measured(node: ast.expr) -> tuple[Dimension, sp.Expr]:
    """Dimension, and how many coherent units it is."""
    if isinstance(node, ast.BinOp):
        (left, by), (right, number) = _measured(node.left), _measured(node.right)
        if isinstance(node.op, ast.Mult):
            return left * right, sp.simplify(by * number)
        if isinstance(node.op, ast.Div):
            return left * right.power(sp.Integer(-1)), sp.simplify(by / number)
        if isinstance(node.op, ast.Pow) and right == NUMBER and number.is_Rational:
            return left.power(number), sp.simplify(by**number)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        dimension, scale = _measured(node.operand)
        return dimension, -scale
    elif isinstance(node, ast.Constant) and isinstance(node.value, int):
        return NUMBER, sp.Integer(node.value)
    elif isinstance(node, ast.Name):
        exponents = _COHERENT.get(node.id)
        return _of_sympy(_ALSO.get(node.id, node.id)) if exponents is None else (_of(*exponents), sp.Integer(1))
    raise ValueError(ast.dump(node))


def _of(*exponents: int) -> Dimension:
    whole = (*exponents, *(0,) * (len(_BASE_NAMES) - len(exponents)))
    return Dimension(tuple(map(sp.Integer, whole)))


def _of_sympy(name: str) -> tuple[Dimension, sp.Expr]:
    """Dimension of a unit that sympy has, and how many coherent units it is."""
    from sympy.physics import units as si
    from sympy.physics.units.systems.si import dimsys_SI

    unit = getattr(si, name, None)
    if not isinstance(unit, si.Quantity):
        raise ValueError(name)
    exponents = dimsys_SI.get_dimensional_dependencies(si.systems.SI.get_quantity_dimension(unit))
    by_name = {str(getattr(one, "name", one)): number for one, number in exponents.items()}
    dimension = Dimension(tuple(sp.sympify(by_name.get(one, 0)) for one in _DIMENSIONS))
    base = (si.kilogram, si.meter, si.second, si.ampere, si.kelvin, si.mole, si.candela)
    coherent = sp.prod([one.scale_factor**number for one, number in zip(base, dimension.of, strict=True)])
    return dimension, sp.simplify(unit.scale_factor / coherent)


def dimension_of(expression: sp.Expr, of: Mapping[str, Dimension]) -> Dimension | None:
    """Of an expression; None of 0. `of` contains signals and symbols by name.

    Raises
    ------
    ModelError
        Where terms of a sum, or the argument of a sine, have the wrong unit.
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
        raise ModelError(f"the term {wrong} has the unit {odd}, but {right}, which is added to it, has {usual}")
    return next(iter(by_unit), None)
