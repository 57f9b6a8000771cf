"""A fleet in one page: what was answered, what failed, and how each board's parameters drift over time."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape

import numpy as np

from pvid.base.replacing import CREATOR
from pvid.base.rounding import with_error
from pvid.fleet.row import EQUAL, Row

_DAY = 86400.0
_DRIFTS = 4.0  # standard errors of the slope
_MOST_BOARDS = 10  # with a colour of their own
_STYLE = """
:root { color-scheme: light dark; font: 15px/1.45 system-ui, sans-serif; }
body { max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; }
td, th { padding: .2rem .8rem; text-align: right; border-bottom: 1px solid #8884; }
td:first-child, th:first-child, td.words { text-align: left; }
.alarm { color: #c22; font-weight: 600; }
figure { margin: 1rem 0; background: #fff; }
svg { width: 100%; height: auto; }
"""


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


def page(rows: Sequence[Row], title: str) -> str:
    """A document of HTML without anything from elsewhere."""
    drifts = drifts_of(rows)
    counts = "".join(f"<tr><td>{escape(name)}</td><td>{count}</td></tr>" for name, count in counts_of(rows).items())
    parts = [
        f"<h1>{escape(title)}</h1><p>{len(rows)} recordings of {len({row.board for row in rows})} boards</p>",
        f"<table>{counts}</table>",
        "<h2>Parameters</h2>",
        "<p>Mean over a board's recordings without a warning, and the change in a day. A change beyond "
        f"{_DRIFTS:g} standard errors is marked. Scatter is the variance about the line over that of the standard "
        "errors: 1 is expected.</p>",
        _drift_table(drifts),
        f"<figure>{_figure(rows)}</figure>" if drifts else "",
        "<h2>Recordings without a good answer</h2>",
        _trouble(rows),
    ]
    head = (
        f'<meta charset="utf-8"><meta name="generator" content="{CREATOR}">'
        f'<meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    )
    body = "".join(parts)
    return f'<!doctype html><html lang="en"><head>{head}<style>{_STYLE}</style></head><body>{body}</body></html>\n'


def _drift_table(drifts: Sequence[Drift]) -> str:
    heads = ("board", "parameter", "recordings", "mean", "s.e.", "change a day", "s.e.", "scatter")
    lines = ["<tr>" + "".join(f"<th>{one}</th>" for one in heads) + "</tr>"]
    for one in drifts:
        change = ("-", "-") if one.slope is None or not one.slope_se else with_error(one.slope, one.slope_se)
        cells = [
            escape(one.board),
            escape(f"{one.name} [{one.unit}]" if one.unit else one.name),
            str(one.recordings),
            *with_error(one.mean, one.se),
            *change,
            "-" if one.scatter is None else f"{one.scatter:.2g}",
        ]
        mark = ' class="alarm"' if one.drifts else ""
        lines.append(f"<tr{mark}>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return f"<table>{''.join(lines)}</table>"


def _trouble(rows: Sequence[Row]) -> str:
    lines = []
    for row in rows:
        words = row.failure or (None if row.identified else row.status) or row.warning
        if row.verified not in (None, EQUAL):
            words = f"{words + '; ' if words else ''}{row.verified}"
        if words:
            lines.append(f'<tr><td>{escape(row.path)}</td><td class="words">{escape(words)}</td></tr>')
    return f"<table>{''.join(lines)}</table>" if lines else "<p>None.</p>"


def _figure(rows: Sequence[Row]) -> str:
    """A panel for each parameter: value and standard error over the date, a colour for each board."""
    from matplotlib.figure import Figure

    good = [row for row in rows if row.parameters and row.warning is None]
    names = list(dict.fromkeys((name, one[2]) for row in good for name, one in row.parameters.items()))
    boards = list(dict.fromkeys(row.board for row in good))
    figure = Figure(figsize=(10, 2.2 * len(names)), layout="constrained")
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
                label=board,
            )
        panel.set_ylabel(f"{name} [{unit}]" if unit else name)
        panel.grid(alpha=0.3)
    panels[-1].set_xlabel("date (UTC)")
    panels[-1].tick_params(axis="x", rotation=20)
    if 1 < len(boards) <= _MOST_BOARDS:
        panels[0].legend(fontsize="small", ncols=min(4, len(boards)), loc="lower left", bbox_to_anchor=(0, 1))
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    text = drawn.getvalue()
    return text[text.index("<svg") :]
