"""What do the equations lack, which parameters are off without it, and is that inside their standard errors?

The largest shift of the plausible candidates is the model's part of the standard errors. An answer is to be doubted
where that part is larger than all others and visible: relevance, not significance, and no constant on chi^2.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle.weak import work
from pvid.oracle.weak.choice import NOISE
from pvid.oracle.weak.errors import chi2_of_sensors, inflation, uncertainty
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.library import Library
from pvid.oracle.weak.rows import EquationError
from pvid.oracle.weak.scores import FOLDS, Scores
from pvid.oracle.weak.solve import Fit, of_fit, resumed
from pvid.oracle.weak.terms import (
    CONSTANT,
    JUMPS,
    OF_LOAD,
    OF_PARAMETER,
    UNUSUAL,
    UNUSUAL_KINDS,
    Act,
    Candidate,
    Course,
)

# A term is there. The verdicts of 100 recordings stay the same for 4 to 20 standard errors, for shares from 0.003 to
# 0.05, and with 0.3 to 0.8 of the best. What p imitates needs more, as what is small beside it is amplified.
_CERTAIN = 6.0  # |size| over its standard error
# Of a size beyond the limit, where the residuals are within the sensors' noise; of one that is six of its standard
# errors besides, by how large that noise is.
_CHANCE, _CHANCE_BESIDES = 1e-8, 1e-6
_EMPTY = 0.3  # of the equations' own terms: a term that leaves less of them takes their place
_BY_NOISE = 0.5  # of what a term explains: noise that is in it and in the residuals
_SHARE = 0.01  # of the residuals' energy on unseen windows
_PLAUSIBLE = 0.5  # of the best candidate's share: what may be meant as well

MOVES = 2.0  # standard errors
VISIBLE = 0.01  # of the value

# Terms are named by fits with them.
_MOST_TERMS = 3
_LARGE = 0.05  # share of a term that is named even if it moves no parameter
_FAMILIES = 5  # that are fitted for each
_TRIED = 0.3  # of the best share
_DISTINCT = 0.01  # of a column's square, that is its own: a term with less is the parameters in another guise
_SAME = 0.9999  # cosine of two columns, beside all parameters, that no run tells apart
_RIVAL = 0.9  # of the best gain of likelihood
# The same of what changes: its course is one of few, and what that leaves is no sign against another; and of delays and
# lags: what corrects a noisy signal adds to its noise.
_ALIKE = 0.5
_EQUAL, _BY_LUCK = 0.9999, 4.0  # of the best gain: the same column; what a gain is less or more by chance
_MOST_RIVALS = 5
_STAND_IN = 1.5  # times the chi^2 that is left with a term: without it no more is left, as it stood in for a later one
_NOTICED = 1.5  # chi^2 from which a term that explains much is looked for
# Of the residuals beyond it: a law that imitates the missing one explains half to nine tenths of them.
_ALL, MOST = 0.95, 0.9
_ROUNDS = 6  # of a size
_SETTLED = 0.01  # of a size
_NOTHING = 0.01  # of a parameter
_BEYOND = 1.5  # times the largest level that is tried, or over the smallest one
_AT_REST = 0.05  # of the variance of an equation's error
_FACTORS, _STEPS = (1.25, 1.08, 1.025), 4  # of a level, as often as it gets better
_PART = 0.01  # of a level: a step that gives its slope
_HALVINGS = 4  # of the distance of two jumps
_PASSES = 3  # of whitening in a fit that begins near its end


def _is_visible(shift: Float, se: Float, p: Float) -> npt.NDArray[np.bool_]:
    return (shift > MOVES * se) & (shift > VISIBLE * np.abs(p))


def _by_chance(windows: float, surest: float, normal: float) -> float:
    """Standard errors, from the scatter of so many windows, that nothing reaches by chance: Student's, or the normal
    distribution's where the surest term does not even reach those."""
    return normal if surest <= normal else student(windows)


def student(freedom: float, chance: float = _CHANCE) -> float:
    """What Student's t exceeds with a probability; scipy's takes a sixth of a second to import.

    With t = sqrt(f) cot(a) the probability is the integral of sin^(f - 1) from 0 to a, over that up to pi.
    """
    nodes, weights = np.polynomial.legendre.leggauss(100)
    whole = math.lgamma(freedom / 2) - math.lgamma((freedom + 1) / 2) + math.log(math.pi) / 2
    low, high = 0.0, math.pi / 2
    for _ in range(60):
        angle = (low + high) / 2
        powers = np.exp((freedom - 1) * np.log(np.sin(angle * (nodes + 1) / 2)) - whole)
        low, high = (low, angle) if angle / 2 * float(weights @ powers) > chance else (angle, high)
    return math.sqrt(freedom) / math.tan(high)


