"""Twin of kapitza_weak_q31.c: theta and its Jacobian in the weak form, as int64 of fixed formats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvid.twin.blocks import Blocks
from pvid.twin.q31.integer import Int, round_shift, times_q31
from pvid.twin.q31.scaled import Scaled

W, D1, D2, C = range(4)
_UP = 15  # p of 31 bits becomes 46, as a product of two of them shifted right by 16
_DOWN = 16


@dataclass(frozen=True)
class ScaledModelQ31:
    """pvid_scaled_model_q31: theta [n_theta, ...] and the non-zeros of C [n_c, ...] of p [n_p, ...], of any size."""

    theta: Callable[[Scaled], Scaled]
    jacobian: Callable[[Scaled], Scaled]


@dataclass(frozen=True)
class ModelQ31:
    """pvid_model_q31: theta and the non-zeros of C as int64 within +-2^60, and their formats."""

    n_theta: int
    n_p: int
    positive: tuple[bool, ...]
    c_row: tuple[int, ...]
    c_column: tuple[int, ...]
    theta: Callable[[Int], Int]
    jacobian: Callable[[Int], Int]
    formats: Callable[[Sequence[int]], tuple[list[int], list[int]]]
    noisy: tuple[int, int] | None = None  # entries of N that hold the sensor's noise
    kind_end: tuple[int, ...] = ()  # one past the last theta of each kind of rows; empty: one kind
    scaled: ScaledModelQ31 | None = None  # in place of theta, jacobian and formats

    @cached_property
    def blocks(self) -> Blocks:
        """The kinds in theta and among the moments."""
        return Blocks(self.kind_end or (self.n_theta,))

    @property
    def moments(self) -> int:
        """Entries of M on and above the diagonals of its blocks."""
        return self.blocks.moments

    @property
    def n_sums(self) -> int:
        """M, B, yy, weight."""
        return self.blocks.n_sums


def _product(a: Int, b: Int) -> Int:
    return round_shift(a * b, _DOWN)


def _zeroed_theta(p: Int) -> list[Int]:
    d2w = _product(p[D2], p[W])
    return [p[D1] << _UP, _product(p[D1], p[W]), p[D2] << _UP, d2w, times_q31(d2w, p[W])]


def _theta(p: Int) -> list[Int]:
    d2c = _product(p[D2], p[C])
    d2cw = times_q31(d2c, p[W])
    return [*_zeroed_theta(p), d2c, d2cw, times_q31(d2cw, p[W])]


def _one(p: Int) -> Int:
    return np.full_like(p[0], 1 << 45)


def _zeroed_jacobian(p: Int) -> list[Int]:
    theta = _zeroed_theta(p)
    w = p[W] << _UP
    return [theta[0], theta[2], 2 * theta[3], _one(p), w, _one(p), w, _product(p[W], p[W])]


def _jacobian(p: Int) -> list[Int]:
    theta = _theta(p)
    w = p[W] << _UP
    ww = _product(p[W], p[W])
    c = p[C] << _UP
    cw = _product(p[C], p[W])
    by_w = [theta[0], theta[2], 2 * theta[3], theta[5], 2 * theta[6]]
    return [*by_w, _one(p), w, _one(p), w, ww, c, cw, times_q31(cw, p[W]), theta[2], theta[3], theta[4]]


def _formats(bits: Sequence[int]) -> tuple[list[int], list[int]]:
    """Formats of theta and of the non-zeros of C from those of p."""
    w, d1, d2, c = bits
    d2w = d2 + w - _DOWN
    d2c = d2 + c - _DOWN
    cw = c + w - _DOWN
    theta = [d1 + _UP, d1 + w - _DOWN, d2 + _UP, d2w, d2w + w - 31, d2c, d2c + w - 31, d2c + 2 * (w - 31)]
    by_w = [theta[0], theta[2], d2w, d2c, theta[6]]
    by_d2 = [45, w + _UP, 2 * w - _DOWN, c + _UP, cw, cw + w - 31]
    return theta, [*by_w, 45, w + _UP, *by_d2, theta[2], d2w, theta[4]]


def _zeroed_formats(bits: Sequence[int]) -> tuple[list[int], list[int]]:
    theta, c = _formats([*bits, 0])
    return theta[:5], [*c[:3], *c[5:10]]


WEAK = ModelQ31(
    n_theta=8,
    n_p=4,
    positive=(True, True, True, False),
    c_row=(1, 3, 4, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 5, 6, 7),
    c_column=(W, W, W, W, W, D1, D1, D2, D2, D2, D2, D2, D2, C, C, C),
    theta=lambda p: np.stack(_theta(p)),
    jacobian=lambda p: np.stack(_jacobian(p)),
    formats=_formats,
    noisy=(1, 4),
)

ZEROED = ModelQ31(
    n_theta=5,
    n_p=3,
    positive=(True, True, True),
    c_row=(1, 3, 4, 0, 1, 2, 3, 4),
    c_column=(W, W, W, D1, D1, D2, D2, D2),
    theta=lambda p: np.stack(_zeroed_theta(p)),
    jacobian=lambda p: np.stack(_zeroed_jacobian(p)),
    formats=_zeroed_formats,
    noisy=(1, 4),
)
