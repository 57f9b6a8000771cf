"""Sensors that are not sampled at the same instant: estimates the delay of y after phi from the run, and shifts y."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pvid.rig.run import Run
from pvid.run.rows import Fit

# y counts as skewed if a shift reduces the variance of the residuals below this share.
_SKEWED = 0.7
_MOST = 3.0  # samples


def aligned(run: Run, y_delay: float) -> Run:
    """The run with y at the instants of phi, if y was sampled y_delay [s] later than phi; y is interpolated linearly
    between its samples."""
    if y_delay == 0.0:
        return run
    clock = np.arange(len(run.y), dtype=np.float64)
    y = np.interp(clock - y_delay * run.sample_rate, clock, run.y)
    return replace(run, y=y, notes=(*run.notes, f"y was moved by {1e3 * y_delay:.3g} ms (y_delay of the rig file)"))


def skew_of(run: Run, fitted: Callable[[Run], Fit]) -> tuple[float, Fit | None]:
    """Estimated delay of y after phi [s], at most 3 samples, and the fit of the run with this delay removed; (0, None)
    if a shift does not reduce the residuals.

    `fitted` returns the least squares of a run. chi^2 is a parabola of the shift: three values give its minimum.
    """
    sample = 1.0 / run.sample_rate
    now, earlier, later = (fitted(aligned(run, shift)).chi2 for shift in (0.0, -sample, sample))
    curvature = earlier + later - 2 * now
    if not curvature > 0:
        return 0.0, None
    delay = sample * float(np.clip((earlier - later) / (2 * curvature), -_MOST, _MOST))
    best = fitted(aligned(run, delay))
    return (delay, best) if best.chi2 < _SKEWED * now else (0.0, None)
