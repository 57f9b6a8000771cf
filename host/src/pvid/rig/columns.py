"""Which columns of a file are t and the signals, and in which units: `t=time_ms:ms,phi=angle_deg:deg,y=h:mm`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import shown
from pvid.models.model import Channel
from pvid.models.registry import DEFAULT, MODELS

FloatArray = npt.NDArray[np.float64]

_TIME = Channel("t", "s", "time", usual_names=r"^t$|^t[^a-z]|time|zeit|temps|tiempo|stamp|clock|millis|micros|^sec")

# (factor, divisor) to SI. A divisor gives the same bits as the decimal number in SI has: 7 ms / 1000 = 0.007 s.
_UNITS_OF: dict[str, dict[str, tuple[float, float]]] = {
    "s": {"s": (1.0, 1.0), "ms": (1.0, 1e3), "us": (1.0, 1e6), "ns": (1.0, 1e9), "min": (60.0, 1.0)},
    "rad": {
        "rad": (1.0, 1.0),
        "mrad": (1.0, 1e3),
        "deg": (math.pi, 180.0),
        "rev": (2.0 * math.pi, 1.0),
        "turn": (2.0 * math.pi, 1.0),
    },
    "m": {"m": (1.0, 1.0), "cm": (1.0, 1e2), "mm": (1.0, 1e3), "um": (1.0, 1e6), "in": (0.0254, 1.0)},
}
_PREFIXED = ("A", "V", "N", "W", "Hz", "Pa")  # units with the usual prefixes
_SAME = {"µs": "us", "μs": "us", "µm": "um", "μm": "um", "°": "deg", "turns": "turn", "revs": "rev", "sec": "s"}

_UNIT_AT_END = re.compile(r"(?:^|[\s_.\-/(\[])(?P<unit>[a-zµμ°]+)[)\]]?\s*$", re.I)


@dataclass(frozen=True)
class Column:
    """A column of a file, and what one unit of it is in SI: factor/divisor."""

    name: str
    factor: float = 1.0
    divisor: float = 1.0

    def in_si(self, values: FloatArray) -> FloatArray:
        """Numbers of the file [n] in s, rad or m [n]; the same array where the file is in SI."""
        if self.factor != 1.0:
            values = values * self.factor
        return values if self.divisor == 1.0 else values / self.divisor


@dataclass(frozen=True)
class Columns:
    """Where a file holds the signals; a signal that is not named is a column of its own name, in SI.

    Attributes
    ----------
    named : by signal
    channels : the signals to find, without the time; those of the pendulum unless given
    """

    named: Mapping[str, Column] = field(default_factory=lambda: MappingProxyType({}))
    channels: tuple[Channel, ...] = MODELS[DEFAULT].channels

    @property
    def units(self) -> dict[str, str]:
        """In SI, by signal: that of the time first."""
        return {one.name: one.unit for one in (_TIME, *self.channels)}

    @property
    def held(self) -> frozenset[str]:
        """Inputs that keep each value until the next one."""
        return frozenset(one.name for one in self.channels if one.held)

    def __getitem__(self, signal: str) -> Column:
        return self.named.get(signal, Column(signal))

    @classmethod
    def parse(cls, text: str, channels: tuple[Channel, ...] = MODELS[DEFAULT].channels) -> Columns:
        """Reads `SIGNAL=COLUMN[:UNIT],...`.

        COLUMN is a name in the file's header or a number, 1 for the first column. UNIT is s, ms, us, ns, min; rad,
        mrad, deg, rev, turn; m, cm, mm, um, in; or a number of SI units. A minus sign in front of it turns the sign,
        `/N` behind it divides: `rev/4096` for counts of an encoder, `-mm` for a height that grows downwards.

        Raises
        ------
        PvidError
            When the text is none, naming the part.
        """
        named: dict[str, Column] = {}
        units = cls(channels=channels).units
        for part in text.split(","):
            signal, equals, rest = part.partition("=")
            signal = signal.strip()
            name, colon, unit = rest.rpartition(":")
            if not colon:
                name, unit = rest, units.get(signal, "")
            if not equals or not name.strip() or not unit.strip():
                raise PvidError(
                    f"--columns: {shown(part)} is not SIGNAL=COLUMN:UNIT, as in t=time_ms:ms,phi=angle_deg:deg,y=h:mm"
                )
            if signal not in units:
                raise PvidError(f"--columns: {shown(signal)} is no signal; the signals are {', '.join(units)}")
            if signal in named:
                raise PvidError(f"--columns: {signal} is given twice")
            factor, divisor = _scale(signal, units[signal], unit.strip())
            named[signal] = Column(name.strip(), factor, divisor)
        return cls(MappingProxyType(named), channels)

    def places(self, path: Path, names: Sequence[str], where: str = "") -> dict[str, int]:
        """Index of each signal's column among the names of a file's columns.

        Raises
        ------
        PvidError
            When a column is missing or appears twice; the sentence lists the file's columns and how to name them.
        """
        places = {}
        for signal in self.units:
            name = self[signal].name
            times = names.count(name)
            if times > 1:
                raise PvidError(f"{path}{where}: column {shown(name)} appears {times} times.")
            if times == 1:
                places[signal] = names.index(name)
            elif signal in self.named and name.isdecimal() and 1 <= int(name) <= len(names):
                places[signal] = int(name) - 1
        missing = [signal for signal in self.units if signal not in places]
        if missing:
            units = self.units
            wanted = " and ".join(
                f"{shown(self[signal].name)} for {signal}" if signal in self.named else f"{signal} ({units[signal]})"
                for signal in missing
            )
            found = ", ".join(shown(name, 24) for name in names[:8]) + (", ..." if len(names) > 8 else "")
            raise PvidError(
                f"{path}{where}: no column {wanted} among {found or 'none'}: "
                f"use --columns {self._suggestion(names, places)}."
            )
        return places

    def _looks_like(self, signal: str, name: str) -> bool:
        """Whether people call the signal so."""
        usual = next(one.usual_names for one in (_TIME, *self.channels) if one.name == signal)
        return re.search(usual, name, re.I) is not None

    def _suggestion(self, names: Sequence[str], places: Mapping[str, int]) -> str:
        """The text for --columns that is likely to be meant; a signal whose column cannot be guessed is NAME."""
        taken = set(places.values())
        parts = []
        numbered = list(names) == [str(k + 1) for k in range(len(names))]  # the file has no names
        for order, (signal, unit) in enumerate(self.units.items()):
            place: int | None = places.get(signal)
            if place is None and numbered and order < len(names):
                place = order
            elif place is None:
                alike = (k for k, name in enumerate(names) if k not in taken and self._looks_like(signal, name))
                place = next(alike, None)
            elif signal not in self.named:
                continue
            if place is None:
                parts.append(f"{signal}=NAME:{unit}")
                continue
            taken.add(place)
            name = names[place]
            plain = name.isprintable() and len(name) <= 24 and not set(name) & set(",:='\"")
            parts.append(f"{signal}={name if plain else place + 1}:{_unit_in(name, unit) or unit}")
        text = ",".join(parts)
        return text if re.fullmatch(r"[\w=:,.\-]+", text, re.ASCII) else f"'{text}'"


def parsed(text: str | None, channels: tuple[Channel, ...] = MODELS[DEFAULT].channels) -> Columns:
    """Columns of the text of --columns, or of their own names; see `Columns.parse`."""
    return Columns(channels=channels) if text is None else Columns.parse(text, channels)


def _units(unit: str) -> dict[str, tuple[float, float]]:
    """Units of the same kind as one of SI; without a table only that one."""
    prefixed = {f"k{unit}": (1e3, 1.0), f"m{unit}": (1.0, 1e3), f"u{unit}": (1.0, 1e6)} if unit in _PREFIXED else {}
    return _UNITS_OF.get(unit, {unit: (1.0, 1.0), **prefixed})


def _scale(signal: str, si: str, text: str) -> tuple[float, float]:
    """Factor and divisor of a unit: `deg`, `-mm`, `rev/4096`, `3.8e-4`."""
    unit, slash, count = text.partition("/")
    turned = unit.startswith("-")
    unit = unit.removeprefix("-").strip()
    known = _units(si).get(_SAME.get(unit, unit))
    try:
        factor, divisor = known if known is not None else (float(unit), 1.0)
        divisor *= float(count) if slash else 1.0
    except ValueError:
        factor = divisor = math.nan
    if not (math.isfinite(factor) and factor > 0.0 and math.isfinite(divisor) and divisor > 0.0):
        raise PvidError(
            f"--columns: {shown(text)} is no unit of {signal}; "
            f"it is {', '.join(_units(si))} or a number of {si or '1'}, as in {signal}=NAME:0.001"
        )
    return (-factor if turned else factor), divisor


def _unit_in(name: str, si: str) -> str | None:
    """The unit at the end of a column's name: `angle_deg`, `h (mm)`, `time[ms]`."""
    match = _UNIT_AT_END.search(name)
    if match is None:
        return None
    unit = _SAME.get(match["unit"], match["unit"].lower())
    return unit if unit in _units(si) else None
