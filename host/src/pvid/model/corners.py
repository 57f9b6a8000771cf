"""Corners of sampled signals: where an input held from sample to sample enters a sensor's first derivative.

A current has a corner (V_k - V_(k-1)) / L at every sample: int chi i dt = sum chi (i + Corner(V) / L) dt to fourth
order, with Corner(V) = dt / 12 (V_k - V_(k-1)). Ignored, L would be off by (R dt / L)^2 / 12.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from pvid.model.compiled import Signal
from pvid.model.eliminate import Equation
from pvid.model.signals import Corner, Integral, Jet, jets, order_of
from pvid.model.terms import added, merged, terms_of, varies


@dataclass(frozen=True)
class Corners:
    """Of one sensor.

    Attributes
    ----------
    sensor : whose slope jumps
    input : that is held
    gain : change of the sensor's first derivative by one unit of the input, a function of the unknowns
    """

    sensor: Jet
    input: Jet
    gain: sp.Expr

    @property
    def channel(self) -> Jet:
        """The auxiliary signal."""
        return Jet(f"{self.input.of}_corner")

    @property
    def value(self) -> sp.Expr:
        """What it stands for."""
        return Corner(self.input)


def corners_of(
    equations: Sequence[Equation], signals: Sequence[Signal], hidden: Collection[str], without: Collection[str] = ()
) -> list[Corners]:
    """Sensors whose first derivative, their highest, one equation gives by a held input and nothing else that has
    corners; those in `without` are left out."""
    inputs = {one.jet for one in signals if one.kind == "input" and one.hold == "zoh"}
    names = [one.name for one in signals if one.kind == "sensor"] + list(hidden)
    highest = {name: max(order_of(one.expression, [name]) for one in equations) for name in names}
    out = []
    for one in signals:
        if one.kind != "sensor" or one.driven or one.name in without or highest[one.name] != 1:
            continue
        rate = one.jet.d()
        holding = [e for e in equations if e.expression.has(rate)]
        if len(holding) != 1:
            continue
        whole = holding[0].expression
        others = [name for name in names if name != one.name and Jet(name, highest[name]) in jets(whole)]
        factor = sp.diff(whole, rate)
        if others or varies(factor):
            continue
        for held in sorted(inputs & jets(whole), key=str):
            gain = sp.cancel(-sp.diff(whole, held) / factor)
            if not varies(gain) and gain != 0:
                out.append(Corners(one.jet, held, gain))
    return out


def with_corners(parts: Mapping[int, sp.Expr], corners: Sequence[Corners]) -> dict[int, sp.Expr]:
    """Each psi with what the corners of its sensors add; a psi with a smoothed derivative or an integral stays."""
    extra: dict[int, sp.Expr] = {}
    for one in corners:
        for m, psi in parts.items():
            touched = [
                term
                for term in terms_of(psi)
                if term.has(one.sensor) and not term.has(Integral, one.sensor.d()) and order_of(term) == 0
            ]
            extra[m] = extra.get(m, 0) + added(sp.diff(term, one.sensor) * one.gain * one.channel for term in touched)
    return merged(parts, extra)
