"""Twin of pattern_f32.c: a model known by theta(p), C(p) and the pattern of C, with M kept whole.

Everything has a trailing lane axis; p is float32 [n_p, lanes].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class PatternModel:
    """pvid_model_f32 without functions of its own but theta and its Jacobian."""

    n_theta: int
    n_p: int
    positive: tuple[bool, ...]
    c_row: tuple[int, ...]
    c_column: tuple[int, ...]
    theta: Callable[[Float32], Float32]
    jacobian: Callable[[Float32], Float32]
    noise: Callable[[Float32, Float32], Float32] | None = None
    n_gated: int = 0

    @property
    def gated(self) -> int:
        """Leading parameters that the gates look at."""
        return self.n_gated or self.n_p

    @property
    def moments(self) -> int:
        """Distinct entries of M."""
        return self.n_theta * (self.n_theta + 1) // 2

    @property
    def n_sums(self) -> int:
        """M, B, yy, weight."""
        return self.moments + self.n_theta + 2

    def terms(self, n: Float32, e: Float32, row_weight: Float32) -> Float32:
        """Terms that a row N [n_theta, lanes], e [lanes] adds to the sums [n_sums, lanes]."""
        upper, column = np.triu_indices(self.n_theta)
        return np.concatenate([n[upper] * n[column], e * n, (e * e)[None], row_weight[None]])

    def matrix(self, sums: Float32) -> Float32:
        """M [n_theta, n_theta, lanes]."""
        m = np.empty((self.n_theta, self.n_theta, sums.shape[1]), np.float32)
        upper, column = np.triu_indices(self.n_theta)
        m[upper, column] = sums[: self.moments]
        m[column, upper] = sums[: self.moments]
        return m

    def transpose_times(self, c: Float32, x: Float32) -> Float32:
        """C^T x [n_p, lanes]."""
        out = np.zeros((self.n_p, x.shape[1]), np.float32)
        for k, (row, column) in enumerate(zip(self.c_row, self.c_column, strict=True)):
            out[column] = out[column] + c[k] * x[row]
        return out

    def project(self, c: Float32, m: Float32) -> Float32:
        """The upper triangle of C^T M C [n_p, n_p, lanes]."""
        lanes = m.shape[2]
        s = np.zeros((self.n_p, self.n_p, lanes), np.float32)
        for a in range(self.n_p):
            own = [k for k, column in enumerate(self.c_column) if column == a]
            t = np.zeros((self.n_theta, lanes), np.float32)
            for k in own:
                t = t + m[self.c_row[k]] * c[k]
            for k in range(own[0], len(self.c_row)):
                b = self.c_column[k]
                s[a, b] = s[a, b] + c[k] * t[self.c_row[k]]
        return s

    def times(self, m: Float32, x: Float32) -> Float32:
        """M x [n_theta, lanes]."""
        out = np.zeros_like(x)
        for j in range(self.n_theta):
            out = out + m[j] * x[j]
        return out
