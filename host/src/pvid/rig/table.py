"""A recorded run as its file holds it, in SI, before its clock is looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.rig.columns import Columns

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """Three columns of a file.

    Attributes
    ----------
    path : where they come from
    t, phi, y : ndarray, shape (n,)
        [s], [rad], [m]; NaN where a cell is empty.
    columns : how the file calls them
    place : how to call the place of row k: a line or a row
    notes : what was left out, a sentence each
    """

    path: Path
    t: FloatArray
    phi: FloatArray
    y: FloatArray
    columns: Columns
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()

    def error(self, row: int, signal: str, complaint: str) -> PvidError:
        """The refusal of a cell."""
        return PvidError(f"{self.path}, {self.place(row)}, column {self.columns[signal].name}: {complaint}.")


def row_place(row: int) -> str:
    """The place in a file that has no lines."""
    return f"row {row + 1}"
