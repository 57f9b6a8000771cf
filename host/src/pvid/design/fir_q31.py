"""FIR banks in integers (pvid/differentiator_q31.h), with the proof that no counts within full scale overflow.

All orders come out in one format in one time unit tau = 2^tau_bits points: one unit of order k is
2^-bits / denominator counts per tau^k. Products of derivatives whose orders add up to the same then need no alignment.

With a block of samples each point is their sum, which is exact and up to `block` times full scale; the denominator
makes it the mean that the design in float64 means.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.fir import ORDERS, FirBank
from pvid.design.shaped_rounding import bits_for, shaped, slow_factor
from pvid.settings.tables import FirBankQ31

Float = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

Y_LOWEST = 2  # of the orders of y that are computed
COUNTS_LIMIT = 2**24
DERIVATIVE_BITS = 31  # signed, and half of it is left free: |derivative| <= 2^30 - 2
FIVE_POINTS_DENOMINATOR = 12

# What moves slowly, for which the rounding errors of the weights are chosen: rates up to the fastest expected one.
_RATES = 32
_OWN_WEIGHT = 1e-12


def largest_sums(weights: Int32, centre: int, full_scale: int) -> list[int]:
    """Largest |sum| of each order over all points within +-full_scale: each with the sign of its weight."""
    largest = []
    for order in range(ORDERS):
        row = [int(w) for w in weights[order]]
        at_centre = (centre if order == 0 else 0) - (2 * sum(row) if order % 2 == 0 else 0)
        largest.append((2 * sum(abs(w) for w in row) + abs(at_centre)) * full_scale)
    return largest


@lru_cache(maxsize=64)
def integer_bank(bank: FirBank, phi_max: int, y_max: int, rate_max: float) -> FirBankQ31:
    """The integers of a bank.

    Parameters
    ----------
    bank
        The design in float64.
    phi_max, y_max
        Full scale of the sensors [counts].
    rate_max
        Fastest rate of the motion [rad per point]: tau is about its reciprocal.

    Raises
    ------
    PvidError
        Where counts within full scale could overflow.
    """
    for name, counts in (("phi_range", phi_max), ("y_range", y_max)):
        if not 16 <= counts <= COUNTS_LIMIT // bank.block:
            most = "2^24" if bank.block == 1 else f"2^24 / {bank.block}, samples of a block,"
            raise PvidError(f"{name} is {counts} counts of the sensor and the fixed-point core takes 16 to {most}")
    phi_point, y_point = phi_max * bank.block, y_max * bank.block
    full_scale = max(phi_point, y_point)
    if bank.kind == "finite-difference":
        denominator, tau_bits = FIVE_POINTS_DENOMINATOR, 0
        weights = np.rint(bank.weights * denominator).astype(np.int32)
        weight_bits, centre = [0] * ORDERS, denominator
    else:
        denominator, tau_bits = bank.block, max(0, round(-math.log2(rate_max)))
        weights, weight_bits = _rounded(bank, full_scale, rate_max)
        centre = 1 << weight_bits[0]
    for order in range(ORDERS):
        reach = full_scale * (2 if order % 2 else 4)
        if bank.block == 1 and np.abs(weights[order].astype(np.int64)).max() * reach >= 2**31:
            raise PvidError(f"the full scale of {full_scale} counts is too many for the derivative {order}")
    weights.setflags(write=False)
    margins: dict[str, float] = {}

    def shifts(name: str, full_scale: int, lowest: int) -> tuple[tuple[int, ...], int]:
        largest = largest_sums(weights, centre, full_scale)
        orders = range(lowest, ORDERS)
        needed = {k: max(0, -bits_for(largest[k], DERIVATIVE_BITS)) for k in orders}
        bits = min(weight_bits[k] - k * tau_bits - needed[k] for k in orders)
        found = tuple(weight_bits[k] - k * tau_bits - bits for k in orders)
        for k, shift in zip(orders, found, strict=True):
            margins[f"{name}{k}"] = DERIVATIVE_BITS - 1 - math.log2(max(largest[k] / 2.0**shift, 1.0))
            if shift > 62:
                raise PvidError(f"the derivative {k} of {name} needs a shift of {shift} bits: shorten the window")
        return found, bits

    phi_shift, phi_bits = shifts("phi", phi_point, 0)
    y_shift, y_bits = shifts("y", y_point, Y_LOWEST)
    return FirBankQ31(
        weights=weights,
        stride=bank.stride,
        centre=centre,
        phi_max=phi_max,
        y_max=y_max,
        phi_shift=phi_shift,
        y_shift=y_shift,
        denominator=denominator,
        phi_bits=phi_bits,
        y_bits=y_bits,
        tau_bits=tau_bits,
        margins=margins,
        block=bank.block,
    )


def _rounded(bank: FirBank, full_scale: int, rate_max: float) -> tuple[Int32, list[int]]:
    """Weights as integers and their formats: without a block a weight times a difference of counts fits 32 bits.

    The rounding errors of an order are chosen such that motion up to rate_max hardly sees them. With blocks there are
    few weights to choose, and points of many bits: there a weight has all of its 31 bits.
    """
    rates = rate_max * np.arange(1, _RATES + 1) / _RATES
    angle = np.arange(1, bank.half + 1)[:, None] * rates
    even, odd = 2 * (np.cos(angle) - 1), 2 * np.sin(angle)
    out = np.zeros(bank.weights.shape, np.int32)
    formats = []
    for order in range(ORDERS):
        reach = full_scale * (2 if order % 2 else 4)
        largest = float(np.abs(bank.weights[order]).max())
        room = bits_for(largest * reach * 1.01, 32) if bank.block == 1 else bits_for(largest * 1.01, 31)
        bits = min(room, 62 if order else 30)
        # relative to what the derivative of a motion of that rate is
        seen = (odd if order % 2 else even) / rates**order
        out[order] = shaped(bank.weights[order] * 2.0**bits, slow_factor(seen / np.abs(seen).max(), _OWN_WEIGHT))
        formats.append(bits)
    return out, formats
