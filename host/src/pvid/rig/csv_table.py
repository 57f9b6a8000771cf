"""Text tables as instruments, programs and loggers write them, read in blocks: memory for the signals and a block more.

`layout` finds the table, `text_lines` reads any encoding, `cells` and `times` read what numpy's compiled reader does
not: it takes the lines of plain numbers, and only what it refuses is read cell by cell. A line that is no row is left
out, counted, and named in a note.
"""

from __future__ import annotations

import gzip
import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.units import scale_to
from pvid.base.wording import listed, shown
from pvid.rig.cells import PLAIN, Evidence, Style, is_missing, is_number, style_note, styles
from pvid.rig.columns import TIME, Columns, MissingColumnError, unit_in, unit_in_name
from pvid.rig.layout import Layout, counts_up, find, split
from pvid.rig.printed_table import printed
from pvid.rig.size import refuse_beyond
from pvid.rig.stated_step import stated_step
from pvid.rig.table import Table
from pvid.rig.text_lines import blocks
from pvid.rig.times import TimesOfDay, is_time
from pvid.rig.turned_table import turned

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_SEARCHED_LINES = 20_000  # for the table
_SAMPLED_ROWS = 500  # that show the style of the numbers; what differs later is found where it is read
_TAIL = 1000  # lines that a cut last line is compared with
# Damaged lines that a table may have: this part of all, and so many of a short one.
_DAMAGED_SHARE, _DAMAGED_LINES = 0.05, 3
_EARLY = 1000  # and more than there are rows: the rest need not be read
_SHOWN = 60  # characters of a line
_FEW = 32  # lines: what numpy refuses is halved down to so many
_COMMAS = ", as if the comma separated columns and were the decimal sign as well"
_NO_NUMBER = (9.9e37, 9.91e37)  # an overload and no number in SCPI, the language of instruments

_SEEN = 4096  # bytes that what is no table is recognised from
_CAN = "CAN frames as bytes, which a data base of the bus turns into signals: `cantools decode --single-line DBC`"
_NO_TABLES = {
    re.compile(rb"\s*date [^\n]*\n\s*base (?:hex|dec)"): f"a Vector log of {_CAN}, or export the signals as CSV",
    re.compile(rb"\s*\(\d+\.\d+\)\s+\w+\s+[0-9A-Fa-f]+(?:#[0-9A-FR#]*|\s+\[\d+\](?:\s+[0-9A-Fa-f]{2})*)\s*\n"): (
        f"a candump log of {_CAN}"
    ),
    re.compile(rb"FMT, ?\d+, ?\d+, ?FMT|\d{4}-\d\d-\d\d [^\n{]*: \w+ \{\w+ : "): (
        "a log of ArduPilot: `mavlogdump.py --format csv --types TYPE RUN.BIN` of the Python package pymavlink writes "
        "the messages of one type as CSV"
    ),
    re.compile(rb"\s*(?:<!DOCTYPE html|<html|<table)", re.I): "a page of HTML: save its table as CSV",
    re.compile(rb"\s*<\?xml"): "XML: save its records as CSV",
    re.compile(rb"SQLite format 3"): "a database: `sqlite3 -header -csv RUN.db 'select * from TABLE' > RUN.csv`",
    re.compile(rb"\s*\$(?:date|version|timescale|comment)\b"): "a dump of value changes (VCD): export it as CSV",
}

_NO_DATA = re.compile(rb"(?m)^[ \t]*(?:[#%]|//|sep=)")
_BLANK_CELL = {
    separator: re.compile(
        rb"(?m)(?:(?<=" + re.escape(separator.encode()) + rb")|^)[ ]*(?=" + re.escape(separator.encode()) + rb"|$)"
    )
    for separator in (",", ";", "\t", "|")
}


class _OtherStyleError(Exception):
    """A number in another style than the column seemed to have."""


def read_csv(path: Path, columns: Columns) -> Table:
    """Reads a table, gzip if its name ends in .gz. Raises PvidError for whatever is wrong with the file."""
    return text_table(path, columns, lambda: blocks(path))


