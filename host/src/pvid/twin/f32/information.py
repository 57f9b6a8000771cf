"""Twin of information_f32.c: the two-level sums."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

_BLOCK_MAX = 64


def decay(x: np.float32) -> np.float32:
    """exp(-x) as the core computes it."""
    one = np.float32(1)
    total = one
    for k in range(24, 0, -1):
        total = one + (x / np.float32(k)) * total
    return np.float32(one / total)


class Information:
    """Sums of every lane: high, low float32 [n_sums, lanes].

    Parameters
    ----------
    n_sums
        Number of sums a lane.
    forgetting_groups
        Time constant in groups of rows, float32 [lanes]; 0: none.
    """

    def __init__(self, n_sums: int, forgetting_groups: Float32) -> None:
        lanes = len(forgetting_groups)
        self.high = np.zeros((n_sums, lanes), np.float32)
        self.low = np.zeros((n_sums, lanes), np.float32)
        self.block = np.full(lanes, _BLOCK_MAX)
        self.age = np.zeros(lanes, np.int64)
        self.retention = np.ones(lanes, np.float32)
        self.rounding = np.zeros(lanes, np.float32)
        for lane, groups in enumerate(forgetting_groups):
            if groups > 0:
                if groups < np.float32(16 * _BLOCK_MAX):
                    self.block[lane] = 1 if groups < np.float32(32) else int(groups / np.float32(16))
                self.retention[lane] = decay(np.float32(self.block[lane]) / groups)

    def read(self) -> Float32:
        """Values of the sums [n_sums, lanes]."""
        return self.high + self.low

    def add(self, terms: Float32, taken: npt.NDArray[np.bool_]) -> Float32:
        """Adds terms [n_sums, lanes] in the lanes `taken`; returns the values of the sums."""
        self.low = self.low + terms if taken.all() else np.where(taken, self.low + terms, self.low)
        return self.read()

    def fade(self, factor: Float32) -> None:
        """Multiplies all that was gathered by factor [lanes]."""
        self.high = self.high * factor
        self.low = self.low * factor
        self.rounding = self.rounding * factor

    def end_group(self, taken: npt.NDArray[np.bool_]) -> None:
        """Folds and forgets in the lanes whose block is complete."""
        self.age += taken
        due = taken & (self.age >= self.block)
        if not due.any():
            return
        self.age[due] = 0
        high = self.high * self.retention
        low = self.low * self.retention
        total = high + low
        part = total - high
        error = (high - (total - part)) + (low - part)
        self.high = np.where(due, total, self.high)
        self.low = np.where(due, error, self.low)
        self.rounding = np.where(due, self.rounding * self.retention, self.rounding)
