"""What the hand-written strong form in fixed point has of the estimator: integers, one lane a start, lanes last."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pvid.twin.q31 import cholesky
from pvid.twin.q31.integer import (
    WIDE,
    Int,
    bit_length,
    clamp,
    integers,
    root_of,
    round_shift,
    scale,
)

Mask = npt.NDArray[np.bool_]

ONE = 2**30
SUM_LIMIT = 2**60  # above it the sums are divided by 4
SUM_LOW = 2**54  # below it, if they were divided, they are multiplied by 4 again
STEP_MAX = 2**40  # of |dp|, far beyond the bounds of p
SIZE_BITS = 22  # format of the size of a step
UNIT_BITS = cholesky.RHS_BITS - 1


def decay(groups: int, block: int) -> int:
    """exp(-block / groups) in Q31, block <= groups / 4."""
    x = (block << 31) // groups
    total = 1 << 31
    for k in range(12, 0, -1):
        total = (1 << 31) - (((x * total) >> 31) // k)
    return total


def forgetting(groups: int) -> tuple[int, int]:
    """Groups of rows between two forgettings, and the factor on the past then, Q31."""
    if groups == 0:
        return 64, 2**31 - 1
    block = 1 if groups < 32 else min(groups // 16, 64)
    return block, min(decay(groups, block), 2**31 - 1)


def square_ratio(sd: Int, exponent: Int, start_sd: Int) -> tuple[Int, Int]:
    """(sd 2^exponent / start_sd)^2 = prior 2^-prior_exponent, prior of 31 bits."""
    ratio = (sd << 31) // start_sd
    up = 31 - bit_length(ratio)
    mantissa = np.minimum(scale(ratio, -up), 1 << 31)
    prior = np.minimum(round_shift(mantissa * mantissa, 31), 2**31 - 1)
    return prior, 2 * ((31 + up) - exponent) - 31


def in_units_of_s(prior: Int, prior_exponent: Int, f: Int) -> Int:
    """prior 2^-prior_exponent in the unit of s, whose exponent is f."""
    return np.minimum(scale(prior, prior_exponent + 2 * f + 32), WIDE // 2)


def equilibrated_system(s: Int) -> tuple[Int, Int]:
    """(S in Q30, g): s_ab = S_ab 2^(g_a + g_b)."""
    g = cholesky.half_exponent(np.stack([s[a, a] for a in range(len(s))]))
    return clamp(scale(s, g[:, None] + g[None]), ONE), g


class Inverse(NamedTuple):
    """Roots of the diagonal of the inverse that standard errors are made of, r 2^e [n_p, lanes].

    ok : lanes in which there is one
    """

    r: Int
    e: Int
    ok: Mask

    def error(self, a: int, root: Int, root_e: Int) -> Int:
        """Of p[a], for the root of a variance."""
        return clamp(scale(root * self.r[a], -(root_e + self.e[a])), 2**31 - 1)


def assess_errors(out: npt.NDArray[np.void], s: Int, f: Int, start_sd: Int, root: Int, root_e: Int) -> Inverse:
    """kappa, least pivot, standard errors and correlations of estimates [lanes].

    From the upper triangle of S [n_p, n_p, lanes] in units of 2^(f_a + f_b + 32), to which it adds the start's
    information; root 2^root_e is the root of a row's variance times the correlation [lanes].
    """
    n_p = len(s)
    alone = cholesky.factor(equilibrated_system(s)[0])
    out["kappa"] = alone.first_pivot
    out["least_pivot"] = alone.least_pivot
    prior, prior_exponent = square_ratio(root, root_e, start_sd)
    for a in range(n_p):
        s[a, a] = s[a, a] + in_units_of_s(prior[a], prior_exponent[a], f[a])
    q, g = equilibrated_system(s)
    factor = cholesky.factor(q)
    units = [np.zeros((n_p, len(root)), np.int64) for _ in range(n_p)]
    for a in range(n_p):
        units[a][a] = 1 << UNIT_BITS
    columns = [cholesky.lower_solve(factor, unit) for unit in units]
    roots = [root_of(np.maximum(np.sum(column * column, axis=0), 1), integers(0)) for column in columns]
    below = f + g + 31 + UNIT_BITS
    inverse = Inverse(np.stack([r for r, _ in roots]), np.stack([e for _, e in roots]) - below, factor.ok)
    for a, (r, e) in enumerate(roots):
        out["se"][:, a] = np.where(factor.ok, inverse.error(a, root, root_e), start_sd[a])
        out["correlation"][:, a, a] = ONE
        for b in range(a):
            r_b, e_b = roots[b]
            x = scale(np.sum(columns[a] * columns[b], axis=0), e + e_b)
            part = np.sign(x) * np.minimum(((np.abs(x) // r) << 30) // r_b, ONE)
            out["correlation"][:, a, b] = np.where(factor.ok, part, 0)
            out["correlation"][:, b, a] = out["correlation"][:, a, b]
    return inverse
