"""Refinement of the pendulum: full equations, friction of both joints and the skew of the sensors, over a whole run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.refine import LOG_SD, WIDTH_SD
from pvid.design.second_derivative import second_derivative
from pvid.models.mechanisms import compiled_of
from pvid.models.registry import DEFAULT, MODELS
from pvid.rig.breaks import breaks
from pvid.rig.file import RigFile
from pvid.rig.gaps import bridge, stretches
from pvid.rig.run import Run
from pvid.run.refined import (
    GOOD,
    NOISE,
    Budget,
    Cut,
    Inputs,
    Measured,
    Prior,
    Problem,
    Refined,
    Stretch,
    explaining,
    gated,
    refined,
    softened,
    without_outliers,
)
from pvid.run.refined_inputs import EDGE, HIGHEST, drive_edge_hz
from pvid.run.refined_kernel import PLAY, PlayedKernel, kernel_of
from pvid.setup.f32 import NOISE_LSB, row_sd_of

Float = npt.NDArray[np.float64]

_PERIODS = 2.0  # of the slow mode in a block
_SEARCH = (0.15, 0.4)  # of that: blocks of the search for w, d1, d2 and the zero alone
_SEARCH_PASSES = 12
_VAGUE = 0.1  # largest standard error of a logarithm from which a search goes on with longer blocks
_BOUND = 1.5  # slow chi^2 of a search that needs no other start
_KNOTS = 4  # of the spline through the drive: over as many it follows a wrong one
_STEP = 0.1  # of a step times the fast mode's angular frequency
_A_PERIOD = 60  # decimated samples in a period of the fast mode
# what is known of the extras before: little
_SD = {"k1": 0.5, "k2": 0.5, "tau": 5e-3, "c": 1.0, "f1": 1.0, "f2": 1.0, "slant": 0.1, PLAY: 5e-3}
_ALIKE = 1.1  # times the least chi^2 of the searches: longer blocks show which of those up to it is right
_MOST_ALIKE = 4
_SAME = 0.02  # two searches agree: relative difference of all parameters
_SIGN_COARSE = 8  # steps in a smooth one where dry friction may reverse
_WIDTHS = (0.3, 0.1, 0.03, 0.01)  # of the sign of a dry friction, in turn: share of the joint's largest speed
_FIRST = tuple(one.name for one in MODELS[DEFAULT].published)
_OPTIONS: tuple[tuple[str, ...], ...] = ((PLAY,), ("slant",), ("f1", "f2"))  # tried one after another
_EXTRAS = ("slant", "f1", "f2", PLAY)  # in the order of r
_WIDTH_OF = {"f1": "width_a1_1", "f2": "width_a1_1_a2_1"}  # of the sign of a dry friction
_DRY = tuple(_WIDTH_OF)
_FRICTIONS = ("k1", "k2", *_DRY)
_DRY_STARTS = 4  # of a search with them
_NEAREST = 2  # of them from the shortest blocks
_OPTION_PASSES = 10
_SHORTER = (0.5, 0.25)  # of a block: tried where the residuals are larger than the sensors' noise
_LONGER = 3  # times a block: tried where they are not
_GROWN = 1.25  # of standard errors: by which those of two lengths of a block differ by chance
_CHEAP = 1.3  # growth of the others' standard errors up to which an extra is free
_TOLD = 9.0  # fall of the sum of squares from which it is free in any case
_UNSURE = 0.05  # standard error of a logarithm from which friction is searched where residuals are no noise
_WORK = 1.2e9  # of one refinement: three to four minutes
_RIVAL = 3.0  # standard errors by which a fit may differ that explains the run as well

TOO_LONG = "the refinement needs too many steps: the run is long, or its guess has too fast a mode"


@dataclass(frozen=True, eq=False)
class RefinedPendulum:
    """Outcome.

    Attributes
    ----------
    problem, found : the fit and the problem that it solves
    first : sample of the run that the problem starts at
    rivals : other fits that explain the run about as well
    breaks : times at which the drive jumps, between the blocks [s]
    """

    problem: Problem
    found: Refined
    first: int
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
        """Their standard errors."""
        _, covariance = self.problem.values(self.found, range(self.problem.n))
        return dict(zip(self.names, map(float, np.sqrt(np.diag(covariance))), strict=True))

    def halves_differ(self) -> Float:
        """By how many of their standard errors w, d1, d2 of the two halves of the run differ [3], the extras left as
        they are; inf where a half determines none."""
        problem, found = self.problem, self.found
        prior = Prior(found.r, np.full(problem.n, 10.0), np.array([name in _FIRST for name in self.names]))
        cut = found.cut if len(found.cut.first) > 1 else problem.cut(found.cut.samples // 2)
        starts = problem.starts_along(found.r, found, cut)
        use = gated(problem, found) & problem.used(found.cut) if cut is found.cut else problem.used(cut)
        middle = len(cut.first) // 2
        halves = []
        for part in (slice(middle), slice(middle, None)):
            of = Cut(cut.first[part], cut.samples)
            halves.append(problem.searched(found.r, prior, of, starts[part], use[part]))
        if not all(np.isfinite(one.chi2) and one.converged for one in halves):
            return np.full(3, np.inf)
        both = np.sqrt(sum(np.diag(one.covariance)[:3] for one in halves))
        if not np.isfinite(both).all():
            return np.full(3, np.inf)
        return np.asarray(np.abs(problem.step_between(halves[0].r, halves[1].r)[:3]) / both)

    @property
    def rivalry(self) -> str | None:
        """A clause where a rival's w, d1 or d2 differ by more than standard errors explain; None where none does."""
        apart = float(self.rivals_differ().max())
        if apart <= _RIVAL:
            return None
        return f"other parameters explain the run about as well, and differ by {apart:.2g} standard errors"

    def rivals_differ(self) -> Float:
        """By how many standard errors w, d1, d2 of the farthest rival differ [3]; 0 where there is none."""
        own, apart = np.diag(self.found.covariance)[:3], np.zeros(3)
        for one in self.rivals:
            far = np.abs(self.problem.step_between(self.found.r, one.r)[:3])
            apart = np.maximum(apart, far / np.sqrt(own + np.diag(one.covariance)[:3]))
        return apart

    @property
    def extras(self) -> dict[str, tuple[float, float]]:
        """Those that the weak form does not have: value and standard error."""
        places = [k for k, one in enumerate(self.problem.kernel.made.parameters) if one.place < 0]
        values, covariance = self.problem.values(self.found, places)
        errors = np.sqrt(np.diag(covariance))
        return {self.names[k]: (float(value), float(sd)) for k, value, sd in zip(places, values, errors, strict=True)}


