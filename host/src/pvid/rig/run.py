"""Recorded runs on disk: text tables, arrays, workbooks and messages, with every check a stranger's file needs.

A recording has the column ``t`` [s] and one for each signal of its mechanism, in any order and among others; `Columns`
maps other names and units. Jumps of a whole turn are joined (`turns`), its clock is made uniform (`clock`) and short
gaps are interpolated (`gaps`). `Recording.notes` lists the corrections; a recording that needs none keeps every bit. A
fault of a file raises a `PvidError` of one sentence with the file and, if known, the line and the column.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.wording import listed, reason
from pvid.rig.array_table import read_arrow, read_npz, read_parquet, table_of, write_npz, write_parquet
from pvid.rig.clock import Uniform, uniform
from pvid.rig.columns import Channel, Columns
from pvid.rig.csv_table import read_csv, write_csv, write_csv_gz
from pvid.rig.excel_table import read_excel
from pvid.rig.gaps import (
    SLOW_GAP,
    bridge,
    bridge_held,
    holds_changes,
    last_values,
    longest_bridged,
    longest_stretch,
    spread,
    stretches,
    ticks_between,
)
from pvid.rig.json_table import read_json
from pvid.rig.mcap_table import read_mcap
from pvid.rig.octave_table import is_octave, read_octave
from pvid.rig.stamps import in_seconds
from pvid.rig.table import Table, called, row_place
from pvid.rig.text_lines import is_text
from pvid.rig.tree_table import read_hdf5, read_matlab, read_netcdf
from pvid.rig.turns import counted_on, joined

FloatArray = npt.NDArray[np.float64]
Function = TypeVar("Function")

# The shortest finite difference of order 4 takes 5 samples: fewer feed no form of the identifier.
MIN_ROWS = 5

LONG_BLANK_ROWS = 20  # in a column of an input's changes

_LARGEST = 1e12  # [rad] or [m]: counts of 40 bits


# Of a recording that is made of several (pvid.rig.together): the number of each sample's own; no signal has this name.
NUMBER = "#recording"


@dataclass(frozen=True)
class Origin:
    """One of several recordings that are identified together: its name, its first sample and its last + 1."""

    name: str
    first: int
    end: int


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals of any mechanism on a common, uniform clock.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s].
    signals : of each name an ndarray, shape (n,)
        In SI; NaN at a tick without a sample.
    sample_rate : float
        [Hz].
    notes : tuple of str
        What was done to the recording, a sentence each; empty when it is as recorded.
    ticks_between : by name
        Mean ticks from sample to sample of a sensor that is slower than the clock: it is interpolated.
    origins : tuple of Origin
        Of several recordings, one behind the other with missing ticks between them; empty of a single one.
    """

    t: FloatArray
    signals: Mapping[str, FloatArray]
    sample_rate: float
    notes: tuple[str, ...] = ()
    ticks_between: Mapping[str, float] = field(default_factory=dict)
    origins: tuple[Origin, ...] = ()

    def __len__(self) -> int:
        return int(self.t.size)

    @property
    def run(self) -> Mapping[str, FloatArray]:
        """The signals; of several recordings with the number of each sample's own, 0 and up, under `NUMBER`."""
        if not self.origins:
            return self.signals
        begins = [one.first for one in self.origins]
        number = np.searchsorted(begins, np.arange(self.t.size), side="right") - 1
        return {**self.signals, NUMBER: number.astype(np.float64)}

    def refuse_damaged(self) -> None:
        """Refuses numbers that no unit explains, and that overflow what is computed with them.

        Raises PvidError naming the first.
        """
        for name, values in self.signals.items():
            beyond = np.abs(values) > _LARGEST
            if beyond.any():
                at = int(np.argmax(beyond))
                raise PvidError(
                    f"{name} is {values[at]:g} at {self.t[at]:.6g} s, which is too large for any unit: "
                    "is the file damaged?"
                )

    @property
    def segments(self) -> tuple[slice, ...]:
        """Stretches without a missing tick."""
        there = np.logical_and.reduce([np.isfinite(one) for one in self.signals.values()])
        return tuple(slice(first, end) for first, end in zip(*(one.tolist() for one in stretches(there)), strict=True))

    def whole(self) -> Recording:
        """The longest stretch without a missing tick, for what cannot leave ticks out; itself when none is missing.

        Raises PvidError when no stretch has `MIN_ROWS` samples.
        """
        there = np.logical_and.reduce([np.isfinite(one) for one in self.signals.values()])
        if there.all():
            return self
        part = longest_stretch(there)
        if part.stop - part.start < MIN_ROWS:
            raise PvidError(f"the run has no {MIN_ROWS} samples in a row")
        t = self.t[part]
        note = f"used is the longest stretch without a gap: {t[0]:.6g} s to {t[-1]:.6g} s"
        signals = {name: one[part] for name, one in self.signals.items()}
        own = [one.name for one in self.origins if one.first <= part.start < one.end]
        note += f", of {own[0]}" if own else ""
        return replace(self, t=t, signals=signals, notes=(*self.notes, note), origins=())