def text_table(path: Path, columns: Columns, lines: Callable[[], Iterator[bytes]], line: str = "line") -> Table:
    """Reads a table of what begins to give blocks of lines anew at every call; `line` is what its lines are called."""
    first = next(lines(), b"")[:_SEEN]
    for form, how in _NO_TABLES.items():
        if form.match(first):
            raise PvidError(f"{path} is {how}.")
    try:
        return _TextTable(path, columns, lines, line).read()
    except PvidError as error:
        refusal = error
    other = turned(lines)
    if other is not None:
        found = _TextTable(path, columns, other.blocks, "row").read()
        return replace(found, notes=(f"the table has {other.note}", *found.notes))
    text = printed(lines)
    if text is None:
        raise refusal
    try:
        found = _TextTable(path, columns, text.blocks, "row").read()
    except PvidError as error:
        raise error if text.named and isinstance(error, MissingColumnError) else refusal from None
    return replace(found, notes=("the numbers stand between words, units or brackets", *found.notes))


def write_csv(path: Path, named: dict[str, FloatArray]) -> bytes:
    """Text of the columns, with every bit."""
    columns = [map(repr, data.tolist()) for data in named.values()]
    lines = [",".join(named), *map(",".join, zip(*columns, strict=True))]
    return ("\n".join(lines) + "\n").encode("ascii")


def write_csv_gz(path: Path, named: dict[str, FloatArray]) -> bytes:
    """The same, compressed; the same bytes at any time of day."""
    return gzip.compress(write_csv(path, named), compresslevel=6, mtime=0)


