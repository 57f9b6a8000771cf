"""An answer in words, and its values as a person reads them: what the report, a program and a notebook show.

The words of the method stay out of it; they are in `Answer.lines`.
"""

from __future__ import annotations

import math
import re
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from pvid.base.rounding import percent, prefix_of
from pvid.base.wording import listed
from pvid.identification.answer import LEVEL, Answer, Value, interval_of
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.model.readable import raised
from pvid.oracle.weak.words import Word
from pvid.rig.mechanism_file import MechanismRig, rig_path_of

VERDICTS: dict[Word, tuple[str, str]] = {
    "good": ("Good", "The values can be used."),
    "usable": ("Usable", "The values can be used with care: read the warnings and notes below."),
    "not_explained": (
        "Not explained",
        "Do not use the values: the equations do not explain this recording. What seems to be missing is below.",
    ),
    "not_identified": ("Not identified", "The recording does not determine the values: the reasons are below."),
}
_LEVEL = percent(LEVEL)
REACH = interval_of(0.0, 1.0, None)[1]  # standard errors of a half of an interval
_PLAIN = 0.1  # from here to 1 a number needs no prefix
_POWERS = (-3, 4)  # of 10: numbers between them have no power beside them
_DIGITS = 9  # behind the point, at most
_LIKE_NOISE = 1.5  # times the sensor's noise: a difference that is no more is as small as it can be
_FACTOR = re.compile(r"([A-Za-z]+)((?:[*/].*)?)")  # of a unit: the first one, without a power, and the rest


@dataclass(frozen=True)
class Shown:
    """A value in the unit in which it has few zeros: it and both ends of its interval are times 10**power."""

    value: str
    low: str
    high: str
    power: int
    unit: str  # as books print it

    @property
    def texts(self) -> tuple[str, str]:
        """The value, and the interval with the unit, as in a terminal."""
        power = f"e{self.power}" if self.power else ""
        return f"{self.value}{power}", f"{self.low}{power} to {self.high}{power} {self.unit}".rstrip()


@dataclass(frozen=True)
class Made:
    """How an answer was made.

    Attributes
    ----------
    command : as it was typed
    files : recordings, rig file and model file that were read
    settings : the text of the rig
    """

    command: str
    files: tuple[Path, ...] = ()
    settings: str = ""

    @classmethod
    def of(
        cls, command: str, runs: Iterable[Path], rig_path: Path | None, rig: MechanismRig, *others: Path | None
    ) -> Made:
        """Of recordings with their rig: the file that was named, or those beside them."""
        own = [rig_path_of(one) for one in runs] if rig_path is None else [rig_path]
        model = rig.model if isinstance(rig.model, Path) else None
        there = dict.fromkeys(one for one in (*runs, *own, model, *others) if one is not None and one.is_file())
        return cls(command, tuple(there), rig.text())

    @classmethod
    def by_this_command(
        cls, runs: Iterable[Path], rig_path: Path | None, rig: MechanismRig, *others: Path | None
    ) -> Made:
        """The same of the command line of this process."""
        return cls.of(shlex.join(["pvid", *sys.argv[1:]]), runs, rig_path, rig, *others)


def prefixed(size: float, unit: str) -> tuple[str, float]:
    """As `prefix_of`; a product takes the prefix at its first factor: 0.05 N*m/A are 50 mN*m/A."""
    factor = _FACTOR.fullmatch(unit)
    if factor is None or _PLAIN <= size < 1.0:
        return unit, 1.0
    first, scale = prefix_of(size, factor[1])
    return first + factor[2], scale


def printed_unit(unit: str) -> str:
    """A unit as books print it: "uN*m^2" is µN·m²."""
    whole = re.sub(r"(?<![A-Za-z])([numkM]?)ohm\b", "\\1Ω", unit)
    whole = re.sub(r"(?<![A-Za-z])u(?=[A-ZΩmsg])", "µ", whole).replace("*", "·")
    return re.sub(r"\^(-?\d+)", lambda power: raised(int(power[1])), whole)


def unit_for(largest: float, unit: str) -> tuple[str, float]:
    """The unit in which numbers up to `largest` have few zeros, as books print it, and its size."""
    unit, scale = prefixed(largest, unit)
    power = math.floor(math.log10(largest / scale)) if 0 < largest < math.inf else 0
    if _POWERS[0] <= power <= _POWERS[1]:
        return printed_unit(unit), scale
    return f"×10{raised(power)} {printed_unit(unit)}".strip(), scale * 10.0**power


