"""Corners of a sampled signal: where a held input jumps, the derivative of a sensor that it drives directly jumps too.

A motor's current has the corner (V_k - V_(k-1))/L at every edge of the voltage. By Euler-Maclaurin
int chi i dt = dt sum chi (i + dt/12 (V_k - V_(k-1))/L): ignored it costs dt^2 R^2/(12 L^2) of L. So every channel that
is linear in such a sensor gets a second one in the scaled jump of the input, with a coefficient that follows from p.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.model.compiled import CompiledModel, Part, Row, Signal
from pvid.model.signals import Jet, jets, order_of

# A coefficient with more operations than this would burden every row for a correction that smooth inputs do not need.
_LONGEST = 12

_SUFFIX = "_jump"


def slopes(model: CompiledModel) -> dict[tuple[str, str], sp.Expr]:
    """(sensor, held input) -> d sensor' / d input, a function of p alone; what is not one is left out."""
    held = [one for one in model.signals if one.kind == "input" and one.hold == "zoh"]
    hidden = {jet.of for jet in model.hidden}
    first = [
        one
        for one in model.signals
        if one.kind == "sensor" and max((order_of(e, [one.name]) for e in model.equations), default=0) == 1
    ]
    found = {}
    for sensor in first:
        rate = sensor.jet.d(1)
        own = [e for e in model.equations if rate in jets(e)]
        others = [one.jet.d(1) for one in first if one is not sensor]
        if len(own) != 1 or any(jet in others or jet.of in hidden for jet in jets(own[0])):
            continue
        inertia = sp.diff(sp.expand(own[0]), rate)
        for one in held:
            slope = sp.cancel(-sp.diff(sp.expand(own[0]), one.jet) / inertia) if inertia != 0 else sp.Integer(0)
            if slope != 0 and not jets(slope) and sp.count_ops(slope) <= _LONGEST:
                found[sensor.name, one.name] = slope
    return found


def with_corners(model: CompiledModel) -> tuple[CompiledModel, dict[str, str]]:
    """The model with corrected rows, and the inputs of its new signals: name of the jump -> name of the input."""
    found = slopes(model)
    jumps = {name: name + _SUFFIX for _, name in found}
    rows = []
    for row in model.rows:
        extra: dict[sp.Expr, dict[int, sp.Expr]] = {}
        for theta, part in [*zip(row.theta, row.regressors, strict=True), (sp.Integer(-1), row.known)]:
            for (sensor, name), slope in found.items():
                for order, psi in part.items():
                    gain = sp.diff(psi, Jet(sensor))
                    if gain != 0 and gain.is_number:
                        own = extra.setdefault(sp.cancel(theta * slope), {})
                        own[order] = own.get(order, sp.Integer(0)) + gain * Jet(jumps[name])
        rows.append(added(row, extra))
    signals = [Signal(Jet(jump), model.signal(name).unit, "input") for name, jump in jumps.items()]
    whole = replace(model, rows=tuple(rows), signals=(*model.signals, *signals))
    return whole, {jump: name for name, jump in jumps.items()}


def added(row: Row, extra: Mapping[sp.Expr, Part]) -> Row:
    """A row with further terms; those with a coefficient that it has already join it."""
    theta, regressors = list(row.theta), [dict(one) for one in row.regressors]
    for coefficient, part in extra.items():
        if coefficient not in theta:
            theta.append(coefficient)
            regressors.append({})
        own = regressors[theta.index(coefficient)]
        for order, psi in part.items():
            own[order] = own.get(order, sp.Integer(0)) + psi
    return replace(row, theta=tuple(theta), regressors=tuple(regressors))


def with_jumps(
    run: Mapping[str, npt.ArrayLike], jumps: Mapping[str, str], sample_rate: float
) -> dict[str, npt.ArrayLike]:
    """A run with the scaled jumps of its inputs, dt/12 (u_k - u_(k-1)) [n]."""
    out = dict(run)
    for jump, name in jumps.items():
        if name in run:
            u = np.asarray(run[name], np.float64)
            out[jump] = np.diff(u, prepend=u[:1]) / (12 * sample_rate)
    return out
