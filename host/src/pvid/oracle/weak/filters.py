"""Filters that give values and derivatives of signals: polynomials at the samples, and block sums before decimation.

D samples make a step. The block sums are a comb filter of order 2, weights 1, 2, .., D, .., 2, 1 over D^2, with zeros
where frequencies fold onto 0. A filter at the steps, a compensator, gives the value or a derivative from its output:
exact at a few frequencies of the motion, with the least noise of all that are. A compensator that is right only on
average biases the parameters (evidence: half-window sums of a driven pivot).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
from numpy.polynomial import legendre

from pvid.base.errors import PvidError

Float = npt.NDArray[np.float64]

# Relative error of a filter at the edge of its band.
_EDGE = 1e-4
_FREQUENCIES = 2000  # at which the edge is sought

# Frequencies at which a compensator is exact, over the highest frequency of the motion, by their number.
_NODES = {2: (0.57, 1.05), 4: (0.3, 0.58, 0.85, 1.05)}

_HIGHEST_NODE = 0.42  # of the rate of the steps


def comb_gain(hz: Float, decimation: int, sample_rate: float) -> Float:
    """Of the block sums."""
    x = np.asarray(hz) / sample_rate
    ratio = np.where(x == 0, 1.0, np.sin(np.pi * x * decimation) / (decimation * np.sin(np.pi * np.where(x, x, 0.5))))
    return np.asarray(ratio**2)


def nodes_of(order: int, degree: int) -> int:
    """How many a compensator has that takes the place of a polynomial of this degree: 4 where that is for derivatives.

    With 3, y'' of a driven pivot at 42 steps a second biases w by 1.4 standard deviations of a 40 s run with 16 bits.
    """
    return 4 if order and degree >= 5 else 2


@cache
def compensator(
    decimation: int, sample_rate: float, order: int, half: int, band_hz: float, count: int
) -> tuple[float, ...]:
    """Weights at the steps that give a derivative of this order [1 / s^order], [2 half + 1].

    Parameters
    ----------
    half : steps on either side, at least `count`
    band_hz : highest frequency of the motion
    count : of frequencies at which it is exact, 2 or 4
    """
    if half < count:
        raise PvidError(f"a compensator with {count} nodes has {count} steps on either side or more")
    rate = sample_rate / decimation
    band = min(band_hz, _HIGHEST_NODE / 1.05 * rate)
    unit = (2 * np.pi * band) ** order
    places = np.arange(1, half + 1)

    def base(hz: Float) -> Float:
        angle = 2 * np.pi / rate * np.outer(hz, places)
        gain = comb_gain(hz, decimation, sample_rate)[:, np.newaxis]
        if order % 2:
            return np.asarray(2 * np.sin(angle) * gain)
        return np.asarray((2 * np.cos(angle) - 2) * gain)

    def wanted(hz: Float) -> Float:
        # Without the unit of the imaginary part; of a value what the centre alone, a weight of 1, leaves to do.
        sign = -1.0 if order % 4 in (2, 3) else 1.0
        value = sign * (2 * np.pi * hz) ** order / unit
        return np.asarray(value - comb_gain(hz, decimation, sample_rate) if order == 0 else value)

    nodes = band * np.array(_NODES[count])
    exact, target = base(nodes), wanted(nodes)
    found = np.linalg.lstsq(exact, target, rcond=None)[0]
    free = np.linalg.svd(exact)[2][len(nodes) :].T
    if free.size:
        each = np.stack([at_samples(decimation, _both_sides(one, order)) for one in np.eye(half)], axis=1)
        fixed = at_samples(decimation, _both_sides(np.zeros(half), order))
        each = each - fixed[:, np.newaxis]
        found = found + free @ np.linalg.lstsq(each @ free, -(fixed + each @ found), rcond=None)[0]
    return _both_sides(np.asarray(found * unit, np.float64), order)


def _both_sides(side: Float, order: int) -> tuple[float, ...]:
    """A filter from the weights on one side, outwards."""
    if order % 2:
        return (*(-side[::-1]), 0.0, *side)
    return (*side[::-1], (1.0 if order == 0 else 0.0) - 2 * float(side.sum()), *side)


@cache
def at_samples(decimation: int, weights: tuple[float, ...]) -> Float:
    """The block sums and a filter at the steps as one filter at the samples [2 D (half + 1) + 1].

    Its outermost weights are 0: the first step with samples on both sides is that of the second whole block.
    """
    ramp = np.convolve(np.ones(decimation), np.ones(decimation)) / decimation**2
    spread = np.zeros((len(weights) - 1) * decimation + 1)
    spread[::decimation] = weights
    return np.pad(np.convolve(spread, ramp), 1)


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
