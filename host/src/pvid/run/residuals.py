"""What a run's rows leave unexplained at given parameters, in float64, and how it hangs together in time."""

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
    """Y - N^T theta at one p, over the noise that the encoder makes of it.

    t : when a group of rows was complete, on the run's clock [groups, s];  e : [groups, rows of a group]
    free : degrees of freedom of a group, at most its rows;  step_s : time between groups [s]
    expected : whether 1 is what the encoder's noise gives; else e is over its own standard deviation
    shared : groups that share samples with one before them
    """

    t: Float
    e: Float
    free: int
    step_s: float
    expected: bool
    shared: int

    @property
    def rms(self) -> Float:
        """Of each group [groups]."""
        return np.asarray(np.sqrt((self.e**2).sum(axis=1) / self.free))

    def autocorrelation(self, lags: int) -> Float:
        """Of groups 0 to `lags` apart, over that of 0 [lags + 1]; less where there are fewer groups."""
        power = float((self.e**2).sum()) or 1.0  # of residuals that are all 0, too
        n = len(self.e)
        return np.array([float((self.e[lag:] * self.e[: n - lag]).sum()) / power for lag in range(min(lags + 1, n))])

    @property
    def chance(self) -> float:
        """What of an autocorrelation is chance alone: two standard deviations if the rows were independent."""
        return 2.0 / float(np.sqrt(len(self.e) * self.free))


def residuals_of(run: Run, rig: RigFile, p: Float) -> Residuals:
    """Of a run in the rig file's form.

    In the weak form with the tables of the rig file: those that identify takes for a run are those of `survey.fitted`.

    Parameters
    ----------
    p
        w, d1, d2, then c where the zero is unknown, then both frictions where they are estimated.

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
    e = (y - n @ oracle.theta(p[:3]))[-_MOST_ROWS:]
    t = run.t[2 * bank.delay :][driven][-_MOST_ROWS:]
    scaled = (e / e.std())[:, np.newaxis]
    return Residuals(t, scaled, 1, 1 / run.sample_rate, expected=False, shared=2 * bank.delay)
