"""Breaks of a recorded signal: wild samples, jumps, lost samples that do not show in t."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

_ORDER = 4
_GAIN = 70.0  # variance of the fourth difference of white noise of variance 1: 1 + 16 + 36 + 16 + 1
_BEYOND = 15.0  # standard deviations


def breaks(x: Float, span: int, noise: float) -> Bool:
    """Samples at which the fourth difference of a signal is far larger than elsewhere near it [n].

    A wild sample marks itself and two neighbours on each side; a jump marks two samples on each side.

    Parameters
    ----------
    x : [n]; NaN where a sample is missing
    span : samples over which the signal may change its character: onset of a drive, a sweep
    noise : lower bound of the noise's standard deviation
    """
    difference = np.abs(np.diff(x, _ORDER))
    found = np.zeros(len(x), bool)
    if not len(difference):
        return found
    blocks = -(-len(difference) // span)
    padded = np.full(blocks * span, np.nan)
    padded[: len(difference)] = difference
    there = np.where(np.isnan(padded), np.inf, padded).reshape(blocks, span)
    count = np.isfinite(there).sum(1)
    middle = np.sort(there, axis=1)[np.arange(blocks), np.maximum(count - 1, 0) // 2]
    own = np.pad(np.where(count > 0, middle, 0.0), 1)
    scale = np.maximum(1.4826 * np.max([own[:-2], own[1:-1], own[2:]], axis=0), np.sqrt(_GAIN) * noise)
    beyond = padded.reshape(blocks, span) > _BEYOND * scale[:, None]
    found[_ORDER // 2 : -(_ORDER // 2)] = beyond.ravel()[: len(difference)]
    return found