class _TextTable:
    """A file, with what is found out about it from its first block."""

    def __init__(self, path: Path, columns: Columns, blocks_of: Callable[[], Iterator[bytes]], line: str) -> None:
        self._path, self._blocks, self._line = path, blocks_of, line
        first = next(blocks_of(), b"")
        lines = first.decode(errors="replace").split("\n", _SEARCHED_LINES)[:_SEARCHED_LINES]
        if not any(line.strip() for line in lines):
            raise PvidError(f"{path} is empty.")
        layout = _layout(lines, columns)
        if layout is None:
            numbers = sum(is_number(line.strip()) for line in lines)
            if 2 * numbers > sum(bool(line.strip()) for line in lines):
                raise PvidError(f"{path} has one column alone: that of the time, t [s] or another name, is missing.")
            raise PvidError(f"{path} has no line of two numbers or more: this is no table.")
        step = stated_step(lines[: layout.body - 1], layout)
        timeless = columns["t"].name == "t" and "t" not in layout.names and not (layout.labelled or layout.beside[0])
        own = [one for one in layout.names if "=" not in one]  # no settings
        timeless = timeless and not any(map(TIME.is_called, own)) and not _rising(lines, layout, columns)
        notes: tuple[str, ...] = ()
        if timeless and step is not None:
            self._blocks = partial(_numbered, blocks_of, layout)
            lines = next(self._blocks()).decode(errors="replace").split("\n", _SEARCHED_LINES)[:_SEARCHED_LINES]
            layout = replace(layout, names=(*layout.names, "t"), width=layout.width + 1)
            columns, notes = step.of(columns), (f"no column of time: a row each {step}",)
        self._layout = layout
        where = f", line {layout.header}" if layout.header else ""
        try:
            self._places = columns.places(path, layout.names, where)
        except MissingColumnError as missing:
            others = (columns[one].name in layout.names for one in columns.units if one != "t")
            if not timeless or not all(others):
                raise
            hint = "; where rows have no time, a line in front such as '# dt = 0.001 s' states that between them."
            raise MissingColumnError(str(missing).removesuffix(".") + hint, missing.names) from None
        if max(self._places.values()) >= layout.width:
            raise PvidError(f"{path}{where}: more names than the lines below have cells, {layout.width}.")
        units = {
            signal: (layout.units[place] if place < len(layout.units) else "")
            or unit_in_name(layout.names[place], signal, columns.units[signal])
            for signal, place in self._places.items()
        }
        rows = (layout.cells(line) for line in lines[layout.body - 1 :])
        body = list(islice((cells for cells in rows if cells and self._is_row(cells)), _SAMPLED_ROWS))
        times = [cells[self._places["t"]] for cells in body]
        self._time_is_text = 2 * sum(map(is_time, times)) > len(body)
        if self._time_is_text:
            units.pop("t")
        is_time_unit = unit_in(columns["t"].name, "s") or scale_to("s", units.get("t", "") or "1")
        if step is not None and not (notes or columns["t"].unit_given or self._time_is_text or is_time_unit):
            clock = TIME.is_called(columns["t"].name) and not layout.beside[0]
            if not clock and len(body) > 1 and counts_up(times):
                columns, notes = step.of(columns), (f"{columns['t'].name} counts rows: one each {step}",)
                units.pop("t")
            elif (unit := step.unit_of(times)) is not None:
                name = columns["t"].name
                if clock:
                    notes = (f"{name} is taken in s; in {unit}, --columns t={name}:{unit}, a row would be each {step}",)
                else:
                    notes, units["t"] = (f"{name} is in {unit}: a row each {step}",), unit
        self._columns, of_units = columns.called(layout.names, self._places).in_units_of_file(units)
        self._notes = (*_front_note(lines, layout), *notes, *of_units)
        self._sample = body

    def _is_row(self, cells: Sequence[str]) -> bool:
        return len(cells) in (self._layout.width, self._layout.beside[0])

    @property
    def _numbers(self) -> list[str]:
        """Signals that are numbers."""
        return [one for one in self._places if one != "t" or not self._time_is_text]

    def read(self) -> Table:
        """The whole file."""
        evidence = {self._columns[one].name: Evidence() for one in self._numbers}
        for signal in self._numbers:
            evidence[self._columns[signal].name].add(cells[self._places[signal]] for cells in self._sample)
        found = styles(str(self._path), evidence, False, self._layout.separator)
        try:
            if found is not None:
                return self._table({one: found[self._columns[one].name] for one in self._numbers}, sampled=True)
        except _OtherStyleError:
            pass
        found = self._styles_of_all()
        return self._table({one: found[self._columns[one].name] for one in self._numbers}, sampled=False)

    def _styles_of_all(self) -> dict[str, Style]:
        """By name of a column, from all cells of the file."""
        evidence = {self._columns[one].name: Evidence() for one in self._numbers}
        for _, block in self._body():
            rows = [
                cells
                for line in block.decode(errors="replace").split("\n")
                if (cells := self._layout.cells(line)) and self._is_row(cells)
            ]
            for signal in self._numbers:
                evidence[self._columns[signal].name].add(cells[self._places[signal]] for cells in rows)
        found = styles(str(self._path), evidence, separator=self._layout.separator)
        assert found is not None
        return found

    def _body(self) -> Iterator[tuple[int, bytes]]:
        """Blocks of lines from the first row on, with the number of their first line."""
        first, body = 1, self._layout.body
        for block in self._blocks():
            count = block.count(b"\n")
            if first + count >= body:
                yield max(first, body), _from_line(block, body - first)
            first += count

    def _table(self, style_of: dict[str, Style], sampled: bool, month_first: bool = False) -> Table:
        times = TimesOfDay(month_first) if self._time_is_text else None
        reader = _Reader(self._layout, self._places, style_of, sampled, times)
        signals = {signal: _Growing() for signal in self._places}
        notes = self._notes
        before = b""
        for first, whole in self._body():
            block = whole
            if not block.endswith(b"\n"):
                block, _, last = block.rpartition(b"\n")
                tail = _rows_in((before + block)[-64 * _TAIL :])[-_TAIL:]
                if _is_cut(last.decode(errors="replace"), tail, self._layout):
                    end = first + whole.count(b"\n")
                    notes += (f"the file ends within line {end}, which is left out",)
                else:
                    block = block + b"\n" + last if block else last
            before = block[-64 * _TAIL :]
            values = reader.rows(block, first) if block else np.empty((len(signals), 0))
            for signal, row in zip(signals, values, strict=True):
                text = signal == "t" and self._time_is_text
                signals[signal].extend(row if text else self._columns[signal].in_si(row))
            refuse_beyond(self._path, signals["t"].size)
            reader.refuse_many_damaged(self._path, ended=False)
        found = {signal: one.values for signal, one in signals.items()}
        if sampled and _may_be_thousands([found[one] for one in self._numbers]):
            raise _OtherStyleError
        t = found.pop("t")
        reader.refuse_many_damaged(self._path)
        if not t.size:
            raise PvidError(f"{self._path} has a header but no data.")
        if times is not None:
            if times.are_month_first:
                return self._table(style_of, sampled, month_first=True)
            try:
                t = times.unwrapped(t)
            except PvidError as error:
                raise PvidError(f"{self._path}, column {self._columns['t'].name}: {error}") from error
        style_notes = style_note({self._columns[one].name: style for one, style in style_of.items()})
        notes = (*notes, *style_notes, *reader.notes(self._columns))
        return Table(self._path, t, found, self._columns, reader.place(self._layout.body, self._line), notes)


