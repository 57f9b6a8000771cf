"""Which columns of a file are t and the signals, and in which units: `t=time_ms:ms,phi=angle_deg:deg,y=h:mm`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.units import Scale, is_unit, scale_to, spelled, usual
from pvid.base.wording import listed, shown

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """A signal that a recording is to have.

    Attributes
    ----------
    name, unit : the unit in SI
    held : it keeps each value until the next one: a blank cell is no change
    usual : regular expression of likely names of its column; "": its own name, which may carry a unit, and those that
        people give a signal of its unit
    """

    name: str
    unit: str
    held: bool = False
    usual: str = ""

    def is_called(self, name: str) -> bool:
        """Whether a column of this name is likely to be the signal."""
        probe = _PROBE.fullmatch(name.strip())
        if probe is not None and probe["node"] != "t" and not is_unit(probe["node"]):
            return probe["node"] == self.name and probe["what"] == self.unit.replace("A", "I")
        if self.usual:
            return re.search(self.usual, name, re.I) is not None
        return self.is_named(name) or is_usual(name, "held" if self.held and not self.unit else self.unit)

    def is_named(self, name: str) -> bool:
        """Whether a column has the signal's own name, which may carry a unit."""
        return re.search(rf"^{re.escape(self.name)}([\s_(\[].*)?$", name, re.I) is not None


def is_usual(name: str, kind: str) -> bool:
    """Whether people call a signal of this SI unit so; of "" a sensor without one, of "held" an input without one."""
    return kind in _USUAL_NAMES and re.search(_USUAL_NAMES[kind], name, re.I) is not None


def of_set_value(name: str) -> int:
    """Rank of a column among those that are called alike: 0 of what is measured, 2 of what is set or surrounds, 1 of
    neither."""
    parts = set(re.split(r"[\W_\d]+", name.lower()))
    return 0 if parts & _MEASURED else 2 if parts & _SET else 1


_MEASURED = frozenset("ist act actual meas measured fbk feedback".split())
_SET = frozenset("soll set setpoint sp ref reference cmd command commanded target des desired ambient air room".split())

TIME = Channel(
    "t",
    "s",
    usual=r"^t$|^t[^a-z]|^ts$|time|zeit|temps|tiempo|stamp|clock|millis|micros|^sec|^sek|elapsed|^x[_-](value|axis)"
    r"|created_at|last_changed|\bdoy\b|day.of.year|julian|^m?jd$",
)

# What people call a signal of a unit, besides its own name; of no unit what is measured and what is held.
_USUAL_NAMES = {
    "": r"output|response|temp|^y[_\s]|^pv$",
    "held": r"duty|throttle|valve|pwm|^u[_\s]|input|stell",
    "rad": r"phi|φ|angle|ang|theta|winkel|enc|deg|rad|pend|°|counts?$|pulses?$",
    "m": r"height|^h$|^h[^a-z]|pivot|cart|base|pos|disp|laser|dist|^x$|^y$|^z|level",
    "rad/s": r"omega|ω|rate|speed|veloc|rpm|gyro|drehzahl|(?-i:^n(?![a-zA-Z]))|^w_?[xyz]$",
    "m/s": r"speed|veloc|^v$",
    "m^3/s": r"flow|pump",
    "V": r"volt|spannung|^u$|^u[^a-z]|^v$|^[uv]_?(in|out|bat|dc)$",
    "A": r"curr|strom|amp|^i$|^i[^a-z]|^i_?(l|out|bat|motor)$",
    "K": r"temp|ambient|^t_",
    "N": r"force|kraft|load",
    "N*m": r"torque|moment|drehmoment|^tau",
    "W": r"power|leistung",
}

