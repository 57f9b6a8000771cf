"""Identification of any mechanism with a compiled model, in float64 (pvid.oracle.weak)."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.model.compiled import CompiledModel, Output
from pvid.model.corners import feedthroughs
from pvid.model.evaluation import numpy_function
from pvid.model.normalise import with_own_scales
from pvid.model.together import offsets, with_own
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.choice import Scored
from pvid.oracle.weak.edges import with_edges
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.identify import Identified, given
from pvid.oracle.weak.identify import identify as identified_by
from pvid.oracle.weak.naming import terms_of
from pvid.oracle.weak.verdict import Judged, ParameterStatus, Verdict
from pvid.oracle.weak.weights import Weights
from pvid.oracle.weak.words import WIDE, Word, worst
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.run.sensor_prediction import SensorPrediction

if TYPE_CHECKING:
    from pvid.run.refined import Problem, Refined

Float = npt.NDArray[np.float64]


_NOTHING = 1e-6  # of its guess: a positive parameter that has shrunk
_NOISE = 2.0  # chi^2 over the sensors' noise up to which it explains the residuals


@dataclass(frozen=True)
class Value:
    """A parameter, or what follows from p.

    Attributes
    ----------
    value, se : its standard error; None where it is not identified
    se_noise, se_scale, se_model
        its parts, whose squares add up to its own: from noise; from gains, constants, the clock and linearised
        equations; from what the equations seem to lack
    status, reason : whether the run determines it; a clause where it does not, or where it may be 0
    below : it is below this with 95 %, where it may be 0
    word : what it may be used for
    """

    unit: str
    value: float | None
    se: float | None
    se_noise: float | None
    status: ParameterStatus = "identified"
    reason: str | None = None
    below: float | None = None
    se_model: float | None = None
    se_scale: float | None = None
    word: Word = "good"

    def as_json(self) -> dict[str, Any]:
        """Its entry in the object of `identify --json`."""
        out = {"value": self.value, "se": self.se, "unit": self.unit, "se_noise": self.se_noise}
        out |= {"se_scale": self.se_scale, "se_model": self.se_model, "verdict": self.word, "status": self.status}
        out |= {} if self.reason is None else {"reason": self.reason}
        return out | ({} if self.below is None else {"below": self.below})


class RefinedFit(Protocol):
    """An outcome of a refinement, as pvid.run.refined_mechanism makes it."""

    @property
    def problem(self) -> Problem: ...

    @property
    def found(self) -> Refined: ...

    @property
    def extras(self) -> Mapping[str, tuple[float, float]]: ...


@dataclass(frozen=True, eq=False)
class Refinement:
    """What became of a refinement.

    Attributes
    ----------
    adopted : the answer's values are the refined ones
    text : why, in a clause
    fit : its outcome; None: there is none
    """

    adopted: bool
    text: str
    fit: RefinedFit | None = None

    def as_json(self) -> dict[str, Any]:
        """For `identify --json`; parameters that the weak form does not have by name."""
        out: dict[str, Any] = {"adopted": self.adopted, "text": self.text}
        if self.fit is None:
            return out
        found = self.fit.found
        extras = {name: {"value": value, "se": se} for name, (value, se) in self.fit.extras.items()}
        out |= {"chi2": found.chi2, "slow_chi2": found.slow_chi2, "blocks": len(found.cut.first)}
        return out | {"parameters": extras}


@dataclass(frozen=True, eq=False)
class MechanismAnswer:
    """An identification of a recording.

    Attributes
    ----------
    model : with the values of the rig file
    found : estimate and verdict
    values : by name: outputs of the model, then p
    recording : the samples
    weights : of the rows
    advice : sentences with what to type, where a column seems to be wrong
    prediction : how well each sensor's motion is predicted that was not fitted; none: it was not looked at
    predicted : the same in each of several recordings, by name
    refinement : None: none was tried
    """

    model: CompiledModel
    found: Identified
    values: Mapping[str, Value]
    recording: Recording
    weights: Weights = "residuals"
    advice: tuple[str, ...] = ()
    prediction: tuple[SensorPrediction, ...] = ()
    predicted: Mapping[str, tuple[SensorPrediction, ...]] = field(default_factory=dict)
    refinement: Refinement | None = None

    @property
    def identified(self) -> bool:
        """Whether at least one parameter is."""
        return self.found.verdict.identified

    @property
    def is_explained(self) -> bool:
        """Whether the residuals are those of the sensors' noise, or a named term explains the rest of them: estimates
        of the same equations are then alike, or all lack the same."""
        named = self.found.named
        return (self.found.chi2 <= _NOISE and self.identified) or (named is not None and named.complete)

    @property
    def ranking(self) -> tuple[Scored, ...]:
        """The designs that were tried, where they were compared as the engine's are; else ()."""
        return self.found.ranking if self.weights == "residuals" else ()

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        found = self.found
        parameters = {name: one.as_json() for name, one in self.values.items()}
        return {
            "identified": self.identified,
            "verdict": found.verdict.word,
            "status": found.verdict.status,
            "warning": found.verdict.warning,
            "advice": list(self.advice),
            "reasons": {one.name: one.text for one in found.verdict.reasons},
            "parameters": parameters,
            "missing": missing_of(found),
            "chi2": found.chi2,
            "r2": found.r2,
            "prediction": {one.name: one.as_json() for one in self.prediction},
            **recordings_of(self),
            "window_s": found.design.window_s,
            "windows": len(found.times),
            "weights": self.weights,
            "input": list(self.recording.notes),
            "samples": len(self.recording),
            "model": self.model.name,
            "core": "f64",
            "form": "weak",
        } | ({} if self.refinement is None else {"refinement": self.refinement.as_json()})


