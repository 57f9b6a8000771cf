"""Measured data of any kind that Python has: a file, a data frame, arrays."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.units import is_unit
from pvid.rig.columns import Columns
from pvid.rig.run import Recording, read_recording, recording_of_arrays

Data = str | os.PathLike[str] | Mapping[str, npt.ArrayLike] | Any


def recording_of(data: Data, path: Path | None, rate: float | None, columns: Columns) -> Recording:
    """What is identified or predicted; `path` where it is a file."""
    if path is not None:
        recording = read_recording(path, rate, columns)
    else:
        recording = recording_of_arrays(named(data), rate, columns)
    recording.refuse_damaged()
    return recording


def named(data: Any) -> dict[str, Any]:
    """Arrays by name, of a mapping, a data frame or set, an Arrow table, a structured array or a list of records."""
    if isinstance(data, np.ndarray) and data.dtype.names:
        return {one: data[one] for one in data.dtype.names}
    if isinstance(data, Sequence) and data and all(isinstance(one, Mapping) or hasattr(one, "_asdict") for one in data):
        rows = [one if isinstance(one, Mapping) else one._asdict() for one in data]
        return {name: [row.get(name) for row in rows] for name in dict.fromkeys(name for row in rows for name in row)}
    if hasattr(data, "collect"):  # of polars, a frame whose rows are yet to be computed
        data = data.collect()
    if hasattr(data, "data_vars"):  # of xarray, a mapping whose coordinates are no keys
        stated = [(one, getattr(data[one], "attrs", {}).get("units")) for one in (*data.coords, *data.data_vars)]
        return {f"{one} [{unit}]" if unit and is_unit(str(unit)) else str(one): data[one] for one, unit in stated}
    if isinstance(data, Mapping):
        names = [*data.keys()]
    else:
        found = getattr(data, "column_names", getattr(data, "columns", None))
        if found is None:
            kind = type(data).__name__
            wanted = "a path, a data frame, a structured array or a mapping of arrays is wanted"
            raise PvidError(f"data: {wanted}, such as {{'t': times, 'x': positions}}, not {kind}")
        names = [*found]
    named = dict(zip(_in_words(names), (data[one] for one in names), strict=True))
    index = getattr(data, "index", None)
    if index is not None:
        for level in getattr(index, "names", None) or ():
            if isinstance(level, str):
                named.setdefault(level, index.get_level_values(level))
        if getattr(getattr(index, "dtype", None), "kind", " ") in "mMf" and index.name is None:
            named.setdefault("t", index)
    return named


def _in_words(names: Sequence[Any]) -> list[str]:
    """Names as text; of one in several levels the last, in brackets where all of them are units."""
    levels = [[str(part) for part in one if str(part)] for one in names if isinstance(one, tuple)]
    units = bool(levels) and all(len(one) > 1 and is_unit(one[-1]) for one in levels)
    last = Counter(one[-1] if one else "" for one in levels)
    words = []
    for one in names:
        parts = [str(part) for part in one if str(part)] if isinstance(one, tuple) else []
        if not parts:
            words.append(one.decode(errors="replace") if isinstance(one, bytes) else str(one))
        elif units:
            words.append(f"{'.'.join(parts[:-1])} [{parts[-1]}]")
        else:
            words.append(parts[-1] if last[parts[-1]] == 1 else ".".join(parts))
    return words
