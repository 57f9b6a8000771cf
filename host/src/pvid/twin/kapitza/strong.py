"""Twin of kapitza_row_f32.h, kapitza_sums_f32.c and kapitza_project_f32.h: row, sums and projection of the strong form.

Everything has a trailing lane axis; p is float32 [3, lanes]. A row is float32 [6, lanes]: A, E, Y, -phi'', -phi, u.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

N_THETA = 11
N_P = 3
ROWS = 4  # of a block

AA, AE, EE, YA, YE, YY = range(6)
A2, E2, Y2, A0, E0, Y0, K22, K20, K00, WEIGHT = 6, 10, 14, 18, 23, 28, 33, 40, 48, 57
SUMS = 58
# Families of powers of u: their first place, their number, their factors as places in a row.
_A, _E, _Y, _F2, _F0, _U = range(6)
_PAIRS = ((_A, _A), (_A, _E), (_E, _E), (_Y, _A), (_Y, _E), (_Y, _Y))
_FAMILIES = (
    *((A2, 4, _A, _F2), (E2, 4, _E, _F2), (Y2, 4, _Y, _F2), (A0, 5, _A, _F0), (E0, 5, _E, _F0), (Y0, 5, _Y, _F0)),
    *((K22, 7, _F2, _F2), (K20, 8, _F2, _F0), (K00, 9, _F0, _F0)),
)

_F = np.float32


def rows(phi: Float32, u: Float32) -> Float32:
    """pvid_kapitza_row_f32 [ticks, 6] for phi [ticks, 5] and u [ticks, 3]."""
    u0, u1, u2 = u[:, 0], u[:, 1], u[:, 2]
    phi0, phi2, phi3, phi4 = phi[:, 0], phi[:, 2], phi[:, 3], phi[:, 4]
    with np.errstate(all="ignore"):
        two_u0, two_u1 = _F(2) * u0, _F(2) * u1
        y = (((u0 * u0) * phi4) - ((two_u0 * u1) * phi3)) + (((two_u1 * u1) - (u0 * u2)) * phi2)
        a = ((two_u1 * phi3) - (two_u0 * phi4)) + (u2 * phi2)
        return np.stack([a, -phi4, y, -phi2, -phi0, u0], axis=1)


def regressors(row: Float32) -> tuple[Float32, Float32]:
    """N [ticks, 11] and Y [ticks] of the theory page, as pvid_kapitza_strong_row_f32, from rows [ticks, 6]."""
    n = np.empty((len(row), N_THETA), np.float32)
    n[:, 0], n[:, 1], n[:, 5], n[:, 10] = row[:, _A], row[:, _E], row[:, _F2], row[:, _F0]
    with np.errstate(all="ignore"):
        for i in (4, 3, 2, 9, 8, 7, 6):
            n[:, i] = row[:, _U] * n[:, i + 1]
    return n, row[:, _Y]


def squares(row: Float32) -> Float32:
    """pvid_kapitza_row_squares_f32 [lanes]."""
    a, e, y, f2, f0, u = row
    u2 = u * u
    high2 = (u * u2) * f2
    high0 = (u2 * u2) * f0
    bound: Float32 = ((((((y * y) + (a * a)) + (e * e)) + (f2 * f2)) + (f0 * f0)) + (high2 * high2)) + (high0 * high0)
    return bound


def terms(row: Float32) -> Float32:
    """What a row adds to the sums but the weight [WEIGHT, lanes]."""
    out = np.empty((WEIGHT, row.shape[1]), np.float32)
    for place, (left, right) in enumerate(_PAIRS):
        out[place] = row[left] * row[right]
    u = row[_U]
    for first, count, left, right in _FAMILIES:
        power = row[left] * row[right]
        for place in range(first + count - 1, first, -1):
            out[place] = power
            power = power * u
        out[first] = power
    return out


def innovate(p: Float32, row: Float32) -> tuple[Float32, Float32]:
    """e = Y - N^T theta [lanes] and C^T N [3, lanes]."""
    w, d1, d2 = p
    a, e, y, f2, f0, u = row
    g = u + w
    g2 = g * g
    g2_f2 = g2 * f2
    g3_f0 = g * (g2 * f0)
    n_1 = g * g2_f2
    n_2 = g * g3_f0
    n_w = (a + ((w + w) * e)) + (((_F(3) * d1) * g2_f2) + ((_F(4) * d2) * g3_f0))
    return (y - (w * (a + (w * e)))) - ((d1 * n_1) + (d2 * n_2)), np.stack([n_w, n_1, n_2])


def squared(g: Float32) -> Float32:
    """g g^T, upper triangle by rows [6, lanes]."""
    return np.stack([g[0] * g[0], g[0] * g[1], g[0] * g[2], g[1] * g[1], g[1] * g[2], g[2] * g[2]])


def _pair(m: Float32, w: Float32, coefficients: list[Float32]) -> tuple[Float32, Float32]:
    """<a b G^r> and <a b G^(r+1)> of a family m."""
    low = _along(m[1:], coefficients)
    return low, _along(m, coefficients) + (w * low)


def _along(m: Float32, coefficients: list[Float32]) -> Float32:
    total: Float32 = m[0]
    for i, c in enumerate(coefficients):
        total = total + c * m[i + 1]
    return total


def _triple(m: Float32, w: Float32, coefficients: list[Float32]) -> tuple[Float32, Float32, Float32]:
    """<a b G^r>, <a b G^(r+1)>, <a b G^(r+2)> of a family m."""
    s0, s1, s2 = (_along(m[first:], coefficients) for first in (2, 1, 0))
    mid = s1 + (w * s0)
    return s0, mid, (s2 + (w * s1)) + (w * mid)


def project(p: Float32, sums: Float32) -> tuple[Float32, Float32, Float32]:
    """S [6, lanes], F [3, lanes] and theta^T M theta - 2 theta^T B [lanes] of the values of the sums."""
    w, d1, d2 = p
    w2 = w * w
    w3 = w2 * w
    w4 = w2 * w2
    two_w, three_d1, four_d2 = _F(2) * w, _F(3) * d1, _F(4) * d2
    r2 = [two_w, w2]
    r3 = [_F(3) * w, _F(3) * w2, w3]
    r4 = [_F(4) * w, _F(6) * w2, _F(4) * w3, w4]
    r5 = [_F(5) * w, _F(10) * w2, _F(10) * w3, _F(5) * w4, w4 * w]
    r6 = [_F(6) * w, _F(15) * w2, _F(20) * w3, _F(15) * w4, _F(6) * (w4 * w), w3 * w3]
    k22_low, k22_mid, k22_high = _triple(sums[K22:K20], w, r4)
    k20_low, k20_mid, k20_high = _triple(sums[K20:K00], w, r5)
    k00_low, k00_mid, k00_high = _triple(sums[K00:WEIGHT], w, r6)
    a2_low, a2_high = _pair(sums[A2:E2], w, r2)
    e2_low, e2_high = _pair(sums[E2:Y2], w, r2)
    y2_low, y2_high = _pair(sums[Y2:A0], w, r2)
    a0_low, a0_high = _pair(sums[A0:E0], w, r3)
    e0_low, e0_high = _pair(sums[E0:Y0], w, r3)
    y0_low, y0_high = _pair(sums[Y0:K22], w, r3)
    aa, ae, ee, ya, ye, _ = sums[:A2]

    x_2 = a2_low + (two_w * e2_low)
    x_0 = a0_low + (two_w * e0_low)
    x_x = (aa + (two_w * ae)) + (two_w * (ae + (two_w * ee)))
    n_2 = x_2 + ((three_d1 * k22_low) + (four_d2 * k20_low))
    n_0 = x_0 + ((three_d1 * k20_low) + (four_d2 * k00_low))
    s_ww = x_x + ((three_d1 * (x_2 + n_2)) + (four_d2 * (x_0 + n_0)))
    s_w1 = (a2_high + (two_w * e2_high)) + ((three_d1 * k22_mid) + (four_d2 * k20_mid))
    s_w2 = (a0_high + (two_w * e0_high)) + ((three_d1 * k20_mid) + (four_d2 * k00_mid))

    q_a = (w * aa) + (w2 * ae)
    q_e = (w * ae) + (w2 * ee)
    q_2 = (w * a2_low) + (w2 * e2_low)
    q_0 = (w * a0_low) + (w2 * e0_low)
    q_w = (q_a + (two_w * q_e)) + ((three_d1 * q_2) + (four_d2 * q_0))
    y_w = (ya + (two_w * ye)) + ((three_d1 * y2_low) + (four_d2 * y0_low))
    r_1 = y2_high - ((w * a2_high) + (w2 * e2_high))
    r_2 = y0_high - ((w * a0_high) + (w2 * e0_high))
    f_w = (y_w - q_w) - ((d1 * s_w1) + (d2 * s_w2))
    f_1 = r_1 - ((d1 * k22_high) + (d2 * k20_high))
    f_2 = r_2 - ((d1 * k20_high) + (d2 * k00_high))

    q_q = (w * q_a) + (w2 * q_e)
    q_y = (w * ya) + (w2 * ye)
    back_1 = f_1 + ((d1 * k22_high) + (d2 * k20_high))
    back_2 = f_2 + ((d1 * k20_high) + (d2 * k00_high))
    rss_minus_yy = (q_q - (_F(2) * q_y)) - ((d1 * (back_1 + f_1)) + (d2 * (back_2 + f_2)))
    s = np.stack([s_ww, s_w1, s_w2, k22_high, k20_high, k00_high])
    return s, np.stack([f_w, f_1, f_2]), rss_minus_yy
