"""The answer for a pendulum's run, of either form; and the strong form's, by one core."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.cases import case_of
from pvid.core.native import Native
from pvid.models.model import Model
from pvid.oracle import strong as oracle
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.rig.sensor_steps import resolved
from pvid.settings.enums import Form, Reason
from pvid.settings.f32 import StrongConfig
from pvid.settings.forms import FORMS
from pvid.setup.f32 import bank_of, strong_config
from pvid.setup.ranges_q31 import Beyond

Float = npt.NDArray[np.float64]

# Largest relative standard error of the first parameter of an identified run, in the strong form.
WORST_SE = 0.1
# Largest angle from rest for which the weak form's equations are meant [rad]: sines are approximated.
VALID_ANGLE = 0.2

# Last reasons of the strong form with which a run is identified.
_GOOD = (Reason.UPDATED.text, Reason.MISFIT.text, Reason.ACCUMULATED.text)

# Status of a run that is not identified because too many samples are beyond the fixed-point core's ranges.
SATURATED = "saturated"
# Status of a run with drive and motion in which the core reports no excitation: the equations do not fit it.
UNEXPLAINED = "held not explained"

# Share of the samples beyond the fixed-point core's ranges that gives a warning beside an estimate.
_BEYOND_WARNED = 0.01
# From here on they are the reason why a run is not identified.
_BEYOND_FATAL = 1e-3


@dataclass(frozen=True)
class Trajectory:
    """Estimates over time, for a figure: t [n] in s, mapped parameters p and their se [n, n_mapped]; physical ones and
    their errors [n, n_physical], NaN outside the physical region; kappa [n]. Standard errors contain those of the
    scales, as Identification.se does."""

    t: Float
    p: Float
    se: Float
    physical: Float
    physical_se: Float
    kappa: Float


@dataclass(frozen=True)
class Publications:
    """Every estimate that was published during a run: t [n] in s, the mapped parameters p and their standard errors
    [n, n_mapped], and whether the misfit alarm was raised [n]."""

    t: Float
    p: Float
    se: Float
    alarm: npt.NDArray[np.bool_]

    @classmethod
    def none(cls, model: Model) -> Publications:
        """Of a run in which nothing was published, or of a form that publishes nothing."""
        nothing = np.zeros((0, model.n_mapped))
        return cls(np.zeros(0), nothing, nothing, np.zeros(0, np.bool_))


@dataclass(frozen=True)
class ErrorParts:
    """Parts of a standard error, in the parameter's unit: `noise`, that of the run; `scales`, those of the model's
    scales by name."""

    noise: float
    scales: Mapping[str, float]

    @property
    def whole(self) -> float:
        """The standard error."""
        return float(np.sqrt(sum((one**2 for one in self.scales.values()), self.noise**2)))


@dataclass(frozen=True)
class Identification:
    """Result of a run.

    model
        of the mechanism: names and units of the parameters
    value, se
        the mapped parameters, the offset where it is estimated and, inside the physical region, the physical
        parameters, with their standard errors. If `identified` is false they are the start, not an estimate.
    parts
        of the standard errors; empty if the run is not identified
    trusted_s, first_publication_s
        times of the core's last and first publication [s]; None: never. trusted_s is None in the strong form, which
        publishes every estimate
    chi2
        residual variance over its expectation from the sensors' noise; None: not judged yet, or the strong form
    alarm
        whether chi2 is too large. The strong form has its own alarm (pvid/misfit.h); its float64 core has none
    status
        the last tick's reason in words, or SATURATED or UNEXPLAINED
    ticks, updates, lost
        samples; steps of the estimate; samples that were rejected
    reasons
        count of each reason, in ticks (core f64: in windows or rows)
    largest_angle
        of phi from its rest [rad]
    beyond
        samples beyond the ranges of the fixed-point core, and a clause about them; None in other cores
    notes
        from reading the run
    advice
        sentences with a likely fault and its remedy (pvid.run.advice)
    publications
        of the weak form's C cores; their standard errors contain those of the scales
    hash
        None where the core has none (f64)
    doubts
        alarms of the weak engine's verdict, a sentence each; None: the answer is of another form
    remarks
        what else the verdict says, a sentence each
    refinement
        pvid.run.refined_identify.RefinementVerdict; None where none was asked for
    """

    model: Model
    value: dict[str, float]
    se: dict[str, float]
    kappa: float
    trusted_s: float | None
    chi2: float | None
    alarm: bool
    status: str
    ticks: int
    updates: int
    lost: int
    hash: int | None
    core: str
    form: Form
    law: str
    on: str
    trajectory: Trajectory
    publications: Publications
    parts: dict[str, ErrorParts] = field(default_factory=dict)
    first_publication_s: float | None = None
    reasons: Mapping[str, int] = field(default_factory=dict)
    largest_angle: float = 0.0
    beyond: Beyond | None = None
    beyond_words: str | None = None
    notes: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()
    doubts: tuple[str, ...] | None = None
    remarks: tuple[str, ...] = ()
    refinement: Any = None

    @property
    def method(self) -> str:
        """What made the answer, in words."""
        made = f"{self.form} form, {self.law} law, core {self.core}"
        refined = self.refinement is not None and self.refinement.adopted
        return f"refinement in float64 after the {made}" if refined else made

    @property
    def identified(self) -> bool:
        """Whether the run is identified: an estimate was published; in the strong form, the last reason is no refusal
        and the first parameter is accurate enough."""
        first = self.model.p_names[0]
        return _is_answer(self.form, self.trusted_s, self.updates, self.status, self.se[first], self.value[first])

    @property
    def modes_hz(self) -> tuple[float, ...]:
        """Natural frequencies of the estimate [Hz], the slowest first; () if the run is not identified."""
        if not self.identified:
            return ()
        return self.model.modes_hz(np.array([self.value[name] for name in self.model.mapped_names]))

    @property
    def warning(self) -> str | None:
        """Reasons to doubt the estimate, in words; None if there are none."""
        words = list(self.doubts or ())
        if not words and self.alarm:
            words.append(
                "the residuals of the rows are too large: the encoder is too coarse for the strong form, a jolt is in "
                "sums without forgetting, or the mechanism has changed; do not trust the estimate"
                if self.chi2 is None
                else f"the residuals have {self.chi2:.1f} times the variance that the sensors' noise explains: the "
                "errors exceed the standard errors"
            )
        if self.identified and self.beyond is not None and self.beyond.share >= _BEYOND_WARNED:
            words.append(f"{self.beyond_words}: those samples were left out")
        return " ".join(words) or None

    @property
    def is_old(self) -> bool:
        """Whether the run's last windows published nothing: the estimate is that of trusted_s."""
        if self.doubts is not None:  # the verdict says so
            return False
        new = (Reason.UPDATED.text, Reason.MISFIT.text, Reason.ACCUMULATED.text)
        return self.trusted_s is not None and self.status not in new

    @property
    def verdict(self) -> str:
        """The reason why the run is not identified, in words."""
        if not FORMS[self.form].publishes and self.updates and self.status in _GOOD:
            first = self.model.p_names[0]
            return f"the standard error of {first} is {100 * self.se[first] / abs(self.value[first]):.0f} % of it"
        return f"{self.status}: {self.beyond_words}" if self.status == SATURATED else self.status


