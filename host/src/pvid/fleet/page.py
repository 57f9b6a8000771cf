"""A fleet in one page: what changed, what all recordings have in common, every parameter of every board over time."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from pvid.base.rounding import percent, with_error
from pvid.base.wording import listed
from pvid.fleet.changes import Change, Float, Series, series_of
from pvid.fleet.row import EQUAL, Row
from pvid.identification.summary import unit_for
from pvid.oracle.weak.words import WIDE
from pvid.show import answer_figure as of
from pvid.show.document import document, picture, table, text

_MOST_COLORS = 6  # boards with a colour of their own; of more, those that are named
_COLORS = ("C0", "C1", "C2", "C4", "C8", "C9")
_PANEL = (4.0, 2.2)  # inches
_SHARED = 0.5  # of the recordings, from which on a warning is one of all
_FEWEST_BOARDS, _ODD, _ODD_PART = 4, 4.0, 0.1  # that are compared; of the others' range, of its error; of the value
_DIGITS = 0.1  # of a change: of the last two digits that are shown
_DAY, _SHORTEST = 86400.0, 60.0  # seconds


@dataclass(frozen=True)
class Fleet:
    """Rows of a fleet, and what they say together.

    Attributes
    ----------
    alarm : a change is an alarm from this part of the value on
    """

    rows: Sequence[Row]
    series: Sequence[Series]
    alarm: float

    @classmethod
    def of(cls, rows: Sequence[Row], alarm: float = 0.01) -> Fleet:
        """Boards that are folders lose the part of the path that all have."""
        short = _short(list(dict.fromkeys(row.board for row in rows)))
        named = [replace(row, board=short[row.board]) for row in rows]
        return cls(named, series_of(named), alarm)

    def changes(self, *, alarms: bool) -> list[tuple[Series, Change]]:
        """Alarms, or what is beyond chance and smaller; the largest first."""
        found = [(one, change) for one in self.series for change in one.changes]
        return sorted(
            (one for one in found if (abs(one[1].part) >= self.alarm) == alarms), key=lambda one: -abs(one[1].part)
        )

    @cached_property
    def odd(self) -> Sequence[tuple[str, str]]:
        """Each board whose value is far from those of all others, which agree, and a sentence; the farthest first."""
        found = []
        for own in _by_parameter(self).values():
            latest = np.array([one.latest[0] for one in own])
            for k, one in enumerate(own if len(own) >= _FEWEST_BOARDS else ()):
                others, value = np.delete(latest, k), float(latest[k])
                usual = float(np.median(others))
                off = abs(value - usual)
                if usual and off > max(_ODD * float(np.ptp(others)), _ODD_PART * abs(usual), _ODD * one.latest[1]):
                    unit, scale = unit_for(abs(value), one.unit)
                    shown, *ends = (with_error(each / scale, off / scale / 10)[0] for each in (value, *_ends(others)))
                    among = " to ".join(dict.fromkeys(ends))
                    words = f"{one.board}: {one.name} is {shown} {unit}".rstrip() + f", of all other boards {among}"
                    found.append((off / abs(usual), one.board, words))
        return [(board, words) for _, board, words in sorted(found, reverse=True)]

    @property
    def title(self) -> str:
        """As "Fleet of 2 boards, 1 to 6 November 2026"."""
        began = [row.began for row in self.rows if row.began]
        when = f", {_dates(min(began), max(began), ' to ')}" if began else ""
        return f"Fleet of {_count(len({row.board for row in self.rows}), 'board')}{when}"

    @property
    def counts(self) -> Mapping[str, int]:
        """Recordings by outcome."""
        found = Counter("failed" if row.verdict is None else row.verdict for row in self.rows)
        found["logs that are not equal"] = sum(row.verified not in (None, EQUAL) for row in self.rows)
        return {name: count for name, count in found.items() if count}

    @cached_property
    def shared(self) -> Mapping[str, tuple[str, int]]:
        """Warnings of most recordings that have an answer, without their numbers: the first one, and how many."""
        kinds: dict[str, list[str]] = {}
        for row in self.rows:
            for kind, own in {_kind(one): one for one in _warnings(row)}.items():
                kinds.setdefault(kind, []).append(own)
        answered = sum(row.verdict is not None for row in self.rows)
        return {kind: (own[0], len(own)) for kind, own in kinds.items() if len(own) > max(1, _SHARED * answered)}


def _ends(values: Float) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def sentence(series: Series, change: Change) -> str:
    """What changed, as "motors/b3: R rose by 10 % (1.200 to 1.320 ohm) between 3 and 4 November 2026"."""
    error = max(float(np.min(series.noise)), _DIGITS * abs(change.after - change.before))
    unit, scale = unit_for(abs(change.before), series.unit)
    before, _ = with_error(change.before / scale, error / scale)
    after = f"{change.after / scale:.{len(before.partition('.')[2])}f}"
    how = f"{'rose' if change.after > change.before else 'fell'}"
    size = f" by {percent(abs(change.part))}" if np.isfinite(change.part) else ""
    step = change.kind == "step"
    between = " and " if step else " to "
    dates = _dates(change.start, change.end, between)
    when = f"{('between' if step else 'steadily from') if between in dates else 'on'} {dates}"
    return f"{series.board}: {series.name} {how}{size} ({before} to {after}{' ' + unit if unit else ''}) {when}"


def page(fleet: Fleet, command: str, folder: Path | None = None, *, refresh: int = 0) -> str:
    """A document of HTML without anything from elsewhere.

    Parameters
    ----------
    command : that made it
    folder : in which it will be, for links to reports
    refresh : seconds after which a browser loads it again; 0: never
    """
    outcomes = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in fleet.counts.items())
    parts = [
        f"<h1>{text(fleet.title)}</h1><p>{_count(len(fleet.rows), 'recording')}: {text(outcomes)}</p>",
        "<h2>What changed</h2>",
        *_changed(fleet),
        _figure(fleet) if fleet.series else "",
        *_common(fleet),
        "<h2>Parameters</h2>",
        "<p>Mean since the last step, or the value at the end of a trend, with its standard error by noise, scatter "
        "and what the equations lack; without the errors of scale that all recordings have in common.</p>",
        _means(fleet),
        "<h2>Recordings</h2>",
        _recordings(fleet, folder or Path()),
        f'<p class="quiet">{text(command)}</p>',
    ]
    return document(fleet.title, "".join(parts), refresh=refresh, broad=True)


def _changed(fleet: Fleet) -> Iterator[str]:
    alarms, small = fleet.changes(alarms=True), fleet.changes(alarms=False)
    if alarms:
        items = "".join(f'<li><strong class="bad">{text(sentence(*one))}</strong></li>' for one in alarms)
        yield f"<ul>{items}</ul>"
    else:
        yield f"<p>No parameter changed by {percent(fleet.alarm)} or more.</p>"
    if fleet.odd:
        items = "".join(f"<li><strong>{text(words)}</strong></li>" for _, words in fleet.odd)
        yield f"<p>Boards apart from the others:</p><ul>{items}</ul>"
    if small:
        items = "".join(f"<li>{text(sentence(*one))}</li>" for one in small)
        heading = f"{_count(len(small), 'smaller change')}, beyond chance"
        yield f"<details><summary>{heading}</summary><ul>{items}</ul></details>"


def _common(fleet: Fleet) -> Iterator[str]:
    """Errors of scale, and warnings of most recordings, once."""
    lines = []
    for name in dict.fromkeys(one.name for one in fleet.series):
        values = [(row.parameters[name], row.se_apart.get(name)) for row in fleet.rows if name in row.parameters]
        scales = [
            max(0.0, se**2 - apart**2) ** 0.5 / abs(value)
            for (value, se, _), apart in values
            if apart is not None and value
        ]
        if scales and (scale := float(np.median(scales))) > 0:
            lines.append(f"{name} {percent(scale)}")
    if not lines and not fleet.shared:
        return
    yield "<h2>What all recordings have in common</h2><ul>"
    for first, count in fleet.shared.values():
        yield f"<li>{text(first)} (alike in {count} of {len(fleet.rows)} recordings)</li>"
    if lines:
        yield (
            f"<li>Errors of scale (gains, constants, the clock), one standard error: {text(', '.join(lines))}. "
            "They are the same before and after a change.</li>"
        )
    yield "</ul>"


def _warnings(row: Row) -> list[str]:
    return row.warning.splitlines() if row.warning else []


def _kind(warning: str) -> str:
    return re.sub(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", "#", warning)


def _means(fleet: Fleet) -> str:
    """A row for each board, a column for each parameter."""
    if not fleet.series:
        return "<p>None.</p>"
    boards: dict[str, dict[str, str]] = {}
    heads: dict[str, str] = {}
    for name, own in _by_parameter(fleet).items():
        unit, scale = _scale(own)
        heads[name] = f"{name} [{unit}]" if unit else name
        for one in own:
            value, se = one.latest
            boards.setdefault(one.board, {})[name] = " ± ".join(with_error(value / scale, se / scale))
    lines = [[text(board), *(text(of.get(name, "-")) for name in heads)] for board, of in sorted(boards.items())]
    return table(("board", *map(text, heads.values())), lines, numbers=len(heads) + 1, cards=True)


def _by_parameter(fleet: Fleet) -> dict[str, list[Series]]:
    """Those that changed first, as they are named."""
    changed = [one for one, _ in (*fleet.changes(alarms=True), *fleet.changes(alarms=False))]
    out: dict[str, list[Series]] = {one.name: [] for one in (*changed, *fleet.series)}
    for one in fleet.series:
        out[one.name].append(one)
    return out


def _scale(series: Sequence[Series]) -> tuple[str, float]:
    """Unit with an SI prefix or a power of ten, in which the values are near 1, and its size."""
    largest = max(float(np.abs(one.value).max()) for one in series)
    return unit_for(largest, series[0].unit)


def _recordings(fleet: Fleet, folder: Path) -> str:
    lines = []
    for row in fleet.rows:
        words = [row.failure or (None if row.identified else row.status)]
        words += [one for one in _warnings(row) if _kind(one) not in fleet.shared]
        words += ["as of all"] if any(_kind(one) in fleet.shared for one in _warnings(row)) else []
        words += [row.verified] if row.verified not in (None, EQUAL) else []
        wide = [name for name, (value, se, _) in row.parameters.items() if se > WIDE * abs(value)]
        words += [f"large errors of {listed(wide)}"] if wide and row.verdict == "usable" else []
        name = text(row.path)
        if row.report is not None:
            name = f'<a href="{quote(os.fsencode(os.path.relpath(row.report, folder)))}">{name}</a>'
        date = _date(row.began, clock=True) if row.began else "-"
        by = " (time of the file)" if row.began and row.dated == "file" else ""
        verdict = (row.verdict or "failed").replace("_", " ")
        lines.append([date + by, name, text(verdict), "<br>".join(text(one) for one in words if one)])
    return table(("date (UTC)", "recording", "verdict", "why"), lines, cards=True)


def _figure(fleet: Fleet) -> str:
    """A picture for each parameter: value and error without scale over the date."""
    boards = list(dict.fromkeys(one.board for one in fleet.series))
    named = [series.board for series, _ in fleet.changes(alarms=True)] + [board for board, _ in fleet.odd]
    colored = (boards if len(boards) <= _MOST_COLORS else [*dict.fromkeys(named)])[:_MOST_COLORS]
    colors = dict(zip(colored, map(to_hex, _COLORS), strict=False))
    keys = "".join(
        f'<span class="key" style="color:{color}">● {text(board)}</span> ' for board, color in colors.items()
    )
    warned = {(row.board, row.began) for row in fleet.rows if row.warning is not None}
    began = [float(at) for one in fleet.series for at in one.t]
    spread = max(began) - min(began)
    margin = spread / 20 if spread >= _SHORTEST else _DAY / 2  # else the axis has no dates
    dates = (_day(min(began) - margin), _day(max(began) + margin))
    draw = partial(_drawn, colors=colors, warned=warned, dates=dates)
    pictures = [
        picture(partial(draw, name=name, own=own), _PANEL[1], "", f"fleet-{k}", _PANEL[0])
        for k, (name, own) in enumerate(_by_parameter(fleet).items())
    ]
    return (
        f'<p>{keys}</p><div class="multiples">{"".join(pictures)}</div><p class="quiet">Each parameter of each board, '
        "with one standard error by noise and what the equations lack. Open: a recording with a warning."
        f"{'' if len(boards) <= _MOST_COLORS else ' Grey: all other boards.'}</p>"
    )


def _drawn(
    figure: Figure,
    name: str,
    own: Sequence[Series],
    colors: Mapping[str, str],
    warned: Set[tuple[str, float]],
    dates: tuple[float, float],
) -> None:
    panel = figure.subplots()
    unit, scale = _scale(own)
    for one in sorted(own, key=lambda one: one.board in colors):
        color = colors.get(one.board, of.QUIET)
        style: Any = {"color": color, "markersize": 4, "linewidth": 0.8, "capsize": 2, "elinewidth": 0.6}
        at_dates = [_day(float(at)) for at in one.t]
        faces = ["none" if (one.board, float(at)) in warned else color for at in one.t]
        panel.errorbar(at_dates, one.value / scale, one.apart / scale, fmt="-", **style, zorder=2)
        panel.scatter(at_dates, one.value / scale, s=16, facecolors=faces, edgecolors=color, zorder=3)
    panel.set_title(f"{name} [{unit}]" if unit else name, loc="left", fontsize="medium")
    panel.set_xlim(*dates)
    panel.ticklabel_format(axis="y", useOffset=False)
    panel.grid(alpha=0.3)
    locator = AutoDateLocator(maxticks=6)  # type: ignore[no-untyped-call]
    panel.xaxis.set_major_locator(locator)
    panel.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]


def _day(seconds: float) -> float:
    """As axes have it."""
    return seconds / _DAY


def _short(boards: Sequence[str]) -> dict[str, str]:
    """Names of boards without the folders that all of them are in, and without the name that all files have."""
    parts = {board: board.split(os.sep) for board in boards}
    common = len(os.path.commonprefix([own[:-1] for own in parts.values()])) if len(boards) > 1 else 0
    alike = len({own[-1] for own in parts.values()}) == 1 and all(len(own) > common + 1 for own in parts.values())
    end = -1 if alike and len(boards) > 1 else None
    return {board: os.sep.join(own[common:end]) for board, own in parts.items()}


def _dates(start: float, end: float, between: str) -> str:
    """Two dates, as "1 to 6 November 2026"; within a day with their times."""
    first, last = (datetime.fromtimestamp(one, UTC) for one in (start, end))
    if first.date() == last.date():
        clocks = list(dict.fromkeys(f"{one:%H:%M}" for one in (first, last)))
        return f"{between.join(clocks)} on {_date(end)}" if between.strip() == "and" and len(clocks) > 1 else _date(end)
    month = f" {first:%B}" if first.month != last.month or first.year != last.year else ""
    year = f" {first.year}" if first.year != last.year else ""
    return f"{first.day}{month}{year}{between}{_date(end)}"


def _date(seconds: float, *, clock: bool = False) -> str:
    """As "3 November 2026" or, with the time of day, "3 November 2026 14:05"."""
    at = datetime.fromtimestamp(seconds, UTC)
    return f"{at.day} {at:%B %Y %H:%M}" if clock else f"{at.day} {at:%B %Y}"


def _count(number: int, of: str) -> str:
    return f"{number} {of}{'' if number == 1 else 's'}"
