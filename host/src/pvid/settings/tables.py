"""Banks of derivative filters as the core takes them: what their folded tables span."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt


class Folded:
    """What folded tables [5, half], whose taps are `stride` points of `block` samples apart, span."""

    weights: npt.NDArray[Any]
    stride: int
    block: int = 1  # samples of a point

    @property
    def half(self) -> int:
        """Points on each side of the centre."""
        return int(self.weights.shape[1])

    @property
    def window(self) -> int:
        """Samples from the first to the last, both included."""
        return self.memory * self.every

    @property
    def memory(self) -> int:
        """Points from the first to the last, both included: places of PVID_MAX_WINDOW."""
        return 2 * self.half * self.stride + 1

    @property
    def every(self) -> int:
        """Samples from a result to the next."""
        return max(self.block, 1)

    @property
    def delay(self) -> int:
        """Samples from the newest one back to the instant the derivatives refer to."""
        return (self.window - 1) // 2
