"""The refinement of a model: its equations of motion solved for the accelerations, their Jacobians and the sensors'.

    r -> constants m               once a pass: what depends on the refined parameters alone
    m, q, v, u -> a                order 2: q'' = a(q, v, u); order 1: q' = a(q, u), and v is not read
    m, q, v, u -> a, K, D, U, B    da/dq, da/dv, da/du by rows, da/d(steps of the motion's parameters) by parameters
    m, q, v, u -> z, Zq, Zv, Zr    what the sensors measure, and its derivatives
    r -> region                    whether the mechanism is possible
    r, row -> row                  derivatives by the motion's steps to those by the steps of r: the chart
    m, q, v, u -> g                arguments of the signs

A refinement with a skew has one more moving entry behind the others: the time by which the sensors are late on the
inputs. Its column is U times the derivative of u; the kernel makes it, and its entries of B are not written.

The width of a sign, v / (v^4 + width^4)^(1/4) in the place of sgn(v), is refined too where it is not given. Motions
with signs, or with relaxations beside oscillations, have order 1: their steps are Runge-Kutta's.

A step of a positive parameter is one of its logarithm. The motion's parameters are those of r, but for shapes:
functions of unknowns that the equations contain in their place. Derivatives come from the equations, not from the
solution: with A h = b, A dh = db - dA h for every column, so that A is inverted once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.base.recent import Recent
from pvid.base.wording import listed
from pvid.codegen.functions import identifiers, with_values
from pvid.model.compiled import CompiledModel
from pvid.model.operations import Argument, Builder, Literal, Operation, Program, Value, evaluated
from pvid.model.signals import Integral, Jet, jets, sgn

_ZERO, _ONE = sp.Integer(0), sp.Integer(1)
_ARRAYS = frozenset("m q v u r a z K D B U row Zq Zv Zr".split())
SKEW = "tau"
SKEW_SD = 5e-3  # [s]
LOG_SD = 0.15  # of the logarithm of a positive parameter: how far off the start may be
WIDTH_SD = 0.9  # of the logarithm of a sign's width
_COUPLED = 3  # equations that are solved together
# Operations of an expression, terms of a determinant: longer ones are not brought into a shorter form, which may take
# for ever.
_LONG, _MANY = 2000, 16


@dataclass(frozen=True)
class RefinedParameter:
    """An entry of r.

    Attributes
    ----------
    name, unit : as in files
    log : its step is one of the logarithm
    place : in p of the weak form; -1: it starts at 0, or is a width
    prior_sd : how far off the start may be, in its step
    sign : argument of the sign whose width it is; empty: it is none
    """

    name: str
    unit: str
    log: bool
    place: int
    prior_sd: float
    sign: str = ""


@dataclass(frozen=True)
class RefineFunction:
    """A generated function.

    Attributes
    ----------
    name : constants, motion, jacobian, output, output_jacobian, region, chart
    given : arrays that are read: name, entries
    written : arrays that are written: name, entries
    program : from all entries that are read to all that are written
    """

    name: str
    given: tuple[tuple[str, int], ...]
    written: tuple[tuple[str, int], ...]
    program: Program

    def values(self, **arrays: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
        """What it writes [entries, ...] from the arrays that it reads, and others [entries, ...], in their type."""
        read = [arrays[key] for key, _ in self.given]
        found = evaluated(self.program, [row for one in read for row in one])
        shape = np.broadcast_shapes(*(one.shape[1:] for one in read))
        whole = np.array([np.broadcast_to(one, shape) for one in found]).reshape(len(found), *shape)
        ends = np.cumsum([n for _, n in self.written])
        return {key: whole[end - n : end] for (key, n), end in zip(self.written, ends, strict=True)}


@dataclass(frozen=True)
class RefineFunctions:
    """What is generated for the refinement.

    Attributes
    ----------
    model : as compiled
    name : of the model, in C
    order : 1 or 2, highest derivative
    coordinates : names of q
    inputs : u, jets of signals and of defined ones
    outputs : names of the sensors z
    parameters : r; the first `moving` ones change the motion
    motion_names : parameters of the motion
    constants : what each m is, as text
    settings : further entries of r's array where constants are arguments: widths of signs, knowns
    skew : the last moving entry is that of the sensors
    runge_kutta : each step is Runge-Kutta's; else Adams's
    hidden : coordinates, of order 1 or 2, that no sensor measures, where steps are Runge-Kutta's
    observer : where steps are Runge-Kutta's, whether an input is measured: its noise moves the model
    turning : of each output, whether the motion is the same when it is shifted, with hidden coordinates
    measured : of q, and of v of order 2: 1 + 2 output where it is that output, 2 + 2 output: its rate, 0: neither
    functions : by name
    """

    model: CompiledModel
    name: str
    order: int
    coordinates: tuple[str, ...]
    inputs: tuple[Jet, ...]
    outputs: tuple[str, ...]
    parameters: tuple[RefinedParameter, ...]
    moving: int
    motion_names: tuple[str, ...]
    constants: tuple[str, ...]
    settings: tuple[str, ...]
    skew: bool
    runge_kutta: bool
    hidden: int
    observer: bool
    turning: tuple[bool, ...]
    measured: tuple[int, ...]
    functions: Mapping[str, RefineFunction] = field(repr=False)

    @property
    def places_of_p(self) -> list[int]:
        """Entries of r, by those of the weak form's p."""
        entry = {one.place: k for k, one in enumerate(self.parameters) if one.place >= 0}
        return [entry[place] for place in sorted(entry)]


