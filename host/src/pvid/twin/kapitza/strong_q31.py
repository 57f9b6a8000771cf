"""Twin of kapitza_row_q31.c: the strong form's rows and their innovation in integers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.tables import RATE_BITS, RowFormatQ31
from pvid.twin.q31.integer import Int, round_shift

Mask = npt.NDArray[np.bool_]

N_ROW = 13  # N_1 .. N_11, Y, G
A, E, X, Z, Y, G = 0, 1, 2, 6, 11, 12
ROW_LIMIT = 2**28
PART_LIMIT = 2**30
TERM_LIMIT = 2**29


class Fitting:
    """Numbers that must stay within -limit..limit - 1, elementwise; `ok` tells where all of them did."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.ok = np.ones(shape, np.bool_)

    def within(self, x: Int, limit: int = ROW_LIMIT) -> Int:
        """x; 0 where it is outside -limit..limit - 1."""
        fits = (x >= -limit) & (x < limit)
        self.ok &= fits
        return np.where(fits, x, 0)

    def powers(self, x: Int, g: Int, count: int) -> list[Int]:
        """-x, -g x, -g^2 x .., each from the one before."""
        found = [-x]
        for _ in range(count - 1):
            found.append(self.within(by_rate(found[-1], g)))
        return found


def by_rate(x: Int, rate: Int) -> Int:
    """x times a rate."""
    return round_shift(x * rate, RATE_BITS)


def rows(row_format: RowFormatQ31, phi: Int, u: Int) -> tuple[Int, Mask]:
    """Rows [ticks, 13] from phi [ticks, 5] and u, u', u'' [ticks, 3], and whether they fit [ticks]."""
    fitting = Fitting((len(phi),))

    third = fitting.within(round_shift(phi[:, 3] * row_format.phi3, 30), PART_LIMIT)

    def entry(order: int, finer: int = 0) -> Int:
        shift, own = row_format.phi_shift[order] + finer, third if order == 3 else phi[:, order]
        return fitting.within(round_shift(own, -shift) if shift <= 0 else own << shift)

    phi0, phi2, phi3, phi4 = (entry(order) for order in (0, 2, 3, 4))
    x = entry(2, row_format.finer[0])
    g = u[:, 0] + row_format.reference
    g_phi4 = g * phi4
    bracket = u[:, 2] * phi2 + 2 * (u[:, 1] * phi3) - g_phi4
    part = fitting.within(round_shift(bracket, RATE_BITS), PART_LIMIT)
    u1_phi2 = fitting.within(by_rate(phi2, u[:, 1]), PART_LIMIT)
    out = np.empty((len(phi), N_ROW), np.int64)
    out[:, A] = fitting.within(round_shift(bracket - g_phi4, RATE_BITS))
    out[:, E] = -phi4
    out[:, X:Z] = np.stack(fitting.powers(x, g, 4)[::-1], axis=1)
    out[:, Z:Y] = np.stack(fitting.powers(phi0, g, 5)[::-1], axis=1)
    out[:, Y] = fitting.within(round_shift(2 * (u[:, 1] * u1_phi2) - g * part, RATE_BITS))
    out[:, G] = g
    return out, fitting.ok


def innovation(row: Int, p: Int, reference: Int, bits: tuple[int, int]) -> tuple[Int, Int, Mask]:
    """e [lanes] at p [3, lanes], its gradient [3, lanes], and whether the row can be taken [lanes].

    row [13] of all lanes or [13, lanes]; reference: w_r as w; bits: formats of d1 and d2 with those of n_1 and n_2.
    """
    w, d1, d2 = p
    fitting = Fitting(w.shape)
    beyond = round_shift(w - reference, 1)
    g = fitting.within(row[G] + beyond, PART_LIMIT)

    def chain(x: Int, count: int) -> list[Int]:
        found = [x]
        for _ in range(count):
            found.append(fitting.within(by_rate(found[-1], g)))
        return found

    def term(d: Int, own_bits: int, factor: int, x: Int) -> Int:
        return fitting.within(round_shift(factor * (d * x), own_bits), TERM_LIMIT)

    g2_x, g3_x = chain(row[X + 3], 3)[-2:]
    g3_z, g4_z = chain(row[Z + 4], 4)[-2:]
    of_e = fitting.within(by_rate(row[E], beyond), TERM_LIMIT)
    inner = row[A] + of_e
    of_w = fitting.within(by_rate(inner, beyond), TERM_LIMIT)
    known = of_w + term(d1, bits[0], 1, g3_x) + term(d2, bits[1], 1, g4_z)
    slope = fitting.within(inner + of_e + term(d1, bits[0], 3, g2_x) + term(d2, bits[1], 4, g3_z), PART_LIMIT)
    e = fitting.within(row[Y] - known)
    return e, np.stack([slope, g3_x, g4_z]), fitting.ok


def accelerations(d_y: Int, multipliers: tuple[int, ...], shifts: tuple[int, ...]) -> Int:
    """u, u', u'' from the derivatives of y [ticks, 3]."""
    both = zip(multipliers, shifts, strict=True)
    scaled = [round_shift(d_y[:, k] * np.int64(multiplier), shift) for k, (multiplier, shift) in enumerate(both)]
    return np.stack(scaled, axis=1)