def read_recording(path: str | os.PathLike[str], rate: float | None, columns: Columns) -> Recording:
    """Read a text table of any suffix, ``.npz``, ``.parquet``, ``.arrow``, ``.mat``, ``.h5``, ``.xlsx`` or ``.mcap``.

    Raises PvidError for anything that is wrong with the file and cannot be bridged.

    Parameters
    ----------
    path : path
    rate : float or None
        The sample rate the rig file promises [Hz].
    columns : Columns
        Which columns are t and the signals, and their units.
    """
    if rate is not None and not 0 < rate < float("inf"):
        raise PvidError(f"The sample rate must be a positive number of Hz, not {rate:g}.")
    return recording_of_table(read_table(Path(path), columns), rate)


def read_table(path: Path, columns: Columns) -> Table:
    """The wanted columns of a file, before their clock is looked at; see `read_recording`."""
    try:
        if path.is_dir():
            raise PvidError(f"{path} is a directory, not a recorded run: name its files, or use pvid batch.")
        if not path.exists():
            raise PvidError(f"{path} does not exist.")
        if not path.is_file():
            raise PvidError(f"{path} is not a regular file.")
        return _forward(in_seconds(_read_as(path)(path, columns)))
    except (OSError, ValueError) as error:
        raise PvidError(f"{path} cannot be read: {reason(error)}.") from error
    except MemoryError as error:
        raise PvidError(f"{path} does not fit into memory.") from error


def recording_of_table(table: Table, rate: float | None) -> Recording:
    """The signals of a table on one uniform clock, with the checks and corrections of `read_recording`."""
    return _recording(_checked(table), rate)


def recording_of_arrays(
    named: Mapping[str, npt.ArrayLike], rate: float | None, columns: Columns, name: str = "the data"
) -> Recording:
    """A recording of arrays by name, with the checks and corrections that a file gets.

    Raises PvidError for anything that is wrong with the data and cannot be bridged.

    Parameters
    ----------
    named : of each column an array-like, shape (n,)
    rate, columns : see `read_recording`
    name : of the data, in a refusal
    """
    names = [str(one) for one in named]
    arrays = dict(zip(names, named.values(), strict=True))
    table = table_of(Path(name), names, arrays.__getitem__, columns)
    return _recording(_checked(_forward(in_seconds(table, days=False))), rate)


def write_recording(path: str | os.PathLike[str], recording: Recording, channels: tuple[Channel, ...]) -> None:
    """Write a recording; the suffix gives the format, and `read_recording` gives every float64 back exactly.

    The file appears whole or not at all (temporary file, then rename), and the same recording gives the same bytes.

    Raises PvidError when `read_recording` would not give it back, or the file cannot be written.
    """
    path = Path(path)
    write = _format(path, _WRITERS)
    named = {"t": recording.t, **recording.signals}
    for name, data in named.items():
        if not np.isfinite(data).all():
            row = int(np.argmin(np.isfinite(data)))
            raise PvidError(f"{path} is not written: {row_place(row)}, column {name}: {data[row]} is no number.")
    table = Table(path, recording.t, recording.signals, Columns(channels), row_place)
    again = _recording(_checked(table), recording.sample_rate)
    if again.notes:
        raise PvidError(f"{path} is not written: {again.notes[0]}.")
    content = write(path, named)
    try:
        write_whole(path, content)
    except OSError as error:
        raise PvidError(f"{path} cannot be written: {reason(error)}.") from error


def is_run(path: Path) -> bool:
    """Whether a file's name is that of a recorded run."""
    return path.name.lower().endswith(tuple(_READERS))


def _forward(table: Table) -> Table:
    """With the first row in front of a table that begins with the last one."""
    last = table.t.size - 1
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.diff(table.t)
    if not steps.size or not (steps <= 0).all() or not table.t[0] > table.t[-1]:
        return table
    return table.rows(slice(None, None, -1), lambda row: table.place(last - row), "the last row comes first: turned")


