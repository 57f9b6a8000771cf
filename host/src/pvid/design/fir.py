"""Design of the differentiator's FIR banks: derivatives of order 0 to 4 from one window of samples.

A bank is kept folded, as the C core uses it (differentiator.h): with x[c] the sample in the window's centre
and x[c+i], x[c-i] the points i strides away,

    q_i = (x[c+i] - x[c]) + (x[c-i] - x[c]),    d_i = x[c+i] - x[c-i],    i = 1..half
    order 0:      x[c] + sum w[0, i-1] q_i
    orders 2, 4:  rate^k sum w[k, i-1] q_i        rate = sample rate / (stride block)
    orders 1, 3:  rate^k sum w[k, i-1] d_i
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt
from numpy.polynomial import legendre

from pvid.base.errors import PvidError
from pvid.settings.tables import Folded

Float = npt.NDArray[np.float64]
Kind = Literal["finite-difference", "savitzky-golay"]

ORDERS = 5
MAX_DEGREE = 12
LONGEST_WINDOW = 8191  # samples: what PVID_MAX_WINDOW can be raised to


@dataclass(frozen=True, eq=False)
class FirBank(Folded):
    """Five symmetric FIR filters over one window, all for the instant of its centre.

    Attributes
    ----------
    weights : folded tables [5, half]; row k is the derivative of order k per point^k, at any sample rate
    stride : points from tap to tap
    kind : the method of design
    degree : highest degree of the polynomials on which all five orders are exact
    block : samples whose mean is a point; there is a result for each block
    """

    weights: Float
    stride: int
    kind: Kind
    degree: int
    block: int = 1

    @property
    def weights32(self) -> npt.NDArray[np.float32]:
        """The tables as the float32 core takes them, [5, half]."""
        return self.weights.astype(np.float32)

    def apply(self, x: npt.ArrayLike, sample_rate: float) -> Float:
        """Orders 0..4 [unit/s^k] of the samples x [n] taken at sample_rate [Hz].

        Returns
        -------
        Shape [5, n // block - 2 half stride]; column j belongs to sample j block + delay.
        """
        samples = np.asarray(x, np.float64)
        count = samples.size // self.every - self.memory + 1
        if count <= 0:
            raise PvidError(f"{samples.size} samples do not fill the differentiator's window of {self.window}")
        points = samples[: samples.size // self.every * self.every].reshape(-1, self.every).mean(axis=1)
        reach = self.half * self.stride
        centre = points[reach : reach + count]
        out = np.zeros((ORDERS, count))
        for i in range(1, self.half + 1):
            after = points[reach + i * self.stride :][:count]
            before = points[reach - i * self.stride :][:count]
            q = (after - centre) + (before - centre)
            d = after - before
            for order in range(ORDERS):
                out[order] += self.weights[order, i - 1] * (d if order % 2 else q)
        out[0] += centre
        rate = sample_rate / (self.stride * self.every)
        out *= rate ** np.arange(ORDERS)[:, np.newaxis]
        return out


@lru_cache(maxsize=64)
def finite_difference(stride: int = 1) -> FirBank:
    """Central differences on five points `stride` samples apart.

    Errors of order h^4 in orders 1 and 2, h^2 in orders 3 and 4, with h = stride / sample rate; order 0 is
    the centre sample itself. Exact on polynomials of degree 4.
    """
    _require_stride(stride)
    _require_window(5, stride)
    weights = np.array(
        [[0.0, 0.0], [8.0 / 12.0, -1.0 / 12.0], [16.0 / 12.0, -1.0 / 12.0], [-1.0, 1.0 / 2.0], [-4.0, 1.0]]
    )
    weights.setflags(write=False)
    return FirBank(weights, stride, "finite-difference", 4)


@lru_cache(maxsize=64)
def savitzky_golay(window: int, degree: int, stride: int = 1, block: int = 1) -> FirBank:
    """Derivatives at the centre of the least-squares polynomial through the window's points.

    With a block each point is the mean of `block` samples, and the polynomial is fitted to these means: exact on
    polynomials of the degree, whatever the block, at the cost of a bank of `window` points.

    Parameters
    ----------
    window : points in the window, odd and above `degree`
    degree : of the polynomial, 4..12
    stride : points from tap to tap
    block : samples of a point, odd

    Notes
    -----
    Even and odd polynomials are orthogonal on a symmetric window, so each half of the problem stands alone.
    Legendre polynomials keep it well conditioned where powers (scipy.signal.savgol_coeffs) lose every digit:
    degree 8 and more with over 100 points.
    """
    _require_stride(stride)
    if not 4 <= degree <= MAX_DEGREE:
        raise PvidError(f"a Savitzky-Golay polynomial must have degree 4 to {MAX_DEGREE}, not {degree}")
    if window % 2 == 0 or window <= degree:
        raise PvidError(f"a Savitzky-Golay window must be odd and above the degree {degree}, not {window} points")
    if block < 1 or block % 2 == 0:
        raise PvidError(f"the block of a Savitzky-Golay window must be odd, not {block} samples")
    _require_window(window, stride)
    if (window, block) == (5, 1):  # through five points there is one polynomial of degree 4: without rounding
        return replace(finite_difference(stride), kind="savitzky-golay")
    half = (window - 1) // 2
    offsets = (np.arange(block) - (block - 1) / 2) / (stride * block)  # of a block's samples from its centre [taps]
    weights = np.empty((ORDERS, half))
    for parity in (0, 1):
        degrees = list(range(parity, degree + 1, 2))
        points = np.arange(parity, half + 1)  # an odd polynomial vanishes at the centre
        # Each point but the centre stands for two.
        multiplicity = np.where(points == 0, 1.0, math.sqrt(2.0))
        of_samples = legendre.legvander((points[:, np.newaxis] + offsets) / half, degree)[..., degrees]
        basis = of_samples.mean(axis=1) * multiplicity[:, np.newaxis]
        q, r = np.linalg.qr(basis)
        for order in range(parity, ORDERS, 2):
            at_centre = np.array([_legendre_derivative(n, order) for n in degrees]) / float(half) ** order
            taps = q @ np.linalg.solve(r.T, at_centre) / multiplicity
            weights[order] = taps[points > 0]
    weights.setflags(write=False)
    return FirBank(weights, stride, "savitzky-golay", degree, block)


def _legendre_derivative(degree: int, order: int) -> float:
    """The derivative of the given order of P_degree at 0."""
    coefficients = np.zeros(degree + 1)
    coefficients[degree] = 1.0
    return float(legendre.legval(0.0, legendre.legder(coefficients, order)))


def _require_stride(stride: int) -> None:
    if stride < 1:
        raise PvidError(f"the stride of a differentiator must be 1 sample or more, not {stride}")


def _require_window(points: int, stride: int) -> None:
    samples = (points - 1) * stride + 1
    if samples > LONGEST_WINDOW:
        raise PvidError(
            f"a differentiator of {points} points, {stride} samples apart, spans {samples} samples, and no core takes "
            f"more than {LONGEST_WINDOW}"
        )
