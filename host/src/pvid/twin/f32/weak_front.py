"""Twin of weak/front_f32.c. It feeds forward, so a whole stretch of samples is computed at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.f32 import WeakTables
from pvid.twin.weak_schedule import Schedule

Float32 = npt.NDArray[np.float32]


def _folded(samples: Float32, weights: Float32, centres: npt.NDArray[np.int64]) -> Float32:
    middle = samples[centres]
    total = np.zeros_like(middle)
    for i, weight in enumerate(weights):
        after = samples[centres + (i + 1)]
        before = samples[centres - (i + 1)]
        total = total + weight * ((after - middle) + (before - middle))
    return total


def decimate(phi: Float32, y: Float32, design: WeakTables, sample_rate: float, l1: float) -> tuple[Float32, Float32]:
    """phi [rad] and u [1/s^2] at the decimated instants of one stretch of finite samples [ticks]."""
    centres = Schedule.of(design).centres(len(phi))
    rate = np.float32(sample_rate)
    scale = (rate * rate) / np.float32(l1)
    smooth = np.asarray(design.smooth, np.float32)
    second = np.asarray(design.second, np.float32)
    with np.errstate(all="ignore"):
        return phi[centres] + _folded(phi, smooth, centres), _folded(y, second, centres) * scale
