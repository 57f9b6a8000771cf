"""Rounding to integers with errors outside the slow motion (noise shaping)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]


def bits_for(largest: float, bits: int) -> int:
    """Largest shift left that keeps |x| <= largest within a signed integer of `bits` bits, with room for rounding."""
    if not largest > 0:
        return 0
    return math.floor(math.log2((2 ** (bits - 1) - 2) / largest))


def slow_factor(slow: Float, own_weight: float) -> Float:
    """Upper factor [n, n] of what errors cost by their part along the columns of `slow` [n, signals].

    `own_weight` is that of the errors themselves beside their part along slow signals: it keeps them small.
    """
    form = slow @ slow.T / slow.shape[1] + own_weight * np.eye(len(slow))
    return np.asarray(np.linalg.cholesky(form).T)


def shaped(values: Float, factor: Float) -> Float:
    """Integers near `values` [n] whose errors have almost no part along the slow signals of `factor`.

    Rounds one entry after the other, each such that it makes up for the errors of those before (Babai's nearest plane).
    """
    out = np.zeros_like(values)
    for i in range(len(values) - 1, -1, -1):
        owed = factor[i, i + 1 :] @ (out[i + 1 :] - values[i + 1 :])
        out[i] = np.rint(values[i] - owed / factor[i, i])
    return out
