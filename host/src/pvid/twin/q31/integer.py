"""Twin of integer_q31.h: integer arithmetic that never wraps, element by element on int64 arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Int = npt.NDArray[np.int64]

WIDE = 2**62  # largest magnitude of an int64 here: a sum of two still fits


def integers(values: npt.ArrayLike) -> Int:
    """As int64."""
    return np.asarray(values, np.int64)


def round_shift(x: Int, s: npt.ArrayLike | int) -> Int:
    """x 2^-s rounded half up, s >= 0."""
    if isinstance(s, int):
        if s == 0:
            return x
        twice: Int = x >> min(s - 1, 63)  # of the result, which is its larger half
        return twice - (twice >> 1)
    shift = integers(s)
    one = np.minimum(shift, 1)  # 0 where nothing is shifted
    twice = x >> np.minimum(shift - one, 63)
    return (twice >> one) + (twice & one)


def upper_product(a: Int | int, b: Int | int) -> Int:
    """a b 2^-32 rounded down, |a|, |b| < 2^31."""
    return np.asarray((integers(a) * b) >> 32)


def shifted_with_rest(x: Int, s: npt.ArrayLike) -> Int:
    """x 2^-s rounded down along the last axis, where each entry gets what the one before it lost."""
    whole = np.cumsum(x, axis=-1) >> integers(s)
    return np.diff(whole, axis=-1, prepend=0)


def scale(x: Int, s: npt.ArrayLike) -> Int:
    """x 2^-s, rounded half up where s > 0, saturated at WIDE where s < 0."""
    shift = integers(s)
    rising = shift < 0
    if not rising.any():
        return round_shift(x, shift)
    left = np.minimum(np.maximum(-shift, 0), 62)
    fits = np.abs(x) <= (np.int64(WIDE - 1) >> left)  # of x, bits and shift are 62 at most
    shifted = x << left
    if not fits.all():
        shifted = np.where(fits, shifted, np.sign(x) * WIDE)
    if rising.all():
        return shifted
    return np.where(rising, shifted, round_shift(x, np.maximum(shift, 0)))


def clamp(x: Int, limit: int) -> Int:
    """x held within +-limit."""
    return np.minimum(np.maximum(x, -limit), limit)


def bit_length(x: Int) -> Int:
    """Bits of x >= 0; 0 for 0."""
    values = integers(x)
    # Without its second bit a number is not rounded up to the next power of two: its float's exponent is its length.
    exponent = (values & ~(values >> 1)).astype(np.float64).view(np.int64) >> 52
    found: Int = np.maximum(exponent - 1022, 0)
    return found


def square_root(x: Int) -> Int:
    """Largest r with r^2 <= x, 0 <= x <= WIDE."""
    values = integers(x)
    root = np.sqrt(values.astype(np.float64)).astype(np.int64)  # the nearest float's: one off at most
    root = root - (root * root > values)
    return root + ((root + 1) * (root + 1) <= values)


def times_q31(a: Int, b: Int) -> Int:
    """a b 2^-31 rounded half up, |a| <= WIDE, |b| < 2^31."""
    return (a >> 31) * b + round_shift((a & (2**31 - 1)) * b, 31)


def root_of(m: Int, exponent: Int) -> tuple[Int, Int]:
    """(r, e) with r 2^e = sqrt(m 2^exponent), r below 2^31, 0 <= m <= WIDE."""
    up = 62 - bit_length(m)
    up = up - ((exponent - up) & 1)
    return square_root(scale(m, -up)), (exponent - up) // 2
