"""Residuals of a run's rows at given parameters, in float64, and their autocorrelation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle import strong as oracle
from pvid.oracle.weak.rows import EquationError
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.refined_pendulum import RefinedPendulum
from pvid.run.trial import rows_near
from pvid.setup.f32 import bank_of, strong_config

Float = npt.NDArray[np.float64]

_MEAN = 16  # samples: residuals of a refinement, whose errors of the equations are slow
_GROUP = 16  # means
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

    Parameters
    ----------
    p
        w, d1, d2, in the weak form then c.

    Raises
    ------
    PvidError
        When the run is too short for one group of rows, or its pivot stands still.
    """
    return _weak(run, rig, p) if rig.identifier.form == "weak" else _strong(run, rig, p)


def residuals_of_fit(fit: RefinedPendulum, began: float) -> Residuals:
    """Residuals of a refinement: means of consecutive samples, times the root of how many they are, in groups; fewer of
    them where its blocks are short.

    Parameters
    ----------
    began : time of the run's first sample [s]
    """
    problem, found = fit.problem, fit.found
    m, cut = problem.measured, found.cut
    error = (cut.rows(m.z) - problem.simulated(found.r, cut, found.starts))[..., 0] / m.sd[0]
    group = min(_GROUP, cut.samples)
    mean = min(_MEAN, cut.samples // group)
    length = group * mean
    groups = cut.samples // length
    parts = np.nan_to_num(error[:, : groups * length]).reshape(-1, group, mean)
    e = parts.sum(axis=-1) / np.sqrt(mean * m.grown)
    ends = cut.first[:, None] + length * np.arange(1, groups + 1)
    return Residuals(began + ends.ravel() / m.rate, e, group, length / m.rate, expected=True, shared=0)


def _weak(run: Run, rig: RigFile, p: Float) -> Residuals:
    rows = rows_near(run, rig, p)
    if rows is None:
        lasted = len(run.t) / run.sample_rate
        raise PvidError(f"the run of {lasted:.3g} s is too short for the rows of the weak form: record longer")
    theta = rows.compiled.parameters.theta(p)
    white = rows.white((0,), theta, [EquationError()] * rows.kinds)
    e = white.residuals(theta)
    free = white.free // max(len(e), 1)
    return Residuals(run.t[0] + rows.end_times(), e, free, rows.functions.dt * rows.functions.hop, True, shared=1)


def _strong(run: Run, rig: RigFile, p: Float) -> Residuals:
    bank, config = bank_of(rig, run.sample_rate), strong_config(rig, run.sample_rate)
    d_phi, d_y = bank.apply(run.phi, run.sample_rate).T, bank.apply(run.y, run.sample_rate).T
    u = d_y[:, 2:5] / rig.l1
    period = bank.every / run.sample_rate
    driven = oracle.driven(u[:, 0], 1 / period, config.drive_min)
    if not driven.any():
        raise PvidError("the pivot rests: there are no rows")
    n, y = oracle.strong_rows(d_phi[driven], u[driven])
    e = (y - n @ oracle.theta(p[: oracle.N_P]))[-_MOST_ROWS:]
    t = run.t[bank.window - 1 :: bank.every][driven][-_MOST_ROWS:]
    scaled = (e / e.std())[:, np.newaxis]
    return Residuals(t, scaled, 1, period, expected=False, shared=bank.memory - 1)
