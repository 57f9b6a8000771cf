"""Files that hold arrays in folders or structures: MATLAB (.mat), HDF5 (.h5) and netCDF (.nc), which is HDF5 since 4.

An array is named by its path, `run.signals.x`, or by the last part of it where no other array has the same. A matrix
has a column each: `data[1]`, `data[2]`, ..., as MATLAB counts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.packages import lacking
from pvid.base.wording import reason
from pvid.rig.array_table import table_of
from pvid.rig.columns import Columns
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table

Array = npt.NDArray[Any]

_UNIT = ("units", "unit")
_PACKED = ("_FillValue", "scale_factor", "add_offset")
_MOST_COLUMNS = 64  # of a matrix; more are pictures or spectra


def read_matlab(path: Path, columns: Columns) -> Table:
    """Reads the arrays of a .mat file of any version; PvidError for whatever is wrong with it."""
    import scipy.io

    try:
        content = scipy.io.loadmat(path, struct_as_record=True, squeeze_me=True)
    except NotImplementedError:  # version 7.3 is HDF5
        return read_hdf5(path, columns)
    except Exception as error:  # scipy raises many kinds on damaged files
        raise PvidError(f"{path} is not a readable MATLAB file: {reason(error)}.") from error
    arrays = {
        name: array
        for key, value in content.items()
        if not key.startswith("__")
        for name, array in _of_structure(key, value)
    }
    return _table(path, arrays, columns, {})


def read_hdf5(path: Path, columns: Columns) -> Table:
    """Reads the datasets of a file; PvidError for whatever is wrong with it."""
    try:
        import h5py
    except ImportError as error:
        raise lacking(f"{path}: an HDF5 file", "h5py") from error
    arrays: dict[str, Any] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:

            def visit(name: str, item: Any) -> None:
                if not isinstance(item, h5py.Dataset) or item.ndim not in (1, 2) or name.startswith("#refs#"):
                    return
                refuse_beyond(path, max(item.shape, default=0))
                name = name.replace("/", ".")
                unit = _unit_of(item.attrs)
                for column, array in _of_structure(name, _unpacked(item[()], item.attrs)):
                    arrays[column], units[column] = array, unit

            file.visititems(visit)
    except PvidError:
        raise
    except Exception as error:  # h5py raises many kinds on damaged files
        raise PvidError(f"{path} is not a readable HDF5 file: {reason(error)}.") from error
    return _table(path, arrays, columns, units)


def read_netcdf(path: Path, columns: Columns) -> Table:
    """Reads the variables of a file of any version; PvidError for whatever is wrong with it."""
    import scipy.io

    with path.open("rb") as file:
        if file.read(3) != b"CDF":
            return read_hdf5(path, columns)
    arrays: dict[str, Any] = {}
    units: dict[str, str] = {}
    try:
        with scipy.io.netcdf_file(path, mmap=False) as file:
            for name, item in file.variables.items():
                refuse_beyond(path, max(item.shape, default=0))
                attributes = {one: getattr(item, one) for one in (*_UNIT, *_PACKED) if hasattr(item, one)}
                for column, array in _of_structure(name, _unpacked(item[:], attributes)):
                    arrays[column], units[column] = array, _unit_of(attributes)
    except PvidError:
        raise
    except Exception as error:  # as above
        raise PvidError(f"{path} is not a readable netCDF file: {reason(error)}.") from error
    return _table(path, arrays, columns, units)


def _unit_of(attributes: Mapping[str, Any]) -> str:
    """The unit that the attributes of an array state, as `ms` of `ms since 2024-05-02`; else an empty text."""
    for name in _UNIT:
        unit = attributes.get(name)
        if isinstance(unit, str | bytes):
            return (unit.decode(errors="replace") if isinstance(unit, bytes) else unit).partition(" since ")[0]
    return ""


def _unpacked(value: Any, attributes: Mapping[str, Any]) -> Any:
    """An array in its unit where its attributes state that it is kept in integers, one of them missing;
    the conventions for climate and forecast (CF), section 8.1."""
    missing, factor, offset = (attributes.get(name) for name in _PACKED)
    if factor is None and offset is None and (missing is None or np.asarray(value).dtype.kind not in "iuf"):
        return value
    gone = False if missing is None else np.asarray(value) == missing
    scaled = np.asarray(value) * (1.0 if factor is None else factor) + (0.0 if offset is None else offset)
    return np.where(gone, np.nan, scaled)


def _of_structure(name: str, value: Any) -> Iterator[tuple[str, Array]]:
    """Columns in an array or a structure, and in what it contains."""
    array = np.asarray(value)
    if array.dtype.names:
        for field in array.dtype.names:
            inner = array[field]
            yield from _of_structure(f"{name}.{field}", inner.item() if inner.ndim == 0 else inner)
    elif array.ndim == 0 and array.dtype.kind == "O" and isinstance(array.item(), np.ndarray | np.void):
        yield from _of_structure(name, array.item())
    elif array.ndim == 1 and array.size > 1 and not (array.dtype.kind == "O" and isinstance(array[0], np.ndarray)):
        yield name, array
    elif array.ndim == 2 and min(array.shape) == 1 and array.size > 1:
        yield name, array.reshape(-1)
    elif array.ndim == 2 and 1 < min(array.shape) <= _MOST_COLUMNS and array.dtype.kind != "O":
        long = array if array.shape[0] >= array.shape[1] else array.T  # MATLAB's order is the other one in HDF5
        for k in range(long.shape[1]):
            yield f"{name}[{k + 1}]", long[:, k]


def table_of_arrays(path: Path, arrays: Mapping[str, Array], columns: Columns) -> Table:
    """The signals among arrays by name: a matrix is a column each. Raises PvidError as `table_of`."""
    found = {one: array for name, whole in arrays.items() for one, array in _of_structure(name, whole)}
    return _table(path, found, columns, {})


def _table(path: Path, arrays: dict[str, Array], columns: Columns, units: dict[str, str]) -> Table:
    if not arrays:
        raise PvidError(f"{path} has no array of samples.")
    last = Counter(name.rpartition(".")[2] for name in arrays)
    short = {name: name.rpartition(".")[2] for name in arrays}
    wanted = {*columns.wanted}
    ends = {one: [name for name in arrays if f".{name}".endswith(f".{one}")] for one in wanted if "." in one}
    # By the whole path where that is wanted or needed, else by its last part.
    names = {
        name if name in wanted or last[short[name]] > 1 or short[name] in arrays else short[name]: name
        for name in arrays
    }
    names.update({one: found[0] for one, found in ends.items() if len(found) == 1})
    stated = {shown: units[name] for shown, name in names.items() if units.get(name)}
    return table_of(path, list(names), lambda name: arrays[names[name]], columns, stated)