def _layout(lines: Sequence[str], columns: Columns) -> Layout | None:
    """By the wanted names; a wanted number is first sought as a name, then as a position."""
    numbered = [one.name for one in columns.named.values() if one.name.isdecimal()]
    if numbered:
        found = find(lines, [*columns.wanted, *numbered])
        head = (split(lines[found.header - 1], found.separator) or []) if found is not None and found.header else []
        if all(name in head for name in numbered):
            return found
    return find(lines, columns.wanted, [int(name) - 1 for name in numbered])


def _numbered(blocks_of: Callable[[], Iterator[bytes]], layout: Layout) -> Iterator[bytes]:
    """Blocks with a last cell: the number of the row."""
    separator, number, rows = layout.separator.encode(), 0, 0
    head = b""
    for block in blocks_of():
        lines = block.split(b"\n")
        for k, line in enumerate(lines[:-1] if block.endswith(b"\n") else lines):
            number += 1
            if number == layout.header:
                head = line
            if number < layout.body or not line.strip() or _NO_DATA.match(line):
                continue
            lines[k] = line + separator + (b"t" if line == head else str(rows).encode())
            rows += line != head
        yield b"\n".join(lines)


def _rising(lines: Sequence[str], layout: Layout, columns: Columns) -> bool:
    """Whether a column that nothing names rises from row to row: it may be the time under another name."""
    used = {columns[one].name for one in columns.units}
    rows = [cells for line in lines[layout.body - 1 :] if (cells := layout.cells(line)) and len(cells) == layout.width]
    for place, name in enumerate(layout.names[: layout.width]):
        own = [cells[place] for cells in rows]
        if name not in used and len(own) > 2 and all(map(is_number, own)):
            if all(b > a for a, b in pairwise(float(one.replace(",", ".")) for one in own)):
                return True
    return False


def _front_note(lines: Sequence[str], layout: Layout) -> tuple[str, ...]:
    """On the lines in front of the first row that are neither blank, comments, names nor units."""
    front = [
        number
        for number, line in enumerate(lines[: layout.body - 1], 1)
        if line.strip() and not _NO_DATA.match(line.encode()) and number not in (layout.header, layout.units_line)
    ]
    notes = () if not layout.units_line else (f"line {layout.units_line} states units",)
    if not front:
        return notes
    at = f"line {front[0]}" if len(front) == 1 else f"{len(front)} lines up to line {front[-1]}"
    names = len(split(lines[front[0] - 1], layout.separator) or ())
    doubled = layout.separator == "," and not layout.header and 1 < names < layout.width <= 2 * names
    cause = f": {names} names for {layout.width} columns{_COMMAS}" if doubled else ""
    return (f"left out in front of the table: {at}, {shown(lines[front[0] - 1].strip())}{cause}", *notes)


