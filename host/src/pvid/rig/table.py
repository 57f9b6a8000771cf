"""A recorded run as its file holds it, in SI, before its clock is looked at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.rig.columns import Columns

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_FEW_NAMES = 4


def called(names: Sequence[str]) -> str:
    """Some columns in a sentence: their names, or how many they are."""
    return listed(names) if len(names) <= _FEW_NAMES else f"{len(names)} columns"


@dataclass(frozen=True, eq=False)
class Table:
    """The columns of a file that hold signals.

    Attributes
    ----------
    path : where they come from
    t : ndarray, shape (n,)
        [s]; NaN where a cell is empty.
    signals : of each name an ndarray, shape (n,)
        In SI; NaN where a cell is empty.
    columns : how the file calls them
    place : how to call the place of row k: a line or a row
    notes : what was left out, a sentence each
    kept : held inputs whose blank cells have their last value
    """

    path: Path
    t: FloatArray
    signals: Mapping[str, FloatArray]
    columns: Columns
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()
    kept: frozenset[str] = frozenset()

    @property
    def complete(self) -> npt.NDArray[np.bool_]:
        """Whether every signal has a number in the row, shape (n,)."""
        there: npt.NDArray[np.bool_] = np.all([np.isfinite(one) for one in self.signals.values()], axis=0)
        return there

    def called(self) -> str:
        """What a sentence calls the signals: as the file does, or by their number where they are many."""
        return called([self.columns[one].name for one in self.signals])

    def rows(self, kept: slice | IntArray, place: Callable[[int], str], note: str) -> Table:
        """Some of the rows, with a note on the others."""
        signals = {name: one[kept] for name, one in self.signals.items()}
        return replace(self, t=self.t[kept], signals=signals, place=place, notes=(*self.notes, note))

    def with_merged_rows(self) -> Table:
        """Rows of one stamp that hold one number of each signal at most, as one."""
        again = np.diff(self.t) == 0
        if not again.any() or self.complete.all():
            return self
        group = np.concatenate([[0], np.cumsum(~again)])
        merged = {}
        for name, values in self.signals.items():
            there = np.isfinite(values)
            if np.bincount(group[there], minlength=1).max() > 1:
                return self
            merged[name] = np.full(int(group[-1]) + 1, np.nan)
            merged[name][group[there]] = values[there]
        first = np.flatnonzero(np.concatenate([[True], ~again]))
        return replace(self, t=self.t[first], signals=merged, place=lambda row: self.place(int(first[row])))

    def error(self, row: int, signal: str, complaint: str) -> PvidError:
        """The refusal of a cell."""
        return PvidError(f"{self.path}, {self.place(row)}, column {self.columns[signal].name}: {complaint}.")


def row_place(row: int) -> str:
    """The place in a file that has no lines."""
    return f"row {row + 1}"
