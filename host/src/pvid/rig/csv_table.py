"""Text tables as programs and loggers write them, read in blocks: memory for the three signals and a block more.

Separators are commas, semicolons, tabs or spaces; with any but commas the decimal point may be a comma. A byte order
mark, CRLF, quotes, blank lines and lines that begin with #, % or // are accepted; such a line may contain the names,
as written by numpy.savetxt. A table without names has columns 1, 2, 3, ... If a file ends within a line, that line is
ignored. Every other fault is reported with its line number.
"""

from __future__ import annotations

import csv
import functools
import gzip
import io
import math
import re
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import reason, shown
from pvid.rig.columns import Columns
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table

FloatArray = npt.NDArray[np.float64]

_BLOCK = 1 << 20  # bytes read at a time, and the longest line
_SAMPLED_LINES = 200  # that separator and decimal point are found from
_TAIL = 1000  # lines that a cut last line is compared with

# Cells that stand for a missing number; what is "nan" is read as a number.
_EMPTY_CELLS = ("", "NA", "N/A", "#N/A", "null", "NULL", "None", "-", "--")

_NO_DATA = re.compile(rb"(?m)^[ \t]*(?:(?:[#%]|//|sep=).*)?$\n?")
_COMMENT_MARKS = (b"#", b"%", b"//")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class _Layout:
    """How a table is written: `body` is the number of the first line behind the names."""

    separator: str
    decimal: str
    names: tuple[str, ...]
    body: int

    def cells(self, line: str) -> list[str]:
        """Cells of a line; csv.Error when its quotes do not match."""
        return _split(line, self.separator, strict=True)

    def is_number(self, cell: str) -> bool:
        """What a block's reader takes as a number."""
        if cell in _EMPTY_CELLS:
            return True
        if self.decimal != ".":
            cell = cell.replace(".", "?").replace(self.decimal, ".")
        if "_" in cell or not cell.isascii():  # float() would take 1_000 for a thousand, and digits of any script
            return False
        try:
            float(cell)
        except ValueError:
            return False
        return True

    def number(self, cell: str) -> float:
        """Of a cell that is a number; NaN of an empty one."""
        return math.nan if cell in _EMPTY_CELLS else float(cell.replace(self.decimal, "."))


def read_csv(path: Path, columns: Columns) -> Table:
    """Reads a table, gzip if its name ends in .gz.

    Raises
    ------
    PvidError
        For whatever is wrong with the file.
    """
    layout: _Layout | None = None
    places: dict[str, int] = {}
    signals = {signal: _Growing() for signal in columns.units}
    tail: list[str] = []
    notes: tuple[str, ...] = ()
    first_line = 1
    for whole in _blocks(path):
        block, line = whole, first_line
        first_line += whole.count(b"\n")
        if layout is None:
            layout = _layout(path, block)
            where = f", line {layout.body - 1}" if layout.body > 1 else ""
            places = columns.places(path, layout.names, where)
            block, line = _from_line(block, layout.body), layout.body
        if not block.endswith(b"\n"):
            block, _, last = block.rpartition(b"\n")
            tail += [text for _, text in _data_lines(block[-64 * _TAIL :], 1)][-_TAIL:]
            if _is_cut(last.decode(errors="replace"), tail, layout):
                notes = (f"the file ends within line {first_line}, which is left out",)
            else:
                block = block + b"\n" + last if block else last
        else:
            tail = [text for _, text in _data_lines(block[-64 * _TAIL :], 1)][1:]
        for signal, values in _numbers(path, block, line, layout, places).items():
            signals[signal].extend(columns[signal].in_si(values))
        refuse_beyond(path, signals["t"].size)
    if layout is None:
        raise PvidError(f"{path} is empty.")
    found = {signal: one.values for signal, one in signals.items()}
    t = found.pop("t")
    if not t.size:
        raise PvidError(f"{path} has a header but no data.")
    body = layout.body
    return Table(path, t, found, columns, lambda row: f"line {_line_of_row(path, body, row)}", notes)


def write_csv(path: Path, named: dict[str, FloatArray]) -> bytes:
    """Text of the columns, with every bit."""
    columns = [map(repr, data.tolist()) for data in named.values()]
    lines = [",".join(named), *map(",".join, zip(*columns, strict=True))]
    return ("\n".join(lines) + "\n").encode("ascii")


def write_csv_gz(path: Path, named: dict[str, FloatArray]) -> bytes:
    """The same, compressed; the same bytes at any time of day."""
    return gzip.compress(write_csv(path, named), compresslevel=6, mtime=0)


# --- lines -----------------------------------------------------------------------------------------------------


