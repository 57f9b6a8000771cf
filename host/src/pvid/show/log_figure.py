"""A log as a figure, under the names that the board gave: estimates, what is said of them, and
the last seconds of the samples."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pvid.base.figure_file import drawable, save
from pvid.base.rounding import with_error
from pvid.identification.summary import unit_for
from pvid.log.history import History
from pvid.log.mechanism import LogMechanism
from pvid.log.reader import LogReader
from pvid.log.words import board_words, reason_words, residual_words, stage_words
from pvid.show.answer_figure import PREDICTED, VALUE
from pvid.show.axis_limits import interesting, plain_ticks

Float = npt.NDArray[np.float64]

_COLUMNS = 2
_LINE = 130  # characters of the title
_POINTS = 2000  # half of the most estimates that are drawn


def write_log_figure(log: Path, mechanism: LogMechanism, path: Path) -> bool:
    """Draws it; the format follows the suffix of `path` (png, svg, pdf). False: the log has no estimate to draw.

    Raises PvidError when the log cannot be read, or the file cannot be written.
    """
    history, reader = History(mechanism, points=_POINTS), LogReader(log)
    history.know(mechanism)  # whatever the board says later
    for record in reader:
        history.take(record)
    t = history.estimates("t")
    if not len(t):
        return False
    parameters, extras = mechanism.parameters, history.extras
    drawn = (*parameters, *extras)
    panels = len(drawn) + 2 + len(mechanism.samples)
    rows = -(-panels // _COLUMNS)
    figure, grid = plt.subplots(rows, _COLUMNS, squeeze=False, figsize=(13, 1.5 + 1.9 * rows), layout="constrained")
    try:
        axes = list(grid.T.flat)
        _estimates(history, axes, "first stage" if history.stage else "estimate", "C0", "C1")
        rest = axes[len(drawn) :]
        _quality(history, rest[0], rest[1])
        seconds, *signals = history.samples()
        for sample, x, axis in zip(mechanism.samples, signals, rest[2:], strict=False):
            axis.plot(seconds, x, color="C1", linewidth=0.8, label=f"last {history.window_s:g} s at most")
            axis.set_ylabel(sample.label)
        for axis in axes[:panels]:
            axis.grid(alpha=0.3)
            axis.set_xlabel("time of the log [s]")
        for axis in axes[panels:]:
            axis.set_axis_off()
        for axis in (*([axes[0], axes[len(parameters)]] if extras else [axes[0]]), *rest[2:3]):
            axis.legend(loc="upper right", fontsize="small")
        lines = [f"{log.name}, {board_words(history.hello, reader.account)}", _last(history), reader.account.text]
        folded = [part for line in lines for part in textwrap.wrap(drawable(line), _LINE) or [""]]
        figure.suptitle("\n".join(folded), fontsize=11, parse_math=False)
        save(figure, path, dpi=110)
    finally:
        plt.close(figure)
    return True


def estimates_of(log: Path, mechanism: LogMechanism) -> tuple[Callable[[Figure], None], int] | None:
    """Draws the estimates that a board published, in a panel for each of so many quantities; None: there is none."""
    history = History(mechanism, points=_POINTS)
    history.know(mechanism)
    for record in LogReader(log):
        history.take(record)
    panels = len(mechanism.parameters) + len(history.extras)
    if not len(history.estimates("t")):
        return None

    def draw(figure: Figure) -> None:
        grid = figure.subplots(-(-panels // _COLUMNS), _COLUMNS, squeeze=False, sharex=True)
        axes = list(grid.T.flat)
        _estimates(history, axes, "first stage" if history.stage else "estimate", VALUE, PREDICTED)
        for axis in axes[:panels]:
            axis.grid(alpha=0.25)
        for axis in axes[panels:]:
            axis.set_axis_off()
        axes[0].legend(fontsize="small")
        for axis in grid[-1]:
            axis.set_xlabel("time of the log [s]")

    return draw, panels


def _estimates(history: History, axes: Sequence[Axes], weak: str, *colors: str) -> None:
    """Of each quantity over time, with its band; of both stages where there are two."""
    t = history.estimates("t")
    for one, axis in zip((*history.mechanism.parameters, *history.extras), axes, strict=False):
        limits = []
        last = history.published.get(one.name, 0.0)
        unit, scale = unit_for(abs(last) if math.isfinite(last) else 0.0, one.unit)
        if one not in history.extras:
            of_weak = t, history.estimates(one.name) / scale, history.estimates(f"{one.name}_se") / scale
            limits += _curve(axis, *of_weak, colors[0], weak)
        if history.stage:
            value, se = (history.refined(name) / scale for name in (one.name, f"{one.name}_se"))
            limits += _curve(axis, history.refined("t"), value, se, colors[1], "refined, published where drawn")
        if limits:
            axis.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
        axis.set_ylabel(f"{one.name} [{unit}]" if unit else one.name)
        plain_ticks(axis)


def _curve(axis: Axes, t: Float, value: Float, se: Float, colour: str, name: str) -> list[tuple[float, float]]:
    """An estimate [n] with its band over t [n, s]; returns the limits that show it, none where there is nothing."""
    axis.fill_between(t, value - 2 * se, value + 2 * se, color=colour, alpha=0.25, label="±2 standard errors")
    axis.plot(t, value, color=colour, linewidth=1.2, label=name)
    low, high = interesting(value, 2 * se)
    return [(low, high)] if math.isfinite(low) and low < high else []


def _quality(history: History, residual: Axes, kappa: Axes) -> None:
    t = history.estimates("t")
    residual.plot(t, history.estimates("residual"), color="C4")
    residual.set_ylabel("residual")
    residual.set_title(residual_words(history.hello), fontsize="small")
    shown = history.estimates("kappa")
    kappa.semilogy(t, np.where(shown > 0, shown, np.nan), color="C2")
    kappa.set_ylabel(f"excitation of {history.mechanism.parameters[0].name}")


def _last(history: History) -> str:
    """The last estimate in words."""
    newest = history.published
    parts = []
    for one in (*history.mechanism.parameters, *history.extras):
        if math.isfinite(newest.get(one.name, math.nan)):
            value, error = with_error(newest[one.name], newest[f"{one.name}_se"])
            parts.append(f"{one.name} = {value} ± {error} {one.shown_unit}".rstrip())
    words = reason_words(history.reason)
    published = (
        f"published: {stage_words(history.stage, history.refined_reason)}; first stage: " if history.stage else ""
    )
    return f"{', '.join(parts)} (± standard error); {published}{history.reason}{': ' if words else ''}{words}"
