"""Integers that are shifted and rounded, and numbers of 30 digits: the arithmetic of the fixed-point core, by hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


def _scaled(x: int, s: int) -> int:
    if s >= 0:
        return (x + (1 << s >> 1)) >> s
    return min(max(x << -s, -(2**62)), 2**62)


scaled = np.frompyfunc(_scaled, 2, 1)  # x 2^-s: rounded half up where s > 0, within +-2^62 where s < 0
within = np.frompyfunc(lambda x, limit: min(max(x, -limit), limit), 2, 1)  # x within +-limit
bits = np.frompyfunc(lambda x: abs(x).bit_length(), 1, 1)  # of |x|


def block(x: Any, digits: int = 20) -> tuple[Any, int]:
    """x = m 2^e [..], the largest m of so many digits: m and e."""
    e = int(max(bits(x))) - digits
    return scaled(x, e), e


def half(diagonal: Any) -> Any:
    """h [..] where diagonal 2^-2h has 29 or 30 bits."""
    return (bits(diagonal) - 29) >> 1


@dataclass(frozen=True)
class Digits:
    """m 2^e: |m| is 2^29 to 2^30, or 0. The result of a sum or a product is rounded half up (pvid/scaled_q31.h)."""

    m: int
    e: int

    @classmethod
    def of(cls, x: int, e: int = 0, most: int = 64) -> Digits:
        """x 2^e; the product 2^60 of two numbers has `most` = 60 bits."""
        shift = min(abs(x).bit_length(), most) - 30
        return cls(_scaled(x, shift), e + shift)

    def fixed(self, point: int) -> int:
        """Times 2^point, as an integer."""
        return _scaled(self.m, -self.e - point)

    def __neg__(self) -> Digits:
        return Digits(-self.m, self.e)

    def __add__(self, other: Digits) -> Digits:
        if self.m == 0 or other.m == 0:
            return self if self.m else other
        more, less = (self, other) if self.e >= other.e else (other, self)
        return Digits.of((more.m << 30) + _scaled(less.m << 30, more.e - less.e), more.e - 30)

    def __sub__(self, other: Digits) -> Digits:
        return self + -other

    def __mul__(self, other: Digits) -> Digits:
        return Digits.of(self.m * other.m, self.e + other.e, 60)

    def __rmul__(self, x: int) -> Digits:
        return Digits.of(x) * self

    def inverse_root(self) -> Digits:
        """1 / sqrt: four steps of Newton's method, y (3 - x y^2) / 2, from 2.2 - 1.25 x; x in Q30, y in Q29."""
        x, e = (self.m >> 1, self.e + 31) if self.e % 2 else (self.m, self.e + 30)
        y = 1181116006 - 5 * (x >> 3)
        for _ in range(4):
            rest = 805306368 - 4 * ((x * (4 * (y * y >> 32))) >> 32)
            y = min(max(8 * ((y * rest) >> 32), 2**29), 2**30 - 1)
        return Digits(y, -(e // 2) - 29)


def _split(x: Digits | int) -> tuple[int, int]:
    one = x if isinstance(x, Digits) else Digits.of(x)
    return one.m, one.e


split = np.frompyfunc(_split, 1, 2)  # m and e of numbers or integers [..]
numbers = np.frompyfunc(Digits.of, 2, 1)  # x 2^e
fixed = np.frompyfunc(Digits.fixed, 2, 1)
