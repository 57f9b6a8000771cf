"""One run through one core: the answer that `pvid identify` prints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid import oracle
from pvid.capture import Run
from pvid.errors import PvidError
from pvid.native import Law, Native, Reason, StrongConfig, WeakConfig, WeakIdentifier
from pvid.native_q31 import StrongConfigQ31, StrongIdentifierQ31, WeakConfigQ31, WeakIdentifierQ31
from pvid.rigfile import RigFile
from pvid.setup import bank_of, config_of, weak_design_of
from pvid.setup_q31 import config_for_run, counts_of, covariance_of, p_of, se_of
from pvid.survey import fitted
from pvid.weak_oracle import WeakSettings, identify_weak

Float = npt.NDArray[np.float64]

LINEAR = ("w", "d1", "d2")
NAMED = 4  # parameters that are published; what friction the weak form estimates beside them only absorbs
ZERO = "c"

# With w known no better than this, relative, nothing is identified.
WORST_SE = 0.1

# What the strong form says of an estimate that is one.
_GOOD = (Reason.UPDATED.text, Reason.MISFIT.text, Reason.ACCUMULATED.text)

_FADING = 4  # windows after the correction's switch (weak_oracle)

# Windows that the float64 core's alarm wants to have seen.
MISFIT_WINDOWS = 16

PHYSICAL = ("g", "l2", "rho2")
UNITS = {"w": "1/s^2", "d1": "", "d2": "", "c": "rad", "g": "m/s^2", "l2": "m", "rho2": "m"}


@dataclass(frozen=True)
class Trajectory:
    """Estimates over time, for a figure: t [n] in s, p and se [n, 3]; physical and its errors [n, 3], NaN outside
    the physical region; kappa [n]."""

    t: Float
    p: Float
    se: Float
    physical: Float
    physical_se: Float
    kappa: Float


@dataclass(frozen=True)
class Publications:
    """Every estimate that was published during a run: t [n] in s, p = (w, d1, d2) and its standard errors [n, 3], and
    whether the alarm stood beside it [n]."""

    t: Float
    p: Float
    se: Float
    alarm: npt.NDArray[np.bool_]

    @classmethod
    def none(cls) -> Publications:
        """Of a run in which nothing was published, or of a form that publishes nothing."""
        return cls(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.bool_))


@dataclass(frozen=True)
class Identification:
    """What a run told.

    `value` and `se` map w, d1, d2 [1/s^2, -, -] and, inside the physical region, g, l2, rho2 [m/s^2, m, m].
    `lost` counts samples that were rejected; `hash` is None where the core has none (f64). In the weak form the values
    are the published ones (pvid/trust.h): `trusted_s` is when the last of them was trusted [s] (None: never, they are
    the start), `misfit` the variance of the residuals over what the sensors' noise explains, and `alarm` whether that
    is too much. In the strong form, which publishes whatever it has, they are the last ones, and None, None; `alarm` is
    the C cores' own (pvid/misfit.h); float64 has none. `publications` are those of the weak form's C cores.
    """

    value: dict[str, float]
    se: dict[str, float]
    kappa: float
    trusted_s: float | None
    misfit: float | None
    alarm: bool
    status: str
    ticks: int
    updates: int
    lost: int
    hash: int | None
    core: str
    form: str
    law: str
    on: str
    trajectory: Trajectory
    publications: Publications

    @property
    def identified(self) -> bool:
        """Whether this is an answer: one that was trusted; in the strong form, whose last word is no refusal and whose
        w is known."""
        if self.form == "weak":
            return self.trusted_s is not None
        return self.updates > 0 and self.status in _GOOD and self.se["w"] <= WORST_SE * abs(self.value["w"])

    @property
    def warning(self) -> str | None:
        """What makes the answer doubtful, in words; None if nothing does."""
        if self.alarm and self.misfit is not None:
            return (
                f"the residuals have {self.misfit:.1f} times the variance that the sensors' noise explains: large "
                f"angles, friction, or a wrong phi_lsb; the errors are larger than the standard errors say"
            )
        if self.alarm:
            return (
                "the rows leave more unexplained than they should: too coarse an encoder for the strong form, a jolt "
                "in sums that do not forget it, or a mechanism that has changed; the estimate is not to be believed"
            )
        if self.trusted_s is not None and self.status not in (Reason.UPDATED.text, Reason.ACCUMULATED.text):
            return f"the estimate is that of {self.trusted_s:.1f} s; since then: {self.status}"
        return None

    @property
    def verdict(self) -> str:
        """Why nothing was identified, in words."""
        if self.form == "strong" and self.updates and self.status in _GOOD:
            return f"the standard error of w is {100 * self.se['w'] / abs(self.value['w']):.0f} % of it"
        return self.status

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (DESIGN.md)."""
        names = (*LINEAR, *PHYSICAL, ZERO)
        parameters: dict[str, Any] = {
            name: {"value": self.value[name], "se": self.se[name]} if name in self.value else None for name in names
        }
        return {
            **parameters,
            "kappa": self.kappa,
            "trusted_s": self.trusted_s,
            "misfit": self.misfit,
            "warning": self.warning,
            "status": self.status,
            "ticks": self.ticks,
            "updates": self.updates,
            "lost": self.lost,
            "hash": None if self.hash is None else f"{self.hash:08x}",
            "core": self.core,
            "form": self.form,
            "law": self.law,
            "on": self.on,
        }


