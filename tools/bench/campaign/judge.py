"""What an answer is worth, with the truth at hand: one record a rig."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.campaign.truth import SimulatedRig
from pvid.base.errors import PvidError
from pvid.identification.answer import Analysis
from pvid.identification.core import CoreAnswer, Publications, identify_in_c
from pvid.identification.reading import read_all
from pvid.identification.road import identified
from pvid.settings.forms import AnyCore

Float = npt.NDArray[np.float64]

NAMES = ("w", "d1", "d2")

# An answer is wrong where an error exceeds both, right where it is within either.
WRONG_SE, WRONG_RELATIVE = 3.0, 0.01
RIGHT_SE, RIGHT_RELATIVE = 2.0, 0.003
# The data of a run suffice when its bound of w and d1 is below this, relative.
SUFFICES = 0.01

Value = float | int | bool | str | None
Record = dict[str, Value]

# Columns of a record, with their types; numbers and texts are None where there is nothing to say.
COLUMNS: dict[str, type] = {
    **dict.fromkeys(("seed", "rig"), int),
    **dict.fromkeys(("condition", "combined", "drive"), str),
    **dict.fromkeys(("l1", "w_true", "d1_true", "d2_true", "slow_hz", "fast_hz"), float),
    **dict.fromkeys(("sample_rate", "duration", "phi_lsb", "y_lsb", "largest_phi", "gain"), float),
    **dict.fromkeys(("bound_w", "bound_d1", "bound_d2"), float),
    **dict.fromkeys(("suffices", "published", "answered", "within_1", "within_5"), bool),
    **dict.fromkeys(("warned", "silently_wrong", "right", "missed", "crashed"), bool),
    **{f"{name}{what}": float for name in NAMES for what in ("", "_se", "_error", "_z")},
    **dict.fromkeys(("worst_error", "misfit", "first_s"), float),
    **dict.fromkeys(("publications", "publications_wrong", "publications_right", "publications_right_alarmed"), int),
    **dict.fromkeys(("status", "reason", "warning"), str),
    "seconds": float,
}


@dataclass(frozen=True)
class Judgement:
    """Errors of an estimate of w, d1, d2: relative [3], and in its standard errors [3]."""

    relative: Float
    z: Float

    @classmethod
    def of(cls, p: npt.ArrayLike, se: npt.ArrayLike, truth: Float) -> Judgement:
        """From estimates and standard errors, shape (..., 3). Where a standard error is 0, z is infinite."""
        values, errors = np.asarray(p, np.float64), np.asarray(se, np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(values == truth, 0.0, np.abs(values - truth) / errors)
        return cls(np.abs(values / truth - 1), z)

    @property
    def wrong(self) -> npt.NDArray[np.bool_]:
        """Whether one of the three is off by more than 3 standard errors and more than 1 %."""
        return np.asarray(((self.relative > WRONG_RELATIVE) & (self.z > WRONG_SE)).any(axis=-1))

    @property
    def right(self) -> npt.NDArray[np.bool_]:
        """Whether each is within 0.3 % or within 2 standard errors."""
        return np.asarray(((self.relative <= RIGHT_RELATIVE) | (self.z <= RIGHT_SE)).all(axis=-1))

    @property
    def answers(self) -> npt.NDArray[np.bool_]:
        """Whether each is within 1 % or within 3 standard errors: not wrong."""
        return np.asarray(((self.relative <= WRONG_RELATIVE) | (self.z <= WRONG_SE)).all(axis=-1))


def identify_rig(
    simulated: SimulatedRig, core: AnyCore = "f64", *, refine: bool = True
) -> tuple[Record, Analysis | CoreAnswer | None]:
    """Identifies a rig as `pvid identify` does; the record of `judge`, and the answer.

    A crash is no refusal: it is recorded as one, with its exception as the reason.
    """
    began = time.perf_counter()
    try:
        recording, model = read_all(simulated.file, [lambda _: simulated.run.recording], (), None)
        if core == "f64":
            result: Analysis | CoreAnswer = identified(recording, model, refine=refine)
        else:
            result = identify_in_c(identified(recording, model, refine=False), core)
    except PvidError as error:
        return judge(simulated, None, refusal=str(error), seconds=time.perf_counter() - began), None
    except Exception as error:  # one rig must not end the campaign, nor be taken for a refusal
        record = judge(simulated, None, refusal=f"{type(error).__name__}: {error}", seconds=time.perf_counter() - began)
        return {**record, "crashed": True}, None
    return judge(simulated, Told.of(result), refusal=None, seconds=time.perf_counter() - began), result


@dataclass(frozen=True)
class Told:
    """What an answer says.

    Attributes
    ----------
    values : of the parameters in NAMES: value and standard error; empty where one of them is not identified
    verdict, warning : in words
    misfit : residuals over what the sensors explain
    reason : why there are no values
    publications : of a C core
    """

    values: Mapping[str, tuple[float, float]]
    verdict: str
    warning: str | None
    misfit: float | None
    reason: str | None = None
    publications: Publications | None = None

    @classmethod
    def of(cls, result: Analysis | CoreAnswer) -> Told:
        """An answer of `identify`."""
        if isinstance(result, CoreAnswer):
            verdict, misfit, text, publications = result.verdict, result.misfit, "", result.publications
        else:
            verdict, misfit, publications = result.found.verdict, result.found.chi2, None
            text = "" if result.refinement is None else f"; {result.refinement.text}"
        values = {
            name: (one.value, one.se)
            for name, one in result.values.items()
            if name in NAMES and one.value is not None and one.se is not None and result.identified
        }
        whole = values if len(values) == len(NAMES) else {}
        return cls(
            whole, verdict.word, verdict.warning, misfit, (verdict.warning or verdict.status) + text, publications
        )


def judge(simulated: SimulatedRig, told: Told | None, *, refusal: str | None, seconds: float) -> Record:
    """One record: the rig, its bound, the answer, and what the answer is worth; None where there is none."""
    suffices = bool((simulated.bound[:2] < SUFFICES).all())
    record: Record = {**_of_rig(simulated), "suffices": suffices, "seconds": round(seconds, 3)}
    published = told is not None and bool(told.values)
    record["published"] = published
    record["missed"] = suffices and not published
    for name in ("warned", "within_1", "within_5", "silently_wrong", "right", "answered", "crashed"):
        record[name] = False
    for name in NAMES:
        record.update({name: None, f"{name}_se": None, f"{name}_error": None, f"{name}_z": None})
    record.update(warning=None, misfit=None, status=None, reason=refusal, worst_error=None)
    record.update(
        first_s=None, publications=0, publications_wrong=0, publications_right=0, publications_right_alarmed=0
    )
    if told is None:
        return record
    record.update(status=told.verdict, misfit=_finite(told.misfit))
    warned = told.warning is not None
    if told.publications is not None:
        record.update(_of_publications(told.publications, simulated, warned))
    if not published:
        record["reason"] = told.reason
        return record
    value, se = np.array([told.values[name] for name in NAMES], np.float64).T
    judgement = Judgement.of(value, se, simulated.p)
    for at, name in enumerate(NAMES):
        record[name], record[f"{name}_se"] = float(value[at]), float(se[at])
        record[f"{name}_error"] = float(value[at] / simulated.p[at] - 1)
        record[f"{name}_z"] = float(judgement.z[at])
    record.update(
        warned=warned,
        warning=told.warning,
        worst_error=float(judgement.relative.max()),
        within_1=bool((judgement.relative <= 0.01).all()),
        within_5=bool((judgement.relative <= 0.05).all()),
        silently_wrong=bool(judgement.wrong) and not warned,
        right=bool(judgement.right),
        answered=bool(judgement.answers),
    )
    return record


def _of_publications(publications: Publications, simulated: SimulatedRig, alarm: bool) -> Record:
    """Seconds to the first publication; how many there were, how many of them silently wrong, right, right but with
    the alarm."""
    if len(publications.t) == 0:
        return {}
    mapped = slice(0, len(simulated.p))
    judgement = Judgement.of(publications.p[:, mapped], publications.se[:, mapped], simulated.p)
    return {
        "first_s": float(publications.t[0] - simulated.run.t[0]),
        "publications": len(publications.t),
        "publications_wrong": 0 if alarm else int(judgement.wrong.sum()),
        "publications_right": int(judgement.right.sum()),
        "publications_right_alarmed": int(judgement.right.sum()) if alarm else 0,
    }


def _of_rig(simulated: SimulatedRig) -> Record:
    rig = simulated.rig
    slow, fast = rig.modes_hz
    w, d1, d2 = simulated.p
    return {
        "seed": rig.seed,
        "rig": rig.index,
        "condition": rig.condition,
        "combined": "+".join(rig.combined),
        "l1": rig.pendulum.l1,
        "w_true": float(w),
        "d1_true": float(d1),
        "d2_true": float(d2),
        "slow_hz": slow,
        "fast_hz": fast,
        "sample_rate": rig.sample_rate,
        "duration": rig.duration,
        "drive": rig.drive,
        "phi_lsb": rig.phi_lsb,
        "y_lsb": rig.y_lsb,
        "largest_phi": simulated.largest,
        "gain": rig.gain,
        **{f"bound_{name}": _finite(simulated.bound[at]) for at, name in enumerate(NAMES)},
    }


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)
