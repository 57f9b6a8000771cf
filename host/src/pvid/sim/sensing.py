"""What a sensor records of a quantity: white noise, then rounding."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import Signal

Float = npt.NDArray[np.float64]


def sensed(signal: Signal, values: Float, rng: np.random.Generator) -> Float:
    """The samples [n] of a quantity [n]; exact ones of an input."""
    if signal.kind == "input":
        return values.copy()
    noise = rng.standard_normal(values.shape)
    if not signal.resolution:
        return values + signal.noise * noise
    return np.asarray(np.round(values / signal.resolution + signal.noise * noise) * signal.resolution)