def _checked(table: Table) -> Table:
    """The rows in which every signal has begun and none has ended, held inputs with the values that they keep; refused
    when there are too few numbers, or one is infinite."""
    for signal, data in {"t": table.t, **table.signals}.items():
        if np.isinf(data).any():
            row = int(np.argmax(np.isinf(data)))
            raise table.error(row, signal, f"{data[row]} is not a finite number")
    table = table.with_merged_rows()
    rows = table.t.size
    places = {name: np.flatnonzero(np.isfinite(one)) for name, one in table.signals.items()}
    for name, own in places.items():
        if own.size < (1 if name in table.columns.held and rows >= MIN_ROWS else MIN_ROWS):
            if all(one.size == own.size for one in places.values()):
                raise PvidError(f"{table.path} has {own.size} rows of data; a run needs at least {MIN_ROWS}.")
            raise PvidError(
                f"{table.path}, column {table.columns[name].name}: it has {own.size} numbers; a run needs at least "
                f"{MIN_ROWS}."
            )
    table = _with_kept_values(table)
    first = max(int(own[0]) for own in places.values())
    last = min(int(own[-1]) if name not in table.kept else rows - 1 for name, own in places.items())
    if last - first + 1 < MIN_ROWS:
        raise PvidError(f"{table.path} has {max(last - first + 1, 0)} rows of data; a run needs at least {MIN_ROWS}.")
    if not np.isfinite(table.t[first : last + 1]).all():
        row = first + int(np.argmin(np.isfinite(table.t[first : last + 1])))
        raise table.error(row, "t", f"the cell is empty or nan, and only {listed(table.signals)} may be missing")
    if (first, last) == (0, rows - 1):
        return table
    note = f"rows without numbers at the ends, left out: {rows - (last + 1 - first)}"
    return table.rows(slice(first, last + 1), lambda row: table.place(row + first), note)


def _with_kept_values(table: Table) -> Table:
    """A held input of which a table contains the changes alone has its last value in the blank cells."""
    kept, notes = {}, []
    for name in table.columns.held.intersection(table.signals):
        values = table.signals[name]
        blank = int(np.count_nonzero(np.isnan(values)))
        if blank and holds_changes(values, LONG_BLANK_ROWS):
            kept[name] = last_values(values)
            notes.append(f"{table.columns[name].name} is blank where it does not change: {blank} cells keep its value")
    if not kept:
        return table
    return replace(table, signals={**table.signals, **kept}, notes=(*table.notes, *sorted(notes)), kept=frozenset(kept))


def _recording(table: Table, rate: float | None) -> Recording:
    angles = [name for name, unit in table.columns.units.items() if unit == "rad"]
    for angle in angles:
        values, jumps = joined(table.signals[angle])
        if jumps:
            name = table.columns[angle].name
            note = f"{name} jumps by a turn, {jumps} times: joined (the encoder starts over there)"
            table = replace(table, signals={**table.signals, angle: values}, notes=(*table.notes, note))
    table = _counted_on(table)
    clocked = uniform(table, rate)
    return _bridged(clocked, table)


def _counted_on(table: Table) -> Table:
    """Angles and lengths without the jumps of counters that start over at any modulus."""
    for name, unit in table.columns.units.items():
        if unit not in ("rad", "m") or name in table.columns.held:
            continue
        column = table.columns[name]
        count = abs(float(column.in_si(np.ones(1))[0]))
        found = counted_on(table.signals[name], count)
        if found is not None:
            times = "once" if found.jumps == 1 else f"{found.jumps} times"
            note = f"{column.name} starts over after {found.modulus / count:.10g}, {times}: joined (a counter)"
            table = replace(table, signals={**table.signals, name: found.values}, notes=(*table.notes, note))
    return table


def _bridged(clocked: Uniform, table: Table) -> Recording:
    """The recording with the gaps of each signal filled that can be, NaN in all signals where one stays missing."""
    rate, slow = clocked.sample_rate, dict(clocked.ticks_between)
    signals, notes = dict(clocked.signals), list(clocked.notes)
    gaps: dict[tuple[bytes, bytes], list[str]] = {}
    for name, recorded in clocked.signals.items():
        if not np.isnan(recorded).any():
            continue
        signal = signals[name] = recorded.copy()
        held = name in table.columns.held
        between = 1.0 if held else ticks_between(signal)
        if between > 1:
            places = np.flatnonzero(np.isfinite(signal)).astype(np.float64)
            longest = max(SLOW_GAP * between, longest_bridged(rate))
            signal[:] = spread(places, recorded[np.isfinite(recorded)], np.arange(float(signal.size)), longest)
            slow[name] = between
            column = table.columns[name].name
            notes.append(f"{column} has a sample every {between:.3g} ticks: interpolated at {rate:g} Hz by splines")
        firsts, ends = (bridge_held if held else bridge)(signal, rate)
        if firsts.size:
            gaps.setdefault((firsts.tobytes(), ends.tobytes()), []).append(name)
    for (firsts_of, ends_of), names in gaps.items():
        firsts, ends = np.frombuffer(firsts_of, np.int64), np.frombuffer(ends_of, np.int64)
        own = "" if len(names) == len(signals) else f" of {called([table.columns[one].name for one in names])}"
        filled = np.logical_and.reduce([np.isfinite(signals[name][firsts]) for name in names])
        notes += _gap_notes(clocked, own, firsts, ends, filled)
    whole = np.logical_and.reduce([np.isfinite(one) for one in signals.values()])
    if whole.all():
        return Recording(clocked.t, signals, rate, tuple(notes), slow)
    if not whole.any():
        raise PvidError(f"{table.path}: no row has numbers of {table.called()} at the same time.")
    part = slice(int(np.argmax(whole)), whole.size - int(np.argmax(whole[::-1])))
    common = {name: np.where(whole, one, np.nan)[part] for name, one in signals.items()}
    return Recording(clocked.t[part], common, rate, tuple(notes), slow)


