"""A pendulum's run through the hand-written strong form: its C core, or the float64 oracle of the same rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.cases import case_of
from pvid.core.native import Native
from pvid.oracle import strong as oracle
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.enums import Reason
from pvid.settings.f32 import StrongConfig
from pvid.setup.f32 import bank_of, strong_config

Float = npt.NDArray[np.float64]

_NAMES = ("w", "d1", "d2")
_WORST_SE = 0.1  # of w, relative: an estimate that is less accurate is none
_GOOD = (Reason.UPDATED, Reason.MISFIT, Reason.ACCUMULATED)


@dataclass(frozen=True)
class StrongEstimate:
    """The last estimate of a run.

    Attributes
    ----------
    value, se : of w, d1, d2; of the start where nothing is identified
    reason : of the last tick that did more than accumulate
    updates : steps of the estimate
    """

    value: Mapping[str, float]
    se: Mapping[str, float]
    reason: Reason
    updates: int

    @property
    def identified(self) -> bool:
        """Whether there is an estimate, and w is accurate enough."""
        return self.updates > 0 and self.reason in _GOOD and self.se["w"] <= _WORST_SE * abs(self.value["w"])

    @property
    def alarm(self) -> bool:
        """Whether the residuals of the rows are too large."""
        return self.reason == Reason.MISFIT


def identify(run: Run, rig: RigFile, native: Native, *, start: npt.ArrayLike | None = None) -> StrongEstimate:
    """Identifies a run with the core and law of the rig file.

    Parameters
    ----------
    start : p = (w, d1, d2) to start from; the rig file's nominal by default

    Raises
    ------
    PvidError
        When the run is shorter than the window, or the settings do not fit the core.
    """
    config = strong_config(rig, run.sample_rate, start)
    if len(run.t) < config.ticks_needed:
        raise PvidError(f"the run has {len(run.t)} samples and the strong form needs {config.ticks_needed}")
    return _in_float64(run, rig, config) if rig.identifier.core == "f64" else _in_core(run, rig, start, native)


def _in_core(run: Run, rig: RigFile, start: npt.ArrayLike | None, native: Native) -> StrongEstimate:
    case = case_of(rig.identifier)
    rig = case.with_ranges(rig, run)
    config = case.settings_for_run(rig, run, start)
    identifier = native.identifier(config)
    record = identifier.run(*case.samples(rig, run), sums=False)
    last, n_p = identifier.estimate, record.p.shape[1]
    said = record.reason[~np.isin(record.reason, (Reason.ACCUMULATED, Reason.WARMING_UP))]
    reason = Reason(int(said[-1])) if len(said) else Reason.ACCUMULATED
    p, covariance = case.p_of(config, last["p"][:n_p]), case.covariance_of(config, last)
    return _estimate(p, covariance, reason, identifier.counters["updates"])


def _in_float64(run: Run, rig: RigFile, config: StrongConfig) -> StrongEstimate:
    bank, settings = bank_of(rig, run.sample_rate), config.estimator
    d_phi, d_y = (bank.apply(x, run.sample_rate).T for x in (run.phi, run.y))
    u, rate = d_y[:, 2:5] / rig.l1, run.sample_rate / bank.every
    driven = oracle.driven(u[:, 0], rate, config.drive_min)
    if not driven.any():
        spread = np.diag(settings.start_sd.astype(np.float64) ** 2)
        return _estimate(settings.start.astype(np.float64), spread, Reason.HELD_NOT_EXCITED, 0)
    same = ("row_sd", "feedback_hz", "forgetting_s", "correlation", "step_limit", "kappa_min", "divider")
    of_start = ("start", "start_sd", "lower", "upper")
    result = oracle.identify_strong(
        *oracle.strong_rows(d_phi[driven], u[driven]),
        oracle.Settings(
            **{name: getattr(settings, name).astype(np.float64) for name in of_start},
            **{name: getattr(settings, name) for name in same},
            rate=rate,
            law=rig.identifier.law,
        ),
    )
    moved = bool(driven[-1] and result.updated[-settings.divider :].any())
    reason = Reason.UPDATED if moved else Reason.HELD_NOT_EXCITED
    return _estimate(result.last.p, result.last.covariance, reason, int(result.updated.sum()))


def _estimate(p: Float, covariance: Float, reason: Reason, updates: int) -> StrongEstimate:
    value, se = (dict(zip(_NAMES, map(float, one), strict=False)) for one in (p, np.sqrt(np.diag(covariance))))
    return StrongEstimate(value, se, reason, updates)
