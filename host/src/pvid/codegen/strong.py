"""The strong form of a model: its rows from derivatives of the signals at one instant.

    samples -> (held inputs) -> differentiators -> row -> estimator

One differentiator for each signal, and for each integral since the start of the run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import sympy as sp

from pvid.base.errors import PvidError
from pvid.codegen.functions import Function, Input, ModelFunctions, functions_of
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.operations import program_of
from pvid.model.signals import Jet

MAX_ORDER = 4  # of a differentiator


@dataclass(frozen=True)
class StrongInput:
    """Where an input of the row comes from: derivative `order` of differentiator `channel`."""

    channel: int
    order: int


@dataclass(frozen=True)
class StrongFunctions:
    """What is generated for the strong form.

    Attributes
    ----------
    functions : of the strong model; theta, Jacobian and pattern are among them
    row : inputs -> regressors and Y of each kind, one kind after the other
    signals : that are sampled, in the order of a sample
    integrals : inputs that are integrals since the start of the run; their channels follow those of the signals
    sources : of each input of the row
    """

    functions: ModelFunctions
    row: Function
    signals: tuple[Signal, ...]
    integrals: tuple[Input, ...]
    sources: tuple[StrongInput, ...]

    @property
    def channels(self) -> int:
        """How many differentiators there are."""
        return len(self.signals) + len(self.integrals)

    @property
    def held(self) -> tuple[bool, ...]:
        """Whether each signal is one that holds its value until the next."""
        return tuple(one.hold == "zoh" for one in self.signals)

    def raw_places(self, given: Input) -> int | None:
        """The sampled signal that is an input as it is; None of a derivative or an integral."""
        names = [one.name for one in self.signals]
        return names.index(given.symbol.of) if isinstance(given.symbol, Jet) and given.symbol.order == 0 else None


def strong_functions_of(model: CompiledModel) -> StrongFunctions:
    """What is generated for the strong form; `model` is that of pvid.model.strong.strong_form.

    Raises PvidError where a row needs a derivative above the fourth, or an integral that the strong form has no state
    for.
    """
    functions = functions_of(model)
    if functions.top > 0:
        raise PvidError(f"{model.name}: a row is integrated by parts; give its strong form")
    used = {one.symbol.of for one in functions.inputs if isinstance(one.symbol, Jet)}
    used |= {jet.of for label in functions.integrands.expressions for jet in label.atoms(Jet)}
    signals = tuple(one for one in model.signals if one.name in used)
    integrals = tuple(one for one in functions.inputs if one.fold)
    names = [one.name for one in signals]
    sources = []
    for one in functions.inputs:
        if isinstance(one.symbol, Jet):
            if one.symbol.order > MAX_ORDER:
                raise PvidError(
                    f"{model.name}: its strong form needs {one.meaning}, the differentiator ends at {MAX_ORDER}"
                )
            sources.append(StrongInput(names.index(one.symbol.of), one.symbol.order))
        elif one.since_start and one.fold == 1:
            sources.append(StrongInput(len(signals) + integrals.index(one), 0))
        else:
            raise PvidError(f"{model.name}: its strong form has no state for the {one.meaning}")
    for expression in functions.integrands.expressions:
        if any(jet.order for jet in expression.atoms(Jet)):
            raise PvidError(f"{model.name}: its strong form cannot integrate {expression}, which has a derivative")
    return StrongFunctions(functions, _row(functions), signals, integrals, tuple(sources))


def _row(functions: ModelFunctions) -> Function:
    """Regressors and Y of each kind from the inputs."""
    columns: list[sp.Expr] = [sp.Integer(0)] * functions.columns
    for term in functions.terms:
        factor = sp.Rational(term.factor.numerator, term.factor.denominator)
        columns[term.column] += factor * functions.channels.expressions[term.channel]
    symbols = [one.symbol for one in functions.inputs]
    names = [one.name for one in functions.inputs]
    labels = [
        label
        for kind in functions.kinds
        for label in (*(f"N[{j}] of {kind.name}" for j in range(len(kind.theta))), f"Y of {kind.name}")
    ]
    return Function("row", program_of(symbols, columns, names), tuple(columns), tuple(labels))


def renamed(strong: StrongFunctions) -> StrongFunctions:
    """With the name NAME_strong, which its files and functions have."""
    return replace(strong, functions=replace(strong.functions, name=f"{strong.functions.name}_strong"))
