"""Sensors that are not sampled at one instant: how much later y is than phi, found from the run, and put right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pvid.capture import Run
from pvid.run_rows import Fit

# y looks skewed where a shift of it leaves less than this share of the residuals' variance.
_SKEWED = 0.7
_MOST = 3.0  # samples


def aligned(run: Run, y_delay: float) -> Run:
    """The run with y as it was when phi was sampled, where it was sampled y_delay [s] later; between its samples on
    straight lines."""
    if y_delay == 0.0:
        return run
    clock = np.arange(len(run.y), dtype=np.float64)
    y = np.interp(clock - y_delay * run.sample_rate, clock, run.y)
    return replace(run, y=y, notes=(*run.notes, f"y was moved by {1e3 * y_delay:.3g} ms (y_delay of the rig file)"))


def skew_of(run: Run, fitted: Callable[[Run], Fit]) -> tuple[float, Fit | None]:
    """How much later y seems to be sampled than phi [s], to 3 samples, and the fit without it; (0, None) where a shift
    explains nothing.

    `fitted` gives the least squares of a run. chi^2 is a parabola of the shift: three of them show where it ends.
    """
    sample = 1.0 / run.sample_rate
    now, earlier, later = (fitted(aligned(run, shift)).chi2 for shift in (0.0, -sample, sample))
    curvature = earlier + later - 2 * now
    if not curvature > 0:
        return 0.0, None
    delay = sample * float(np.clip((earlier - later) / (2 * curvature), -_MOST, _MOST))
    best = fitted(aligned(run, delay))
    return (delay, best) if best.chi2 < _SKEWED * now else (0.0, None)
