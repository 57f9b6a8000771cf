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
    whole = x >> np.minimum(shift, 63)
    half = (x >> np.clip(shift - 1, 0, 63)) & 1
    return np.where(shift > 63, 0, whole + np.where(shift > 0, half, 0))


def scale(x: Int, s: npt.ArrayLike) -> Int:
    """x 2^-s, rounded half up where s > 0, saturated at WIDE where s < 0."""
    shift = integers(s)
    left = np.maximum(-shift, 0)
    fits = (bit_length(np.abs(x)) + left) <= 62
    shifted = np.where(x == 0, 0, np.where(fits, x << np.minimum(left, 62), np.sign(x) * WIDE))
    return np.where(shift < 0, shifted, round_shift(x, np.maximum(shift, 0)))


def clamp(x: Int, limit: int) -> Int:
    """x held within +-limit."""
    return np.clip(x, -limit, limit)


def bit_length(x: Int) -> Int:
    """Bits of x >= 0; 0 for 0."""
    rest = integers(x)
    length = np.zeros_like(rest)
    for step in (32, 16, 8, 4, 2, 1):
        large = rest >= (1 << step)
        length = length + np.where(large, step, 0)
        rest = np.where(large, rest >> step, rest)
    return length + (rest > 0)


def square_root(x: Int) -> Int:
    """Largest r with r^2 <= x, 0 <= x <= WIDE."""
    rest = integers(x)
    root = np.zeros_like(rest)
    for place in range(62, -1, -2):
        bit = np.int64(1 << place)
        trial = root + bit
        taken = rest >= trial
        rest = np.where(taken, rest - trial, rest)
        root = (root >> 1) + np.where(taken, bit, 0)
    return root


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