def _is_answer(form: Form, trusted_s: float | None, updates: int, status: str, se: float, value: float) -> bool:
    if FORMS[form].publishes:
        return trusted_s is not None
    return updates > 0 and status in _GOOD and se <= WORST_SE * abs(value)


def identify(
    run: Run, rig: RigFile, native: Native, *, start: npt.ArrayLike | None = None, points: int = 400
) -> Identification:
    """Identifies a run by the strong form, with the core and law of the rig file.

    Parameters
    ----------
    run, rig
        The samples and the rig they come from.
    native
        The C core, used by cores "f32" and "q31".
    start
        p = (w, d1, d2) to start from; by default the rig file's nominal.
    points
        Number of points of the trajectory.

    Raises
    ------
    PvidError
        When the run is shorter than the window, or the settings do not fit the core.
    """
    rig = resolved(rig, run)
    config = strong_config(rig, run.sample_rate, start)
    if len(run.t) < config.ticks_needed:
        raise PvidError(
            f"the run has {len(run.t)} samples and the strong form needs {config.ticks_needed} for its first "
            f"estimate: record longer or shorten window_s"
        )
    every = max(1, len(run.t) // points)
    if rig.identifier.core == "f64":
        return _in_float64(run, rig, config, every)
    return _in_core(run, rig, start, every, native)


def _in_core(run: Run, rig: RigFile, start: npt.ArrayLike | None, every: int, native: Native) -> Identification:
    """Identifies a run with the C core of the rig file's arithmetic."""
    case = case_of(rig.identifier)
    rig = case.with_ranges(rig, run)
    config, samples = case.settings_for_run(rig, run, start), case.samples(rig, run)
    identifier = native.identifier(config)
    record = identifier.run(*samples, sums=False, estimate_every=every)
    counters, last = identifier.counters, identifier.estimate
    updated = np.flatnonzero(np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)))
    beyond = case.beyond(config, *samples)
    n_p = record.p.shape[1]
    return _identification(
        rig,
        run,
        p=case.p_of(config, last["p"][:n_p]),
        covariance=case.covariance_of(config, last),
        kappa=float(case.kappa_of(last)),
        first_publication_s=float(run.t[updated[0]]) if len(updated) else None,
        reasons=counted(record.reason),
        beyond=beyond,
        beyond_words=None if beyond is None else beyond.words(rig.sensor),
        alarm=bool(len(updated)) and bool(record.reason[updated[-1]] == Reason.MISFIT),
        status=_final_status(record.reason),
        ticks=len(run.t),
        updates=counters["updates"],
        lost=counters["rejected_not_finite"] + counters["rejected_saturated"],
        running_hash=identifier.running_hash,
        trajectory=_trajectory(
            run.t[::every],
            case.p_of(config, record.estimate["p"][:, :n_p]),
            case.covariance_of(config, record.estimate),
            rig,
            case.kappa_of(record.estimate),
        ),
    )


