"""Figure of a refinement: what the sensors measured against what the fitted equations simulate."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from pvid.base.figure_file import save
from pvid.run.refined import Problem, Refined

_MOST = 4000  # points of a line


def measured_and_simulated(problem: Problem, found: Refined, path: Path) -> None:
    """Writes, for each sensor, both curves and below them the residuals over the sensor's standard deviation."""
    made, m, cut = problem.kernel.made, problem.measured, found.cut
    simulated = problem.simulated(found.r, cut, found.starts).reshape(-1, len(made.outputs))
    measured = cut.rows(m.z).reshape(-1, len(made.outputs))
    t = (cut.first[:, None] + np.arange(cut.samples)).ravel() / m.rate
    step = max(1, len(t) // _MOST)
    n = len(made.outputs)
    figure, axes = plt.subplots(2 * n, 1, sharex=True, figsize=(9, 4.5 * n), squeeze=False, layout="constrained")
    for k, name in enumerate(made.outputs):
        unit = made.model.signal(name).unit
        upper, lower = axes[2 * k, 0], axes[2 * k + 1, 0]
        upper.plot(t[::step], measured[::step, k], lw=1.2, label="measured")
        upper.plot(t[::step], simulated[::step, k], lw=0.8, ls="--", label="simulated")
        upper.set_ylabel(f"{name} [{unit or '1'}]")
        upper.legend(loc="upper right")
        lower.plot(t[::step], ((measured - simulated)[:, k] / m.sd[k])[::step], lw=0.6)
        lower.set_ylabel("residual / s.d.")
    axes[-1, 0].set_xlabel("t [s]")
    try:
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)
