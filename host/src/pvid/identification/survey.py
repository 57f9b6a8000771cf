"""What is in a file, without a mechanism: its columns as they are, their clock, and what each of them does."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.units import Scale, scale_to, spelled
from pvid.base.wording import typed_name
from pvid.identification.wild_samples import MOST_FAR, far_from_median
from pvid.models.mechanisms import described
from pvid.models.registry import most_specific
from pvid.models.registry import names as shipped_names
from pvid.rig.clock import unit_of_slow
from pvid.rig.columns import (
    ALSO_WORDS,
    TIME,
    Channel,
    Column,
    Columns,
    MissingColumnError,
    is_usual,
    of_set_value,
    typed,
    unit_in,
    unit_in_brackets,
)
from pvid.rig.gaps import at_its_ends, holds_changes
from pvid.rig.mechanism_file import channels_of
from pvid.rig.run import LONG_BLANK_ROWS, MIN_ROWS, Recording, read_table, recording_of_table
from pvid.rig.sensor_steps import resolution_of
from pvid.rig.table import Table
from pvid.rig.turns import counted_on

Float = npt.NDArray[np.float64]

_NOBODYS_NAME = "\0"  # what no header contains
_HELD_SHARE = 0.1  # a column that keeps its value from row to row but in so few is set, not measured
_ONE_STEP = 1.5  # of the smallest change
_HELD_SAMPLES = 4  # for which a set value stays, at least
_FEW_LEVELS = 12
_FAR_AT_ONCE = 0.2  # of its range: a coarse sensor of a slow motion moves by a step
_CLIPPED_SAMPLES, _CLIPPED_STRETCHES = 3, 2  # in a row at the end of the range, and how often
_ROUNDED = 4  # of the samples at the next value: the top of a smooth motion in steps of a sensor has up to 2.5 times
_AT_THE_END = 0.98  # share of the other stretches of equal samples, in which a clipped one is longer
_IRREGULAR = 0.3  # scatter of the blank stretches, of their mean
_EVEN = 0.1  # scatter of the steps from row to row, of their mean
_BLANK = 0.9  # share of the rows in which what is set is blank
_BETWEEN = 0.01  # of the samples in the middle of the range: a counter passes it, what is switched does not
_OF_MOTION = 0.99  # share of a signal's power
_SPECTRUM = 1 << 17  # samples
_SI = ("rad", "m", "s", "rad/s", "m/s", "V", "A", "N", "N*m", "K", "Hz", "W", "Pa", "kg", "m/s^2", "rad/s^2")
_OFTEN_OTHER = {"rad/s": ("rpm", 0.0), "rad": ("deg", 3.2)}  # another usual unit, and numbers above which it can be
_PHASES = {"V": "UW", "A": "BC"}  # of a machine, by letters that are also units
_COUNTS = re.compile("count|pulse|tick|enc", re.I)
_NO_NUMBERS = re.compile(r" has 0 rows of data|('.*') is not a number; (\d+) of \2 lines")


@dataclass(frozen=True)
class ColumnFacts:
    """One column, in the numbers of the file.

    Attributes
    ----------
    key : of its signal in the recording: its position from 1
    name, unit : as the file writes them; "": it states no unit
    low, high : ends of its range; NaN of a column without numbers
    step : between its values, where a sensor or a file gives whole steps
    reaches : frequency below which 99 % of its motion is [Hz]; None of a constant, or of what changes in steps
    remarks : sentences
    is_set : it keeps each value until the next one, as an input
    is_even : it rises by the same step from row to row, as a clock
    jumps : it is set and goes far at once, as no sensor of a mechanism's motion does
    """

    key: str
    name: str
    unit: str
    low: float
    high: float
    step: float | None
    reaches: float | None
    remarks: tuple[str, ...]
    is_set: bool = False
    is_even: bool = False
    jumps: bool = False


@dataclass(frozen=True, eq=False)
class Survey:
    """A file.

    Attributes
    ----------
    names : of its columns
    at : place of that of time, from 0
    time : what --columns is to say of t, "t" where it needs nothing
    recording : the columns of numbers on one clock, by position from 1
    facts : of the columns but for that of time
    """

    path: Path
    names: tuple[str, ...]
    at: int
    time: str
    recording: Recording
    facts: tuple[ColumnFacts, ...]


@dataclass(frozen=True)
class _AsWritten(Columns):
    """Columns whose numbers are left as they are, and that note the units which the file states, by signal."""

    stated: dict[str, str] = field(default_factory=dict)

    def in_units_of_file(self, units: Mapping[str, str]) -> tuple[Columns, tuple[str, ...]]:
        """See Columns; of the time as there."""
        self.stated.update({signal: spelled(unit) for signal, unit in units.items() if unit.strip()})
        return super().in_units_of_file({"t": units["t"]} if "t" in units else {})


def surveyed(path: str | os.PathLike[str]) -> Survey:
    """Looks at a file. Raises PvidError when it is no table, or none of its columns can be the time of another one."""
    path = Path(path)
    names = names_in(path)
    called = [k for k, name in enumerate(names) if TIME.is_called(name)]
    own = [names.index("t")] if names.count("t") == 1 else []
    refusal: PvidError | None = None
    for at in dict.fromkeys([*own, *called, 0]):  # without such a name it is the first, as instruments write it
        try:
            return _with_time(path, names, at)
        except PvidError as error:
            refusal = refusal or error
    assert refusal is not None
    raise refusal


def names_in(path: Path) -> tuple[str, ...]:
    """The names of a file's columns; positions from 1 where it has none. Raises PvidError when it is no table."""
    nobody = Columns((Channel(_NOBODYS_NAME, ""),))
    try:
        read_table(path, nobody)
    except MissingColumnError as missing:
        return missing.names
    raise AssertionError("a column of nobody's name")


