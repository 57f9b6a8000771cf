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
from pvid.run.identify import Identification
from pvid.show.axis_limits import draw_answer, interesting, plain_ticks

Float = npt.NDArray[np.float64]


def convergence(result: Identification, path: Path, *, truth: dict[str, float] | None = None, title: str = "") -> None:
    """Writes the estimates of the physical parameters over time with a +-2 s.e. band; the truth as a line if known. An
    answer that is refined is drawn beside the estimates of the weak form, its first stage.

    The format follows the suffix of `path` (png, svg, pdf).

    Raises
    ------
    PvidError
        When it cannot be written.
    """
    trajectory = result.trajectory
    refined = result.refinement is not None and result.refinement.adopted
    shown = result.model.physical
    figure, grid = plt.subplots(len(shown), 1, sharex=True, squeeze=False, figsize=(8, 8), layout="constrained")
    axes = grid[:, 0]
    for column, (one, axis) in enumerate(zip(shown, axes, strict=True)):
        value = trajectory.physical[:, column]
        band = 2 * trajectory.physical_se[:, column]
        axis.fill_between(trajectory.t, value - band, value + band, alpha=0.25, color="C0", label="±2 s.e.")
        label = "weak form" if refined else "estimate" if result.identified else "not published"
        axis.plot(trajectory.t, value, color="C0", linewidth=1.2, label=label)
        low, high = interesting(value, band)
        if refined and one.name in result.value:
            draw_answer(axis, result.value[one.name], result.se[one.name])
        if truth is not None:
            axis.axhline(truth[one.name], color="C3", linestyle="--", linewidth=1.2, label="truth")
            low, high = min(low, truth[one.name]), max(high, truth[one.name])
        if math.isfinite(low) and low < high:
            axis.set_ylim(low, high)
        axis.set_ylabel(one.label)
        plain_ticks(axis)
        axis.grid(alpha=0.3)
    axes[0].legend(loc="upper right", ncols=4, fontsize="small")
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(trajectory.t[0], trajectory.t[-1])
    figure.suptitle(title or result.method)
    try:
        save(figure, path, dpi=130)
    finally:
        plt.close(figure)