_PROBE = re.compile(r"(?P<what>[VI])\((?P<node>\w+)\)")  # of a circuit simulator: V(out), I(R1)
_UNIT_AT_END = re.compile(r"(?:^|[\s_.\-/(\[])(?P<unit>[a-zµμ°]+)[)\]]?\s*$", re.I)
_IN_BRACKETS = re.compile(r"[\[(](?P<unit>[^\[\]()]+)[\])]\s*$")
_BEHIND_SIGN = re.compile(r"(?:\sin\s+|,\s*|(?<=\w)\s?/\s?)(?P<unit>[^\s,].*?)\s*$")  # `U in V`, `Force, N`, `I/mA`
ALSO_WORDS = frozenset("m s a k n v h d g c w j t f l in min".split())  # units that are also words of names
_LONG = 24  # characters of a name that is typed
_PART = re.compile(r'(?:[^,"]|"(?:[^"]|"")*"?)+')
_ASSIGNED = re.compile(
    r'\s*(?P<signal>[^=]*?)\s*=\s*(?:"(?P<quoted>(?:[^"]|"")*)"\s*|(?P<name>[^":].*?))'
    r"(?:\s*:\s*(?P<unit>[^:]*?)\s*)?",
    re.S,
)


@dataclass(frozen=True)
class Column:
    """A column of a file, and what a number of it is in SI: value * factor / divisor + offset.

    Attributes
    ----------
    name : in the file's header, or a position from 1
    unit_given : whether the scale was typed; else that of the file holds, if it has one
    unit_of_file : whether the scale is one that the file states
    """

    name: str
    factor: float = 1.0
    divisor: float = 1.0
    offset: float = 0.0
    unit_given: bool = False
    unit_of_file: bool = False

    def in_si(self, values: FloatArray) -> FloatArray:
        """Numbers of the file [n] in s, rad or m [n]; the same array where the file is in SI."""
        if self.factor != 1.0:
            values = values * self.factor
        if self.divisor != 1.0:
            values = values / self.divisor
        return values if self.offset == 0.0 else values + self.offset


