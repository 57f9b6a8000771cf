"""Sensors that are not sampled at the same instant: y is moved by a known delay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvid.rig.run import Run


def aligned(run: Run, y_delay: float) -> Run:
    """The run with y at the instants of phi, if y was sampled y_delay [s] later than phi; y is interpolated linearly
    between its samples."""
    if y_delay == 0.0:
        return run
    clock = np.arange(len(run.y), dtype=np.float64)
    y = np.interp(clock - y_delay * run.sample_rate, clock, run.y)
    return replace(run, y=y, notes=(*run.notes, f"y was moved by {1e3 * y_delay:.3g} ms (y_delay of the rig file)"))
