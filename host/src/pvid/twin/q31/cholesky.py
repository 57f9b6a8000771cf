"""Twin of cholesky_q31.c: factor and solve an equilibrated symmetric system of small order, in Q30."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.twin.q31.integer import Int, bit_length, clamp, round_shift, scale
from pvid.twin.q31.scaled import inverse_root, scaled

Mask = npt.NDArray[np.bool_]

ONE = 2**30
PIVOT_SHIFT = 20  # a pivot below 2^-20 of its diagonal entry is rounding, not data
RHS_BITS = 20  # of a right-hand side: U^-1 makes it grow by 2^10 at most


def half_exponent(diagonal: Int) -> Int:
    """e such that diagonal 2^(-2 e) lies in [2^28, 2^30), for diagonal > 0."""
    return (bit_length(diagonal) - 29) >> 1


@dataclass
class Factor:
    """S = U U^T in Q30, lanes last: u [n, n, lanes], 1/U_jj = inverse_j 2^(k_j - 31) in Q30, [n, lanes] each."""

    u: Int
    inverse: Int
    k: Int
    first_pivot: Int
    least_pivot: Int
    ok: Mask


def divide(total: Int, inverse: Int, k: Int, limit: int) -> Int:
    """total 2^-30 times the reciprocal in Q30, within +-limit."""
    return clamp(round_shift(clamp(round_shift(total, 30), 2**31 - 1) * inverse, 31 - k), limit)


def factor(s: Int) -> Factor:
    """From the upper triangle of S [n, n, lanes], diagonal in [2^28, 2^30)."""
    n, _, lanes = s.shape
    u = np.zeros_like(s)
    inverse = np.zeros((n, lanes), np.int64)
    k = np.zeros((n, lanes), np.int64)
    ok = np.ones(lanes, np.bool_)
    least = np.full(lanes, ONE, np.int64)
    for j in range(n - 1, -1, -1):
        diagonal = s[j, j]
        pivot = diagonal << 30
        for i in range(j + 1, n):
            pivot = pivot - u[j, i] * u[j, i]
        ok = ok & (diagonal >= 2**28) & (pivot >= (diagonal << (30 - PIVOT_SHIFT)))
        pivot = np.where(ok, pivot, np.int64(1) << 60)
        relative = pivot // np.maximum(diagonal, 1)
        least = np.minimum(least, relative)
        root = inverse_root(scaled(pivot, 0))
        inverse[j], k[j] = 2 * root.m, root.e + 60
        for i in range(j):
            total = s[i, j] << 30
            for m in range(j + 1, n):
                total = total - u[i, m] * u[j, m]
            u[i, j] = divide(total, inverse[j], k[j], ONE)
    return Factor(u, inverse, k, np.where(ok, np.minimum(relative, ONE), 0), np.where(ok, least, 0), ok)


def lower_solve(f: Factor, rhs: Int) -> Int:
    """U^-1 rhs [n, lanes], |rhs| < 2^RHS_BITS."""
    n = len(rhs)
    x = np.zeros_like(rhs)
    for i in range(n - 1, -1, -1):
        total = rhs[i] << 30
        for m in range(i + 1, n):
            total = total - f.u[i, m] * x[m]
        x[i] = divide(total, f.inverse[i], f.k[i], ONE)
    return x


def upper_solve(f: Factor, rhs: Int) -> Int:
    """U^-T rhs [n, lanes], |rhs| < 2^RHS_BITS."""
    x = np.zeros_like(rhs)
    for i in range(len(rhs)):
        total = rhs[i] << 30
        for m in range(i):
            total = total - f.u[m, i] * x[m]
        x[i] = divide(total, f.inverse[i], f.k[i], ONE)
    return x


def to_block(x: Int, bits: int) -> tuple[Int, Int]:
    """x [n, lanes] with one exponent a lane: (x 2^-h within `bits` bits, h)."""
    h = bit_length(np.abs(x)).max(axis=0) - bits
    return scale(x, h), h


def solve(f: Factor, rhs: Int) -> tuple[Int, Int]:
    """(x, h) with S^-1 rhs = x 2^h, [n, lanes] and [lanes]."""
    first, h1 = to_block(rhs, RHS_BITS)
    middle, h2 = to_block(lower_solve(f, first), RHS_BITS)
    return upper_solve(f, middle), h1 + h2
