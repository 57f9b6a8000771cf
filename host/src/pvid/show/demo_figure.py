"""The picture of the demo: what the C core publishes as it runs, beside the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

from pvid.base.figure_file import save
from pvid.run.mechanism import MechanismAnswer
from pvid.run.mechanism_core import CoreAnswer
from pvid.run.refined_core import RefinedCoreAnswer

Float = npt.NDArray[np.float64]
_FROM = 0.15  # of the publications: what comes before may be off the scale


def convergence(
    answer: MechanismAnswer,
    weak: CoreAnswer,
    refined: RefinedCoreAnswer | None,
    truth: Mapping[str, float],
    names: Sequence[str],
    path: Path,
) -> None:
    """Writes every published estimate with +-2 of its standard errors; png, svg or pdf by suffix.

    Parameters
    ----------
    weak, refined : the first stage, and both
    truth, names : values by name; those that are shown

    Raises
    ------
    PvidError
        When it cannot be written.
    """
    t, values, errors = published(weak, refined, names)
    rows = -(-len(names) // 2) if len(names) > 3 else len(names)
    columns = 2 if len(names) > 3 else 1
    units = {name: one.unit for name, one in weak.values.items()}
    figure, grid = plt.subplots(
        rows,
        columns,
        sharex=True,
        squeeze=False,
        figsize=(4.6 * columns + 1.2, 1.55 * rows + 0.9),
        layout="constrained",
    )
    for k, (name, axis) in enumerate(zip(names, grid.T.flat, strict=False)):
        if len(t):
            axis.fill_between(
                t, values[:, k] - 2 * errors[:, k], values[:, k] + 2 * errors[:, k], step="post", color="C0",
                alpha=0.25, linewidth=0, label="± 2 standard errors",
            )  # fmt: skip
            axis.step(t, values[:, k], where="post", color="C0", linewidth=1.4, label="estimate")
            late = slice(int(_FROM * len(t)), None)
            reach = max(float(np.max(np.abs(values[late, k] - truth[name]))), 3 * float(np.max(errors[late, k])), 1e-12)
            axis.set_ylim(truth[name] - 1.1 * reach, truth[name] + 1.1 * reach)
        axis.axhline(truth[name], color="C3", linewidth=1.0, linestyle="--", label="truth")
        axis.ticklabel_format(useOffset=False)
        axis.set_ylabel(f"{name} [{units[name]}]" if units.get(name) else name)
        axis.grid(alpha=0.3)
    for axis in grid.T.flat[len(names) :]:
        axis.set_axis_off()
    grid[0, 0].legend(loc="upper right", fontsize="small")
    for axis in grid[-1]:
        axis.set_xlim(0, float(answer.recording.t[-1]))
        axis.set_xlabel("time [s]")
    figure.suptitle(answer.model.title)
    try:
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)


def published(weak: CoreAnswer, refined: RefinedCoreAnswer | None, names: Sequence[str]) -> tuple[Float, Float, Float]:
    """Times [n] and, of each name, values and standard errors [n, names]: of the second stage where it publishes."""
    history = refined.history() if refined is not None and refined.adopted else weak.history()
    t = np.array([one for one, _ in history])
    values = np.array([[of[name].value for name in names] for _, of in history], np.float64).reshape(-1, len(names))
    errors = np.array([[of[name].se for name in names] for _, of in history], np.float64).reshape(-1, len(names))
    return t, values, errors