def _gap_notes(
    clocked: Uniform, of: str, firsts: npt.NDArray[np.int64], ends: npt.NDArray[np.int64], filled: npt.NDArray[np.bool_]
) -> list[str]:
    lengths = ends - firsts
    rate = clocked.sample_rate
    notes = []
    for chosen, done in (
        (filled, "interpolated"),
        (~filled, "which cannot be interpolated: the identifier starts its windows again behind each"),
    ):
        if chosen.any():
            count = int(np.count_nonzero(chosen))
            samples = int(lengths[chosen].sum())
            at = float(clocked.t[firsts[chosen][0]])
            longest = float(lengths[chosen].max()) / rate
            notes.append(
                f"missing samples{of}: {samples} of {clocked.t.size}, in {count} gap{'s' if count > 1 else ''} (first "
                f"at {at:.6g} s, longest {longest:.3g} s), {done}"
            )
    return notes


_TEXT = (".csv", ".tsv", ".txt", ".dat", ".asc", ".prn", ".tab", ".lvm")
_READERS: dict[str, Callable[[Path, Columns], Table]] = {
    **{f"{suffix}{zipped}": read_csv for suffix in _TEXT for zipped in ("", ".gz")},
    ".npz": read_npz,
    ".parquet": read_parquet,
    **dict.fromkeys((".feather", ".arrow"), read_arrow),
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), read_json),
    ".mat": read_matlab,
    **dict.fromkeys((".h5", ".hdf5"), read_hdf5),
    ".nc": read_netcdf,
    **dict.fromkeys((".xlsx", ".xlsm"), read_excel),
    ".mcap": read_mcap,
}
SUFFIXES = tuple(_READERS)
# How other kinds of files become one of these.
_CONVERTED = {
    ".bag": "ROS 1: `mcap convert RUN.bag RUN.mcap`",
    ".db3": "ROS 2: `ros2 bag convert` to the storage mcap",
    ".ulg": "PX4: `ulog2csv RUN.ulg` of the Python package pyulog",
    ".bin": "ArduPilot: `mavlogdump.py --format csv --types TYPE RUN.BIN` of the Python package pymavlink",
    ".wpilog": "WPILib: export it as CSV in AdvantageScope",
    ".tdms": "LabVIEW: `TdmsFile.read(RUN).as_dataframe().to_csv(CSV)` of the Python package npTDMS",
    ".mf4": "ASAM MDF: `MDF(RUN).export('csv', CSV)` of the Python package asammdf",
    ".blf": "CAN: export the decoded signals as CSV",
    ".xls": "save it as .xlsx",
    ".ods": "save it as .xlsx",
    ".npy": "numpy.savez('RUN.npz', t=..., and an array for each signal)",
    **dict.fromkeys((".pkl", ".pickle"), "write the data frame with to_parquet or to_csv"),
    ".wav": "sound: `scipy.io.wavfile.read(RUN)` has the rate and the samples; write them with a column of times",
    ".raw": "LTspice: export the traces as text",
    ".tar": "unpack it",
    ".7z": "unpack it",
}
_WRITERS: dict[str, Callable[[Path, dict[str, FloatArray]], bytes]] = {
    ".csv": write_csv,
    ".csv.gz": write_csv_gz,
    ".npz": write_npz,
    ".parquet": write_parquet,
}


def _read_as(path: Path) -> Callable[[Path, Columns], Table]:
    """The reader of a file: that of its suffix, and that of text tables for text with another one."""
    if path.is_file() and is_octave(path):
        return read_octave
    if path.is_file() and not is_run(path) and path.suffix.lower() not in _CONVERTED and is_text(path):
        return read_csv
    return _format(path, _READERS)


def _format(path: Path, formats: Mapping[str, Function]) -> Function:
    for suffix, function in formats.items():
        if path.name.lower().endswith(suffix):
            return function
    suffix = path.suffix.lower()
    how = f"; {_CONVERTED[suffix]}" if suffix in _CONVERTED else ""
    shown = [one for one in formats if not one.endswith(".gz")]
    raise PvidError(f"{path} has no name of a run: it must end in {listed(shown, 'or')}{how}.")
