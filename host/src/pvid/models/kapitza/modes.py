"""How fast the pendulum swings by itself."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt


def modes_hz(p: npt.NDArray[np.float64]) -> tuple[float, ...]:
    """Frequencies at rest [Hz], the slow one first, of s^4 + d1 w s^2 + d2 w^2 at p = (w, d1, d2, ...); none if there
    are none."""
    w, d1, d2 = map(float, p[:3])
    if not 4 * d2 <= d1 * d1 < math.inf or min(w, d1, d2) <= 0 or not math.isfinite(w * d1):
        return ()
    root = math.sqrt(d1 * d1 - 4 * d2)
    slow = d1 - root or 4 * d2 / (d1 + root)  # the same, where the difference has no digit left
    return tuple(math.sqrt(w * both / 2) / (2 * math.pi) for both in (slow, d1 + root))
