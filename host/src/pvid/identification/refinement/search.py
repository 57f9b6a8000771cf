"""The refinement of any mechanism: from which starts, in which blocks, with which of its extras.

Where the weak form determines every parameter and one fit from its estimate leaves residuals of noise, that is all;
also where the rows of the weak form explain the recording, and this fit does not: no extra explains more. Else searches
begin at several starts, in blocks that grow; where residuals are more than noise, optional extras are
tried, the play of a sensor, dry friction (pvid.identification.refinement.friction), and shorter blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.refine import is_driven_by_derivatives
from pvid.identification.answer import Analysis
from pvid.identification.refinement.fit import (
    GOOD,
    NOISE,
    Prior,
    Problem,
    Refined,
    explaining,
    gated,
    refined,
    without_outliers,
)
from pvid.identification.refinement.friction import sharper, with_rivals, without_push
from pvid.identification.refinement.problem import RefinedMechanism, refine_mechanism, softer
from pvid.identification.refinement.problems import Problems, Values
from pvid.identification.refinement.starts import starts_of, weak_start

Float = npt.NDArray[np.float64]

_SEARCH = (0.15, 0.4)  # of a whole block: blocks of the search for the unknowns of the weak form alone
_SEARCH_PASSES = 12
_VAGUE = 0.1  # largest standard error of a logarithm from which a search goes on with longer blocks
_BOUND = 1.5  # slow chi^2 of a search that needs no other start
_ALIKE = 1.1  # times the least chi^2 of the searches: longer blocks show which of those up to it is right
_MOST_ALIKE = 4
_SAME = 0.02  # two searches agree: relative difference of all main parameters
_RUBBING_STARTS = 4  # of a search with dry friction
_NEAREST = 2  # of them from the shortest blocks
_OPTION_PASSES = 10
_SHORTER = (0.5, 0.25)  # of a whole block: tried where the residuals are larger than the sensors' noise
_LONGER = 3  # times a block: tried where they are not
_GROWN = 1.25  # of standard errors: by which those of two lengths of a block differ by chance
_BY_CHANCE = 4.0  # standard deviations of a chi^2: by so much the sum of squares rises with fewer starts
_CHEAP = 1.3  # growth of the others' standard errors up to which an extra is free
_TOLD = 9.0  # fall of the sum of squares from which it is free in any case
_UNSURE = 0.05  # standard error of a logarithm from which friction is searched where residuals are no noise

# Mean square of slow residuals in short blocks, over that of the sensors' noise, from which a motion that is not found
# is another one; and the part of the budget after which no further start is tried then.
_UNLIKE, _TRIED = 1e4, 0.1

TOO_LONG = "the refinement needs too many steps: the recording is long, or the guess has too fast a motion"


def refine(answer: Analysis) -> RefinedMechanism:
    """Refines the weak form's answer.

    Raises PvidError when the equations have no refinement, the recording is too short for it, or no start leads
    anywhere.
    """
    model, weak, recording = answer.model, answer.found, answer.recording
    model.refuse_drifts("the refinement")
    sure = all(one.status != "not_identified" for one in weak.judged)
    small = {k for k, one in enumerate(weak.judged) if one.status == "near_zero"}
    first = None
    if not is_driven_by_derivatives(model) and np.isfinite(weak_start(weak)).all():
        block_s = 2 * weak.design.window_s
        first = refine_mechanism(model, recording.run, recording.sample_rate, weak_start(weak), block_s)
        if sure and first.found.converged and first.found.slow_chi2 <= NOISE:
            return replace(first, main=tuple(_main(first.problem, small)))
    starts = list(starts_of(model, weak, recording.run))
    problems = Problems(model, recording.run, recording.sample_rate, starts, weak.design.window_s)
    explained = sure and weak.chi2 <= GOOD
    return _Search(problems, starts, sure, small, explained).outcome_from(None if first is None else first.found)


class _Search:
    """One recording; `sure`: the first start is an estimate of all parameters, and others are tried where it leads
    nowhere. Else the search goes on until two of them agree on the best. `small`: places in p of parameters near 0.
    `explained`: the rows of the weak form leave noise alone."""

    def __init__(
        self, problems: Problems, starts: Sequence[Float], sure: bool, small: set[int], explained: bool
    ) -> None:
        self._all, self._sure, self._small, self._explained = problems, sure, small, explained
        self._starts = [problems.values_of_p(p) for p in starts]
        self._short: list[tuple[float, Values]] = []  # chi^2 and values of the shortest blocks, of each start

    def outcome_from(self, first: Refined | None) -> RefinedMechanism:
        """The whole search; `first`: an outcome of the base problem that is known already."""
        every = self._all
        problem = every.problem()
        base, outcomes = problem, [] if first is None or not np.isfinite(first.chi2) else [first]
        settled = self._sure and first is not None and first.converged
        rivals: tuple[Refined, ...] = ()
        if first is not None and settled:
            found = first
        else:
            starts = self._starts[:1] if self._explained else self._starts
            outcomes = self._outcomes(problem, starts, self._sure, known=outcomes)
            if _are_unlike(outcomes):
                spent = every.budget.is_spent
                raise PvidError(TOO_LONG if spent else "the refinement finds no motion that is like the recorded one")
            found, rivals = self._of_outcomes(problem, outcomes)
        if self._explained and every.has_own_equations and found.slow_chi2 > GOOD:
            return RefinedMechanism(problem, found, tuple(_main(problem, self._small)), breaks=every.breaks)
        if found.slow_chi2 > NOISE:
            problem, found = self._with_options(problem, found)
        unsure = found.slow_chi2 > NOISE and self._largest_error(problem, found) > _UNSURE
        if every.rubbing and (found.slow_chi2 > GOOD or not found.converged or unsure):
            outcomes.sort(key=lambda one: one.chi2)
            reached = [every.values(base, one) for one in outcomes[:2]]
            about = reached[:1] if self._sure else [*self._nearest(), *reached, *self._starts][:_RUBBING_STARTS]
            problem, found = self._with_friction((problem, found), about)
        found, rubbing = with_rivals(every, problem, found)
        if settled:
            pass
        elif found.slow_chi2 > NOISE:
            found = self._shorter(problem, found)
        elif found.converged and not rivals:
            found = self._longer(problem, found)
        if np.isfinite(found.sum_of_squares):
            found = without_push(every, problem, every.prior_at(problem, found), found)
        if problem is not base:  # other parameters were freed since
            rivals = ()
        main = tuple(_main(problem, self._small))
        return RefinedMechanism(problem, found, main, (*rivals, *rubbing), every.breaks)

    # ---- starts

    def _outcomes(
        self,
        problem: Problem,
        starts: Sequence[Values],
        sure: bool,
        more: tuple[str, ...] = (),
        known: Sequence[Refined] = (),
    ) -> list[Refined]:
        """Searches from the starts in turn, until one fits that is sure, or two agree. `more`: parameters that are
        searched besides those of the weak form. `known`: outcomes before."""
        outcomes = list(known)
        for values in starts:
            budget = self._all.budget
            if budget.is_spent or (_are_unlike(outcomes) and budget.left < (1 - _TRIED) * budget.whole):
                break
            found = self._searched(problem, values, more)
            if found is None:
                continue
            outcomes.append(found)
            best = _likeliest(outcomes)
            agreeing = sum(self._is_same(problem, one, best) for one in outcomes)
            if best.slow_chi2 < _BOUND and (sure or agreeing > 1):
                break
        return outcomes

    def _searched(self, problem: Problem, values: Values, more: tuple[str, ...]) -> Refined | None:
        """The unknowns of the weak form and `more` from a start by short blocks; None where it leads nowhere."""
        every = self._all
        try:
            r = every.r(problem, values)
            if not problem.kernel.possible(r):
                return None
            prior = every.prior(problem, r, [*every.first, *more])
            wide = Prior(r, np.maximum(prior.sd, 1.0), prior.free)
            short, full = every.lengths(r, problem, _SEARCH)
            found = refined(problem, wide, [short], most=_SEARCH_PASSES)
            self._short.append((found.chi2, every.values(problem, found)))
            found = refined(problem, wide, [full], before=found, most=_SEARCH_PASSES)
            while self._is_vague(problem, found) and self._can_grow(problem, found):
                found = refined(problem, wide, [_longer(problem, found)], before=found, most=_SEARCH_PASSES)
        except (PvidError, np.linalg.LinAlgError):
            return None
        if not np.isfinite(found.chi2) or not problem.kernel.possible(found.r):
            return None
        return found if every.lengths(found.r, problem, (1.0,))[0] <= problem.longest else None

    def _nearest(self) -> list[Values]:
        """Where the shortest blocks fit best: what no equation has moves their parameters least."""
        return [values for _, values in sorted(self._short, key=lambda one: one[0])[:_NEAREST]]

    def _of_outcomes(self, problem: Problem, outcomes: Sequence[Refined]) -> tuple[Refined, tuple[Refined, ...]]:
        """The best of the outcomes that explain the recording about as well, in blocks of full length. Where several
        do, blocks are lengthened, and those that then still explain it about as well are returned too."""
        every, least = self._all, _likeliest(outcomes).chi2
        alike = sorted((one for one in outcomes if one.chi2 <= _ALIKE * least), key=lambda one: one.chi2)
        wholes: list[Refined] = []
        for one in alike[:_MOST_ALIKE]:
            whole, prior = self._whole(problem, one)
            whole = without_outliers(problem, prior, whole)
            if not any(self._is_same(problem, whole, other) for other in wholes):
                wholes.append(whole)
        noise = [one for one in wholes if one.converged and one.slow_chi2 < NOISE]
        if len(noise) < 2:
            return _likeliest(wholes), ()
        ends = [self._longer(problem, one) for one in noise]
        longest = min(ends, key=lambda one: len(one.cut.first))
        cut, use = longest.cut, gated(problem, longest) & problem.used(longest.cut)
        there = [
            problem.searched(one.r, every.prior_at(problem, one), cut, problem.starts_along(one.r, one, cut), use)
            for one in ends
        ]
        best = min(there, key=lambda one: one.sum_of_squares)
        return best, explaining(there, best)

    def _is_same(self, problem: Problem, one: Refined, other: Refined) -> bool:
        """Whether the main parameters agree."""
        apart = problem.step_between(other.r, one.r)[_main(problem, self._small)]
        return bool((np.abs(np.expm1(apart)) < _SAME).all())

    # ---- extras

    def _with_options(self, problem: Problem, found: Refined, kept: tuple[str, ...] = ()) -> tuple[Problem, Refined]:
        """With the optional extras that explain enough, beside those of `kept`: of each round those that explain
        most."""
        every = self._all
        while found.slow_chi2 >= NOISE and not every.budget.is_spent:
            tried: list[tuple[Problem, Prior, Refined, tuple[str, ...]]] = []
            for optional in every.options:
                if optional[0] in kept or any(one.slow_chi2 < NOISE for _, _, one, _ in tried):
                    continue
                other, prior, again = self._with_option(problem, found, (*kept, *optional))
                gained = found.sum_of_squares - again.sum_of_squares
                if np.isfinite(again.chi2) and gained > again.significant_fall * len(optional):
                    tried.append((other, prior, again, optional))
            if not tried:
                break
            problem, prior, found, optional = min(tried, key=lambda one: one[2].sum_of_squares)
            found, kept = without_outliers(problem, prior, found), (*kept, *optional)
        if not found.converged and np.isfinite(found.sum_of_squares):
            prior = every.prior_at(problem, found)
            found = problem.searched(found.r, prior, found.cut, found.starts, problem.used(found.cut))
            found = without_outliers(problem, prior, found)
        return problem, found

    def _with_option(
        self, problem: Problem, found: Refined, optional: tuple[str, ...]
    ) -> tuple[Problem, Prior, Refined]:
        """With these extras, from an outcome of another problem."""
        every = self._all
        other = every.problem(optional)
        r = every.r(other, every.values(problem, found))
        prior = every.prior(other, r)
        again = other.searched(r, prior, found.cut, found.starts, other.used(found.cut), most=_OPTION_PASSES)
        rubs = bool(set(every.rubbing) & set(optional))
        return other, prior, sharper(every, other, prior, again) if rubs else again

    def _with_friction(self, before: tuple[Problem, Refined], starts: Sequence[Values]) -> tuple[Problem, Refined]:
        """Searches in which friction is free from the first block on; the one before where they explain no more."""
        every = self._all
        problem = every.problem(every.rubbing)
        frictions = tuple(every.frictions(problem))
        outcomes = self._outcomes(problem, starts, True, frictions)
        if not outcomes:
            return before
        found, prior = self._whole(problem, _likeliest(outcomes), frictions)
        found = sharper(every, problem, prior, found)
        problem, found = self._with_options(problem, without_outliers(problem, prior, found), every.rubbing)
        return (problem, found) if found.converged and found.slow_chi2 < before[1].slow_chi2 else before

    def _with_extras(self, problem: Problem, prior: Prior, found: Refined) -> tuple[Refined, Prior]:
        """Skew and frictions are free where that costs the others little, or explains much."""
        every, names = self._all, [one.name for one in problem.kernel.made.parameters]
        first = [name for name, free in zip(names, prior.free, strict=True) if free]
        for extras in every.groups:
            if any(one in first for one in extras):
                continue
            wide = every.prior(problem, found.r, first)
            fall, grown = problem.gain(found, wide, np.array([names.index(one) for one in extras]))
            factor = max(1.0, found.slow_chi2) if found.slow_chi2 < _BOUND else 1.0
            free = np.flatnonzero(wide.free)
            main = np.isin(free, _main(problem, self._small))
            if grown[main].max(initial=0.0) < _CHEAP or fall > _TOLD * len(extras) * factor:
                first += extras
                prior = every.prior(problem, found.r, first)
                cut = found.cut
                found = problem.searched(found.r, prior, cut, found.starts, problem.used(cut))
        return found, prior

    # ---- lengths of blocks

    def _whole(self, problem: Problem, found: Refined, more: tuple[str, ...] = ()) -> tuple[Refined, Prior]:
        """Blocks of full length; skew and frictions are free where that costs the others little, or explains much."""
        every = self._all
        prior = every.prior(problem, found.r, [*every.first, *more])
        found = refined(problem, prior, every.lengths(found.r, problem, (1.0,)), before=found)
        if every.is_sharp(problem):
            found, prior = softer(problem, prior, found)
        return self._with_extras(problem, prior, found)

    def _shorter(self, problem: Problem, found: Refined) -> Refined:
        """Shorter blocks, in which an error of the drive grows less, where the standard errors fall."""
        every, best = self._all, found
        if not np.isfinite(found.sum_of_squares):
            return found
        prior = every.prior_at(problem, found)
        for samples in every.lengths(found.r, problem, _SHORTER):
            again = refined(problem, prior, [samples], before=found, most=_OPTION_PASSES)
            if np.isfinite(again.chi2) and self._largest_error(problem, again) < self._largest_error(problem, best):
                best = again
        return best

    def _longer(self, problem: Problem, found: Refined) -> Refined:
        """Longer blocks, of which fewer starts are unknown, as long as residuals stay noise and the standard errors do
        not grow by more than their own uncertainty; with a dry friction, whose errors at reversals grow along a block,
        as long as the sum of squares rises by no more than fewer starts explain."""
        every = self._all
        dry = np.array([bool(every.width_of(one.name)) for one in problem.kernel.made.parameters])
        best, least = found, self._largest_error(problem, found)
        while self._can_grow(problem, found):
            prior = every.prior_at(problem, found)
            prior = Prior(prior.r, prior.sd, prior.free | dry)
            found = refined(problem, prior, [_longer(problem, found)], before=found)
            if not np.isfinite(found.chi2):
                break
            found, prior = self._with_extras(problem, prior, found)
            found = without_outliers(problem, prior, without_push(every, problem, prior, found))
            if not (found.slow_chi2 < NOISE and self._largest_error(problem, found) < _GROWN * least):
                break
            fewer = problem.kernel.states * (len(best.cut.first) - len(found.cut.first))
            rise = found.sum_of_squares - best.sum_of_squares
            if problem.kernel.widths and rise > fewer + _BY_CHANCE * np.sqrt(2 * fewer):
                break
            if found.converged:
                best, least = found, min(least, self._largest_error(problem, found))
        return best

    def _can_grow(self, problem: Problem, found: Refined) -> bool:
        """Whether blocks can be longer, and there is work left."""
        return problem.cut(_longer(problem, found)).samples > found.cut.samples and not self._all.budget.is_spent

    def _is_vague(self, problem: Problem, found: Refined) -> bool:
        """Whether the noise alone makes a main parameter uncertain: the blocks are too short."""
        main = _main(problem, self._small)
        return not float(np.sqrt(np.diag(found.noise)[main]).max(initial=0.0)) < _VAGUE

    def _largest_error(self, problem: Problem, found: Refined) -> float:
        """Of the logarithms of the main parameters."""
        return float(np.sqrt(np.diag(found.covariance)[_main(problem, self._small)]).max(initial=0.0))


def _main(problem: Problem, small: set[int]) -> list[int]:
    """Places of the positive unknowns that are not near 0."""
    parameters = problem.kernel.made.parameters
    return [k for k, one in enumerate(parameters) if one.place >= 0 and one.log and one.place not in small]


def _longer(problem: Problem, found: Refined) -> int:
    """Of the next blocks [samples]."""
    return min(_LONGER * found.cut.samples, problem.longest)


def _are_unlike(outcomes: Sequence[Refined]) -> bool:
    """Whether no start has led to a motion that is like the recorded one."""
    return not any(one.converged or one.slow_chi2 < _UNLIKE for one in outcomes)


def _likeliest(outcomes: Sequence[Refined]) -> Refined:
    return min(outcomes, key=lambda one: one.chi2)
