"""From a description to rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import sympy as sp

from pvid.model.compiled import Row, Unknown
from pvid.model.eliminate import Equation, Reduced, eliminate
from pvid.model.factor import factor
from pvid.model.lower import lower
from pvid.model.normal_form import normal_form
from pvid.model.normalise import with_scales
from pvid.model.opaque import Opaque
from pvid.model.refusal import ModelError
from pvid.model.signals import jets, total_derivative
from pvid.model.terms import by_unknowns, merged, times


def reduced(
    equations: Sequence[Equation], hidden: Sequence[str], p: Sequence[sp.Symbol]
) -> tuple[list[Reduced], Opaque]:
    """The equations in measured signals; sgn and |..| stand as auxiliary signals in them."""
    opaque = Opaque(hidden, p)
    ready = []
    for one in equations:
        try:
            ready.append(Equation(one.name, opaque.hide(normal_form(one.expression, p)), one.place))
        except ModelError as error:
            raise error.at(one.place) from None
    try:
        return eliminate(ready, hidden, p), opaque
    except ModelError as error:
        raise error.at(equations[-1].place) from None


def rows_of(
    equations: Sequence[Equation],
    hidden: Sequence[str],
    unknowns: Sequence[Unknown],
    rates: Mapping[str, sp.Expr],
    by_parts: str = "",
) -> list[Row]:
    """Rows in the order of the equations; `rates` contains the derivatives of signals that are integrals of others."""
    p = [one.symbol for one in unknowns]
    found, opaque = reduced(equations, hidden, p)
    rows = []
    for one in found:
        try:
            parts = lowered(with_rates(one, rates), p, by_parts)
            rows.append(factor(one.name, parts, p, one.nuisances))
        except ModelError as error:
            raise error.at(one.place) from None
    return [opaque.shown(row) for row in with_scales(rows, unknowns)]


def with_rates(one: Reduced, rates: Mapping[str, sp.Expr]) -> Reduced:
    """Without derivatives of signals that are integrals of others."""
    if one.expression is None or not rates:
        return one
    orders = [jet for jet in jets(one.expression) if jet.of in rates and jet.order > 0]
    values = {jet: total_derivative(rates[jet.of], jet.order - 1) for jet in orders}
    return replace(one, expression=sp.expand(one.expression.xreplace(values)))


def lowered(one: Reduced, p: Sequence[sp.Symbol], by_parts: str = "") -> dict[int, sp.Expr]:
    """{m: psi} of a reduced equation, lowered for each function of the unknowns apart."""
    if one.expression is None:
        return one.parts
    return merged(*(times(lower(varying, by_parts), mono) for mono, varying in by_unknowns(one.expression, p).items()))
