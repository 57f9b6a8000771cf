"""Where the table is in a text file: names, units, first line of numbers, and what divides the columns.

Instruments write settings, titles and messages in front of a table and beside it; middleware writes the names in a
comment. The names that are wanted find the line of names; without them it is the last text in front of the numbers.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice, pairwise

from pvid.base.units import is_unit
from pvid.rig.cells import is_missing, is_number
from pvid.rig.times import is_time

_NO_DATA = re.compile(r"[ \t]*(?:(?:[#%]|//|sep=).*)?")
_MARKS = "#%/; \t"  # of a comment
_GARBAGE = re.compile(r"[^!-~]+")
SEPARATORS = (";", "\t", ",", "|", " ")
_SAMPLED = 400  # lines that the separator is found from
_LABEL = re.compile(r"([A-Za-z_][^\s:=,;]*)\s*[:=]\s*([^\s:=]*)")
_DATE = r"\d{4}-\d\d-\d\d[T ]"
_STAMP = re.compile(rf"\s*\[?((?:{_DATE})?\d{{1,2}}:\d\d:\d\d(?:[.,:]\d+)?)(?:\]\s*(?:[-=]?>)?|\s*[-=]?>)\s*")
_MOSTLY = 0.8
_REMARKS = ("comment", "comments", "remark", "remarks", "note", "notes")  # a last column that most rows lack

STAMP = "stamp"  # name of a monitor's stamps in front of the lines; "t" where no other column is called so


@dataclass(frozen=True)
class Layout:
    """How a table is written.

    Attributes
    ----------
    separator : " ": any number of blanks and tabs
    names : of the columns; positions from 1 where the file has no names
    units : of the columns, "" where there is none; () where the file states none
    header, units_line : number of these lines, 0 where there are none
    body : number of the first line that may be a row
    labelled : whether each cell repeats its name: `t:1,F:2`
    stamped : whether a serial monitor's time stands in front of each line
    width : number of cells of a row
    beside : the same of the rows that have settings beside them, and the last line of these
    """

    separator: str
    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    header: int = 0
    units_line: int = 0
    body: int = 1
    width: int = 0
    labelled: bool = False
    stamped: bool = False
    beside: tuple[int, int] = (0, 0)

    def cells(self, line: str) -> list[str] | None:
        """Of a row, without labels; None where it has too few or too many, or its quotes do not match."""
        if self.stamped:
            line, stamp = without_stamp(line)
        found = split(line, self.separator, strict=True)
        if found is None:
            return None
        if self.stamped:
            found.insert(0, stamp)
        if self.labelled:
            first = int(self.stamped)
            for k in range(first, len(found)):
                match = _LABEL.fullmatch(found[k])
                if match is None or k >= len(self.names) or match[1] != self.names[k]:
                    return None
                found[k] = match[2]
        return found

    def repeats_head(self, cells: Sequence[str]) -> bool:
        """Whether a line is that of the names again, or that of the units."""
        first = int(self.stamped)  # the stamp is another one
        bare = [cells[0].lstrip(_MARKS), *cells[1:]] if cells else []
        return any(len(one) > first and tuple(bare[first:]) == one[first:] for one in (self.names, self.units) if one)


def without_stamp(line: str) -> tuple[str, str]:
    """A line without the stamp of a serial monitor, and the stamp."""
    match = _STAMP.match(line)
    return (line, "") if match is None else (line[match.end() :], match[1])


def split(line: str, separator: str, strict: bool = False) -> list[str] | None:
    """Cells of a line; None when its quotes do not match, or, unless strict, without regard to them.

    One line is one row: a quoted cell may not run over a line's end.
    """
    if separator == " ":
        line = " ".join(line.split())
    if '"' in line:
        try:
            reader = csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True)
            cells = [cell.strip() for cell in next(reader)]
            return (
                split(cells[0], separator, strict) if len(cells) == 1 and '"' not in cells[0] else cells
            )  # a quoted line
        except csv.Error:
            if strict:
                return None
    return [cell.strip() for cell in line.split(separator)]


@dataclass(frozen=True)
class _Line:
    number: int
    cells: list[str]
    bare: list[str]  # without the mark of a comment
    is_comment: bool
    kinds: str  # a letter each cell: n number, t time, e missing, x text

    @property
    def is_blank(self) -> bool:
        return not any(self.cells)


def find(lines: Sequence[str], wanted: Sequence[str], positions: Sequence[int] = ()) -> Layout | None:
    """The layout of a file that begins with these lines.

    Parameters
    ----------
    lines : from the first on
    wanted : names that the header has, if there is one
    positions : from 0, of columns that are wanted beside these

    Returns
    -------
    None where no line has a number.
    """
    stamped = _is_stamped(lines)
    bare = [without_stamp(line)[0] for line in lines] if stamped else lines
    sought = [one for one in wanted if not (stamped and one in ("t", STAMP))]
    found: list[tuple[tuple[bool, float, int], Layout]] = []
    named = cache(lambda: _named(bare, sought))
    for separator in SEPARATORS:
        table = _table(bare, separator, sought, [one - int(stamped) for one in positions], named)
        if table is not None:
            found.append(table)
    if not found:
        return None
    by_tabs = next(((head, width) for (head, _, width), one in found if one.separator == "\t"), (False, 0))
    # a row whose last cells are blank has fewer cells between blanks, and as many between tabs
    found = [one for one in found if one[1].separator != " " or (one[0][0], one[0][2]) > by_tabs]
    layout = max(found, key=lambda one: one[0])[1]
    if stamped:
        stamp = STAMP if "t" in layout.names else "t"
        units = ("", *layout.units) if layout.units else ()
        wide, last = layout.beside
        names, width = (stamp, *layout.names), layout.width + 1
        layout = replace(layout, stamped=True, names=names, units=units, width=width, beside=(wide + 1, last))
    return layout


def _is_stamped(lines: Sequence[str]) -> bool:
    seen = [line for line in lines[:_SAMPLED] if line.strip()]
    return sum(_STAMP.match(line) is not None for line in seen) > _MOSTLY * len(seen)


def _table(
    lines: Sequence[str],
    separator: str,
    wanted: Sequence[str],
    positions: Sequence[int],
    named: Callable[[], Sequence[int]],
) -> tuple[tuple[bool, float, int], Layout] | None:
    """The layout if this is the separator, how well it fits, and the cells of a row; None where it divides nothing.

    named : as `_named`, for a header behind the first lines
    """
    sampled = [*_read(lines, separator, range(min(len(lines), _SAMPLED)))]
    head = _head(sampled, wanted)
    if head is None and wanted and len(lines) > _SAMPLED:
        further = _head([*_read(lines, separator, named())], wanted)
        if further is not None:
            sampled += _read(lines, separator, range(further[0].number, min(len(lines), further[0].number + _SAMPLED)))
            head = further
    after = [one for one in sampled if head is None or one.number > head[0].number]
    labelled = _labels(after if head is None else [])
    if labelled is not None:
        names, first = labelled
        return (True, float(len(names)), len(names)), Layout(
            separator, names, body=first, width=len(names), labelled=True
        )
    rows = [one for one in after if not one.is_comment and len(one.cells) > 1 and _has_number(one)]
    if not rows:
        if head is None or len(head[1]) < 2:
            return None
        names, number = tuple(head[1]), head[0].number
        return (True, 0.0, len(names)), Layout(separator, names, header=number, body=number + 1, width=len(names))
    width = Counter(len(one.cells) for one in rows).most_common(1)[0][0]
    usual = [one for one in rows if len(one.cells) == width]
    numeric = sum(sum(kind in "nt" for kind in one.kinds) for one in usual) / len(rows)
    layout = _with_head(separator, sampled, usual, head, (wanted, positions))
    return (head is not None, numeric**2 / width, width), layout


def _named(lines: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """The first few lines behind the sampled ones that contain all names."""
    longest = max(wanted, key=len)
    there = (k for k in range(_SAMPLED, len(lines)) if longest in lines[k] and all(one in lines[k] for one in wanted))
    return [*islice(there, 3)]


def _read(lines: Sequence[str], separator: str, at: Iterable[int]) -> Iterator[_Line]:
    for k in at:
        cells = split(lines[k], separator) or [""]
        bare = split(lines[k].lstrip(_MARKS), separator) or [""] if lines[k][:1] in _MARKS else cells
        yield _Line(k + 1, cells, bare, _NO_DATA.fullmatch(lines[k]) is not None, "".join(map(_kind, cells)))


def _kind(cell: str) -> str:
    if is_missing(cell):
        return "e"
    if is_number(cell):
        return "n"
    return "t" if is_time(cell) else "x"


def _has_number(line: _Line) -> bool:
    return "n" in line.kinds or "t" in line.kinds


def _head(lines: Sequence[_Line], wanted: Sequence[str]) -> tuple[_Line, list[str]] | None:
    """The last line in front of the numbers with all names, and its names as wanted: with the mark of a comment or
    without."""
    found: tuple[_Line, list[str]] | None = None
    if not wanted:
        return None
    for line in lines:
        if len(line.cells) < len(wanted):
            continue
        if found is not None and not line.is_comment and sum(kind in "nt" for kind in line.kinds) >= len(wanted):
            break
        for cells in (line.cells, line.bare, [_GARBAGE.sub("", line.cells[0]), *line.cells[1:]]):
            if cells[0] and not cells[0].strip(_MARKS):
                continue  # the mark of a comment is no name
            if all(name in cells for name in wanted):
                found = line, cells
                break
    return found


def _labels(lines: Sequence[_Line]) -> tuple[tuple[str, ...], int] | None:
    """Names of cells such as `F:1.5`, and the number of the first line that has them."""
    found: Counter[tuple[str, ...]] = Counter()
    first: dict[tuple[str, ...], int] = {}
    for line in lines:
        matches = [_LABEL.fullmatch(cell) for cell in line.cells]
        if len(matches) > 1 and all(one is not None and (is_number(one[2]) or is_missing(one[2])) for one in matches):
            names = tuple(one[1] for one in matches if one is not None)
            found[names] += 1
            first.setdefault(names, line.number)
    if not found:
        return None
    names, times = found.most_common(1)[0]
    return (names, first[names]) if times > _MOSTLY * len([one for one in lines if not one.is_blank]) else None


def _with_head(
    separator: str,
    lines: Sequence[_Line],
    usual: Sequence[_Line],
    head: tuple[_Line, list[str]] | None,
    sought: tuple[Sequence[str], Sequence[int]],
) -> Layout:
    """With the names in front of the numbers, and the units; `usual` are lines of the table's width."""
    width = len(usual[0].cells)
    kinds = ["".join(one.kinds[k] for one in usual) for k in range(width)]
    least = min(2, len(usual))  # a single one is a setting beside the names
    numbers = [
        k
        for k, own in enumerate(kinds)
        if own.count("n") + own.count("t") >= least and own.count("x") <= (1 - _MOSTLY) * len(usual)
    ]
    if head is None:
        head = _guessed(lines, _first(usual, numbers), width, numbers)
        if head is not None and not sought[0] and len(head[1]) != width:
            head = None  # every column has a position
    names = [str(k + 1) for k in range(width)] if head is None else list(head[1])
    while len(names) > width and not names[-1]:
        names.pop()
    ended = not any(one.cells[-1] for one in usual)  # each row ends with a separator
    if head is not None and len(names) > width and _are_settings(lines, head[0], width - ended):
        names = [*names[: width - ended], *[""] * ended]
    if len(names) == width + 1 and names[-1].lower() in _REMARKS:
        names.pop()
    elif len(names) == width - 1:
        if ended:
            names.append("")
        elif _counts([one.cells[0] for one in usual]) or not any(one.cells[0] for one in usual):
            names.insert(0, "")  # numbers of the rows, or each row begins with a separator
    wanted, positions = sought
    if all(name in names for name in wanted):
        used = {*(names.index(name) for name in wanted), *positions}
        numbers = [k for k in used if 0 <= k < width] or numbers
    first = _first(usual, numbers)
    number = 0 if head is None else head[0].number
    wide = [one for one in lines if number < one.number and len(one.cells) > width and _has_number(one)]
    wide = [one for one in wide if one.number < first and all(one.kinds[k] in "nte" for k in numbers)]
    beside = (len(wide[-1].cells), wide[-1].number) if wide else (0, 0)
    if wide:
        first = wide[0].number
    between = [one for one in lines if number < one.number < first and not one.is_blank] if head else []
    units = next((one for one in between if _units(one, len(names))), None)
    return Layout(
        separator,
        tuple(names),
        () if units is None else tuple(_units(units, len(names))),
        number,
        0 if units is None else units.number,
        first,
        width if wide else len(names),
        beside=beside,
    )


