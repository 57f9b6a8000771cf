"""A refinement of a mechanism: its problem from a recording, its first fit, and its outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.refine import LOG_SD
from pvid.identification.refinement.fit import (
    NOISE,
    Cut,
    Measured,
    Prior,
    Problem,
    Refined,
    Stretch,
    gated,
    refined,
    softened,
    without_outliers,
)
from pvid.identification.refinement.inputs import inputs_of
from pvid.identification.refinement.kernel import kernel_of
from pvid.model.compiled import CompiledModel
from pvid.rig.gaps import stretches
from pvid.rig.run import NUMBER

Float = npt.NDArray[np.float64]

_WIDER = (8.0, 64.0, 512.0, 4096.0)  # times the sharp width
_WIDENING_PASSES = 10
_WORSE = 3.0  # times the least sum of squares: signs that are wider still explain less
_FREE_SD = 10.0  # of a step of a half: the half alone determines it


@dataclass(frozen=True, eq=False)
class RefinedMechanism:
    """Outcome.

    Attributes
    ----------
    problem, found : the fit and the problem that it solves
    main : places in r of the parameters that the search is judged by: the positive unknowns that are not near 0
    rivals : other fits that explain the recording about as well
    breaks : times at which a differentiated signal jumps, between the blocks [s]
    """

    problem: Problem
    found: Refined
    main: tuple[int, ...] = ()
    rivals: tuple[Refined, ...] = ()
    breaks: tuple[float, ...] = ()

    @property
    def names(self) -> list[str]:
        """Of the refined parameters."""
        return [one.name for one in self.problem.kernel.made.parameters]

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name."""
        return dict(zip(self.names, map(float, self.found.r), strict=False))

    @property
    def errors(self) -> dict[str, float]:
        """Their standard errors, in their units."""
        _, covariance = self.problem.values(self.found, range(self.problem.n))
        return {name: float(sd) for name, sd in zip(self.names, np.sqrt(np.diag(covariance)), strict=True)}

    @property
    def extras(self) -> dict[str, tuple[float, float]]:
        """Those that the weak form does not have, and that were searched and determined: value and standard error."""
        values, errors = self.values, self.errors
        own = [one.name for one in self.problem.kernel.made.parameters if one.place < 0]
        return {name: (values[name], errors[name]) for name in own if 0 < errors[name] < np.inf}

    def halves_differ(self) -> float:
        """By how many of their standard errors the main parameters of two halves of the recording, or of all its
        recordings, differ, the extras left as they are; inf where a half does not determine one."""
        problem, found = self.problem, self.found
        of_p = np.array([one.place >= 0 for one in problem.kernel.made.parameters])
        prior = Prior(found.r, np.full(problem.n, _FREE_SD), of_p)
        numbers = problem.kernel.number_of(found.cut.first)
        own = found.cut if np.bincount(numbers).min() > 1 else problem.cut(found.cut.samples // 2)
        starts = problem.starts_along(found.r, found, own)
        use = gated(problem, found) & problem.used(found.cut) if own is found.cut else problem.used(own)
        numbers = problem.kernel.number_of(own.first)
        count = np.bincount(numbers)
        rank = np.arange(len(numbers)) - np.searchsorted(numbers, numbers)
        late = rank >= count[numbers] // 2
        halves = [
            problem.searched(found.r, prior, Cut(own.first[half], own.samples), starts[half], use[half])
            for half in (~late, late)
        ]
        if not all(np.isfinite(one.chi2) and one.converged for one in halves):
            return np.inf
        both = np.sqrt(sum(np.diag(one.covariance) for one in halves))[list(self.main)]
        if not np.isfinite(both).all():
            return np.inf
        apart = np.abs(problem.step_between(halves[0].r, halves[1].r)[list(self.main)])
        return float(np.max(apart / both, initial=0.0))

    def rivals_differ(self) -> float:
        """By how many standard errors a main parameter of the farthest rival differs; 0 where there is none."""
        main, apart = list(self.main), 0.0
        own = np.diag(self.found.covariance)[main]
        for one in self.rivals:
            far = np.abs(self.problem.step_between(self.found.r, one.r)[main])
            apart = max(apart, float(np.max(far / np.sqrt(own + np.diag(one.covariance)[main]), initial=0.0)))
        return apart


def begins_of(signals: Mapping[str, Float], mean: int = 1) -> list[int]:
    """First sample of each of several recordings, of averages over so many samples; [0] of one."""
    number = signals.get(NUMBER, np.zeros(1))
    return [-(-int(first) // mean) for first in np.flatnonzero(np.diff(number, prepend=-1.0))]


def problem_of(model: CompiledModel, signals: Mapping[str, Float], rate: float, p: Float) -> tuple[Problem, Float]:
    """The problem, and r at p of the weak form, with widths of the signs."""
    kernel = kernel_of(model, begins=begins_of(signals))
    made = kernel.made
    sub, coarse, r = kernel.steps(len(signals[made.outputs[0]]), rate, kernel.start(p))
    inputs = inputs_of(model, made, signals, rate, sub)
    measured = Measured(
        np.stack([signals[name] for name in made.outputs], -1),
        np.array([model.signal(name).sd for name in made.outputs]),
        lambda _: inputs,
        rate,
        sub,
        coarse=coarse,
        stretches=known_stretches(inputs[0], sub),
    )
    return Problem(kernel, measured), r


def known_stretches(u: Float, sub: int) -> list[Stretch]:
    """In which the inputs [steps, 3, inputs] are known; none: everywhere.

    Raises PvidError where they are known nowhere.
    """
    there = np.asarray(np.isfinite(u).all((1, 2)).reshape(-1, sub).all(1))
    if there.all():
        return []
    if not there.any():
        raise PvidError("the recording is too short for the refinement, or its gaps leave nothing between them")
    return [(int(first), int(end)) for first, end in zip(*stretches(there), strict=True)]


def refine_mechanism(
    model: CompiledModel,
    signals: Mapping[str, Float],
    rate: float,
    p: Float,
    block_s: float,
) -> RefinedMechanism:
    """Refines an estimate p of the weak form.

    Parameters
    ----------
    block_s : length of a block [s]
    """
    problem, r = problem_of(model, signals, rate, p)
    prior = prior_about(problem, r)
    samples = max(8, round(block_s * rate))
    shorter = refined(problem, prior, (max(8, samples // 3),))
    found = longest_that_fits((shorter, refined(problem, prior, (samples,), before=shorter)))
    found, prior = softer(problem, prior, found)
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


def softer(problem: Problem, prior: Prior, found: Refined) -> tuple[Refined, Prior]:
    """With the wider signs of the frictions that explain most, and then with their widths free; the same where there
    are none, or residuals are noise."""
    if not problem.kernel.widths or found.slow_chi2 <= NOISE:
        return found, prior
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