def _from_line(block: bytes, count: int) -> bytes:
    """A block without its first lines."""
    position = 0
    for _ in range(count):
        position = block.find(b"\n", position) + 1
        if position == 0:
            return b""
    return block[position:]


def _rows_in(block: bytes) -> list[str]:
    return [line.decode(errors="replace") for line in block.split(b"\n") if line.strip() and not _NO_DATA.match(line)]


def _is_cut(last: str, before: list[str], layout: Layout) -> bool:
    """Whether the last line, which has no end, stops within a number.

    It may lack its end (RFC 4180). But a last cell shorter than all others of its column is then taken for the rest of
    a number.
    """
    if not last.strip() or _NO_DATA.match(last.encode()):
        return False
    cells = split(last, layout.separator, strict=True)
    if cells is None:
        return True
    width = layout.width - int(layout.stamped)
    if len(cells) != width:
        return len(cells) < width and (len(cells) > 1 or last.lstrip()[0] in "+-.0123456789")
    lengths = [
        len(other[-1].lstrip("+-"))
        for line in before
        if (other := split(line, layout.separator)) and len(other) == width
    ]
    return len(lengths) > 0 and len(cells[-1].lstrip("+-")) < min(lengths)


def _may_be_thousands(numbers: Sequence[FloatArray]) -> bool:
    """Whether points could separate thousands: three decimals wherever there are any, and none below 1."""
    mixed = False
    for values in numbers:
        there = np.abs(values[np.isfinite(values)])
        fractional = there[there != np.floor(there)]
        if not fractional.size:
            continue
        with np.errstate(over="ignore"):
            thousands = fractional * 1000.0
        if (fractional < 1.0).any() or (np.abs(thousands - np.round(thousands)) > 1e-9 * thousands).any():
            return False
        mixed |= fractional.size < there.size
    return mixed


class _Growing:
    """An array that grows at its end. What it has too much was never touched, and takes no memory."""

    def __init__(self) -> None:
        self._buffer = np.empty(1 << 17)
        self._size = 0

    @property
    def size(self) -> int:
        """How many there are."""
        return self._size

    @property
    def values(self) -> FloatArray:
        """What was put in, shape (n,)."""
        return self._buffer[: self._size]

    def extend(self, values: FloatArray) -> None:
        """Puts values [m] behind the others."""
        size = self._size + values.size
        if size > self._buffer.size:
            larger = np.empty(2 * size)
            larger[: self._size] = self.values
            self._buffer = larger
        self._buffer[self._size : size] = values
        self._size = size


