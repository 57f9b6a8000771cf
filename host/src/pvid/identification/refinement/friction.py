"""Dry friction in a refinement: how sharp its sign is, which other frictions explain as much, and which would push."""

from __future__ import annotations

import numpy as np

from pvid.identification.refinement.fit import Prior, Problem, Refined, explaining, gated, softened
from pvid.identification.refinement.problems import Problems

_WIDTHS = (0.3, 0.1, 0.03, 0.01)  # of the sign of a dry friction, in turn: share of the joint's largest speed
_PASSES = 10


def sharper(every: Problems, problem: Problem, prior: Prior, found: Refined) -> Refined:
    """With narrower signs of the friction as long as they explain more."""
    for share in _WIDTHS[1:]:
        r = every.with_width(problem, found.r, share)
        again = problem.searched(r, prior, found.cut, found.starts, problem.used(found.cut), most=_PASSES)
        if not again.sum_of_squares < found.sum_of_squares:
            break
        found = again
    found, prior = softened(problem, prior, found, problem.used(found.cut))
    return without_push(every, problem, prior, found)


def with_rivals(every: Problems, problem: Problem, found: Refined) -> tuple[Refined, tuple[Refined, ...]]:
    """The best of the frictions that a search from the widest sign on leads through, and those that explain about as
    much: the sum of squares has a flat valley where the mechanism is at rest for long."""
    names = {one.name for one in problem.kernel.made.parameters}
    if not names & set(every.rubbing) or not np.isfinite(found.sum_of_squares):
        return found, ()
    prior = every.prior_at(problem, found)
    fixed = Prior(prior.r, prior.sd, prior.free & ~problem.is_width)
    cut, use = found.cut, gated(problem, found) & problem.used(found.cut)
    tried = [problem.searched(found.r, prior, cut, found.starts, use, most=_PASSES)]
    again = tried[0]
    for share in _WIDTHS[:-1]:
        r = every.with_width(problem, again.r, share)
        again = problem.searched(r, fixed, cut, again.starts, use, most=_PASSES)
        tried.append(again)
    best = min(tried, key=lambda one: one.sum_of_squares)
    best = problem.searched(best.r, prior, cut, best.starts, use)
    if not prior.free[problem.is_width].any():
        best, prior = softened(problem, prior, best, use)
    best = without_push(every, problem, prior, best)
    if not best.converged or best.sum_of_squares > tried[0].sum_of_squares:
        best = found if found.converged else tried[0]
    return best, explaining(tried, best)


def without_push(every: Problems, problem: Problem, prior: Prior, found: Refined) -> Refined:
    """Without frictions that would push: dry ones, and viscous ones by more than their standard errors."""
    place = {one.name: k for k, one in enumerate(problem.kernel.made.parameters)}
    errors = np.sqrt(np.diag(found.covariance))
    r, free = found.r.copy(), prior.free.copy()
    for name in every.frictions(problem):
        width = every.width_of(name)
        if found.r[place[name]] < (0.0 if width else -errors[place[name]]):
            r[place[name]] = 0.0
            free[[place[name], place.get(width, place[name])]] = False
    if np.array_equal(r, found.r, equal_nan=True):
        return found
    within = Prior(prior.r, prior.sd, free)
    use = gated(problem, found) & problem.used(found.cut)
    again = problem.searched(r, within, found.cut, found.starts, use)
    return again if again.converged or not found.converged else found
