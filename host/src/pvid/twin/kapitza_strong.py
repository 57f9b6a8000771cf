"""Twin of kapitza_strong_f32.c: row, sums and projection of the strong form.

Everything has a trailing lane axis; p is float32 [3, lanes].
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

N_THETA = 11
N_P = 3
MOMENTS = 45
SUMS = MOMENTS + N_THETA + 2
POSITIVE = (True, True, True)

_PHI2 = (2, 3, 4, 5)
_PHI0 = (6, 7, 8, 9, 10)
_Y, _ONE = 11, 12


def _pairs() -> list[tuple[int, int]]:
    """Factors of every sum, as places in (N, y, 1), in the order of the C enum."""
    pairs = [(0, 0), (0, 1), (1, 1)]
    pairs += [(0, j) for j in _PHI2] + [(1, j) for j in _PHI2]
    pairs += [(0, j) for j in _PHI0] + [(1, j) for j in _PHI0]
    pairs += [(2, j) for j in _PHI2] + [(5, j) for j in _PHI2[1:]]
    pairs += [(6, j) for j in _PHI2] + [(5, j) for j in _PHI0[1:]]
    pairs += [(6, j) for j in _PHI0] + [(10, j) for j in _PHI0[1:]]
    pairs += [(_Y, j) for j in range(N_THETA)]
    return [*pairs, (_Y, _Y), (_ONE, _ONE)]


_LEFT = np.array([a for a, _ in _pairs()])
_RIGHT = np.array([b for _, b in _pairs()])

AA, AE, EE = 0, 1, 2
# A, E and Y times -u^k phi'' (and -u^k phi), by descending k
_SEQUENCES_2 = np.array([[3, 4, 5, 6], [7, 8, 9, 10], [MOMENTS + j for j in _PHI2]])
_SEQUENCES_0 = np.array([[*range(11, 16)], [*range(16, 21)], [MOMENTS + j for j in _PHI0]])
_PHI2_PHI2, _PHI2_PHI0, _PHI0_PHI0 = 21, 28, 36


def rows(phi: Float32, u: Float32) -> tuple[Float32, Float32]:
    """pvid_kapitza_strong_row_f32 for phi [..., 5, (lanes)] and u [..., 3, (lanes)] given as [ticks, k].

    Returns N [ticks, 11] and Y [ticks].
    """
    two = np.float32(2)
    u0, u1, u2 = u[:, 0], u[:, 1], u[:, 2]
    phi0, phi2, phi3, phi4 = phi[:, 0], phi[:, 2], phi[:, 3], phi[:, 4]
    two_u0 = two * u0
    two_u1 = two * u1
    n = np.empty((len(phi), N_THETA), np.float32)
    with np.errstate(all="ignore"):
        y = (((u0 * u0) * phi4) - ((two_u0 * u1) * phi3)) + (((two_u1 * u1) - (u0 * u2)) * phi2)
        n[:, 0] = ((two_u1 * phi3) - (two_u0 * phi4)) + (u2 * phi2)
        n[:, 1] = -phi4
        n[:, 5] = -phi2
        for i in (4, 3, 2):
            n[:, i] = u0 * n[:, i + 1]
        n[:, 10] = -phi0
        for i in (9, 8, 7, 6):
            n[:, i] = u0 * n[:, i + 1]
    return n, y


def terms(n: Float32, y: Float32) -> Float32:
    """What a row adds to the sums: [SUMS, lanes] from N [11, lanes] and Y [lanes]."""
    extended = np.concatenate([n, y[None], np.ones_like(y)[None]])
    product: Float32 = extended[_LEFT] * extended[_RIGHT]
    return product


def _shift(sequence: Float32, coefficients: list[Float32], w: Float32, orders: int) -> list[Float32]:
    """<a b G^r>, <a b G^(r+1)> (and <a b G^(r+2)>) as shift_pair and shift_triple have it.

    sequence [..., r + orders, lanes] by descending powers of u; coefficients binom(r, i) w^i, i = 1..r.
    """
    s = [sequence[..., k, :] for k in range(orders)]
    for i, c in enumerate(coefficients, start=1):
        s = [s[k] + c * sequence[..., i + k, :] for k in range(orders)]
    low = s[-1]
    mid = s[-2] + w * low
    if orders == 2:
        return [low, mid]
    return [low, mid, (s[0] + w * s[1]) + w * mid]


def project(p: Float32, sums: Float32) -> tuple[Float32, Float32, Float32]:
    """S [3, 3, lanes] (upper triangle), F [3, lanes] and theta^T M theta - 2 theta^T B [lanes]."""
    f = np.float32
    w, d1, d2 = p
    w2 = w * w
    w3 = w2 * w
    w4 = w2 * w2
    w5 = w4 * w
    two_w = f(2) * w
    three_d1 = f(3) * d1
    four_d2 = f(4) * d2
    r2 = [f(2) * w, w2]
    r3 = [f(3) * w, f(3) * w2, w3]
    r4 = [f(4) * w, f(6) * w2, f(4) * w3, w4]
    r5 = [f(5) * w, f(10) * w2, f(10) * w3, f(5) * w4, w5]
    r6 = [f(6) * w, f(15) * w2, f(20) * w3, f(15) * w4, f(6) * w5, w3 * w3]
    low2, high2 = _shift(sums[_SEQUENCES_2], r2, w, 2)
    low0, high0 = _shift(sums[_SEQUENCES_0], r3, w, 2)
    a2_low, e2_low, y2_low = low2
    a2_high, e2_high, y2_high = high2
    a0_low, e0_low, y0_low = low0
    a0_high, e0_high, y0_high = high0
    k22_low, k22_mid, k22_high = _shift(sums[_PHI2_PHI2 : _PHI2_PHI2 + 7], r4, w, 3)
    k20_low, k20_mid, k20_high = _shift(sums[_PHI2_PHI0 : _PHI2_PHI0 + 8], r5, w, 3)
    k00_low, k00_mid, k00_high = _shift(sums[_PHI0_PHI0 : _PHI0_PHI0 + 9], r6, w, 3)
    m_aa, m_ae, m_ee = sums[AA], sums[AE], sums[EE]
    b_a, b_e = sums[MOMENTS], sums[MOMENTS + 1]

    x_2 = a2_low + two_w * e2_low
    x_0 = a0_low + two_w * e0_low
    x_x = (m_aa + two_w * m_ae) + two_w * (m_ae + two_w * m_ee)
    n_2 = x_2 + (three_d1 * k22_low + four_d2 * k20_low)
    n_0 = x_0 + (three_d1 * k20_low + four_d2 * k00_low)
    s_ww = x_x + (three_d1 * (x_2 + n_2) + four_d2 * (x_0 + n_0))
    s_w1 = (a2_high + two_w * e2_high) + (three_d1 * k22_mid + four_d2 * k20_mid)
    s_w2 = (a0_high + two_w * e0_high) + (three_d1 * k20_mid + four_d2 * k00_mid)

    q_a = w * m_aa + w2 * m_ae
    q_e = w * m_ae + w2 * m_ee
    q_2 = w * a2_low + w2 * e2_low
    q_0 = w * a0_low + w2 * e0_low
    q_w = (q_a + two_w * q_e) + (three_d1 * q_2 + four_d2 * q_0)
    q_n1 = w * a2_high + w2 * e2_high
    q_n2 = w * a0_high + w2 * e0_high
    y_w = (b_a + two_w * b_e) + (three_d1 * y2_low + four_d2 * y0_low)
    t_1 = q_n1 + (d1 * k22_high + d2 * k20_high)
    t_2 = q_n2 + (d1 * k20_high + d2 * k00_high)

    s = np.zeros((N_P, N_P, *w.shape), np.float32)
    s[0, 0], s[0, 1], s[0, 2] = s_ww, s_w1, s_w2
    s[1, 1], s[1, 2], s[2, 2] = k22_high, k20_high, k00_high
    force = np.empty((N_P, *w.shape), np.float32)
    force[0] = (y_w - q_w) - (d1 * s_w1 + d2 * s_w2)
    force[1] = y2_high - t_1
    force[2] = y0_high - t_2

    q_q = w * q_a + w2 * q_e
    q_b = w * b_a + w2 * b_e
    along_1 = (q_n1 + t_1) - f(2) * y2_high
    along_2 = (q_n2 + t_2) - f(2) * y0_high
    energy = (q_q - f(2) * q_b) + (d1 * along_1 + d2 * along_2)
    return s, force, energy


def innovate(p: Float32, n: Float32, y: Float32) -> tuple[Float32, Float32]:
    """e = Y - N^T theta [lanes] and C^T N [3, lanes]."""
    f = np.float32
    w, d1, d2 = p
    two_w = f(2) * w
    w2 = w * w
    g2_low = (n[3] + two_w * n[4]) + w2 * n[5]
    g2_high = (n[2] + two_w * n[3]) + w2 * n[4]
    g3_low = ((n[7] + w * n[8]) + two_w * (n[8] + w * n[9])) + w2 * (n[9] + w * n[10])
    g3_high = ((n[6] + w * n[7]) + two_w * (n[7] + w * n[8])) + w2 * (n[8] + w * n[9])
    n_1 = g2_high + w * g2_low
    n_2 = g3_high + w * g3_low
    gradient = np.empty((N_P, *w.shape), np.float32)
    gradient[0] = (n[0] + two_w * n[1]) + ((f(3) * d1) * g2_low + (f(4) * d2) * g3_low)
    gradient[1] = n_1
    gradient[2] = n_2
    e = (y - w * (n[0] + w * n[1])) - (d1 * n_1 + d2 * n_2)
    return e, gradient
