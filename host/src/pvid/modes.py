"""How fast the pendulum swings by itself."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt


def modes_hz(p: npt.NDArray[np.float64]) -> tuple[float, ...]:
    """Frequencies at rest [Hz], the slow one first, of s^4 + d1 w s^2 + d2 w^2 at p = (w, d1, d2, ...); none if there
    are none."""
    w, d1, d2 = p[:3]
    if d1**2 < 4 * d2 or min(w, d1, d2) <= 0:
        return ()
    root = math.sqrt(d1**2 - 4 * d2)
    return tuple(math.sqrt(w * (d1 + sign * root) / 2) / (2 * math.pi) for sign in (-1, 1))