def _in_float64(run: Run, rig: RigFile, config: StrongConfig, every: int) -> Identification:
    bank = bank_of(rig, run.sample_rate)
    d_phi = bank.apply(run.phi, run.sample_rate).T
    d_y = bank.apply(run.y, run.sample_rate).T
    u = d_y[:, 2:5] / rig.l1
    rate = run.sample_rate / bank.every
    driven = oracle.driven(u[:, 0], rate, config.drive_min)
    if not driven.any():
        return _start_held(run, rig, config)
    n, y = oracle.strong_rows(d_phi[driven], u[driven])
    settings = config.estimator
    result = oracle.identify_strong(
        n,
        y,
        oracle.Settings(
            start=settings.start.astype(np.float64),
            start_sd=settings.start_sd.astype(np.float64),
            lower=settings.lower.astype(np.float64),
            upper=settings.upper.astype(np.float64),
            row_sd=settings.row_sd,
            rate=rate,
            law=rig.identifier.law,
            feedback_hz=settings.feedback_hz,
            forgetting_s=settings.forgetting_s,
            correlation=settings.correlation,
            step_limit=settings.step_limit,
            kappa_min=settings.kappa_min,
            divider=settings.divider,
        ),
        estimate_every=every,
    )
    times = run.t[config.window - 1 :: config.every][driven][[tick for tick, _ in result.estimates]]
    moved_at_end = bool(driven[-1] and result.updated[-settings.divider :].any())
    return _identification(
        rig,
        run,
        p=result.last.p,
        covariance=result.last.covariance,
        kappa=result.last.kappa,
        alarm=False,
        status=(Reason.UPDATED if moved_at_end else Reason.HELD_NOT_EXCITED).text,
        reasons=_windows_counted(result.updated, result.updated),
        ticks=len(run.t),
        updates=int(result.updated.sum()),
        lost=0,
        running_hash=None,
        trajectory=_trajectory(
            times,
            np.array([estimate.p for _, estimate in result.estimates]),
            np.array([estimate.covariance for _, estimate in result.estimates]),
            rig,
            np.array([estimate.kappa for _, estimate in result.estimates]),
        ),
    )


def _start_held(run: Run, rig: RigFile, config: StrongConfig) -> Identification:
    """The result of a run without a drive: the start with its standard deviations."""
    p = config.estimator.start.astype(np.float64)
    covariance = np.diag(config.estimator.start_sd.astype(np.float64) ** 2)
    return _identification(
        rig,
        run,
        p=p,
        covariance=covariance,
        kappa=0.0,
        alarm=False,
        status=Reason.HELD_NOT_EXCITED.text,
        reasons={Reason.HELD_NOT_EXCITED.text: len(run.t)},
        ticks=len(run.t),
        updates=0,
        lost=0,
        running_hash=None,
        trajectory=_trajectory(run.t[[0, -1]], np.stack([p, p]), np.stack([covariance, covariance]), rig, np.zeros(2)),
    )


def _trajectory(t: Float, p: Float, covariance: Float, rig: RigFile, kappa: Float) -> Trajectory:
    """The trajectory of p [n, n_p] with its covariance [n, n_p, n_p]."""
    mechanism = rig.mechanism
    n = mechanism.model.n_mapped
    p, covariance = p[:, :n], covariance[:, :n, :n]
    wide = covariance + mechanism.added_covariance(p, rig.scale_sd)
    noise = mechanism.physical_errors(p, covariance)
    scales = mechanism.scale_errors(p, rig.scale_sd).values()
    return Trajectory(
        t=t,
        p=p,
        se=np.sqrt(np.diagonal(wide, axis1=-2, axis2=-1)),
        physical=mechanism.physical(p),
        physical_se=np.sqrt(sum((one.physical**2 for one in scales), noise**2)),
        kappa=kappa,
    )


