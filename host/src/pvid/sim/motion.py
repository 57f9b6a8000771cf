"""The equations of a mechanism in the form that an integrator needs: A(x, u, p) h = r(x, u, p, s).

h are the highest derivatives of the coordinates (every signal that the run does not set, and every hidden coordinate),
x the lower ones, u what the run sets, s the signs of the frictions. A coordinate without derivatives is algebraic: no
state, but an entry of h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import sympy as sp

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Known
from pvid.model.signals import TIME, Integral, Jet, jets, sgn


@dataclass(frozen=True)
class Motion:
    """The solved form; shapes in numbers of equations n, states nx, inputs nu, signs ns.

    Attributes
    ----------
    states : symbols of x [nx]: jets, and one for each fold of a running integral
    inputs : jets of driven signals in the equations [nu]
    highest : h [n]
    constants : the unknowns, then the knowns
    matrix : A [n, n]
    right : r [n], affine in the signs
    rates : x' [nx] in x and h
    signs : s [ns]
    arguments : of the signs [ns], in x, u and the constants
    slopes : d arguments / d x [ns, nx]
    """

    states: tuple[sp.Symbol, ...]
    inputs: tuple[Jet, ...]
    highest: tuple[Jet, ...]
    constants: tuple[sp.Symbol, ...]
    matrix: sp.Matrix
    right: sp.Matrix
    rates: tuple[sp.Expr, ...]
    signs: tuple[sp.Symbol, ...]
    arguments: tuple[sp.Expr, ...]
    slopes: sp.Matrix

    def state(self, name: str) -> int:
        """Place of a state in x; PvidError where there is none."""
        names = [str(one) for one in self.states]
        if name not in names:
            raise PvidError(f"{name} is no state of the simulation; states are {', '.join(names)}")
        return names.index(name)


def motion_of(model: CompiledModel) -> Motion:
    """The equations solved for the highest derivatives.

    Raises PvidError when they are too few, not linear in the highest derivatives, or do not determine them.
    """
    model.refuse_robot()
    inputs_of = {one.name: one for one in model.signals if one.driven or one.kind == "input"}
    free = [one.name for one in model.signals if one.name not in inputs_of] + [one.of for one in model.hidden]
    equations, folds, integrands = _without_integrals(model.equations)
    found = {jet for equation in (*equations, *integrands) for jet in jets(equation)}
    free = [name for name in free if any(jet.of == name for jet in found)]
    if len(equations) != len(free):
        raise PvidError(
            f"{model.name} has {len(equations)} equations for the {len(free)} quantities {', '.join(free)}: "
            "a simulation needs as many equations; mark what the run sets as an input or as driven"
        )
    top = {name: max(jet.order for jet in found if jet.of == name) for name in free}
    highest = tuple(Jet(name, top[name]) for name in free)
    inner, marks = _signs_of(equations)
    equations = tuple(equation.xreplace(marks) for equation in equations)
    _check_arguments(model.name, (*inner, *integrands), highest)
    matrix, right = _linear(model.name, equations, highest)
    states = tuple(Jet(name, order) for name in free for order in range(top[name])) + folds
    inputs = tuple(sorted((jet for jet in found if jet.of in inputs_of), key=lambda jet: (jet.of, jet.order)))
    for jet in inputs:
        if jet.order and inputs_of[jet.of].hold == "zoh":
            raise PvidError(f"{model.name} contains the derivative of {jet.of}, which is held between samples")
    folded = dict(zip(folds, integrands, strict=True))
    rates = tuple(folded[one] if one in folded else Jet(one.of, one.order + 1) for one in states)
    arguments = tuple(inner)
    return Motion(
        states=states,
        inputs=inputs,
        highest=highest,
        constants=model.p + tuple(one.symbol for one in model.knowns),
        matrix=matrix,
        right=right,
        rates=rates,
        signs=tuple(marks.values()),
        arguments=arguments,
        slopes=sp.Matrix(len(arguments), len(states), lambda i, j: sp.diff(arguments[i], states[j])),
    )


def with_whole_equations(model: CompiledModel) -> CompiledModel:
    """The model with the equations of its refinement, where it has its own; its refined parameters are knowns of value
    0."""
    own = model.refinement
    if not own.equations:
        return model
    equations = tuple(one.xreplace(dict(own.shapes)).xreplace(dict(model.opaque)) for one in own.equations)
    recorded = {one.name for one in model.signals}
    coordinates = dict.fromkeys(jet.of for one in equations for jet in sorted(jets(one), key=str))
    hidden = tuple(Jet(name) for name in coordinates if name not in recorded)
    refined = tuple(Known(one.symbol, one.unit, 0.0) for one in own.extras)
    return replace(model, equations=equations, hidden=hidden, knowns=model.knowns + refined)


def _without_integrals(
    equations: Sequence[sp.Expr],
) -> tuple[tuple[sp.Expr, ...], tuple[sp.Symbol, ...], tuple[sp.Expr, ...]]:
    """The equations with a state in place of each fold of a running integral; these states, and their rates."""
    found = sorted({one for equation in equations for one in equation.atoms(Integral)}, key=str)
    states: list[sp.Symbol] = []
    rates: list[sp.Expr] = []
    places = {}
    for number, one in enumerate(found):
        rate, folds = one.args
        for fold in range(int(folds)):
            states.append(sp.Symbol(f"integral_{number}_{fold}", real=True))
            rates.append(rate)
            rate = states[-1]
        places[one] = states[-1]
    bare = tuple(equation.xreplace(places) for equation in equations)
    if any(equation.has(TIME) for equation in bare):
        raise PvidError("an equation contains the time itself, which a simulation does not have")
    return bare, tuple(states), tuple(rates)


def _signs_of(equations: Sequence[sp.Expr]) -> tuple[list[sp.Expr], dict[sp.Expr, sp.Symbol]]:
    """Arguments of the signs, and a symbol for each."""
    found = sorted({one for equation in equations for one in equation.atoms(sgn)}, key=str)
    return [one.args[0] for one in found], {one: sp.Symbol(f"sign_{number}") for number, one in enumerate(found)}


def _check_arguments(name: str, expressions: Sequence[sp.Expr], highest: Sequence[Jet]) -> None:
    for expression in expressions:
        for jet in highest:
            if expression.has(jet):
                raise PvidError(f"{name} cannot be simulated: {jet}, a highest derivative, stands in {expression}")


def _linear(name: str, equations: Sequence[sp.Expr], highest: Sequence[Jet]) -> tuple[sp.Matrix, sp.Matrix]:
    """A and r of A h = r."""
    matrix = sp.Matrix(len(equations), len(highest), lambda i, j: sp.diff(equations[i], highest[j]))
    for i, j in sorted(matrix.todok()):
        if matrix[i, j].has(*highest):
            raise PvidError(f"{name} cannot be simulated: equation {i + 1} is not linear in {highest[j]}")
    for j, jet in enumerate(highest):
        if not any(matrix[i, j] != 0 for i in range(len(equations))):
            raise PvidError(f"{name} cannot be simulated: no equation determines {jet}")
    right = sp.Matrix([-equation.xreplace(dict.fromkeys(highest, sp.Integer(0))) for equation in equations])
    return matrix, right