def _blocks(path: Path) -> Iterator[bytes]:
    """The text in blocks of whole lines, each line ended by one newline but perhaps the last."""
    line = 1
    rest = b""
    zipped = path.name.lower().endswith(".gz")
    try:
        with gzip.open(path, "rb") if zipped else path.open("rb") as file:
            while data := file.read(_BLOCK):
                if data.endswith(b"\r"):
                    data += file.read(1)
                if line == 1 and not rest:
                    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
                        raise PvidError(f"{path} is UTF-16 text, where UTF-8 is wanted.")
                    data = data.removeprefix(b"\xef\xbb\xbf")
                block = rest + data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
                if b"\0" in block:
                    line += block.count(b"\n", 0, block.index(b"\0"))
                    raise PvidError(f"{path}, line {line}: a zero byte, so this is not a text file.")
                end = block.rfind(b"\n") + 1
                rest = block[end:]
                if len(rest) >= _BLOCK:
                    raise PvidError(f"{path}: a line longer than {_BLOCK} bytes, so this is no table of numbers.")
                if end:
                    line += block.count(b"\n")
                    yield block[:end]
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise PvidError(f"{path} is not a whole gzip file: {reason(error)}.") from error
    if rest:
        yield rest


def _data_lines(block: bytes, first: int) -> Iterator[tuple[int, str]]:
    """Number and text of each line of a block that is neither blank nor a comment."""
    for number, line in enumerate(block.split(b"\n"), first):
        if not _NO_DATA.fullmatch(line):
            yield number, line.decode(errors="replace")


def _line_of_row(path: Path, body: int, row: int) -> int:
    """Line of the row counted from 0: searched only on request."""
    first = 1
    for block in _blocks(path):
        for number, _ in _data_lines(block, first):
            if number >= body:
                if row == 0:
                    return number
                row -= 1
        first += block.count(b"\n")
    return first


def _from_line(block: bytes, number: int) -> bytes:
    """A block that begins the file, from a line on."""
    position = 0
    for _ in range(number - 1):
        position = block.find(b"\n", position) + 1
        if position == 0:
            return b""
    return block[position:]


# --- layout ----------------------------------------------------------------------------------------------------


def _layout(path: Path, block: bytes) -> _Layout:
    """From the file's first block."""
    sampled: list[tuple[int, str]] = []
    for numbered in _data_lines(block, 1):
        sampled.append(numbered)
        if len(sampled) == _SAMPLED_LINES:
            break
    if not sampled:
        raise PvidError(f"{path} is empty.")
    lines = [text for _, text in sampled]
    separator = _separator(lines)
    decimal = _decimal(lines, separator)
    number = sampled[0][0]
    first = _Layout(separator, decimal, (), number)
    names = _split(lines[0], separator)
    if all(first.is_number(name) for name in names):  # no names, unless a comment holds them
        comment = _comment_before(block, number)
        held = _split(comment, separator) if comment else []
        if len(held) != len(names) or all(first.is_number(name) for name in held):
            held = [str(k + 1) for k in range(len(names))]
        return _Layout(separator, decimal, tuple(held), number)
    width = Counter(len(_split(line, separator)) for line in lines[1:]).most_common(1)
    if width and width[0][0] == len(names) + 1 and lines[1].rstrip(" ").endswith(separator):
        names.append("")  # each line of numbers ends with a separator
    return _Layout(separator, decimal, tuple(names), number + 1)


def _comment_before(block: bytes, number: int) -> str:
    """Text of the line in front of a line, without the marks of a comment."""
    if number < 2:
        return ""
    line = block.split(b"\n", number)[number - 2]
    return line.decode(errors="replace").lstrip("#%/ \t")


def _separator(lines: list[str]) -> str:
    """What divides the lines into the largest number of columns that header and numbers agree on."""
    most, best = 1, ""
    for separator in (";", "\t", ","):
        counts = [len(_split(line, separator)) for line in lines]
        usual = Counter(counts[1:] or counts).most_common(1)[0][0]
        if usual > most and abs(counts[0] - usual) <= 1:
            most, best = usual, separator
    if best:
        return best
    return " " if len(lines[0].split()) > 1 and "," not in lines[0] else ","


def _decimal(lines: list[str], separator: str) -> str:
    cells = (cell for line in lines for cell in _split(line, separator))
    return "," if any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells) else "."


def _split(line: str, separator: str, strict: bool = False) -> list[str]:
    """Cells of a line. One line is one row: a quoted cell may not run over a line's end."""
    if separator == " ":
        line = " ".join(line.split())
    if '"' in line:
        try:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, strict=True))]
        except csv.Error:
            if strict:
                raise
    return [cell.strip() for cell in line.split(separator)]


