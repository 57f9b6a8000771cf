"""Filter for the second derivative of a signal: exact in a pass band, little noise beyond it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

_GRID = 4001
_EXACT = 1e6  # weight of the pass band, relative to what is wanted there
_LEAST_WANTED = 0.02  # of the pass band's edge: below it the weight grows no more
_NOISE = 1e-6  # weight of white noise
_DIGITS = 22  # binary digits of the largest weight behind its first one; one is left for the centre's


def _left_of_means(frequency: Float, ratio: int) -> Float:
    """Response of means of `ratio` samples whose droop is undone to second order."""
    mean = np.sinc(frequency) / np.sinc(frequency / ratio)
    droop = (1.0 - 1.0 / ratio**2) / 24.0
    return np.asarray(mean * (1.0 + 2.0 * droop * (1.0 - np.cos(2.0 * np.pi * frequency))))


def second_derivative(half: int, pass_band: float, ratio: int = 1) -> Float:
    """Symmetric weights [half + 1], centre first, per squared step.

    Least squares over all frequencies, exact for polynomials to degree 4. In the pass band they undo what is left of
    the droop of means of `ratio` samples, which refine_front_f32.c undoes to second order.

    Parameters
    ----------
    half : steps on each side
    pass_band : highest frequency that is not to be changed [cycles a step], < 0.5
    ratio : samples of a step
    """
    place = np.arange(half + 1)
    frequency = np.linspace(0.0, 0.5, _GRID)
    response = 2.0 * np.cos(2.0 * np.pi * np.outer(frequency, place))
    response[:, 0] = 1.0
    edge = (2.0 * np.pi * pass_band) ** 2
    inside = frequency < pass_band
    wanted = np.where(inside, -((2.0 * np.pi * frequency) ** 2) / _left_of_means(frequency, ratio), 0.0)
    size = np.maximum(np.abs(wanted), _LEAST_WANTED * edge)
    root = np.where(inside, np.sqrt(_EXACT) / size, np.sqrt(_NOISE) / edge)
    degrees = np.array([0, 2, 4])
    moments = np.where(place == 0, 1.0, 2.0) * (place / half) ** degrees[:, None]
    target = np.array([0.0, 2.0 / half**2, 0.0])
    # not by normal equations: their rounding leaves errors of 1e-5 in the pass band, which are errors of w
    q, r = np.linalg.qr(moments.T, mode="complete")
    first = q[:, : degrees.size] @ np.linalg.solve(r[: degrees.size].T, target)
    free = q[:, degrees.size :]
    rest = np.linalg.lstsq((response @ free) * root[:, None], root * (wanted - response @ first), rcond=None)[0]
    return np.asarray(first + free @ rest)


def as_float32(weights: Float) -> npt.NDArray[np.float32]:
    """The weights in float32, still exact for constants, and for parabolas to a few quanta.

    All are multiples of one quantum, so that their sums are exact.
    """
    place = np.arange(len(weights)).astype(np.int64)
    quantum = 2.0 ** (np.floor(np.log2(np.abs(weights).max())) - _DIGITS)
    counts = np.rint(weights / quantum).astype(np.int64)
    missing = round(float(place**2 @ (weights / quantum))) - int(place**2 @ counts)
    for one in place[:0:-1]:
        if abs(missing) >= one**2:
            more = 1 if missing > 0 else -1
            counts[one] += more
            missing -= more * int(one) ** 2
    counts[0] = -2 * counts[1:].sum()
    return np.asarray(counts * quantum, np.float32)