def recordings_of(answer: MechanismAnswer) -> dict[str, Any]:
    """Of several recordings: samples of each, begin on the common time axis [s], and how well it is predicted."""
    recording = answer.recording
    if not recording.origins:
        return {}
    each = {
        one.name: {
            "samples": one.end - one.first,
            "begin_s": float(recording.t[one.first]),
            "prediction": {sensor.name: sensor.as_json() for sensor in answer.predicted.get(one.name, ())},
        }
        for one in recording.origins
    }
    return {"recordings": each}


def missing_of(found: Identified) -> dict[str, Any] | None:
    """What the equations seem to lack, and the parameters with it; None: nothing that moves a parameter visibly."""
    named = found.named
    if named is None:
        return None
    with_it = zip(found.names, named.fit.p, uncertainty(named.fit).se, strict=True)
    parameters = {name: {"value": float(p), "se": float(se)} for name, p, se in with_it}
    terms = [asdict(one) for one in terms_of(found.fit, named)]
    return {"explained": named.complete, "share": named.share, "terms": terms, "parameters": parameters}


def model_of(rig: MechanismRig) -> CompiledModel:
    """The compiled model with the values of a rig."""
    return rig.applied(compiled_of(rig.model))


@np.errstate(all="ignore")  # what diverges is judged, and told in words
def identify_mechanism(
    recording: Recording, model: CompiledModel, weights: Weights = "residuals", own: Collection[str] = ()
) -> MechanismAnswer:
    """Parameters of a mechanism from all segments of a recording.

    Parameters
    ----------
    own : unknowns that have a value of their own in each of several recordings
    weights : of the rows, as in pvid.oracle.weak.identify

    Raises
    ------
    PvidError
        When the recording is too short, or holds a signal beyond all reason.
    """
    refuse_constant(recording, model)
    model = with_edges(as_sampled(model, recording.ticks_between), recording.run, recording.sample_rate)
    names = [one.name for one in recording.origins]
    whole = with_own(model, own, names)
    found = identified_by(whole, recording.run, recording.sample_rate, weights=weights)
    if _collapsed(model, found) and (scaled := with_own_scales(model)) is not None:
        other = with_own(scaled, own, names)
        again = attempted(lambda: identified_by(other, recording.run, recording.sample_rate, weights=weights))
        if again is not None and _determined(again) > _determined(found):
            whole, found = other, again
    model = whole
    notes = *_of_own(model, own), *_of_edges(model), *_of_segments(recording, found)
    noted = replace(recording, notes=(*recording.notes, *notes))
    return MechanismAnswer(model, found, values_of_found(model, found), noted, weights)


def _determined(found: Identified) -> int:
    return sum(one.status == "identified" for one in found.judged)


def _collapsed(model: CompiledModel, found: Identified) -> bool:
    """Whether an unknown of a homogeneous row has shrunk to nothing."""
    homogeneous = {str(one) for row in model.rows if not row.known for theta in row.theta for one in theta.free_symbols}
    guesses = {one.name: one.guess for one in model.unknowns if one.positive and one.name in homogeneous}
    names = (name if name in guesses else name.partition("[")[0] for name in found.names)  # m of m[A], too
    return any(p < _NOTHING * guesses.get(name, -np.inf) for name, p in zip(names, found.p, strict=True))


def _of_edges(model: CompiledModel) -> Iterator[str]:
    """A note on each sensor that is sampled on one side of the jumps of an input."""
    for sensor, name in feedthroughs(model):
        if (edge := model.signal(sensor).edge) != "between":
            yield f"{sensor} jumps with {name}: its samples are those {edge} the jump"


