"""The time from row to row that the text in front of a table states: `# dt = 0.001 s`, `Sample Rate: 2 kHz`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from types import MappingProxyType

from pvid.base.units import scale_to
from pvid.rig.clock import CLOCKS
from pvid.rig.columns import Column, Columns
from pvid.rig.layout import Layout, split

_SAMPLING = r"(?:sampl\w*|scan|logging|acquisition|abtast\w*)"
_NUMBER = r"""
    \s* (?:[\[(](?P<bracket>[^\])]+)[\])] | in\s+(?P<word>[A-Za-zµ/]+))?
    "?\s*[:=,;\t ]["\s:=,;]*
    (?P<number>\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?) \s* (?P<unit>[A-Za-zµ/]*)"""
_STATED = re.compile(
    rf"""(?<![A-Za-z])
    (?: (?P<rate> f_?s | {_SAMPLING}[ _-]*(?:rate|freq\w*) | abtastfrequenz)
      | d[ _]?t | [tx]_?incr?\w* | delta[ _]?(?:t|time) | delta_x | abtastzeit | messintervall
      | {_SAMPLING}[ _-]*(?:interval|period|step|increment|time) ){_NUMBER}""",
    re.X | re.I,
)
# Words that may be of anything, at the beginning of a line, with a unit or beside the names.
_BARE = re.compile(
    rf"""^[\s#%;/*"]* (?: (?P<rate> (?:data[ _-]*)?rate)
      | t_?s | delta[ ]x | increment | (?:(?:data|time|horizontal|measur\w*)[ _-]*)?(?:interval|period|step|increment)
    ){_NUMBER} (?P<rest>.*)$""",
    re.X | re.I,
)
_THOUSANDS = re.compile(r"[1-9]\d{0,2}[.,]\d{3}")
_RATE = re.compile(r"(?P<prefix>[kM]?)(?:Hz|Sa?/s|sps|samples/s(?:ec)?|1/s)?", re.I)
_SAME = 1e-6
_STEADY = 1e-3  # of a step, in the median of rounded times
_UNITS = ("ms", "us", "ns")


@dataclass(frozen=True)
class Step:
    """Seconds from row to row, and the line that states them."""

    seconds: float
    line: int

    def __str__(self) -> str:
        return f"{self.seconds:g} s, as line {self.line} states"

    def of(self, columns: Columns) -> Columns:
        """With the column of time as one that counts rows."""
        rate = round(1 / self.seconds)
        whole = rate > 0 and abs(rate * self.seconds - 1) < _SAME
        name = columns["t"].name
        column = (
            Column(name, divisor=float(rate), unit_given=True) if whole else Column(name, self.seconds, unit_given=True)
        )
        return replace(columns, named=MappingProxyType({**columns.named, "t": column}))

    def unit_of(self, times: Sequence[str]) -> str | None:
        """In which cells of the time have this step, where they do not have it in seconds."""
        try:
            steps = [float(b) - float(a) for a, b in pairwise(one.replace(",", ".") for one in times)]
        except ValueError:
            return None
        tried = (median(steps), sum(steps) / len(steps)) if steps else ()  # the mean of rounded ones
        units = (unit for unit in _UNITS for own in tried if abs(own / CLOCKS[unit] / self.seconds - 1) < _STEADY)
        return next(units, None)


def stated_step(front: Sequence[str], layout: Layout) -> Step | None:
    """Of the lines in front of the first row; None where none states it, or two contradict each other."""
    found = [Step(seconds, number) for number, line, beside in _statements(front, layout)
             for seconds in _seconds(line, layout, beside)]  # fmt: skip
    agree = all(one.seconds > 0 and abs(one.seconds / found[0].seconds - 1) < _SAME for one in found)
    return found[0] if found and agree else None


def _statements(front: Sequence[str], layout: Layout) -> Iterator[tuple[int, str, bool]]:
    """Lines with their numbers; settings beside the names have their numbers in the line below."""
    for number, line in enumerate(front, 1):
        yield number, line, False
        if number == layout.header and number < len(front):
            below = (split(one, layout.separator) or [] for one in (line, front[number]))
            yield from ((number + 1, f"{name}={cell}", True) for name, cell in zip(*below, strict=False))


def _seconds(line: str, layout: Layout, beside: bool) -> Iterator[float]:
    """Those that a line states; 0 where it may be one or another."""
    matches = list(_STATED.finditer(line))
    bare = None if matches else _BARE.match(line)
    if (
        bare is not None
        and (beside or bare["unit"] or bare["bracket"] or bare["word"])
        and not bare["rest"].strip('" ,;')
    ):
        matches = [bare]
    for match in matches:
        text = match["number"].partition(",")[0] if layout.separator == "," else match["number"].replace(",", ".")
        number, unit = float(text), match["unit"] or match["bracket"] or match["word"] or ""
        if number <= 0:
            continue
        is_rate = bool(match["rate"])
        if _THOUSANDS.fullmatch(match["number"]) and (is_rate or "," in match["number"]):
            yield 0.0
        elif is_rate and (rate := _RATE.fullmatch(unit)) is not None:
            yield 1 / (number * {"": 1.0, "k": 1e3, "m": 1e6}[rate["prefix"].lower()])
        elif not is_rate and (scale := scale_to("s", unit or "s")) is not None:
            yield number * scale.factor / scale.divisor