def unit_of_name(name: str, names: Sequence[str] = ()) -> str:
    """The unit at the end of a column's name, where it is one beyond doubt: `angle_deg`, `h (mm)`; else "".

    names : of all columns: `ref_V` is in V unless there is a phase `ref_U`
    """
    sure = name.rstrip().endswith((")", "]"))
    sure |= not {name[:-1] + phase for phase in _PHASES.get(name[-1:], name[-1:])} & {*names, name}
    for si in _SI:
        found = unit_in(name, si)
        if found is None:
            continue
        of_its_signal = name.endswith(f"_{found}") and found.isupper() and is_usual(name, si)  # power_W, temp_C
        if sure or found.lower() not in ALSO_WORDS or of_its_signal:
            return found
    return ""


def _with_time(path: Path, names: tuple[str, ...], at: int) -> Survey:
    """With the column at this place as the time."""
    others = [k for k in range(len(names)) if k != at]
    read = _read(path, names, at, others)
    facts = []
    for k in others:
        key = str(k + 1)
        if key in read.unread:
            facts.append(ColumnFacts(key, names[k], "", np.nan, np.nan, None, None, (read.unread[key],)))
        else:
            unit = read.stated.get(key) or unit_of_name(names[k], names)
            facts.append(_facts_of(names[k], unit, read.table.signals[key], read.recording, key))
    time = f"t={typed(names, at)}" + (f":{read.time_unit}" if read.time_unit else "")
    return Survey(path, names, at, "t" if time == "t=t" else time, read.recording, tuple(facts))


@dataclass(frozen=True, eq=False)
class _Read:
    """Columns of numbers by their position from 1: as written, and on one clock; the units that the file states, and
    that of the time where the file does not; sentences on the columns that are not numbers."""

    table: Table
    recording: Recording
    stated: Mapping[str, str]
    time_unit: str
    unread: Mapping[str, str] = field(default_factory=dict)


