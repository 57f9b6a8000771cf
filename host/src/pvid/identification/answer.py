"""What the identification of a recording finds: the answer, each of its values, and what a refinement made of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base.rounding import part_of_one, with_error
from pvid.base.wording import listed
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.choice import Scored
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import Identified
from pvid.oracle.weak.naming import terms_of
from pvid.oracle.weak.verdict import ParameterStatus, Reason, Verdict
from pvid.oracle.weak.weights import Weights
from pvid.oracle.weak.words import Word
from pvid.rig.run import Recording

if TYPE_CHECKING:
    from pvid.identification.refinement.fit import Problem, Refined
    from pvid.identification.validation import Validation

Float = npt.NDArray[np.float64]

_NOISE = 2.0  # chi^2 over the sensors' noise up to which it explains the residuals
_CLEAR = 2.0  # standard errors: a change beyond them is said

LEVEL = 0.95  # of the intervals that are shown


def interval_of(value: float, se: float, below: float | None, level: float = LEVEL) -> tuple[float, float]:
    """In which a parameter is with this probability, from 0 to 1; what may be 0 is positive, and at most `below`."""
    reach = NormalDist().inv_cdf((1 + level) / 2) * se
    low, high = value - reach, value + reach
    return (low, high) if below is None else (max(low, 0.0), max(high, below))


@dataclass(frozen=True, eq=False)
class Factors:
    """What moves a value, for what it has in common with others: by one standard deviation of each independent part of
    the noise; of each gain, constant and clock; and by each term that the equations may lack.
    """

    noise: Float
    scale: Float
    model: Float


@dataclass(frozen=True)
class Value:
    """A parameter, or what follows from p.

    Attributes
    ----------
    value, se : its standard error; None where it is not identified
    se_noise, se_scale, se_model : its parts, whose squares add up to its own: from noise; from gains, constants, the
        clock and linearised equations; from what the equations seem to lack
    status, reason : whether the run determines it; a clause where it does not, or where it may be 0
    below : it is below this with 95 %, where it may be 0
    word : what it may be used for
    factors : what noise, scale and what is missing move it by; None: alone
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
    factors: Factors | None = field(default=None, repr=False, compare=False)

    def interval(self, level: float = LEVEL) -> tuple[float, float] | None:
        """In which it is with this probability; None: it is not identified."""
        if self.value is None or self.se is None:
            return None
        return interval_of(self.value, self.se, self.below, level)

    def as_json(self) -> dict[str, Any]:
        """Its entry in the object of `identify --json`."""
        interval = self.interval()
        out: dict[str, Any] = {"value": self.value, "se": self.se, "unit": self.unit, "se_noise": self.se_noise}
        out |= {"interval": None if interval is None else list(interval)}
        out |= {"se_scale": self.se_scale, "se_model": self.se_model, "verdict": self.word, "status": self.status}
        out |= {} if self.reason is None else {"reason": self.reason}
        return out | ({} if self.below is None else {"below": self.below})