class _Search:
    """One run; problems differ in the optional extras."""

    def __init__(self, run: Run, rig: RigFile, p: Float) -> None:
        self.run, self.rig = run, rig
        self.slow, self.fast = rig.mechanism.model.modes_hz(p)
        rate = run.sample_rate
        if not 2 * self.fast < rate:
            raise PvidError(f"{rate:g} samples a second are too few for a mode of {self.fast:.3g} Hz")
        y, self.breaks = self._whole(run.y)
        there = np.isfinite(y)
        edge = max(EDGE * drive_edge_hz(y, rate, NOISE_LSB * rig.sensor.y_lsb), self.slow)
        front = second_derivative(rate, min(edge, HIGHEST * rate))
        y = np.interp(np.arange(len(y)), np.flatnonzero(there), y[there])
        times, acceleration = front.apply(y, rate)
        if len(times) < 12:
            raise PvidError(f"the run of {len(y) / rate:.3g} s is too short for the refinement")
        self.first, last = int(np.ceil(times[0] * rate)), int(times[-1] * rate)
        self.mean = max(1, int(rate / (_A_PERIOD * self.fast)))
        self.samples = (last - self.first + 1) // self.mean
        self.stretches = self._stretches(there, front.mean * (front.half + _KNOTS))
        self.rate = rate / self.mean
        middle = self.first + (self.mean - 1) / 2  # of the first average
        self._track = times - middle / rate, acceleration / rig.l1
        self.budget = Budget(_WORK)
        self._problems: dict[tuple[str, ...], Problem] = {}
        self.short: list[tuple[float, dict[str, float]]] = []  # chi^2 and values of the shortest blocks, of each start

    def _whole(self, y: Float) -> tuple[Float, tuple[float, ...]]:
        """The drive without wild samples, NaN about jumps; and the times of these [s]."""
        rate, periods = self.run.sample_rate, len(y) / self.run.sample_rate * self.slow
        broken = breaks(y, max(8, round(rate / self.slow)), NOISE_LSB * self.rig.sensor.y_lsb)
        missing = np.isnan(y)
        whole = np.where(broken, np.nan, y)
        bridge(whole, rate)
        firsts, _ = stretches(np.isnan(whole) & ~missing)
        if len(firsts) > periods / _PERIODS:  # more than blocks: corners of the drive
            return y, ()
        return whole, tuple(self.run.t[firsts].tolist())

    def _stretches(self, there: npt.NDArray[np.bool_], reach: int) -> list[Stretch]:
        """In which the drive is known: its filter has no missing sample; none where no sample is missing."""
        if there.all():
            return []
        missing = np.convolve(~there, np.ones(2 * reach + 1), "same") > 0.5
        averaged = missing[self.first :][: self.samples * self.mean].reshape(-1, self.mean)
        firsts, ends = stretches(np.asarray(~averaged.any(1)))
        if not len(firsts):
            raise PvidError("the gaps of the run leave nothing between them that the refinement can use")
        return [(int(first), int(end)) for first, end in zip(firsts, ends, strict=True)]

    def problem(self, optional: tuple[str, ...] = ()) -> Problem:
        """With these extras."""
        if optional not in self._problems:
            rate = self.rate
            sub = max(1, int(np.ceil(2 * np.pi * self.fast / rate / _STEP)))
            coarse = _SIGN_COARSE if "f1" in optional else 1
            sub *= coarse
            inputs = _inputs(*self._track, rate, sub, self.samples)
            phi, grown = averages(self.run.phi[self.first :][: self.samples * self.mean], self.mean)
            sd = np.array([row_sd_of(self.rig, self.mean)])
            kernel = kernel_of(compiled_of(DEFAULT), tuple(name for name in optional if name != PLAY))
            if PLAY in optional:
                kernel = PlayedKernel(kernel, "rad")
            measured = Measured(phi[:, None], sd, inputs, rate, sub, grown, coarse, self.stretches)
            self._problems[optional] = Problem(kernel, measured, self.budget)
        return self._problems[optional]

    def r(self, problem: Problem, values: Mapping[str, float]) -> Float:
        """r and its settings from values by name, with the widest sign."""
        made = problem.kernel.made
        names = [*(one.name for one in made.parameters), *made.settings]
        r = np.array([{"l1": self.rig.l1, **values}.get(name, 0.0) for name in names])
        return self.with_width(problem, r, _WIDTHS[0])

    def with_width(self, problem: Problem, r: Float, share: float) -> Float:
        """r with this width of the signs."""
        out = r.copy()
        out[problem.kernel.widths] = share * 2 * np.pi * self.fast * float(np.nanstd(self.run.phi))
        return out

    def prior(self, problem: Problem, r: Float, free: Sequence[str] | None = None) -> Prior:
        """About r, wide; of these parameters, or of all but the widths of signs."""
        made = problem.kernel.made
        sd = np.array([3 * (WIDTH_SD if one.sign else LOG_SD) if one.log else _SD[one.name] for one in made.parameters])
        searched = np.array([one.name in free if free is not None else not one.sign for one in made.parameters])
        return Prior(r, sd, searched)

    def prior_at(self, problem: Problem, found: Refined) -> Prior:
        """About an outcome; of the parameters that were searched and determined."""
        prior = self.prior(problem, found.r)
        return Prior(found.r, prior.sd, np.diag(found.covariance) > 0)

    def longer(self, problem: Problem, found: Refined) -> int:
        """Of the next blocks [samples]."""
        return min(_LONGER * found.cut.samples, problem.longest)

    def can_grow(self, problem: Problem, found: Refined) -> bool:
        """Whether blocks can be longer, and there is work left."""
        return problem.cut(self.longer(problem, found)).samples > found.cut.samples and not self.budget.is_spent

    def nearest(self) -> list[dict[str, float]]:
        """Where the shortest blocks fit best: what no equation has moves their parameters least."""
        return [values for _, values in sorted(self.short, key=lambda one: one[0])[:_NEAREST]]

    def lengths(self, slow_hz: float, shares: Sequence[float]) -> list[int]:
        """Of blocks [samples]."""
        return [max(8, round(share * _PERIODS / slow_hz * self.rate)) for share in shares]


