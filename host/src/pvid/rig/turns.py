"""Unwraps the angle of an encoder that wraps after one turn."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_TURN = 2.0 * math.pi
_FEWEST = 100  # samples; with fewer the usual step between samples is not known
_MOST_SHARE = 0.1  # largest share of steps that are wraps: noise at the wrap position repeats them
# An unwrapped step is at most this many times the largest of the other steps.
_SMOOTH = 3.0


def joined(phi: FloatArray) -> tuple[FloatArray, int]:
    """phi without jumps of a whole turn, and the number of jumps.

    phi is returned unchanged if there are too many jumps, or if a jump differs from a whole turn by more than the angle
    moves between two samples: then the encoder does not wrap. The median of an unwrapped angle is within half a turn
    of 0.

    Parameters
    ----------
    phi : ndarray, shape (n,)
        [rad]; NaN where there is no sample.
    """
    if phi.size < _FEWEST or not np.nanmax(phi) - np.nanmin(phi) > 0.75 * _TURN:
        return phi, 0
    there = np.isfinite(phi)
    values = phi[there]
    steps = np.diff(values)
    jumps = np.abs(steps) > 0.5 * _TURN
    count = int(np.count_nonzero(jumps))
    if not 0 < count <= _MOST_SHARE * steps.size:
        return phi, 0
    largest = float(np.abs(steps[~jumps]).max())
    turns = np.rint(steps / _TURN)
    if np.abs(steps - _TURN * turns)[jumps].max() > _SMOOTH * largest or largest > 0.25 * _TURN:
        return phi, 0
    values[1:] -= _TURN * np.cumsum(np.where(jumps, turns, 0.0))
    values -= _TURN * np.rint(np.median(values) / _TURN)
    out = phi.copy()
    out[there] = values
    return out, count
