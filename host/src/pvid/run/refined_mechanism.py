"""Refinement of a described mechanism from a recording, with the weak form's answer as its start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.codegen.refine import LOG_SD, signs_of, width_name
from pvid.model.compiled import CompiledModel
from pvid.run.refined import Measured, Prior, Problem, Refined, refined
from pvid.run.refined_inputs import inputs_of
from pvid.run.refined_kernel import RefinedKernel, kernel_of

Float = npt.NDArray[np.float64]

_STEP = 0.1  # of a step times the fastest eigenvalue: the error of RK4 is below 1e-7 of a period
_MOST_SUB = 16
_SIGN_SUB = 4  # steps a sample where there are signs: their width follows from these


@dataclass(frozen=True, eq=False)
class RefinedMechanism:
    """Outcome: `found` and the problem that it solves."""

    problem: Problem
    found: Refined

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name."""
        names = [one.name for one in self.problem.kernel.made.parameters]
        return dict(zip(names, map(float, self.found.r), strict=False))

    @property
    def errors(self) -> dict[str, float]:
        """Their standard errors, in their units."""
        made = self.problem.kernel.made
        sd = np.sqrt(np.diag(self.found.covariance))
        return {one.name: float(sd[k] * (self.found.r[k] if one.log else 1.0)) for k, one in enumerate(made.parameters)}


def start_of(kernel: RefinedKernel, p: Float) -> Float:
    """r, with settings, from p of the weak form."""
    made = kernel.made
    model = made.model
    known = {one.name: one.value for one in model.knowns}
    r = [p[one.place] if one.place >= 0 else 0.0 for one in made.parameters]
    return np.array(r + [known.get(name, 1.0) for name in made.settings])


def problem_of(
    model: CompiledModel, signals: Mapping[str, Float], rate: float, r: Float, widths: Mapping[str, float] | None = None
) -> tuple[Problem, Float]:
    """The problem, and r with widths of the signs."""
    kernel = kernel_of(model)
    made = kernel.made
    signs = signs_of(model)
    sub = _SIGN_SUB if signs else 1
    r = r.copy()
    names = list(made.settings)
    places = {str(one): len(made.parameters) + names.index(width_name(one)) for one in signs}
    zero = np.zeros(kernel.states)
    u = np.zeros(len(made.inputs))
    for place in places.values():
        r[place] = 1e6  # out of the way
    fastest = float(np.abs(np.linalg.eigvals(kernel.slopes(r, zero, u))).max())
    sub = min(max(sub, int(np.ceil(fastest / rate / _STEP))), _MOST_SUB)
    for sign, place in places.items():
        r[place] = (widths or {}).get(sign) or _width(kernel, r, place, sub, rate)
    inputs = inputs_of(model, made, signals, rate, sub)
    measured = Measured(
        np.stack([signals[name] for name in made.outputs], -1),
        np.array([model.signal(name).sd for name in made.outputs]),
        lambda _: inputs,
        rate,
        sub,
    )
    return Problem(kernel, measured), r


def _width(kernel: RefinedKernel, r: Float, place: int, sub: int, rate: float) -> float:
    """The jump of the rate within a step that a friction's reversal makes: RK4 stays stable and smooth."""
    sharp = r.copy()
    sharp[place] = 1e-9
    zero, u = np.zeros(kernel.states), np.zeros(len(kernel.made.inputs))
    steepest = float(np.abs(np.linalg.eigvals(kernel.slopes(sharp, zero, u))).max()) * 1e-9
    return max(steepest / rate / sub, 1e-9)


def refine_mechanism(
    model: CompiledModel,
    signals: Mapping[str, Float],
    rate: float,
    p: Float,
    block_s: float,
    widths: Mapping[str, float] | None = None,
) -> RefinedMechanism:
    """Refines an estimate p of the weak form.

    Parameters
    ----------
    block_s : length of a block [s]
    widths : of signs, by argument; from the sampling by default
    """
    kernel = kernel_of(model)
    problem, r = problem_of(model, signals, rate, start_of(kernel, p), widths)
    sd = np.array([LOG_SD if one.log else one.prior_sd for one in kernel.made.parameters])
    prior = Prior(r, np.maximum(3 * sd, 0.5 * problem.log), np.ones(problem.n, bool))
    samples = max(8, round(block_s * rate))
    return RefinedMechanism(problem, refined(problem, prior, (max(8, samples // 3), samples)))
