"""Design of the weak form's front end: FIR filters for the angle and the pivot's acceleration before decimation by D.

A filter of order 0 (value) or 2 (second derivative) is symmetric and minimises, in the least-squares sense,

    its relative error in the pass band |f| < pass_hz, where the motion is,
    what decimation folds into the pass band: the bands of that width about multiples of sample_rate / D,
    and, much less, its gain elsewhere (noise).

Polynomials up to degree 4 pass exactly. A Savitzky-Golay filter of the same length folds a hundred times as much of the
pivot sensor's noise (ten times in amplitude), which costs a factor of two in the standard errors at 16 bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError

Float = npt.NDArray[np.float64]

# Weights of a squared error in the pass band, of the gain in the folding bands (1) and of the gain elsewhere.
_PASS = 1e6
_ELSEWHERE = 1e-4
# Where the wanted response is small (order 2 near 0 Hz) errors are relative to this share of its value at the edge.
_SHARE = 0.02
# A design is good when its pass band errs by no more than this and folds no more than this (rms gain over that of the
# pass band's edge): measured on the standard rig at 16 bits, 8e-4 and more biases w by half its standard error.
GOOD_PASS_ERROR = 5e-5
GOOD_FOLDED_GAIN = 5e-3
# The filter is exact for polynomials up to this degree.
_DEGREE = 4
MIN_TAPS = 2 * _DEGREE + 1


@dataclass(frozen=True, eq=False)
class Fir:
    """One symmetric filter.

    Attributes
    ----------
    weights : folded taps [(taps - 1) / 2], in units of 1/sample^order: x0 + sum w q_i or sum w q_i with
        q_i = (x[c+i] - x[c]) + (x[c-i] - x[c])
    pass_error : largest error in the pass band, relative to the wanted response
    folded_gain : rms gain in the folding bands, over the wanted response at the pass band's edge
    """

    weights: Float
    pass_error: float
    folded_gain: float


@dataclass(frozen=True, eq=False)
class Decimator:
    """The pair of filters of a front end: `smooth` for the angle, `second` for the pivot."""

    taps: int
    decimation: int
    smooth: Fir
    second: Fir

    @property
    def badness(self) -> float:
        """How many times the worse of error and folded gain exceeds what is good; at most 1 when good."""
        return max(
            max(one.pass_error / GOOD_PASS_ERROR, one.folded_gain / GOOD_FOLDED_GAIN)
            for one in (self.smooth, self.second)
        )


def fir(taps: int, decimation: int, order: int, edge: float) -> Fir:
    """One filter.

    Raises PvidError when the length is even or below 9, or the pass band reaches half the sample rate.

    Parameters
    ----------
    taps : length [samples], odd
    decimation : D
    order : of the derivative, 0 or 2
    edge : of the pass band [cycles per sample], below 0.5
    """
    if taps % 2 == 0 or taps < MIN_TAPS:
        raise PvidError(f"taps must be odd and at least {MIN_TAPS}, not {taps}")
    if not 0 < edge < 0.5:
        raise PvidError(f"the pass band must end below half the sample rate, not at {edge:g} cycles per sample")
    half = (taps - 1) // 2
    points = np.arange(half + 1)
    frequency = np.union1d(np.linspace(0.0, 0.5, max(401, 4 * taps)), edge)
    responses = 2 * np.cos(2 * math.pi * np.outer(frequency, points))
    responses[:, 0] = 1.0
    wanted = np.ones_like(frequency) if order == 0 else -((2 * math.pi * frequency) ** 2)
    at_edge = 1.0 if order == 0 else (2 * math.pi * edge) ** 2
    inside = frequency <= edge
    nearest = np.round(frequency * decimation)
    folding = (np.abs(frequency - nearest / decimation) < edge) & (nearest > 0) & ~inside
    relative = np.maximum(np.abs(wanted), _SHARE * at_edge)
    weight = np.where(folding, 1.0, math.sqrt(_ELSEWHERE)) / at_edge
    weight[inside] = math.sqrt(_PASS) / relative[inside]
    target = np.where(inside, wanted, 0.0)
    taps_half = _constrained(responses * weight[:, None], target * weight, *_exactness(half, order))
    response = responses @ taps_half
    error = np.abs(response - wanted)[inside] / relative[inside]
    gain = math.sqrt(float(np.mean(response[folding] ** 2))) / at_edge if folding.any() else 0.0
    weights = taps_half[1:].copy()
    weights.setflags(write=False)
    return Fir(weights, float(error.max()), gain)


def _exactness(half: int, order: int) -> tuple[Float, Float]:
    """Constraints a h = b under which polynomials up to _DEGREE pass exactly; x runs from 0 to 1 over the half."""
    x = np.arange(half + 1) / half
    powers = range(0, _DEGREE + 1, 2)
    a = np.array([x**power * np.where(x == 0, 1.0, 2.0) for power in powers])
    b = np.zeros(len(a))
    if order == 0:
        b[0] = 1.0
    else:
        b[1] = 2.0 / half**2
    return a, b


def _constrained(a: Float, b: Float, c: Float, d: Float) -> Float:
    """x of least |a x - b| under c x = d, by the null space of c.

    Normal equations and one refinement: equal to a decomposition of `a` to 1e-11, in a tenth of its time.
    """
    q, r = np.linalg.qr(c.T, mode="complete")
    n = len(c)
    fixed = np.linalg.solve(r[:n].T, d)
    particular = q[:, :n] @ fixed
    rest = q[:, n:]
    inner, target = a @ rest, b - a @ particular
    normal = inner.T @ inner
    free = np.linalg.solve(normal, inner.T @ target)
    free += np.linalg.solve(normal, inner.T @ (target - inner @ free))
    return np.asarray(particular + rest @ free)


@lru_cache(maxsize=256)
def pair(taps: int, decimation: int, edge: float) -> Decimator:
    """Both filters of a front end of this length."""
    return Decimator(taps, decimation, fir(taps, decimation, 0, edge), fir(taps, decimation, 2, edge))


def shortest(decimation: int, edge: float, most_taps: int) -> Decimator:
    """The shortest good pair of filters up to `most_taps`, or the longest.

    Parameters
    ----------
    decimation : D
    edge : of the pass band [cycles per sample]; counts to two digits, upwards
    most_taps : longest allowed
    """
    return _shortest(decimation, _rounded_up(edge), most_taps)


@lru_cache(maxsize=1024)
def _shortest(decimation: int, edge: float, most_taps: int) -> Decimator:
    longest = most_taps - 1 + most_taps % 2
    lengths = sorted({min(round(length) | 1, longest) for length in _LENGTHS})
    low, high = 0, len(lengths) - 1
    while low < high:  # longer filters are better ones
        middle = (low + high) // 2
        if pair(lengths[middle], decimation, edge).badness <= 1:
            high = middle
        else:
            low = middle + 1
    return pair(lengths[high], decimation, edge)


def _rounded_up(x: float) -> float:
    digit = 10.0 ** (math.floor(math.log10(x)) - 1)
    return math.ceil(x / digit - 1e-9) * digit


_LENGTHS = tuple(float(length) for length in np.geomspace(MIN_TAPS, 1023, 28))
