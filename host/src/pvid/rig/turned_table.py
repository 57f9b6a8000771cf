"""Text tables that are turned, as tables with a row for each time: those with a row for each signal and time, as data
bases write them (time, name, value), and those with a row for each signal.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

from pvid.rig.cells import is_missing, is_number
from pvid.rig.columns import TIME
from pvid.rig.layout import SEPARATORS, split
from pvid.rig.times import TimesOfDay, is_time

_SAMPLED = 2000  # lines that show how a table is turned
_MOST_SIGNALS = 64
_FEWEST = 3  # times of each signal
_VALUE = re.compile("value|wert|valeur|valor|reading|state", re.I)
_BETWEEN = ";"  # cells of what is written


class Turned(NamedTuple):
    """What a table is, in words, and its lines with a row for each time."""

    note: str
    blocks: Callable[[], Iterator[bytes]]


class _Long(NamedTuple):
    """Places of the columns of a table with a row for each signal and time, and what stands above that of the time."""

    separator: str
    width: int
    time: int
    name: int
    value: int
    above: str
    names: tuple[str, ...]
    stacked: bool  # one signal after the other


def turned(blocks_of: Callable[[], Iterator[bytes]]) -> Turned | None:
    """A text table whose blocks of lines begin anew at every call; None where it is not turned."""
    lines = list(_lines(next(blocks_of(), b"")))
    for separator in SEPARATORS if lines else ():
        rows = [split(one, separator) or [""] for one in lines]
        if (long := _long(rows, separator)) is not None:
            what = f"a row for each signal and time ({', '.join(long.names[:8])}): read as a column for each signal"
            return Turned(what, partial(_of_long, long, blocks_of))
        if _is_transposed(rows):
            rows = [split(one, separator) or [""] for block in blocks_of() for one in _lines(block)]
            width = min(map(len, rows))
            written = _written(zip(*(row[:width] for row in rows), strict=True))
            return Turned("a row for each signal: read as a column for each", partial(iter, [written]))
    return None


def _lines(block: bytes) -> Iterator[str]:
    return (one for one in block.decode(errors="replace").split("\n") if one.strip() and one.lstrip()[0] not in "#%")


def _written(rows: Iterable[Iterable[str]]) -> bytes:
    return "".join(_BETWEEN.join(one.replace(_BETWEEN, " ") for one in row) + "\n" for row in rows).encode()


def _is_word(cell: str) -> bool:
    return not (is_number(cell) or is_missing(cell) or is_time(cell))


def _is_transposed(rows: list[list[str]]) -> bool:
    """Each line has a name of its own, and numbers or times behind it, more than there are lines."""
    names, width = {row[0] for row in rows}, len(rows[0])
    return (
        1 < len(rows) == len(names) <= _MOST_SIGNALS
        and all(map(_is_word, names))
        and all(len(row) == width > max(_FEWEST, len(rows)) and not any(map(_is_word, row[1:])) for row in rows)
    )


def _long(rows: list[list[str]], separator: str) -> _Long | None:
    """One column of few words, that change from row to row or where the time begins again, and one of numbers."""
    head, *body = rows[:_SAMPLED]
    body = [row for row in body if len(row) == len(head)]
    if (
        any(is_number(one) or is_time(one) for one in head)
        or len(body) < 0.9 * (len(rows[:_SAMPLED]) - 1)
        or len(head) < 3
    ):
        return None
    columns = list(zip(*body, strict=True))
    words = {k: tuple(dict.fromkeys(one)) for k, one in enumerate(columns) if all(map(_is_word, one))}
    words = {k: one for k, one in words.items() if 1 < len(one) <= _MOST_SIGNALS and _FEWEST * len(one) <= len(body)}
    changing = [k for k, one in enumerate(columns) if k not in words and not _is_word(one[0]) and len(set(one)) > 2]
    times = [k for k in changing if TIME.is_called(head[k]) or is_time(columns[k][0])]
    values = [k for k in changing if k not in times]
    if len(values) > 1:
        values = [k for k in values if _VALUE.search(head[k])]
    if not times or len(values) != 1 or not words:
        return None
    time, value, name = times[0], values[0], max(words, key=lambda k: len(words[k]))
    stamps, own = columns[time], columns[name]
    turns = [k for k in range(1, len(own)) if own[k] != own[k - 1]]
    stacked = len(turns) < len(words[name])
    if stacked:
        at = _numbers(stamps)
        fits = all(at[k] < at[k - 1] for k in turns)
    else:
        fits = 2 * len(turns) > len(own)
    return _Long(separator, len(head), time, name, value, head[time], words[name], stacked) if fits else None


def _numbers(stamps: Iterable[str]) -> list[float]:
    """By which stamps are sorted; NaN of one that is none."""
    cells = list(stamps)
    if is_time(cells[0]):
        return list(map(float, TimesOfDay().seconds(cells)))
    return [float(one.replace(",", ".")) if is_number(one.replace(",", ".")) else float("nan") for one in cells]


def _of_long(long: _Long, blocks_of: Callable[[], Iterator[bytes]]) -> Iterator[bytes]:
    """Rows of one stamp that are beside each other, or anywhere in a stacked table, as one."""
    place = {name: k for k, name in enumerate(long.names)}
    head = _written([[long.above, *long.names]])
    rows: dict[tuple[str, int], list[str]] = {}  # by stamp, and how often it has been there
    for block in blocks_of():
        for line in _lines(block):
            cells = split(line, long.separator) or []
            if len(cells) != long.width or cells[long.name] not in place:
                continue
            stamp, at = cells[long.time], place[cells[long.name]] + 1
            again = 0
            while (row := rows.setdefault((stamp, again), [stamp, *[""] * len(place)]))[at]:
                again += 1
            row[at] = cells[long.value]
        if not long.stacked and len(rows) > 1:
            last = rows.popitem()
            yield head + _written(rows.values())
            head, rows = b"", dict([last])
    kept = list(rows.values())
    if long.stacked:
        numbers = _numbers(row[0] for row in kept)
        kept = [kept[k] for k in sorted(range(len(kept)), key=numbers.__getitem__)]
    yield head + _written(kept)
