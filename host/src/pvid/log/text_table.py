"""Lines of numbers that a board prints, as a table: sketches print CSV where they send no frames.

A line is a row if its cells are numbers and as many as in the other rows. They are apart by commas, semicolons, tabs or
spaces, or have labels as for the plotter of the Arduino program (`angle:1.2,duty:30`). Whatever arrives, nothing is
raised and memory is bounded.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from pvid.link.frames import Decoder, Frame

_LONGEST = 4096  # bytes of a line; a longer one is no line of a table
_ALIKE = 3  # rows of as many cells, from which the number of columns is taken
_HEADS = 20  # lines in front of the first rows among which the header is
_CERTAIN = 10  # rows, from which the port is certain to send text
_SHOWN = 60
_SEEN = 1 << 16  # bytes that are searched for frames
_LABEL = re.compile(r"\s*([A-Za-z_][\w .()\[\]/^*%-]*):\s*(\S*)\s*")


@dataclass
class TextTable:
    """Takes bytes in and gives rows out.

    Attributes
    ----------
    names : of the columns: the board's header, else column_1 ...; (): there are no rows yet
    has_header : whether the board sent it
    rows, damaged, words : lines that are rows; lines with numbers that are none, as after lost bytes; other lines
    restarts : how often the header came again
    frames : frames of pvid's link among the bytes
    last : the last row
    """

    names: tuple[str, ...] = ()
    has_header: bool = False
    rows: int = 0
    damaged: int = 0
    words: int = 0
    restarts: int = 0
    frames: int = 0
    last: str = ""
    _rest: bytes = b""
    _begun: bool = False  # whether the first end of a line has come
    _waiting: list[str] = field(default_factory=list)  # lines before the number of columns is known
    _decoder: Decoder = field(default_factory=Decoder)
    _searched: int = 0

    @property
    def is_text(self) -> bool:
        """Whether the bytes are certainly lines of a table."""
        return self.rows >= _CERTAIN and not self.frames

    @property
    def example(self) -> str:
        """A line for a sentence: the board's header, else a row."""
        return (",".join(self.names) if self.has_header else self.last)[:_SHOWN]

    @property
    def header(self) -> str:
        """First line of a CSV file."""
        return ",".join(self.names) + "\n"

    def feed(self, data: bytes) -> str:
        """More bytes; returns the rows that they complete, as lines of CSV."""
        if self._searched < _SEEN:
            self._searched += len(data)
            self.frames += sum(isinstance(item, Frame) for item in self._decoder.feed(data))
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > _LONGEST:
            self._rest, self.damaged = b"", self.damaged + 1
        return "".join(self._line(line) for line in lines if line.strip())

    def cut(self) -> None:
        """The link was down: what is left of a line is none, and the next one may be cut."""
        self._rest, self._begun = b"", False

    def end(self) -> str:
        """Rows that still wait at the end; a line that was cut off is none."""
        waiting, self._waiting = self._waiting, []
        return "" if self.names else self._settled(waiting)

    def _line(self, raw: bytes) -> str:
        is_first, self._begun = not self._begun, True  # it may be cut at its begin
        if len(raw) > _LONGEST or not (text := _ascii(raw)):
            self.damaged += not is_first
            return ""
        if self.names:
            return "" if is_first and _numbers(text) is not None else self._row(text)
        self._waiting.append(text)
        counts = Counter(len(cells) for one in self._waiting if (cells := _numbers(one)) is not None)
        most = max(counts.values(), default=0)
        if most >= _ALIKE:
            waiting, self._waiting = self._waiting, []
            return self._settled(waiting)
        if len(self._waiting) > _HEADS:
            self.words += 1
            del self._waiting[0]
        return ""

    def _settled(self, lines: Sequence[str]) -> str:
        """The columns from the first lines, and the rows among these."""
        rows = [(place, cells) for place, one in enumerate(lines) if (cells := _numbers(one)) is not None]
        if not rows:
            self.words += len(lines)
            return ""
        width = Counter(len(cells) for _, cells in rows).most_common(1)[0][0]
        start = next(place for place, cells in rows if len(cells) == width)
        heads = [head for one in lines[:start] if (head := _head(one, width))]
        found = tuple(_labels(lines[rows[-1][0]])) or (heads[-1] if heads else ())
        self.has_header = bool(found)
        self.names = found or tuple(f"column_{k + 1}" for k in range(width))
        before = [_numbers(one) is not None for one in lines[:start]]
        self.damaged += sum(before[1:])
        self.words += before.count(False) - bool(heads)
        # The first line of all may be cut at its begin; as a row it may have lost digits.
        return "".join(map(self._row, lines[max(start, 1) :]))

    def _row(self, text: str) -> str:
        cells = _numbers(text)
        if cells is not None and len(cells) == len(self.names):
            self.rows, self.last = self.rows + 1, ",".join(cells)
            return self.last + "\n"
        head = _head(text, len(self.names))
        if head and (head == self.names or not self.has_header):
            self.restarts += 1
            self.names, self.has_header = head, True
        elif cells is not None or any(one.isdigit() for one in text):
            self.damaged += 1
        else:
            self.words += 1
        return ""


def _ascii(raw: bytes) -> str:
    """The text of a line; "": it is none."""
    text = raw.decode("utf-8", "replace").strip().strip("\0")
    return text if text.isprintable() or text.replace("\t", "").isprintable() else ""


def _cells(text: str) -> list[str]:
    """Of a line, by the first separator of `;`, tab, `,` and space that it has."""
    for separator in (";", "\t", ","):
        if separator in text:
            return [one.strip() for one in text.rstrip(separator).split(separator)]
    return text.split()


def _numbers(text: str) -> list[str] | None:
    """The cells of a row, with points as decimal marks; None: it is none."""
    cells = _cells(text)
    if _labels(text):
        cells = [_LABEL.fullmatch(one)[2] for one in cells]  # type: ignore[index]
    if ";" in text or "\t" in text:
        cells = [one.replace(",", ".") for one in cells]
    try:
        numbers = [float(one) for one in cells if one]
    except ValueError:
        return None
    return cells if numbers else None


def _labels(text: str) -> list[str]:
    """Names in front of the numbers of a line; []: it has none."""
    found = [_LABEL.fullmatch(one) for one in _cells(text)]
    return [one[1].strip() for one in found if one] if found and all(found) else []


def _head(text: str, width: int) -> tuple[str, ...]:
    """The names of a header of so many columns; (): it is none."""
    cells = [one.strip().strip('"') for one in _cells(text.lstrip("#%/ "))]
    if len(cells) != width or len(set(cells)) < width or any(not one or one[0].isdigit() for one in cells):
        return ()
    return tuple(one.replace(",", " ") for one in cells)