@dataclass(frozen=True)
class Missing:
    """The meaning of scored candidates for an estimate.

    Attributes
    ----------
    there : candidates that count, that of the largest share first
    shifts : what p moves by with each plausible one [plausible, n_p]
    visible : parameters that it moves by more than their standard errors cover and by more than is tolerated [n_p]
    scores : of the estimate
    se : its standard errors, without those shifts [n_p]
    """

    there: tuple[Candidate, ...]
    shifts: Float
    visible: npt.NDArray[np.bool_]
    scores: Scores
    se: Float

    @classmethod
    def of(cls, library: Library, se: Float, fit: Fit | None = None) -> Missing:
        """For the estimate of a library, with standard errors se [n_p], or for one with terms that were added.

        What is left of such a term goes to the terms of which p explains most: those count no more.
        """
        scores = library.scores if fit is None else Scores(fit)
        scored, p = scores.of(library.candidates), scores.fit.p
        chi2 = chi2_of_sensors(scores.fit)
        doubtful = chi2 < NOISE  # the residuals are no sign that anything is missing
        # Standard errors from the scatter of few windows, which overlap, are themselves uncertain; those of the
        # sensors' noise are not, where it is what is left.
        surest = max((one.certainty for one in scored), default=0.0)
        normal, besides = (-NormalDist().inv_cdf(one) for one in (_CHANCE, _CHANCE_BESIDES))
        least = _by_chance(len(scores.residuals) / 2, surest, normal) if doubtful else _CERTAIN
        overlap = inflation(scores.fit) ** 0.5 if doubtful and least > normal else 1.0

        def sureness(one: Candidate) -> float:
            by_noise = 0.0
            if doubtful and np.any(np.abs(one.shift) > VISIBLE * np.abs(p)):
                by_noise = min(one.certainty / normal, one.by_noise / overlap / besides)
            return max(one.certainty / least, by_noise)

        possible = [
            one
            for one in scored
            if sureness(one) > 1
            if one.share > _SHARE and one.folds >= FOLDS - 1
            if fit is None or one.own > _DISTINCT
            if scores.leaves(one) > _EMPTY
            if one.share * chi2 * _BY_NOISE**2 > 1  # the noise in it explains at most 1 / chi2
            or scores.by_noise(one, library.noise, library.noise_in(one)) < _BY_NOISE
        ]
        leads = [not doubtful or sureness(one) > (_DISTINCT / max(one.own, 1e-300)) ** 0.5 for one in possible]
        best = next((one.share for one, own in zip(possible, leads, strict=True) if own), np.inf)
        there = tuple(
            one for one, own in zip(possible, leads, strict=True) if own or one.share > max(_RIVAL * best, _LARGE)
        )
        plausible = [one for one in there if one.share >= _PLAUSIBLE * there[0].share]
        shifts = np.array(
            [one.shift for one in plausible if one.own > _DISTINCT or one.share > _RIVAL * there[0].share]
        ).reshape(-1, len(p))
        visible = _is_visible(np.max(np.abs(shifts), axis=0, initial=0.0), se, p)
        return cls(there, shifts, visible, scores, se)

    def also(self, shift: Float) -> Missing:
        """With one more plausible shift of p [n_p]."""
        return replace(self, shifts=np.append(self.shifts, shift[np.newaxis], axis=0))

    def by_fit(self, p: Float) -> Missing:
        """With the shift to p [n_p] of a fit that has the terms: what scored to first order may move it further."""
        begun = self.scores.fit.p
        return replace(self.also(p - begun), visible=self.visible | _is_visible(np.abs(p - begun), self.se, begun))

    @property
    def error(self) -> Float:
        """The model's part of the standard errors: largest of the shifts [n_p]."""
        return np.asarray(np.max(np.abs(self.shifts), axis=0, initial=0.0))

    @property
    def is_large(self) -> bool:
        """Whether a term explains much of what the sensors' noise does not, whether or not it moves a parameter."""
        return bool(self.there) and self.there[0].share > _LARGE and chi2_of_sensors(self.scores.fit) > _NOTICED

    def groups(self) -> list[list[Candidate]]:
        """Families that may be meant, of each its best, those together that no run tells apart; in each group, and of
        the groups, the one of the largest share first.

        What p imitates leads no group: it would take p's place.
        """
        best: dict[tuple[str, str, str], Candidate] = {}
        tried = [one for one in self.there if one.share >= _TRIED * self.there[0].share]
        # Of levels one that is no guise of p, and of those that explain the same, the one that is most of its own.
        first = {id(one): (one.own <= _DISTINCT, -round(one.share / tried[0].share, 2), -one.own) for one in tried}
        for one in sorted(tried, key=lambda one: first[id(one)]):
            best.setdefault(one.family, one)
        families = sorted(best.values(), key=lambda one: -one.share)
        if not families:
            return []
        columns = self.scores.rests(families)
        same = np.abs(columns @ columns.T) > _SAME
        out: list[list[int]] = []
        for place in range(len(families)):
            own = next((group for group in out if same[group[0], place]), None)
            if own is None:
                out.append([place])
            else:
                own.append(place)
        return [[families[place] for place in group] for group in out]


