"""What a cell of a text table means: a number in one of the world's styles, or no number at all."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from pvid.base.errors import PvidError
from pvid.base.wording import listed, shown

_MISSING = re.compile(
    r"""[+-]?nan\d*(?:\(.*\))?  |  [+-]?1\.\#(?:q?nan|snan|ind|inf)\d*
    |  [+-]?(?:inf|infinity|∞|ol|o\.l\.?|ovl|ovld|ovf|ovfl|ovrflw|over|overload|overrange|overflow|under|underflow)
    |  \#?n/?a  |  \#nv  |  \#(?:div/0|value|num|ref|name)[!?]?  |  null  |  none  |  nil  |  nat  |  missing
    |  unavailable  |  unknown  |  no\ data  |  invalid  |  error  |  err  |  [-–—]+  |  \*+  |  \#+  |  \?+  |  \.""",
    re.X | re.I,
)
_BLANKS = " \xa0\u2009\u202f'’"  # that group digits
_GROUPED = re.compile(rf"[1-9]\d{{0,2}}(?:[{_BLANKS}]\d{{3}})+(?![\d{_BLANKS}])")
_THOUSANDS = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:\{mark}\d{{3}})+(?!\d)") for mark in ",."}
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?", re.ASCII)
_ANY_NUMBER = re.compile(
    r"[+-]?(?P<digits>\d+[.,]?\d*|[.,]\d+|[1-9]\d{0,2}(?:(?:,\d{3})+(?:\.\d*)?|(?:\.\d{3})+(?:,\d*)?))(?:[eEdD][+-]?\d+)?",
    re.ASCII,
)
_WORDS = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
# Of the cells that decide, those of another style are damaged if they are fewer than this part.
_DAMAGED = 0.01


def is_missing(cell: str) -> bool:
    """Whether a cell stands for a missing number: blank, a word, an overload."""
    return not cell or _MISSING.fullmatch(cell) is not None


def is_number(cell: str) -> bool:
    """Whether a cell is a number in any style."""
    return bool(cell) and (_ANY_NUMBER.fullmatch(_ungrouped(cell)) is not None or cell.lower() in _WORDS)


def _ungrouped(cell: str) -> str:
    """Without blanks and apostrophes between groups of three digits; with the sign that computers use."""
    if cell[0] == "−":
        cell = "-" + cell[1:]
    return _GROUPED.sub(lambda match: re.sub(rf"[{_BLANKS}]", "", match[0]), cell)


@dataclass(frozen=True)
class Style:
    """How a column writes its numbers: the marks of decimals and, where there are any, of thousands."""

    decimal: str = "."
    thousands: str = ""

    def number(self, cell: str) -> float | None:
        """Of a cell in this style; None of any other."""
        if not cell:
            return None
        text = _ungrouped(cell)
        if self.thousands and (match := _THOUSANDS[self.thousands].match(text)):
            text = match[0].replace(self.thousands, "") + text[match.end() :]
        if self.decimal == ",":
            text = text.replace(".", "?").replace(",", ".")
        if _NUMBER.fullmatch(text):
            return float(text.replace("D", "e").replace("d", "e"))
        return _WORDS.get(text.lower())


PLAIN = Style()


