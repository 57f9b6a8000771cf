"""Refinement of a described mechanism from a recording, with the weak form's answer as its start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.refine import LOG_SD, has_skew
from pvid.model.compiled import CompiledModel
from pvid.models.model import Mechanism
from pvid.models.registry import DEFAULT, MODELS
from pvid.oracle.weak import verdict
from pvid.oracle.weak.identify import Identified
from pvid.rig.file import Nominal, RigFile, Sensor
from pvid.rig.gaps import stretches
from pvid.rig.run import NUMBER, Run
from pvid.run.mechanism import MechanismAnswer, refined_gains_of, refined_shifts_of, values_of
from pvid.run.refined import (
    GOOD,
    NOISE,
    Measured,
    Prior,
    Problem,
    Refined,
    Stretch,
    refined,
    softened,
    without_outliers,
)
from pvid.run.refined_inputs import inputs_of
from pvid.run.refined_kernel import RefinedKernel, kernel_of
from pvid.run.refined_pendulum import RefinedPendulum, refine_pendulum

Float = npt.NDArray[np.float64]

_STEP = 0.1  # of a step times the fastest eigenvalue: the error of RK4 is below 1e-7 of a period
_MOST_SUB = 16
_SIGN_SUB = (16, 64)  # steps a sample where there are signs, whose width follows from these: a wide one biases
_STEPS = 1e6  # of the run: inputs at each are kept
_WIDER = (8.0, 64.0, 512.0, 4096.0)  # times the sharp width
_WIDENING_PASSES = 10
_WORSE = 3.0  # times the least sum of squares: signs that are wider still explain less


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
        made, problem = self.problem.kernel.made, self.problem
        _, covariance = problem.values(self.found, range(problem.n))
        return {one.name: float(sd) for one, sd in zip(made.parameters, np.sqrt(np.diag(covariance)), strict=True)}


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
    number = signals.get(NUMBER, np.zeros(1))
    kernel = kernel_of(model, begins=np.flatnonzero(np.diff(number, prepend=-1.0)).tolist())
    made = kernel.made
    r = r.copy()
    zero = np.zeros(kernel.states)
    u = np.zeros(len(made.inputs))
    r[kernel.widths] = 1e6  # out of the way
    fastest = float(np.abs(np.linalg.eigvals(kernel.slopes(r, zero, u))).max())
    smooth = min(max(1, int(np.ceil(fastest / rate / _STEP))), _MOST_SUB)
    samples = len(signals[made.outputs[0]])
    fine = int(np.clip(_STEPS / samples, *_SIGN_SUB))
    coarse = max(2, fine // smooth // 2 * 2) if kernel.widths else 1
    sub = smooth * coarse
    for place in kernel.widths:
        r[place] = (widths or {}).get(made.parameters[place].sign) or _width(kernel, r, place, sub, rate)
    inputs = inputs_of(model, made, signals, rate, sub)
    measured = Measured(
        np.stack([signals[name] for name in made.outputs], -1),
        np.array([model.signal(name).sd for name in made.outputs]),
        lambda _: inputs,
        rate,
        sub,
        coarse=coarse,
        stretches=_known_stretches(inputs[0], sub),
    )
    return Problem(kernel, measured), r


def _known_stretches(u: Float, sub: int) -> list[Stretch]:
    """In which the inputs [steps, 3, inputs] are known; none: everywhere."""
    there = np.asarray(np.isfinite(u).all((1, 2)).reshape(-1, sub).all(1))
    if there.all():
        return []
    return [(int(first), int(end)) for first, end in zip(*stretches(there), strict=True)]


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
    problem, r = problem_of(model, signals, rate, start_of(kernel_of(model), p), widths)
    prior = prior_about(problem, r)
    samples = max(8, round(block_s * rate))
    shorter = refined(problem, prior, (max(8, samples // 3),))
    found = longest_that_fits((shorter, refined(problem, prior, (samples,), before=shorter)))
    if problem.kernel.widths and found.slow_chi2 > NOISE:
        found, prior = _softer(problem, prior, found)
    return RefinedMechanism(problem, without_outliers(problem, prior, found))


def longest_that_fits(tried: Sequence[Refined]) -> Refined:
    """Of blocks of rising length the longest whose residuals are noise, else the longest: along a block the errors of
    the steps at reversals grow, and a search in it may not converge."""
    return next((one for one in reversed(tried) if one.converged and one.slow_chi2 <= NOISE), tried[-1])


def prior_about(problem: Problem, r: Float) -> Prior:
    """Wide, of all parameters but the widths of signs."""
    parameters = problem.kernel.made.parameters
    sd = np.array([LOG_SD if one.log and not one.sign else one.prior_sd for one in parameters])
    return Prior(r, np.maximum(3 * sd, 0.5 * problem.log), ~problem.is_width)


def simulated_at(answer: MechanismAnswer, p: Float) -> RefinedMechanism:
    """The motion of a recording at p [n_p]: the starts of its blocks, of two windows each, are fitted to it.

    Raises
    ------
    PvidError
        Where the equations cannot be simulated on it.
    """
    model, recording = answer.model, answer.recording
    rate = recording.sample_rate
    problem, r = problem_of(model, recording.run, rate, start_of(kernel_of(model), p))
    cut = problem.cut(max(8, round(2 * answer.found.design.window_s * rate)))
    return RefinedMechanism(problem, problem.with_starts(prior_about(problem, r), cut))


def _softer(problem: Problem, prior: Prior, found: Refined) -> tuple[Refined, Prior]:
    """With the wider signs of the frictions that explain most, and then with their widths free."""
    use, sharp = problem.used(found.cut), found.r[problem.kernel.widths]
    again = found
    for wider in _WIDER if np.isfinite(found.sum_of_squares) else ():
        r = again.r.copy()
        r[problem.kernel.widths] = wider * sharp
        again = problem.searched(r, prior, found.cut, again.starts, use, most=_WIDENING_PASSES)
        found = min(found, again, key=lambda one: one.sum_of_squares)
        if not again.sum_of_squares < _WORSE * found.sum_of_squares:
            break
    return softened(problem, prior, found, use)


def _as_pendulum(answer: MechanismAnswer) -> RefinedPendulum:
    """By the pendulum's own refinement, whose input is the second derivative of a sample.

    Raises
    ------
    PvidError
        For another mechanism with such an input.
    """
    model, recording = answer.model, answer.recording.whole()
    if model.name != DEFAULT:
        raise PvidError(
            f"an input of {model.name} is the derivative of a sample, which the refinement in float64 has for the "
            "pendulum alone: use --core f32"
        )
    p, known = (
        dict(zip(model.p_names, map(float, answer.found.p), strict=True)),
        {x.name: x.value for x in model.knowns},
    )
    pendulum = MODELS[DEFAULT]
    own = Mechanism(pendulum, {one.name: known[one.name] for one in pendulum.constants})
    lengths = own.physical([p[name] for name in pendulum.mapped_names])
    rig = RigFile(
        l1=known["l1"],
        nominal=Nominal(**dict(zip(pendulum.physical_names, map(float, lengths), strict=True))),
        sensor=Sensor(phi_lsb=model.signal("phi").resolution, y_lsb=model.signal("y").resolution),
        sample_rate=recording.sample_rate,
    )
    run = Run(recording.t, recording.signals["phi"], recording.signals["y"], recording.sample_rate)
    return refine_pendulum(run, rig, [p], sure=answer.identified)


def refined_answer(answer: MechanismAnswer) -> tuple[MechanismAnswer, RefinedMechanism | RefinedPendulum | None, str]:
    """The answer after a refinement that starts from it, the refinement, and what became of it in a clause."""
    weak, model, recording = answer.found, answer.model, answer.recording
    refined: RefinedMechanism | RefinedPendulum
    try:
        if has_skew(model):
            refined = _as_pendulum(answer)
        else:
            refined = refine_mechanism(
                model, recording.run, recording.sample_rate, _start(weak), 2 * weak.design.window_s
            )
    except PvidError as error:
        return answer, None, f"not refined: {error}"
    found = refined.found
    if not found.converged:
        return answer, refined, "the refinement did not converge: the weak form's answer stands"
    if isinstance(refined, RefinedPendulum) and (rivalry := refined.rivalry) is not None:
        return answer, refined, f"{rivalry}: the weak form's answer stands"
    asked = 2 * weak.design.window_s
    length = found.cut.samples / recording.sample_rate
    if isinstance(refined, RefinedMechanism) and length < asked / 2 and _spread(refined, weak.se) > 1:
        text = f"blocks above {length:.2g} s do not fit, and shorter ones have larger standard errors"
        return answer, refined, f"{text}: the weak form's answer stands"
    better = isinstance(refined, RefinedMechanism) and _better(refined, weak.p, weak.se)
    if found.slow_chi2 > GOOD and not better:
        text = (
            f"slow residuals have {found.slow_chi2:.2g} times the variance of the noise: the weak form's answer stands"
        )
        return answer, refined, text
    made = refined.problem.kernel.made
    p, covariance = refined.problem.values(found, made.places_of_p)
    shifts = refined_shifts_of(model, weak)
    judged = verdict.judged_again(model, weak.judged, p, np.sqrt(np.diag(covariance)))
    kept = [one for one in weak.verdict.reasons if one.name != "near_zero"]
    told = verdict.sorted_by_gravity([*kept, *verdict.of_bounds(model, judged, min(weak.r2.values()))])
    weak = replace(weak, judged=judged, verdict=verdict.Verdict(told))
    values = values_of(model, p, covariance, refined_gains_of(model, weak), judged, weak.verdict, shifts)
    text = f"refined over {len(found.cut.first)} blocks; chi2 {found.chi2:.2g}, of slow residuals {found.slow_chi2:.2g}"
    if isinstance(refined, RefinedPendulum) and len(recording.segments) > 1:
        t = recording.whole().t
        text += f"; of the longest segment alone, {t[0]:.6g} s to {t[-1]:.6g} s"
    for place in refined.problem.kernel.widths:
        if found.covariance[place, place] > 0:
            text += (
                f"; sgn({made.parameters[place].sign}) changes over {found.r[place]:.2g} {made.parameters[place].unit}"
            )
    return replace(answer, found=weak, values=values), refined, text


def _start(weak: Identified) -> Float:
    """p, but half of its bound for what may be 0: its logarithm has run down, where nothing moves it."""
    half = [p if one.below is None else max(p, one.below / 2) for p, one in zip(weak.p, weak.judged, strict=True)]
    return np.array(half, np.float64)


def _spread(refined: RefinedMechanism, se: Float) -> float:
    """Geometric mean of the refined standard errors over those of the weak form, of parameters that both have."""
    ratio = np.array([refined.errors[name] for name in refined.problem.kernel.made.model.p_names]) / se
    there = np.isfinite(ratio) & (ratio > 0)
    return float(np.exp(np.mean(np.log(ratio[there])))) if there.any() else np.inf


def _better(refined: RefinedMechanism, p: Float, se: Float) -> bool:
    """Whether the refined answer agrees with the weak one and its standard errors are smaller."""
    names = refined.problem.kernel.made.model.p_names
    value = np.array([refined.values[name] for name in names])
    error = np.array([refined.errors[name] for name in names])
    return bool((np.abs(value - p) <= 3 * np.hypot(error, se)).all() and (error <= se).all())
