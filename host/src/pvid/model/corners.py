"""Corners of a sampled signal: where a held input jumps, the derivative of a sensor that it drives directly jumps too.

A motor's current has the corner (V_k - V_(k-1))/L at every edge of the voltage. By Euler-Maclaurin
int chi i dt = dt sum chi (i + dt/12 (V_k - V_(k-1))/L): ignored it costs dt^2 R^2/(12 L^2) of L. So every channel that
is linear in such a sensor gets a second one in the scaled jump of the input, with a coefficient that follows from p.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy as sp

from pvid.model.compiled import CompiledModel, Signal
from pvid.model.factor import factor, parts_of
from pvid.model.signals import Integral, Jet, jets, order_of
from pvid.model.terms import added, merged, terms_of, varies

# A coefficient with more operations than this would burden every row for a correction that smooth inputs do not need.
_LONGEST = 12

_SUFFIX = "_jump"


def slopes(model: CompiledModel) -> dict[tuple[str, str], sp.Expr]:
    """(sensor, held input) -> d sensor' / d input, a function of p alone.

    Of a sensor whose first derivative is the highest one and occurs in one equation, where no other signal with corners
    does; what is no function of p alone is left out.
    """
    held = [one for one in model.signals if one.kind == "input" and one.hold == "zoh"]
    hidden = {jet.of for jet in model.hidden}
    names = [one.name for one in model.signals if one.kind == "sensor" and not one.driven]
    first = [name for name in names if max((order_of(one, [name]) for one in model.equations), default=0) == 1]
    found = {}
    for name in first:
        rate = Jet(name, 1)
        own = [one for one in model.equations if rate in jets(one)]
        others = {Jet(other, 1) for other in first if other != name}
        if len(own) != 1 or any(jet in others or jet.of in hidden for jet in jets(own[0])):
            continue
        whole = sp.expand(own[0])
        inertia = sp.diff(whole, rate)
        for one in held:
            slope = sp.cancel(-sp.diff(whole, one.jet) / inertia)
            if slope != 0 and not varies(slope) and sp.count_ops(slope) <= _LONGEST:
                found[name, one.name] = slope
    return found


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
    """What the terms that are linear in the sensor get; one with a derivative or an integral of it gets nothing."""
    jet = Jet(sensor)
    out = {}
    for order, psi in parts.items():
        linear = [term for term in terms_of(psi) if jet in jets(term) and not term.has(Integral)]
        gains = [sp.diff(term, jet) for term in linear]
        out[order] = added(gain for gain in gains if not varies(gain)) * slope * Jet(jumps[name])
    return out
