"""Text that a program prints, as a table: a number of each signal a line, between words, units or brackets.

`t=0.1 s, F=2 N`, `(0.1, 2.0)`, `{"t": 0.1, "F": 2.0}`, a log's `10:00:00.1 INFO F=2.0`, and records with `---` between
them, as `ros2 topic echo` prints them. Most lines, or records, have the same text between their numbers.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice, pairwise
from typing import NamedTuple

from pvid.base.units import is_unit
from pvid.rig.layout import SEPARATORS, split

_SAMPLED = 2000  # lines
_MOST = 0.8  # of the lines with numbers have the same text between them
_TIME = r"(?:\d{4}-\d\d-\d\d[T ])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?(?:Z|[+-]\d\d:?\d\d)?"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|-?(?:nan|inf|null)(?![A-Za-z_])"
_TOKEN = re.compile(rf"(?<![A-Za-z_\d.^]){_TIME}|(?<![A-Za-z_\d.^])(?:{_NUMBER})", re.I)
_LABEL = re.compile(r"([^\W\d][\w.]*)[\"']?\s*[:=]\s*[\"'(\[{\-\s]*$")
_UNIT = re.compile(r"\s?([A-Za-zµμ°%Ω][\w/*^°µ²%]*)(?!\s*[:=\w])")
_LONE_SIGN = re.compile(r"[=(\[,;]\s*-\s+$")
_SINCE_1970 = re.compile(r"[1-3]\d{9}(?:\d{3}){0,3}(?:\.\d+)?")  # in seconds or parts of one
_RECORD_ENDS = re.compile(rb"(?m)^---\s*$")
_SECONDS, _PARTS = ("sec", "secs"), ("nanosec", "nsec", "nsecs")


class Printed(NamedTuple):
    """What the columns are called in the text, and lines of a table, that of names first."""

    named: bool
    blocks: Callable[[], Iterator[bytes]]


def printed(blocks_of: Callable[[], Iterator[bytes]]) -> Printed | None:
    """The table in text whose blocks of lines begin anew at every call; None where there is none."""
    text = [(one, _between(one)) for one in islice(_lines(blocks_of()), _SAMPLED)]
    counted = Counter(between for _, between in text if len(between) > 2)
    if not counted:
        return None
    usual, times = counted.most_common(1)[0]
    if times < max(_MOST * counted.total(), 3) or not "".join(usual).strip(" ,;|\t"):
        return None
    labels = [_LABEL.search(one) for one in usual[:-1]]
    names = [str(k + 1) if one is None else one[1] for k, one in enumerate(labels)]
    stamp = next(line for line, between in text if between == usual)
    head = _head([line for line, _ in text], stamp, len(names))
    if any((one == "," and head is None) or _LONE_SIGN.search(one) for one in _TOKEN.split(stamp)):
        return None  # decimal commas; a sign apart from its number
    if labels[0] is None and re.match(_TIME, _TOKEN.findall(stamp)[0]):
        names[0] = "time" if "t" in names else "t"
    joined = next((k for k, (a, b) in enumerate(pairwise(names)) if a in _SECONDS and b in _PARTS), None)
    if joined is not None:
        names[joined : joined + 2] = ["stamp" if "t" in names else "t"]
    elif not any(labels):
        names = head or names
    elif "t" not in names:
        names = ["t" if one.isdecimal() and _SINCE_1970.fullmatch(cell) else one
                 for one, cell in zip(names, _TOKEN.findall(stamp), strict=True)]  # fmt: skip
    found = [_UNIT.match(one) for one in usual[1:]]
    units = [one[1] if one is not None and is_unit(one[1]) else "" for one in found]
    if joined is not None:
        del units[joined]
    return Printed(not all(map(str.isdecimal, names)), partial(_rows, blocks_of, usual, names, units, joined))


def _lines(blocks: Iterator[bytes]) -> Iterator[str]:
    """Not blank; those of a record as one."""
    records, record = False, list[str]()
    for number, block in enumerate(blocks):
        records |= not number and _RECORD_ENDS.search(block) is not None
        for line in filter(None, map(str.strip, block.decode(errors="replace").split("\n"))):
            if not records:
                yield line
            elif line == "---":
                yield " ".join(record)
                record = []
            else:
                record.append(line)
    if record:
        yield " ".join(record)


def _between(line: str) -> tuple[str, ...]:
    """Text in front of, between and behind the numbers of a line."""
    return tuple(" ".join(one.split()) for one in _TOKEN.split(line))


def _head(lines: list[str], first: str, count: int) -> list[str] | None:
    """So many names in the line in front of the first one with numbers."""
    above = lines[: lines.index(first)][-1:]
    found = (split(one, separator) for one in above for separator in SEPARATORS)
    return next((one for one in found if one is not None and len(one) == count and all(one)), None)


def _rows(
    blocks_of: Callable[[], Iterator[bytes]],
    usual: tuple[str, ...],
    names: list[str],
    units: list[str],
    joined: int | None,
) -> Iterator[bytes]:
    """Lines of other text are left as they are."""
    rows = [";".join(names)] + [";".join(units)] * any(units)
    began = False
    for line in _lines(blocks_of()):
        if _between(line) == usual:
            cells = _TOKEN.findall(line)
            if joined is not None:
                cells[joined : joined + 2] = [f"{cells[joined]}.{cells[joined + 1]:0>9}"]
            rows.append(";".join(cells))
            began = True
        elif began:
            rows.append(line.replace(";", ","))
        if len(rows) > 10_000:
            yield ("\n".join(rows) + "\n").encode()
            rows = []
    yield ("\n".join(rows) + "\n").encode()