def width_name(argument: sp.Expr) -> str:
    """Of the setting that is the width of the sign of this argument."""
    return f"width_{identifiers([str(argument)])[0]}"


def width_of(model: CompiledModel, argument: sp.Expr) -> RefinedParameter:
    """The width of the sign of this argument as a parameter."""
    return RefinedParameter(width_name(argument), _unit_of(model, argument), True, -1, WIDTH_SD, str(argument))


def signs_of(model: CompiledModel) -> tuple[sp.Expr, ...]:
    """Arguments of the signs in the equations of the refinement."""
    found = {one for equation in _equations(model) for one in equation.atoms(sgn)}
    return tuple(one.args[0] for one in sorted(found, key=str))


def _argument_with_values(model: CompiledModel, argument: sp.Expr) -> sp.Expr:
    """As a sign keeps it, which may be with the other sign and without a factor."""
    (kept,) = sgn(with_values(model, argument)).atoms(sgn)
    return kept.args[0]


def has_skew(model: CompiledModel) -> bool:
    """Whether the inputs are measured by sensors and derived, so that a delay between sensors matters."""
    return any(jet in model.opaque and not model.opaque[jet].has(Integral) for jet in _inputs(model))


def is_driven_by_derivatives(model: CompiledModel) -> bool:
    """Whether an input is, or contains, a derivative of what a sensor measures."""
    return has_skew(model) or any(
        jet.order and any(one.name == jet.of and one.driven and one.kind == "sensor" for one in model.signals)
        for jet in _inputs(model)
    )


def _inputs(model: CompiledModel) -> set[Jet]:
    return {jet for one in _equations(model) for jet in jets(one)}


def is_measured(model: CompiledModel, jet: Jet) -> bool:
    """Whether an input is what a sensor measures, with its noise."""
    return jet.order == 0 and any(one.name == jet.of and one.kind == "sensor" for one in model.signals)


def refine_functions_of(
    model: CompiledModel, widths: Mapping[str, float] | None = None, skew: bool = False
) -> RefineFunctions:
    """What is generated of a model.

    Raises PvidError where the equations do not determine a motion.

    Parameters
    ----------
    model : as compiled
    widths : argument of a sgn, as in phi_1 -> width of v / (v^4 + width^4)^(1/4) in its place; those of the others are
        refined. None: widths and known constants are settings, arguments behind r.
    skew : r has one
    """
    return _Refine(model, widths, skew).functions()


def refine_hash(made: RefineFunctions) -> str:
    """Eight digits that change with anything that the files are made from."""
    parts = [repr(made.parameters), repr(made.inputs), repr(made.outputs), str(made.order), repr(made.coordinates)]
    parts += [f"{name} {one.program!r}" for name, one in made.functions.items()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:8]


def refine_id(made: RefineFunctions) -> str:
    """The same in C: PVID_REFINE_MODEL_ID."""
    return f"0x{refine_hash(made).upper()}u"


def ring_of(made: RefineFunctions) -> int:
    """PVID_REFINE_RING: where a step may be a tick the ring is longer."""
    return 2048 if made.runge_kutta else 512


def check_outputs(made: RefineFunctions) -> None:
    """The kernel has columns of the motion, and those of outputs alone."""
    n, moving = len(made.parameters), made.moving - made.skew
    shown = is_nonzero(made, "Zr")
    width = n - made.skew
    for row in range(len(made.outputs)):
        for k in range(moving):
            if shown[row * width + k]:
                raise PvidError(
                    f"{made.model.name}: the second stage in C needs readings without parameters of the motion; "
                    f"{made.outputs[row]} depends on {made.parameters[k].name}, which changes the motion too"
                )


def widths(made: RefineFunctions) -> list[str]:
    """Arguments of the signs whose widths are refined, in the order of r."""
    return [one.sign for one in made.parameters if one.sign]


def has_integrals(made: RefineFunctions) -> bool:
    """Whether an input is the integral of a sample."""
    opaque = made.model.opaque
    return any(jet in opaque and opaque[jet].has(Integral) for jet in made.inputs)


def is_nonzero(made: RefineFunctions, key: str) -> list[bool]:
    """Which entries of a derivative of the outputs are not constantly 0."""
    one = made.functions["output_jacobian"]
    at = 0
    for name, n in one.written:
        if name == key:
            values = [one.program.values[place] for place in one.program.results[at : at + n]]
            return [not (isinstance(value, Literal) and value.value == 0) for value in values]
        at += n
    return []


def refine_functions(model: CompiledModel, widths: Mapping[str, float] | None = None) -> RefineFunctions:
    """What the core's second stage takes: without optional extras; with a skew where inputs are measured and derived.

    Parameters as of `refine_functions_of`; widths that are not given are refined.
    """
    model.refuse_constraints("the second stage")
    return _refined((model, tuple(sorted((widths or {}).items()))))


@Recent
def _refined(given: tuple[CompiledModel, tuple[tuple[str, float], ...]]) -> RefineFunctions:
    plain = without_optional(given[0])
    return refine_functions_of(plain, dict(given[1]), has_skew(plain))


