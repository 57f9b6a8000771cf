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
from pvid.base.rounding import with_prefix
from pvid.identification.answer import Analysis
from pvid.identification.core import CoreAnswer
from pvid.identification.core_refined import RefinedCoreAnswer

Float = npt.NDArray[np.float64]
_FROM = 0.15  # of the publications: those before may be off the scale
_IN_A_COLUMN = 3  # parameters


def convergence(
    answer: Analysis,
    weak: CoreAnswer,
    refined: RefinedCoreAnswer | None,
    truth: Mapping[str, float],
    names: Sequence[str],
    path: Path,
) -> None:
    """Writes every published estimate with +-2 of its standard errors; png, svg or pdf by suffix.

    Raises PvidError when it cannot be written.

    Parameters
    ----------
    weak, refined : the first stage, and both
    truth, names : values by name; those that are shown
    """
    t, values, errors = published(weak, refined, names)
    columns = 2 if len(names) > _IN_A_COLUMN else 1
    rows = -(-len(names) // columns)
    figure, grid = plt.subplots(
        rows,
        columns,
        sharex=True,
        squeeze=False,
        figsize=(4.6 * columns + 1.2, 1.55 * rows + 1.1),
        layout="constrained",
    )
    for k, (name, axis) in enumerate(zip(names, grid.T.flat, strict=False)):
        *_, unit, scale = with_prefix(truth[name], 0.0, weak.values[name].unit)
        true, value, error = truth[name] / scale, values[:, k] / scale, errors[:, k] / scale
        if np.any(np.isfinite(value)):
            band = (value - 2 * error, value + 2 * error)
            axis.fill_between(t, *band, step="post", color="C0", alpha=0.25, linewidth=0, label="± 2 standard errors")
            axis.step(t, value, where="post", color="C0", linewidth=1.4, label="estimate")
            late = slice(int(_FROM * len(t)), None)
            reach = 1.1 * float(np.nanmax([np.abs(value[late] - true), 3 * error[late]]))
            axis.set_ylim(true - reach, true + reach)
        axis.axhline(true, color="C3", linewidth=1.0, linestyle="--", label="truth")
        axis.ticklabel_format(axis="y", useOffset=False, scilimits=(-3, 5))
        axis.set_ylabel(f"{name} [{unit}]" if unit else name)
        axis.set_xlim(0, float(answer.recording.t[-1]))
        axis.grid(alpha=0.3)
        if k + 1 == len(names) or (k + 1) % rows == 0:
            axis.set_xlabel("time [s]")
            axis.tick_params(labelbottom=True)
    for axis in grid.T.flat[len(names) :]:
        axis.set_axis_off()
    figure.suptitle(f"{answer.model.title}: estimates of the C core as it runs")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
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