def averages(x: Float, mean: int) -> tuple[Float, float]:
    """Averages of so many samples with their droop undone to second order, and the variance of one over that of an
    average."""
    if mean == 1:
        return x, 1.0
    c = (mean * mean - 1) / (24 * mean * mean)
    found = x.reshape(-1, mean).mean(1)
    found[1:-1] = (1 + 2 * c) * found[1:-1] - c * (found[2:] + found[:-2])
    return found, (1 + 2 * c) ** 2 + 2 * c * c


def refine_pendulum(
    run: Run, rig: RigFile, starts: Sequence[Mapping[str, float]], sure: bool = False
) -> RefinedPendulum:
    """Refines an estimate.

    Parameters
    ----------
    starts : values of w, d1, d2, c to start from, the likeliest first
    sure : the first one is an estimate that was published: others are tried where it leads nowhere. Else the search
        goes on until two of them agree on the best

    Raises
    ------
    PvidError
        When the run is too short, or no start leads anywhere.
    """
    model = rig.mechanism.model
    likeliest = np.array([starts[0][name] for name in model.mapped_names])
    search = _Search(run, rig, likeliest)
    problem = search.problem()
    outcomes = _outcomes(search, problem, starts, sure)
    if not outcomes:
        raise PvidError(TOO_LONG if search.budget.is_spent else "the refinement finds no motion that is like the run's")
    found, rivals = _of_outcomes(search, problem, outcomes)
    slow = model.modes_hz(found.r[:3])[0]
    if found.slow_chi2 > NOISE:
        problem, found = _with_options(search, problem, found)
    unsure = found.slow_chi2 > NOISE and _largest_error(found) > _UNSURE
    if found.slow_chi2 > GOOD or not found.converged or unsure:
        outcomes.sort(key=lambda one: one.chi2)
        reached = [_values_of(search.problem())(one) for one in outcomes[:2]]
        about = reached[:1] if sure else [*search.nearest(), *reached, *starts][:_DRY_STARTS]
        problem, found = _with_friction(search, (problem, found), about)
        slow = model.modes_hz(found.r[:3])[0]
    found, rubbing = _with_rivals(search, problem, found)
    if found.slow_chi2 > NOISE:
        found = _shorter(problem, search.prior_at(problem, found), found, search.lengths(slow, _SHORTER))
    elif found.converged and not rivals:
        found = _longer(search, problem, found)
    if np.isfinite(found.sum_of_squares):
        found = _without_push(problem, search.prior_at(problem, found), found)
    if problem is not search.problem():  # other parameters were freed since
        rivals = ()
    return RefinedPendulum(problem, found, search.first, (*rivals, *rubbing), search.breaks)