def _read(path: Path, names: Sequence[str], at: int, others: Sequence[int]) -> _Read:
    def reading(which: Sequence[int]) -> _Read:
        channels = tuple(Channel(str(k + 1), "") for k in which)
        named = {str(k + 1): Column(_name_of(names, k)) for k in which} | {"t": Column(_name_of(names, at))}
        columns = _AsWritten(channels, named)
        table = read_table(path, columns)
        unit = "" if columns.stated.get("t") else unit_in(names[at], "s") or unit_of_slow(table.t)
        scale = scale_to("s", unit) if unit else None
        if scale is not None:
            table = replace(table, t=Column("", scale.factor, scale.divisor).in_si(table.t))
        held = frozenset(name for name, values in table.signals.items() if _has_changes_alone(values))
        channels = tuple(replace(one, held=one.name in held) for one in channels)
        clocked = replace(table, columns=replace(table.columns, channels=channels))
        return _Read(table, recording_of_table(clocked, None), columns.stated, unit)

    try:
        return reading(others)
    except PvidError as error:
        refusal = error
    unread: dict[str, str] = {}
    readable = []
    for k in others:
        try:
            reading([k])
            readable.append(k)
        except PvidError as error:
            unread[str(k + 1)] = _without_place(error, path, names[k])
    if not readable:
        raise refusal
    return replace(reading(readable), unread=unread)


def _name_of(names: Sequence[str], k: int) -> str:
    """As Column has it."""
    return typed(names, k).strip('"')


def _has_changes_alone(values: Float) -> bool:
    """Whether a column is blank where it keeps its value; a slow sensor is blank for short, regular times."""
    places = np.flatnonzero(np.isfinite(values))
    if places.size == values.size or not holds_changes(values, LONG_BLANK_ROWS):
        return False
    steps = np.diff(places)
    return not steps.size or bool(steps.mean() > LONG_BLANK_ROWS or steps.std() > _IRREGULAR * steps.mean())


def _without_place(error: PvidError, path: Path, name: str) -> str:
    """A refusal without the file and the column, which stand beside it."""
    if found := _NO_NUMBERS.search(str(error)):
        return "no numbers" + (f", as in {found[1]}" if found[1] else "")
    return str(error).replace(f"{path}, ", "").replace(f"column {name}: ", "").rstrip(".")


def _facts_of(name: str, unit: str, written: Float, recording: Recording, key: str) -> ColumnFacts:
    """Of a column [rows] and its signal on the clock."""
    x = written[np.isfinite(written)]
    low, high = float(x.min()), float(x.max())
    if low == high:
        return ColumnFacts(key, name, unit, low, high, None, None, ("never changes",))
    remarks = []
    signal = recording.signals[key]
    counter = counted_on(signal, 1.0)
    between = np.mean(np.abs(x - (low + high) / 2) < (high - low) / 4)
    if counter is not None and between > _BETWEEN:
        remarks.append(f"a counter: it starts over after {counter.modulus:.10g}")
        signal, x = counter.values, counter.values[np.isfinite(counter.values)]
    blank = 1 - len(x) / len(written)
    steps = np.diff(x)
    if np.ptp(steps) < _EVEN * abs(steps.mean()):
        even = ("rises evenly: a counter or a clock",)
        return ColumnFacts(key, name, unit, low, high, float(steps.mean()), None, even, is_even=True)
    changes = np.flatnonzero(steps)
    levels = len(np.unique(x))
    stays = np.median(np.diff(changes, append=len(x)))
    is_set = blank > _BLANK or (len(changes) < _HELD_SHARE * len(x) and stays >= _HELD_SAMPLES)
    if is_set:
        what = f"{levels} values" if levels <= _FEW_LEVELS else f"more than {_FEW_LEVELS} values"
        remarks.append(f"set, not measured: {what}, {len(changes)} changes")
        jumps = bool(np.abs(steps).max(initial=0.0) > _FAR_AT_ONCE * (high - low))
        return ColumnFacts(key, name, unit, low, high, None, None, tuple(remarks), is_set=True, jumps=jumps)
    there = signal[np.isfinite(signal)]
    sizes = np.abs(steps[changes])
    far = far_from_median(there, 0.0)
    if sizes.max() <= _ONE_STEP * sizes.min():
        far[:] = False  # a sensor between two of its steps
    if far.any() and far.mean() < MOST_FAR:
        values, times = np.unique(there[far], return_counts=True)
        usual = f"{values[np.argmax(times)]:.6g} {unit}".rstrip()
        remarks.append(f"{far.sum()} samples are far from those about them, most often {usual}")
        there = there[~far]
    remarks += _clipped(x, unit) if levels > 2 else ["has two values alone"]
    if blank > 0:
        remarks.append(f"{100 * blank:.2g} % of the rows have no number")
    step = resolution_of(x)
    if step == 1.0 and not unit and levels > _FEW_LEVELS:
        remarks.append("whole numbers: counts, of an encoder or a converter?")
    reaches = _reaches(there, recording.sample_rate)
    return ColumnFacts(key, name, unit, low, high, step, reaches, tuple(remarks))


