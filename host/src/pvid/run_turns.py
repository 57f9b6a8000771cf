"""Angles of an encoder that starts over after a turn, joined into one that does not."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_TURN = 2.0 * math.pi
_FEWEST = 100  # samples; fewer do not show how large the steps between samples are
_MOST_SHARE = 0.1  # of the steps: noise about the place where the encoder starts over repeats them
# A joined step is at most so many times the largest of the others.
_SMOOTH = 3.0


def joined(phi: FloatArray) -> tuple[FloatArray, int]:
    """phi without the jumps of a whole turn, and how many there were.

    Where the jumps are not a turn to within what the angle moves between two samples, or too many, nothing is changed:
    it is no encoder that starts over. What is joined rests within half a turn of 0.

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
