"""Twin of scaled_q31.c: numbers of any size with 30 digits, element by element."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pvid.twin.q31.integer import Int, bit_length, integers, round_shift, scale, upper_product

_DIGITS = 30
_NEWTON_STEPS = 4


class Scaled(NamedTuple):
    """m 2^e, elementwise."""

    m: Int
    e: Int

    def plus(self, other: Scaled) -> Scaled:
        """The sum."""
        first = self.e >= other.e
        more, less = pick(first, self, other), pick(first, other, self)
        total = scaled((more.m << 30) + scale(less.m << 30, np.maximum(more.e - less.e, 0)), more.e - 30)
        return pick(self.m == 0, other, pick(other.m == 0, self, total))

    def minus(self, other: Scaled) -> Scaled:
        """The difference."""
        return self.plus(Scaled(-other.m, other.e))

    def times(self, other: Scaled) -> Scaled:
        """The product."""
        return scaled(self.m * other.m, self.e + other.e)

    def over(self, other: Scaled) -> Scaled:
        """The quotient, other > 0: rounded towards 0 before its digits are counted."""
        wide = self.m << 30
        return scaled(np.sign(wide) * (np.abs(wide) // other.m), self.e - other.e - 30)

    def exceeds(self, other: Scaled) -> npt.NDArray[np.bool_]:
        """Where it is larger, other >= 0."""
        return np.asarray(self.minus(other).m > 0)

    def shifted(self, exponent: npt.ArrayLike) -> Scaled:
        """Times 2^exponent."""
        return Scaled(self.m, self.e + integers(exponent))

    def packed(self) -> Scaled:
        """What is left of it in one word: 20 bits, and an exponent within +-1000."""
        m = np.where(self.e < -1000, 0, (self.m >> 11) << 11)
        return Scaled(m, np.where(m == 0, -1024, np.minimum(self.e, 1000)))

    def fixed(self, bits: npt.ArrayLike) -> Int:
        """As integers of `bits` bits after the point, saturated."""
        return scale(self.m, -(self.e + integers(bits)))


def inverse_root(x: Scaled) -> Scaled:
    """1 / sqrt(x), x > 0, by Newton's method."""
    odd = x.e & 1
    m, exponent = x.m >> odd, x.e + 30 + odd
    y: Int = 1181116006 - 5 * (m >> 3)
    for _ in range(_NEWTON_STEPS):
        part = 4 * upper_product(m, 4 * upper_product(y, y))
        y = np.clip(8 * upper_product(y, 3 * 2**28 - part), 1 << 29, (1 << 30) - 1)
    return Scaled(y, -(exponent // 2) - 29)


def scaled(x: npt.ArrayLike, exponent: npt.ArrayLike) -> Scaled:
    """x 2^exponent."""
    value = integers(x)
    shift = bit_length(np.abs(value)) - _DIGITS
    up = np.maximum(-shift, 0)  # to 30 digits, which always fit
    return Scaled(round_shift(value << up, shift + up), integers(exponent) + shift)


def pick(where: npt.NDArray[np.bool_], a: Scaled, b: Scaled) -> Scaled:
    """a where it is so, else b."""
    return Scaled(np.where(where, a.m, b.m), np.where(where, a.e, b.e))