def _clipped(x: Float, unit: str) -> list[str]:
    """A sensor that stands at an end of its range again and again, longer than it stands elsewhere."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(x)) + 1])
    lengths, held = np.diff(begins, append=len(x)), x[begins]
    found = []
    for end, word, firsts, ends in at_its_ends(x):
        own = ends - firsts
        elsewhere = lengths[held != end]
        usual = np.quantile(elsewhere, _AT_THE_END) if len(elsewhere) else np.inf
        long = own[(own >= _CLIPPED_SAMPLES) & (own > 2 * usual)]
        beside = x[x != end][np.argmin(np.abs(x[x != end] - end))]
        if len(long) >= _CLIPPED_STRETCHES and own.sum() > _ROUNDED * (x == beside).sum():
            value = f"{end:.6g} {unit}".rstrip()
            found.append(f"stands at its {word} value {value} in {len(long)} stretches: does it clip?")
    return found


def _reaches(x: Float, rate: float) -> float | None:
    """The frequency below which 99 % of the motion is that stands above the noise [Hz]."""
    x = x[:_SPECTRUM]
    n = len(x)
    if n < MIN_ROWS:
        return None
    t = np.linspace(-1, 1, n)
    x = x / np.abs(x).max()
    flat = x - np.polynomial.Polynomial.fit(t, x, 1)(t)
    power = np.abs(np.fft.rfft(flat * np.hanning(n))) ** 2
    noise = float(np.median(power[len(power) // 2 :]))
    motion = np.cumsum(np.maximum(power - 4 * noise, 0.0))
    if not motion[-1] > 0:
        return None
    return float(np.searchsorted(motion, _OF_MOTION * motion[-1]) * rate / n)


# ---- the mechanisms ----


@dataclass(frozen=True)
class Proposal:
    """A shipped mechanism that a file's columns can be of.

    Attributes
    ----------
    mechanism, title : its name, and what it is
    columns : text of --columns; "": the columns have the names of the signals
    constants : that its user must state, each with its unit
    used : names of columns
    doubts : a sentence on each column without a unit whose numbers can be in another one
    """

    mechanism: str
    title: str
    columns: str
    constants: tuple[tuple[str, str], ...]
    used: frozenset[str]
    doubts: tuple[str, ...] = ()

    def command(self, file: str) -> str:
        """What to type next; a constant that must be stated is VALUE there."""
        parts = [typed_name(), "identify", shlex.quote(file), "--model", self.mechanism]
        if self.columns:
            parts += ["--columns", self.columns]
        return " ".join([*parts, *(f"--set {name}=VALUE" for name, _ in self.constants)])


def proposals(survey: Survey) -> tuple[Proposal, ...]:
    """The shipped mechanisms with a column for each signal, by names and units; those that use most columns first.

    One that uses a part of another's columns is left out: the columns of a driven motor are also those of one that runs
    out.
    """
    stated = {one.name: one.unit for one in survey.facts if one.unit}
    measured = [one.name for one in survey.facts if one.low < one.high and not one.is_even]
    all_of = [one for name in shipped_names() if (one := _proposal(name, survey, measured, stated)) is not None]
    specific = most_specific({one.mechanism: one.used for one in all_of})
    found = [one for one in all_of if one.mechanism in specific]
    return tuple(sorted(found, key=lambda one: (bool(one.columns), -len(one.used), bool(one.constants))))


def _proposal(mechanism: str, survey: Survey, measured: Sequence[str], stated: Mapping[str, str]) -> Proposal | None:
    description = described(mechanism)
    own: dict[str, str] = {}
    jumping = {one.name for one in survey.facts if one.jumps}
    moving = {one.name for one in description.signals if one.kind == "sensor" and not one.driven}
    for channel in channels_of(description):
        unit = channel.unit
        free = [one for one in measured if one not in own.values() and _fits(stated.get(one), unit, channel.held)]
        free = [one for one in free if not (one in jumping and channel.name in moving)]
        same = [one for one in free if one == channel.name] or [one for one in free if channel.is_named(one)]
        alike = same or [one for one in free if channel.is_called(one)]
        alike = alike or [one for one in free if unit and stated.get(one)]
        if not alike:
            return None
        own[channel.name] = min(alike, key=of_set_value)
    units = {one.name: one.unit for one in channels_of(description)}
    sizes = {one.name: max(abs(one.low), abs(one.high)) for one in survey.facts}
    counts = {one.name for one in survey.facts if one.step == 1.0 and not one.unit}
    doubts: list[str] = []
    parts = [] if survey.time == "t" else [survey.time]
    for signal, name in own.items():
        unit = unit_in(name, units[signal]) or unit_of_name(name, survey.names)
        other_kind = not units[signal] and scale_to("", stated.get(name, "1")) is None
        if other_kind:
            unit = "1"
        elif units[signal] == "rad" and not unit and name in counts and _COUNTS.search(name):
            unit = "rev/N"
            doubts.append("with the number of counts of a turn in place of N")
        written = typed(survey.names, survey.names.index(name))
        in_si = not unit or scale_to(units[signal], unit) == Scale() and not other_kind
        other, largest = _OFTEN_OTHER.get(units[signal], ("", np.inf))
        if name not in stated and not unit and sizes[name] > largest:
            doubts.append(
                f"{name} states no unit: {units[signal]} is assumed; write {signal}={written}:{other} for {other}"
            )
        if name != signal or not in_si:
            is_stated = unit_in_brackets(name) and not other_kind
            parts.append(f"{signal}={written}" + ("" if in_si or is_stated else f":{unit}"))
    constants = tuple((one.name, one.unit) for one in description.knowns if one.required)
    columns = ",".join(parts)
    typed_columns = shlex.quote(columns) if columns else ""
    used = frozenset(own.values())
    return Proposal(mechanism, description.title, typed_columns, constants, used, tuple(doubts))


def _fits(unit: str | None, si: str, held: bool) -> bool:
    """Whether a column that states this unit can be a signal in an SI unit; a sensor without one may be anything."""
    return not unit or scale_to(si, unit) is not None or (not si and not held)


def lines_of_a_model(survey: Survey) -> tuple[str, ...]:
    """A line of a model file for each column that changes: inputs are those that are set."""
    lines = []
    for one in survey.facts:
        if not one.low < one.high or one.is_even:
            continue
        name = re.sub(r"\W+", "_", one.name).strip("_") or "x"
        name = f"x{name}" if name[0].isdigit() else name
        si = next((si for si in _SI if one.unit and scale_to(si, one.unit) is not None), "")
        line = (
            f"{name} = model.input({name!r}, {si!r}, hold='zoh')"
            if one.is_set
            else f"{name} = model.sensor({name!r}, {si!r})"
        )
        lines.append(line)
    return tuple(lines)
