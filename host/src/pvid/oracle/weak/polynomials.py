"""Filters that fit a polynomial to samples."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
from numpy.polynomial import legendre

Float = npt.NDArray[np.float64]

# Relative error of a filter at the edge of its band.
_EDGE = 1e-4
_FREQUENCIES = 2000  # at which the edge is sought


@cache
def polynomial_weights(taps: int, degree: int, order: int) -> Float:
    """Weights [taps] of the derivative per step^order at the centre of a least-squares polynomial."""
    half = (taps - 1) // 2
    if half == 0:
        return np.ones(1)
    basis = legendre.legvander(np.arange(-half, half + 1) / half, degree)
    at_centre = [legendre.legval(0.0, legendre.legder(one, order)) for one in np.eye(degree + 1)]
    return np.asarray(np.array(at_centre) @ np.linalg.pinv(basis) / float(half) ** order)


@cache
def edge_of(taps: int, degree: int, order: int) -> float:
    """Lowest frequency over the sample rate at which such a filter is off by more than _EDGE; one half: nowhere."""
    weights, half = polynomial_weights(taps, degree, order), taps // 2
    rates = np.linspace(0, 0.5, _FREQUENCIES + 1)[1:]
    gain = np.exp(2j * np.pi * np.outer(rates, np.arange(-half, half + 1))) @ weights / (2j * np.pi * rates) ** order
    off = np.abs(gain - 1) > _EDGE
    return float(rates[np.argmax(off)]) if off.any() else 0.5
