"""Twin of weak_front_f32.c. It feeds forward, so a whole stretch of samples is computed at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.native import WeakTables

Float32 = npt.NDArray[np.float32]


def _folded(samples: Float32, weights: Float32, centres: npt.NDArray[np.int64]) -> Float32:
    middle = samples[centres]
    total = np.zeros_like(middle)
    for i, weight in enumerate(weights):
        after = samples[centres + (i + 1)]
        before = samples[centres - (i + 1)]
        total = total + weight * ((after - middle) + (before - middle))
    return total


def job_ticks(taps: int, decimation: int) -> int:
    """Ticks that the FIR job of a block takes."""
    half = (taps - 1) // 2
    slice_pairs = -(-half // max(1, decimation // 2))
    return -(-half // slice_pairs)


def outputs(samples: int, taps: int, decimation: int) -> int:
    """Decimated samples that come out of a stretch of `samples`."""
    return max(0, (samples - taps - job_ticks(taps, decimation) + 1) // decimation + 1)


def tick_of(index: int, taps: int, decimation: int) -> int:
    """Tick, from the start of the stretch, at which decimated sample `index` comes out."""
    return taps - 1 + index * decimation + job_ticks(taps, decimation) - 1


def decimate(phi: Float32, y: Float32, design: WeakTables, sample_rate: float, l1: float) -> tuple[Float32, Float32]:
    """phi [rad] and u [1/s^2] at the decimated instants of one stretch of finite samples [ticks]."""
    half = (design.taps - 1) // 2
    centres = half + design.decimation * np.arange(outputs(len(phi), design.taps, design.decimation))
    rate = np.float32(sample_rate)
    scale = (rate * rate) / np.float32(l1)
    smooth = np.asarray(design.smooth, np.float32)
    second = np.asarray(design.second, np.float32)
    with np.errstate(all="ignore"):
        return phi[centres] + _folded(phi, smooth, centres), _folded(y, second, centres) * scale
