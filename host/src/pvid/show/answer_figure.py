"""The figures of an answer: measured against predicted signals, their differences, and how the values settle.

They are parts of the report; `write_figure` puts the first and the last into one file.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from pvid.base.figure_file import drawable, save
from pvid.identification.answer import Analysis, Answer
from pvid.identification.core import CoreAnswer
from pvid.identification.core_refined import RefinedCoreAnswer
from pvid.identification.summary import prefixed, printed_unit, shown, unit_for
from pvid.identification.validation import Validation
from pvid.log.history import envelope
from pvid.model.compiled import CompiledModel
from pvid.show.axis_limits import plain_ticks

Float = npt.NDArray[np.float64]
Place = Figure | SubFigure

INK, QUIET, MEASURED, PREDICTED, VALUE = "#20242a", "#8b949e", "#9aa5b1", "#d9480f", "#1c66b3"  # as in document.py
WIDTH = 7.2  # inches: letters of 10 points stay legible on a telephone
_BINS = 500  # of all blocks: a line has twice as many points
_FEWEST_BINS = 20  # of a block
_COLUMNS = 2
_SETTLED = 3  # the axis shows the estimates behind the first third
_LINE = 95  # characters of the title
_PANEL = 1.75  # inches
_CELLS = 41  # of a histogram


def write_figure(answer: Answer, path: Path, title: str = "") -> None:
    """Writes measured against predicted motion that was not fitted, where it was simulated, and below it the estimates
    over time with the answer and its 95 % interval. png, svg or pdf by suffix.

    Raises PvidError when it cannot be written.

    Parameters
    ----------
    answer : whose values and errors are drawn
    """
    unseen = answer.unseen
    heights = [] if unseen is None else [height_of(unseen)]
    heights.append(_PANEL * -(-len(answer.model.p_names) // _COLUMNS))
    texts = (title or answer.model.title).split("\n")
    lines = [part for line in texts for part in textwrap.wrap(drawable(line), _LINE)]
    figure = plt.figure(figsize=(WIDTH, sum(heights) + 0.3 + 0.25 * len(lines)), layout="constrained")
    try:
        parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        if unseen is not None:
            against(answer.model, unseen, parts[0])
        settling(answer, parts[-1])
        figure.suptitle("\n".join(lines), parse_math=False, fontsize="medium")
        save(figure, path, dpi=130)
    finally:
        plt.close(figure)


def write_comparison(model: CompiledModel, validation: Validation, path: Path) -> None:
    """Writes measured against predicted signals alone."""
    figure = plt.figure(figsize=(WIDTH, height_of(validation)), layout="constrained")
    try:
        against(model, validation, figure)
        save(figure, path, dpi=130)
    finally:
        plt.close(figure)


def height_of(validation: Validation) -> float:
    """Inches of a figure with a panel for each sensor."""
    return 0.4 + _PANEL * len(validation.sensors)


def against(model: CompiledModel, validation: Validation, place: Place) -> None:
    """Measured and predicted signals over time, a panel for each sensor."""
    axes = _panels(place, len(validation.sensors))
    for one, axis in zip(validation.sensors, axes, strict=True):
        label, scale = _scaled(axis, model, one.name, validation.measured[one.name])
        for values, color, width, kind in _pair(validation, one.name):
            axis.plot(*_thinned(validation, values / scale), color=color, linewidth=width, label=kind)
        axis.set_ylabel(label)
    _finished(axes)


def closest(model: CompiledModel, validation: Validation, place: Place) -> None:
    """The same of one block for each sensor: that which is predicted worst."""
    axes = _panels(place, len(validation.sensors), shared=False)
    samples = validation.t.size // validation.blocks
    for one, axis in zip(validation.sensors, axes, strict=True):
        measured, simulated = validation.measured[one.name], validation.simulated[one.name]
        squares = np.nanmean(np.square(measured - simulated).reshape(-1, samples), axis=1)
        first = samples * int(np.nanargmax(squares))
        block = slice(first, first + samples)
        label, scale = _scaled(axis, model, one.name, measured[block])
        for values, color, width, kind in _pair(validation, one.name):
            axis.plot(*_envelope(validation.t[block], values[block] / scale), color=color, linewidth=width, label=kind)
        axis.set_ylabel(label)
    _finished(axes)


def differences(model: CompiledModel, validation: Validation, place: Place) -> None:
    """Measured less predicted signals over time, with twice the standard deviation of the sensor's noise; beside it how
    often each difference is."""
    n = len(validation.sensors)
    grid = place.subplots(n, 2, sharey="row", width_ratios=[4, 1], squeeze=False)
    for one, (axis, beside) in zip(validation.sensors, grid, strict=True):
        left = validation.measured[one.name] - validation.simulated[one.name]
        label, scale = _scaled(axis, model, one.name, left)
        axis.plot(*_thinned(validation, left / scale), color=VALUE, linewidth=0.7)
        if one.of_noise:
            noise = one.rms / one.of_noise / scale
            axis.axhspan(-2 * noise, 2 * noise, color=PREDICTED, alpha=0.18, linewidth=0, label="± 2 s.d. of the noise")
            beside.axhspan(-2 * noise, 2 * noise, color=PREDICTED, alpha=0.18, linewidth=0)
        there = left[np.isfinite(left)] / scale
        reach = max(float(np.percentile(np.abs(there), 99.9)) * 1.3, 1e-300)
        beside.hist(
            np.clip(there, -reach, reach),
            bins=np.linspace(-reach, reach, _CELLS),
            orientation="horizontal",
            color=VALUE,
        )
        axis.set_ylim(-reach, reach)
        beside.set_xticks([])
        axis.set_ylabel(label)
        for edge in ("top", "right", "bottom"):
            beside.spines[edge].set_visible(False)
        beside.spines["left"].set_color(QUIET)
        beside.tick_params(left=False)
    _finished(list(grid[:, 0]))


def settling(answer: Answer, place: Place) -> None:
    """The estimates over the time of the recording, with the answer and its interval."""
    names = answer.model.p_names
    rows = -(-len(names) // _COLUMNS)
    grid = place.subplots(rows, _COLUMNS, sharex=True, squeeze=False)
    for k, (name, axis) in enumerate(zip(names, grid.T.flat, strict=False)):
        one = answer.values[name]
        told, interval = shown(one), one.interval()
        unit, scale = unit_for(abs(one.value or 0.0), one.unit)
        late: list[Float] = []
        for (t, history, label), color in zip(histories(answer), (VALUE, INK), strict=False):
            axis.plot(t, history[:, k] / scale, color=color, linewidth=1.2, label=label)
            late.append(history[len(history) // _SETTLED :, k] / scale)
        if told is not None and interval is not None and one.value is not None:
            low, high = (end / scale for end in interval)
            axis.axhspan(low, high, color=PREDICTED, alpha=0.22, linewidth=0, label="95 % interval")
            axis.axhline(one.value / scale, color=PREDICTED, linewidth=0.9, label="answer")
            away = np.abs(np.concatenate([*late, [low, high]]) - one.value / scale)
            reach = 1.15 * max(float(np.nanmax(away)), high - low)
            axis.set_ylim(one.value / scale - reach, one.value / scale + reach)
        axis.set_ylabel(f"{name} [{unit}]" if unit else name)
        _styled(axis)
    for axis in grid.T.flat[len(names) :]:
        axis.set_axis_off()
    grid[0, 0].legend(loc="best", fontsize="small", frameon=False, labelcolor=INK)
    for axis in grid[-1]:
        axis.set_xlabel("time of the recording [s]", color=INK)


def histories(answer: Answer) -> list[tuple[Float, Float, str]]:
    """Times [n] and estimates [n, n_p] up to them, with their names; none where an identifier has none."""
    if isinstance(answer, Analysis):
        return [(answer.found.history_times, answer.found.history, "data up to then")]
    if isinstance(answer, CoreAnswer):
        return [(answer.publications.t, answer.publications.p, "in C, as it runs")]
    if isinstance(answer, RefinedCoreAnswer):
        later = answer.history()
        values = [[of[name].value for name in answer.model.p_names] for _, of in later]
        p = np.array(values, np.float64).reshape(-1, len(answer.model.p_names))
        return [*histories(answer.weak), (np.array([t for t, _ in later]), p, "in C, refined")]
    return []


def _pair(validation: Validation, name: str) -> Sequence[tuple[Float, str, float, str]]:
    measured, simulated = validation.measured[name], validation.simulated[name]
    return (measured, MEASURED, 2.4, "measured"), (simulated, PREDICTED, 1.0, "predicted")


def _scaled(axis: Axes, model: CompiledModel, name: str, values: Float) -> tuple[str, float]:
    """The label of an axis of values of a signal, and what a number at it is multiplied with."""
    _styled(axis)
    unit, scale = prefixed(float(np.nanmax(np.abs(values), initial=0.0)), model.signal(name).unit)
    return f"{name} [{printed_unit(unit) or '1'}]", scale


def _panels(place: Place, count: int, *, shared: bool = True) -> list[Axes]:
    return list(place.subplots(count, 1, sharex=shared, squeeze=False)[:, 0])


def _finished(axes: Sequence[Axes]) -> None:
    axes[-1].set_xlabel("time of the recording [s]", color=INK)
    if axes[0].get_legend_handles_labels()[0]:
        where = {"bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1}  # above the panel
        axes[0].legend(loc="lower right", fontsize="small", ncols=2, frameon=False, labelcolor=INK, **where)


def _styled(axis: Axes) -> None:
    plain_ticks(axis)
    axis.grid(color=QUIET, alpha=0.25, linewidth=0.6)
    axis.tick_params(colors=INK, labelsize="small")
    axis.yaxis.label.set_color(INK)
    axis.patch.set_alpha(0.0)
    for name, edge in axis.spines.items():
        edge.set_color(QUIET)
        edge.set_visible(name in ("left", "bottom"))


def _envelope(t: Float, values: Float, bins: int = _BINS) -> tuple[Float, Float]:
    there = np.isfinite(values)
    return envelope(t[there], values[there], bins)


def _thinned(validation: Validation, values: Float) -> tuple[Float, Float]:
    """Few points of all blocks, which no line connects where time is between them."""
    samples = validation.t.size // validation.blocks
    bins = max(_BINS // validation.blocks, _FEWEST_BINS)
    t, none = validation.t, np.array([np.nan])
    times, kept = [t[:0]], [t[:0]]
    for first in range(0, t.size, samples):
        if first and t[first] - t[first - 1] > 1.5 * (t[1] - t[0]):
            times.append(none)
            kept.append(none)
        for whole, part in zip(
            (times, kept), _envelope(t[first:][:samples], values[first:][:samples], bins), strict=True
        ):
            whole.append(part)
    return np.concatenate(times), np.concatenate(kept)