@dataclass(frozen=True)
class Named:
    """A term in place of what was unexplained.

    Attributes
    ----------
    chosen : with the size, or the level, of most likelihood
    error : of that number
    rivals : of other families, that explain about as much
    """

    chosen: Candidate
    error: float
    rivals: tuple[Candidate, ...]


@dataclass(frozen=True)
class Explained:
    """Terms that were added one after the other.

    Attributes
    ----------
    named : in this order
    fit : with all of them
    further : with what still seems to be lacking then and moves a parameter visibly, as far as it could be found
    instead : what p moves by with a rival in place of a term [rivals, n_p]
    share : of the residuals beyond the sensors' noise, that they remove
    complete : what is left of them moves no parameter by what is visible, or is next to nothing
    """

    named: tuple[Named, ...]
    fit: Fit
    further: Fit
    instead: tuple[Float, ...]
    share: float
    complete: bool


def explained(library: Library, found: Missing) -> Explained:
    """The terms that are missing, the likeliest first.

    What scored best to first order has the weights of a model that lacks it: several families are fitted anew, and the
    likelihood of the residuals with weights of their own decides between them.
    """
    fit, named, share, complete = library.fit, list[Named](), 0.0, False
    with_named, instead, excess = fit, list[Float](), chi2_of_sensors(fit) - 1
    for _ in range(_MOST_TERMS):
        before, begun = unlikelihood(fit), fit.p
        groups = found.groups()
        tellable = [one for one in groups if one[0].own > _DISTINCT or one[0].share > _PLAUSIBLE * groups[0][0].share]
        distinct = tellable[:_FAMILIES]
        # A lag is a delay to first order alone: which of them leads is rounding.
        leading = [one for group in distinct for one in group if one is group[0] or _is_in_time(one)]
        gains = _gains(library, fit, before, leading)
        if not gains:
            break
        best = next(group for group in distinct if gains[0][1].family in [one.family for one in group])
        others = [one for one in best[:_FAMILIES] if one not in leading]
        gains = sorted(gains + _gains(library, fit, before, others), key=lambda one: -one[0])
        alike = [one for one in gains if one[0] > _RIVAL * gains[0][0]]
        equal = min(_EQUAL * gains[0][0], gains[0][0] - _BY_LUCK)
        _, chosen, fit = min(alike, key=lambda one: (_is_unusual(one[1]), one[0] < equal, _plainness(one[1])))
        # Beside those: what is the same column as one of them, and what explains as much and was not tried.
        nearly = partial(_rival, chosen)
        families = [one.family for _, one, _ in alike]
        rivals = [one for gain, one, _ in gains if gain > nearly(one) * gains[0][0] and one.family != chosen.family]
        tried = [one.family for _, one, _ in gains]
        rivals += [
            one
            for group in groups
            for one in group
            if (group[0].family in families if group in distinct else one.share > nearly(one) * best[0].share)
            and one.family not in tried
        ]
        if not complete:
            named.append(Named(chosen, _error_of(library, chosen, fit), tuple(rivals[:_MOST_RIVALS])))
            refitted = {one.family: own.p for _, one, own in gains}
            instead += [refitted.get(one.family, begun + one.shift) - library.fit.p for one in rivals[:_MOST_RIVALS]]
            named, fit = _without_superfluous(library, named, fit)
        found = Missing.of(library, uncertainty(fit).se, fit)
        if not complete:
            with_named, left = fit, chi2_of_sensors(fit)
            share = 1 - max(left - 1, 0.0) / excess if excess > 0 else 1.0
            few = len(named) < _MOST_TERMS  # three terms imitate much
            changes = any(isinstance(one.chosen.kind, Course) for one in named)  # imitates what follows the amplitude
            complete = left < (_NOTICED if changes else NOISE)
            complete |= few and (share > _ALL or share > MOST and not changes and not found.visible.any())
        if complete and not found.visible.any():
            break
    return Explained(tuple(named), with_named, fit, tuple(instead), share, complete)