class _Reader:
    """Rows of a body, block after block, and what was left out of it."""

    def __init__(
        self,
        layout: Layout,
        places: Mapping[str, int],
        style_of: Mapping[str, Style],
        sampled: bool,
        times: TimesOfDay | None,
    ) -> None:
        self._layout, self._places, self._style_of, self._sampled = layout, places, style_of, sampled
        self._used = sorted(set(places.values()))
        self._times = times
        self._comma = any(style.decimal == "," for style in style_of.values())
        self._compiled = not (
            layout.labelled
            or layout.stamped
            or self._times is not None
            or any(style.thousands for style in style_of.values())
            or (self._comma and layout.separator == ",")
        )
        self._skipped: list[IntArray] = []
        self._damaged: dict[int, tuple[str, str]] = {}  # text and complaint, by number of the line
        self._rows = 0
        self._heads: list[int] = []
        self._last_row = 0
        self._missing: dict[str, Counter[str]] = {signal: Counter() for signal in places}

    def rows(self, block: bytes, first: int) -> FloatArray:
        """Of a block of lines from number `first` on: shape (signals, rows), in the file's units."""
        if not block.endswith(b"\n"):
            block += b"\n"
        lines = _Split(block, self._layout)
        values = np.full((len(self._places), lines.count), np.nan)
        is_row = np.zeros(lines.count, np.bool_)
        careful = np.ones(lines.count, np.bool_)
        careful[lines.silent] = False
        if self._compiled:
            plain = lines.plain(self._comma)
            for k, row in self._compiled_rows(lines, np.flatnonzero(plain)):
                values[:, k] = row
                is_row[k] = True
                careful[k] = False
        self._careful_rows(lines, np.flatnonzero(careful), first, values, is_row)
        self._without_numbers(values, is_row, lines, first)
        self._skipped.append(first + np.flatnonzero(~is_row))
        self._rows += int(np.count_nonzero(is_row))
        if is_row.any():
            self._last_row = first + int(np.flatnonzero(is_row)[-1])
        return values[:, is_row] if not is_row.all() else values

    def _compiled_rows(self, lines: _Split, at: IntArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Lines that numpy's reader takes, and their values (signals, lines)."""
        if not at.size:
            return
        text = lines.text(at)
        if self._layout.separator == " ":
            text = re.sub(rb"(?m)^ | $", b"", re.sub(rb"[ \t]+", b" ", text))
        if self._comma:
            text = text.replace(b",", b".")
        parsed = self._parsed(text)
        blank = _BLANK_CELL.get(self._layout.separator)
        if parsed is None and blank is not None and at.size > _FEW:
            text = blank.sub(b"nan", text.rstrip(b"\n"))
            parsed = self._parsed(text)
        if parsed is not None:
            yield at, parsed
        elif at.size > _FEW:
            half = at.size // 2
            yield from self._compiled_rows(lines, at[:half])
            yield from self._compiled_rows(lines, at[half:])

    def _parsed(self, text: bytes) -> FloatArray | None:
        try:
            columns = np.loadtxt(
                io.BytesIO(text), delimiter=self._layout.separator, usecols=self._used, comments=None, ndmin=2
            )
        except ValueError:
            return None
        return columns[:, [self._used.index(place) for place in self._places.values()]].T

    def _careful_rows(self, lines: _Split, at: IntArray, first: int, values: FloatArray, is_row: Flags) -> None:
        """Cell by cell: for whatever is seldom in a table of numbers."""
        layout = self._layout
        kept: list[int] = []
        cells: list[list[str]] = []
        for k in at.tolist():
            number = first + k
            found = layout.cells(lines.line(k))
            if found is not None and len(found) != layout.width:
                if len(found) == layout.beside[0] and number <= layout.beside[1]:
                    pass
                elif layout.repeats_head(found):
                    self._heads.append(number)
                    continue
                else:
                    if any(found):
                        more = layout.separator == "," and layout.width < len(found) <= 2 * layout.width
                        cause = f"{len(found)} columns where the header has {layout.width}" + more * _COMMAS
                        self._damage(number, lines.line(k), cause)
                    continue
            if found is None:
                self._damage(number, lines.line(k), "a malformed line or quoted cell")
            else:
                kept.append(k)
                cells.append(found)
        if not kept:
            return
        bad: dict[int, str] = {}
        words: list[tuple[int, str, str]] = []
        for order, (signal, place) in enumerate(self._places.items()):
            column = [row[place] for row in cells]
            if signal == "t" and self._times is not None:
                found_t = self._times.seconds(column)
                for j in np.flatnonzero(np.isnan(found_t)).tolist():
                    if not is_missing(column[j]):
                        bad.setdefault(j, f"column {layout.names[place]}: {shown(column[j])} is not a time")
                values[order, kept] = found_t
                continue
            numbers = self._numbers_of(column, signal)
            for j in np.flatnonzero(np.isnan(numbers)).tolist():
                if not is_missing(column[j]):
                    if self._sampled and is_number(column[j]) and not layout.repeats_head(cells[j]):
                        raise _OtherStyleError
                    bad.setdefault(j, f"column {layout.names[place]}: {shown(column[j])} is not a number")
                elif column[j] and column[j].lower() != "nan":
                    words.append((j, signal, column[j]))
            values[order, kept] = numbers
        for j, signal, word in words:
            self._missing[signal][word] += int(j not in bad)
        for j, k in enumerate(kept):
            if j not in bad:
                is_row[k] = True
            elif layout.repeats_head(cells[j]):
                self._heads.append(first + k)
            else:
                self._damage(first + k, lines.line(k), bad[j])

    def _numbers_of(self, column: list[str], signal: str) -> FloatArray:
        """NaN where a cell is no number."""
        style = self._style_of[signal]
        if style == PLAIN:
            joined = "".join(column)
            if joined.isascii() and "_" not in joined:
                try:
                    return np.array(list(map(float, column)))
                except ValueError:
                    pass
        return np.array([math.nan if (one := style.number(cell)) is None else one for cell in column])

    def _without_numbers(self, values: FloatArray, is_row: Flags, lines: _Split, first: int) -> None:
        """Rows without a time or without any number are none; overloads are missing."""
        order = list(self._places)
        for k, signal in enumerate(order):
            for j in np.flatnonzero(np.isinf(values[k]) | np.isin(np.abs(values[k]), _NO_NUMBER)).tolist():
                word = "inf" if math.isinf(values[k, j]) else "9.9E37"
                if word == "inf" or "E" in lines.line(j):  # not what `write_csv` writes
                    self._missing[signal][word] += int(is_row[j])
                    values[k, j] = np.nan
        timeless = is_row & np.isnan(values[order.index("t")])
        if timeless.any():
            for k in np.flatnonzero(timeless).tolist():
                if not np.isnan(values[:, k]).all():
                    name = self._layout.names[self._places["t"]]
                    self._damage(first + k, lines.line(k), f"column {name}: the cell is empty or nan")
            is_row &= ~timeless

    def _damage(self, number: int, line: str, complaint: str) -> None:
        self._damaged[number] = (line.strip()[:_SHOWN], complaint)

    def refuse_many_damaged(self, path: Path, ended: bool = True) -> None:
        """Refuses a table of which more than a sensible part is damaged; lines behind the last row do not count."""
        if not ended and len(self._damaged) <= max(_EARLY, self._rows):
            return
        within = self._within() if self._rows else sorted(self._damaged)
        behind = sorted(one for one in self._damaged if one > self._last_row) if ended and self._rows else []
        if len(behind) > max(_DAMAGED_LINES, _DAMAGED_SHARE * self._rows) and behind[0] == self._last_row + 1:
            cells = self._layout.cells(self._damaged[behind[0]][0]) or []
            if 2 * sum(map(is_number, cells)) >= self._layout.width:
                within = behind  # rows of another form, and no footer
        most = max(_DAMAGED_LINES, int(_DAMAGED_SHARE * (self._rows + len(within)))) if self._rows else 0
        if len(within) > most:
            complaint = self._damaged[within[0]][1]
            raise PvidError(
                f"{path}, line {within[0]}{', ' if complaint.startswith('column') else ': '}{complaint}; "
                f"{len(within)} of {self._rows + len(within)} lines are no rows of the table."
            )

    def _within(self) -> list[int]:
        """Numbers of the damaged lines in front of the last row, but for what a board prints before the names."""
        damaged = {one for one in self._damaged if one < self._last_row}
        if damaged and self._heads:
            no_rows = set(np.concatenate(self._skipped).tolist())
            for head in self._heads:
                line = head - 1
                while line in no_rows:
                    damaged.discard(line)
                    line -= 1
        return sorted(damaged)

    def notes(self, columns: Columns) -> tuple[str, ...]:
        """On what was left out."""
        notes = []
        within = self._within()
        behind = sum(one > self._last_row for one in self._damaged)
        if within:
            count = f"{len(within)} damaged lines, the first is line" if len(within) > 1 else "a damaged line,"
            notes.append(f"left out: {count} {within[0]}, {shown(self._damaged[within[0]][0])}")
        if behind:
            last = min(one for one in self._damaged if one > self._last_row)
            lines = f"{behind} lines from line" if behind > 1 else "line"
            notes.append(f"left out behind the table: {lines} {last}, {shown(self._damaged[last][0])}")
        if self._heads:
            again = f"{len(self._heads)} times, first in line" if len(self._heads) > 1 else "in line"
            notes.append(f"the names come again {again} {min(self._heads)} (a restart?)")
        words = {columns[signal].name: found for signal, found in self._missing.items() if sum(found.values())}
        if words:
            parts = [
                f"{sum(found.values())} of {name} ({listed(shown(one) for one, _ in found.most_common(3))})"
                for name, found in words.items()
            ]
            notes.append(f"cells without a number, taken as missing: {listed(parts)}")
        return tuple(notes)

    def place(self, body: int, line: str) -> Callable[[int], str]:
        """What calls the line of a row."""
        skipped = np.concatenate(self._skipped) if self._skipped else np.empty(0, np.int64)
        rows_before = skipped - body - np.arange(skipped.size)
        return lambda row: f"{line} {body + row + int(np.searchsorted(rows_before, row, side='right'))}"


class _Split:
    """Lines of a block: where they begin, and which are plain."""

    def __init__(self, block: bytes, layout: Layout) -> None:
        self._block, self._layout = block, layout
        self._bytes = np.frombuffer(block, np.uint8)
        self._ends = np.flatnonzero(self._bytes == 10)
        self._starts = np.concatenate([np.zeros(1, np.int64), self._ends[:-1] + 1])
        self.count = int(self._ends.size)

    @cached_property
    def silent(self) -> IntArray:
        """Blank lines and comments."""
        found = np.flatnonzero(self._starts == self._ends)
        if any(mark in self._block for mark in (b"#", b"%", b"//", b"sep=")):
            marked = [match.start() for match in _NO_DATA.finditer(self._block)]
            found = np.concatenate([found, np.searchsorted(self._ends, marked)])
        return found.astype(np.int64)

    def plain(self, comma: bool) -> Flags:
        """Lines with as many cells as a row has, and none in quotes."""
        separator = self._layout.separator
        good = np.ones(self.count, np.bool_)
        if separator == " ":
            blank = (self._bytes == 32) | (self._bytes == 9)
            begins = ~blank & (self._bytes != 10)
            begins[1:] &= blank[:-1] | (self._bytes[:-1] == 10)
            good &= self._counts(begins) == self._layout.width
        else:
            good &= self._have(np.flatnonzero(self._bytes == ord(separator)), self._layout.width - 1)
        for odd in ('"', "\0", *("." if comma else "")):
            if odd.encode() in self._block:
                good &= self._counts(self._bytes == ord(odd)) == 0
        good[self.silent] = False
        return good

    def _have(self, at: IntArray, count: int) -> Flags:
        """Whether each line has `count` of these places."""
        if at.size == self.count * count:
            by_line = at.reshape(self.count, count)
            good: Flags = (by_line[:, 0] >= self._starts) & (by_line[:, -1] < self._ends)
            if good.all():
                return good
        found: Flags = np.diff(np.searchsorted(at, self._ends), prepend=0) == count
        return found

    def _counts(self, found: Flags) -> IntArray:
        """In each line."""
        return np.diff(np.searchsorted(np.flatnonzero(found), self._ends), prepend=0)

    def text(self, at: IntArray) -> bytes:
        """Of lines."""
        if at.size == self.count:
            return self._block
        breaks = np.flatnonzero(np.diff(at) > 1)
        firsts, lasts = at[np.concatenate([[0], breaks + 1])], at[np.concatenate([breaks, [at.size - 1]])]
        spans = zip(self._starts[firsts].tolist(), (self._ends[lasts] + 1).tolist(), strict=True)
        return b"".join(self._block[low:high] for low, high in spans)

    def line(self, k: int) -> str:
        """Text of a line."""
        return self._block[self._starts[k] : self._ends[k]].decode(errors="replace")
