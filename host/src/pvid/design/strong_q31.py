"""Formats of the fixed-point strong form (pvid/strong_q31.h), with the proof that no input overflows.

The derivatives come from an integer bank that any counts within full scale leave below 2^30 (differentiation_q31.py).
From there on it is interval analysis by construction: products of two of them fit an int64 four times over, and every
entry of a row is brought below 2^28 or the row is refused. What remains to be chosen are the formats: full scale alone
would leave them empty, since a square wave of full scale has derivatives a thousand times those of any motion. They
follow from the motion that the rig file lets expect: a quarter of full scale, at half the fastest rate, fills 22 of the
28 bits.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.fir import FirBank
from pvid.design.fir_q31 import integer_bank
from pvid.design.shaped_rounding import bits_for
from pvid.settings.tables import RowShiftsQ31, StrongDesignQ31

Float = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

EXPECTED_BITS = 23  # of an entry of a row, signed
FORMAT_MAX = 64
_EXPECTED_PART = 0.25  # of full scale, of phi and of the pivot's acceleration
_EXPECTED_RATE = 0.5  # of the fastest


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
) -> StrongDesignQ31:
    """Formats for sensors that count in phi_lsb [rad] and y_lsb [m], within +-phi_range [rad] and +-y_range [m].

    Parameters
    ----------
    bank, sample_rate, l1
        Derivative filters, samples a second [Hz], length of rod 1 [m].
    acceleration_range
        Largest acceleration of the pivot that is taken in [m/s^2].
    rate
        Fastest rate of the motion [rad/s]: that of the time unit, and of the ranges of u' and u''.

    Raises
    ------
    PvidError
        Where a range is less than 16 counts, or something cannot be held.
    """
    point = bank.stride / sample_rate
    integer = integer_bank(bank, round(phi_range / phi_lsb), round(y_range / y_lsb), rate * point)
    tau = point * 2.0**integer.tau_bits
    angle_unit = phi_lsb / integer.denominator * 2.0**-integer.phi_bits
    u_range = acceleration_range / l1 * tau**2
    orders = np.arange(3)
    u_bits = bits_for(float((u_range * (rate * tau) ** orders).max()), 31)
    mantissa, exponent = math.frexp(y_lsb / integer.denominator / l1 * 2.0 ** (u_bits - integer.y_bits))
    u_multiplier, u_shift = min(round(mantissa * 2.0**31), 2**31 - 1), 31 - exponent
    if not 0 <= u_shift <= 62:
        raise PvidError(f"the fixed-point core cannot scale the pivot's acceleration: a shift of {u_shift} bits")

    phi = [phi_range * _EXPECTED_PART / angle_unit * (rate * tau * _EXPECTED_RATE) ** k for k in range(5)]
    u = [u_range * _EXPECTED_PART * 2.0**u_bits * (rate * tau * _EXPECTED_RATE) ** k for k in range(3)]

    def shift_of(expected: float) -> int:
        shift = max(0, -bits_for(expected, EXPECTED_BITS))
        if shift > 62:
            raise PvidError(f"the fixed-point core cannot hold a row of the strong form: a shift of {shift} bits")
        return shift

    def powers(order: int, count: int) -> tuple[tuple[int, ...], list[int]]:
        """Shifts of -x, -u x .., and the formats they lead to."""
        shifts, formats, expected, bits = [], [], phi[order], 0
        for k in range(count):
            if k:
                expected, bits = expected * u[0], bits + u_bits
            shift = shift_of(expected)
            expected, bits = expected / 2.0**shift, bits - shift
            shifts.append(shift)
            formats.append(bits)
        return tuple(shifts), formats

    n_phi2, phi2_bits = powers(2, 4)
    n_phi0, phi0_bits = powers(0, 5)
    parts = [u[2 - k] * phi[2 + k] for k in range(3)]  # u'' phi'', u' phi''', u phi''''
    n_a = shift_of(parts[0] + 2 * parts[1] + 2 * parts[2])
    bracket = parts[0] + 2 * parts[1] + parts[2]
    part = shift_of(bracket)
    y = shift_of((bracket * u[0] + 2 * u[1] ** 2 * phi[2]) / 2.0**part)
    n_e = shift_of(phi[4])
    n_bits = (u_bits - n_a, -n_e, *phi2_bits[::-1], *phi0_bits[::-1])
    y_bits = 2 * u_bits - part - y
    if max(abs(b) for b in (*n_bits, y_bits)) > FORMAT_MAX:
        raise PvidError("the strong form's row needs formats that the fixed-point core does not have")
    return StrongDesignQ31(
        bank=integer,
        row=RowShiftsQ31(n_a=n_a, n_e=n_e, n_phi2=n_phi2, n_phi0=n_phi0, part=part, y=y),
        u_multiplier=u_multiplier,
        u_shift=u_shift,
        u_bits=u_bits,
        n_bits=n_bits,
        y_bits=y_bits,
        angle_unit=angle_unit,
        dt=tau,
    )
