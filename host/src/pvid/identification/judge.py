"""Which estimate to publish: that which predicts motion that it has not seen.

Estimates of the same equations differ: by the weights of the rows, by the compensation of the regressors' noise, by the
length of a window, by the stage. Each is computed from one half of the run, in several parts, and simulates the other
half. The usual estimate is published unless another one has a prediction error (rms) at least 10 % smaller.

Where the residuals are those of the sensors' noise alone, or a missing term explains the rest, the usual estimate
stands, with the prediction of each half by the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from operator import attrgetter

import numpy as np
import numpy.typing as npt

from pvid.base.wording import listed
from pvid.identification.answer import Analysis, RefinedFit
from pvid.identification.refinement.fit import Problem, Refined, Stretch, refined
from pvid.identification.refinement.problem import prior_about
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.identification.validation import Motion, Validation
from pvid.identification.values import values_of_found
from pvid.oracle.weak import verdict, work
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.failures import FAILURES, attempted
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.identify import Identified, ready
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import COMPARED, Fit
from pvid.oracle.weak.verdict import Reason, Verdict
from pvid.oracle.weak.words import worst
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]

_PARTS = 6  # of a run, of which every other one is fitted, and the rest predicted
_FEWEST = 4  # windows of a half of the parts, to which a model is fitted
_SAMPLES = 3000  # that are simulated of each half
_ALIKE = 0.1  # difference of the logarithms of the rms up to which estimates predict alike
_PASSES = 8  # of the refinement
_MOST = 12_000  # samples that it takes: no more are needed where the equations are what errs
_MOST_OF_PARTS = 6000  # the same over whole parts of the run
_OF_ANALYSIS = 0.6  # of the work that is allowed to a search for a design: that of the estimates here
_SIMULATED = 120  # times that the samples of both halves are simulated with all derivatives, at most
_NEAR = 4  # passes of a fit that begins at that to all data
_DESCRIBED = 0.5  # R^2 that an estimate has at least that replaces the usual one
PREDICTED = 0.9  # R^2 of motion that was not seen, below which the equations do not describe it
_NOTHING, _NO_WORSE = 1e-6, 0.01  # of a parameter: its term is gone; by the logarithm of the rms: it is not missed
_OF_NOISE = 3.0  # times the sensor's: a smaller error of a prediction is noise

_FALLEN = 0.01  # of its guess: a parameter that the search for the others may have lost
_USUAL = "the usual estimate"
_WHOLE, _FROM_GUESSES = "the fit of the whole equations", ", from the guesses on"
# Doubts of the usual estimate alone: another has its own, or is one of those that were compared.
_OF_PARAMETERS = ("not_identified", "undetermined", "near_zero")
_OF_USUAL = (
    *(*_OF_PARAMETERS, "range", "not_settled"),
    *("halves", "windows", "smoothing", "attenuation", "weights"),
)
# In place of what was found at a usual estimate that does not describe the motion.
_LACKING = "The equations lack something, or a signal is not what was recorded: the cause is unknown."
_OF_WIDTH = ("wide", "model_error")  # of standard errors that the spread of the estimates is not in
# Of a window, times the chosen one; words, error of the equations in the weights, compensation.
_LENGTHS = {1.0: _USUAL, 2.0: "the estimate with windows twice as long", 0.5: "the estimate with windows half as long"}
_WEIGHTS = (
    ("", True, True),
    (", without compensation of the regressors' noise", True, False),
    (", with the weights of the sensors' noise", False, True),
    (", with the weights of the sensors' noise and without compensation", False, False),
)


@dataclass(frozen=True, eq=False)
class Candidate:
    """An estimate of the parameters.

    Attributes
    ----------
    name : what it is, in words
    p, se : from all data [n_p]
    halves : r from each half of the parts [2][parameters and settings of the simulation]
    fit : of the weak form; of the refinement the estimate at which it began
    unseen : how well the halves predict each other; None: not scored
    of_recordings : the same in each of several recordings, by name
    """

    name: str
    p: Float
    se: Float
    halves: tuple[Float, Float]
    fit: Fit
    unseen: Validation | None = None
    of_recordings: Mapping[str, tuple[SensorPrediction, ...]] = field(default_factory=dict)
    score: float = np.inf

    @property
    def sensors(self) -> tuple[SensorPrediction, ...]:
        """Of each sensor."""
        return () if self.unseen is None else self.unseen.sensors


def judged(answer: Analysis) -> Analysis:
    """The answer, or that of the estimate that predicts best. Its standard errors include the spread of the estimates
    that predict about equally well.

    Cost: a second or some for 10 000 samples, where the residuals exceed the sensors' noise alone.
    """
    if answer.is_explained:
        return answer
    try:
        with np.errstate(all="ignore"), work.limited(_OF_ANALYSIS * answer.found.allowance):
            return _judged(answer)
    except FAILURES:  # the equations cannot be simulated on this run: the usual answer, as it is
        return answer


def with_prediction(answer: Analysis) -> Analysis:
    """The same answer with how well its equations predict motion that was not fitted: each half of the run the other's,
    after a refinement of each where the answer is refined.

    Cost: some tenths of a second, where the model's simulation is compiled already.
    """
    try:
        with np.errstate(all="ignore"):
            found, trial = answer.found, _Trial(answer)
            if trial.fit is not None:
                usual = [trial.of_fit(trial.fit)]
            else:
                usual = trial.estimates(_USUAL, found.design, found.fit.start, _WEIGHTS[:1])
            small = [k for k, one in enumerate(found.judged) if one.status == "near_zero"]
            if usual and small and trial.fit is None and trial.is_as_good_without(usual[0], small):
                answer = _with_superfluous(answer, [answer.model.p_names[k] for k in small])
    except FAILURES:  # they cannot be simulated on this run
        return answer
    return with_unseen(answer, usual[0].unseen) if usual else answer


def _with_superfluous(answer: Analysis, names: Sequence[str]) -> Analysis:
    """The answer; the reason with the bound of a parameter adds that the model without its term predicts as well."""
    more = (
        f" Without {listed(names)}, motion that was not fitted is predicted as well: the equations need no such term."
    )
    reasons = tuple(
        replace(one, text=one.text + more) if one.name == "near_zero" else one for one in answer.found.verdict.reasons
    )
    return replace(answer, found=replace(answer.found, verdict=Verdict(reasons)))


def with_unseen(answer: Analysis, unseen: Validation | None) -> Analysis:
    """The answer with these predictions, and a doubt where one is poor and more than noise."""
    answer = replace(answer, unseen=unseen)
    poor = [one for one in answer.prediction if one.r2 < PREDICTED and not (one.of_noise or np.inf) < _OF_NOISE]
    if not poor or not answer.identified:
        return answer
    reasons = [*answer.found.verdict.reasons, _unpredicted(poor, "it explains what was fitted alone")]
    found = replace(answer.found, verdict=Verdict(verdict.sorted_by_gravity(reasons)))
    values = {name: replace(one, word=worst([one.word, "not_explained"])) for name, one in answer.values.items()}
    return replace(answer, found=found, values=values)


def _unpredicted(poor: Sequence[SensorPrediction], because: str) -> Reason:
    shares = listed(f"{100 * max(one.r2, 0.0):.0f} % of {one.name}" for one in poor)
    return Reason("unpredicted", f"Of motion that was not fitted the answer predicts {shares}: {because}.")


def _judged(answer: Analysis) -> Analysis:
    trial = _Trial(answer)
    designs = {name: (design, start) for name, design, start in _designs(answer)}
    found = [one for name, given in designs.items() for one in trial.estimates(name, *given, _WEIGHTS[:1])]
    if found:
        best = min(found, key=attrgetter("score"))
        found += trial.estimates(best.name, *designs[best.name], _WEIGHTS[1:])
        best = min(found, key=attrgetter("score"))
        if not trial.is_spent and any(one.r2 > 0 for one in best.sensors):  # else no motion near the recorded one
            name = _WHOLE + ("" if best.name == _USUAL else f", from {best.name} on")
            found += trial.refined(best, name, _MOST)
        if trial.has_fallen(best):  # whatever the search for others has spent
            found += trial.refined(trial.at_guesses(best), _WHOLE + _FROM_GUESSES, _MOST)
    found = [one for one in found if np.isfinite(one.score)]
    if not found:
        return answer
    if _poor(min(found, key=attrgetter("score"))):
        found = trial.over_whole_parts(found)
    best = min(found, key=attrgetter("score"))
    usual = next((one for one in found if one.name == _USUAL), None)
    describes = all(one.r2 > _DESCRIBED for one in best.sensors)
    if usual is None and not describes:
        return answer
    chosen = best if usual is None or (describes and best.score < usual.score - _ALIKE) else usual
    alike = [one for one in found if one.score < chosen.score + _ALIKE] if describes else [chosen]
    return _published(answer, chosen, usual, alike)


def _poor(one: Candidate) -> list[SensorPrediction]:
    """Sensors whose motion that was not fitted it does not describe."""
    return [sensor for sensor in one.sensors if sensor.r2 < PREDICTED]


def _designs(answer: Analysis) -> Iterator[tuple[str, WeakDesign, Float]]:
    """Of windows: the chosen one and others, in words, and where to search from."""
    design, start = answer.found.design, answer.found.fit.start
    for factor, name in _LENGTHS.items():
        other = attempted(partial(replace, design, window_s=factor * design.window_s))
        if other is not None:  # else a window is too short for its functions
            yield name, other, start
    for window_s in sorted({one.design.window_s for one in answer.found.ranking}):
        least = min(
            (one for one in answer.found.ranking if one.design.window_s == window_s),
            key=lambda one: one.design.functions,
        )
        if least.design.functions < design.functions:
            name = f"the estimate with {least.design.functions} functions a window of {window_s:.3g} s"
            yield name, least.design, least.p


def _parts(recording: Recording) -> tuple[list[Stretch], list[Stretch]]:
    """Of the run, the first, third, ... and the others: about as many as _PARTS, each within one recording, and as many
    of each recording in either half."""
    whole = [(one.first, one.end) for one in recording.origins] or [(0, len(recording))]
    total = sum(end - first for first, end in whole)
    halves: tuple[list[Stretch], list[Stretch]] = ([], [])
    for first, end in whole:
        count = 2 * max(1, round(_PARTS / 2 * (end - first) / total))
        edges = np.linspace(first, end, count + 1).astype(int).tolist()
        parts = list(pairwise(edges))
        halves[0].extend(parts[0::2])
        halves[1].extend(parts[1::2])
    return halves


class _Trial:
    """Estimates from one recording, and how well they predict."""

    def __init__(self, answer: Analysis) -> None:
        self._answer, self._compiled = answer, ready(answer.model)
        self._parts = _parts(answer.recording)
        refinement, rate = answer.refinement, answer.recording.sample_rate
        self.fit = refinement.fit if refinement is not None and refinement.adopted else None
        self._every = 1 if self.fit is None else round(rate / self.fit.problem.measured.rate)
        if self.fit is not None:
            early, late = ([(a // self._every, b // self._every) for a, b in part] for part in self._parts)
            self._parts = early, late
            self._motion = Motion(self.fit.problem, self.fit.found.r)
            self._block = self._motion.block(answer.found.design.window_s, _PARTS)
            return
        known = all(one.status == "identified" for one in answer.found.judged)
        p = answer.found.p if known else np.array([one.guess for one in answer.model.unknowns])
        self._motion = Motion.near(answer.model, answer.recording.run, rate, p)
        self._block = self._motion.block(answer.found.design.window_s, _PARTS)
        problem = self._motion.problem
        samples = min(len(answer.recording), 2 * _SAMPLES) * problem.measured.sub / problem.measured.coarse
        problem.budget.left = _SIMULATED * samples * (1 + problem.kernel.columns)

    @property
    def is_spent(self) -> bool:
        return work.is_spent() or self._motion.problem.budget.is_spent

    def estimates(
        self, name: str, design: WeakDesign, start: Float, weights: Sequence[tuple[str, bool, bool]]
    ) -> list[Candidate]:
        """By the weak form with these weights (name, error of the equations, compensation), scored."""
        known = self._answer.found.fit.rows
        same = design == known.record.grid.design and self._compiled is known.compiled
        rows = known if same else attempted(lambda: WeakRows.of(self._compiled, self._answer.recording.run, design))
        if rows is None:
            return []
        out = []
        for words, equation_error, compensate in weights:
            if self.is_spent and not (name == _USUAL and not words):
                break
            fitted = _Fitted(equation_error, compensate)
            usual = self._answer.found.fit
            own = name == _USUAL and not words and not usual.diverged
            fit = usual if own else attempted(partial(fitted, rows, start))
            errors = None if fit is None else attempted(partial(uncertainty, fit))
            if fit is None or errors is None or not np.isfinite(fit.p).all():
                continue
            halves = [attempted(partial(fitted.half, rows, part, fit)) for part in self._parts]
            if all(one is not None and np.isfinite(one).all() for one in halves):
                first, second = (self._motion.r_of(one) for one in halves if one is not None)
                out.append(self._scored(Candidate(name + words, fit.p, errors.se, (first, second), fit)))
        return out

    def _scored(self, one: Candidate) -> Candidate:
        """With how well each half predicts the other."""
        motion, samples = self._motion, self._block
        measured, simulated, places = [], [], []
        for r, others in zip(one.halves, reversed(self._parts), strict=True):
            problem = motion.within(others)
            if not problem.measured.stretches or problem.longest < samples:
                return one
            cut, z = motion.simulated(r, problem, samples, _SAMPLES)
            measured.append(cut.rows(problem.measured.z))
            simulated.append(z)
            places.append(cut.places)
        shortest = min(part.shape[1] for part in measured)
        z, x, at = (np.concatenate([part[:, :shortest] for part in both]) for both in (measured, simulated, places))
        if not np.isfinite(x).all():
            return one
        at *= self._every
        unseen = motion.validation(self._answer.recording.t[at], z, x)
        rms = np.array([one.rms for one in unseen.sensors])
        first = at[:, 0]
        of_recordings = {
            own.name: motion.compared(z[inside], x[inside])
            for own in self._answer.recording.origins
            if (inside := (own.first <= first) & (first < own.end)).any()
        }
        score = float(np.mean(np.log(np.maximum(rms, motion.sd))))
        return replace(one, unseen=unseen, of_recordings=of_recordings, score=score)

    def is_as_good_without(self, one: Candidate, small: Sequence[int]) -> bool:
        """Whether motion is predicted as well with nothing of these positive parameters [places in p]."""
        first, second = (half.copy() for half in one.halves)
        for half in (first, second):
            half[[self._motion.problem.kernel.made.places_of_p[k] for k in small]] *= _NOTHING
        return self._scored(replace(one, halves=(first, second), score=np.inf)).score < one.score + _NO_WORSE

    def of_fit(self, fit: RefinedFit) -> Candidate:
        """The refinement that gave the answer, with one of each half from there on, scored."""
        problem, found = fit.problem, fit.found
        prior = replace(prior_about(problem, found.r), free=np.diag(found.covariance) > 0)
        halves = []
        for parts in self._parts:
            half = self._motion.within(parts, problem.measured.sd)
            samples = min(found.cut.samples, half.longest)
            halves.append(refined(half, prior, (samples,), most=_PASSES).r)
        p, covariance = problem.values(found, problem.kernel.made.places_of_p)
        usual = self._answer.found.fit
        return self._scored(Candidate(_USUAL, p, np.sqrt(np.diag(covariance)), (halves[0], halves[1]), usual))

    def over_whole_parts(self, found: Sequence[Candidate]) -> list[Candidate]:
        """The same, scored over blocks as long as a part of the run, with the refinement of the best of them, or else
        of the guesses, over such blocks: a process that is slow beside the windows, or a recording of one step, shows
        its parameters there alone."""
        recording = self._answer.recording
        self._block = max(self._block, self._motion.block(len(recording) / recording.sample_rate, _PARTS))
        again = [self._scored(replace(one, score=np.inf)) for one in found]
        again = [one for one in again if np.isfinite(one.score)]
        if not again:
            return list(found)
        best = min(again, key=attrgetter("score"))
        name = f"{_WHOLE} over blocks of {self._seconds:.2g} s"
        if _poor(best):
            again += self.refined(best, name, _MOST_OF_PARTS)
        if _poor(min(again, key=attrgetter("score"))):
            again += self.refined(self.at_guesses(best), name + _FROM_GUESSES, _MOST_OF_PARTS)
        return again

    def at_guesses(self, one: Candidate) -> Candidate:
        """The guesses in place of an estimate, scored."""
        p = np.array([unknown.guess for unknown in self._answer.model.unknowns])
        return self._scored(replace(one, p=p, halves=(self._motion.r_of(p),) * 2, score=np.inf))

    def has_fallen(self, one: Candidate) -> bool:
        """Whether a positive parameter is next to nothing: a search cannot come back from there, and a mechanism of two
        bodies may have become one of one body."""
        unknowns = self._answer.model.unknowns
        return any(own.positive and p < _FALLEN * own.guess for own, p in zip(unknowns, one.p, strict=True))

    @property
    def _seconds(self) -> float:
        """Of a block."""
        return self._block / self._motion.problem.measured.rate

    def refined(self, best: Candidate, name: str, most: int) -> list[Candidate]:
        """The refinement from an estimate on, of about so many samples at most, scored: it is weighted by what that
        reaches, not by the sensors' noise. None where it has no outcome."""
        motion, samples = self._motion, self._block
        if self._answer.model.constraints or not best.sensors or motion.problem.budget.is_spent:  # it keeps none
            return []
        sd = np.maximum(motion.sd, [one.rms for one in best.sensors])

        def searched(problem: Problem, r: Float) -> Refined:
            return refined(problem, prior_about(problem, r), (max(8, samples // 3), samples), most=_PASSES)

        try:
            whole = searched(
                motion.within(self._thinned(self._parts[0] + self._parts[1], most), sd), motion.r_of(best.p)
            )
            first, second = (
                searched(motion.within(self._thinned(part, most // 2), sd), r).r
                for part, r in zip(self._parts, best.halves, strict=True)
            )
        except FAILURES:
            return []
        p, covariance = motion.problem.values(whole, motion.problem.kernel.made.places_of_p)
        if not np.isfinite(covariance).all():
            return []
        one = self._scored(Candidate(name, p, np.sqrt(np.diag(covariance)), (first, second), best.fit))
        return [one] if np.isfinite(one.score) else []

    def _thinned(self, parts: Sequence[Stretch], most: int) -> list[Stretch]:
        """Pieces of the parts with at most about so many samples together, evenly spread."""
        total = sum(end - first for first, end in parts)
        if total <= most:
            return list(parts)
        piece = 2 * self._block
        pieces = [(at, at + piece) for first, end in parts for at in range(first, end - piece + 1, piece)]
        return pieces[:: -(-total // most)] or [(first, min(end, first + most // len(parts))) for first, end in parts]


@dataclass(frozen=True)
class _Fitted:
    """A fit with these weights."""

    equation_error: bool
    compensate: bool

    def __call__(self, rows: WeakRows, start: Float) -> Fit:
        return gated(rows, start, self.equation_error, self.compensate, settled=COMPARED)

    def half(self, rows: WeakRows, parts: Sequence[Stretch], fit: Fit) -> Float:
        """p from the windows within these parts; that of the whole where they are too few."""
        rate = rows.record.grid.design.sample_rate
        end = np.rint(rows.end_times() * rate)
        begin = end - np.rint(rows.functions.length * rate)
        within = np.any([(begin >= first - 1) & (end <= last + 1) for first, last in parts], axis=0)
        if within.sum() < _FEWEST:
            return fit.p
        return gated(rows.only(within), fit.p, self.equation_error, self.compensate, _NEAR).p


def _published(answer: Analysis, chosen: Candidate, usual: Candidate | None, alike: Sequence[Candidate]) -> Analysis:
    """The answer with the chosen estimate; its standard errors contain how far the estimates that predict alike are."""
    found, model = answer.found, answer.model
    fit = chosen.fit.at(chosen.p)
    apart = np.array([one.p - chosen.p for one in alike])
    shifts = np.concatenate([found.shifts, apart]) if chosen is usual else apart
    by_model = np.max(np.abs(shifts), axis=0)
    noise = found.noise if chosen is usual else chosen.se
    se = np.sqrt(noise**2 + np.sum(found.gains**2, axis=0) + by_model**2)
    poor = _poor(chosen)
    settled = fit.settled or not poor  # a search that did not come to rest may predict the motion all the same
    again = chosen is not usual or (settled and not fit.settled)
    found_of = verdict.judged(model, fit, noise)
    status = tuple(found_of if settled or again else verdict.with_unsettled(fit, found_of))
    r2 = list(found.r2.values()) if chosen is usual else uncertainty(fit).r2
    own = (*_OF_WIDTH, *(_OF_USUAL if chosen is not usual else _OF_PARAMETERS if again else ()))
    reasons = [one for one in found.verdict.reasons if one.name not in own]
    if chosen is not usual and (usual is None or any(one.r2 < _DESCRIBED for one in usual.sensors)):
        reasons = [replace(one, text=_LACKING) if one.name == "unexplained" else one for one in reasons]
    if not poor:  # the cause is unknown, but the values are those that move the mechanism
        reasons = [replace(one, name="missing") if one.name == "unexplained" else one for one in reasons]
    reasons += verdict.of_width(model, fit, se, by_model, status)
    if again:
        reasons += verdict.of_parameters(model, fit, noise, status, r2)
    if chosen is not usual:
        reasons += [*verdict.of_range(model, chosen.p, status), _of_choice(chosen, usual)]
    if not poor and (worse := _poorly_predicted(chosen)):
        text = f"The answer predicts {listed(worse)}: did something change, or does a parameter differ there (--own)?"
        reasons.append(Reason("unpredicted", text))
    if poor:
        reasons.append(_unpredicted(poor, "the equations lack something that matters"))
    judged_found: Identified = replace(
        found,
        p=chosen.p,
        se=se,
        by_model=by_model,
        shifts=shifts,
        fit=fit,
        judged=status,
        verdict=Verdict(verdict.sorted_by_gravity(reasons)),
    )
    return replace(
        answer,
        found=judged_found,
        values=values_of_found(model, judged_found),
        unseen=chosen.unseen,
        predicted=chosen.of_recordings,
    )


def _poorly_predicted(one: Candidate) -> list[str]:
    """Of several recordings: how much of the motion of a sensor is predicted in those where it is too little."""
    return [
        f"{100 * max(sensor.r2, 0.0):.0f} % of {sensor.name} in {name}"
        for name, sensors in one.of_recordings.items()
        for sensor in sensors
        if sensor.r2 < PREDICTED
    ]


def _of_choice(chosen: Candidate, usual: Candidate | None) -> Reason:
    """Which estimate is published, and why."""
    text = f"Published is {chosen.name}, because it predicts motion that was not fitted better"
    than = f"{_USUAL} cannot" if usual is None else f"{_USUAL} {listed(usual.sensors)}"
    own = f"{listed(chosen.sensors)}; {than}"
    return Reason("prediction", f"{text}. It predicts {own}.")
