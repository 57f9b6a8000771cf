"""Figures a person can read without the text."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

from pvid.base.figure_file import save
from pvid.run.identify import PHYSICAL, UNITS, Identification
from pvid.show.axis_limits import interesting

Float = npt.NDArray[np.float64]

LABELS = {
    "g": "gravity in the plane g*",
    "l2": "joint to centre of mass l2",
    "rho2": "radius of gyration rho2",
}


def convergence(result: Identification, path: Path, *, truth: dict[str, float] | None = None, title: str = "") -> None:
    """Writes the estimates of g*, l2 and rho2 over time with a +-2 s.e. band; the truth as a line if known.

    The format follows the suffix of `path` (png, svg, pdf).

    Raises
    ------
    PvidError
        When it cannot be written.
    """
    trajectory = result.trajectory
    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(8, 8), layout="constrained")
    for column, (name, axis) in enumerate(zip(PHYSICAL, axes, strict=True)):
        value = trajectory.physical[:, column]
        band = 2 * trajectory.physical_se[:, column]
        axis.fill_between(trajectory.t, value - band, value + band, alpha=0.25, color="C0", label="±2 s.e.")
        label = "estimate" if result.identified else "not published"
        axis.plot(trajectory.t, value, color="C0", linewidth=1.2, label=label)
        low, high = interesting(value, band)
        if truth is not None:
            axis.axhline(truth[name], color="C3", linestyle="--", linewidth=1.2, label="truth")
            low, high = min(low, truth[name]), max(high, truth[name])
        if math.isfinite(low) and low < high:
            axis.set_ylim(low, high)
        axis.set_ylabel(f"{LABELS[name]} [{UNITS[name]}]")
        axis.grid(alpha=0.3)
    axes[0].legend(loc="upper right", ncols=3)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(trajectory.t[0], trajectory.t[-1])
    figure.suptitle(title or f"{result.form} form, {result.law} law, core {result.core} on {result.on}")
    try:
        save(figure, path, dpi=130)
    finally:
        plt.close(figure)