def _outcomes(
    search: _Search,
    problem: Problem,
    starts: Sequence[Mapping[str, float]],
    sure: bool,
    more: tuple[str, ...] = (),
) -> list[Refined]:
    """Searches from the starts in turn, until one fits that is sure, or two agree. `more`: parameters that are
    searched besides w, d1, d2 and the zero."""
    outcomes: list[Refined] = []
    for values in starts:
        if search.budget.is_spent:
            break
        found = _searched(search, problem, values, more)
        if found is None:
            continue
        outcomes.append(found)
        best = _likeliest(outcomes)
        agreeing = sum(_is_same(one, best) for one in outcomes)
        if best.slow_chi2 < _BOUND and (sure or agreeing > 1):
            break
    return outcomes


def _of_outcomes(search: _Search, problem: Problem, outcomes: Sequence[Refined]) -> tuple[Refined, tuple[Refined, ...]]:
    """The best of the outcomes that explain the run about as well, in blocks of full length. Where several do,
    blocks are lengthened, and those that then still explain it about as well are returned too."""
    least = _likeliest(outcomes).chi2
    alike = sorted((one for one in outcomes if one.chi2 <= _ALIKE * least), key=lambda one: one.chi2)
    wholes: list[Refined] = []
    for one in alike[:_MOST_ALIKE]:
        whole, prior = _whole(search, problem, one, search.rig.mechanism.model.modes_hz(one.r[:3])[0])
        whole = without_outliers(problem, prior, whole)
        if not any(_is_same(whole, other) for other in wholes):
            wholes.append(whole)
    noise = [one for one in wholes if one.converged and one.slow_chi2 < NOISE]
    if len(noise) < 2:
        return _likeliest(wholes), ()
    ends = [_longer(search, problem, one) for one in noise]
    longest = min(ends, key=lambda one: len(one.cut.first))
    cut, use = longest.cut, gated(problem, longest) & problem.used(longest.cut)
    there = [
        problem.searched(one.r, search.prior_at(problem, one), cut, problem.starts_along(one.r, one, cut), use)
        for one in ends
    ]
    best = min(there, key=lambda one: one.sum_of_squares)
    return best, explaining(there, best)


