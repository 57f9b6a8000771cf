"""Corners and steps of sampled signals: where a held input jumps, so do some sensors, or their derivatives.

A motor's current has the corner (V_k - V_(k-1))/L at every edge of the voltage. By Euler-Maclaurin
int chi i dt = dt sum chi (i + dt/12 (V_k - V_(k-1))/L): ignored it costs dt^2 R^2/(12 L^2) of L. So every channel that
contains such a sensor gets a second one in the scaled jump of the input, with a coefficient that follows from p and
from the signals at the edge: with the voltage d vb of a bridge it is vb (d_k - d_(k-1))/L, and in w Lq iq it is
multiplied by w.

A sensor that an algebraic equation ties to the input jumps itself, by D = dy/du: the current through a resistor, the
voltage of a cell, an accelerometer. Sampled behind the jump its integral is dt sum chi (y + D (mean of u about t_k -
u_k)); sampled before it, u_k is replaced by u_(k-1). Without the correction the sensor is half a sample late or early.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import sympy as sp

from pvid.model.compiled import CompiledModel, Signal
from pvid.model.factor import factor, parts_of
from pvid.model.signals import TIME, Integral, Jet, jets, order_of
from pvid.model.terms import added, is_opaque, merged, terms_of, varies

# A coefficient with more operations than this would burden every row for a correction that smooth inputs do not need.
_LONGEST = 12


@dataclass(frozen=True)
class OfInput:
    """A signal made of a held input u: "jump", dt/12 (u_k - u_(k-1)); "after", u_k; or "before", u_(k-1)."""

    name: str
    kind: Literal["jump", "after", "before"]

    @property
    def jet(self) -> Jet:
        """The signal."""
        return Jet(f"{self.name}_{self.kind}")


def feedthroughs(model: CompiledModel) -> dict[tuple[str, str], sp.Expr]:
    """(sensor, held input) -> d sensor / d input at an instant, a function of p and of the signals.

    Of sensors without derivatives in the equations; what is long is left out.
    """
    driven = {one.name for one in model.signals if one.kind == "input" or one.driven}
    hidden = {jet.of for jet in model.hidden}
    return {
        (jet.of, name): ratio
        for (jet, name), ratio in _solved(model).items()
        if jet.order == 0 and jet.of not in driven | hidden and _is_usable(ratio, hidden)
    }


def _solved(model: CompiledModel) -> Mapping[tuple[Jet, str], sp.Expr]:
    """(highest derivative of a sensor or a hidden quantity, held input) -> its jump over that of the input.

    By the solution of the linear system that all equations are. Empty where no quantity is without derivatives: then
    each equation shows its own; and where the system's matrix varies, is not square or is singular.
    """
    held = [one.name for one in model.signals if one.kind == "input" and one.hold == "zoh"]
    names = [one.name for one in model.signals if one.kind == "sensor" and not one.driven]
    names += sorted({str(jet.of) for jet in model.hidden})
    return _jumps_of(model.equations, tuple(held), tuple(names))


@lru_cache(maxsize=16)
def _jumps_of(
    equations: tuple[sp.Expr, ...], held: tuple[str, ...], names: tuple[str, ...]
) -> Mapping[tuple[Jet, str], sp.Expr]:
    """The same of the quantities of these names."""
    top = [Jet(name, max((order_of(one, [name]) for one in equations), default=0)) for name in names]
    if not held or all(jet.order for jet in top) or len(top) != len(equations):
        return {}
    whole = [sp.expand(one) for one in equations]
    matrix = sp.Matrix([[sp.diff(one, jet) for jet in top] for one in whole])
    if any(varies(one) for one in matrix):
        return {}
    right = sp.Matrix([[-sp.diff(one, Jet(name)) for name in held] for one in whole])
    try:
        jumps = matrix.LUsolve(right)
    except ValueError:  # singular
        return {}
    ratios = {(jet, name): sp.cancel(jumps[i, k]) for i, jet in enumerate(top) for k, name in enumerate(held)}
    return {key: ratio for key, ratio in ratios.items() if ratio != 0}


def slopes(model: CompiledModel) -> dict[tuple[str, str], sp.Expr]:
    """(sensor, held input) -> d sensor' / d input, a function of p and of the signals.

    Of a sensor whose first derivative is the highest one and occurs in one equation, where no other signal with corners
    does, or that the input drives through algebraic equations; and of one that an algebraic equation ties to such
    sensors. Left out: what has an inertia that varies, what
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
    for (jet, of), slope in _solved(model).items():
        if jet.order == 1 and jet.of in first and _is_usable(slope, hidden):
            found.setdefault((jet.of, of), slope)
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
    plain = not slope.has(Integral, sp.Derivative, sp.Subs) and all(
        jet.order == 0 and jet.of not in hidden for jet in jets(slope)
    )
    return plain and sp.count_ops(slope) <= _LONGEST


def _tied(model: CompiledModel, name: str, held: str, known: Mapping[str, sp.Expr]) -> sp.Expr:
    """Of a sensor without a derivative, by the one equation that ties it to sensors with corners and to quantities
    whose derivatives do not jump; 0: there is none."""
    ties = [
        one
        for one in model.equations
        if Jet(name) in jets(one)
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


def with_corners(model: CompiledModel) -> tuple[CompiledModel, dict[str, OfInput]]:
    """The model with corrected rows, and what its new signals are made of."""
    corners = [(sensor, slope, OfInput(name, "jump")) for (sensor, name), slope in slopes(model).items()]
    added_to = [(sensor, slope * of.jet) for sensor, slope, of in corners]
    made = [of for *_, of in corners]
    for (sensor, name), ratio in feedthroughs(model).items():
        edge = model.signal(sensor).edge
        if edge != "between":
            made.append(OfInput(name, edge))
            added_to.append((sensor, ratio * (Jet(name) - made[-1].jet)))
    if not made:
        return model, {}
    rows = []
    for row in model.rows:
        parts = parts_of(row)
        whole = merged(parts, *(_added(parts, *one) for one in added_to))
        rows.append(factor(row.name, whole, model.alone.p, row.nuisances).with_empty(row))
    named = {str(one.jet): one for one in made}
    signals = [Signal(one.jet, model.signal(one.name).unit, "input") for one in named.values()]
    return replace(model, rows=tuple(rows), signals=(*model.signals, *signals)), named


def _added(parts: Mapping[int, sp.Expr], sensor: str, what: sp.Expr) -> dict[int, sp.Expr]:
    """What the terms that contain the sensor get; one with a derivative or an integral of it gets nothing."""
    jet = Jet(sensor)
    out = {}
    for order, psi in parts.items():
        own = [term for term in terms_of(psi) if jet in jets(term) and not term.has(Integral, TIME)]
        plain = [term for term in own if not any(one.of == sensor and one.order for one in jets(term))]
        gains = [sp.diff(term, jet) for term in plain]
        out[order] = added(gain for gain in gains if not is_opaque(gain) and not gain.has(sp.Function)) * what
    return out
