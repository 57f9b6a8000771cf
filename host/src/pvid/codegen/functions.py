"""The functions of a compiled model that are generated, and the tables that belong to them.

inputs -> integrands                 f of each running integral I^n[f], where there is one
inputs -> channels                   what the test functions are applied to
terms                                column += factor * D^order[channel]: the regressors, Y and nuisances of every row
p -> theta, p -> non-zeros of C      of all kinds of rows, one kind after the other
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Part
from pvid.model.operations import Program, exact, program_of
from pvid.model.signals import TIME, Integral, Jet, jets, sgn, total_derivative

_RESERVED = frozenset(
    """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl concept const const_cast
    constexpr continue co_await co_return co_yield decltype default delete do double dynamic_cast else enum explicit
    export extern false float for friend goto if import inline int long module mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast requires restrict return short signed
    sizeof static static_assert static_cast struct switch template this thread_local throw true try typedef typeid
    typename union unsigned using virtual void volatile wchar_t while xor xor_eq
    int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t size_t NULL INT32_C INT64_C
    in out limits np elementary elementary_q31 Scaled
    """.split()
) | set(keyword.kwlist)
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Input:
    """An input of `channels`: a jet of a signal, a running integral, the time in the window, or a sign.

    Attributes
    ----------
    symbol : as in the channels
    name : in C and Python
    meaning : in words
    unit : "" for a pure number
    reach : largest absolute value, as far as the description tells: of a derivative that of the signal per second^n,
        of an integral and the time that of a window of one second
    fold : of an integral, how often its integrand is integrated; 0 for others
    since_start : the integral runs since the start of the run; else since that of the window
    """

    symbol: sp.Expr
    name: str
    meaning: str
    unit: str
    reach: float
    fold: int = 0
    since_start: bool = False


@dataclass(frozen=True)
class Term:
    """A share of a column: factor * D^order[channel].

    Columns count through all kinds: for each its regressors, Y, its nuisances.
    """

    kind: int
    column: int
    order: int
    channel: int
    factor: Fraction


@dataclass(frozen=True)
class RowKind:
    """A kind of row: the equation's name, its places in theta and among the columns."""

    name: str
    theta: range
    columns: range
    nuisances: int

    @property
    def known(self) -> int:
        """The column of Y."""
        return self.columns.start + len(self.theta)


@dataclass(frozen=True)
class Function:
    """A generated function: `program` computes `expressions`, of which entry k is `labels[k]`."""

    name: str
    program: Program
    expressions: tuple[sp.Expr, ...]
    labels: tuple[str, ...]


