"""Text tables that are turned, as tables with a row for each time: those with a row for each signal and time, as data
bases write them (time, name, value), and those with a row for each signal.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import islice, pairwise
from typing import NamedTuple

from pvid.base.units import is_unit
from pvid.rig.cells import is_missing, is_number
from pvid.rig.columns import TIME, unit_in_name
from pvid.rig.layout import SEPARATORS, split
from pvid.rig.times import TimesOfDay, is_time

_SAMPLED, _SEEN = 2000, 20_000  # lines by which a table is recognised that has its time in a column, or in a row
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
    units: tuple[str, ...]  # of the signals; () where the table states none
    head: tuple[str, ...]
    stacked: bool  # one signal after the other


def turned(blocks_of: Callable[[], Iterator[bytes]]) -> Turned | None:
    """A text table whose blocks of lines begin anew at every call; None where it is not turned."""
    lines = list(islice(_all(blocks_of), _SEEN))
    for separator in SEPARATORS if lines else ():
        rows = [split(one, separator) or [""] for one in lines]
        if (long := _long(rows[:_SAMPLED], separator, blocks_of)) is not None:
            what = f"a row for each signal and time ({', '.join(long.names[:8])}): read as a column for each signal"
            return Turned(what, partial(_of_long, long, blocks_of))
        if _is_transposed(rows):
            rows = [split(one, separator) or [""] for one in _all(blocks_of)]
            width = min(map(len, rows))
            written = _written(zip(*(row[:width] for row in rows), strict=True))
            return Turned("a row for each signal: read as a column for each", partial(iter, [written]))
    return None


def _all(blocks_of: Callable[[], Iterator[bytes]]) -> Iterator[str]:
    return (line for block in blocks_of() for line in _lines(block))


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


def _long(rows: list[list[str]], separator: str, blocks_of: Callable[[], Iterator[bytes]]) -> _Long | None:
    """One column of few words, that change from row to row or where the time begins again, and one of numbers."""
    head, *body = rows
    if any(is_number(one) or is_time(one) for one in head):
        head, body = [f"{k + 1}" for k in range(len(head))], rows  # the columns have no names
    whole = [row for row in body if len(row) == len(head) and row != head]
    if len(whole) < max(0.9 * len(body), 1) or len(head) < 3:
        return None
    columns = list(zip(*whole, strict=True))
    most = [2 * sum(map(_is_word, one)) > len(one) for one in columns]
    worded = [k for k, one in enumerate(columns) if all(map(_is_word, one)) and len(set(one)) <= _MOST_SIGNALS]
    changing = [k for k, one in enumerate(columns) if k not in worded and not most[k] and len(set(one)) > 2]
    times = [k for k in changing if TIME.is_called(head[k]) or is_time(columns[k][0])]
    if not times and head[0] == "1":
        times = [k for k in changing if all(b >= a for a, b in pairwise(_numbers(columns[k])))][:1]
    values = [k for k in changing if k not in times]
    if len(values) > 1:
        values = [k for k in values if _VALUE.search(head[k])]
    if not times or len(values) != 1 or not worded:
        return None
    return _of_words(separator, head, (times[0], values[0]), worded, blocks_of)


def _of_words(
    separator: str,
    head: list[str],
    places: tuple[int, int],
    worded: list[int],
    blocks_of: Callable[[], Iterator[bytes]],
) -> _Long | None:
    """By all lines of the file: a signal may come late, and its unit stand beside it."""
    time, value = places
    found = [row for line in _all(blocks_of) if len(row := split(line, separator) or []) == len(head) and row != head]
    words = {k: dict.fromkeys(row[k] for row in found) for k in worded}
    words = {k: one for k, one in words.items() if 1 < len(one) <= _MOST_SIGNALS and _FEWEST * len(one) <= len(found)}
    if not words:
        return None
    name = max(words, key=lambda k: len(words[k]))
    turns = [k for k in range(1, len(found)) if found[k][name] != found[k - 1][name]]
    stacked = len(turns) < len(words[name])
    if stacked:
        at = _numbers(row[time] for row in found)
        fits = all(at[k] < at[k - 1] for k in turns)
    else:
        fits = 2 * len(turns) > len(found)
    if not fits:
        return None
    names, units = tuple(words[name]), tuple[str, ...]()
    for k in worded:
        beside = {(row[name], row[k]) for row in found}
        if k != name and len(beside) == len(names) and all(is_unit(unit) for _, unit in beside):
            units = tuple(dict(beside)[one] for one in names)
    above = head[time] if head[0] != "1" else "t"
    return _Long(separator, len(head), time, name, value, above, names, units, tuple(head), stacked)


def _numbers(stamps: Iterable[str]) -> list[float]:
    """By which stamps are sorted; NaN of one that is none."""
    cells = list(stamps)
    if is_time(cells[0]):
        return list(map(float, TimesOfDay().seconds(cells)))
    return [float(one.replace(",", ".")) if is_number(one.replace(",", ".")) else float("nan") for one in cells]


def _of_long(long: _Long, blocks_of: Callable[[], Iterator[bytes]]) -> Iterator[bytes]:
    """Rows of one stamp that are beside each other, or anywhere in a stacked table, as one."""
    place = {name: k for k, name in enumerate(long.names)}
    units = [[unit_in_name(long.above, "", "s") or "s", *long.units]] if long.units else []
    head = _written([[long.above, *long.names], *units])
    rows: dict[tuple[str, int], list[str]] = {}  # by stamp, and how often it has been there
    for block in blocks_of():
        for line in _lines(block):
            cells = split(line, long.separator) or []
            if len(cells) != long.width or cells[long.name] not in place or tuple(cells) == long.head:
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