def without_optional(model: CompiledModel, kept: Collection[str] = ()) -> CompiledModel:
    """The model with its optional extras 0, but for those that are kept."""
    own = model.refinement
    left = {one.symbol: _ZERO for one in own.extras if one.optional and one.name not in kept}
    if not left:
        return model
    equations = tuple(one.xreplace(left) for one in own.equations)
    outputs = {name: one.xreplace(left) for name, one in own.outputs.items()}
    extras = tuple(one for one in own.extras if one.symbol not in left)
    return replace(model, refinement=replace(own, equations=equations, outputs=outputs, extras=extras))


def _equations(model: CompiledModel) -> tuple[sp.Expr, ...]:
    """Those of the refinement: integrals of what the run sets are inputs, not coordinates."""
    if model.refinement.equations:
        return model.refinement.equations
    set_ones = {one.of for one in _set_integrals(model)}
    return tuple(one for one in model.equations if not any(jet.of in set_ones and jet.order == 1 for jet in jets(one)))


def _set_integrals(model: CompiledModel) -> set[Jet]:
    """Integrals of what the run sets; that of a sensor is a coordinate: as an input it would walk."""
    given = {one.name for one in model.signals if one.driven or one.kind == "input"}
    return {
        jet
        for jet, value in model.opaque.items()
        if value.has(Integral) and (model.refinement.equations or {one.of for one in jets(value)} <= given)
    }


