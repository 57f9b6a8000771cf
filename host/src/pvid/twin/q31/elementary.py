"""Twin of elementary_q31.h: sine, cosine, sign, products and quotients in integers, element by element."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.twin.q31.integer import Int, integers, round_shift
from pvid.twin.q31.scaled import Scaled, pick, scaled

ONE = 1 << 30

_HALF_TURNS = 1367130551
_HALF_TURNS_BITS = 32
_ANGLE_BITS = 30
_SMALL_EXPONENT = -45
_POLYNOMIAL = (-1879182, 22020091, -160859250, 684554113, -1387197326, 843314856)
_POLYNOMIAL_BITS = 28


def _sine_of_half_turns(h: Int, bits: npt.ArrayLike | int) -> Int:
    places = integers(bits)
    half = np.int64(1) << (places - 1)
    from_half = np.abs(h) + half
    rest = (from_half & ((np.int64(1) << places) - 1)) - half  # |h| less the nearest integer
    y = round_shift(rest, places - _ANGLE_BITS)
    z = round_shift(y * y, _ANGLE_BITS)
    total: Int = np.full_like(y, _POLYNOMIAL[0])
    for coefficient in _POLYNOMIAL[1:]:
        total = round_shift(total * z, _ANGLE_BITS) + coefficient
    found = np.clip(round_shift(y * total, _POLYNOMIAL_BITS), -ONE, ONE)
    is_odd = ((from_half >> places) & 1) != 0
    return np.where(is_odd != (h < 0), -found, found)


def sine(x: npt.ArrayLike, bits: npt.ArrayLike | int) -> Int:
    """pvid_sin_q31: in Q30 of x 2^-bits [rad]."""
    return _sine_of_half_turns(integers(x) * _HALF_TURNS, integers(bits) + _HALF_TURNS_BITS)


def cosine(x: npt.ArrayLike, bits: npt.ArrayLike | int) -> Int:
    """pvid_cos_q31: in Q30 of x 2^-bits [rad]."""
    whole = integers(bits) + _HALF_TURNS_BITS
    return _sine_of_half_turns(integers(x) * _HALF_TURNS + (np.int64(1) << (whole - 1)), whole)


def sign(v: npt.ArrayLike) -> Int:
    """pvid_sign_q31: -1, 0 or 1 in Q30."""
    return np.sign(integers(v)) * ONE


def soft_sign(v: npt.ArrayLike, width: int) -> Int:
    """pvid_soft_sign_q31: v / (|v| + width) in Q30."""
    given = integers(v)
    return _towards_0(given << 30, np.abs(given) + width)


_TWO_OVER_LN_2 = 193635251
_POWER_BITS = 26
_POWER_OF_HALF = (117454, -1369790, 10286509, -59583045, 257938938, -744260975, 1073741823)


def tanh(v: npt.ArrayLike, width: int) -> Int:
    """pvid_tanh_q31: tanh(v / width) in Q30."""
    given = integers(v)
    t = np.abs(given) * _TWO_OVER_LN_2 // width
    near = np.minimum(t, 31 << _POWER_BITS)
    f = near & (2**_POWER_BITS - 1)
    total = np.full_like(f, _POWER_OF_HALF[0])
    for coefficient in _POWER_OF_HALF[1:]:
        total = ((total * f) >> _POWER_BITS) + coefficient
    e = total >> (near >> _POWER_BITS)
    whole = np.where(t < 31 << _POWER_BITS, ((ONE - e) * ONE) // (ONE + e), ONE)
    return np.sign(given) * whole


def shift(x: npt.ArrayLike, s: int) -> Int:
    """pvid_fixed_shift_q31: x 2^-s rounded half up."""
    return round_shift(integers(x), s)


def product(a: npt.ArrayLike, b: npt.ArrayLike, s: int) -> Int:
    """pvid_fixed_product_q31: a b 2^-s rounded half up."""
    return round_shift(integers(a) * integers(b), s)


def quotient(a: npt.ArrayLike, b: npt.ArrayLike, s: int) -> Int:
    """pvid_fixed_quotient_q31: a 2^s / b rounded towards 0, 0 for b = 0."""
    return _towards_0(integers(a) << s, integers(b))


def _towards_0(a: Int, b: Int) -> Int:
    size = np.abs(a) // np.where(b == 0, 1, np.abs(b))
    return np.where(b == 0, 0, np.sign(a) * np.sign(b) * size)


def magnitude(x: npt.ArrayLike) -> Int:
    """pvid_fixed_magnitude_q31."""
    return np.abs(integers(x))


def within(x: Int, limits: Sequence[int]) -> npt.NDArray[np.bool_]:
    """pvid_within_limits_q31 of x [entries, ...]."""
    bound = integers(limits).reshape(-1, *[1] * (x.ndim - 1))
    return np.asarray((np.abs(x) <= bound).all(axis=0))


def constant(m: int, e: int, like: Scaled) -> Scaled:
    """A literal, as many as there are of `like`."""
    return Scaled(np.full_like(like.m, m), np.full_like(like.e, e))


def negated(a: Scaled) -> Scaled:
    """pvid_scaled_negated_q31."""
    return Scaled(-a.m, a.e)


def scaled_quotient(a: Scaled, b: Scaled) -> Scaled:
    """pvid_scaled_quotient_q31: for b of any sign, 0 for b = 0."""
    none = b.m == 0
    above = pick(b.m < 0, negated(a), a)
    below = pick(b.m < 0, negated(b), b)
    found = above.over(Scaled(np.where(none, 1, below.m), below.e))
    return Scaled(np.where(none, 0, found.m), np.where(none, 0, found.e))


def _angle(a: Scaled) -> tuple[Int, Int]:
    """The angle with at most 30 bits after the point, and how many; 0 where it is too small or too large."""
    bits = np.minimum(np.maximum(-a.e, 0), -_SMALL_EXPONENT)
    usable = (a.e >= _SMALL_EXPONENT) & (a.e <= 0)
    x = round_shift(np.where(usable, a.m, 0), np.maximum(bits - _ANGLE_BITS, 0))
    return x, np.minimum(bits, _ANGLE_BITS)


def scaled_sine(a: Scaled) -> Scaled:
    """pvid_scaled_sin_q31."""
    found = scaled(sine(*_angle(a)), np.full_like(a.e, -30))
    beyond = scaled(np.zeros_like(a.m), np.zeros_like(a.e))
    return pick((a.m == 0) | (a.e < _SMALL_EXPONENT), a, pick(a.e > 0, beyond, found))


def scaled_cosine(a: Scaled) -> Scaled:
    """pvid_scaled_cos_q31."""
    found = scaled(cosine(*_angle(a)), np.full_like(a.e, -30))
    beyond = scaled(np.zeros_like(a.m), np.zeros_like(a.e))
    one = scaled(np.ones_like(a.m), np.zeros_like(a.e))
    return pick((a.m == 0) | (a.e < _SMALL_EXPONENT), one, pick(a.e > 0, beyond, found))


def scaled_sign(a: Scaled) -> Scaled:
    """pvid_scaled_sign_q31."""
    return scaled(sign(a.m), np.full_like(a.e, -30))


def scaled_magnitude(a: Scaled) -> Scaled:
    """pvid_scaled_magnitude_q31."""
    return Scaled(np.abs(a.m), a.e)