@dataclass(frozen=True)
class Columns:
    """Where a file holds the signals; a signal that is not named is a column of its own name, in SI.

    Attributes
    ----------
    named : by signal
    channels : the signals to find, without the time
    """

    channels: tuple[Channel, ...]
    named: Mapping[str, Column] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def units(self) -> dict[str, str]:
        """In SI, by signal: that of the time first."""
        return {one.name: one.unit for one in (TIME, *self.channels)}

    @property
    def held(self) -> frozenset[str]:
        """Inputs that keep each value until the next one."""
        return frozenset(one.name for one in self.channels if one.held)

    def __getitem__(self, signal: str) -> Column:
        return self.named.get(signal, Column(signal))

    @classmethod
    def parse(cls, text: str, channels: tuple[Channel, ...]) -> Columns:
        """Reads `SIGNAL=COLUMN[:UNIT],...`.

        COLUMN is a name in the file's header, in double quotes where it has a comma, a colon or a quote of its own
        (which is doubled), or a number, 1 for the first column. UNIT is one of `pvid.base.units`, or a number of SI
        units. A minus sign in front of it turns the sign, `/N` behind it divides: `rev/4096` for counts of an encoder,
        `-mm` for a height that grows downwards.

        Raises PvidError when the text is none, naming the part.
        """
        named: dict[str, Column] = {}
        units = cls(channels).units
        for part in _PART.findall(text) or [""]:
            match = _ASSIGNED.fullmatch(part)
            name = "" if match is None else (match["name"] or (match["quoted"] or "").replace('""', '"')).strip()
            if match is None or not name or match["unit"] == "":
                raise PvidError(
                    f"--columns: {shown(part)} is not SIGNAL=COLUMN:UNIT, as in t=time_ms:ms,phi=angle_deg:deg,y=h:mm"
                )
            signal = match["signal"]
            if signal not in units:
                raise PvidError(f"--columns: {shown(signal)} is no signal; the signals are {', '.join(units)}")
            if signal in named:
                raise PvidError(f"--columns: {signal} is given twice")
            unit = match["unit"]
            named[signal] = Column(name) if unit is None else _column(signal, name, units[signal], unit.strip())
        return cls(channels, MappingProxyType(named))

    def in_units_of_file(self, units: Mapping[str, str]) -> tuple[Columns, tuple[str, ...]]:
        """With the units that a file states for signals, where none was typed; and a sentence on each that was used or
        is no unit of its signal."""
        named, used, unknown = dict(self.named), [], []
        for signal, unit in units.items():
            column = self[signal]
            if column.unit_given or not unit.strip():
                continue
            scale = scale_to(self.units[signal], unit)
            if spelled(unit) == "%" and self.units[signal]:
                name, si = column.name, self.units[signal]
                raise PvidError(
                    f"column {shown(name)} is in %, and {signal} in {si}: --columns {signal}=NAME:NUMBER has what 1 % "
                    f"is in {si}, such as 0.12 where 100 % are 12 {si}"
                )
            if scale is None:
                unknown.append(f"{shown(unit)} of column {shown(column.name)}")
                continue
            of_file = replace(column, factor=scale.factor, divisor=scale.divisor, offset=scale.offset)
            named[signal] = replace(of_file, unit_of_file=True)
            if scale != Scale():
                used.append(f"{signal} in {spelled(unit)}")
        notes: tuple[str, ...] = (f"units as the file states them: {listed(used)}",) if used else ()
        if unknown:
            what = "is no unit of its signal" if len(unknown) == 1 else "are no units of their signals"
            notes += (f"{listed(unknown)} {what}: taken as SI unless --columns has a unit",)
        return replace(self, named=MappingProxyType(named)), notes

    def called(self, names: Sequence[str], places: Mapping[str, int]) -> Columns:
        """With the names of the file's columns for those that were typed by position, where a sentence can use them."""
        own = {
            signal: replace(column, name=names[places[signal]])
            for signal, column in self.named.items()
            if column.name.isdecimal() and names.count(names[places[signal]]) == 1 and names[places[signal]].strip()
        }
        return replace(self, named=MappingProxyType({**self.named, **own}))

    @property
    def wanted(self) -> tuple[str, ...]:
        """Names that the header of a file contains; not positions."""
        return tuple(self[one].name for one in self.units if not (one in self.named and self[one].name.isdecimal()))

    def places(self, path: Path, names: Sequence[str], where: str = "") -> dict[str, int]:
        """Index of each signal's column among the names of a file's columns.

        Raises PvidError when a column is missing or appears twice; the sentence lists the file's columns and how to
        name them.
        """
        places = {}
        numbers = {one.name for one in self.named.values() if one.name.isdecimal()}
        are_positions = not numbers <= set(names)  # all are names, or none
        for signal in self.units:
            name = self[signal].name
            times = 0 if are_positions and name in numbers else names.count(name)
            if times > 1:
                at = [str(k + 1) for k, one in enumerate(names) if one == name]
                raise PvidError(
                    f"{path}{where}: column {shown(name)} appears {times} times: name it by its position, "
                    f"{listed(at, 'or')}, as in --columns {signal}={at[0]}."
                )
            if times == 1:
                places[signal] = names.index(name)
            elif signal in self.named:
                if name.isdecimal() and 1 <= int(name) <= len(names):
                    places[signal] = int(name) - 1
            elif len(with_unit := [k for k, one in enumerate(names) if self._is_with_unit(one, signal)]) == 1:
                places[signal] = with_unit[0]
        missing = [signal for signal in self.units if signal not in places]
        if missing:
            units = self.units
            wanted = " and ".join(
                f"{shown(self[signal].name)} for {signal}" if signal in self.named else f"{signal} ({units[signal]})"
                for signal in missing
            )
            found = ", ".join(shown(name, 24) for name in names[:8]) + (", ..." if len(names) > 8 else "")
            raise MissingColumnError(
                f"{path}{where}: no column {wanted} among {found or 'none'}: "
                f"use --columns {self._suggestion(names, places)}.",
                tuple(names),
            )
        return places

    def _is_with_unit(self, name: str, signal: str) -> bool:
        """Whether a column is called as the signal, with a unit of its dimension in brackets: `x [mm]`."""
        unit = unit_in_brackets(name)
        stem = _IN_BRACKETS.sub("", name).strip()
        return bool(unit) and stem == signal and scale_to(self.units[signal], spelled(unit)) is not None

    def _suggestion(self, names: Sequence[str], places: Mapping[str, int]) -> str:
        """The text for --columns that is likely to be meant; a signal whose column cannot be guessed is NAME."""
        taken = set(places.values())
        parts = []
        numbered = list(names) == [str(k + 1) for k in range(len(names))]  # the file has no names
        for order, channel in enumerate((TIME, *self.channels)):
            signal, unit = channel.name, channel.unit
            place: int | None = places.get(signal)
            if place is None and numbered and order < len(names):
                place = order
            elif place is None:
                alike = (k for k, name in enumerate(names) if k not in taken and channel.is_called(name))
                place = min(alike, key=lambda k: of_set_value(names[k]), default=None)
            elif signal not in self.named:
                continue
            if place is None:
                parts.append(f"{signal}=NAME:{unit or 1}")
                continue
            taken.add(place)
            parts.append(f"{signal}={typed(names, place)}:{unit_in(names[place], unit) or unit or 1}")
        text = ",".join(parts)
        return text if re.fullmatch(r"[\w=:,.\-]+", text, re.ASCII) else f"'{text}'"