def _is_same(one: Refined, other: Refined) -> bool:
    """Whether w, d1, d2 agree."""
    return bool((np.abs(one.r[:3] / other.r[:3] - 1) < _SAME).all())


def _likeliest(outcomes: Sequence[Refined]) -> Refined:
    return min(outcomes, key=lambda one: one.chi2)


def _values_of(problem: Problem) -> Callable[[Refined], dict[str, float]]:
    """Parameters of an outcome by name."""
    names = [one.name for one in problem.kernel.made.parameters]
    return lambda found: dict(zip(names, map(float, found.r), strict=False))


def _with_friction(
    search: _Search, before: tuple[Problem, Refined], starts: Sequence[Mapping[str, float]]
) -> tuple[Problem, Refined]:
    """Searches in which friction is free from the first block on; the one before where they explain no more."""
    problem = search.problem(_DRY)
    outcomes = _outcomes(search, problem, starts, True, _FRICTIONS)
    if not outcomes:
        return before
    found = _likeliest(outcomes)
    slow = search.rig.mechanism.model.modes_hz(found.r[:3])[0]
    found, prior = _whole(search, problem, found, slow, _FRICTIONS)
    found = _sharper(search, problem, prior, found)
    problem, found = _with_options(search, problem, without_outliers(problem, prior, found), _DRY)
    return (problem, found) if found.converged and found.slow_chi2 < before[1].slow_chi2 else before


def _sharper(search: _Search, problem: Problem, prior: Prior, found: Refined) -> Refined:
    """With narrower signs of the friction as long as they explain more."""
    for share in _WIDTHS[1:]:
        r = search.with_width(problem, found.r, share)
        again = problem.searched(r, prior, found.cut, found.starts, problem.used(found.cut), most=_OPTION_PASSES)
        if not again.sum_of_squares < found.sum_of_squares:
            break
        found = again
    found, prior = softened(problem, prior, found, problem.used(found.cut))
    return _without_push(problem, prior, found)


def _with_rivals(search: _Search, problem: Problem, found: Refined) -> tuple[Refined, tuple[Refined, ...]]:
    """The best of the frictions that a search from the widest sign on leads through, and those that explain about as
    much: the sum of squares has a flat valley where the mechanism is at rest for long."""
    names = [one.name for one in problem.kernel.made.parameters]
    if "f1" not in names or not np.isfinite(found.sum_of_squares):
        return found, ()
    prior = search.prior_at(problem, found)
    fixed = Prior(prior.r, prior.sd, prior.free & ~problem.is_width)
    cut, use = found.cut, gated(problem, found) & problem.used(found.cut)
    tried = [problem.searched(found.r, prior, cut, found.starts, use, most=_OPTION_PASSES)]
    again = tried[0]
    for share in _WIDTHS[:-1]:
        r = search.with_width(problem, again.r, share)
        again = problem.searched(r, fixed, cut, again.starts, use, most=_OPTION_PASSES)
        tried.append(again)
    best = min(tried, key=lambda one: one.sum_of_squares)
    best = problem.searched(best.r, prior, cut, best.starts, use)
    if not prior.free[problem.is_width].any():
        best, prior = softened(problem, prior, best, use)
    best = _without_push(problem, prior, best)
    if not best.converged or best.sum_of_squares > tried[0].sum_of_squares:
        best = found if found.converged else tried[0]
    return best, explaining(tried, best)


