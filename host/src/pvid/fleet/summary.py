"""A fleet in one page: what was answered, what failed, and how each board's parameters drift over time."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

import numpy as np
from matplotlib.figure import Figure

from pvid.base.rounding import with_error
from pvid.fleet.row import EQUAL, Row
from pvid.show.document import document, picture, table, text

_DAY = 86400.0
_DRIFTS = 4.0  # standard errors of the slope
_MOST_BOARDS = 10  # with a colour of their own
_LONGEST = 40  # letters of a board in the figure's legend: its last ones


@dataclass(frozen=True)
class Drift:
    """A parameter of a board over its recordings.

    Attributes
    ----------
    recordings : with a value
    mean, se : weighted with the standard errors, the error of the mean
    scatter : variance about the line over what the standard errors explain; None: fewer than three recordings
    slope, slope_se : change a day; its error from the standard errors or the scatter, the larger one; None as above
    """

    board: str
    name: str
    unit: str
    recordings: int
    mean: float
    se: float
    scatter: float | None
    slope: float | None
    slope_se: float | None

    @property
    def drifts(self) -> bool:
        """Whether the change is beyond chance."""
        return self.slope is not None and self.slope_se is not None and abs(self.slope) > _DRIFTS * self.slope_se


def drifts_of(rows: Sequence[Row]) -> list[Drift]:
    """Of every board and parameter, by weighted least squares; recordings with a warning do not count.

    The errors contain no scale: that of a board is the same in all its recordings.
    """
    points: dict[tuple[str, str, str], list[tuple[float, float, float]]] = {}
    for row in rows:
        for name, (value, se, unit) in row.parameters.items():
            if row.warning is None and (apart := row.se_apart.get(name, se)) > 0:
                points.setdefault((row.board, name, unit), []).append((row.began / _DAY, value, apart))
    return [_drift(board, name, unit, np.array(one)) for (board, name, unit), one in points.items()]


def _drift(board: str, name: str, unit: str, points: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> Drift:
    t, value, se = points.T
    weight = se**-2.0
    mean, of_mean = float(weight @ value / weight.sum()), float(weight.sum() ** -0.5)
    centre = t - weight @ t / weight.sum()
    spread = float(weight @ centre**2)
    if len(t) < 3 or spread == 0:
        return Drift(board, name, unit, len(t), mean, of_mean, None, None, None)
    slope = float(weight @ (centre * value) / spread)
    rest = (value - mean - slope * centre) / se
    scatter = float(rest @ rest / (len(t) - 2))
    slope_se = spread**-0.5 * max(1.0, scatter**0.5)
    return Drift(board, name, unit, len(t), mean, of_mean, scatter, slope, slope_se)


def counts_of(rows: Sequence[Row]) -> Mapping[str, int]:
    """Recordings by outcome."""
    found = Counter("failed" if row.verdict is None else row.verdict for row in rows)
    found["logs that are not equal"] = sum(row.verified not in (None, EQUAL) for row in rows)
    return {name: count for name, count in found.items() if count}


def page(rows: Sequence[Row], title: str, folder: Path | None = None) -> str:
    """A document of HTML without anything from elsewhere.

    Parameters
    ----------
    folder : in which it will be, for links to reports
    """
    drifts = drifts_of(rows)
    counts = table((), ([text(name), str(count)] for name, count in counts_of(rows).items()))
    parts = [
        f"<h1>{text(title)}</h1><p>{len(rows)} recordings of {len({row.board for row in rows})} boards</p>",
        counts,
        "<h2>Parameters</h2>",
        "<p>Mean over a board's recordings without a warning, and the change in a day. A change beyond "
        f"{_DRIFTS:g} standard errors is marked. Scatter is the variance about the line over that of the standard "
        "errors: 1 is expected.</p>",
        _drift_table(drifts),
        _figure(rows) if drifts else "",
        "<h2>Recordings without a good answer</h2>",
        _trouble(rows),
        *_reports(rows, folder or Path()),
    ]
    return document(title, "".join(parts))


def _drift_table(drifts: Sequence[Drift]) -> str:
    heads = ("board", "parameter", "recordings", "mean", "s.e.", "change a day", "s.e.", "scatter")
    rows = []
    for one in drifts:
        change = ("-", "-") if one.slope is None or not one.slope_se else with_error(one.slope, one.slope_se)
        cells = [
            text(one.board),
            text(f"{one.name} [{one.unit}]" if one.unit else one.name),
            str(one.recordings),
            *with_error(one.mean, one.se),
            *change,
            "-" if one.scatter is None else f"{one.scatter:.2g}",
        ]
        rows.append([f'<strong class="bad">{cell}</strong>' for cell in cells] if one.drifts else cells)
    return table(heads, rows, numbers=5)


def _reports(rows: Sequence[Row], folder: Path) -> Iterator[str]:
    """Links to them, if there are any."""
    found = [
        [
            f'<a href="{quote(os.fsencode(os.path.relpath(row.report, folder)))}">{text(row.path)}</a>',
            text(row.verdict or ""),
        ]
        for row in rows
        if row.report is not None
    ]
    if found:
        yield "<h2>Reports</h2>" + table(("recording", "verdict"), found)


def _trouble(rows: Sequence[Row]) -> str:
    lines = []
    for row in rows:
        words = row.failure or (None if row.identified else row.status) or row.warning
        if row.verified not in (None, EQUAL):
            words = f"{words + '; ' if words else ''}{row.verified}"
        if words:
            lines.append([text(row.path), text(words)])
    return table(("recording", "why"), lines) if lines else "<p>None.</p>"


def _figure(rows: Sequence[Row]) -> str:
    """A panel for each parameter: value and standard error over the date, a colour for each board."""
    good = [row for row in rows if row.parameters and row.warning is None]
    names = list(dict.fromkeys((name, one[2]) for row in good for name, one in row.parameters.items()))
    return picture(
        lambda figure: _drawn(figure, good, names), 0.9 + 1.7 * len(names), "Value and standard error.", "fleet"
    )


def _drawn(figure: Figure, good: Sequence[Row], names: Sequence[tuple[str, str]]) -> None:
    boards = list(dict.fromkeys(row.board for row in good))
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (name, unit) in zip(panels, names, strict=True):
        for number, board in enumerate(boards):
            here = [row for row in good if row.board == board and name in row.parameters]
            panel.errorbar(
                [datetime.fromtimestamp(row.began, UTC) for row in here],
                [row.parameters[name][0] for row in here],
                [row.parameters[name][1] for row in here],
                fmt="o-",
                markersize=3,
                linewidth=0.8,
                capsize=2,
                color=f"C{number}" if len(boards) <= _MOST_BOARDS else "C0",
                label=board if len(board) <= _LONGEST else f"...{board[-_LONGEST:]}",
            )
        panel.set_ylabel(f"{name} [{unit}]" if unit else name)
        panel.grid(alpha=0.3)
    panels[-1].set_xlabel("date (UTC)")
    panels[-1].tick_params(axis="x", rotation=20)
    if 1 < len(boards) <= _MOST_BOARDS:
        columns = max(1, 2 * _LONGEST // min(_LONGEST, max(map(len, boards))))
        panels[0].legend(fontsize="small", ncols=min(4, columns), loc="lower left", bbox_to_anchor=(0, 1))
