"""The pendulum's identification by the weak engine: analysis in float64, then the C core on the same samples.

run -> description of the mechanism with the rig's values -> analysis (design, verdict) -> C core, every tick
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle.weak.choice import MODEL_ERROR
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import UNKNOWN
from pvid.rig.described import described, refuse_strong
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolved
from pvid.run.excitation import excitation_of
from pvid.run.identify import (
    UNEXPLAINED,
    VALID_ANGLE,
    Identification,
    Publications,
    Trajectory,
    largest_angle,
    parts_of,
)
from pvid.run.mechanism import MechanismAnswer, Value, identify_mechanism, model_of
from pvid.run.mechanism_core import CoreAnswer, identify_in_c
from pvid.settings.engine_cores import ENGINE_CORES
from pvid.settings.enums import Reason
from pvid.setup.f32 import nominal_start

_EXPLAINED = 0.97  # R^2 of each row kind: below, the equations do not fit the run
_FARTHEST = 20.0  # times the guess: what lies beyond is no start

NO_CORE = "No core has computed this answer"  # how a remark begins
ALL_ALIKE = f"{NO_CORE} but that of float64, which takes all windows alike: [identifier] has no effect"


@dataclass(frozen=True, eq=False)
class _Core:
    """What the C core adds to an analysis; in float64 what follows from the analysis alone."""

    values: dict[str, Value]
    p: Float
    published: bool
    reason: Reason
    chi2: float | None
    updates: int
    reasons: Mapping[str, int]
    hash: int | None
    publications: Publications
    doubts: tuple[str, ...]
    remarks: tuple[str, ...]
    t: Float
    history: Float
    se: Float


def identify_by_engine(run: Run, rig: RigFile) -> Identification:
    """Identifies a run of the pendulum by the weak engine in the core of the rig file.

    Parameters
    ----------
    run, rig
        The samples and the rig they come from.

    Raises
    ------
    PvidError
        When the recording is too short, or holds a signal beyond all reason.
    """
    refuse_strong(rig)
    run, rig = run.whole(), resolved(rig, run)
    _refuse_slow(run, rig)
    answer = identify_mechanism(run.recording, model_of(described(rig)))
    return _identification(run, *_computed(run, rig, answer))


def held_if_wide(found: Identification) -> Identification:
    """Without the estimate if its error, with what the linearised equations neglect, exceeds the engine's limit."""
    names = found.model.mapped_names
    if not found.identified or all(found.se[name] <= UNKNOWN * abs(found.value[name]) for name in names):
        return found
    far = found.largest_angle > VALID_ANGLE
    reason = Reason.HELD_OUT_OF_RANGE if far else Reason.HELD_UNCERTAIN
    return replace(
        found, trusted_s=None, first_publication_s=None, chi2=None, parts={}, doubts=(), status=reason.text, alarm=False
    )


def _refuse_slow(run: Run, rig: RigFile) -> None:
    """No guess is so wrong that samples slower than its fastest mode show the motion."""
    modes = rig.mechanism.model.modes_hz(nominal_start(rig))
    if modes and modes[-1] > run.sample_rate:
        raise PvidError(
            f"a sample rate of {run.sample_rate:g} Hz shows no mode of {modes[-1]:.3g} Hz, which the guess of the rig "
            "file has: the unit of t is probably wrong"
        )


def _computed(run: Run, rig: RigFile, answer: MechanismAnswer) -> tuple[RigFile, MechanismAnswer, _Core]:
    """By the core of the rig file; where it cannot be, by the analysis alone, which says why."""
    engine = ENGINE_CORES.get(rig.identifier.core)
    if engine is None:
        alone = _of_analysis(answer, run)
        said = () if answer.model.following.is_usual else (ALL_ALIKE,)
        return rig, answer, replace(alone, remarks=(*said, *alone.remarks))
    try:
        return rig, answer, _of_core(identify_in_c(answer, engine.name), run)
    except PvidError as error:
        in_float64 = replace(rig, identifier=replace(rig.identifier, core="f64"))
        alone = _of_analysis(answer, run)
        why = f"{NO_CORE} but that of float64: {error}"
        return in_float64, answer, replace(alone, remarks=(why, *alone.remarks))


def _of_core(found: CoreAnswer, run: Run) -> _Core:
    published = found.publications
    history, t, se = published.p, published.t, published.se
    if not len(t):
        analysis = found.oracle.found
        history, t = analysis.history, run.t[0] + analysis.times
        se = _growing(analysis.se, len(t))
    names = found.oracle.model.p_names
    given = [found.values[name].value for name in names]
    # The physical map needs every parameter.
    whole = found.identified and None not in given
    last = np.array(given, np.float64) if whole else found.oracle.found.p
    reasons = found.verdict.reasons
    return _Core(
        dict(found.values),
        last,
        whole,
        found.reason,
        found.misfit,
        len(published.t),
        found.reasons,
        found.hash,
        published,
        tuple(one.text for one in reasons if one.alarm),
        tuple(one.text for one in reasons if not one.alarm),
        t,
        history,
        se,
    )