def _first(usual: Sequence[_Line], numbers: Sequence[int]) -> int:
    """Number of the first row."""
    rows = (one.number for one in usual if all(one.kinds[k] in "nte" for k in numbers) and _has_number(one))
    return next(rows, usual[0].number)


def _guessed(lines: Sequence[_Line], first: int, width: int, numbers: Sequence[int]) -> tuple[_Line, list[str]] | None:
    """The names in front of the first row when none of them is wanted."""
    before = [one for one in lines if one.number < first and not one.is_blank]
    text = []
    for one in reversed(before):
        named = len(one.cells) == width and not any(one.kinds[k] in "nt" for k in numbers if k < width)
        if one.is_comment or not named:
            break
        text.append(one)
    if not text and before and not before[-1].is_comment and len(before[-1].cells) > 1:
        return (before[-1], before[-1].cells) if not _has_number(before[-1]) else None
    if not text:
        held = [one for one in before if one.is_comment and len(one.bare) == width and not _are_numbers(one)]
        return (held[-1], held[-1].bare) if held else None
    for k, one in enumerate(text[:-1]):
        if _units(one, width):
            return text[k + 1], text[k + 1].cells
    above = [one for one in before if one.number < text[-1].number and not one.is_comment][-1:]
    for one in above if _has_number(text[-1]) else []:  # settings beside the names
        if len(one.cells) >= width and not _has_number(one) and not any(one.cells[width:]):
            return one, one.cells[:width]
    if all(is_unit(cell) for cell in text[-1].cells if cell):  # the names are in a line of another width, or nowhere
        for one in above:
            if len(one.cells) > width and not any(one.cells[width:]):
                return one, one.cells[:width]
        nowhere = replace(text[-1], number=text[-1].number - 1)
        return nowhere, [str(k + 1) for k in range(width)]
    return text[0], text[0].cells


