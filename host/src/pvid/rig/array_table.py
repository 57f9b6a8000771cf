"""Runs as arrays: in memory, .npz archives of numpy, Parquet, Feather and Arrow files."""

from __future__ import annotations

import datetime
import io
import json
import numbers
import zipfile
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.packages import lacking
from pvid.base.wording import listed, reason, shown
from pvid.rig.cells import Evidence, is_missing, styles
from pvid.rig.columns import Columns, unit_in_name
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table, row_place
from pvid.rig.times import TimesOfDay, is_time, seconds_of

FloatArray = npt.NDArray[np.float64]

_LONGEST_NUMBER = 16  # bytes of one in an archive
_TIMELESS_SHARE = 0.05  # rows without a time that are left out


def read_npz(path: Path, columns: Columns) -> Table:
    """Reads the arrays of an archive; PvidError for whatever is wrong with it."""
    try:
        with path.open("rb") as file:  # which np.load would leave open where it fails
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise PvidError(f"{path} holds one bare array, where an archive of {listed(columns.units)} is wanted.")
            members = archive.zip.infolist() if archive.zip is not None else []
            refuse_beyond(path, max((member.file_size for member in members), default=0) // _LONGEST_NUMBER)
            names = [name for name in archive.files if name != "units" or archive[name].dtype.kind != "U"]
            units = json.loads(str(archive["units"])) if len(names) < len(archive.files) else {}
            return table_of(path, names, archive.__getitem__, columns, units)
    except PvidError:
        raise
    except Exception as error:  # zipfile, zlib and numpy raise a dozen kinds on damaged archives
        raise PvidError(f"{path} is not a readable .npz file: {reason(error)}.") from error


def write_npz(path: Path, named: dict[str, FloatArray]) -> bytes:
    """The archive, the same bytes at any time of day."""
    # Not np.savez: it stamps the archive with the time of day.
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in named.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as member:
                np.lib.format.write_array(member, data)
    return buffer.getvalue()


def read_parquet(path: Path, columns: Columns) -> Table:
    """Reads the columns of a file; PvidError for whatever is wrong with it."""
    try:
        import pyarrow.parquet  # 40 ms that other commands need not wait for
    except ImportError as error:
        raise lacking(f"{path}: a Parquet file", "pyarrow") from error
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            refuse_beyond(path, file.metadata.num_rows)
            schema = file.schema_arrow

            def column(name: str) -> Any:
                return file.read(columns=[name], use_threads=False).column(0)

            return _arrow_table(path, schema, column, columns)
    except PvidError:
        raise
    except Exception as error:  # pyarrow's readers raise many kinds on damaged files
        raise PvidError(f"{path} is not a readable Parquet file: {reason(error)}.") from error


def read_arrow(path: Path, columns: Columns) -> Table:
    """Reads a Feather or Arrow file; PvidError for whatever is wrong with it."""
    try:
        import pyarrow.feather
        import pyarrow.ipc
    except ImportError as error:
        raise lacking(f"{path}: an Arrow file", "pyarrow") from error
    try:
        try:
            table = pyarrow.feather.read_table(path)
        except pyarrow.ArrowInvalid:
            with path.open("rb") as file:
                table = pyarrow.ipc.open_stream(file).read_all()
        refuse_beyond(path, table.num_rows)
        return _arrow_table(path, table.schema, table.column, columns)
    except PvidError:
        raise
    except Exception as error:  # as above
        raise PvidError(f"{path} is not a readable Arrow file: {reason(error)}.") from error


def _arrow_table(path: Path, schema: Any, column: Callable[[str], Any], columns: Columns) -> Table:
    units = {one.name: one.metadata.get(b"unit", b"").decode(errors="replace") for one in schema if one.metadata}

    def values(name: str) -> npt.NDArray[Any]:
        return np.array(column(name).to_numpy())  # a copy, so that pyarrow can give its memory back

    return table_of(path, schema.names, values, columns, units)


def write_parquet(path: Path, named: dict[str, FloatArray]) -> bytes:
    """The file's content."""
    import pyarrow
    import pyarrow.parquet

    buffer = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(named), buffer)
    return buffer.getvalue()


