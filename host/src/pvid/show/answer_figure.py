"""The answer of a described mechanism as a figure: how it converges, and measured against simulated signals."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure

from pvid.base.errors import PvidError
from pvid.base.figure_file import drawable, save
from pvid.base.rounding import with_error
from pvid.identification.answer import Analysis, RefinedFit
from pvid.identification.core import CoreAnswer
from pvid.identification.refinement.fit import Problem, Refined
from pvid.identification.refinement.problem import simulated_at
from pvid.show.axis_limits import plain_ticks

_MOST = 4000  # points of a line
_COLUMNS = 2
_SETTLED = 3  # the axis shows the estimates behind the first third
_LINE = 110  # characters of the title
_PANEL = 1.9  # inches


def write_figure(answer: Analysis | CoreAnswer, path: Path, title: str = "") -> None:
    """Writes the estimates after each window with the answer and +-2 of its standard errors; below them, for each
    sensor, the measured against the simulated signal and their difference: of the refinement where it gave the answer,
    else at the answer's values, where the model's equations can be simulated. png, svg or pdf by suffix.

    Parameters
    ----------
    answer : whose values and errors are drawn

    Raises
    ------
    PvidError
        When it cannot be written.
    """
    refinement = answer.refinement if isinstance(answer, Analysis) else None
    fit = refinement.fit if refinement is not None and refinement.adopted else _motion(answer)
    _write(answer, fit, path, title)


def convergence(answer: Analysis | CoreAnswer, path: Path) -> None:
    """Writes the first part of it alone."""
    _write(answer, None, path, "")


def _motion(answer: Analysis | CoreAnswer) -> RefinedFit | None:
    p = [answer.values[name].value for name in answer.model.p_names]
    if None in p:
        return None
    try:
        fit = simulated_at(answer.analysis, np.array(p, np.float64))
    except PvidError:
        return None
    return fit if np.isfinite(fit.found.sum_of_squares) else None


def _write(answer: Analysis | CoreAnswer, fit: RefinedFit | None, path: Path, title: str) -> None:
    heights = [_PANEL * -(-len(answer.model.p_names) // _COLUMNS)]
    if fit is not None:
        heights.append(2 * _PANEL * len(fit.problem.kernel.made.outputs))
    lines = [
        part for line in (title or answer.model.title).split("\n") for part in textwrap.wrap(drawable(line), _LINE)
    ]
    figure = plt.figure(figsize=(10, sum(heights) + 0.3 + 0.25 * len(lines)), layout="constrained")
    try:
        parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        _converge(answer, parts[0])
        if fit is not None:
            _compare(fit.problem, fit.found, float(answer.recording.t[0]), parts[1])
        figure.suptitle("\n".join(lines), parse_math=False)
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)


def write_comparison(fit: RefinedFit, path: Path) -> None:
    """Writes the second part of it alone."""
    figure = plt.figure(figsize=(10, 2 * _PANEL * len(fit.problem.kernel.made.outputs)), layout="constrained")
    try:
        _compare(fit.problem, fit.found, 0.0, figure.subfigures(1, 1, squeeze=False)[0, 0])
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)


def _history(answer: Analysis | CoreAnswer, k: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], str]:
    """Times and estimates of the k-th unknown, and whose they are."""
    if isinstance(answer, CoreAnswer):
        return answer.publications.t, answer.publications.p[:, k], "each window, in C"
    return answer.found.times, answer.found.history[:, k], "weak form, each window"


def _converge(answer: Analysis | CoreAnswer, place: SubFigure) -> None:
    names = answer.model.p_names
    rows = -(-len(names) // _COLUMNS)
    grid = place.subplots(rows, _COLUMNS, sharex=True, squeeze=False)
    for k, (name, axis) in enumerate(zip(names, grid.T.flat, strict=False)):
        one, (t, history, label) = answer.values[name], _history(answer, k)
        axis.plot(t, history, color="C0", linewidth=1.2, label=label)
        late = history[len(history) // _SETTLED :]
        if one.value is not None and one.se is not None:
            axis.axhspan(
                one.value - 2 * one.se, one.value + 2 * one.se, color="C1", alpha=0.25, label="answer ± 2 s.e."
            )
            axis.axhline(one.value, color="C1", linewidth=0.9)
            reach = max(float(np.max(np.abs(late - one.value), initial=0.0)), 4 * one.se)
            axis.set_ylim(one.value - 1.2 * reach, one.value + 1.2 * reach)
            value, error = with_error(one.value, one.se)
            axis.set_title(drawable(f"{name} = {value} ± {error} {one.unit}".rstrip()), fontsize="medium")
        axis.set_ylabel(f"{name} [{one.unit}]" if one.unit else name)
        plain_ticks(axis)
        axis.grid(alpha=0.3)
    for axis in grid.T.flat[len(names) :]:
        axis.set_axis_off()
    grid[0, 0].legend(loc="upper right", fontsize="small")
    for axis in grid[-1]:
        axis.set_xlabel("time of the run [s]")


def _compare(problem: Problem, found: Refined, began: float, place: SubFigure) -> None:
    """Measured and simulated signals of every sensor, and their difference over the sensor's standard deviation."""
    made, m, cut = problem.kernel.made, problem.measured, found.cut
    n = len(made.outputs)
    simulated = problem.simulated(found.r, cut, found.starts).reshape(-1, n)
    measured = cut.rows(m.z).reshape(-1, n)
    t = began + (cut.first[:, None] + np.arange(cut.samples)).ravel() / m.rate
    step = max(1, len(t) // _MOST)
    axes: Sequence[Axes] = place.subplots(2 * n, 1, sharex=True, height_ratios=[2, 1] * n)
    for k, (name, (upper, lower)) in enumerate(zip(made.outputs, _pairs(axes), strict=True)):
        there = np.isfinite(measured[:, k])
        left = measured[there, k] - simulated[there, k]
        upper.plot(t[::step], measured[::step, k], color="0.6", linewidth=2.0, label="measured")
        upper.plot(t[::step], simulated[::step, k], color="C1", linewidth=0.9, label="simulated with the answer")
        unit = made.model.signal(name).unit
        upper.set_ylabel(f"{name} [{unit or '1'}]")
        upper.set_title(f"{name}: rms difference {np.sqrt(np.mean(left**2)):.2g} {unit}".rstrip(), fontsize="medium")
        upper.legend(loc="upper right", fontsize="small", ncols=2)
        lower.plot(t[there][::step], left[::step] / m.sd[k], color="C0", linewidth=0.6)
        lower.set_ylabel("difference\n[sensor's s.d.]")
        for axis in (upper, lower):
            plain_ticks(axis)
            axis.grid(alpha=0.3)
    axes[-1].set_xlabel("time of the run [s]")


def _pairs(axes: Sequence[Axes]) -> Iterator[tuple[Axes, Axes]]:
    return zip(axes[::2], axes[1::2], strict=True)
