"""The identifier of the paper, by hand and line by line, in float32 and in fixed point: begin here if you know it.

(1) to (5) are the equations of B. I. Adamov's paper (theory.md). The model is written once, for numbers of either
arithmetic; `Single` and `Fixed` are law (5) in each. The C core in its literal form (estimator.h: the law
pseudovelocity, divider 1, kappa_min 0, so that every row adds N N^T and solves) has the same bits after every tick on
every board (tests/paper), because float32 is summed in the order in which it is written: numpy's dot, sum and einsum
have another one. What the core adds (forgetting, kinds of rows, standard errors ..) is not here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pvid.oracle.digits import Digits, bits, block, fixed, half, numbers, scaled, split, within

# ---- the model: numbers are float32 or Digits


def regressor(phi: Any, u: Any) -> tuple[Any, list[Any]]:
    """(2) Y = N^T theta: Y and N [11], of phi [5] (orders 0 to 4) and u = y''/l1 [3] (u, u', u'')."""
    phi0, _, phi2, phi3, phi4 = phi
    u0, u1, u2 = u
    uu = u0 * u0
    y = uu * phi4 - 2 * u0 * u1 * phi3 + (2 * u1 * u1 - u0 * u2) * phi2
    n = [-2 * u0 * phi4 + 2 * u1 * phi3 + u2 * phi2, -phi4]
    n += [-uu * u0 * phi2, -3 * uu * phi2, -3 * u0 * phi2, -phi2]
    n += [-uu * uu * phi0, -4 * uu * u0 * phi0, -6 * uu * phi0, -4 * u0 * phi0, -phi0]
    return y, n


def theta_of(p: Any) -> list[Any]:
    """(3) theta = f(p) [11], p = (omega^2, d1, d2): the eight equations give the other eight."""
    w, d1, d2 = p
    of_d1 = [d1, d1 * w, d1 * w * w, d1 * w * w * w]
    return [w, w * w, *of_d1, d2, d2 * w, d2 * w * w, d2 * w * w * w, d2 * w * w * w * w]


def jacobian(p: Any) -> list[list[Any]]:
    """(4) theta' = C pi: C^T = d theta / d p [3][11]."""
    w, d1, d2 = p
    of_w = [1, 2 * w, 0, d1, 2 * d1 * w, 3 * d1 * w * w, 0, d2, 2 * d2 * w, 3 * d2 * w * w, 4 * d2 * w * w * w]
    return [of_w, [0, 0, 1, w, w * w, w * w * w] + 5 * [0], 6 * [0] + [1, w, w * w, w * w * w, w * w * w * w]]


def plus(x: Any, a: Any, b: Any) -> Any:
    """x + a^T b, from the first row of a and b on."""
    for one, two in zip(a, b, strict=True):
        x = x + one * two
    return x


FIVE_POINTS = ((8, -1), (16, -1), (-12, 6), (-48, 12))  # orders 1 to 4: twelfths for samples 1 and 2 from the middle


class Paper:
    """What float32 and fixed point share: the derivatives, and the Cholesky factor U U^T of S."""

    take: Any  # a row (Y, N): law (5)
    inverse_root: Any  # of a pivot of S; None if it is rounding
    wide: Any = np.positive  # an entry of S, as products are summed
    times: Any = np.multiply  # such a sum by an inverse root
    block: Any = staticmethod(lambda x: (x, 0))  # x = m 2^e: m and e
    weights: Any = FIVE_POINTS
    unit: Any  # of the derivatives of phi and of y/l1, orders 0 to 4
    window: Any = ()

    def step(self, phi: Any, y: Any) -> None:
        """One sample: phi [rad] and y/l1, in fixed point their counts."""
        self.window = [*self.window[-4:], (phi, y)]
        if len(self.window) == 5:
            with np.errstate(all="ignore"):
                of_phi, of_y = map(self.derivatives, zip(*self.window, strict=True), self.unit)
                self.take(*regressor(of_phi, of_y[2:]))

    def derivatives(self, x: Any, unit: Any) -> list[Any]:
        """Orders 0 to 4 at the middle of five samples."""
        odd, even = (x[3] - x[1], x[4] - x[0]), ((x[3] - x[2]) + (x[1] - x[2]), (x[4] - x[2]) + (x[0] - x[2]))
        parts = zip(self.weights, (odd, even, odd, even), unit[1:], strict=True)
        return [x[2] * unit[0]] + [(w[0] * near + w[1] * far) * scale for w, (near, far), scale in parts]

    def solved(self, s: Any, rhs: Any) -> tuple[Any, int]:
        """S^-1 rhs = x 2^e, from the last row up and down again; x is None where S is singular."""
        u, x, inverse = np.zeros((3, 3), object), np.array(rhs, object), [None, None, None]
        for j in (2, 1, 0):
            above = slice(j + 1, 3)
            inverse[j] = self.inverse_root(plus(self.wide(s[j, j]), u[j, above], -u[j, above]), s[j, j])
            if inverse[j] is None:
                return None, 0
            x[j] = self.times(plus(self.wide(rhs[j]), u[j, above], -x[above]), inverse[j])
            for i in range(j):
                u[i, j] = self.times(plus(self.wide(s[i, j]), u[i, above], -u[j, above]), inverse[j])
        x, e = self.block(x)
        for i in range(3):
            x[i] = self.times(plus(self.wide(x[i]), u[:i, i], -x[:i]), inverse[i])
        return x, e


class Single(Paper):
    """(5) pi = (C^T M C)^-1 C^T N (Y - N^T theta), M = int N N^T, p += pi. S has H0 = (row_sd / start_sd)^2 besides."""

    def __init__(self, start: Any, start_sd: Any, lower: Any, upper: Any, row_sd: float, rate: float) -> None:
        self.p, self.lower, self.upper = (np.array(x, np.float32) for x in (start, lower, upper))
        self.prior = np.diag((np.float32(row_sd) / np.array(start_sd, np.float32)) ** 2)
        self.unit = 2 * [np.cumprod(np.array([1, rate, rate, rate, rate], np.float32))]
        self.weights = np.array(FIVE_POINTS, np.float32) / np.float32(12)
        self.high, self.low, self.rows = np.zeros((11, 11), np.float32), np.zeros((11, 11), np.float32), 0

    def take(self, y: Any, n: Any) -> None:
        """A row; one that is not finite or beyond 1e14 changes nothing."""
        e = plus(y, n, -np.array(theta_of(self.p)))  # Y - N^T theta
        if not (plus(y * y, n, n) <= np.float32(1e28) and e * e <= np.float32(1e28)):
            return
        n, c, none = np.array(n), np.array(jacobian(self.p), np.float32).T, np.float32(0)
        self.low = self.low + n[:, None] * n  # M += N N^T, in two levels: 10^7 rows do not stall it
        mc = plus(none, (self.high + self.low)[:, :, None], c[:, None])
        s = plus(none, mc[:, :, None], c[:, None]) + self.prior  # C^T M C + H0
        diagonal = np.diag(s)
        if np.isfinite(diagonal).all() and (diagonal >= np.finfo(np.float32).tiny).all():
            d = np.ldexp(np.float32(1), -((np.frexp(diagonal)[1] - 1) >> 1))  # S scaled by powers of two: exact
            x, _ = self.solved((s * d[:, None]) * d, (plus(none, c, n) * e) * d)
            pi = np.array(x, np.float32) * d  # NaN of None
            size = np.max(np.abs(pi / self.p))
            if np.isfinite(size):  # p += pi, shortened to |dp/p| = 0.3, within the bounds
                part = np.float32(0.3) / size if size > np.float32(0.3) else np.float32(1)
                self.p = np.clip(self.p + part * pi, self.lower, self.upper)
        self.rows += 1
        if self.rows % 64 == 0:  # Knuth's two-sum
            total = self.high + self.low
            part = total - self.high
            self.high, self.low = total, (self.high - (total - part)) + (self.low - part)

    def inverse_root(self, pivot: Any, diagonal: Any) -> Any:
        return np.float32(1) / np.sqrt(pivot) if pivot >= np.float32(1e-6) * diagonal else None


# ---- the same in fixed point: integers scaled by powers of two; numbers of 30 digits for the model


class Fixed(Paper):
    """The law on counts, in formats: bits after the point of p, N and Y. row_sd is in 2^-8 of the last bit of Y.

    Squares must sum to less than 2^60: then the core would divide them by 4.
    """

    wide: Any = staticmethod(lambda x: x << 30)
    block: Any = staticmethod(block)

    def __init__(self, start: Any, start_sd: Any, lower: Any, upper: Any, row_sd: int, formats: Any, unit: Any) -> None:
        self.p, sd, self.lower, self.upper = (np.array(x, object) for x in (start, start_sd, lower, upper))
        self.p_bits, self.n_bits, self.y_bits = (np.array(x, object) for x in formats)
        self.unit, self.m = unit, np.zeros((11, 11), object)
        ratio = (row_sd << 31) // sd
        self.prior = within(scaled(scaled(ratio, bits(ratio) - 31) ** 2, 31), 2**31 - 1)
        self.prior_bits = 2 * (70 - bits(ratio)) - 31
        p, change = numbers(self.p, -self.p_bits), numbers(sd, -self.p_bits)
        m, e = split([theta_of(p), *(np.array(jacobian(p), object) * change[:, None])])
        self.theta_bits = within(40 - (bits(m) + e).max(0), 500)  # 40 bits of the larger of theta and its change

    def take(self, y: Any, n: Any) -> None:
        """A row; one beyond 2^28 changes nothing."""
        y, n, p = y.fixed(self.y_bits), fixed(n, self.n_bits), numbers(self.p, -self.p_bits)
        theta = within(fixed(theta_of(p), self.theta_bits), 2**60)
        m, e = split(numbers(theta, -self.theta_bits))
        e = y - within(scaled(n * m, self.n_bits - self.y_bits - e), 2**40).sum()  # Y - N^T theta
        if max(abs(x) for x in (y, e, *n)) > 2**28:
            return
        self.m = self.m + n[:, None] * n  # M += N N^T
        h = half(np.diag(self.m))
        m = within(scaled(self.m, h[:, None] + h), 2**30)
        c, k = split(np.array(jacobian(p), object).T)
        k = k + (h + self.y_bits - self.n_bits)[:, None] - self.p_bits
        f = (np.where(c == 0, -200, bits(c)) + k).max(0) - 29
        c = within(scaled(c, f - k), 2**29)
        mc = (m[:, :, None] * c >> 32).sum(1)
        s = mc.T @ c + np.diag(within(scaled(self.prior, self.prior_bits + 2 * f + 32), 2**61))  # C^T M C + H0
        g = half(np.diag(s))
        force, of_force = block(scaled(n * e, h), 30)
        rhs, of_rhs = block(scaled(c.T @ force, g))
        x, of_x = self.solved(within(scaled(s, g[:, None] + g), 2**30), rhs)
        if x is not None:
            pi = within(scaled(x, f + g - of_force - of_rhs - of_x + 62), 2**40)
            size, limit = max((abs(pi) << 22) // self.p), 19661 << 6  # 0.3, as above
            part = min((limit << 31) // max(size, 1), 2**31 - 1)
            self.p = np.clip(self.p + (scaled(pi * part, 31) if size > limit else pi), self.lower, self.upper)

    def inverse_root(self, pivot: Any, diagonal: Any) -> Any:
        root = Digits.of(pivot).inverse_root() if diagonal >= 2**28 and pivot >= diagonal << 10 else None
        return root and (2 * root.m, -root.e - 29)

    def times(self, x: Any, inverse: Any) -> Any:
        return within(scaled(within(scaled(x, 30), 2**31 - 1) * inverse[0], inverse[1]), 2**30)
