"""Recorded runs on disk: CSV (plain or gzip), NPZ and Parquet, with every check a stranger's file needs.

A run has the columns ``t`` [s], ``phi`` [rad] and ``y`` [m], in any order, and may have more. ``t`` is
uniform: a gap is reported, never bridged. Whatever is wrong with a file is told in one sentence, as a
`PvidError`, that names the file and, where there is one, the line and the column.
"""

from __future__ import annotations

import contextlib
import csv
import gzip
import importlib
import io
import os
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.appearing import appearing
from pvid.errors import PvidError

FloatArray = npt.NDArray[np.float64]

REQUIRED = ("t", "phi", "y")
UNITS = {"t": "s", "phi": "rad", "y": "m"}

# The shortest finite difference of order 4 takes 5 samples: fewer feed no form of the identifier.
MIN_ROWS = 5
# A step of t longer than this many periods is a gap: a sample is missing.
_GAP_PERIODS = 1.5
# Largest departure of t from a uniform clock [periods]. On the standard rig at 1 kHz (phi' up to 1 rad/s) it
# is worth 1e-4 rad, half the encoder's noise, and it leaves room for time stamps with few decimals.
_JITTER_PERIODS = 0.1
# w is proportional to the square of the sample rate: 1e-4 costs 0.02 %, what a good run's standard error is.
_RATE_TOLERANCE = 1e-4
_RATE_RANGE_HZ = (1e-3, 1e9)

_COLUMN_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.\[\]^*+-]*")


@dataclass(frozen=True, eq=False)
class Run:
    """One recorded run: three signals on a common, uniform clock.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s].
    phi : ndarray, shape (n,)
        Measured relative angle [rad].
    y : ndarray, shape (n,)
        Measured height of the pivot [m].
    sample_rate : float
        [Hz].
    columns : mapping of str to ndarray, shape (n,)
        Whatever else was recorded.
    """

    t: FloatArray
    phi: FloatArray
    y: FloatArray
    sample_rate: float
    columns: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in REQUIRED:
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=np.float64))
        extra = {name: np.ascontiguousarray(data, dtype=np.float64) for name, data in self.columns.items()}
        object.__setattr__(self, "columns", extra)
        for name, data in self._named():
            if data.ndim != 1 or data.size != self.t.size:
                raise PvidError(f"A run's column {name} must hold one number a sample ({self.t.size}).")

    def __len__(self) -> int:
        return int(self.t.size)

    def _named(self) -> list[tuple[str, FloatArray]]:
        return [("t", self.t), ("phi", self.phi), ("y", self.y), *self.columns.items()]


@dataclass(frozen=True)
class _Table:
    """What a file held: named columns, and how to call the place of row k."""

    path: Path
    columns: dict[str, FloatArray]
    place: Callable[[int], str]

    def error(self, row: int, column: str, complaint: str) -> PvidError:
        return PvidError(f"{self.path}, {self.place(row)}, column {column}: {complaint}.")


def read_run(path: str | os.PathLike[str], rate: float | None = None) -> Run:
    """Read a run from ``.csv``, ``.csv.gz``, ``.npz`` or ``.parquet``.

    Columns other than t, phi and y are kept in `Run.columns` when they hold one number a row (an empty cell
    is NaN), and left out otherwise.

    Parameters
    ----------
    path : path
    rate : float, optional
        The sample rate the rig file promises [Hz]. It must agree with t within 1e-4 (relative), and is then
        the run's rate.

    Raises
    ------
    PvidError
        For anything that is wrong with the file.
    """
    path = Path(path)
    read = _format(path)[0]
    try:
        if path.is_dir():
            raise PvidError(f"{path} is a directory, not a recorded run.")
        if not path.exists():
            raise PvidError(f"{path} does not exist.")
        if not path.is_file():
            raise PvidError(f"{path} is not a regular file.")
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        raise PvidError(f"{path} cannot be read: {_reason(error)}.") from error
    if not content:
        raise PvidError(f"{path} is empty.")
    table = read(path, content)
    sample_rate = _check(table, rate)
    extra = {name: data for name, data in table.columns.items() if name not in REQUIRED}
    required = {name: table.columns[name] for name in REQUIRED}
    return Run(**required, sample_rate=sample_rate, columns=extra)


