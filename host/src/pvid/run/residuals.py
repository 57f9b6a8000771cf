"""Residuals of a run's rows at given parameters, in float64, and their autocorrelation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle import strong as oracle
from pvid.oracle.weak import WeakOracle, WeakSettings, end_times
from pvid.oracle.windows import Windows
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.f32 import WeakConfig
from pvid.setup.f32 import bank_of, strong_config, weak_config, weak_design_of

Float = npt.NDArray[np.float64]

_MOST_ROWS = 200_000  # of the strong form, from the run's end: one a sample


@dataclass(frozen=True)
class Residuals:
    """Y - N^T theta at one p, relative to the encoder's noise in it.

    t : time at which a group of rows is complete, on the run's clock [groups, s];  e : [groups, rows of a group]
    free : degrees of freedom of a group, at most its rows;  step_s : time between groups [s]
    expected : whether e is relative to the encoder's noise; else to its own standard deviation
    shared : number of earlier groups that share samples with a group
    """

    t: Float
    e: Float
    free: int
    step_s: float
    expected: bool
    shared: int

    @property
    def rms(self) -> Float:
        """RMS of each group [groups]."""
        return np.asarray(np.sqrt((self.e**2).sum(axis=1) / self.free))

    def autocorrelation(self, lags: int) -> Float:
        """Autocorrelation at 0 to `lags` groups, 1 at lag 0 [lags + 1]; shorter if there are fewer groups."""
        power = float((self.e**2).sum()) or 1.0  # of residuals that are all 0, too
        n = len(self.e)
        return np.array([float((self.e[lag:] * self.e[: n - lag]).sum()) / power for lag in range(min(lags + 1, n))])

    @property
    def chance(self) -> float:
        """Two standard deviations of the autocorrelation of independent rows."""
        return 2.0 / float(np.sqrt(len(self.e) * self.free))


def residuals_of(run: Run, rig: RigFile, p: Float) -> Residuals:
    """Residuals of a run in the rig file's form.

    The weak form uses the tables of this rig file; identify uses those of the rig file from `survey.fitted`.

    Parameters
    ----------
    p
        w, d1, d2, then c if the offset is unknown, then both frictions if they are estimated.

    Raises
    ------
    PvidError
        When the run is too short for one group of rows, or its pivot stands still.
    """
    return _weak(run, rig, p) if rig.identifier.form == "weak" else _strong(run, rig, p)


def _weak(run: Run, rig: RigFile, p: Float) -> Residuals:
    config: WeakConfig = weak_config(rig, run.sample_rate)
    design = weak_design_of(rig, run.sample_rate)
    n_core = rig.n_core
    settings = WeakSettings(
        start=p[:n_core],
        row_sd=config.estimator.row_sd,
        full_angle=rig.identifier.full_angle,
        damping=rig.identifier.damping,
    )
    at = WeakOracle(design, settings, corrected=rig.identifier.full_angle or rig.identifier.damping)
    at.p[: len(p)] = p[: len(at.p)]
    windows = Windows.of(run, design)
    e = windows.residuals(at) / config.estimator.row_sd
    t = run.t[0] + end_times(len(e), design)
    return Residuals(t, e, design.functions - 2, design.hop_s, expected=True, shared=1)


def _strong(run: Run, rig: RigFile, p: Float) -> Residuals:
    bank, config = bank_of(rig, run.sample_rate), strong_config(rig, run.sample_rate)
    d_phi, d_y = bank.apply(run.phi, run.sample_rate).T, bank.apply(run.y, run.sample_rate).T
    u = d_y[:, 2:5] / rig.l1
    driven = oracle.driven(u[:, 0], run.sample_rate, config.drive_min)
    if not driven.any():
        raise PvidError("the pivot rests: there are no rows")
    n, y = oracle.strong_rows(d_phi[driven], u[driven])
    e = (y - n @ oracle.theta(p[: oracle.N_P]))[-_MOST_ROWS:]
    t = run.t[2 * bank.delay :][driven][-_MOST_ROWS:]
    scaled = (e / e.std())[:, np.newaxis]
    return Residuals(t, scaled, 1, 1 / run.sample_rate, expected=False, shared=2 * bank.delay)
