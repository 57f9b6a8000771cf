"""Measured data of any kind that Python has: a file, a data frame, arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
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
    """Arrays by name, of a mapping, a data frame, an Arrow table or a structured array."""
    if isinstance(data, np.ndarray) and data.dtype.names:
        return {one: data[one] for one in data.dtype.names}
    names = data.keys() if isinstance(data, Mapping) else getattr(data, "column_names", getattr(data, "columns", None))
    if names is None:
        kind = type(data).__name__
        raise PvidError(f"data: a path, a data frame, a structured array or a mapping of arrays is wanted, not {kind}")
    named = {str(one): data[one] for one in names}
    index = getattr(data, "index", None)
    if index is not None and isinstance(getattr(index, "name", None), str):
        named.setdefault(index.name, index)
    return named