def _is_cut(last: str, before: list[str], layout: _Layout) -> bool:
    """Whether the last line, which has no end, stops within a number.

    It may lack its end (RFC 4180). But a last cell shorter than all others of its column is then taken for the rest of
    a number.
    """
    if _NO_DATA.fullmatch(last.encode()):
        return False
    try:
        cells = layout.cells(last)
    except csv.Error:
        return True
    if len(cells) != len(layout.names):
        return len(cells) < len(layout.names)
    lengths = [len(_split(line, layout.separator)[-1].lstrip("+-")) for line in before]
    return len(lengths) > 0 and len(cells[-1].lstrip("+-")) < min(lengths)


# --- numbers ---------------------------------------------------------------------------------------------------


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


def _numbers(
    path: Path, block: bytes, first_line: int, layout: _Layout, places: dict[str, int]
) -> dict[str, FloatArray]:
    """The signals in a block [n], in the file's units; NaN where a cell is empty."""
    clean = block
    if any(mark in block for mark in _COMMENT_MARKS):
        clean = _NO_DATA.sub(b"", block)
    try:
        return _parsed(clean, layout, places)
    except (ValueError, csv.Error) as error:
        without = _NO_DATA.sub(b"", clean)  # of lines of blanks
        if without != clean:
            try:
                return _parsed(without, layout, places)
            except (ValueError, csv.Error):
                pass
        raise _fault(path, block, first_line, layout, places, error) from error


def _parsed(block: bytes, layout: _Layout, places: dict[str, int]) -> dict[str, FloatArray]:
    """As `_numbers`; ValueError where a line has too few or too many cells, or a cell is not a number."""
    separator, wanted = layout.separator.encode(), sorted(set(places.values()))
    if separator == b" ":
        block = re.sub(rb"[ \t]+", b" ", block)
        block = re.sub(rb"(?m)^ | $", b"", block)
    if not block.strip():
        return {}
    if b'"' in block:
        return _from_cells(block.decode(errors="replace"), layout, places)
    lines = block.rstrip(b"\n").split(b"\n")
    if {line.count(separator) for line in lines} != {len(layout.names) - 1}:
        raise ValueError("a line has too few or too many cells")
    if layout.decimal == ",":
        if b"." in block:  # in a column that is not wanted, or in a number
            return _from_cells(block.decode(errors="replace"), layout, places)
        block = block.replace(b",", b".")
    if b"_" in block or not block.isascii():
        return _from_cells(block.decode(errors="replace"), layout, places)
    try:
        columns = _loaded(block, layout.separator, wanted)
    except ValueError:
        filled = _empty_cell(layout.separator).sub(b"nan", block.rstrip(b"\n"))
        columns = _loaded(filled, layout.separator, wanted)
    return {signal: columns[:, wanted.index(place)].copy() for signal, place in places.items()}


def _loaded(block: bytes, separator: str, wanted: list[int]) -> FloatArray:
    return np.loadtxt(io.BytesIO(block), delimiter=separator, usecols=wanted, comments=None, ndmin=2)


@functools.cache
def _empty_cell(separator: str) -> re.Pattern[bytes]:
    """Cells that hold no number."""
    between = re.escape(separator.encode())
    cells = b"|".join(re.escape(one.encode()) for one in sorted(_EMPTY_CELLS, key=len, reverse=True))
    return re.compile(rb"(?m)(?:(?<=" + between + rb")|^)(?:" + cells + rb")(?=" + between + rb"|\r?$)")


def _from_cells(block: str, layout: _Layout, places: dict[str, int]) -> dict[str, FloatArray]:
    """Cell by cell: for quotes, and for whatever else is seldom in a table of numbers."""
    rows: list[list[float]] = []
    wanted = sorted(set(places.values()))
    for line in block.splitlines():
        cells = layout.cells(line)
        if len(cells) != len(layout.names) or not all(layout.is_number(cells[place]) for place in wanted):
            raise ValueError("a cell is not a number")
        rows.append([layout.number(cells[place]) for place in wanted])
    columns = np.array(rows, np.float64).reshape(-1, len(wanted))
    return {signal: columns[:, wanted.index(place)].copy() for signal, place in places.items()}


def _fault(
    path: Path, block: bytes, first_line: int, layout: _Layout, places: dict[str, int], error: Exception
) -> PvidError:
    """The refusal of a block's first line that cannot be read."""
    width = len(layout.names)
    for number, line in _data_lines(block, first_line):
        try:
            cells = layout.cells(line)
        except csv.Error as why:
            return PvidError(f"{path}, line {number}: a malformed quoted cell ({reason(why)}).")
        if len(cells) != width:
            return PvidError(f"{path}, line {number}: {len(cells)} columns where the header has {width}.")
        for place in places.values():
            if not layout.is_number(cells[place]):
                name = layout.names[place]
                return PvidError(f"{path}, line {number}, column {name}: {shown(cells[place])} is not a number.")
    return PvidError(f"{path}, from line {first_line}: {reason(error)}.")