def write_run(path: str | os.PathLike[str], run: Run) -> None:
    """Write a run in the format its name asks for; `read_run` gives every float64 back exactly.

    The file appears whole or not at all (temporary file, then rename), and the same run gives the same bytes.

    Raises
    ------
    PvidError
        When the run is one that `read_run` would refuse, or the file cannot be written.
    """
    path = Path(path)
    write = _format(path)[1]
    named = dict(run._named())
    if len(named) != len(REQUIRED) + len(run.columns):
        raise PvidError(f"{path} is not written: a further column has the name t, phi or y.")
    for name in named:
        if not _COLUMN_NAME.fullmatch(name):
            raise PvidError(f"{path} is not written: {_shown(name)} is no name for a column.")
    _check(_Table(path, named, _row_place), run.sample_rate)
    content = write(path, named)
    try:
        with appearing(path) as temporary, temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise PvidError(f"{path} cannot be written: {_reason(error)}.") from error


# --- checks shared by all formats ---------------------------------------------------------------------------


def _check(table: _Table, rate: float | None) -> float:
    """Refuse what is no uniform, finite run; return its sample rate [Hz]."""
    if rate is not None and not 0 < rate < float("inf"):
        raise PvidError(f"The sample rate must be a positive number of Hz, not {rate:g}.")
    rows = table.columns["t"].size
    if rows < MIN_ROWS:
        raise PvidError(f"{table.path} has {rows} rows of data; a run needs at least {MIN_ROWS}.")
    for name in REQUIRED:
        data = table.columns[name]
        finite = np.isfinite(data)
        if not finite.all():
            row = int(np.argmin(finite))
            raise table.error(row, name, f"{data[row]} is not a finite number")
    with np.errstate(over="ignore", invalid="ignore"):  # times near the end of float64's range
        return _check_clock(table, rate)


def _check_clock(table: _Table, rate: float | None) -> float:
    t = table.columns["t"]
    steps = np.diff(t)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        what = "repeats" if steps[row - 1] == 0 else "runs back from"
        raise table.error(row, "t", f"{t[row]!s} s {what} the time before it, {t[row - 1]!s} s")
    period = float(np.median(steps))
    if (steps > _GAP_PERIODS * period).any():
        row = int(np.argmax(steps > _GAP_PERIODS * period)) + 1
        raise table.error(
            row,
            "t",
            f"a gap of {steps[row - 1]:.6g} s, {steps[row - 1] / period:.4g} periods, comes before it",
        )
    span = float(t[-1]) - float(t[0])
    measured = (t.size - 1) / span
    low, high = _RATE_RANGE_HZ
    if not low <= measured <= high:
        raise PvidError(
            f"{table.path}, column t: a sample rate of {measured:.6g} Hz is out of range (is t in seconds?)."
        )
    departure = np.abs((t - t[0]) * measured - np.arange(t.size))
    if departure.max() > _JITTER_PERIODS:
        row = int(np.argmax(departure))
        raise table.error(
            row,
            "t",
            f"the clock is not uniform, {t[row]!s} s is {departure[row]:.3g} periods off the others",
        )
    if rate is None:
        return _shortest_decimal(measured, 1e-9 + 4 * float(np.spacing(np.abs(t).max())) / span)
    # t is trusted only to within the jitter at each end.
    if not abs(measured / rate - 1) <= _RATE_TOLERANCE + 2 * _JITTER_PERIODS / (t.size - 1):
        raise PvidError(
            f"{table.path}, column t: the samples come at {measured:.6g} Hz, "
            f"but the rig's sample rate is {rate:.6g} Hz."
        )
    return float(rate)


def _shortest_decimal(value: float, tolerance: float) -> float:
    """The shortest number within a relative ``tolerance``: 1000 rather than 1000.0000000000001."""
    for digits in range(1, 17):
        candidate = float(f"{value:.{digits}g}")
        if abs(candidate - value) <= tolerance * value:
            return candidate
    return value


def _check_names(path: Path, names: list[str], where: str) -> None:
    """Refuse missing and repeated names; an empty name (a row index) may repeat, it is never kept."""
    for name, times in Counter(names).items():
        if name and times > 1:
            raise PvidError(f"{path}{where}: column {_shown(name)} appears {times} times.")
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        found = ", ".join(_shown(name) for name in names[:8]) + (", ..." if len(names) > 8 else "")
        wanted = " and ".join(f"{name} ({UNITS[name]})" for name in missing)
        raise PvidError(f"{path}{where}: no column {wanted} among {found or 'none'}.")


def _row_place(row: int) -> str:
    return f"row {row + 1}"


def _line_place(row: int) -> str:
    return f"line {row + 2}"  # line 1 is the header


def _shown(text: str) -> str:
    """``text`` quoted for a sentence, on one line and of bounded length."""
    return ascii(text if len(text) <= 40 else text[:37] + "...")


