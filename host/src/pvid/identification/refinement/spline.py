"""Splines of order five through equally spaced samples, as polynomials: scipy's takes a third of a second to import.

Between two samples the spline is that of six coefficients of cardinal B-splines: sample i is
(c_(i-2) + 26 c_(i-1) + 66 c_i + 26 c_(i+1) + c_(i+2))/120. The inverse of this filter falls by 0.43 a sample, so that
coefficients far from the ends are a short convolution of the samples. At the ends the first and the last three
intervals have one polynomial each (not-a-knot).
"""

from __future__ import annotations

from math import comb

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

ORDER = 5
_FAR = 60  # samples: 0.43^60 is below what a double holds
_SAMPLE = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120
_SIXTH = np.array([comb(6, k) * (-1.0) ** k for k in range(7)])  # difference: of the fifth derivative at a sample
# Of B_5 on its six intervals: coefficient of s^power in the share of c_(i-2+k) between samples i and i + 1.
_BASIS = (
    np.array(
        [
            [1, -5, 10, -10, 5, -1],
            [26, -50, 20, 20, -20, 5],
            [66, 0, -60, 0, 30, -10],
            [26, 50, 20, -20, -20, 10],
            [1, 5, 10, 10, 5, -5],
            [0, 0, 0, 0, 0, 1],
        ]
    )
    / 120
)


class Spline:
    """Through samples [n], 6 at least, at first, first + step, ...: n - 1 polynomials, the ends' go on beyond."""

    def __init__(self, first: float, step: float, samples: Float) -> None:
        self._first, self._step = first, step
        c = _coefficients(np.asarray(samples, np.float64))
        self._polynomials = np.lib.stride_tricks.sliding_window_view(c, 6) @ _BASIS  # [intervals, powers]

    def __call__(self, t: Float, slope: bool = False) -> Float:
        """Values at times [...], or slopes."""
        s = (t - self._first) / self._step
        interval = np.clip(s.astype(np.int64), 0, len(self._polynomials) - 1)
        s = s - interval
        own = self._polynomials.T
        if slope:
            own = own[1:] * (np.arange(1, 6) / self._step)[:, np.newaxis]
        out = own[-1][interval]
        for power in own[-2::-1]:
            out = out * s + power[interval]
        return np.asarray(out)


def _coefficients(x: Float) -> Float:
    """c_-2 .. c_(n + 1) of samples [n]."""
    n = len(x)
    if n < 2 * _FAR + 2:
        return _solved(x)
    angle = 2 * np.pi * np.arange(4 * _FAR) / (4 * _FAR)
    inverse = np.fft.ifft(120 / (66 + 52 * np.cos(angle) + 2 * np.cos(2 * angle))).real
    taps = np.concatenate([inverse[-_FAR:], inverse[: _FAR + 1]])
    inner = np.convolve(x, taps, "valid")  # c_FAR .. c_(n - 1 - FAR)
    head = _solved(x[:_FAR], inner[:2])  # whose samples reach two coefficients of the inner ones
    tail = _solved(x[: -_FAR - 1 : -1], inner[:-3:-1])[::-1]
    return np.concatenate([head, inner, tail])


def _solved(x: Float, known: Float | None = None) -> Float:
    """Coefficients of a beginning [n + 2] from its samples [n] and the two that are known behind it; of all samples
    [n + 4] where none are."""
    n = len(x)
    smooth, whole = np.zeros((2, n + 4)), np.zeros((n, n + 4))
    for k in range(2):
        smooth[k, k : k + 7] = _SIXTH
    for k, weight in enumerate(_SAMPLE):
        whole[range(n), np.arange(n) + k] = weight
    right = np.concatenate([np.zeros(2), x])
    if known is None:
        return np.linalg.solve(np.concatenate([smooth, whole, smooth[:, ::-1]]), np.append(right, np.zeros(2)))
    matrix = np.concatenate([smooth, whole])
    return np.asarray(np.linalg.solve(matrix[:, :-2], right - matrix[:, -2:] @ known))