def meaning_of(name: str, meanings: Mapping[str, str]) -> str:
    """Of a parameter, that of one recording included (`m[2]`); "": none is given."""
    return meanings.get(name.partition("[")[0], "")


class WithInterval(Protocol):
    """A value of an answer, or a parameter of a result."""

    @property
    def value(self) -> float | None: ...

    @property
    def unit(self) -> str: ...

    def interval(self) -> tuple[float, float] | None:
        """That of 95 %."""


def shown(one: WithInterval) -> Shown | None:
    """A value with its 95 % interval, to the second digit of half of that; None: it is not identified."""
    interval = one.interval()
    if interval is None or one.value is None:
        return None
    largest = max(map(abs, interval)) if interval[0] <= 0 <= interval[1] else abs(one.value)
    unit, scale = prefixed(largest, one.unit)
    numbers = np.array([one.value, *interval]) / scale
    half, largest = float(numbers[2] - numbers[1]) / 2, largest / scale
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    power = 0 if _POWERS[0] <= power < _POWERS[1] else power
    numbers /= 10.0**power
    half /= 10.0**power
    decimals = 1 - math.floor(math.log10(half)) if 0 < half < math.inf else 6
    decimals = min(max(decimals, 0), _DIGITS)
    value, low, high = (f"{number:.{decimals}f}" for number in numbers)
    return Shown(value, low, high, power, printed_unit(unit))


def head(answer: Answer) -> tuple[str, str]:
    """The verdict in a word, and what it means."""
    return VERDICTS[answer.verdict.word if answer.identified else "not_identified"]


def sentences(answer: Answer) -> Iterator[str]:
    """What the recording determines, how well, and what the equations predict."""
    if not answer.identified:
        yield f"Nothing is identified{f': {answer.why_nothing}' if answer.why_nothing else ''}."
        return
    known = {name: answer.values[name] for name in answer.names}
    yield f"The recording determines {listed(known)}."
    unknown = [name for name in answer.values if name not in known]
    if unknown:
        yield f"It does not determine {listed(unknown)}."
    near_0 = [name for name, one in known.items() if has_0(one)]
    parts = {name: (one.se or 0.0) / abs(one.value or 1.0) for name, one in known.items() if name not in near_0}
    if parts:
        best, worst = min(parts, key=parts.__getitem__), max(parts, key=parts.__getitem__)
        reach = {name: f"± {percent(REACH * part)}" for name, part in parts.items()}
        rest = f", the least certain {worst} ({reach[worst]})" if worst != best else ""
        yield f"The most certain value is {best} ({reach[best]}){rest}, with {_LEVEL} probability."
    if near_0:
        yield f"The interval of {listed(near_0)} contains 0."
    unseen = answer.unseen
    if unseen is not None:
        yield f"With values from one part of the recording, the equations predict the rest: {in_words(unseen.sensors)}."


def has_0(one: Value) -> bool:
    """Whether its 95 % interval contains 0: a percentage of it means nothing."""
    interval = one.interval()
    return interval is not None and interval[0] <= 0 <= interval[1]


def in_words(sensors: tuple[SensorPrediction, ...]) -> str:
    """How far predictions are off, of each sensor."""
    return listed(
        f"{one.name} to {percent(one.of_motion)} of its motion"
        + (" (the noise of the sensor)" if one.of_noise is not None and one.of_noise < _LIKE_NOISE else "")
        for one in sensors
    )


def summary(answer: Answer) -> str:
    """The answer in words, the values in lines, the doubts and the advice."""
    word, meaning = head(answer)
    lines = [f"{answer.model.title}: {word.lower()}. {meaning}", *sentences(answer)]
    texts = {name: shown(value) for name, value in answer.values.items()}
    rows = [(name, *(("not determined", "") if one is None else one.texts)) for name, one in texts.items()]
    if answer.identified:
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines += ["", f"{'':{widths[0]}}  {'value':{widths[1]}}  {_LEVEL} interval"]
        lines += [f"{a:{widths[0]}}  {b:>{widths[1]}}  {c}".rstrip() for a, b, c in rows]
    doubts = [f"{'warning' if one.alarm and answer.identified else 'note'}: {one.text}" for one in answer.doubts]
    lines += ["", *doubts, *(f"advice: {one}" for one in answer.advice)] if doubts or answer.advice else []
    return "\n".join(lines)