def _reason(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split()).rstrip(".")


# --- CSV ----------------------------------------------------------------------------------------------------


def _read_csv(path: Path, content: bytes) -> _Table:
    lines, terminated = _csv_lines(path, content)
    if not lines:
        raise PvidError(f"{path} is empty.")
    rows = _csv_rows(path, lines)
    header = [name.strip() for name in rows[0]]
    if len(header) == 1:
        for separator, called in ((";", "semicolons"), ("\t", "tabs")):
            if separator in lines[0]:
                raise PvidError(f"{path}, line 1: the columns are separated by {called}, not by commas.")
    if all(_is_number(name) for name in header):
        raise PvidError(f"{path}, line 1: a header (t,phi,y) is wanted, these are numbers.")
    _check_names(path, header, ", line 1")
    body = rows[1:]
    if not body:
        raise PvidError(f"{path} has a header but no data.")
    width = len(header)
    for row, cells in enumerate(body):
        if len(cells) != width:
            last = row == len(body) - 1 and len(cells) < width
            raise PvidError(
                f"{path}, {_line_place(row)}: {len(cells)} columns where the header has {width}"
                f"{' (the file may be truncated)' if last else ''}."
            )
    if not terminated and len(body) > 1:
        _check_last_cell(path, header[-1], [cells[-1].strip() for cells in body])
    columns = {}
    for name, column in zip(header, zip(*body, strict=True), strict=True):
        if name in REQUIRED:
            columns[name] = _csv_numbers(path, name, column)
        elif name:
            with contextlib.suppress(ValueError):
                columns[name] = _numbers(cell.strip() or "nan" for cell in column)
    return _Table(path, columns, _line_place)


def _csv_lines(path: Path, content: bytes) -> tuple[list[str], bool]:
    """Lines without their ends, trailing blank ones dropped, and whether the last one was ended."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise PvidError(f"{path} is UTF-16 text, where UTF-8 is wanted.")
    if b"\x00" in content:
        line = _line_of(content, content.index(b"\x00"))
        raise PvidError(f"{path}, line {line}: a zero byte, so this is not a text file.")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = _line_of(content, error.start)
        raise PvidError(f"{path}, line {line}: this is not UTF-8 text (byte {error.start}).") from error
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    terminated = not lines[-1].strip()
    while lines and not lines[-1].strip():
        lines.pop()
    return lines, terminated


def _line_of(content: bytes, position: int) -> int:
    return content.count(b"\n", 0, position) + 1


def _csv_rows(path: Path, lines: list[str]) -> list[list[str]]:
    """Cells of each line. One line is one row: a quoted cell may not run over a line's end."""
    rows = []
    for number, line in enumerate(lines, 1):
        if '"' in line:
            try:
                rows.append(next(csv.reader([line], strict=True)))
            except csv.Error as error:
                raise PvidError(f"{path}, line {number}: a malformed quoted cell ({_reason(error)}).") from error
        elif line and not line.isspace():
            rows.append(line.split(","))
        else:
            raise PvidError(f"{path}, line {number}: the line is empty.")
    return rows


def _check_last_cell(path: Path, name: str, cells: list[str]) -> None:
    """Refuse a file that stops in the middle of its last number.

    The last line may lack its end (RFC 4180). But a cell shorter than all others of its column is then taken
    for what was left of a number when the file was cut.
    """
    lengths = [len(cell.lstrip("+-")) for cell in cells]
    if lengths[-1] < min(lengths[:-1]):
        raise PvidError(
            f"{path}, line {len(cells) + 1}, column {name}: the file seems truncated, its last line has no "
            f"end and {_shown(cells[-1])} is shorter than every number before it (if it is whole, end the line)."
        )


def _csv_numbers(path: Path, name: str, cells: tuple[str, ...]) -> FloatArray:
    try:
        return _numbers(cells)
    except ValueError:
        row = next(row for row, cell in enumerate(cells) if not _is_number(cell))
        what = "the cell is empty" if not cells[row].strip() else f"{_shown(cells[row])} is not a number"
        raise PvidError(f"{path}, {_line_place(row)}, column {name}: {what}.") from None


def _numbers(cells: Iterable[str]) -> FloatArray:
    """Float64 array of text cells; ValueError if one is no number."""
    cells = tuple(cells)
    joined = "".join(cells)
    # float() would take 1_000 for a thousand, and digits of any script.
    if "_" in joined or not joined.isascii():
        raise ValueError
    return np.array(list(map(float, cells)))