class Answer(ABC):
    """What an identification of a recording found, by any identifier: what is printed, drawn and returned.

    Attributes
    ----------
    model : with the values of the rig file
    recording : the samples
    values : by name: outputs of the model, then p
    verdict : what they may be used for
    identified : whether there is a value
    identifier : which one it is: form and arithmetic
    lines, method : what is said of it below the values, and in words of the method
    advice : sentences with what to type, where a column seems to be wrong
    """

    model: CompiledModel
    recording: Recording
    values: Mapping[str, Value]
    advice: tuple[str, ...]

    @property
    @abstractmethod
    def verdict(self) -> Verdict: ...

    @property
    @abstractmethod
    def identified(self) -> bool: ...

    @property
    @abstractmethod
    def identifier(self) -> str: ...

    @property
    def lines(self) -> list[str]:
        """None, unless there is a prediction."""
        return []

    @property
    @abstractmethod
    def method(self) -> list[str]: ...

    @property
    def status(self) -> str:
        """The last word of the identifier."""
        return self.verdict.status

    @property
    def unseen(self) -> Validation | None:
        """How its equations predict motion that was not fitted: in the halves of the recording, each of them with what
        the other gives. None: they were not simulated."""
        return None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the values that are identified."""
        return tuple(name for name, one in self.values.items() if one.value is not None and self.identified)

    @property
    def covariance_of_values(self) -> Float:
        """Of the identified values, in the order of `names` [n, n]: its diagonal is their squared standard errors.

        Noise and scale are those of independent causes. The part of the model is as large as for the term that moves a
        value most, and correlated as over all terms.
        """
        known = [self.values[name] for name in self.names]
        out = np.diag([(one.se or 0.0) ** 2 for one in known])
        for k, one in enumerate(known):
            for j, other in enumerate(known[:k]):
                out[j, k] = out[k, j] = _common(one, other)
        return out

    @property
    def doubts(self) -> Sequence[Reason]:
        """The reasons that are printed below the values."""
        return self.verdict.reasons

    @property
    def why_nothing(self) -> str:
        """Why there is no value, in a clause; "": the doubts say it."""
        return ""

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        verdict = self.verdict
        return {
            "identified": self.identified,
            "verdict": verdict.word,
            "status": verdict.status,
            "warning": verdict.warning,
            "advice": list(self.advice),
            "reasons": {one.name: one.text for one in verdict.reasons},
            "parameters": {name: one.as_json() for name, one in self.values.items()},
            "input": list(self.recording.notes),
            "samples": len(self.recording),
            "model": self.model.name,
        }


def _common(one: Value, other: Value) -> float:
    """Covariance of two values."""
    a, b = one.factors, other.factors
    if a is None or b is None:
        return 0.0
    sizes = float(np.linalg.norm(a.model) * np.linalg.norm(b.model))
    by_model = float(a.model @ b.model) / sizes * (one.se_model or 0.0) * (other.se_model or 0.0) if sizes else 0.0
    return float(a.noise @ b.noise + a.scale @ b.scale) + by_model


class RefinedFit(Protocol):
    """An outcome of a refinement, as pvid.identification.refinement.problem makes it."""

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
class Analysis(Answer):
    """An identification in float64.

    Attributes
    ----------
    model : with the values of the rig file
    found : estimate and verdict
    values : by name: outputs of the model, then p
    recording : the samples
    weights : of the rows
    advice : sentences with what to type, where a column seems to be wrong
    unseen : how motion is predicted that was not fitted; None: it was not looked at
    predicted : the same in each of several recordings, by name
    refinement : None: none was tried
    """

    model: CompiledModel
    found: Identified
    values: Mapping[str, Value]
    recording: Recording
    weights: Weights = "residuals"
    advice: tuple[str, ...] = ()
    unseen: Validation | None = None
    predicted: Mapping[str, tuple[SensorPrediction, ...]] = field(default_factory=dict)
    refinement: Refinement | None = None

    @property
    def prediction(self) -> tuple[SensorPrediction, ...]:
        """How well each sensor's motion is predicted that was not fitted."""
        return () if self.unseen is None else self.unseen.sensors

    @property
    def identified(self) -> bool:
        """Whether at least one parameter is."""
        return self.found.verdict.identified

    @property
    def verdict(self) -> Verdict:
        """That of the estimate."""
        return self.found.verdict

    @property
    def analysis(self) -> Analysis:
        """Itself: an answer of the C core has one beside it."""
        return self

    @property
    def stage(self) -> str:
        """Whose the values are."""
        return "refined" if self.refinement is not None and self.refinement.adopted else "weak form"

    @property
    def identifier(self) -> str:
        """Form and arithmetic."""
        return f"{self.stage}, float64"

    @property
    def lines(self) -> list[str]:
        """The prediction, or the drift, with which none is made."""
        if self.drift:
            return [f"{self.drift}; motion is not predicted"]
        return [f"predicts motion that was not fitted: {listed(self.prediction)}"] if self.prediction else []

    @property
    def drift(self) -> str:
        """What drifted clearly, in a clause; "": there is nothing that drifts, or no value."""
        if self.found.drifted is None or not self.identified:
            return ""
        course = course_of(self.found, self.model)
        if not course:
            return "parameters may drift: the values are those of the end of the last recording"
        clear = {name: one for name, one in course.items() if _is_clear(**one["change"])}
        if not clear:
            return "no drift beyond its error"
        ways = "; ".join(_drift_text(name, one) for name, one in clear.items())
        return f"drifted, the values are those of the end: {ways}"

    @property
    def method(self) -> list[str]:
        """Residuals, the memory of a drift, and the refinement."""
        found = self.found
        explained = ", ".join(f"{name} {part_of_one(value, 6)}" for name, value in found.r2.items())
        of_weak = "" if self.stage == "weak form" else "weak form: "
        lines = [
            f"{of_weak}chi2 {found.chi2:.2g}; {len(found.times)} windows of "
            f"{found.design.window_s:.3g} s; R^2 {explained}"
        ]
        if found.drifted is not None:
            lines.append(f"drift with a memory of {found.drifted.memory_s:.2g} s")
        if self.refinement is not None:
            extras = self.refinement.fit.extras if self.refinement.fit is not None and self.refinement.adopted else {}
            shown = [f"{name} {value:.3g} ± {se:.1g}" for name, (value, se) in extras.items()]
            lines.append("; ".join([self.refinement.text, *([", ".join(shown)] if shown else [])]))
        return lines

    @property
    def is_explained(self) -> bool:
        """Whether the residuals are those of the sensors' noise, or a named term explains the rest of them: estimates
        of the same equations are then alike, or all lack the same."""
        named = self.found.named
        return (self.found.chi2 <= _NOISE and self.identified) or (named is not None and named.complete)

    @property
    def ranking(self) -> tuple[Scored, ...]:
        """The designs that were tried, where they were compared as the identifier's are; else ()."""
        return self.found.ranking if self.weights == "residuals" else ()

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        found = self.found
        return (
            super().as_json()
            | {
                "missing": missing_of(found),
                "chi2": found.chi2,
                "r2": found.r2,
                "prediction": {one.name: one.as_json() for one in self.prediction},
                **recordings_of(self),
                "window_s": found.design.window_s,
                "windows": len(found.times),
                "weights": self.weights,
                "core": "f64",
                "form": "weak",
            }
            | ({} if self.refinement is None else {"refinement": self.refinement.as_json()})
            | ({"course": course} if (course := course_of(found, self.model)) else {})
        )