@dataclass
class Evidence:
    """What the cells of a column show of its style; each count is of cells.

    Attributes
    ----------
    decimal, thousands : by mark, where a cell allows no other reading: 0,5 and 1,5; 1,234,567 and 1,234.5
    either : by mark, where it stands in front of exactly three digits: 1,234
    round : by mark, those of `either` that end in 0, which no shortened decimal number does
    short, long : whole numbers without a mark, of up to three digits and of more
    example : of `either`, by mark
    """

    decimal: dict[str, int] = field(default_factory=lambda: {",": 0, ".": 0})
    thousands: dict[str, int] = field(default_factory=lambda: {",": 0, ".": 0})
    either: dict[str, int] = field(default_factory=lambda: {",": 0, ".": 0})
    round: dict[str, int] = field(default_factory=lambda: {",": 0, ".": 0})
    short: int = 0
    long: int = 0
    example: dict[str, str] = field(default_factory=dict)

    def add(self, cells: Iterable[str]) -> None:
        """Counts cells; those that are no numbers show nothing."""
        for cell in cells:
            match = _ANY_NUMBER.fullmatch(_ungrouped(cell)) if cell else None
            if match is not None:
                self._add(match["digits"], cell)

    def _add(self, digits: str, cell: str) -> None:
        commas, dots = digits.count(","), digits.count(".")
        if not commas and not dots:
            if len(digits) > 3:
                self.long += 1
            else:
                self.short += 1
        elif commas and dots or commas > 1 or dots > 1:
            last = "," if digits.rfind(",") > digits.rfind(".") else "."
            mark = last if (commas > 1) != (dots > 1) and not (commas and dots) else ("." if last == "," else ",")
            match = _THOUSANDS[mark].match(digits)
            if match is not None and mark not in digits[match.end() :] and digits[match.end() :].count(last) <= 1:
                self.thousands[mark] += 1
                self.decimal[last] += int(last != mark)
        else:
            mark = "," if commas else "."
            before, _, after = digits.partition(mark)
            if len(after) == 3 and before and before[0] != "0" and len(before) <= 3:
                self.either[mark] += 1
                self.round[mark] += int(after.endswith("0"))
                self.example.setdefault(mark, cell)
            else:
                self.decimal[mark] += 1


def styles(
    path: str, found: Mapping[str, Evidence], whole: bool = True, separator: str = ""
) -> dict[str, Style] | None:
    """Of each column, by what all of them show.

    Raises PvidError where a column can be read in two ways.

    Parameters
    ----------
    path : of the file, for a refusal
    found : by name of a column
    whole : whether all cells were counted; else None is returned where more of them might decide otherwise
    separator : of columns; with a semicolon a comma is a decimal sign where other numbers have no thousands separators
    """
    sure = {name: _sure(path, name, one, whole) for name, one in found.items()}
    if not whole and any(one.either[","] and sure[name] is None for name, one in found.items()):
        return None
    known = {one for one in sure.values() if one is not None}
    mixed = {
        name: Style(thousands=",")
        for name, one in found.items()
        if sure[name] is None and not known and one.either[","] and one.short and not one.long and one.round[","]
    }
    known |= set(mixed.values())
    if not known and separator == ";" and any(one.long for one in found.values()):
        known = {Style(",")}
    return {name: sure[name] or mixed.get(name) or _by_others(path, name, one, known) for name, one in found.items()}


def _sure(path: str, name: str, one: Evidence, whole: bool) -> Style | None:
    """The style that a column shows by itself; None where its cells allow several."""
    readings: dict[Style, int] = {}
    for mark, other in ((",", "."), (".", ",")):
        if one.decimal[mark] or one.thousands[other]:
            readings[Style(mark, other if one.thousands[other] or one.either[other] else "")] = (
                one.decimal[mark] + one.thousands[other]
            )
    if not readings:
        return None
    likely = max(readings, key=lambda style: readings[style])
    against = sum(readings.values()) - readings[likely]
    if against > _DAMAGED * readings[likely]:
        if not whole:
            return None
        raise PvidError(
            f"{path}, column {name}: both the comma and the point seem to be the decimal sign ({readings[likely]} "
            f"cells against {against})"
        )
    return likely


def _by_others(path: str, name: str, one: Evidence, known: set[Style]) -> Style:
    """The style of a column that allows several: that of the others, if they agree."""
    decimals = {style.decimal for style in known}
    if decimals == {","}:
        return Style(",", "." if one.either["."] else "")
    mark = "," if one.either[","] else "."
    if decimals == {"."}:
        return Style(".", mark if one.either[","] else "")
    if one.either[","] or (one.either["."] and one.short and not one.long and one.round["."]):
        cell = one.example[mark]
        raise PvidError(
            f"{path}, column {name}: {shown(cell)} can be {cell.replace(mark, '')} or {cell.replace(mark, '.')}: "
            f"write the numbers without thousands separators and with a decimal point"
        )
    return PLAIN


def style_note(styles_of: Mapping[str, Style]) -> tuple[str, ...]:
    """A sentence on thousands separators."""
    marks = {style.thousands for style in styles_of.values() if style.thousands}
    names = [name for name, style in styles_of.items() if style.thousands]
    words = {",": "the comma", ".": "the point"}
    if not names:
        return ()
    return (f"{listed(names)}: {listed(words[one] for one in sorted(marks))} separates thousands",)