def _without_push(problem: Problem, prior: Prior, found: Refined) -> Refined:
    """Without frictions that would push: dry ones, and viscous ones by more than their standard errors."""
    place = {one.name: k for k, one in enumerate(problem.kernel.made.parameters)}
    errors = np.sqrt(np.diag(found.covariance))
    r, free = found.r.copy(), prior.free.copy()
    for name in place.keys() & set(_FRICTIONS):
        if found.r[place[name]] < (0.0 if name in _DRY else -errors[place[name]]):
            r[place[name]] = 0.0
            free[[place[name], place[_WIDTH_OF.get(name, name)]]] = False
    if np.array_equal(r, found.r, equal_nan=True):
        return found
    within = Prior(prior.r, prior.sd, free)
    use = gated(problem, found) & problem.used(found.cut)
    again = problem.searched(r, within, found.cut, found.starts, use)
    return again if again.converged or not found.converged else found


def _whole(
    search: _Search, problem: Problem, found: Refined, slow_hz: float, more: tuple[str, ...] = ()
) -> tuple[Refined, Prior]:
    """Blocks of full length; skew and frictions are free where that costs the others little, or explains much."""
    first = [*_FIRST, *more]
    prior = search.prior(problem, found.r, first)
    found = refined(problem, prior, search.lengths(slow_hz, (1.0,)), before=found)
    return _with_extras(search, problem, prior, found)


def _with_extras(search: _Search, problem: Problem, prior: Prior, found: Refined) -> tuple[Refined, Prior]:
    """Skew and frictions are free where that costs the others little, or explains much."""
    names = [one.name for one in problem.kernel.made.parameters]
    first = [name for name, free in zip(names, prior.free, strict=True) if free]
    for extras in (("tau", "k1", "k2"), ("k1", "k2"), ("tau",)):
        if any(one in first for one in extras):
            continue
        wide = search.prior(problem, found.r, first)
        fall, grown = problem.gain(found, wide, np.array([names.index(one) for one in extras]))
        factor = max(1.0, found.slow_chi2) if found.slow_chi2 < _BOUND else 1.0
        if grown[:3].max() < _CHEAP or fall > _TOLD * len(extras) * factor:
            first += extras
            prior = search.prior(problem, found.r, first)
            cut = found.cut
            found = problem.searched(found.r, prior, cut, found.starts, problem.used(cut))
    return found, prior


def _shorter(problem: Problem, prior: Prior, found: Refined, lengths: Sequence[int]) -> Refined:
    """Shorter blocks, in which an error of the drive grows less, where the standard errors fall."""
    best = found
    for samples in lengths:
        again = refined(problem, prior, [samples], before=found, most=_OPTION_PASSES)
        if np.isfinite(again.chi2) and _largest_error(again) < _largest_error(best):
            best = again
    return best


def _longer(search: _Search, problem: Problem, found: Refined) -> Refined:
    """Longer blocks, of which fewer starts are unknown, as long as residuals stay noise and the standard errors do not
    grow by more than their own uncertainty."""
    dry = [one.name in _DRY for one in problem.kernel.made.parameters]
    best, least = found, _largest_error(found)
    while search.can_grow(problem, found):
        prior = search.prior_at(problem, found)
        prior = Prior(prior.r, prior.sd, prior.free | dry)
        found = refined(problem, prior, [search.longer(problem, found)], before=found)
        if not np.isfinite(found.chi2):
            break
        found, prior = _with_extras(search, problem, prior, found)
        found = without_outliers(problem, prior, _without_push(problem, prior, found))
        if not (found.slow_chi2 < NOISE and _largest_error(found) < _GROWN * least):
            break
        if found.converged:
            best, least = found, min(least, _largest_error(found))
    return best


def _is_vague(found: Refined) -> bool:
    """Whether the noise alone makes w, d1 or d2 uncertain: the blocks are too short."""
    return not float(np.sqrt(np.diag(found.noise)[:3]).max()) < _VAGUE


def _largest_error(found: Refined) -> float:
    """Of the logarithms of w, d1, d2."""
    return float(np.sqrt(np.diag(found.covariance)[:3]).max())


