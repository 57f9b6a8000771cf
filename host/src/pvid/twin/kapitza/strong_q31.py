"""Twin of kapitza_strong_q31.c: the strong form's rows, theta and its Jacobian in integers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.settings.tables import RowShiftsQ31
from pvid.twin.kapitza.weak_q31 import ModelQ31
from pvid.twin.q31.estimator import ROW_LIMIT
from pvid.twin.q31.integer import Int, clamp, integers, round_shift, times_q31

Mask = npt.NDArray[np.bool_]

W, D1, D2 = range(3)
_UP = 27  # p of 31 bits becomes 58, as a product of two of them shifted right by 4
_DOWN = 4
_N_THETA = 11
_POWERS_OF_W = np.array([1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4], np.int64)  # how often it is a factor of theta_i


class _Taker:
    """Shifts to the formats of a row, and remembers which rows [ticks] did not fit."""

    def __init__(self, ticks: int) -> None:
        self.fits = np.ones(ticks, np.bool_)

    def take(self, x: Int, shift: int) -> Int:
        rounded = round_shift(x, shift)
        self.fits &= np.abs(rounded) <= ROW_LIMIT
        return clamp(rounded, ROW_LIMIT)

    def powers(self, x: Int, u: Int, shifts: Sequence[int]) -> list[Int]:
        """-x, -u x, -u^2 x .., each from the one before."""
        found = [self.take(-x, shifts[0])]
        for shift in shifts[1:]:
            found.append(self.take(u * found[-1], shift))
        return found


def rows(shifts: RowShiftsQ31, phi: Int, u: Int) -> tuple[Int, Int, Mask]:
    """Rows from phi [ticks, 5] and u, u', u'' [ticks, 3]: N [ticks, 11], Y [ticks] and whether they fit [ticks]."""
    taker = _Taker(len(phi))
    u0, u1, u2 = u.T
    u0_phi4 = u0 * phi[:, 4]
    bracket = u2 * phi[:, 2] + 2 * (u1 * phi[:, 3]) - u0_phi4
    a = taker.take(bracket, shifts.part)
    b = taker.take(u1 * phi[:, 2], shifts.part)
    y = taker.take(2 * (u1 * b) - u0 * a, shifts.y)
    n = np.empty((len(phi), _N_THETA), np.int64)
    n[:, 0] = taker.take(bracket - u0_phi4, shifts.n_a)
    n[:, 1] = taker.take(-phi[:, 4], shifts.n_e)
    for k, power in enumerate(taker.powers(phi[:, 2], u0, shifts.n_phi2)):
        n[:, 5 - k] = power
    for k, power in enumerate(taker.powers(phi[:, 0], u0, shifts.n_phi0)):
        n[:, 10 - k] = power
    return n, y, taker.fits


def sensitivity(terms: Int) -> Int:
    """w times the gradient in w of N^T theta, from N_i theta_i [11, lanes]."""
    return np.asarray(_POWERS_OF_W @ terms)


def _product(a: Int, b: Int) -> Int:
    return round_shift(a * b, _DOWN)


def _powers(p: Int, w: Int) -> Int:
    """p w, p w^2, p w^3 and p w^4 [4, n, lanes] from p [n, lanes] and w of 31 bits: the first is a product."""
    found = [_product(p, w)]
    for _ in range(3):
        found.append(times_q31(found[-1], w))
    return np.stack(found)


def theta(p: Int) -> Int:
    """f(p) [11, lanes]."""
    w = p[W]
    d1, d2 = _powers(p[D1:], w).transpose(1, 0, 2)
    by_d1 = [p[D1] << _UP, 3 * d1[0], 3 * d1[1], d1[2]]
    return np.stack([w << _UP, _product(w, w), *by_d1, p[D2] << _UP, d2[0], 3 * d2[1], d2[2], d2[3]])


def jacobian(p: Int) -> Int:
    """Non-zeros of d theta / d p [18, lanes]."""
    w = p[W]
    (w2, w3, w4, _), d1, d2 = _powers(p, w).transpose(1, 0, 2)
    one = np.full_like(w, 1 << (30 + _UP))
    first = w << _UP
    by_w = [one, first, 3 * (p[D1] << _UP), 3 * d1[0], 3 * d1[1], p[D2] << _UP, 3 * d2[0], 3 * d2[1], d2[2]]
    return np.stack([*by_w, one, 3 * first, 3 * w2, w3, one, first, 3 * w2, w3, w4])


def _formats(bits: Sequence[int]) -> tuple[list[int], list[int]]:
    """Formats of theta and of the non-zeros of C from those of p."""
    w, d1, d2 = bits
    down = w - 31
    w1, w2 = w + _UP, 2 * w - _DOWN
    d1w, d2w = d1 + w - _DOWN, d2 + w - _DOWN
    one = 30 + _UP
    d1, d2 = d1 + _UP, d2 + _UP
    by_d2 = [d2, d2w - 2, d2w + down - 1, d2w + 2 * down - 2, d2w + 3 * down]
    by_w = [one, w1 - 1, d1, d1w - 1, d1w + down, d2 - 2, d2w - 2, d2w + down - 2, d2w + 2 * down - 2]
    by_d = [one, w1, w2, w2 + down, one, w1 - 2, w2 - 1, w2 + down - 2, w2 + 2 * down]
    return [w1, w2, d1, d1w, d1w + down, d1w + 2 * down, *by_d2], [*by_w, *by_d]


STRONG = ModelQ31(
    n_theta=_N_THETA,
    n_p=3,
    positive=(True, True, True),
    c_row=(0, 1, 3, 4, 5, 7, 8, 9, 10, 2, 3, 4, 5, 6, 7, 8, 9, 10),
    c_column=(W,) * 9 + (D1,) * 4 + (D2,) * 5,
    theta=theta,
    jacobian=jacobian,
    formats=_formats,
)


def accelerations(d_y: Int, multiplier: int, shift: int) -> Int:
    """u, u', u'' from the derivatives of y [ticks, 3]."""
    return round_shift(d_y * integers(multiplier), shift)