class MissingColumnError(PvidError):
    """A file has no column for a signal; `names` are those of its columns."""

    def __init__(self, sentence: str, names: tuple[str, ...]) -> None:
        super().__init__(sentence)
        self.names = names


def parsed(text: str | None, channels: tuple[Channel, ...]) -> Columns:
    """Columns of the text of --columns, or of their own names; see `Columns.parse`."""
    return Columns(channels) if text is None else Columns.parse(text, channels)


def _column(signal: str, name: str, si: str, text: str) -> Column:
    """With a typed unit: `deg`, `-mm`, `rev/4096`, `rev/min`, `3.8e-4`, `12/255`."""
    turned = text.startswith("-")
    unit, slash, count = text.removeprefix("-").strip(), "", ""
    scale = _scale(si, unit)
    if scale is None:
        unit, slash, count = unit.rpartition("/")
        scale = _scale(si, unit)
    try:
        divisor = float(count) if slash else 1.0
    except ValueError:
        divisor = math.nan
    if scale is None or not (math.isfinite(divisor) and divisor > 0.0 and math.isfinite(scale.divisor * divisor)):
        raise PvidError(
            f"--columns: {shown(text)} is no unit of {signal}; "
            f"it is {', '.join(usual(si))} or a number of {si or '1'}, as in {signal}=NAME:0.001"
        )
    if scale.offset and (turned or slash):
        raise PvidError(f"--columns: {shown(text)}: {unit} has an offset, and takes no sign and no divisor")
    return Column(name, -scale.factor if turned else scale.factor, scale.divisor * divisor, scale.offset, True)


def _scale(si: str, text: str) -> Scale | None:
    """Of a unit, or of a positive number."""
    known = scale_to(si, text) if text else None
    if known is not None:
        return known
    try:
        number = float(text)
    except ValueError:
        return None
    return Scale(number) if math.isfinite(number) and number > 0.0 else None


def typed(names: Sequence[str], k: int) -> str:
    """A column as --columns names it: its name, in double quotes where this has a comma or a colon; its position from 1
    where this is no name that can be typed, or long."""
    name = names[k]
    can_be_typed = name.isprintable() and not set(name) & set("='\"") and len(name) <= _LONG
    if not can_be_typed or names.count(name) > 1 or name.isdecimal():
        return str(k + 1)
    return f'"{name}"' if set(name) & set(",:") else name


def unit_in(name: str, si: str) -> str | None:
    """The unit at the end of a column's name: `angle_deg`, `h (mm)`, `time[ms]`."""
    match = _UNIT_AT_END.search(name)
    if match is None:
        return None
    unit = spelled(match["unit"])
    return unit if scale_to(si, unit) is not None else None


def unit_in_name(name: str, signal: str, si: str) -> str:
    """The unit that a column's name states beyond doubt for a signal in an SI unit: in brackets (of any dimension),
    behind a sign, or at its end (`angle_deg`, but not `x_in`, nor in the signal's own name: `elbow_rev`); "" where
    there is none."""
    if (found := unit_in_brackets(name)) or name == signal:
        return found
    behind = _BEHIND_SIGN.search(name)
    if behind is not None and scale_to(si, behind["unit"]) is not None:
        return behind["unit"]
    at_end = unit_in(name, si) or ""
    return at_end if at_end.lower() not in ALSO_WORDS or (si, at_end) == ("s", "min") else ""


def unit_in_brackets(name: str) -> str:
    """The unit at the end of a column's name: `h (mm)`, `time [ms]`; "" where there is none."""
    match = _IN_BRACKETS.search(name)
    return match["unit"] if match is not None and match["unit"] != "1" and is_unit(match["unit"]) else ""  # not x[1]
