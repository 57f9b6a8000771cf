"""SymPy expressions, and what a function of numbers computes, as one list of three-address operations.

Every printer reads this list: an operation has at most two operands, each value is computed once, and the order of the
operands is fixed here. `evaluated` computes it in numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any
from typing import Literal as OneOf

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.signals import sgn

Kind = OneOf["+", "-", "*", "/", "neg", "sin", "cos", "sign", "soft_sign", "abs", "sqrt"]

_COMMUTES = ("+", "*")
_DIGITS = 40  # of an irrational constant before it is rounded to a literal


@dataclass(frozen=True)
class Literal:
    """A constant; each printer rounds it once."""

    value: Fraction


@dataclass(frozen=True)
class Argument:
    """The input at a place."""

    place: int


@dataclass(frozen=True)
class Operation:
    """An operation on values at these places of the list; soft_sign has its width as second operand."""

    kind: Kind
    operands: tuple[int, ...]


Value = Literal | Argument | Operation


@dataclass(frozen=True)
class Program:
    """A function as a list of values, each of which uses those before it.

    Attributes
    ----------
    arguments : names of the inputs
    values : literals, arguments and operations
    results : places of the outputs
    """

    arguments: tuple[str, ...]
    values: tuple[Value, ...]
    results: tuple[int, ...]

    @property
    def operations(self) -> int:
        """How many there are."""
        return sum(isinstance(one, Operation) for one in self.values)

    @property
    def cost(self) -> str:
        """As in "3 operations"."""
        return f"{self.operations} operation{'' if self.operations == 1 else 's'}"

    def literal(self, place: int) -> Fraction:
        """The constant at a place."""
        value = self.values[place]
        assert isinstance(value, Literal)
        return value.value

    def operation(self, place: int) -> Operation:
        """The operation at a place."""
        value = self.values[place]
        assert isinstance(value, Operation)
        return value

    def kind(self, place: int) -> Kind:
        """Of the operation at a place."""
        return self.operation(place).kind

    @property
    def kinds(self) -> set[Kind]:
        """Kinds of the operations."""
        return {one.kind for one in self.values if isinstance(one, Operation)}


_IN_NUMPY: Mapping[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "neg": np.negative,
    "sin": np.sin,
    "cos": np.cos,
    "sign": np.sign,
    "soft_sign": lambda v, width: v / (np.abs(v) + width),
    "abs": np.abs,
    "sqrt": np.sqrt,
}


def _computed(program: Program, given: Sequence[Any] | npt.NDArray[Any]) -> list[Any]:
    values: list[Any] = []
    for one in program.values:
        if isinstance(one, Literal):
            values.append(float(one.value))
        elif isinstance(one, Argument):
            values.append(given[one.place])
        else:
            values.append(_IN_NUMPY[one.kind](*(values[place] for place in one.operands)))
    return values


def evaluated(program: Program, given: Sequence[Any] | npt.NDArray[Any]) -> list[Any]:
    """The results, each a number or [...], from the arguments, each a number or [...], in their type."""
    values = _computed(program, given)
    return [values[place] for place in program.results]


def differentiated(
    program: Program, given: Sequence[npt.NDArray[Any]] | npt.NDArray[Any]
) -> tuple[list[Any], Callable[[Sequence[Any]], list[Any]]]:
    """The results, and a function: weights of the results [...] -> derivative of their weighted sum by each argument.

    Of sums, products, sines and cosines; backwards through the list, so that all arguments cost about three times the
    results. Complex arguments give the complex derivative.
    """
    values = _computed(program, given)

    def back(weights: Sequence[Any]) -> list[Any]:
        slopes: list[Any] = [0.0] * len(values)
        for place, weight in zip(program.results, weights, strict=True):
            slopes[place] = slopes[place] + weight
        out: list[Any] = [0.0] * len(program.arguments)
        for place in range(len(values) - 1, -1, -1):
            one, slope = program.values[place], slopes[place]
            if isinstance(one, Argument):
                out[one.place] = slope
            elif isinstance(one, Operation):
                parts = _PARTIAL[one.kind]([values[k] for k in one.operands], slope)
                for operand, part in zip(one.operands, parts, strict=True):
                    if not isinstance(program.values[operand], Literal):
                        slopes[operand] = slopes[operand] + part
        return out

    return [values[place] for place in program.results], back


_PARTIAL: Mapping[str, Callable[[list[Any], Any], tuple[Any, ...]]] = {
    "+": lambda _, slope: (slope, slope),
    "-": lambda _, slope: (slope, -slope),
    "*": lambda x, slope: (slope * x[1], slope * x[0]),
    "neg": lambda _, slope: (-slope,),
    "sin": lambda x, slope: (slope * np.cos(x[0]),),
    "cos": lambda x, slope: (-slope * np.sin(x[0]),),
}


def program_of(
    arguments: Sequence[sp.Expr],
    expressions: Iterable[sp.Expr],
    names: Sequence[str] | None = None,
    widths: Mapping[str, float] | None = None,
) -> Program:
    """The operations that compute the expressions.

    Raises PvidError for a symbol that is no argument, and for a function other than sin, cos, tan, sgn, abs and sqrt.

    Parameters
    ----------
    arguments : what is given: symbols, and other expressions that are inputs as a whole (an integral)
    expressions : what is computed, in this order
    names : of the arguments; their text by default
    widths : argument of a sgn, as text -> width of the soft sign v / (|v| + width) in its place; a plain sign without
        one
    """
    builder = Builder(arguments, widths or {})
    results = tuple(builder.place_of(sp.sympify(one)) for one in expressions)
    return Program(tuple(names or map(str, arguments)), tuple(builder.values), results)


class Traced:
    """A number of a function that is traced; constants are folded, and products with 0 and 1, so that a value is one or
    a float."""

    def __init__(self, builder: Builder, place: int) -> None:
        self._builder, self.place = builder, place

    def _do(self, kind: Kind, *operands: Traced | float) -> Traced:
        places = (self._builder.constant(one) if isinstance(one, float | int) else one.place for one in operands)
        return Traced(self._builder, self._builder.operation(kind, *places))

    def __add__(self, other: Traced | float) -> Traced:
        return self if isinstance(other, float | int) and other == 0 else self._do("+", self, other)

    __radd__ = __add__

    def __neg__(self) -> Traced:
        return self._do("neg", self)

    def __sub__(self, other: Traced | float) -> Traced | float:
        if isinstance(other, Traced) and other.place == self.place:
            return 0.0
        return self if isinstance(other, float | int) and other == 0 else self._do("-", self, other)

    def __rsub__(self, other: float) -> Traced:
        return -self if other == 0 else self._do("-", other, self)

    def __mul__(self, other: Traced | float) -> Traced | float:
        if isinstance(other, Traced):
            return self._do("*", self, other)
        if other in (0, 1):
            return self if other else 0.0
        return -self if other == -1 else self._do("*", self, other)

    __rmul__ = __mul__

    def sin(self) -> Traced:
        """Its sine."""
        return self._do("sin", self)

    def cos(self) -> Traced:
        """Its cosine."""
        return self._do("cos", self)


def traced(arguments: Sequence[str], function: Callable[[list[Traced]], Sequence[Traced | float]]) -> Program:
    """The operations that a function does with its arguments, those that its results need alone."""
    builder = Builder([], {})
    given = [Traced(builder, builder.argument(place)) for place in range(len(arguments))]
    found = function(given)
    results = [one.place if isinstance(one, Traced) else builder.constant(one) for one in found]
    needed = set(results)
    for place in range(len(builder.values) - 1, -1, -1):
        value = builder.values[place]
        if place in needed and isinstance(value, Operation):
            needed.update(value.operands)
    new = {place: k for k, place in enumerate(sorted(needed))}
    values = [builder.values[place] for place in new]
    moved = (
        Operation(one.kind, tuple(new[k] for k in one.operands)) if isinstance(one, Operation) else one
        for one in values
    )
    return Program(tuple(arguments), tuple(moved), tuple(new[place] for place in results))


class Builder:
    """The list as it grows; equal values share a place.

    `definitions` holds symbols that stand for expressions in arguments and other symbols; each is computed where it is
    first needed. `fixed` are arguments that change seldom: in products what depends on them alone is one factor, with
    its divisions, which a caller can compute ahead.
    """

    def __init__(
        self,
        arguments: Sequence[sp.Expr],
        widths: Mapping[str, float],
        definitions: Mapping[sp.Expr, sp.Expr] | None = None,
        fixed: Iterable[sp.Symbol] = (),
    ) -> None:
        self.values: list[Value] = []
        self._places: dict[Value, int] = {}
        self._arguments = {one: Argument(place) for place, one in enumerate(arguments)}
        self._widths = widths
        self._definitions = definitions or {}
        self._fixed = dict.fromkeys(fixed, True)

    def _put(self, value: Value) -> int:
        if value not in self._places:
            self._places[value] = len(self.values)
            self.values.append(value)
        return self._places[value]

    def constant(self, value: float) -> int:
        """The place of a number."""
        return self._put(Literal(Fraction(value)))

    def argument(self, place: int) -> int:
        """The place of an input."""
        return self._put(Argument(place))

    def operation(self, kind: Kind, *operands: int) -> int:
        """The place of an operation."""
        if kind in _COMMUTES:
            operands = tuple(sorted(operands, key=lambda place: (not isinstance(self.values[place], Literal), place)))
        return self._put(Operation(kind, operands))

    def place_of(self, e: sp.Expr) -> int:
        """The place of its value."""
        if e in self._arguments:
            return self._put(self._arguments[e])
        if e in self._definitions:
            return self.place_of(self._definitions[e])
        if e.is_number:
            return self._put(Literal(exact(e)))
        if e.is_Symbol:
            raise PvidError(f"{e} has no value in a generated function of {', '.join(map(str, self._arguments))}")
        if e.is_Add:
            return self._sum(sorted(e.args, key=sp.default_sort_key))
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e.base, e.exp)
        return self._function(e)

    def _sum(self, terms: Sequence[sp.Expr]) -> int:
        """Positive terms and differences: no term is negated but a sum that has negative terms only."""
        signed = [(_is_negative(term), term) for term in terms]
        if all(negative for negative, _ in signed):
            return self.operation("neg", self._sum([-term for _, term in signed]))
        first = next(k for k, (negative, _) in enumerate(signed) if not negative)
        total = self.place_of(signed[first][1])
        for negative, term in signed[:first] + signed[first + 1 :]:
            if negative:
                total = self.operation("-", total, self.place_of(-term))
            else:
                total = self.operation("+", total, self.place_of(term))
        return total

    def _product(self, e: sp.Expr) -> int:
        constant, rest = e.as_independent(*e.free_symbols, as_Add=False)
        factor = exact(constant)
        if factor < 0:
            return self.operation("neg", self.place_of(-e))
        parts = sorted(sp.Mul.make_args(rest), key=sp.default_sort_key)
        ahead = [one for one in parts if self._is_fixed(one)]
        if ahead and len(ahead) < len(parts) and (len(ahead) > 1 or factor != 1 or not ahead[0].is_Symbol):
            first = self.place_of(sp.Mul(constant, *ahead))
            return self.operation("*", first, self.place_of(sp.Mul(*[one for one in parts if one not in ahead])))
        above: list[int] = []
        below: list[int] = []
        for one in parts:
            if one.is_Pow and one.exp.is_number and one.exp.is_negative:
                below.append(self.place_of(one.base**-one.exp))
            else:
                above.append(self.place_of(one))
        numerator = self._all(above)
        if factor != 1 or numerator is None:
            literal = self._put(Literal(factor))
            numerator = literal if numerator is None else self.operation("*", literal, numerator)
        denominator = self._all(below)
        return numerator if denominator is None else self.operation("/", numerator, denominator)

    def _is_fixed(self, e: sp.Expr) -> bool:
        """Whether it depends on fixed arguments alone; never where there are none."""
        if e not in self._fixed:
            if e in self._definitions:
                self._fixed[e] = bool(self._fixed) and self._is_fixed(self._definitions[e])
            else:
                symbols = e.free_symbols if not e.is_Symbol else set()
                self._fixed[e] = bool(symbols) and all(self._is_fixed(one) for one in symbols)
        return self._fixed[e]

    def _all(self, factors: Sequence[int]) -> int | None:
        """Their product from the left."""
        product: int | None = None
        for one in factors:
            product = one if product is None else self.operation("*", product, one)
        return product

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> int:
        if exponent.is_number and exponent.is_negative:
            return self.operation("/", self._put(Literal(Fraction(1))), self.place_of(base**-exponent))
        if exponent == sp.Rational(1, 2):
            return self.operation("sqrt", self.place_of(base))
        if exponent.is_Rational and exponent.q == 2:
            root = self.operation("sqrt", self.place_of(base))
            return self.operation("*", self._integer_power(self.place_of(base), int(exponent.p) // 2), root)
        if not exponent.is_Integer:
            raise PvidError(f"{base**exponent} cannot be generated: powers are integers or halves")
        return self._integer_power(self.place_of(base), int(exponent))

    def _integer_power(self, base: int, exponent: int) -> int:
        """By squares, exponent >= 1."""
        if exponent == 1:
            return base
        half = self._integer_power(base, exponent // 2)
        square = self.operation("*", half, half)
        return self.operation("*", square, base) if exponent % 2 else square

    def _function(self, e: sp.Expr) -> int:
        if isinstance(e, sp.tan):
            return self.operation("/", self.place_of(sp.sin(e.args[0])), self.place_of(sp.cos(e.args[0])))
        if isinstance(e, sp.sin):
            return self.operation("sin", self.place_of(e.args[0]))
        if isinstance(e, sp.cos):
            return self.operation("cos", self.place_of(e.args[0]))
        if isinstance(e, sp.Abs):
            return self.operation("abs", self.place_of(e.args[0]))
        if isinstance(e, sgn | sp.sign):
            width = self._widths.get(str(e.args[0]), 0.0)
            if width > 0:
                return self.operation("soft_sign", self.place_of(e.args[0]), self._put(Literal(Fraction(width))))
            return self.operation("sign", self.place_of(e.args[0]))
        raise PvidError(
            f"{e} cannot be generated: the functions are sin, cos, tan, sgn, abs and sqrt; describe the mechanism with "
            f"these, or give {e.func} of a signal as a signal of its own"
        )


def _is_negative(term: sp.Expr) -> bool:
    return bool(exact(term.as_independent(*term.free_symbols, as_Add=False)[0]) < 0)


def exact(number: sp.Expr) -> Fraction:
    """A real constant as a fraction; one that is none with 40 digits."""
    if not number.is_Rational:
        number = sp.Rational(number if number.is_Float else sp.N(number, _DIGITS))
    return Fraction(int(number.p), int(number.q))