def _without_superfluous(library: Library, named: list[Named], fit: Fit) -> tuple[list[Named], Fit]:
    """Terms without those that only stood in for the last one: without them next to nothing more is left."""
    for one in named[:-1]:
        others, without = [other for other in named if other is not one], library.fit
        for place, other in enumerate(others):
            again = _refitted(library, without, other.chosen)
            if again is None:
                break
            others[place], without = replace(other, chosen=again[0]), again[1]
        else:
            if chi2_of_sensors(without) < max(_STAND_IN * chi2_of_sensors(fit), _NOTICED):
                others[-1] = replace(others[-1], error=_error_of(library, others[-1].chosen, without))
                return _without_superfluous(library, others, without)
    return named, fit


def _gains(
    library: Library, fit: Fit, before: float, candidates: Sequence[Candidate]
) -> list[tuple[float, Candidate, Fit]]:
    """What the likelihood gains by each, if anything, the candidate with its size, and the fit with it; the best first.

    Parameters
    ----------
    before : unlikelihood of the fit without it
    """
    tried = filter(None, (_refitted(library, fit, one) for one in candidates if not work.is_spent()))
    gains = [(before - unlikelihood(with_it), one, with_it) for one, with_it in tried]
    return sorted((one for one in gains if one[0] > 0), key=lambda one: -one[0])


def _error_of(library: Library, one: Candidate, with_it: Fit) -> float:
    """Standard error of a term's number, beside all parameters."""
    step = 1.0
    if one.leveled:
        assert isinstance(one.kind, Act)
        step = _PART * one.level
        other = library.act(library.recorded(one.signal), one.kind, one.level + step).changed
        near = one.changed

        def change(theta: Sequence[Float]) -> list[Float]:
            return [now - before for now, before in zip(other(theta), near(theta), strict=True)]

        one = replace(one, kind=replace(one.kind, levels=None), change=change)
    scored = Scores(with_it).of([one])[0]
    return abs(step * scored.size) / scored.certainty if scored.certainty else float("nan")


def word_of(one: Candidate) -> str:
    return one.kind.words[one.number < 0] if isinstance(one.kind, Act) else ""


def _is_unusual(one: Candidate) -> bool:
    """Of terms that explain a run alike those that are less often the cause: a signal that is early, and the cosine of
    an angle beside an offset of its sensor, a sensor's lag beside its delay, and what changes during the run."""
    return word_of(one) in UNUSUAL or one.kind in UNUSUAL_KINDS or isinstance(one.kind, Course)


def _rival(chosen: Candidate, one: Candidate) -> float:
    """Part of the best gain from which a term may be meant in place of the chosen one."""
    both = (chosen, one)
    in_time = all(_is_in_time(own) and word_of(own) not in UNUSUAL for own in both)
    return _ALIKE if in_time or all(isinstance(own.kind, Course) for own in both) else _RIVAL


def _is_in_time(one: Candidate) -> bool:
    return isinstance(one.kind, Act) and one.kind.measure == "time"


def _plainness(one: Candidate) -> int:
    """Order of terms that are the same column: a constant, of what is the same where a signal does not change its sign;
    of what changes a parameter, then a load."""
    return 0 if one.kind in (CONSTANT, OF_PARAMETER) else 1 if one.kind is OF_LOAD else 2


@of_fit
def unlikelihood(fit: Fit) -> float:
    """Minus twice the logarithm of the likelihood of all residuals, but for a constant."""
    theta = fit.parameters.theta(fit.p)
    return sum(fit.rows.unexplained(kind, theta)(one).unlikelihood for kind, one in enumerate(fit.errors))


def corrected(fit: Fit, term: Candidate) -> Fit:
    """The fit with a term of its size, weights anew."""
    rows, theta = copy.copy(fit.rows), fit.parameters.theta(fit.p)
    rows.columns = [one.copy() for one in rows.columns]
    for own, moved, th in zip(rows.columns, term.changed(theta), theta, strict=True):
        own[:, len(th)] -= term.size * moved
    return resumed(rows, fit, _PASSES)