def own_of(
    model: CompiledModel,
    recording: Recording,
    own: Sequence[str] = (),
    shared: Sequence[str] = (),
    *,
    in_c: bool = False,
) -> tuple[str, ...]:
    """Unknowns that have a value of their own in each of several recordings: these, and offsets of sensors.

    Parameters
    ----------
    own, shared : names that were asked for
    in_c : for the C core, which has one value of each

    Raises
    ------
    PvidError
        For a name that is no unknown of the model, and where there is one recording, or the C core.
    """
    for option, names in (("own", own), ("shared", shared)):
        for name in names:
            if name not in model.p_names:
                raise PvidError(f"{option} {name}: {model.name} has no such unknown; it has {listed(model.p_names)}")
    if both := [name for name in own if name in shared]:
        raise PvidError(f"{both[0]} is both own and shared")
    if own and not recording.origins:
        raise PvidError(f"own {own[0]}: a parameter has values of its own in several recordings, and there is one")
    if own and in_c:
        raise PvidError(f"own {own[0]}: the C core has one value of each parameter; identify in float64")
    if not recording.origins or in_c:
        return ()
    of_sensors = [name for name in offsets(model) if name not in shared]
    return tuple(name for name in model.p_names if name in own or name in of_sensors)


def _of_own(model: CompiledModel, own: Collection[str]) -> tuple[str, ...]:
    """A note on the parameters that each recording has of its own."""
    if not own:
        return ()
    text = f"each recording has its own {listed(own)}"
    of_sensors = [name for name in offsets(model.alone) if name in own]
    if of_sensors:
        be = "is the offset of a sensor" if len(of_sensors) == 1 else "are offsets of sensors"
        text += f" ({listed(of_sensors)} {be}; --shared {','.join(of_sensors)}: one value in all)"
    return (text,)


def _of_segments(recording: Recording, found: Identified) -> tuple[str, ...]:
    """A note on the segments of a recording that has several."""
    whole = recording.segments
    if len(whole) < 2:
        return ()
    grid, rate = found.fit.rows.record.grid, recording.sample_rate
    first = [int(grid.places[part.start]) for part in grid.parts]
    used = [(part.stop - part.start) / rate for part in whole if any(part.start <= one < part.stop for one in first)]
    left = [(part.stop - part.start) / rate for part in whole]
    for one in used:
        left.remove(one)
    text = f"identified from {len(used)} segments together, of {min(used):.3g} s to {max(used):.3g} s"
    if left:
        text += (
            f"; left out, as too short for a window or behind a lost integral: {len(left)}, {sum(left):.3g} s in all"
        )
    return (text,)


def as_sampled(model: CompiledModel, ticks_between: Mapping[str, float]) -> CompiledModel:
    """The model with white noise of slow sensors that has, at every tick, the density of theirs.

    Parameters
    ----------
    ticks_between : by signal: mean ticks from sample to sample, of those that were interpolated
    """
    if not ticks_between:
        return model
    signals = []
    for one in model.signals:
        between = ticks_between.get(one.name, 1.0)
        rounding = 1 / 12 if one.resolution else 0.0
        signals.append(replace(one, noise=float(np.sqrt(between * (rounding + one.noise**2) - rounding))))
    return replace(model, signals=tuple(signals))


def refuse_constant(recording: Recording, model: CompiledModel) -> None:
    """A sensor that never moves is dead or not connected."""
    for one in model.signals:
        if one.kind == "sensor" and np.nanmax(values := recording.signals[one.name]) == np.nanmin(values):
            raise PvidError(f"{one.name} has the same value in all {len(recording)} samples: is the sensor connected?")


def values_of_found(model: CompiledModel, found: Identified) -> dict[str, Value]:
    """Outputs of the model, then p, by name."""
    # The correlations of the rows, with the published standard errors but for gains and constants.
    widened = noise_of(model, found) / np.sqrt(np.diag(found.covariance))
    covariance = found.covariance * np.outer(widened, widened)
    return values_of(model, found.p, covariance, gains_of(model, found), found.judged, found.verdict, shifts_of(found))


def noise_of(model: CompiledModel, found: Identified) -> Float:
    """The published standard errors but for gains, constants and what is missing [n_p]."""
    other = np.sum(gains_of(model, found) ** 2, axis=0) + found.by_model**2
    return np.asarray(np.sqrt(np.maximum(found.se**2 - other, 0.0)))


def shifts_of(found: Identified) -> Float:
    """What p moves by with each term that the equations may lack, and to other estimates [terms, n_p]."""
    if found.shifts is not None:
        return found.shifts
    return np.zeros((0, len(found.p))) if found.lacking is None else found.lacking.shifts


def gains_of(model: CompiledModel, found: Identified) -> Float:
    """What p is off by for one standard deviation of each gain, constant and clock that has any, and of what
    linearised equations neglect [gains, n_p]."""
    return np.array([*given(model, found.by_gain, found.by_known, found.by_clock), found.by_neglect])


