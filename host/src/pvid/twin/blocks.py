"""Twin of kinds.h: where the rows of a kind are in theta and among the moments, for both cores."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Places = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Blocks:
    """M as the packed upper triangles of its blocks, one a kind of rows.

    end : one past the last theta of each kind
    """

    end: tuple[int, ...]

    @cached_property
    def of_kind(self) -> tuple[slice, ...]:
        """The theta of each kind."""
        return tuple(slice(first, end) for first, end in zip((0, *self.end), self.end, strict=False))

    def of_entry(self, i: int) -> slice:
        """The theta of the kind that has entry i."""
        return next(block for block in self.of_kind if i < block.stop)

    @cached_property
    def places(self) -> tuple[Places, Places]:
        """Row and column of each moment."""
        row, column = np.triu_indices(self.end[-1])
        kind = np.searchsorted(np.array(self.end), np.arange(self.end[-1]), side="right")
        same = kind[row] == kind[column]
        return row[same], column[same]

    @cached_property
    def moments(self) -> int:
        """Entries of M on and above the diagonals of its blocks."""
        return len(self.places[0])

    @cached_property
    def n_sums(self) -> int:
        """M, b, rr, weight."""
        return self.moments + self.end[-1] + 2

    def places_of_kind(self, kind: int) -> tuple[slice, Places, Places]:
        """The moments of a kind, and row and column of each within its block."""
        block = self.of_kind[kind]
        row, column = np.triu_indices(block.stop - block.start)
        first = int(np.searchsorted(self.places[0], block.start))
        return slice(first, first + len(row)), row, column