def _refitted(library: Library, fit: Fit, one: Candidate) -> tuple[Candidate, Fit] | None:
    """A candidate with the size or level of most likelihood, and the fit with it; None: it leads nowhere."""
    if isinstance(one.kind, Act) and one.kind.positive and one.size < 0:
        return None
    if isinstance(one.kind, Act) and one.kind.exact:
        one = replace(one, kind=one.kind.exact, level=one.size, size=1.0)
    try:
        if isinstance(one.kind, Course) and one.level:
            one = _nearest_jump(library, fit, one)
        with_it = _leveled(library, fit, one) if one.leveled else _sized(fit, one)
    except (np.linalg.LinAlgError, ArithmeticError, PvidError):
        return None
    if with_it is None or not _is_nearer(with_it[1], fit) or _takes_place(with_it[1], library.fit):
        return None
    return None if _is_unphysical(with_it[1]) else with_it


def _takes_place(one: Fit, other: Fit) -> bool:
    """Whether next to nothing is left of a parameter: the term is there in its place."""
    positive = other.parameters.positive
    return bool(np.any(one.p[positive] < _NOTHING * other.p[positive]))


def _is_unphysical(one: Fit) -> bool:
    """Whether a parameter that is positive, and may pass 0 as it is next to it, is below 0 by more than its error."""
    positive = np.array([unknown.positive for unknown in one.rows.compiled.bare.unknowns])
    return bool(np.any(positive & (one.p < 0)) and np.any(positive & (one.p < -MOVES * uncertainty(one).se)))


def _nearest_jump(library: Library, fit: Fit, one: Candidate) -> Candidate:
    """A change at the time at which it explains most."""
    scores, part = Scores(fit), JUMPS[1] - JUMPS[0]
    for _ in range(_HALVINGS):
        part /= 2
        one = scores.of(library.jumps_near(one, part))[0]
    return one


def _is_nearer(one: Fit, other: Fit) -> bool:
    """Whether it leaves less beyond the sensors' noise: the likelihood alone prefers what takes an input away, with
    parameters and residuals near 0."""
    return bool(np.isfinite(unlikelihood(one))) and chi2_of_sensors(one) < chi2_of_sensors(other)


def _sized(fit: Fit, one: Candidate) -> tuple[Candidate, Fit] | None:
    with_it = fit
    for _ in range(_ROUNDS):
        before = with_it.errors
        with_it = corrected(replace(fit, p=with_it.p, errors=before), one)
        more = Scores(with_it).of([one])[0].size
        one = replace(one, size=one.size + more)
        if abs(one.size) > one.most:
            return None
        if abs(more) < _SETTLED * abs(one.size) and _are_alike(before, with_it.errors):
            break
    return one, with_it


def _are_alike(before: Sequence[EquationError], after: Sequence[EquationError]) -> bool:
    """Whether the errors of the equations, and with them the likelihood, have come to rest."""
    return all(abs(a.variance - b.variance) <= _AT_REST * b.variance for a, b in zip(before, after, strict=True))


def _leveled(library: Library, fit: Fit, one: Candidate) -> tuple[Candidate, Fit] | None:
    assert isinstance(one.kind, Act)
    act, recorded = one.kind, library.recorded(one.signal)
    # A level far from those that are tried takes the signal away: 0 = 0 fits every run.
    tried = [abs(level) for level in act.tried(recorded)]
    least, most = min(tried, default=0.0) / _BEYOND, min(max(tried, default=np.inf) * _BEYOND, one.most)

    def at(level: float, near: Fit = fit) -> tuple[float, Candidate, Fit]:
        own = replace(one, level=level, size=1.0, change=library.act(recorded, act, level).change)
        with_it = corrected(replace(fit, p=near.p, errors=near.errors), own)
        believable = least <= abs(level) <= most and _is_nearer(with_it, fit)
        return unlikelihood(with_it) if believable else np.inf, own, with_it

    best = at(one.level)
    best = at(one.level, best[2])
    for factor in _FACTORS:
        for step in (factor, 1 / factor):
            for _ in range(0 if work.is_spent() else _STEPS):
                other = at(best[1].level * step, best[2])
                if not other[0] < best[0]:
                    break
                best = other
    for _ in range(_ROUNDS):
        again = at(best[1].level, best[2])
        if _are_alike(best[2].errors, again[2].errors) or not again[0] < best[0]:
            break
        best = again
    return None if abs(best[1].level) * _FACTORS[-1] > one.most else (best[1], best[2])  # it would be larger yet
