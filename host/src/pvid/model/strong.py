"""The strong form: the same rows in derivatives of the signals, as the paper has them."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from pvid.model.compiled import CompiledModel
from pvid.model.compiler import reduced, with_rates
from pvid.model.eliminate import Equation
from pvid.model.factor import factor
from pvid.model.normalise import with_scales
from pvid.model.signals import Integral, jets, total_derivative


def strong_form(compiled: CompiledModel) -> CompiledModel:
    """The model with rows whose parts are of order 0 only.

    Where an elimination differentiates sgn(..) or |..|, an auxiliary signal of `opaque` replaces it, and its jets in
    the rows are its derivatives.
    """
    compiled.refuse_drifts("the strong form")
    integrals = {jet: value for jet, value in compiled.opaque.items() if value.has(Integral)}
    rates = {jet.of: total_derivative(value) for jet, value in integrals.items()}
    definitions = {jet.d() - rates[jet.of] for jet in integrals}
    equations = [
        Equation(f"equation {k + 1}", one) for k, one in enumerate(compiled.equations) if one not in definitions
    ]
    hidden = [jet.of for jet in compiled.hidden if jet not in integrals]
    p = list(compiled.p)
    found, opaque = reduced(equations, hidden, p)
    rows = []
    for one in found:
        whole = with_rates(one, rates).expression if one.expression is not None else one.strong
        assert whole is not None
        rows.append(factor(one.name, {0: sp.expand(whole)}, p))
    named = [opaque.shown(row) for row in with_scales(rows, compiled.unknowns)]
    psis = [psi for row in named for part in (*row.regressors, row.known) for psi in part.values()]
    used = {jet.of for psi in psis for jet in jets(psi)}
    extra = {jet: value for jet, value in opaque.stands_for.items() if jet.of in used}
    return replace(compiled, rows=tuple(named), opaque={**compiled.opaque, **extra})