def identify(
    run: Run, rig: RigFile, native: Native, *, start: npt.ArrayLike | None = None, points: int = 400
) -> Identification:
    """Identifies a run with the core, form and law of the rig file.

    Parameters
    ----------
    run, rig
        The samples and the rig they come from.
    native
        The C core, used by cores "f32" and "q31".
    start
        p = (w, d1, d2) to start from; by default what the run's survey finds (pvid.survey).
    points
        Number of points of the trajectory.

    Raises
    ------
    PvidError
        When the run is shorter than the window, or the settings do not fit the core.
    """
    if start is None:
        rig = fitted(rig, run)
    config = config_of(rig, run.sample_rate, start)
    needed = _ticks_needed(config)
    if len(run.t) < needed:
        raise PvidError(
            f"the run has {len(run.t)} samples and the {rig.identifier.form} form needs {needed} for its first answer: "
            f"nothing can be identified; record longer or shorten window_s"
        )
    every = max(1, len(run.t) // points)
    if rig.identifier.core == "f32":
        return _in_float32(run, rig, config, every, native)
    if rig.identifier.core == "f64":
        if isinstance(config, StrongConfig):
            return _in_float64(run, rig, config, every)
        return _weak_in_float64(run, rig, config)
    return _in_q31(run, rig, config_for_run(rig, run, start), every, native)


def _ticks_needed(config: StrongConfig | WeakConfig) -> int:
    if isinstance(config, WeakConfig):
        # one window, and as much again as its rows and steps may take
        return config.design.taps + config.design.decimation * (config.design.window + config.hop)
    return 2 * config.delay + 1


def _in_float32(
    run: Run, rig: RigFile, config: StrongConfig | WeakConfig, every: int, native: Native
) -> Identification:
    identifier = native.weak(config) if isinstance(config, WeakConfig) else native.strong(config)
    record = identifier.run(run.phi, run.y, sums=False, estimate_every=every)
    counters = identifier.counters
    last = identifier.estimate if isinstance(identifier, WeakIdentifier) else identifier.assess()
    trusted = np.flatnonzero(np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)))
    told = len(trusted) > 0
    publishes = isinstance(identifier, WeakIdentifier)
    estimates = record.estimate
    trajectory = _trajectory(
        run.t[::every],
        estimates["p"][:, :3].astype(np.float64),
        estimates["covariance"][:, :3, :3].astype(np.float64),
        rig.l1,
        estimates["kappa"].astype(np.float64),
    )
    n_p = min(record.p.shape[1], NAMED)
    publications = Publications.none()
    if publishes:
        publications = Publications(
            t=run.t[trusted],
            p=record.published[trusted, :3].astype(np.float64),
            se=record.published_se[trusted, :3].astype(np.float64),
            alarm=record.reason[trusted] == Reason.MISFIT,
        )
    return _identification(
        rig,
        p=last["p"][:n_p].astype(np.float64),
        covariance=last["covariance"][:n_p, :n_p].astype(np.float64),
        kappa=float(last["kappa"]),
        trusted_s=float(run.t[trusted[-1]]) if told and publishes else None,
        misfit=identifier.misfit if isinstance(identifier, WeakIdentifier) else None,
        alarm=told and bool(record.reason[trusted[-1]] == Reason.MISFIT),
        status=_final_status(record.reason),
        ticks=len(run.t),
        updates=counters["updates"],
        lost=counters["rejected_not_finite"] + counters["rejected_saturated"],
        running_hash=identifier.running_hash,
        trajectory=trajectory,
        publications=publications,
    )