def _of_analysis(answer: MechanismAnswer, run: Run) -> _Core:
    found, reasons = answer.found, answer.found.verdict.reasons
    windows = len(found.times)
    whole = answer.identified and all(one.value is not None for one in answer.values.values())
    return _Core(
        dict(answer.values),
        found.p,
        whole,
        Reason.UPDATED if whole else Reason.HELD_UNCERTAIN,
        found.chi2,
        windows,
        {(Reason.UPDATED if whole else Reason.HELD_UNCERTAIN).text: windows},
        None,
        Publications(np.zeros(0), np.zeros((0, len(found.p))), np.zeros((0, len(found.p))), np.zeros(0, np.bool_)),
        tuple(one.text for one in reasons if one.alarm),
        tuple(one.text for one in reasons if not one.alarm),
        run.t[0] + found.times,
        found.history,
        _growing(found.se, windows),
    )


def _growing(se: Float, windows: int) -> Float:
    """Standard errors after each window [windows, n_p], when all windows tell alike, from those after the last."""
    return np.asarray(se * np.sqrt(windows / np.arange(1.0, windows + 1))[:, None])


def _identification(run: Run, rig: RigFile, answer: MechanismAnswer, core: _Core) -> Identification:
    mechanism, found = rig.mechanism, answer.found
    model, n = mechanism.model, mechanism.model.n_mapped
    names = (*model.mapped_names, model.offset_name)
    correlation = found.covariance / np.sqrt(np.outer(np.diag(found.covariance), np.diag(found.covariance)))
    p = core.p if core.published else _start(rig, answer)
    value = dict(zip(names, map(float, p), strict=True))
    if core.published:
        noise = {name: one.se_noise for name, one in core.values.items() if name in names and one.se_noise is not None}
    else:
        noise = dict(zip(names, map(float, found.se), strict=True))
    # What linearised equations neglect moves w, d1, d2 together.
    noise_sd = np.array([noise[name] for name in names])
    covariance = correlation * np.outer(noise_sd, noise_sd) + np.outer(found.by_neglect, found.by_neglect)
    noise = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    physical = mechanism.physical(p)
    if np.isfinite(physical).all():
        value.update(zip(model.physical_names, map(float, physical), strict=True))
        noise.update(zip(model.physical_names, map(float, mechanism.physical_errors(p, covariance)), strict=True))
    parts = parts_of(noise, p, rig) if core.published else {}
    status = core.reason.text
    if not core.published:
        fits = min(found.r2.values()) > _EXPLAINED and found.chi2 <= MODEL_ERROR
        status = _why_not(run, rig, core.reason, fits)
    end = core.publications.t if len(core.publications.t) else core.t
    n_mapped = slice(0, n)
    published = core.publications
    return Identification(
        model=model,
        value=value,
        se={name: parts[name].whole if parts else one for name, one in noise.items()},
        parts=parts,
        kappa=_own_share(found.covariance),
        trusted_s=float(end[-1]) if core.published else None,
        first_publication_s=float(end[0]) if core.published else None,
        chi2=core.chi2 if core.published else None,
        alarm=False,
        doubts=core.doubts if core.published else (),
        remarks=core.remarks,
        status=status,
        reasons=core.reasons,
        ticks=len(run.t),
        updates=core.updates,
        lost=0,
        largest_angle=largest_angle(run, value[model.offset_name] if core.published else None),
        hash=core.hash,
        core=rig.identifier.core,
        form="weak",
        law="stationary",
        on="host",
        trajectory=_trajectory(core, correlation, rig),
        publications=Publications(published.t, published.p[:, n_mapped], published.se[:, n_mapped], published.alarm),
    )


def _start(rig: RigFile, answer: MechanismAnswer) -> Float:
    """What to search on from where nothing is identified: what the analysis has found, or the guess."""
    guess, found = np.array([one.guess for one in answer.model.unknowns]), answer.found.p
    model = rig.mechanism.model
    mapped = slice(0, model.n_mapped)
    with np.errstate(all="ignore"):
        near = np.abs(np.log(found[mapped] / guess[mapped])).max() < np.log(_FARTHEST)
    return found if near and model.is_plausible(found) else guess


def _why_not(run: Run, rig: RigFile, reason: Reason, fits: bool) -> str:
    """The status of a run that is not identified; fits: the residuals are about those of the sensors."""
    if reason in (Reason.UPDATED, Reason.MISFIT):  # the analysis refused it
        reason = Reason.HELD_UNCERTAIN
    if reason == Reason.HELD_NOT_EXCITED or not fits:
        try:
            if not excitation_of(run, rig).weak:
                return UNEXPLAINED
        except PvidError:
            pass
    return reason.text


def _own_share(covariance: Float) -> float:
    """Share of the information on the first parameter that the others cannot explain; 0 without information."""
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    if not np.isfinite(correlation).all():
        return 0.0
    return float(min(1.0, 1.0 / np.linalg.pinv(correlation, hermitian=True)[0, 0]))


def _trajectory(core: _Core, correlation: npt.NDArray[np.float64], rig: RigFile) -> Trajectory:
    mechanism = rig.mechanism
    n = mechanism.model.n_mapped
    p, se = core.history[:, :n], core.se[:, :n]
    covariance = correlation[:n, :n] * se[:, :, None] * se[:, None, :]
    return Trajectory(
        t=core.t,
        p=p,
        se=se,
        physical=mechanism.physical(p),
        physical_se=mechanism.physical_errors(p, covariance),
        kappa=np.full(len(core.t), _own_share(covariance[-1]) if len(p) else 0.0),
    )
