"""Formats of the fixed-point strong form (pvid/strong_q31.h), with the proof that no input overflows.

The derivatives come from an integer bank that any counts within full scale leave below 2^30 (fir_q31.py). From there on
it is interval analysis by construction: products of two of them fit an int64 four times over, and every entry of a row
is brought below 2^28 or the row is refused. What remains to be chosen are two units:

- of time, T: the bank's times a power of the root of two, such that w is about 1 / T^2, at its upper bound below
  64 / T^2, and u of the largest acceleration below 32 / T^2. All powers of u + w_r then fill the same bits.
- of angles, for each family of entries (A, E, Y; -G^k phi''; -G^k phi): the motion that the rig file lets expect, a
  quarter of full scale at half the fastest rate, fills 25 of the 28 bits.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.fir import FirBank
from pvid.design.fir_q31 import integer_bank
from pvid.settings.tables import RATE_BITS, RowFormatQ31, StrongDesignQ31

Float = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

EXPECTED_BITS = 25  # of an entry of a row, without the sign
W_LIKELY = 1.5  # of the nominal w [1/T^2], at most
W_MOST = 64.0  # of w at its upper bound
RATE_MOST = 32.0  # of |u| and of w_r
SHIFT_MOST = 31
_EXPECTED_PART = 0.25  # of full scale, of phi and of the pivot's acceleration
_EXPECTED_RATE = 0.5  # of the fastest
_ONE, _ROOT_TWO = 2**30, round(2**30.5)


def strong_design_q31(
    bank: FirBank,
    sample_rate: float,
    l1: float,
    phi_lsb: float,
    y_lsb: float,
    phi_range: float,
    y_range: float,
    acceleration_range: float,
    rate: float,
    w: float,
    w_upper: float,
) -> StrongDesignQ31:
    """Formats for sensors that count in phi_lsb [rad] and y_lsb [m], within +-phi_range [rad] and +-y_range [m].

    Parameters
    ----------
    bank, sample_rate, l1
        Derivative filters, samples a second [Hz], length of rod 1 [m].
    acceleration_range
        Largest acceleration of the pivot that is taken in [m/s^2].
    rate
        Fastest rate of the motion [rad/s]: that of the bank's time unit, and of the ranges of u' and u''.
    w, w_upper
        The nominal w, from which the rows count it, and its upper bound [1/s^2].

    Raises
    ------
    PvidError
        Where a range is less than 16 counts, or something cannot be held.
    """
    apart = bank.stride * bank.every / sample_rate  # from tap to tap [s]
    integer = integer_bank(bank, round(phi_range / phi_lsb), round(y_range / y_lsb), rate * apart)
    tau = apart * 2.0**integer.tau_bits
    angle_unit = phi_lsb / integer.denominator * 2.0**-integer.phi_bits
    u_range = acceleration_range / l1
    most = min(W_LIKELY / w, W_MOST / w_upper, RATE_MOST / max(u_range, w))
    u_unit = y_lsb / integer.denominator / l1 * 2.0 ** (RATE_BITS - integer.y_bits)
    octaves = math.floor(math.log2(most / tau**2 * (1 - 1e-9)))  # of the square of the time unit
    octaves = min(octaves, (31 - math.frexp(u_unit)[1]) // 2)  # u'' is shifted to the right: points that are close
    dt = tau * 2.0 ** (octaves / 2)

    u_parts = [math.frexp(u_unit * 2.0 ** (octaves * order / 2)) for order in (2, 3, 4)]
    u_multiplier = tuple(min(round(mantissa * 2.0**31), 2**31 - 1) for mantissa, _ in u_parts)
    u_shift = tuple(31 - exponent for _, exponent in u_parts)
    if not 0 <= min(u_shift) <= max(u_shift) <= 62:
        raise PvidError(f"the fixed-point core cannot scale the pivot's acceleration: shifts of {u_shift} bits")

    halvings, of_x, of_z = (
        math.ceil(math.log2(expected / angle_unit)) - EXPECTED_BITS
        for expected in _largest_expected(phi_range, u_range, rate, w, dt)
    )
    phi_shift = (-of_z, *(octaves * order // 2 - halvings for order in range(1, 5)))
    if max(map(abs, phi_shift)) > SHIFT_MOST:
        raise PvidError(f"the fixed-point core cannot hold a row of the strong form: shifts of {phi_shift} bits")
    return StrongDesignQ31(
        bank=integer,
        row=RowFormatQ31(
            phi_shift=phi_shift,
            finer=(halvings - of_x, halvings - of_z),
            phi3=_ONE if octaves % 2 == 0 else _ROOT_TWO,
            reference=round(w * dt**2 * 2.0**RATE_BITS),
        ),
        u_multiplier=u_multiplier,
        u_shift=u_shift,
        angle_unit=angle_unit,
        tau=tau,
        row_angle=angle_unit * 2.0**halvings,
        dt=dt,
    )


def _largest_expected(phi_range: float, u_range: float, rate: float, w: float, dt: float) -> tuple[float, float, float]:
    """The largest entries of a row of the expected motion [rad], in the time unit dt: alone, of phi'', of phi."""
    expected = rate * dt * _EXPECTED_RATE
    phi = [phi_range * _EXPECTED_PART * expected**k for k in range(5)]
    u = [u_range * dt**2 * _EXPECTED_PART * expected**k for k in range(3)]
    g = u[0] + w * dt**2
    bracket = u[2] * phi[2] + 2 * u[1] * phi[3] + g * phi[4]
    y = bracket * g + 2 * u[1] ** 2 * phi[2]
    return max(bracket + g * phi[4], y, phi[4]), phi[2] * max(1.0, g**3), phi[0] * max(1.0, g**4)
