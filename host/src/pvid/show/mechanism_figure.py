"""How the estimates of a described mechanism converge."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from pvid.base.figure_file import save
from pvid.run.mechanism import MechanismAnswer


def convergence(answer: MechanismAnswer, path: Path) -> None:
    """Writes p after each window, with the final estimate and +-2 of its standard errors; png, svg or pdf by suffix.

    Raises
    ------
    PvidError
        When it cannot be written.
    """
    found = answer.found
    rows = -(-len(found.names) // 2)
    figure, grid = plt.subplots(rows, 2, sharex=True, squeeze=False, figsize=(9, 1.9 * rows), layout="constrained")
    for k, (name, unit, axis) in enumerate(zip(found.names, found.units, grid.T.flat, strict=False)):
        value, se, history = found.p[k], found.se[k], found.history[:, k]
        axis.axhspan(value - 2 * se, value + 2 * se, color="C0", alpha=0.25, label="±2 s.e. at the end")
        axis.plot(found.times, history, color="C0", linewidth=1.2, label="window by window")
        axis.axhline(value, color="C1", linewidth=0.9, label="whole run")
        late = history[len(history) // 3 :]
        reach = max(float(np.max(np.abs(late - value))), 4 * se)
        axis.set_ylim(value - 1.2 * reach, value + 1.2 * reach)
        axis.set_ylabel(f"{name} [{unit}]" if unit else name)
        axis.grid(alpha=0.3)
    for axis in grid.T.flat[len(found.names) :]:
        axis.set_axis_off()
    grid[0, 0].legend(loc="upper right", fontsize="small")
    for axis in grid[-1]:
        axis.set_xlabel("time [s]")
    figure.suptitle(answer.model.title)
    try:
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)
