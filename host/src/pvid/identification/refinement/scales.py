"""What errors of gains, constants and the clock make of a refined estimate, which no residual shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.identification.refinement.fit import Measured, Prior, Problem, gated
from pvid.identification.refinement.problem import RefinedMechanism
from pvid.model.signals import Jet, jets

Float = npt.NDArray[np.float64]

_RELATIVE = 1e-4  # of a scale: the change is linear, and above rounding
_FREE_SD = 10.0  # of a step: the recording alone determines it


def scales_of(refined: RefinedMechanism) -> Float:
    """What p is off by for one standard deviation of each gain, constant and clock that has any [scales, n_p]: a step
    of the search from the estimate, with that scale larger."""
    problem, found = refined.problem, refined.found
    places = problem.kernel.made.places_of_p
    units = np.where(problem.log[places], found.r[places], 1.0)
    use = gated(problem, found) & problem.used(found.cut)
    prior = Prior(found.r, np.full(problem.n, _FREE_SD), np.diag(found.covariance) > 0)

    def step(measured: Measured, r: Float) -> Float:
        moved = Problem(problem.kernel, measured)
        block = moved.block(r, found.cut, found.starts, use)
        return np.full(problem.n, np.nan) if block is None else moved.step(block, r, prior)[0]

    before = step(problem.measured, found.r)
    steps = [sd / _RELATIVE * (step(measured, r) - before)[places] * units for measured, r, sd in _moved(refined)]
    return np.array(steps).reshape(-1, len(places))


def _moved(refined: RefinedMechanism) -> Iterator[tuple[Measured, Float, float]]:
    """What is fitted, and r, with one scale larger by a part, and the relative standard deviation of the scale: first
    of the constants."""
    r, m, made = refined.found.r, refined.problem.measured, refined.problem.kernel.made
    model, scale = made.model, sp.Symbol("scale", positive=True)

    def driven(own: Mapping[sp.Symbol, sp.Expr], measured: Measured) -> Measured:
        factors = np.array([(1 + _RELATIVE) ** _power(model.opaque.get(jet, jet), own, scale) for jet in made.inputs])

        def inputs(late: float) -> tuple[Float, Float]:
            u, du = m.inputs(late)
            return u * factors, du * factors

        return replace(measured, inputs=inputs)

    found = {jet for jet in made.inputs} | {one for jet in made.inputs for one in jets(model.opaque.get(jet, jet))}
    for known in model.knowns:
        if known.sd:
            part = _RELATIVE * known.value if known.value else _RELATIVE
            names = [*(one.name for one in made.parameters), *made.settings]
            near = np.where([name == known.name for name in names], r + part, r)
            own = {known.symbol: scale * known.symbol} if known.value else {}
            yield driven(own, m), near, _RELATIVE * known.sd / abs(part)
    for one in model.signals:
        if one.gain_sd:
            factors = np.where([name == one.name for name in made.outputs], 1 + _RELATIVE, 1.0)
            own = {jet: scale * jet for jet in found if jet.of == one.name}
            yield driven(own, replace(m, z=m.z * factors)), r, one.gain_sd
    if model.clock_sd:
        of_time = {jet: scale**jet.order * jet for jet in found if jet.order}
        yield driven(of_time, replace(m, rate=m.rate * (1 + _RELATIVE))), r, model.clock_sd


def _power(value: sp.Expr, own: Mapping[Jet, sp.Expr], scale: sp.Symbol) -> float:
    """Of an expression, by the scale that some of its symbols have: exact where it is homogeneous in them."""
    slope = sp.diff(value.xreplace(dict(own)), scale).xreplace({scale: sp.Integer(1)}) / value
    return float(slope.xreplace(dict.fromkeys(slope.free_symbols, sp.Integer(1))).evalf())