def refined_gains_of(model: CompiledModel, found: Identified) -> Float:
    """The same of a refined estimate, whose equations neglect nothing where the refinement has its own."""
    return gains_of(model, found)[:-1] if model.refinement.equations else gains_of(model, found)


def refined_shifts_of(model: CompiledModel, found: Identified) -> Float:
    """The same of a refined estimate: where the refinement has its own equations, what the linear rows lack counts only
    where it is more than they neglect."""
    shifts = shifts_of(found)
    return np.where(np.abs(shifts) > found.by_neglect, shifts, 0.0) if model.refinement.equations else shifts


def values_of(
    model: CompiledModel,
    p: Float,
    covariance: Float,
    gains: Float,
    judged: Sequence[Judged],
    verdict: Verdict,
    shifts: Float | None = None,
    *,
    of_known: bool = True,
) -> dict[str, Value]:
    """Outputs of the model, then p, by name.

    Parameters
    ----------
    covariance : of p by noise [n_p, n_p]
    gains : see gains_of
    judged : of each parameter; an output is identified where all parameters that it depends on are
    verdict : whose word a parameter has; an output has the worst of those that it depends on
    shifts : see shifts_of; None: no terms were tried
    of_known : the first of the gains are those of constants, in which an output may stand by itself
    """
    terms = np.zeros((0, len(p))) if shifts is None else shifts

    def shown(unit: str, value: float, slope: Float, of: Judged, word: Word, direct: Float | float = 0.0) -> Value:
        if of.status == "not_identified":
            return Value(unit, None, None, None, of.status, of.reason, word="not_identified")
        se_noise, se_scale = float(np.sqrt(slope @ covariance @ slope)), float(np.linalg.norm(gains @ slope + direct))
        se_model = float(np.max(np.abs(terms @ slope), initial=0.0))
        se = math.hypot(se_noise, se_scale, se_model)
        return Value(unit, value, se, se_noise, of.status, of.reason, of.below, se_model, se_scale, word)

    values = {}
    for one in model.outputs:
        used = [of for symbol, of in zip(model.p, judged, strict=True) if one.value.has(symbol)]
        missing = next((of for of in used if of.status == "not_identified"), Judged())
        slope = np.where([of.status == "not_identified" for of in judged], 0.0, (found := output_at(model, p, one))[1])
        word = worst(verdict.of(name) for name, p_k in zip(model.p_names, model.p, strict=True) if one.value.has(p_k))
        direct = np.zeros(len(gains))
        if of_known:
            by_known = _of_constants(model, p, one, found[0])
            direct[: len(by_known)] = by_known
        own = shown(one.unit, found[0], slope, missing, word, direct)
        if own.value is not None and not (own.se or 0.0) <= WIDE * abs(own.value):
            own = replace(own, word=worst([word, "usable"]))
        values[one.name] = own
    for k, unknown in enumerate(model.unknowns):
        values[unknown.name] = shown(unknown.unit, float(p[k]), np.eye(len(p))[k], judged[k], verdict.of(unknown.name))
    return values


def unless_held(judged: Sequence[Judged], reason: str | None) -> Sequence[Judged]:
    """Of each parameter; with a reason (a clause) why an identifier publishes nothing, none is identified."""
    return judged if reason is None else [Judged("not_identified", reason)] * len(judged)


def outputs_at(model: CompiledModel, p: Float) -> dict[str, float]:
    """Outputs of the model at p [n_p], by name."""
    return {one.name: output_at(model, p, one)[0] for one in model.outputs}


def _of_constants(model: CompiledModel, p: Float, output: Output, value: float) -> list[float]:
    """What an output at p is off by for one standard deviation of each constant that has any, beside what p is."""
    off = []
    for known in model.knowns:
        if known.sd > 0:
            moved = tuple(replace(one, value=one.value + one.sd) if one is known else one for one in model.knowns)
            stands = output.value.has(known.symbol)
            off.append(output_at(replace(model, knowns=moved), p, output)[0] - value if stands else 0.0)
    return off


@lru_cache(maxsize=256)
def _gradient(value: sp.Expr, p: tuple[sp.Symbol, ...]) -> Any:
    """A function of p: the value, then its slopes."""
    return numpy_function(p, [value, *(value.diff(symbol) for symbol in p)])


def output_at(model: CompiledModel, p: Float, output: Output) -> tuple[float, Float]:
    """Value at p and its gradient [n_p]; NaN where it does not exist at p."""
    value = model.with_knowns(output.value)
    with np.errstate(all="ignore"):
        at, *slopes = (complex(one) for one in _gradient(value, model.p)(*p.astype(complex)))
    if abs(at.imag) > 0:
        return float("nan"), np.full(len(p), np.nan)
    return at.real, np.array(slopes).real
