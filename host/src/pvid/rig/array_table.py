"""Runs as arrays: .npz archives of numpy and Parquet files."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed, reason
from pvid.rig.columns import Columns
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table, row_place

FloatArray = npt.NDArray[np.float64]

_LONGEST_NUMBER = 16  # bytes of one in an archive


def read_npz(path: Path, columns: Columns) -> Table:
    """Reads the arrays of an archive; PvidError for whatever is wrong with it."""
    try:
        with path.open("rb") as file:  # which np.load would leave open where it fails
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise PvidError(f"{path} holds one bare array, where an archive of {listed(columns.units)} is wanted.")
            members = archive.zip.infolist() if archive.zip is not None else []
            refuse_beyond(path, max((member.file_size for member in members), default=0) // _LONGEST_NUMBER)
            return table_of(path, list(archive.files), archive.__getitem__, columns)
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
    import pyarrow.parquet  # 40 ms that other commands need not wait for

    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            refuse_beyond(path, file.metadata.num_rows)
            names = file.schema_arrow.names

            def column(name: str) -> npt.NDArray[Any]:
                # a copy, so that pyarrow can give its memory back
                return np.array(file.read(columns=[name], use_threads=False).column(0).to_numpy())

            return table_of(path, names, column, columns)
    except PvidError:
        raise
    except Exception as error:  # pyarrow's readers raise many kinds on damaged files
        raise PvidError(f"{path} is not a readable Parquet file: {reason(error)}.") from error


def write_parquet(path: Path, named: dict[str, FloatArray]) -> bytes:
    """The file's content."""
    import pyarrow
    import pyarrow.parquet

    buffer = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(named), buffer)
    return buffer.getvalue()


def table_of(path: Path, names: Sequence[str], column: Callable[[str], npt.NDArray[Any]], columns: Columns) -> Table:
    """The signals among named columns of numbers; PvidError where one is missing or holds something else."""
    places = columns.places(path, names)
    signals: dict[str, FloatArray] = {}
    for signal in columns.units:
        name = names[places[signal]]
        data = column(name)
        if data.dtype.kind not in "iuf":
            raise PvidError(f"{path}, column {name}: real numbers are wanted, not {data.dtype}.")
        if data.ndim != 1:
            raise PvidError(f"{path}, column {name}: one number a sample is wanted, not shape {data.shape}.")
        signals[signal] = columns[signal].in_si(data.astype(np.float64, copy=False))
    sizes = [data.size for data in signals.values()]
    if len(set(sizes)) > 1:
        raise PvidError(f"{path}: columns {listed(signals)} have {listed(map(str, sizes))} rows.")
    return Table(path, signals.pop("t"), signals, columns, row_place)