@dataclass(frozen=True)
class ModelFunctions:
    """What is generated of a model.

    Attributes
    ----------
    model : as compiled
    name : of the files, prefix of all names in C
    inputs : of channels and integrands
    channels, integrands, theta, jacobian : the functions
    constraints : each and its slopes by p; without labels where the model has none
    drifts : all directions; likewise
    c_row, c_column : of each non-zero of C, by columns
    terms : of all columns, by kind and column
    kinds : of rows
    """

    model: CompiledModel
    name: str
    inputs: tuple[Input, ...]
    integrands: Function
    channels: Function
    theta: Function
    jacobian: Function
    constraints: Function
    drifts: Function
    c_row: tuple[int, ...]
    c_column: tuple[int, ...]
    terms: tuple[Term, ...]
    kinds: tuple[RowKind, ...]

    @property
    def functions(self) -> tuple[Function, ...]:
        """Those that have results."""
        of_p = (self.theta, self.jacobian, self.constraints, self.drifts)
        return tuple(one for one in (self.integrands, self.channels, *of_p) if one.labels)

    @cached_property
    def p_names(self) -> list[str]:
        """Names of p in C and Python."""
        return identifiers(self.model.p_names)

    @property
    def columns(self) -> int:
        """How many there are in all kinds."""
        return self.kinds[-1].columns.stop

    @property
    def kind_end(self) -> tuple[int, ...]:
        """One past the last theta of each kind."""
        return tuple(one.theta.stop for one in self.kinds)

    @property
    def moments(self) -> int:
        """Distinct entries of M, which has a block for each kind."""
        return sum(len(one.theta) * (len(one.theta) + 1) // 2 for one in self.kinds)

    @property
    def top(self) -> int:
        """Highest order of a term."""
        return max(one.order for one in self.terms)


def functions_of(
    model: CompiledModel, widths: Mapping[str, float] | None = None, signs_are_inputs: bool = False
) -> ModelFunctions:
    """What is generated of a model.

    Raises PvidError where a parameter is in no theta, an expression has no C, or the model has the library's name.

    Parameters
    ----------
    model : as compiled; its known constants become literals
    widths : argument of a sgn, as in phi_1 -> width of a soft sign instead; see operations.program_of
    signs_are_inputs : the caller computes every sgn and passes it as an input
    """
    name = identifiers([model.name])[0]
    if name.lower() == "pvid":
        raise PvidError(f"{name} is the library's name, whose macros the C of this model would define again: rename it")
    plain = _Plain(model)
    bases, terms, kinds = _columns(model, plain)
    integrals = sorted({one for base in bases for one in base.atoms(Integral)}, key=sp.default_sort_key)
    runs = {mark: one for mark, one in plain.runs.items() if any(mark in base.free_symbols for base in bases)}
    folded = tuple(plain(one.args[0]) for one in (*integrals, *runs.values()))
    inputs = _inputs(model, [*bases, *folded], integrals, runs, signs_are_inputs)
    symbols, names = [one.symbol for one in inputs], [one.name for one in inputs]
    theta = tuple(with_values(model, one) for row in model.rows for one in row.theta)
    p_names = identifiers(model.p_names)
    c_row, c_column, c = _jacobian(model, theta)
    tied = [with_values(model, one) for one in model.constraints]
    moving = tuple(with_values(model, one) for direction in model.drifts for one in direction)
    g = tuple(value for one in tied for value in (one, *(sp.diff(one, symbol) for symbol in model.p)))

    def function(
        name: str, of: Sequence[sp.Expr], by: Sequence[str], e: tuple[sp.Expr, ...], labels: Sequence[str]
    ) -> Function:
        return Function(name, program_of(of, e, by, widths), e, tuple(labels))

    return ModelFunctions(
        model=model,
        name=name,
        inputs=inputs,
        integrands=function("integrands", symbols, names, folded, [str(one) for one in folded]),
        channels=function("channels", symbols, names, bases, [str(one) for one in bases]),
        theta=function("theta", model.p, p_names, theta, [str(one) for row in model.rows for one in row.theta]),
        jacobian=function(
            "jacobian",
            model.p,
            p_names,
            c,
            [f"d theta[{i}] / d {model.p_names[j]}" for i, j in zip(c_row, c_column, strict=True)],
        ),
        drifts=function("drifts", model.p, p_names, moving, [str(one) for one in moving]),
        constraints=function("constraints", model.p, p_names, g, [str(one) for one in g]),
        c_row=c_row,
        c_column=c_column,
        terms=terms,
        kinds=kinds,
    )


def with_values(model: CompiledModel, expression: sp.Expr) -> sp.Expr:
    """The values of known constants in place of their symbols, as the decimal fractions they were written as."""
    return expression.xreplace({one.symbol: sp.Rational(repr(one.value)) for one in model.knowns})


class _Plain:
    """Replaces the known constants by their values, and defined signals by their definitions.

    runs : symbol -> the integral since the start of the run
    """

    def __init__(self, model: CompiledModel) -> None:
        self.model = model
        self.runs: dict[sp.Symbol, sp.Expr] = {}
        self._definitions: dict[str, sp.Expr] = {}
        for jet, value in model.opaque.items():
            marks = {one: self._mark(jet, one, whole=one == value) for one in value.atoms(Integral)}
            self._definitions[jet.of] = value.xreplace(marks)

    def _mark(self, jet: Jet, integral: sp.Expr, whole: bool) -> sp.Symbol:
        name = jet.of if whole else f"{jet.of}_integral"
        number = sum(str(one).startswith(name) for one in self.runs)
        mark = sp.Symbol(f"{name}_{number}" if number else name, real=True)
        self.runs[mark] = integral
        return mark

    def __call__(self, expression: sp.Expr) -> sp.Expr:
        values = {
            jet: self._derivative(self._definitions[jet.of], jet.order)
            for jet in jets(expression)
            if jet.of in self._definitions
        }
        return with_values(self.model, expression.xreplace(values))

    def _derivative(self, definition: sp.Expr, order: int) -> sp.Expr:
        """By time; between reversals, where every sign is constant."""
        if order == 0:
            return definition
        whole = definition.xreplace(self.runs).replace(sp.Abs, lambda inner: inner * sgn(inner))
        signs = {one: sp.Dummy(real=True) for one in whole.atoms(sgn)}
        back = {mark: one for one, mark in signs.items()} | {one: mark for mark, one in self.runs.items()}
        return total_derivative(whole.xreplace(signs), order).xreplace(back)


def _columns(model: CompiledModel, plain: _Plain) -> tuple[tuple[sp.Expr, ...], tuple[Term, ...], tuple[RowKind, ...]]:
    """Channels, the terms that make columns of them, and the kinds of rows."""
    channels: dict[sp.Expr, int] = {}
    terms: list[Term] = []
    kinds: list[RowKind] = []
    column = theta = 0
    for kind, row in enumerate(model.rows):
        first = column
        for part in (*row.regressors, row.known, *row.nuisances):
            for order, base, factor in _split(plain, part):
                place = channels.setdefault(base, len(channels))
                terms.append(Term(kind, column, order, place, factor))
            column += 1
        places = range(theta, theta + len(row.theta))
        kinds.append(RowKind(row.name, places, range(first, column), len(row.nuisances)))
        theta = places.stop
    return tuple(channels), tuple(terms), tuple(kinds)


def _split(plain: _Plain, part: Part) -> list[tuple[int, sp.Expr, Fraction]]:
    """Order, channel and factor of each term of a part."""
    found = []
    for order, psi in sorted(part.items()):
        whole = sp.expand(plain(sp.sympify(psi)))
        for term in sorted(sp.Add.make_args(whole), key=sp.default_sort_key):
            factor, base = term.as_independent(*term.free_symbols, as_Add=False)
            if factor != 0:
                found.append((order, base, exact(factor)))
    return found


def _jacobian(
    model: CompiledModel, theta: Sequence[sp.Expr]
) -> tuple[tuple[int, ...], tuple[int, ...], tuple[sp.Expr, ...]]:
    """Rows, columns and values of the non-zeros of d theta / d p, by columns."""
    entries = [
        (i, j, value) for j, p in enumerate(model.p) for i, one in enumerate(theta) if (value := sp.diff(one, p)) != 0
    ]
    missing = set(range(len(model.p))) - {j for _, j, _ in entries}
    tied = {one for value in model.constraints for one in value.free_symbols}
    entries += [(0, j, sp.Integer(0)) for j in missing if model.p[j] in tied]  # every parameter has a column
    entries.sort(key=lambda one: (one[1], one[0]))
    missing -= {j for j in missing if model.p[j] in tied}
    if missing:
        raise PvidError(f"{model.name}: {model.p_names[min(missing)]} is in no coefficient of a row: remove it")
    rows, columns, values = zip(*entries, strict=True)
    return rows, columns, values


def _inputs(
    model: CompiledModel,
    seen: Sequence[sp.Expr],
    integrals: Sequence[sp.Expr],
    runs: Mapping[sp.Symbol, sp.Expr],
    signs_are_inputs: bool,
) -> tuple[Input, ...]:
    """Signals in the model's order with their derivatives, integrals, the time, signs."""
    outside = [one.xreplace({integral: sp.Integer(0) for integral in integrals}) for one in seen]
    signs: list[sp.Expr] = []
    if signs_are_inputs:
        signs = sorted({one for e in outside for one in e.atoms(sgn)}, key=sp.default_sort_key)
        outside = [one.xreplace({sign: sp.Integer(1) for sign in signs}) for one in outside]
    used = {jet for one in outside for jet in jets(one)}
    order = [one.name for one in model.signals]
    unknown = sorted(jet.of for jet in used if jet.of not in order)
    if unknown:
        raise PvidError(f"{model.name}: {unknown[0]} is no signal of the mechanism, but in a channel")
    found: list[Input] = []
    for jet in sorted(used, key=lambda jet: (order.index(jet.of), jet.order)):
        signal = model.signal(jet.of)
        found.append(Input(jet, str(jet), _meaning(jet), _derived_unit(signal.unit, jet.order), signal.reach))
    for k, integral in enumerate(integrals):
        found.append(_integral(integral, integral, f"integral_{k}", since_start=False))
    for mark, integral in runs.items():
        found.append(_integral(mark, integral, str(mark), since_start=True))
    if any(TIME in one.free_symbols for one in outside):
        found.append(Input(TIME, "t", "time since the start of the window", "s", 1.0))
    for k, sign in enumerate(signs):
        found.append(Input(sign, f"sign_{k}", f"sign of {sign.args[0]}", "", 1.0))
    names = identifiers([one.name for one in found])
    return tuple(replace(one, name=name) for one, name in zip(found, names, strict=True))


def _integral(symbol: sp.Expr, integral: sp.Expr, name: str, since_start: bool) -> Input:
    integrand, fold = integral.args[0], int(integral.args[1])
    what = f"integral of {integrand}" if fold == 1 else f"{fold}-fold integral of {integrand}"
    since = "run" if since_start else "window"
    return Input(symbol, name, f"{what} since the start of the {since}", "", 1.0, fold, since_start)


def _meaning(jet: Jet) -> str:
    return jet.of if jet.order == 0 else f"{jet.of}, derivative {jet.order}"


def _derived_unit(unit: str, order: int) -> str:
    """As in rad/s^2."""
    if order == 0:
        return unit
    power = "s" if order == 1 else f"s^{order}"
    return f"{unit or '1'}/{power}"


def identifiers(names: Sequence[str]) -> list[str]:
    """One for each name, no two alike: the name itself where it is one, else the letters of it.

    A name that is reserved ends in an underscore; 2 and more are numbered.
    """
    taken: set[str] = set()
    found = []
    for name in names:
        base = re.sub(r"\W+|^(?=\d)", "_", name, flags=re.ASCII).strip("_") or "symbol"
        base = base if _NAME.fullmatch(base) else f"s_{base}"
        if base in _RESERVED or base.startswith("pvid_"):
            base += "_"
        one, number = base, 2
        while one in taken:
            one, number = f"{base}_{number}", number + 1
        taken.add(one)
        found.append(one)
    return found
