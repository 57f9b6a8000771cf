"""Twin of kapitza_physical_q31.c: the pendulum's physical parameters from fixed-point estimates, in integers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.q31 import ScaleQ31
from pvid.twin.q31.integer import WIDE, Int, bit_length, clamp, integers, root_of, round_shift, scale

_D_BITS = 30  # of d1, d2 and L2
_INT32_MAX = 2**31 - 1
_W, _D1, _D2 = range(3)


def _times_over(a: Int, b: Int, c: Int) -> Int:
    """a b / c, rounded down; 0 <= a < 2^62, 0 <= b < 2^31, c > 0. Saturates at half of WIDE."""
    up = 62 - bit_length(a)
    quotient = scale(a, -up) // c
    down = bit_length(quotient) - 31
    mantissa = np.minimum(scale(quotient, down), 1 << 31)
    return clamp(scale(mantissa * b, up - down), WIDE // 2)


def _combined(x: Int, y: Int, r: Int) -> Int:
    """sqrt(x^2 + y^2 + 2 r x y), r in Q30."""
    exponent = np.maximum(bit_length(np.abs(x)), bit_length(np.abs(y))) - 29
    m, n = scale(x, exponent), scale(y, exponent)
    square = m * m + n * n + round_shift(m * n, 29) * r
    root, e = root_of(np.maximum(square, 0), 2 * exponent)
    return scale(root, -e)


def physical(estimates: npt.NDArray[np.void], unit: ScaleQ31) -> tuple[Int, Int, npt.NDArray[np.bool_]]:
    """pvid_kapitza_physical_q31 of estimates [n], dtype estimates.Q31.

    Returns
    -------
    (g, l2, rho2) and their standard errors in 2^-24, int64 [n, 3] each, and whether there are any [n]; 0 where not.
    """
    p, se = estimates["p"].astype(np.int64), estimates["se"].astype(np.int64)
    d1 = scale(p[:, _D1], unit.d1_bits - _D_BITS)
    d2 = scale(p[:, _D2], unit.d2_bits - _D_BITS)
    big_l2 = d1 - d2 - (1 << _D_BITS)
    inside = (p[:, _W] > 0) & (d2 > 0) & (big_l2 > 0)
    d2, big_l2 = np.where(inside, d2, 1), np.where(inside, big_l2, 1)
    w = np.where(inside, p[:, _W], 0)
    root, e = root_of(big_l2, integers(-_D_BITS))
    root = scale(root, -(e + _D_BITS))
    l1 = integers(unit.l1)
    g = scale(w * unit.g_multiplier, unit.g_shift)
    l2 = _times_over(big_l2, l1, d2)
    rho2 = _times_over(root, l1, d2)
    inside &= (g <= _INT32_MAX) & (l2 <= _INT32_MAX) & (rho2 <= _INT32_MAX)
    g, l2, rho2 = (np.where(inside, x, 0) for x in (g, l2, rho2))
    s1 = scale(se[:, _D1], unit.d1_bits - _D_BITS)
    s2 = scale(se[:, _D2], unit.d2_bits - _D_BITS)
    r = estimates["correlation"][:, _D1, _D2].astype(np.int64)
    l2_1 = _times_over(s1, l1, d2)
    l2_2 = -(_times_over(s2, l1, d2) + _times_over(s2, l2, d2))
    rho2_1 = _times_over(s1, rho2, 2 * big_l2)
    rho2_2 = -(_times_over(s2, rho2, 2 * big_l2) + _times_over(s2, rho2, d2))
    g_se = scale(se[:, _W] * unit.g_multiplier, unit.g_shift)
    errors = [clamp(x, _INT32_MAX) for x in (g_se, _combined(l2_1, l2_2, r), _combined(rho2_1, rho2_2, r))]
    values = np.stack([g, l2, rho2], axis=1)
    return values, np.where(inside[:, None], np.stack(errors, axis=1), 0), inside
