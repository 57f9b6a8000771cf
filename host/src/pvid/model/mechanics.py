"""Equations of motion of sympy.physics.mechanics in the signals of a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.physics.mechanics import KanesMethod, LagrangesMethod, System, dynamicsymbols

from pvid.model.refusal import ModelError
from pvid.model.signals import total_derivative


def equations_of(method: Any, signals: Mapping[Any, sp.Expr]) -> list[sp.Expr]:
    """Expressions = 0 of a LagrangesMethod, KanesMethod or System, its dynamicsymbols replaced.

    Raises ModelError where something has no counterpart in the model.

    Parameters
    ----------
    method : Kane's and Lagrange's equations are formed where they are not yet
    signals : dynamicsymbol (coordinates, inputs; speeds follow) or constant -> what the model has for it
    """
    if isinstance(method, System):
        if method.eom_method is None:
            method.form_eoms()
        method = method.eom_method
    if isinstance(method, LagrangesMethod):
        whole, speeds = list(method.form_lagranges_equations()), {}
    elif isinstance(method, KanesMethod):
        whole = _kanes(method)
        speeds = _speeds(method)
    else:
        raise ModelError(f"{type(method).__name__} is none of LagrangesMethod, KanesMethod and System")
    return [_in_jets(one, {sp.sympify(key): value for key, value in signals.items()}, speeds) for one in whole]


def _kanes(method: KanesMethod) -> list[sp.Expr]:
    if method._fr is None or method._frstar is None:
        method.kanes_equations()
    return list(method._fr + method._frstar)


def _speeds(method: KanesMethod) -> dict[Any, sp.Expr]:
    """Generalised speeds by derivatives of the coordinates."""
    rates = method.kindiffdict()
    equations = [rate - value for rate, value in rates.items()]
    return dict(sp.solve(equations, list(method.u), dict=True)[0])


def _in_jets(expression: sp.Expr, signals: Mapping[Any, sp.Expr], speeds: Mapping[Any, sp.Expr]) -> sp.Expr:
    time = dynamicsymbols._t
    whole = expression
    if speeds:
        whole = whole.subs({sp.diff(u, time): sp.diff(value, time) for u, value in speeds.items()})
        whole = whole.subs(speeds).doit()
    derivatives = {}
    for one in whole.atoms(sp.Derivative):
        base, order = one.expr, sum(count for _, count in one.variable_count)
        if base in signals:
            derivatives[one] = total_derivative(signals[base], int(order))
    whole = whole.xreplace(derivatives).xreplace(dict(signals))
    left = [*whole.atoms(sp.core.function.AppliedUndef), *whole.atoms(sp.Derivative)]
    if left:
        raise ModelError(f"{left[0]} has no signal: map it in model.mechanics(method, {{..}})")
    return whole