def _is_number(cell: str) -> bool:
    try:
        _numbers((cell,))
    except ValueError:
        return False
    return True


def _write_csv(path: Path, named: dict[str, FloatArray]) -> bytes:
    columns = [map(repr, data.tolist()) for data in named.values()]
    lines = [",".join(named), *map(",".join, zip(*columns, strict=True))]
    return ("\n".join(lines) + "\n").encode("ascii")


def _read_csv_gz(path: Path, content: bytes) -> _Table:
    try:
        text = gzip.decompress(content)
    except (OSError, EOFError, zlib.error) as error:
        raise PvidError(f"{path} is not a whole gzip file: {_reason(error)}.") from error
    if not text:
        raise PvidError(f"{path} is empty.")
    return _read_csv(path, text)


def _write_csv_gz(path: Path, named: dict[str, FloatArray]) -> bytes:
    return gzip.compress(_write_csv(path, named), compresslevel=6, mtime=0)


# --- binary formats -----------------------------------------------------------------------------------------


def _array_table(path: Path, names: list[str], column: Callable[[str], npt.NDArray[Any]]) -> _Table:
    """Table of whole arrays; a required one that is not one row of real numbers is refused."""
    _check_names(path, names, "")
    columns: dict[str, FloatArray] = {}
    for name in REQUIRED:
        data = column(name)
        if data.dtype.kind not in "iuf":
            raise PvidError(f"{path}, column {name}: real numbers are wanted, not {data.dtype}.")
        if data.ndim != 1:
            raise PvidError(f"{path}, column {name}: one number a sample is wanted, not shape {data.shape}.")
        columns[name] = data.astype(np.float64)
    sizes = [columns[name].size for name in REQUIRED]
    if len(set(sizes)) > 1:
        raise PvidError(f"{path}: columns t, phi and y have {sizes[0]}, {sizes[1]} and {sizes[2]} rows.")
    for name in names:
        if name and name not in REQUIRED:
            data = column(name)
            if data.dtype.kind in "iufb" and data.shape == columns["t"].shape:
                columns[name] = data.astype(np.float64)
    return _Table(path, columns, _row_place)


def _read_npz(path: Path, content: bytes) -> _Table:
    try:
        archive = np.load(io.BytesIO(content), allow_pickle=False)
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise PvidError(f"{path} holds one bare array, where an archive of t, phi and y is wanted.")
        return _array_table(path, list(archive.files), archive.__getitem__)
    except PvidError:
        raise
    except Exception as error:  # zipfile, zlib and numpy raise a dozen kinds on damaged archives
        raise PvidError(f"{path} is not a readable .npz file: {_reason(error)}.") from error


def _write_npz(path: Path, named: dict[str, FloatArray]) -> bytes:
    # Not np.savez: it takes no column called "file" and stamps the archive with the time of day.
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in named.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as member:
                np.lib.format.write_array(member, data)
    return buffer.getvalue()


def _parquet(path: Path) -> Any:
    try:
        return importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise PvidError(f"{path} needs the Python package pyarrow, which is not installed.") from error


def _read_parquet(path: Path, content: bytes) -> _Table:
    parquet = _parquet(path)
    try:
        table = parquet.read_table(io.BytesIO(content))
        return _array_table(path, list(table.column_names), lambda name: table.column(name).to_numpy())
    except PvidError:
        raise
    except Exception as error:  # pyarrow raises its own kinds, which cannot be named without importing it
        raise PvidError(f"{path} is not a readable Parquet file: {_reason(error)}.") from error


def _write_parquet(path: Path, named: dict[str, FloatArray]) -> bytes:
    parquet = _parquet(path)
    table = importlib.import_module("pyarrow").table(named)
    buffer = io.BytesIO()
    parquet.write_table(table, buffer)
    return buffer.getvalue()


_Reader = Callable[[Path, bytes], _Table]
_Writer = Callable[[Path, dict[str, FloatArray]], bytes]
_FORMATS: dict[str, tuple[_Reader, _Writer]] = {
    ".csv": (_read_csv, _write_csv),
    ".csv.gz": (_read_csv_gz, _write_csv_gz),
    ".npz": (_read_npz, _write_npz),
    ".parquet": (_read_parquet, _write_parquet),
}


def _format(path: Path) -> tuple[_Reader, _Writer]:
    for suffix, functions in _FORMATS.items():
        if path.name.lower().endswith(suffix):
            return functions
    raise PvidError(f"{path} has no name of a run: it must end in {', '.join(_FORMATS)}.")
