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
# A, E and Y times -u^k phi'' and -u^k phi, by descending k
_BY_PHI2 = np.array([[3, 4, 5, 6], [7, 8, 9, 10], [MOMENTS + j for j in _PHI2]])
_BY_PHI0 = np.array([[*range(11, 16)], [*range(16, 21)], [MOMENTS + j for j in _PHI0]])
# phi'' phi'', phi'' phi and phi phi, of 7, 8 and 9 sums each; a place beyond the last is not used
_SQUARES = np.array([range(21, 30), range(28, 37), range(36, 45)])


def _windows(sequences: npt.NDArray[np.int64], orders: int) -> npt.NDArray[np.int64]:
    """Places i .. i + orders - 1 of every sequence, [i, sequences, orders]."""
    last = sequences.shape[1] - orders
    return np.stack([sequences[:, i : i + orders] for i in range(last + 1)])


_WINDOWS_2, _WINDOWS_0, _WINDOWS_SQUARES = _windows(_BY_PHI2, 2), _windows(_BY_PHI0, 2), _windows(_SQUARES, 3)
# binom(r, i), i = 1 .. r, one column a sequence: r = 2 and 3; r = 4, 5 and 6
_BINOMIALS_2, _BINOMIALS_0 = np.array([[2], [1]], np.float32), np.array([[3], [3], [1]], np.float32)
_BINOMIALS_SQUARES = np.array([[4, 5, 6], [6, 10, 15], [4, 10, 20], [1, 5, 15], [0, 1, 6], [0, 0, 1]], np.float32)


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
    product: Float32 = extended.take(_LEFT, axis=0) * extended.take(_RIGHT, axis=0)
    return product


def _shifted(sums: Float32, windows: npt.NDArray[np.int64], binomials: Float32, powers: Float32) -> Float32:
    """What shift_pair and shift_triple sum up before they multiply by w: [orders, sequences, lanes].

    The last sequence has as many terms as there are binomials, each before it one less.
    """
    count, sequences = binomials.shape
    terms = (binomials[:, :, None] * powers[:count, None])[:, :, None] * sums.take(windows[1:], axis=0)
    s: Float32 = sums.take(windows[0], axis=0)
    for i, term in enumerate(terms):
        first = max(i - count + sequences, 0)
        s[first:] = s[first:] + term[first:]
    return s.transpose(1, 0, 2)


def project(p: Float32, sums: Float32) -> tuple[Float32, Float32, Float32]:
    """S [3, 3, lanes] (upper triangle), F [3, lanes] and theta^T M theta - 2 theta^T B [lanes].

    What phi'' and phi (and their squares and product) need alike is computed as the rows of one array.
    """
    f = np.float32
    w, d1, d2 = p
    w2 = w * w
    w3 = w2 * w
    w4 = w2 * w2
    powers = np.stack([w, w2, w3, w4, w4 * w, w3 * w3])
    two_w = f(2) * w
    three_d1 = f(3) * d1
    four_d2 = f(4) * d2
    pair_2 = _shifted(sums, _WINDOWS_2, _BINOMIALS_2, powers)
    pair_0 = _shifted(sums, _WINDOWS_0, _BINOMIALS_0, powers)
    pairs = np.stack([pair_2, pair_0], axis=2)  # [2, (A, E, Y), (phi'', phi), lanes]
    low = pairs[1]
    high = pairs[0] + w * low
    (a_low, e_low, y_low), (a_high, e_high, y_high) = low, high
    k_first, k_second, k_low = _shifted(sums, _WINDOWS_SQUARES, _BINOMIALS_SQUARES, powers)
    k_mid = k_second + w * k_low
    k_high = (k_first + w * k_second) + w * k_mid
    m_aa, m_ae, m_ee = sums[AA], sums[AE], sums[EE]
    b_a, b_e = sums[MOMENTS], sums[MOMENTS + 1]

    x = a_low + two_w * e_low
    x_x = (m_aa + two_w * m_ae) + two_w * (m_ae + two_w * m_ee)
    n = x + (three_d1 * k_low[:2] + four_d2 * k_low[1:])
    x_n = x + n
    s_ww = x_x + (three_d1 * x_n[0] + four_d2 * x_n[1])
    s_wd = (a_high + two_w * e_high) + (three_d1 * k_mid[:2] + four_d2 * k_mid[1:])

    q_a = w * m_aa + w2 * m_ae
    q_e = w * m_ae + w2 * m_ee
    q = w * a_low + w2 * e_low
    q_w = (q_a + two_w * q_e) + (three_d1 * q[0] + four_d2 * q[1])
    q_n = w * a_high + w2 * e_high
    y_w = (b_a + two_w * b_e) + (three_d1 * y_low[0] + four_d2 * y_low[1])
    t = q_n + (d1 * k_high[:2] + d2 * k_high[1:])

    s = np.zeros((N_P, N_P, *w.shape), np.float32)
    s[0, 0], s[0, 1:] = s_ww, s_wd
    s[1, 1:], s[2, 2] = k_high[:2], k_high[2]
    force = np.empty((N_P, *w.shape), np.float32)
    force[0] = (y_w - q_w) - (d1 * s_wd[0] + d2 * s_wd[1])
    force[1:] = y_high - t

    q_q = w * q_a + w2 * q_e
    q_b = w * b_a + w2 * b_e
    along = (q_n + t) - f(2) * y_high
    rss_minus_yy = (q_q - f(2) * q_b) + (d1 * along[0] + d2 * along[1])
    return s, force, rss_minus_yy


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
