"""Corners of a sampled signal: where a held input jumps, the derivative of a sensor that it drives directly jumps too.

A motor's current has the corner (V_k - V_(k-1))/L at every edge of the voltage. By Euler-Maclaurin
int chi i dt = dt sum chi (i + dt/12 (V_k - V_(k-1))/L): ignored it costs dt^2 R^2/(12 L^2) of L. So every channel that
contains such a sensor gets a second one in the scaled jump of the input, with a coefficient that follows from p and
from the signals at the edge: with the voltage d vb of a bridge it is vb (d_k - d_(k-1))/L, and in w Lq iq it is
multiplied by w.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import sympy as sp

from pvid.model.compiled import CompiledModel, Signal
from pvid.model.factor import factor, parts_of
from pvid.model.signals import TIME, Integral, Jet, jets, order_of
from pvid.model.terms import added, merged, terms_of, varies

# A coefficient with more operations than this would burden every row for a correction that smooth inputs do not need.
_LONGEST = 12

_SUFFIX = "_jump"


def slopes(model: CompiledModel) -> dict[tuple[str, str], sp.Expr]:
    """(sensor, held input) -> d sensor' / d input, a function of p and of the signals.

    Of a sensor whose first derivative is the highest one and occurs in one equation, where no other signal with corners
    does; and of one that an algebraic equation ties to such sensors. Left out: what has an inertia that varies, what
    contains a derivative or a hidden quantity, and what is long.
    """
    held = [one for one in model.signals if one.kind == "input" and one.hold == "zoh"]
    hidden = {jet.of for jet in model.hidden}
    names = [one.name for one in model.signals if one.kind == "sensor" and not one.driven]
    top = {name: max((order_of(one, [name]) for one in model.equations), default=0) for name in names}
    first = [name for name in names if top[name] == 1]
    found = {}
    for name in first:
        rate = Jet(name, 1)
        own = [one for one in model.equations if rate in jets(one)]
        others = {Jet(other, 1) for other in first if other != name}
        if len(own) != 1 or any(jet in others or jet.of in hidden for jet in jets(own[0])):
            continue
        for one in held:
            slope = _ratio(own[0], one.jet, rate)
            if slope != 0 and _is_usable(slope, hidden):
                found[name, one.name] = slope
    for name in (name for name in names if top[name] == 0):
        for one in held:
            slope = _tied(
                model, name, one.name, {sensor: value for (sensor, u), value in found.items() if u == one.name}
            )
            if slope != 0 and _is_usable(slope, hidden):
                found[name, one.name] = slope
    return found


def _ratio(equation: sp.Expr, by: Jet, of: Jet) -> sp.Expr:
    """-(d equation / d by) / (d equation / d of); 0 where the latter varies."""
    whole = sp.expand(equation)
    inertia = sp.diff(whole, of)
    return sp.S.Zero if inertia == 0 or varies(inertia) else sp.cancel(-sp.diff(whole, by) / inertia)


def _is_usable(slope: sp.Expr, hidden: Collection[str]) -> bool:
    plain = not slope.has(Integral) and all(jet.order == 0 and jet.of not in hidden for jet in jets(slope))
    return plain and sp.count_ops(slope) <= _LONGEST


def _tied(model: CompiledModel, name: str, held: str, known: Mapping[str, sp.Expr]) -> sp.Expr:
    """Of a sensor without a derivative, by the one equation that ties it to sensors with corners and to quantities
    whose derivatives do not jump; 0: there is none."""
    ties = [
        one
        for one in model.equations
        if Jet(name) in jets(one)
        and Jet(held) not in jets(one)
        and all(jet.order == 0 for jet in jets(one))
        and any(jet.of in known for jet in jets(one))
        and not any(_jumps(model, jet, held) for jet in jets(one) if jet.of in {of.of for of in model.hidden})
    ]
    if len(ties) != 1:
        return sp.S.Zero
    return sp.cancel(
        sum((_ratio(ties[0], Jet(sensor), Jet(name)) * slope for sensor, slope in known.items()), sp.S.Zero)
    )


def _jumps(model: CompiledModel, hidden: Jet, held: str) -> bool:
    """Whether the input stands beside the derivative of a hidden quantity, or that has none."""
    own = [one for one in model.equations if hidden.d() in jets(one)]
    return not own or any(Jet(held) in jets(one) for one in own)


def with_corners(model: CompiledModel) -> tuple[CompiledModel, dict[str, str]]:
    """The model with corrected rows, and the inputs of its new signals: name of the jump -> name of the input.

    A jump is dt/12 (u_k - u_(k-1)) of the input u.
    """
    found = slopes(model)
    if not found:
        return model, {}
    jumps = {name: name + _SUFFIX for _, name in found}
    rows = []
    for row in model.rows:
        parts = parts_of(row)
        whole = merged(parts, *(_added(parts, *key, slope, jumps) for key, slope in found.items()))
        rows.append(factor(row.name, whole, model.p, row.nuisances))
    signals = [Signal(Jet(jump), model.signal(name).unit, "input") for name, jump in jumps.items()]
    corrected = replace(model, rows=tuple(rows), signals=(*model.signals, *signals))
    return corrected, {jump: name for name, jump in jumps.items()}


def _added(
    parts: Mapping[int, sp.Expr], sensor: str, name: str, slope: sp.Expr, jumps: Mapping[str, str]
) -> dict[int, sp.Expr]:
    """What the terms that contain the sensor get; one with a derivative or an integral of it gets nothing."""
    jet = Jet(sensor)
    out = {}
    for order, psi in parts.items():
        own = [term for term in terms_of(psi) if jet in jets(term) and not term.has(Integral, TIME)]
        plain = [term for term in own if not any(one.of == sensor and one.order for one in jets(term))]
        gains = [sp.diff(term, jet) for term in plain]
        out[order] = added(gain for gain in gains if not gain.has(sp.Function)) * slope * Jet(jumps[name])
    return out
