"""Twin of integer_q31.h: integer arithmetic that never wraps, element by element on int64 arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Int = npt.NDArray[np.int64]

WIDE = 2**62  # largest magnitude of an int64 here: a sum of two still fits


def integers(values: npt.ArrayLike) -> Int:
    """As int64."""
    return np.asarray(values, np.int64)


def round_shift(x: Int, s: npt.ArrayLike) -> Int:
    """x 2^-s rounded half up, s >= 0."""
    shift = integers(s)
    twice = x >> np.minimum(np.maximum(shift - 1, 0), 63)  # of the result, but for a shift of 0
    rounded = (twice >> 1) + (twice & 1)
    return np.where(shift > 63, 0, np.where(shift > 0, rounded, x))


def scale(x: Int, s: npt.ArrayLike) -> Int:
    """x 2^-s, rounded half up where s > 0, saturated at WIDE where s < 0."""
    shift = integers(s)
    right = round_shift(x, np.maximum(shift, 0))
    if (shift >= 0).all():
        return right
    left = np.minimum(np.maximum(-shift, 0), 62)
    fits = np.abs(x) <= (np.int64(WIDE - 1) >> left)  # of x, bits and shift are 62 at most
    shifted = np.where(fits, x << left, np.sign(x) * WIDE)
    return np.where(shift < 0, shifted, right)


def clamp(x: Int, limit: int) -> Int:
    """x held within +-limit."""
    return np.minimum(np.maximum(x, -limit), limit)


def bit_length(x: Int) -> Int:
    """Bits of x >= 0; 0 for 0."""
    values = integers(x)
    exponent = np.frexp(values.astype(np.float64))[1].astype(
        np.int64
    )  # of the nearest float: 2^exponent may be above x
    return exponent - ((values > 0) & (values < (np.int64(1) << np.maximum(exponent - 1, 0))))


def square_root(x: Int) -> Int:
    """Largest r with r^2 <= x, 0 <= x <= WIDE."""
    values = integers(x)
    root = np.sqrt(values.astype(np.float64)).astype(np.int64)  # the nearest float's: one off at most
    root = root - (root * root > values)
    return root + ((root + 1) * (root + 1) <= values)


def reciprocal(x: Int) -> tuple[Int, Int]:
    """(m, k) with 1/x = m 2^(k - 61), 2^30 <= m < 2^31, for 1 <= x < 2^31."""
    k = 31 - bit_length(x)
    m = np.int64(2**61) // (x << k)
    return np.minimum(m, 2**31 - 1), k


def times_q31(a: Int, b: Int) -> Int:
    """a b 2^-31 rounded half up, |a| <= WIDE, |b| < 2^31."""
    return (a >> 31) * b + round_shift((a & (2**31 - 1)) * b, 31)


def root_of(m: Int, exponent: Int) -> tuple[Int, Int]:
    """(r, e) with r 2^e = sqrt(m 2^exponent), r below 2^31, 0 <= m <= WIDE."""
    up = 62 - bit_length(m)
    up = up - ((exponent - up) & 1)
    return square_root(scale(m, -up)), (exponent - up) // 2