def recordings_of(answer: Analysis) -> dict[str, Any]:
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


def course_of(found: Identified, model: CompiledModel) -> dict[str, Any]:
    """Of each parameter that drifts, where it was at the start and at the end, and how far it has gone; {}: none, or
    several recordings, between which nothing is known of it.

    The end is that of the values. What the noise of the end exceeds that of its course by, and what gains and missing
    terms move it by, is in the errors of all three, in those of the change in proportion to it.
    """
    drifted = found.drifted
    if drifted is None or np.ptp(found.fit.rows.recordings) > 0:
        return {}
    out = {}
    for k in model.drifting:
        start, end, se = drifted.p[0, k], found.p[k], found.se[k]
        more = max(1.0, found.noise[k] / drifted.se[-1, k])
        common = np.sqrt(max(se**2 - found.noise[k] ** 2, 0.0))
        part = abs(end - start) / max(abs(start), abs(end), 1e-300)
        change_se = np.hypot(more * drifted.change_se[k], part * common)
        begin_se = np.hypot(more * drifted.se[0, k], common)
        ways = {"start": (start, begin_se), "end": (end, se), "change": (end - start, change_se)}
        parts = {name: {"value": float(value), "se": float(se)} for name, (value, se) in ways.items()}
        out[model.p_names[k]] = {"unit": model.unknowns[k].unit, **parts}
    return out


def _is_clear(value: float, se: float) -> bool:
    return abs(value) > _CLEAR * se


def _drift_text(name: str, course: Mapping[str, Any]) -> str:
    start, end, change = (" ± ".join(with_error(*course[one].values())) for one in ("start", "end", "change"))
    return f"{name} from {start} to {end} {course['unit']}, by {change}"


def missing_of(found: Identified) -> dict[str, Any] | None:
    """What the equations seem to lack, and the parameters with it; None: nothing that moves a parameter visibly."""
    named = found.named
    if named is None:
        return None
    with_it = zip(found.names, named.fit.p, uncertainty(named.fit).se, strict=True)
    parameters = {name: {"value": float(p), "se": float(se)} for name, p, se in with_it}
    terms = [asdict(one) for one in terms_of(found.fit, named)]
    return {"explained": named.complete, "share": named.share, "terms": terms, "parameters": parameters}