def _in_float64(run: Run, rig: RigFile, config: StrongConfig, every: int) -> Identification:
    bank = bank_of(rig, run.sample_rate)
    d_phi = bank.apply(run.phi, run.sample_rate).T
    d_y = bank.apply(run.y, run.sample_rate).T
    u = d_y[:, 2:5] / rig.l1
    driven = oracle.driven(u[:, 0], run.sample_rate, config.drive_min)
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
            rate=run.sample_rate,
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
    times = run.t[2 * config.delay :][driven][[tick for tick, _ in result.estimates]]
    moved_at_end = bool(driven[-1] and result.updated[-settings.divider :].any())
    return _identification(
        rig,
        p=result.last.p,
        covariance=result.last.covariance,
        kappa=result.last.kappa,
        trusted_s=None,
        misfit=None,
        alarm=False,
        status=(Reason.UPDATED if moved_at_end else Reason.HELD_NOT_EXCITED).text,
        ticks=len(run.t),
        updates=int(result.updated.sum()),
        lost=0,
        running_hash=None,
        trajectory=_trajectory(
            times,
            np.array([estimate.p for _, estimate in result.estimates]),
            np.array([estimate.covariance for _, estimate in result.estimates]),
            rig.l1,
            np.array([estimate.kappa for _, estimate in result.estimates]),
        ),
    )


def _weak_in_float64(run: Run, rig: RigFile, config: WeakConfig) -> Identification:
    """The trajectory has one point a window."""
    if config.estimator.law is not Law.STATIONARY or config.estimator.divider != 1:
        raise PvidError("core f64 has the weak form's stationary law with a solve at every window only: use f32")
    settings = config.estimator
    n_p = min(len(settings.start), NAMED)
    result = identify_weak(
        run.phi,
        run.y,
        weak_design_of(rig, run.sample_rate),
        WeakSettings(
            start=settings.start[:n_p].astype(np.float64),
            row_sd=settings.row_sd,
            start_sd=settings.start_sd[:n_p].astype(np.float64),
            forgetting_s=settings.forgetting_s,
            iterations=config.iterations,
            step_limit=settings.step_limit,
            kappa_min=settings.kappa_min,
            drive_min=config.drive_min,
            full_angle=rig.identifier.full_angle,
            damping=rig.identifier.damping,
        ),
    )
    # the gate and the alarm of pvid/trust.h, without the question how much of the information noise makes
    trust = config.trust
    relative = (result.se[:, :3] / result.p[:, :3]).max(axis=1)
    arrived = np.arange(len(result.t)) + 1 >= trust.groups_min
    good = result.updated & arrived & (result.kappa >= trust.kappa_min) & (relative <= trust.se_max)
    trusted = np.flatnonzero(good)
    if len(trusted) == 0:
        p, covariance = (
            settings.start[:n_p].astype(np.float64),
            np.diag(settings.start_sd[:n_p].astype(np.float64) ** 2),
        )
        status, misfit, alarm = Reason.HELD_NOT_EXCITED, None, False
    else:
        p, covariance = result.p[trusted[-1], :n_p], result.covariance[trusted[-1], :n_p, :n_p]
        # rows that are corrected later than the first publication are judged once the uncorrected past has faded
        judged = result.misfit[
            max(trusted[0], _FADING * int(result.corrected.any()) + int(np.argmax(result.corrected))) :
        ]
        misfit = float(np.nanmean(judged))
        alarm = trust.misfit_max > 0 and np.isfinite(judged).sum() >= MISFIT_WINDOWS and misfit > trust.misfit_max
        status = Reason.MISFIT if alarm else Reason.UPDATED
        if not good[-1]:
            status = Reason.HELD_UNCERTAIN if result.updated[-1] else Reason.HELD_NOT_EXCITED
    return _identification(
        rig,
        p=p,
        covariance=covariance,
        kappa=float(result.kappa[trusted[-1]]) if len(trusted) else result.last.kappa,
        trusted_s=float(run.t[0] + result.t[trusted[-1]]) if len(trusted) else None,
        misfit=misfit,
        alarm=alarm,
        status=status.text,
        ticks=len(run.t),
        updates=config.iterations * int(result.updated.sum()),
        lost=0,
        running_hash=None,
        trajectory=_trajectory(
            run.t[0] + result.t, result.p[:, :3], result.covariance[:, :3, :3], rig.l1, result.kappa
        ),
    )