def _are_settings(lines: Sequence[_Line], head: _Line, width: int) -> bool:
    """Whether what a line of names has behind the columns are settings: `t0 = 1`, or numbers in the line below it."""
    below = next((one.cells for one in lines if one.number == head.number + 1), [])
    behind = [(k, cell) for k, cell in enumerate(head.cells) if k >= width and cell]
    return all("=" in cell or (k < len(below) and is_number(below[k])) for k, cell in behind)


def _are_numbers(line: _Line) -> bool:
    return all(is_number(cell) for cell in line.bare)


def _units(line: _Line, width: int) -> list[str]:
    """The units that a line states: half of its cells or more, the others being blank or words, and no number; [] of
    any other. Behind the columns there may be settings."""
    for cells in (line.bare, line.cells):
        filled = [cell for cell in cells[:width] if cell]
        known = sum(is_unit(cell) for cell in filled)
        if len(cells) >= width and not any(map(is_number, filled)) and known and 2 * known >= len(filled):
            if len(cells) == width or all(is_number(cell) for cell in cells[width:] if cell):
                return cells[:width]
    return []


def _counts(cells: Sequence[str]) -> bool:
    """Whether cells are 0, 1, 2, ... or 1, 2, 3, ..."""
    return counts_up(cells) and int(cells[0]) in (0, 1)


def counts_up(cells: Sequence[str]) -> bool:
    """Whether cells are whole numbers, each one more than the one before it."""
    try:
        numbers = [int(cell) for cell in cells]
    except ValueError:
        return False
    return all(b == a + 1 for a, b in pairwise(numbers))
