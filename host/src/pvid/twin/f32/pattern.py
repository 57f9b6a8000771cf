"""Twin of pattern_f32.c: a model known by theta(p), C(p) and the pattern of C, M by blocks.

Everything has a trailing lane axis; p is float32 [n_p, lanes].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pvid.twin.blocks import Blocks

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class PatternModel:
    """pvid_model_f32.

    kind_end: one past the last theta of each kind of rows; empty: one kind.
    """

    n_theta: int
    n_p: int
    positive: tuple[bool, ...]
    c_row: tuple[int, ...]
    c_column: tuple[int, ...]
    theta: Callable[[Float32], Float32]
    jacobian: Callable[[Float32], Float32]
    kind_end: tuple[int, ...] = ()

    @cached_property
    def blocks(self) -> Blocks:
        """The kinds in theta and among the moments."""
        return Blocks(self.kind_end or (self.n_theta,))

    @property
    def moments(self) -> int:
        """Distinct entries of M."""
        return self.blocks.moments

    @property
    def n_sums(self) -> int:
        """M, B, yy, weight."""
        return self.blocks.n_sums

    def terms(self, kind: int, n: Float32, e: Float32, row_weight: Float32) -> Float32:
        """Terms that a row of a kind, N [its theta, lanes], e [lanes], adds to the sums [n_sums, lanes]; -0 changes no
        sum."""
        places, row, column = self.blocks.places_of_kind(kind)
        terms = np.full((self.n_sums, n.shape[1]), -0.0, np.float32)
        terms[places] = n[row] * n[column]
        terms[self.moments : -2][self.blocks.of_kind[kind]] = e * n
        terms[-2] = e * e
        terms[-1] = row_weight
        return terms

    def matrix(self, sums: Float32) -> Float32:
        """M [n_theta, n_theta, lanes]; 0 outside of its blocks."""
        m = np.zeros((self.n_theta, self.n_theta, sums.shape[1]), np.float32)
        row, column = self.blocks.places
        m[row, column] = sums[: self.moments]
        m[column, row] = sums[: self.moments]
        return m

    def transpose_times(self, c: Float32, x: Float32, kind: int | None = None) -> Float32:
        """C^T x [n_p, lanes]; x [n_theta, lanes], or the theta of a kind [its theta, lanes], 0 for the others."""
        block = slice(0, self.n_theta) if kind is None else self.blocks.of_kind[kind]
        out = np.zeros((self.n_p, x.shape[1]), np.float32)
        for k, (row, column) in enumerate(zip(self.c_row, self.c_column, strict=True)):
            if block.start <= row < block.stop:
                out[column] = out[column] + c[k] * x[row - block.start]
        return out

    def project(self, c: Float32, m: Float32) -> Float32:
        """The upper triangle of C^T M C [n_p, n_p, lanes]."""
        lanes = m.shape[2]
        s = np.zeros((self.n_p, self.n_p, lanes), np.float32)
        for a in range(self.n_p):
            own = [k for k, column in enumerate(self.c_column) if column == a]
            t = np.zeros((self.n_theta, lanes), np.float32)
            for k in own:
                block = self.blocks.of_entry(self.c_row[k])
                t[block] = t[block] + m[self.c_row[k], block] * c[k]
            for k in range(own[0], len(self.c_row)):
                b = self.c_column[k]
                s[a, b] = s[a, b] + c[k] * t[self.c_row[k]]
        return s

    def times(self, m: Float32, x: Float32) -> Float32:
        """M x [n_theta, lanes]."""
        out = np.zeros_like(x)
        for block in self.blocks.of_kind:
            for j in range(block.start, block.stop):
                out[block] = out[block] + m[j, block] * x[j]
        return out