_REJECTED = (Reason.REJECTED_NOT_FINITE, Reason.REJECTED_SATURATED)


def _final_status(reasons: npt.NDArray[np.uint8]) -> str:
    """The last reason in words, without ticks that only accumulate; if the windows fill again after a rejected sample,
    the reason of the rejection."""
    solved = reasons[reasons != Reason.ACCUMULATED]
    if len(solved) == 0:
        return Reason.ACCUMULATED.text
    before = solved[solved != Reason.WARMING_UP]
    if solved[-1] == Reason.WARMING_UP and len(before) and before[-1] in _REJECTED:
        return Reason(int(before[-1])).text
    return Reason(int(solved[-1])).text


def counted(reasons: npt.NDArray[np.uint8]) -> dict[str, int]:
    """Count of each reason."""
    counts = np.bincount(reasons)
    return {Reason(int(one)).text: int(counts[one]) for one in np.flatnonzero(counts)}


def _windows_counted(updated: npt.NDArray[np.bool_], good: npt.NDArray[np.bool_]) -> dict[str, int]:
    """Count of each reason in the float64 core's windows: `updated` moved p [n], `good` published [n]."""
    counts = {
        Reason.UPDATED.text: int(good.sum()),
        Reason.HELD_UNCERTAIN.text: int((updated & ~good).sum()),
        Reason.HELD_NOT_EXCITED.text: int((~updated).sum()),
    }
    return {name: count for name, count in counts.items() if count}


def largest_angle(run: Run, rest: float | None) -> float:
    """Largest |phi - rest| of a run [rad]; None: from the median."""
    phi = run.phi[np.isfinite(run.phi)]
    if not len(phi):
        return 0.0
    return float(np.abs(phi - (np.median(phi) if rest is None else rest)).max())


def _identification(
    rig: RigFile,
    run: Run,
    *,
    p: Float,
    covariance: Float,
    kappa: float,
    first_publication_s: float | None = None,
    alarm: bool,
    status: str,
    reasons: Mapping[str, int],
    ticks: int,
    updates: int,
    lost: int,
    running_hash: int | None,
    trajectory: Trajectory,
    beyond: Beyond | None = None,
    beyond_words: str | None = None,
) -> Identification:
    """The answer of the strong form, with the errors of the scales."""
    mechanism = rig.mechanism
    model = mechanism.model
    names = model.p_names[: len(p)]
    value = dict(zip(names, map(float, p), strict=True))
    noise = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    physical = mechanism.physical(p)
    if np.isfinite(physical).all():
        value.update(zip(model.physical_names, map(float, physical), strict=True))
        noise.update(zip(model.physical_names, map(float, mechanism.physical_errors(p, covariance)), strict=True))
    se, parts = noise, {}
    answered = _is_answer(rig.identifier.form, None, updates, status, noise[names[0]], value[names[0]])
    if answered:
        parts = parts_of(noise, p, rig)
        se = {name: one.whole for name, one in parts.items()}
    elif beyond is not None and beyond.share >= _BEYOND_FATAL:
        status = SATURATED
    return Identification(
        model=model,
        value=value,
        se=se,
        parts=parts,
        kappa=kappa,
        trusted_s=None,
        first_publication_s=first_publication_s,
        chi2=None,
        alarm=alarm,
        status=status,
        reasons=reasons,
        ticks=ticks,
        updates=updates,
        lost=lost,
        largest_angle=largest_angle(run, value.get(model.offset_name) if answered else None),
        beyond=beyond,
        beyond_words=beyond_words,
        hash=running_hash,
        core=rig.identifier.core,
        form=rig.identifier.form,
        law=rig.identifier.law,
        on="host",
        trajectory=trajectory,
        publications=Publications.none(model),
    )


def parts_of(noise: Mapping[str, float], p: Float, rig: RigFile) -> dict[str, ErrorParts]:
    """Parts of the standard error of every parameter in `noise`."""
    model, scales = rig.mechanism.model, rig.mechanism.scale_errors(p, rig.scale_sd)
    order = (*model.mapped_names, *model.physical_names)
    sizes = {
        scale: dict(zip(order, np.abs(np.append(error.p, error.physical)), strict=True))
        for scale, error in scales.items()
    }
    return {
        name: ErrorParts(one, {scale: float(of.get(name, 0.0)) for scale, of in sizes.items()})
        for name, one in noise.items()
    }