def table_of(
    path: Path,
    names: Sequence[str],
    column: Callable[[str], Any],
    columns: Columns,
    units: Mapping[str, str] | None = None,
) -> Table:
    """The signals among named columns of numbers.

    Raises PvidError where a column is missing or holds something else than numbers, or times for t.

    Parameters
    ----------
    path : of the file, or a name for data in memory
    names : of the columns
    column : an array-like by name: shape (n,), (n, 1) or (1, n); masked samples, None, NaN and infinities are missing
    columns : the ones that are wanted
    units : of columns by name, as far as the file states them
    """
    places = columns.places(path, names)
    given = {
        signal: (units or {}).get(names[place]) or unit_in_name(names[place], signal, columns.units[signal])
        for signal, place in places.items()
    }
    found = {signal: _array(path, names[place], column(names[place])) for signal, place in places.items()}
    times = _seconds(found["t"])
    if times is not None:
        given.pop("t")
    columns, notes = columns.called(names, places).in_units_of_file(given)
    signals: dict[str, FloatArray] = {}
    for signal, place in places.items():
        if signal == "t" and times is not None:
            signals[signal] = times
            continue
        values = numbers_of(path, names[place], found[signal])
        infinite = np.isinf(values)
        if infinite.any():
            values = np.where(infinite, np.nan, values)
            notes += (f"{names[place]}: {np.count_nonzero(infinite)} infinite samples are taken as missing",)
        signals[signal] = columns[signal].in_si(values)
    sizes = [data.size for data in signals.values()]
    if len(set(sizes)) > 1:
        raise PvidError(f"{path}: columns {listed(signals)} have {listed(map(str, sizes))} rows.")
    table = Table(path, signals.pop("t"), signals, columns, row_place, notes)
    timeless = np.isnan(table.t)
    count = int(np.count_nonzero(timeless))
    if not 0 < count <= _TIMELESS_SHARE * table.t.size:
        return table
    kept = np.flatnonzero(~timeless)
    return table.rows(kept, lambda row: row_place(int(kept[row])), f"rows without a time, left out: {count}")


def _array(path: Path, name: str, data: Any) -> Any:
    """What numpy takes for an array. Raises PvidError on anything else."""
    try:
        array = data if np.ma.isMaskedArray(data) else np.asarray(data)
    except Exception as error:  # of what calls itself an array
        raise PvidError(f"{path}, column {name}: one number a sample is wanted: {reason(error)}.") from error
    if array.ndim == 0:
        raise PvidError(f"{path}, column {name}: an array of numbers is wanted, not {type(data).__name__}.")
    return array


def numbers_of(path: Path, name: str, data: Any) -> FloatArray:
    """Of an array-like of any kind of real numbers, shape (n,); NaN where one is missing.

    Raises PvidError where it holds something else.
    """
    mask = np.ma.getmaskarray(data) if np.ma.isMaskedArray(data) else None
    array = np.asarray(np.ma.getdata(data) if mask is not None else data)
    if array.ndim != 1:
        if max(array.shape, default=0) != array.size:
            raise PvidError(f"{path}, column {name}: one number a sample is wanted, not shape {array.shape}.")
        array = array.reshape(-1)
    if array.dtype.kind in "biuf":
        values = array.astype(np.float64, copy=False)
    elif array.dtype.kind in "OSU":
        values = _of_objects(path, name, array.tolist())
    else:
        raise PvidError(f"{path}, column {name}: real numbers are wanted, not {array.dtype}.")
    return values if mask is None else np.where(mask.reshape(-1), np.nan, values)


def _of_objects(path: Path, name: str, data: list[Any]) -> FloatArray:
    """Numbers, texts of numbers, and missing values: None, NA, NaT."""
    texts = {k: _text(one) for k, one in enumerate(data) if isinstance(one, str | bytes)}
    evidence = Evidence()
    evidence.add(texts.values())
    style = (styles(str(path), {name: evidence}) or {})[name]
    out = np.full(len(data), np.nan)
    for k, one in enumerate(data):
        if k in texts:
            value = style.number(texts[k])
            if value is None and not is_missing(texts[k]):
                raise PvidError(f"{path}, {row_place(k)}, column {name}: {shown(texts[k])} is not a number.")
            out[k] = np.nan if value is None else value
        elif isinstance(one, numbers.Real | Decimal):
            out[k] = float(one)
        elif not (one is None or type(one).__name__ in ("NAType", "NaTType")):
            raise PvidError(f"{path}, column {name}: real numbers are wanted, not {type(one).__name__}.")
    return out


def _text(one: str | bytes) -> str:
    return (one.decode(errors="replace") if isinstance(one, bytes) else one).strip()


def _seconds(data: Any) -> FloatArray | None:
    """Of times as numpy, Python or text writes them, since the first one; None of numbers."""
    mask = np.ma.getmaskarray(data) if np.ma.isMaskedArray(data) else None
    array = np.asarray(np.ma.getdata(data) if mask is not None else data)
    if array.ndim != 1 and max(array.shape, default=0) == array.size and array.ndim > 0:
        array = array.reshape(-1)
    if array.ndim != 1:
        return None
    if array.dtype.kind in "mM":
        found = seconds_of(array)
        return found if mask is None else np.where(mask.reshape(-1), np.nan, found)
    if array.dtype.kind not in "OSU" or not array.size:
        return None
    items = array.tolist()
    first = next((one for one in items if one is not None and type(one).__name__ not in ("NAType", "NaTType")), None)
    if isinstance(first, datetime.datetime | datetime.time):
        texts = ["" if one is None else str(one) for one in items]
    elif isinstance(first, datetime.timedelta):
        return np.array([one.total_seconds() if isinstance(one, datetime.timedelta) else np.nan for one in items])
    elif isinstance(first, str | bytes) and is_time(_text(first)):
        texts = [_text(one) if isinstance(one, str | bytes) else "" for one in items]
    else:
        return None
    times = TimesOfDay()
    return times.unwrapped(times.seconds(texts))