class _Refine:
    def __init__(self, model: CompiledModel, widths: Mapping[str, float] | None, skew: bool) -> None:
        self.model, self.skew = model, skew
        own = model.refinement
        self._definitions: dict[sp.Symbol, sp.Expr] = {}
        self._inner: list[tuple[sp.Symbol, sp.Expr, sp.Expr]] = []  # symbol, argument, derivative by the argument
        self._by_width: dict[sp.Symbol, list[tuple[sp.Symbol, sp.Expr]]] = {}  # symbol, derivative by the width
        equations = _equations(model)
        self.settings: tuple[sp.Symbol, ...] = ()
        self.widths: dict[sp.Symbol, sp.Expr] = {}  # that are refined: argument of the sign
        signs = {one: width_name(one) for one in signs_of(model)}
        width_symbols = {one: sp.Symbol(name, positive=True) for one, name in signs.items()}
        self._signs = [one if widths is None else _argument_with_values(model, one) for one in signs]
        if widths is None:
            self.settings = (*width_symbols.values(), *(one.symbol for one in model.knowns))
        else:
            for argument, mark in width_symbols.items():
                if str(argument) in widths:
                    self._definitions[mark] = sp.Rational(repr(float(widths[str(argument)])))
                else:
                    self.widths[mark] = argument
        inputs_of = {one.name for one in model.signals if one.driven or one.kind == "input"}
        walked = {jet for jet, value in model.opaque.items() if value.has(Integral)} - _set_integrals(model)
        inputs_of |= {jet.of for jet in model.opaque if jet not in walked}
        self._equations = equations
        whole = [*equations, *own.outputs.values()]
        found = {jet for one in whole for jet in jets(one)}
        order = [one.name for one in model.signals] + [jet.of for jet in model.opaque]
        self.u = tuple(
            sorted((jet for jet in found if jet.of in inputs_of), key=lambda jet: (order.index(jet.of), jet.order))
        )
        free = list(dict.fromkeys(jet.of for jet in self._in_order(found, equations) if jet.of not in inputs_of))
        if len(free) != len(equations):
            raise PvidError(
                f"{model.name} has {len(equations)} equations for the {len(free)} quantities {', '.join(free)}: "
                "the refinement needs as many equations"
            )
        top = {name: max(jet.order for jet in found if jet.of == name) for name in free}
        if not any(top.values()):
            raise PvidError(f"{model.name}: the second stage needs a motion; no equation has a derivative")
        self.highest = [Jet(name, top[name]) for name in free]
        jumps = any(one.hold == "zoh" and not one.smooth for one in model.signals)  # which spoil the steps of Adams
        mixed = len(set(top.values())) > 1 or bool(walked)
        self.runge_kutta = widths is not None and (bool(signs) or mixed or jumps)
        self.order = 2 if all(n == 2 for n in top.values()) and not self.runge_kutta else 1
        if self.order == 2:
            self.q = [Jet(name) for name in free]
            self.v = [Jet(name, 1) for name in free]
        else:
            self.q = [Jet(name, k) for name in free for k in range(top[name])]
            self.v = []
        sensors = [one.name for one in model.signals if one.kind == "sensor" and not one.driven]
        self.outputs = tuple(sensors)
        readings = [own.outputs.get(name, Jet(name)) for name in sensors]
        for one in readings:
            beyond = jets(one) - set(self.q) - set(self.v) - set(self.u) - set(self.highest)
            if beyond:
                raise PvidError(
                    f"{model.name}: the refinement does not know {min(map(str, beyond))}, which is measured"
                )
        self._check_linear(equations)
        self._matrix = sp.Matrix(len(free), len(free), lambda i, j: sp.diff(equations[i], self.highest[j]))
        self._blocks = self._in_turn(self._matrix)
        self._parameters([*equations, *readings], equations)
        of_values = dict(zip(self._signs, width_symbols.values(), strict=True))
        marked = [self._marked(one, of_values) for one in (*equations, *readings)]
        self._solve(marked[: len(equations)])
        self._readings = marked[len(equations) :]
        self.z = [one.xreplace(dict(zip(self.highest, self._h, strict=True))) for one in self._readings]

    @staticmethod
    def _in_order(found: Iterable[Jet], equations: Sequence[sp.Expr]) -> list[Jet]:
        """By the equation in which each first has its highest derivative, so that q has the equations' order."""
        top = {jet.of: 0 for jet in found}
        for jet in found:
            top[jet.of] = max(top[jet.of], jet.order)

        def first(jet: Jet) -> tuple[int, str]:
            high = Jet(jet.of, top[jet.of])
            places = [k for k, one in enumerate(equations) if high in one.free_symbols]
            return (places[0] if places else len(equations), jet.of)

        return sorted(found, key=first)

    # ---- parameters

    def _parameters(self, whole: Sequence[sp.Expr], equations: Sequence[sp.Expr]) -> None:
        """r, and the symbols of the motion in the order of its moving entries."""
        own, model = self.model.refinement, self.model
        used = {symbol for one in whole for symbol in one.free_symbols}
        moved = {symbol for i in self._moving_equations() for symbol in equations[i].free_symbols}
        shapes = [one for one in own.shapes if one in used]
        behind = {symbol for one in shapes for symbol in own.shapes[one].free_symbols}
        unknowns = (one.symbol for one in model.unknowns if one.symbol not in model.anchors)  # of a drift: no motion's
        every = [*unknowns, *(one.symbol for one in own.extras)]
        direct = [one for one in every if one in moved]
        hidden = [one for one in every if one in behind and one not in direct]
        if len(hidden) != len(shapes):
            raise PvidError(
                f"{model.name}: the refinement has {len(shapes)} shapes of the {len(hidden)} unknowns "
                f"{', '.join(map(str, hidden))}, which are not in its equations otherwise: there must be as many"
            )
        places = iter(shapes)
        moving = [*self.widths, *(one for one in every if one in direct or one in hidden)]
        self.motion = [next(places) if one in hidden else one for one in moving]
        self.r = moving + [one for one in every if one not in moving]
        for one in self.r:
            if one not in used and one not in behind and one not in self.widths:
                raise PvidError(f"{model.name}: {one} is in no equation of the refinement and in no output")
        self.moving = len(moving)
        by_symbol = {one.symbol: one for one in model.unknowns}
        extras = {one.symbol: one for one in own.extras}
        names = identifiers([str(one) for one in self.r])
        self.parameters = []
        for name, one in zip(names, self.r, strict=True):
            if one in by_symbol:
                unknown = by_symbol[one]
                sd = LOG_SD if unknown.positive else unknown.sd
                place = model.unknowns.index(unknown)
                self.parameters.append(RefinedParameter(name, unknown.unit, unknown.positive, place, sd))
            elif one in self.widths:
                self.parameters.append(width_of(model, self.widths[one]))
            else:
                self.parameters.append(RefinedParameter(name, extras[one].unit, False, -1, extras[one].sd))
        self.log = {one: entry.log for one, entry in zip(self.r, self.parameters, strict=True)}
        self.log |= dict.fromkeys(shapes, True)

    # ---- functions inside: angles that are sums, signs

    def _marked(self, e: sp.Expr, widths: Mapping[sp.Expr, sp.Symbol]) -> sp.Expr:
        """With a symbol in place of each angle that is no single symbol, and of each sign."""
        known = {one.symbol for one in self.model.knowns}
        whole = e if self.settings else with_values(self.model, e)
        signs = {}
        for one in sorted(whole.atoms(sgn), key=str):
            argument = one.args[0]
            words = ("sign", "slope", "part", "square", "length", "root")
            soft, slope, part, square, length, root = (sp.Symbol(f"{word}[{argument}]") for word in words)
            width = widths[argument]
            if soft not in self._definitions:
                self._definitions[part] = argument * (1 / width)
                self._definitions[square] = part * part
                self._definitions[length] = sp.sqrt(1 + square * square)
                self._definitions[root] = 1 / sp.sqrt(length)
                self._definitions[soft] = part * root
                self._definitions[slope] = (1 / width) * root / (length * length)
                self._inner.append((soft, argument, slope))
                if width in self.widths:
                    self._by_width[width] = [(soft, -part * slope)]
            signs[one] = soft
        whole = whole.xreplace(signs)
        for one in sorted({*whole.atoms(sp.sin), *whole.atoms(sp.cos)}, key=str):
            argument = one.args[0]
            if argument.is_Symbol or not argument.free_symbols - known:
                continue
            negative = sp.Symbol(f"angle[{-argument}]")
            if negative in self._definitions:
                turned = -sp.sin(negative) if isinstance(one, sp.sin) else sp.cos(negative)
                whole = whole.xreplace({one: turned})
                continue
            mark = sp.Symbol(f"angle[{argument}]")
            if mark not in self._definitions:
                self._definitions[mark] = argument
                self._inner.append((mark, argument, _ONE))
                self._add_theorem(mark, argument)
            whole = whole.xreplace({one: one.func(mark)})
        return whole

    def _add_theorem(self, mark: sp.Symbol, argument: sp.Expr) -> None:
        """Sine and cosine of a sum or difference of two coordinates, from theirs."""
        terms = sp.Add.make_args(argument)
        if len(terms) != 2:
            return
        signs = [one.could_extract_minus_sign() for one in terms]
        plain = [abs(one) if one.is_number else (-one if sign else one) for one, sign in zip(terms, signs, strict=True)]
        if not all(one in self.q for one in plain) or all(signs):
            return
        x, y = plain if not signs[0] else (plain[1], plain[0])
        sign = -1 if any(signs) else 1
        self._definitions[sp.sin(mark)] = sp.sin(x) * sp.cos(y) + sign * sp.cos(x) * sp.sin(y)
        self._definitions[sp.cos(mark)] = sp.cos(x) * sp.cos(y) - sign * sp.sin(x) * sp.sin(y)

    def _symbol(self, name: str, e: sp.Expr) -> sp.Expr:
        """A symbol for an expression that several formulas contain; a short expression is returned unchanged."""
        if e.is_number or e.is_Symbol:
            return e
        mark = sp.Symbol(name)
        assert mark not in self._definitions
        self._definitions[mark] = e
        return mark

    # ---- solution

    def _solve(self, equations: Sequence[sp.Expr]) -> None:
        n = len(equations)
        matrix = sp.Matrix(n, n, lambda i, j: sp.diff(equations[i], self.highest[j]))
        right = [-one.xreplace(dict.fromkeys(self.highest, _ZERO)) for one in equations]
        self._matrix = matrix
        self._inverse = self._inverted()
        self._h = self._solved([self._symbol(f"right_{i}", one) for i, one in enumerate(right)], "h_{}")
        for j, one in enumerate(self._h):  # x' = v: v is a coordinate, and stays fixed below as a rate alone
            if one.is_Symbol and one not in self._definitions:
                self._h[j] = sp.Symbol(f"h_{j}")
                self._definitions[self._h[j]] = one
        # what is 0 for the solution: its derivatives at fixed h are the right sides of all columns
        self._rest = [right[i] - sum((matrix[i, j] * self._h[j] for j in range(n)), _ZERO) for i in range(n)]
        self._by_inner = {
            (i, mark): self._symbol(f"d{i} by {mark}", sp.diff(self._rest[i], mark))
            for i in range(n)
            for mark, _, _ in self._inner
        }
        self._columns: dict[tuple[sp.Expr, ...], list[sp.Expr]] = {}
        self._by_step: dict[tuple[sp.Symbol, sp.Expr], list[sp.Expr]] = {}

    def _check_linear(self, equations: Sequence[sp.Expr]) -> None:
        """A highest derivative neither in a power nor inside a sign, a magnitude or an angle."""
        for i, one in enumerate(equations):
            inside = {jet for part in one.atoms(sp.Function) for jet in jets(part)}
            for jet in self.highest:
                if jet in inside or sp.diff(one, jet).has(jet):
                    raise PvidError(
                        f"{self.model.name}: the second stage needs equations that are linear in each highest "
                        f"derivative; equation {i + 1} is not linear in {jet}"
                    )

    def _moving_equations(self) -> set[int]:
        """Those that the rates depend on; the others determine what is measured alone."""
        block_of = {j: rows for rows, columns in self._blocks for j in columns}
        found: set[int] = set()
        for rows, columns in reversed(self._blocks):
            if any(self.highest[j].order > 0 for j in columns) or found & set(rows):
                found.update(i for k in rows for j in block_of if self._matrix[k, j] != 0 for i in block_of[j])
        return found

    def _in_turn(self, matrix: sp.Matrix) -> list[tuple[list[int], list[int]]]:
        """Rows and columns of the smallest blocks that can be solved one behind the other, each with those before it.

        Raises PvidError where the equations do not determine their highest derivatives, or more than three only
        together.
        """
        equation_of: dict[int, int] = {}  # highest derivative -> the equation that is solved for it

        def solves(row: int, tried: set[int]) -> bool:
            for column in range(matrix.rows):
                if matrix[row, column] != 0 and column not in tried:
                    tried.add(column)
                    if column not in equation_of or solves(equation_of[column], tried):
                        equation_of[column] = row
                        return True
            return False

        name, rows = self.model.name, range(matrix.rows)
        for row in rows:
            if not solves(row, set()):
                left = ", ".join(str(self.highest[k]) for k in rows if k not in equation_of)
                raise PvidError(
                    f"{name}: the second stage needs equations that determine the highest derivative of each quantity; "
                    f"equation {row + 1} and those before it leave {left} open"
                )
        needs = [(i, equation_of[j]) for i in rows for j in rows if matrix[i, j] != 0]
        found = []
        for block in sp.utilities.iterables.strongly_connected_components((list(rows), needs)):
            if len(block) > _COUPLED:
                raise PvidError(
                    f"{name}: {len(block)} coupled equations; the second stage needs at most {_COUPLED} that are "
                    "solved together"
                )
            found.append((sorted(block), sorted(j for j in rows if equation_of[j] in block)))
        return found

    def _inverted(self) -> sp.Matrix:
        """Of each block, at the places of its quantities and equations."""
        whole = sp.zeros(self._matrix.rows, self._matrix.rows)
        for rows, columns in self._blocks:
            block = self._inverted_block(self._matrix.extract(rows, columns), f"{rows[0]}")
            if block is None:
                which = listed([i + 1 for i in rows])
                what = listed([self.highest[j] for j in columns])
                raise PvidError(
                    f"{self.model.name}: the second stage needs equations that determine the highest derivative of "
                    f"each quantity; equations {which} do not determine {what}"
                )
            for a, column in enumerate(columns):
                for b, row in enumerate(rows):
                    whole[column, row] = block[a, b]
        return whole

    def _solved(self, right: Sequence[sp.Expr], name: str) -> list[sp.Expr]:
        """x of A x = right, a symbol of this name with the place of each."""
        found: dict[int, sp.Expr] = {}
        for rows, columns in self._blocks:
            left = {}
            for i in rows:
                known = sum((self._matrix[i, j] * x for j, x in found.items()), _ZERO)
                left[i] = right[i] if known == 0 else self._symbol(f"left_{i} of {name}", right[i] - known)
            for j in columns:
                e = sum((self._inverse[j, i] * left[i] for i in rows), _ZERO)
                found[j] = self._symbol(name.format(j), e)
        return [found[j] for j in range(len(right))]

    def _inverted_block(self, block: sp.Matrix, name: str) -> sp.Matrix | None:
        """None: it is singular."""
        if block.rows == 1:
            return sp.Matrix([[self._symbol(f"inverse_{name}_00", 1 / block[0, 0])]])
        fixed = set(self.motion) | set(self.r) | set(self.settings)
        pairs = {one: sp.Dummy() for one in (*block.atoms(sp.sin), *block.atoms(sp.cos))}
        plain = block.xreplace(pairs)
        determinant = sp.expand(plain.det())
        if determinant == 0:
            return None
        if len(sp.Add.make_args(determinant)) > _MANY:
            once, adjugate = self._symbol(f"over_{name}", 1 / block.det()), block.adjugate()
            return sp.Matrix(3, 3, lambda i, j: self._symbol(f"inverse_{name}_{i}{j}", adjugate[i, j] * once))
        squares = {}
        for one, mark in list(pairs.items()):
            if isinstance(one, sp.cos):
                other = pairs.setdefault(sp.sin(one.args[0]), sp.Dummy())
                squares[mark**2] = 1 - other**2
        factored = sp.factor(sp.expand(determinant.subs(squares)))
        if sp.count_ops(factored) >= sp.count_ops(sp.factor(determinant)):
            factored = sp.factor(determinant)
        if factored == 0:
            return None
        back = {mark: one for one, mark in pairs.items()}
        ahead = sp.Mul(*[one for one in sp.Mul.make_args(factored) if one.free_symbols <= fixed])
        rest = sp.Mul(*[one for one in sp.Mul.make_args(factored) if not one.free_symbols <= fixed])
        once = self._symbol(f"over_{name}", 1 / rest.xreplace(back))
        found = (plain.adjugate() / ahead).applyfunc(lambda one: sp.factor(sp.cancel(one)))
        entries: dict[tuple[int, int], sp.Expr] = {}
        for i in range(block.rows):
            for j in range(block.rows):
                before = next((key for key in entries if sp.expand(found[key] - found[i, j]) == 0), None)
                entries[i, j] = (
                    entries[before]
                    if before
                    else self._symbol(f"inverse_{name}_{i}{j}", found[i, j].xreplace(back) * once)
                )
        return sp.Matrix(block.rows, block.rows, lambda i, j: entries[i, j])

    # ---- derivatives

    def _by(self, e: sp.Expr, x: sp.Symbol, by_inner: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
        total = sp.diff(e, x)
        for mark, argument, slope in self._inner:
            step = sp.diff(argument, x)
            if step != 0 and by_inner[mark] != 0:
                total += by_inner[mark] * slope * step
        for mark, slope in self._by_width.get(x, ()):
            total += by_inner[mark] * slope
        return total

    def _column(self, x: sp.Symbol, factor: sp.Expr = _ONE) -> list[sp.Expr]:
        """d h / d x times a factor [n]."""
        if (x, factor) not in self._by_step:
            self._by_step[x, factor] = self._new_column(x, factor)
        return self._by_step[x, factor]

    def _new_column(self, x: sp.Symbol, factor: sp.Expr) -> list[sp.Expr]:
        n = len(self._h)
        sides = []
        for i in range(n):
            by_inner = {mark: self._by_inner[i, mark] for mark, _, _ in self._inner}
            sides.append(self._by(self._rest[i], x, by_inner))
        key = tuple(sides)
        if key in self._columns:
            return [factor * one for one in self._columns[key]]
        marks = [self._symbol(f"side_{i} by {x}", _shortest(factor * one)) for i, one in enumerate(sides)]
        column = self._solved(marks, f"d h_{{}} by {x}")
        if factor == 1:
            self._columns[key] = column
        return column

    def _rates(self, of_h: Sequence[sp.Expr], x: sp.Symbol | None) -> list[sp.Expr]:
        """From values (or derivatives by x) of the highest derivatives those of q'' or q'."""
        found = []
        places = {jet: k for k, jet in enumerate(self.highest)}
        for one in self.v if self.order == 2 else self.q:
            above = one.d()
            if above in places:
                found.append(of_h[places[above]])
            else:
                found.append(above if x is None else sp.Integer(int(above == x)))
        return found

    def functions(self) -> RefineFunctions:
        """All of it."""
        q, v, u, n = self.q, self.v, list(self.u), len(self.q)
        by_u = {one: self._column(one) for one in u}
        by_q = {one: self._column(one) for one in (*q, *v)}
        by_m = {one: self._column(one, one if self.log[one] else _ONE) for one in self.motion}
        tail = self.r[self.moving :]
        a = self._rates(self._h, None)
        wide = {
            "K": [self._rates(by_q[one], one) for one in q],
            "D": [self._rates(by_q[one], one) for one in v],
            "U": [self._rates(by_u[one], one) for one in u],
        }
        jacobian = {key: [column[i] for i in range(n) for column in columns] for key, columns in wide.items()}
        jacobian["B"] = [e for one in self.motion for e in self._rates(by_m[one], one)]
        steps = [*self.motion, *tail]
        readings = {
            "Zq": [self._reading(z, one, by_q[one]) for z in self._readings for one in q],
            "Zv": [self._reading(z, one, by_q[one]) for z in self._readings for one in v],
            "Zr": [
                (one if self.log[one] else _ONE)
                * self._reading(z, one, None if one in by_m else self._column(one), by_m.get(one))
                for z in self._readings
                for one in steps
            ],
        }
        groups: dict[str, list[tuple[str, list[sp.Expr]]]] = {
            "motion": [("a", a)],
            "jacobian": [("a", a), *((key, e) for key, e in jacobian.items() if e or key in ("U", "B"))],
            "output": [("z", list(self.z))],
            "output_jacobian": [(key, e) for key, e in readings.items() if e],
        }
        if self._signs:
            groups["signs"] = [("g", self._signs)]
        return self._generated(groups)

    def _reading(
        self, z: sp.Expr, x: sp.Symbol, of_h: Sequence[sp.Expr] | None, scaled: Sequence[sp.Expr] | None = None
    ) -> sp.Expr:
        """dz/dx of a reading, with what goes through its highest derivatives; `scaled` is d h / d log x."""
        by_inner = {mark: sp.diff(z, mark) for mark, _, _ in self._inner}
        total = self._by(z, x, by_inner)
        for place, h in enumerate(self.highest):
            share = sp.diff(z, h)
            if share != 0:
                if scaled is not None:
                    total += share * scaled[place] / (x if self.log[x] else _ONE)
                elif of_h is not None:
                    total += share * of_h[place]
        return _expanded(total) if total.is_Add else total

    def _generated(self, groups: Mapping[str, Sequence[tuple[str, list[sp.Expr]]]]) -> RefineFunctions:
        own = self.model.refinement
        definitions = {**self._definitions, **own.shapes}
        skew = [sp.Symbol(SKEW)] if self.skew else []
        given: list[sp.Symbol] = [*self.r[: self.moving], *skew, *self.r[self.moving :], *self.settings]
        arguments = [*given, *self.q, *self.v, *self.u]
        builder = Builder(arguments, {}, definitions, given)
        places = {name: [[builder.place_of(one) for one in e] for _, e in parts] for name, parts in groups.items()}
        split = _Split(builder.values, len(given), [p for parts in places.values() for one in parts for p in one])
        counts = {"m": len(split.hoisted), "q": len(self.q), "v": len(self.v), "u": len(self.u)}
        whole = _locals([*(f"m{k}" for k in range(counts["m"])), *map(str, (*self.q, *self.v, *self.u))])
        arrays = tuple(counts.items())
        made: dict[str, RefineFunction] = {}
        r_names = tuple(_locals(list(map(str, given))))
        r_array = (("r", len(r_names)),)
        constants = split.constants(r_names)
        made["constants"] = RefineFunction("constants", r_array, (("m", len(split.hoisted)),), constants)
        for name, parts in groups.items():
            written = tuple((key, len(e)) for key, e in parts)
            flat = [p for one in places[name] for p in one]
            made[name] = RefineFunction(name, arrays, written, split.rest(flat, tuple(whole)))
        region = [
            *(one for one, entry in zip(self.r, self.parameters, strict=True) if entry.log),
            *(one if self.settings else with_values(self.model, one) for one in own.region),
        ]
        apart = Builder(given, {}, definitions)
        found = tuple(apart.place_of(one) for one in region)
        made["region"] = RefineFunction(
            "region", r_array, (("positive", len(region)),), Program(r_names, tuple(apart.values), found)
        )
        chart = self._chart()
        if chart:
            row = [sp.Symbol(f"row[{k}]") for k in range(len(self.motion))]
            apart = Builder([*given, *row], {}, definitions, given)
            found = tuple(
                apart.place_of(sum((row[k] * one for k, one in enumerate(column)), _ZERO)) for column in chart
            )
            names = (*r_names, *_locals([f"by_{one}" for one in self.motion]))
            array = (("row", len(row)),)
            made["chart"] = RefineFunction(
                "chart", (*r_array, *array), array, Program(names, tuple(apart.values), found)
            )
        parameters = list(self.parameters)
        if self.skew:
            parameters.insert(self.moving, RefinedParameter(SKEW, "s", False, -1, SKEW_SD))
        return RefineFunctions(
            model=self.model,
            name=identifiers([self.model.name])[0],
            order=self.order,
            coordinates=tuple(map(str, self.q)),
            inputs=self.u,
            outputs=self.outputs,
            parameters=tuple(parameters),
            moving=self.moving + self.skew,
            motion_names=tuple(map(str, self.motion)),
            constants=split.texts(r_names),
            settings=tuple(map(str, self.settings)),
            skew=self.skew,
            runge_kutta=self.runge_kutta,
            hidden=len(self._hidden({Jet(name) for name in self.outputs})) if self.runge_kutta else 0,
            observer=self.runge_kutta and any(is_measured(self.model, one) for one in self.u),
            turning=self._turning(),
            measured=self._measured(),
            functions=made,
        )

    def _measured(self) -> tuple[int, ...]:
        """Hidden coordinates begin where a measured one is if only the distance from it matters."""
        direct = {Jet(name): k for k, name in enumerate(self.outputs) if name not in self.model.refinement.outputs}
        hidden = self._hidden(direct)
        near = next((k for jet, k in direct.items() if hidden and self._is_free(jet, *hidden)), None)
        if near is not None:
            direct |= dict.fromkeys(hidden, near)
        codes = {jet: 1 + 2 * k for jet, k in direct.items()} | {jet.d(): 2 + 2 * k for jet, k in direct.items()}
        return tuple(codes.get(one, 0) for one in (*self.q, *self.v))

    def _hidden(self, measured: Collection[Jet]) -> list[Jet]:
        return [jet for jet in (Jet(one.of) for one in self.highest if one.order > 0) if jet not in measured]

    def _turning(self) -> tuple[bool, ...]:
        """Only where steps are Runge-Kutta's: elsewhere the ring keeps whole angles."""
        own = self.model.refinement.outputs
        direct = {Jet(name): name for name in self.outputs if name not in own}
        hidden = self._hidden(direct)
        free = {name for jet, name in direct.items() if jet in self.q and self._is_free(jet, *hidden)}
        return tuple(self.runge_kutta and name in free for name in self.outputs)

    def _is_free(self, *coordinates: Jet) -> bool:
        """Whether the motion is the same when these are shifted together."""
        shift = sp.Dummy()
        moved = {one: one + shift for one in coordinates}
        return all(sp.expand(one.xreplace(moved) - one) == 0 for one in self._equations)

    def _chart(self) -> list[list[sp.Expr]]:
        """d(steps of the motion)/d(steps of r), by entries of r; empty: it is the identity."""
        own = self.model.refinement
        if not any(one in own.shapes for one in self.motion):
            return []
        found = []
        for step in self.r[: self.moving]:
            column = []
            for one in self.motion:
                if one in own.shapes:
                    slope = sp.diff(own.shapes[one], step) * (step if self.log[step] else _ONE)
                    column.append(sp.factor(slope / own.shapes[one]))
                else:
                    column.append(sp.Integer(int(one == step)))
            found.append(column)
        return found


def _unit_of(model: CompiledModel, rate: sp.Expr) -> str:
    """Of a sign's argument: that of the first signal in it, by its order."""
    first = min(jets(rate), key=str)
    unit = next((one.unit for one in model.signals if one.name == first.of), "") or "1"
    return unit if first.order == 0 else f"{unit}/s" if first.order == 1 else f"{unit}/s^{first.order}"


def _locals(names: Sequence[str]) -> list[str]:
    """Identifiers that are no array's name."""
    return [f"{one}_" if one in _ARRAYS else one for one in identifiers(names)]


def _shortest(e: sp.Expr) -> sp.Expr:
    """The form with the fewest operations."""
    if sp.count_ops(e) > _LONG:
        return e
    return min((sp.factor_terms(e), sp.expand(e), e), key=lambda one: (sp.count_ops(one), str(one)))


def _expanded(e: sp.Expr) -> sp.Expr:
    return e if sp.count_ops(e) > _LONG else sp.expand(e)


class _Split:
    """A list of values in two: what depends on the first arguments alone, and the rest, which reads it as constants."""

    def __init__(self, values: Sequence[Value], given: int, results: Sequence[int]) -> None:
        self.values, self.given = values, given
        self.fixed: list[bool] = []
        for value in values:
            if isinstance(value, Argument):
                self.fixed.append(value.place < given)
            elif isinstance(value, Literal):
                self.fixed.append(True)
            else:
                self.fixed.append(all(self.fixed[one] for one in value.operands))
        needed = {one for one in results if self._is_constant(one)}
        for place, value in enumerate(values):
            if isinstance(value, Operation) and not self.fixed[place]:
                needed |= {one for one in value.operands if self._is_constant(one)}
        self.hoisted = sorted(needed)

    def _is_constant(self, place: int) -> bool:
        return self.fixed[place] and not isinstance(self.values[place], Literal)

    def constants(self, names: tuple[str, ...]) -> Program:
        """From r to m."""
        return self._program(names, self.hoisted, {})

    def rest(self, results: Sequence[int], names: tuple[str, ...]) -> Program:
        """From m, q, v, u to the results."""
        return self._program(names, results, {place: k for k, place in enumerate(self.hoisted)})

    def _program(self, names: tuple[str, ...], results: Sequence[int], constants: Mapping[int, int]) -> Program:
        found: list[Value] = []
        at: dict[int, int] = {}
        shift = len(constants) - self.given if constants else 0

        def put(place: int) -> int:
            if place not in at:
                value = self.values[place]
                if place in constants:
                    made: Value = Argument(constants[place])
                elif isinstance(value, Argument):
                    made = Argument(value.place + shift)
                elif isinstance(value, Operation):
                    made = Operation(value.kind, tuple(put(one) for one in value.operands))
                else:
                    made = value
                at[place] = len(found)
                found.append(made)
            return at[place]

        wanted = tuple(put(one) for one in results)
        return Program(names, tuple(found), wanted)

    def texts(self, names: Sequence[str]) -> tuple[str, ...]:
        """Each constant as text."""

        def text(place: int, inside: bool) -> str:
            value = self.values[place]
            if isinstance(value, Argument):
                return names[value.place]
            if isinstance(value, Literal):
                return str(value.value)
            parts = [text(one, True) for one in value.operands]
            if value.kind in ("+", "-", "*", "/"):
                whole = f"{parts[0]} {value.kind} {parts[1]}"
                return f"({whole})" if inside else whole
            return f"-{parts[0]}" if value.kind == "neg" else f"{value.kind}({', '.join(parts)})"

        return tuple(text(one, False) for one in self.hoisted)