def _in_q31(
    run: Run, rig: RigFile, config: StrongConfigQ31 | WeakConfigQ31, every: int, native: Native
) -> Identification:
    phi, y = counts_of(rig, run)
    identifier = (
        WeakIdentifierQ31(native, config) if isinstance(config, WeakConfigQ31) else StrongIdentifierQ31(native, config)
    )
    record = identifier.run(phi, y, sums=False, estimate_every=every)
    last = identifier.estimate if isinstance(identifier, WeakIdentifierQ31) else identifier.assess()
    n_p = record.p.shape[1]
    p = p_of(config, last["p"][:n_p])
    if n_p > 3:  # where the counts lie between the LSB's multiples: 0 when the run was recorded as counts
        p[3] += float(np.nanmean(run.phi - phi * rig.sensor.phi_lsb))
    trusted = np.flatnonzero(np.isin(record.reason, (Reason.UPDATED, Reason.MISFIT)))
    told = len(trusted) > 0
    counters = identifier.counters
    publications = Publications.none()
    if isinstance(identifier, WeakIdentifierQ31):
        publications = Publications(
            t=run.t[trusted],
            p=p_of(config, record.published[trusted])[:, :3],
            se=se_of(config, record.published_se[trusted])[:, :3],
            alarm=record.reason[trusted] == Reason.MISFIT,
        )
    return _identification(
        rig,
        p=p,
        covariance=covariance_of(config, last),
        kappa=float(last["kappa"]) / 2**30,
        trusted_s=float(run.t[trusted[-1]]) if told and isinstance(identifier, WeakIdentifierQ31) else None,
        misfit=identifier.misfit if isinstance(identifier, WeakIdentifierQ31) else None,
        alarm=told and bool(record.reason[trusted[-1]] == Reason.MISFIT),
        status=_final_status(record.reason),
        ticks=len(run.t),
        updates=counters["updates"],
        lost=counters["rejected_saturated"],
        running_hash=identifier.running_hash,
        trajectory=_trajectory(
            run.t[::every],
            p_of(config, record.estimate["p"][:, :n_p])[:, :3],
            covariance_of(config, record.estimate)[:, :3, :3],
            rig.l1,
            record.estimate["kappa"] / 2**30,
        ),
        publications=publications,
    )


def _start_held(run: Run, rig: RigFile, config: StrongConfig) -> Identification:
    """The answer to a run without a drive: the start, with the start's own standard deviations."""
    p = config.estimator.start.astype(np.float64)
    covariance = np.diag(config.estimator.start_sd.astype(np.float64) ** 2)
    return _identification(
        rig,
        p=p,
        covariance=covariance,
        kappa=0.0,
        trusted_s=None,
        misfit=None,
        alarm=False,
        status=Reason.HELD_NOT_EXCITED.text,
        ticks=len(run.t),
        updates=0,
        lost=0,
        running_hash=None,
        trajectory=_trajectory(
            run.t[[0, -1]], np.stack([p, p]), np.stack([covariance, covariance]), rig.l1, np.zeros(2)
        ),
    )


def _trajectory(t: Float, p: Float, covariance: Float, l1: float, kappa: Float) -> Trajectory:
    return Trajectory(
        t=t,
        p=p,
        se=np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)),
        physical=oracle.physical(p, l1),
        physical_se=oracle.physical_errors(p, covariance, l1),
        kappa=kappa,
    )


def _final_status(reasons: npt.NDArray[np.uint8]) -> str:
    """The last reason in words; with a divider, the last one that followed a solve."""
    solved = reasons[reasons != Reason.ACCUMULATED]
    return Reason(int(solved[-1])).text if len(solved) else Reason.ACCUMULATED.text


def _identification(
    rig: RigFile,
    *,
    p: Float,
    covariance: Float,
    kappa: float,
    trusted_s: float | None,
    misfit: float | None,
    alarm: bool,
    status: str,
    ticks: int,
    updates: int,
    lost: int,
    running_hash: int | None,
    trajectory: Trajectory,
    publications: Publications | None = None,
) -> Identification:
    names = (*LINEAR, ZERO)[: len(p)]
    values = dict(zip(names, map(float, p), strict=True))
    errors = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    physical = oracle.physical(p[:3], rig.l1)
    if np.isfinite(physical).all():
        values.update(zip(PHYSICAL, map(float, physical), strict=True))
        errors.update(zip(PHYSICAL, map(float, oracle.physical_errors(p[:3], covariance[:3, :3], rig.l1)), strict=True))
    return Identification(
        value=values,
        se=errors,
        kappa=kappa,
        trusted_s=trusted_s,
        misfit=misfit,
        alarm=alarm,
        status=status,
        ticks=ticks,
        updates=updates,
        lost=lost,
        hash=running_hash,
        core=rig.identifier.core,
        form=rig.identifier.form,
        law=rig.identifier.law,
        on="host",
        trajectory=trajectory,
        publications=Publications.none() if publications is None else publications,
    )