def _searched(
    search: _Search, problem: Problem, values: Mapping[str, float], more: tuple[str, ...] = ()
) -> Refined | None:
    """w, d1, d2, the zero and `more` from a start by short blocks; None where it leads nowhere."""
    model = search.rig.mechanism.model
    p = np.array([values[name] for name in model.mapped_names])
    if not model.is_plausible(p):
        return None
    r = search.r(problem, values)
    prior = search.prior(problem, r, (*_FIRST, *more))
    wide = Prior(r, np.maximum(prior.sd, 1.0), prior.free)
    short, full = search.lengths(model.modes_hz(p)[0], _SEARCH)
    try:
        found = refined(problem, wide, [short], most=_SEARCH_PASSES)
        search.short.append((found.chi2, _values_of(problem)(found)))
        found = refined(problem, wide, [full], before=found, most=_SEARCH_PASSES)
        while _is_vague(found) and search.can_grow(problem, found):
            found = refined(problem, wide, [search.longer(problem, found)], before=found, most=_SEARCH_PASSES)
    except (PvidError, np.linalg.LinAlgError):
        return None
    if not np.isfinite(found.chi2) or not model.is_plausible(found.r[:3]):
        return None
    fits = search.lengths(model.modes_hz(found.r[:3])[0], (1.0,))[0] <= problem.longest
    return found if fits else None


def _with_options(
    search: _Search, problem: Problem, found: Refined, kept: tuple[str, ...] = ()
) -> tuple[Problem, Refined]:
    """With the optional extras that explain enough, beside those of `kept`: of each round the one that explains
    most."""
    while found.slow_chi2 >= NOISE and not search.budget.is_spent:
        tried: list[tuple[Problem, Prior, Refined, tuple[str, ...]]] = []
        for optional in _OPTIONS:
            if optional[0] in kept or any(one.slow_chi2 < NOISE for _, _, one, _ in tried):
                continue
            other, prior, again = _with_option(search, problem, found, (*kept, *optional))
            gained = found.sum_of_squares - again.sum_of_squares
            if np.isfinite(again.chi2) and gained > again.significant_fall * len(optional):
                tried.append((other, prior, again, optional))
        if not tried:
            break
        problem, prior, found, optional = min(tried, key=lambda one: one[2].sum_of_squares)
        found, kept = without_outliers(problem, prior, found), (*kept, *optional)
    if not found.converged:
        prior = search.prior_at(problem, found)
        found = problem.searched(found.r, prior, found.cut, found.starts, problem.used(found.cut))
        found = without_outliers(problem, prior, found)
    return problem, found


def _with_option(
    search: _Search, problem: Problem, found: Refined, optional: tuple[str, ...]
) -> tuple[Problem, Prior, Refined]:
    """With these extras, from an outcome of another problem."""
    other = search.problem(tuple(one for one in _EXTRAS if one in optional))
    r = search.r(other, _values_of(problem)(found))
    prior = search.prior(other, r)
    again = other.searched(r, prior, found.cut, found.starts, other.used(found.cut), most=_OPTION_PASSES)
    return other, prior, _sharper(search, other, prior, again) if "f1" in optional else again


def _inputs(t: Float, u: Float, rate: float, sub: int, samples: int) -> Inputs:
    """u and u' at the steps, of any skew, by a spline of order five through the filtered track."""
    from scipy.interpolate import PPoly, make_interp_spline  # takes a quarter of a second

    spline = PPoly.from_spline(make_interp_spline(t, u, k=5))  # four times faster
    slope = spline.derivative()
    at = np.arange(2 * sub * samples + 1) / (2 * sub * rate)
    kept: dict[float, tuple[Float, Float]] = {}

    def steps(fine: Float) -> Float:
        return np.ascontiguousarray(np.stack([fine[0:-2:2], fine[1:-1:2], fine[2::2]], 1)[..., None])

    def of(skew: float) -> tuple[Float, Float]:
        if skew not in kept:
            if len(kept) > 4:
                kept.pop(next(iter(kept)))
            when = np.clip(at + skew, t[0], t[-1])
            kept[skew] = steps(spline(when)), steps(slope(when))
        return kept[skew]

    return of
