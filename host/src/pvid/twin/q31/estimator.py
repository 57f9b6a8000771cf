"""Twin of estimator_q31.c and information_q31.c: integers, one lane a start, lanes last."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31
from pvid.twin import estimates
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
    times_q31,
    upper_product,
)
from pvid.twin.q31.model import ModelQ31
from pvid.twin.q31.scaled import Scaled, pick, scaled
from pvid.twin.record import COUNTERS

Mask = npt.NDArray[np.bool_]
Reasons = npt.NDArray[np.uint8]

ONE = 2**30
ROW_LIMIT = 2**28
SUM_LIMIT = 2**60  # above it the sums are divided by 4
SUM_LOW = 2**54  # below it, if they were divided, they are multiplied by 4 again
STEP_MAX = 2**40  # of |dp|, far beyond the bounds of p
SIZE_BITS = 22  # format of the size of a step
TERM_MAX = 2**40  # of |N_i theta_i|, far beyond the limit of a row
HELD_LIMIT = 2 * SUM_LIMIT  # of |b|, rr and what a step may add to them
UNIT_BITS = cholesky.RHS_BITS - 1
_REST_BITS = 28  # of F, for a dead zone
_THETA_BITS = 40  # of theta at the start, of a model with numbers of any size
_NOTHING = -200  # exponent of a number that is 0


def length(x: Int) -> Int:
    """Bits of |x|; very negative for 0, so that it never is the largest."""
    return np.where(x == 0, _NOTHING, bit_length(np.abs(x)))


def _length(x: Scaled) -> Int:
    """Bits of |x| before the point; very negative for 0."""
    return np.where(x.m == 0, -9000, bit_length(np.abs(x.m)) + x.e)


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


class EstimatorQ31:
    """pvid_estimator_q31 in every lane; all lanes share model, formats, divider and whether the law is a rate.

    score : of the last solve that ended a group, of fewer than 30 digits
    inverse : of the last assessment

    p int64 [n_p, lanes]; sums int64 [n_sums, lanes]: M, b, rr times 4^-exponent, weight in Q16.
    """

    _ROWS_PER_STAGE = 8
    _ENTRIES_PER_STAGE = 18
    _PIVOTS_PER_STAGE = 2
    _END_PARTS = 2

    def __init__(self, configs: Sequence[EstimatorConfigQ31], model: ModelQ31) -> None:
        first = configs[0]
        for c in configs:
            if (c.p_bits, c.n_bits, c.y_bits, c.divider, c.gain < ONE) != (
                first.p_bits,
                first.n_bits,
                first.y_bits,
                first.divider,
                first.gain < ONE,
            ):
                raise PvidError("lanes of one twin must share formats, divider and whether the law is a rate")
        self.model = model
        self._upper = model.blocks.places
        self._bits = 29 - (0 if model.n_theta <= 11 else 1 if model.n_theta <= 22 else 2)  # of C and steps of theta
        self._diagonal = np.flatnonzero(self._upper[0] == self._upper[1])
        self._c_row, self._c_column = np.array(model.c_row), np.array(model.c_column)
        self._columns = [np.flatnonzero(self._c_column == a) for a in range(model.n_p)]
        lanes = len(configs)

        def stacked(name: str) -> Int:
            return np.stack([integers(getattr(c, name))[: model.n_p] for c in configs], axis=1)

        def lane(name: str) -> Int:
            return integers([getattr(c, name) for c in configs])

        self.p = stacked("start")
        self.start_sd = stacked("start_sd")
        self.lower = stacked("lower")
        self.upper = stacked("upper")
        self.row_sd = lane("row_sd")
        self.correlation = lane("correlation")
        self.row_weight = lane("row_weight")
        self.step_limit = lane("step_limit")
        self.kappa_min = lane("kappa_min")
        self.noise_margin = lane("noise_margin")
        self.dead_zone = lane("dead_zone")
        self.noise_table: dict[tuple[int, int], Scaled] = {}
        self.noise_rows = 0
        self.rss = np.zeros(lanes, np.int64)
        self.group_weight = np.zeros(lanes, np.int64)
        self.expected = scaled(np.zeros(lanes, np.int64), 0)
        self.group_rss = self.rss
        self.size = self.rss
        self.gain = lane("gain")
        self.is_rate = first.gain < ONE  # a law that does not iterate
        self.divider = first.divider
        self.block, self.retention = integers([forgetting(c.forgetting_groups) for c in configs]).T
        self._p_bits = integers(first.p_bits)[:, None]
        theta_bits, c_bits = self._formats(first.p_bits)
        # e = Y - sum N_i theta_i 2^-align_i;  C in units of e per N_i per p_a is c_k 2^c_exponent_k
        self.align = [t + n - first.y_bits for t, n in zip(theta_bits, first.n_bits, strict=True)]
        self.c_exponent = [
            first.y_bits - first.n_bits[row] - first.p_bits[column] - bits
            for row, column, bits in zip(model.c_row, model.c_column, c_bits, strict=True)
        ]
        self.theta_bits = theta_bits
        self.theta = self._theta_of(self.p)
        self.phase = 0
        self.age = np.zeros(lanes, np.int64)
        self.exponent = np.zeros(lanes, np.int64)
        self.sums = np.zeros((model.n_sums, lanes), np.int64)
        self.fresh = np.zeros((model.n_theta, lanes), np.int64)
        self.counters = {name: np.zeros(lanes, np.int64) for name in COUNTERS}
        self.was_due = True
        self.prior, self.prior_exponent = square_ratio(self.row_sd, integers(-8), self.start_sd)

    def _numbers(self, p: Int) -> Scaled:
        """p in its unit."""
        return scaled(p, -self._p_bits)

    def _theta_of(self, p: Int) -> Int:
        """theta in its formats."""
        if self.model.scaled is None:
            return self.model.theta(p)
        return clamp(self.model.scaled.theta(self._numbers(p)).fixed(integers(self.theta_bits)[:, None]), 2**60)

    def _formats(self, p_bits: Sequence[int]) -> tuple[list[int], list[int]]:
        """Formats of theta and C: those of the model, or from the start, which all lanes then share."""
        model = self.model
        if model.scaled is None:
            return model.formats(p_bits)
        start, sd = self._numbers(self.p), self._numbers(self.start_sd)
        c = model.scaled.jacobian(start)
        lengths = _length(model.scaled.theta(start))
        for k, (row, column) in enumerate(zip(model.c_row, model.c_column, strict=True)):
            change = Scaled(c.m[k], c.e[k]).times(Scaled(sd.m[column], sd.e[column]))
            lengths[row] = np.maximum(lengths[row], _length(change))
        if (lengths != lengths[:, :1]).any():
            raise PvidError("lanes of one twin must share the formats of theta: their starts differ too much")
        bits = clamp(_THETA_BITS - lengths[:, 0], 500)
        return [int(one) for one in bits], [0] * len(model.c_row)

    @property
    def lanes(self) -> int:
        """Number of lanes."""
        return int(self.p.shape[1])

    def mantissas(self, values: Int) -> tuple[Int, Int]:
        """values = m 2^h with m of 30 bits."""
        h = bit_length(np.abs(values)) - 30
        return scale(values, h), h

    def place(self, index: int, value: int) -> None:
        """Sets p[index] before the first row, within its bounds."""
        self.p = self.p.copy()
        self.p[index] = np.clip(value, self.lower[index], self.upper[index])
        self.theta = self._theta_of(self.p)

    def innovation(self, n: Int, y: Int, kind: int = 0) -> tuple[Int, Mask]:
        """e = Y - N^T theta of a row [lanes], and whether the row fits; shapes as in `add`."""
        return self.terms(n, y, kind)[1:]

    def terms(self, n: Int, y: Int, kind: int = 0) -> tuple[Int, Int, Mask]:
        """N_i theta_i of a row [theta of its kind, lanes], and its innovation."""
        block = self.model.blocks.of_kind[kind]
        m, h = self.mantissas(self.theta[block])
        terms = clamp(scale(clamp(n, ROW_LIMIT) * m, integers(self.align)[block, None] - h), TERM_MAX)
        e = y - terms.sum(axis=0)
        return terms, e, (np.abs(y) <= ROW_LIMIT) & (np.abs(n) <= ROW_LIMIT).all(axis=0) & (np.abs(e) <= ROW_LIMIT)

    @property
    def expected_variance(self) -> Scaled:
        """row_sd^2 [lanes], in units of the sums."""
        return scaled(self.row_sd * self.row_sd, -2 * (8 + self.exponent))

    def add(self, n: Int, y: Int, kind: int = 0) -> Reasons:
        """One row of a group: N [theta of this kind, lanes], Y [lanes]."""
        return self.take_row(n, *self.innovation(n, y, kind), kind)

    def take_row(self, n: Int, innovation: Int, fits: Mask, kind: int = 0) -> Reasons:
        """As `add`, given the results of `innovation`."""
        e = np.where(fits, innovation, 0)
        self.rss = clamp(self.rss + e * e, WIDE)
        e = round_shift(e, self.exponent)
        row = round_shift(np.where(fits, n, 0), self.exponent)
        block = self.model.blocks.of_kind[kind]
        places, upper, column = self.model.blocks.places_of_kind(kind)
        weight = np.where(fits, self.row_weight, 0)
        self.group_weight = self.group_weight + weight
        sums = self.sums.copy()
        sums[places] += row[upper] * row[column]
        sums[self.model.moments : -2][block] += row * e
        sums[-2] = np.minimum(sums[-2] + e * e, 3 * SUM_LIMIT)
        sums[-1] += weight
        self.sums = sums
        fresh = self.fresh.copy()
        fresh[block] += row * e
        self.fresh = fresh
        reason = np.full(self.lanes, Reason.ACCUMULATED, np.uint8)
        reason[~fits] = Reason.REJECTED_SATURATED
        self.counters["rows"] += fits
        self.counters["rejected_saturated"] += ~fits
        return reason

    def add_to_b(self, g: Scaled) -> Reasons:
        """pvid_estimator_add_to_b_q31: g [n_theta, lanes] in units of N's integer times Y's."""
        added = clamp(g.shifted(-2 * self.exponent).fixed(0), HELD_LIMIT)
        places = slice(self.model.moments, -2)
        fits = (np.abs(self.sums[places] + added) <= HELD_LIMIT).all(axis=0)
        fits = fits & (np.abs(self.fresh + added) <= HELD_LIMIT).all(axis=0)
        self.fresh = np.where(fits, self.fresh + added, self.fresh)
        self.sums[places] = np.where(fits, self.sums[places] + added, self.sums[places])
        reason = np.full(self.lanes, Reason.ACCUMULATED, np.uint8)
        reason[~fits] = Reason.REJECTED_SATURATED
        self.counters["rejected_saturated"] += ~fits
        return reason

    def solve(self, ends_group: bool, fallback: tuple[Mask, Int] | None = None) -> Iterator[Reasons | None]:
        """The stages of a solve: None while it is in progress, the reasons [lanes] at the last one.

        refuge: in which lanes p goes elsewhere if it may not step, and where [n_p, lanes].
        """
        reason = np.full(self.lanes, Reason.ACCUMULATED, np.uint8)
        self.was_due = True
        self.size = np.zeros(self.lanes, np.int64)
        if ends_group:
            self.group_rss = self.rss
            self.rss = np.zeros(self.lanes, np.int64)
            self.group_weight = np.zeros(self.lanes, np.int64)
            self.phase += 1
            self.was_due = self.phase >= self.divider
        elif self.is_rate:
            yield reason
            return
        if self.was_due:
            if ends_group:
                self.phase = 0
            for _ in range(self._stages_before_commit()):
                yield None
            reason = self._commit(fallback, ends_group)
            yield None if ends_group else reason
        if ends_group:
            self._forget(slice(0, self.model.n_sums // 2))
            yield None
            self._forget(slice(self.model.n_sums // 2, None))
            self._end_group()
            yield reason

    def solve_stages(self, ends_group: bool) -> int:
        """Stages of a solve that is due."""
        return self._stages_before_commit() + 1 + (self._END_PARTS if ends_group else 0)

    @property
    def assessment_stages(self) -> int:
        """Stages of an assessment: projection, residual, two factors, kappa, columns and errors."""
        return self._shared_stages() + 2 + 2 * self._factor_parts() + 2 * self.model.n_p

    def _stages_before_commit(self) -> int:
        """Stages of projection, factor, force, solve, step, rows of M dtheta."""
        follow = -(-self.model.n_theta // self._ROWS_PER_STAGE)
        return self._shared_stages() + self._factor_parts() + follow + 3

    def _factor_parts(self) -> int:
        return 1 + -(-self.model.n_p // self._PIVOTS_PER_STAGE)

    def _shared_stages(self) -> int:
        """Rows of M, C, rows of S, and whether there is more in it than noise."""
        return self._matrix_stages() + 1 + self.model.n_p + self._factor_parts()

    def _matrix_stages(self) -> int:
        """Stages that scale M, a few rows each."""
        stages = 0
        for block in self.model.blocks.of_kind:
            row = block.start
            while row < block.stop:
                entries = 0
                while row < block.stop and entries < self._ENTRIES_PER_STAGE:
                    entries += block.stop - row
                    row += 1
                stages += 1
        return stages

    # ---- information ----

    def _forget(self, places: slice) -> None:
        """Multiplies some of the sums by the retention at the end of a block."""
        due = (self.age + 1 >= self.block) & (self.retention < 2**31 - 1)
        if due.any():
            self.sums[places] = np.where(due, times_q31(self.sums[places], self.retention), self.sums[places])

    def fade(self, factor: Int) -> Iterator[None]:
        """Multiplies the sums by factor [lanes], Q31, in stages; 0: no change."""
        half = self.model.n_sums // 2
        for places in (slice(0, half), slice(half, None)):
            faded = times_q31(self.sums[places], np.maximum(factor, 1))
            self.sums[places] = np.where(factor > 0, faded, self.sums[places])
            yield None

    def _end_group(self) -> None:
        self.age = np.where(self.age + 1 >= self.block, 0, self.age + 1)
        largest = np.maximum(self.sums[self._diagonal].max(axis=0), self.sums[-2])
        high = largest > SUM_LIMIT
        low = (largest < SUM_LOW) & (self.exponent > 0)
        if (high | low).any():
            change = np.where(high, 2, np.where(low, -2, 0))
            self.sums[:-1] = scale(self.sums[:-1], change)
            self.fresh = scale(self.fresh, change)
            self.exponent = self.exponent + change // 2
        self.fresh = clamp(self.fresh, HELD_LIMIT)

    def _matrix(self, sums: Int) -> Int:
        n = self.model.n_theta
        m = np.zeros((n, n, sums.shape[1]), np.int64)
        upper, column = self._upper
        m[upper, column] = sums[: self.model.moments]
        m[column, upper] = sums[: self.model.moments]
        return m

    # ---- the solve ----

    def _equilibrated(self) -> tuple[Int, Int]:
        """(m, h): M_ij = m_ij 2^(h_i + h_j), m within 30 bits."""
        h = cholesky.half_exponent(self.sums[self._diagonal])
        row, column = self._upper
        m = clamp(scale(self.sums[: self.model.moments], h[row] + h[column]), ONE)
        return self._matrix(m), h

    def _jacobian(self, h: Int) -> tuple[Int, Int]:
        """(c, f): C_ka = c_k 2^(f_a - h_row), c within 29 bits less the guard bits."""
        model = self.model
        exponent = integers(self.c_exponent)[:, None] + h[self._c_row]
        if model.scaled is None:
            c = model.jacobian(self.p)
        else:
            c, more = model.scaled.jacobian(self._numbers(self.p))
            exponent = exponent + more
        lengths = length(c) + exponent
        f = np.stack([np.maximum(lengths[own].max(axis=0), _NOTHING) for own in self._columns]) - self._bits
        return clamp(scale(c, f[self._c_column] - exponent), ONE // 2), f

    def _project(self, c: Int, m: Int) -> Int:
        """The upper triangle of C^T M C, in units of 2^(f_a + f_b + 32) [n_p, n_p, lanes]."""
        model = self.model
        s = np.zeros((model.n_p, model.n_p, self.lanes), np.int64)
        rows = self._c_row
        for a, own in enumerate(self._columns):
            t = upper_product(m[rows[own]], c[own][:, None]).sum(axis=0)
            for b in range(a, model.n_p):
                there = self._columns[b]
                s[a, b] = (c[there] * t[rows[there]]).sum(axis=0)
        return s

    def _above_noise(self, s: Int, f: Int, variance: Scaled) -> Mask:
        """Whether S minus noise_margin times the information of noise of this variance is positive definite."""
        if not self.noise_rows:
            return np.ones(self.lanes, np.bool_)
        row = scaled(self.row_sd * self.row_sd, -16)
        tables = scaled(self.sums[-1], -16).over(scaled(np.full(self.lanes, self.noise_rows), 0))
        much = scaled(self.noise_margin, -16).times(tables).times(variance.over(row))
        rest = s.copy()
        for (a, b), noise in self.noise_table.items():
            rest[a, b] = clamp(s[a, b] - much.times(noise).fixed(-(f[a] + f[b] + 32)), WIDE)
        return np.asarray((self.noise_margin == 0) | cholesky.factor(equilibrated_system(rest)[0]).ok)

    def unscaled_jacobian(self) -> tuple[Int, Int]:
        """(c, f): C_ka = c_k 2^f_a."""
        return self._jacobian(np.zeros((self.model.n_theta, self.lanes), np.int64))

    def _commit(self, fallback: tuple[Mask, Int] | None, ends_group: bool) -> Reasons:
        model = self.model
        m, h = self._equilibrated()
        c, f = self._jacobian(h)
        s = self._project(c, m)
        above_noise = self._above_noise(s, f, self.expected_variance)
        prior = in_units_of_s(self.prior, self.prior_exponent + 2 * self.exponent, f)
        for a in range(model.n_p):
            s[a, a] = s[a, a] + prior[a]
        q, g = equilibrated_system(s)
        factor = cholesky.factor(q)
        own = round_shift(factor.first_pivot * q[0, 0], 31) >= scale(prior[0], 2 * g[0])
        excited = (factor.first_pivot >= self.kappa_min) & (own | (self.kappa_min == 0))
        reason = np.full(self.lanes, Reason.UPDATED, np.uint8)
        reason[~(excited & above_noise)] = Reason.HELD_NOT_EXCITED
        reason[~factor.ok] = Reason.HELD_SINGULAR

        b = self.sums[model.moments : model.moments + model.n_theta]
        in_dead_zone = (reason == Reason.UPDATED) & self._at_rest(factor, c, scale(b, h), g)
        force, force_h = cholesky.to_block(scale(self._driving(b), h), 30)
        if ends_group:
            self.score = self._score(c, f, h)
        self.fresh[:] = 0
        _, x, x_h = self._solve_for(factor, c, force, g)
        dp = clamp(scale(x, f + g - x_h - force_h + 62), STEP_MAX)
        steps = reason == Reason.UPDATED
        self.counters["in_dead_zone"] += in_dead_zone
        p = self._limited(dp, steps & ~in_dead_zone)
        falls_back = np.zeros(self.lanes, np.bool_)
        if fallback is not None:
            falls_back = ~steps & fallback[0]
            p = np.where(falls_back, fallback[1], p)
        return self._follow(p, m, h, b, reason, falls_back, in_dead_zone)

    def _score(self, c: Int, f: Int, h: Int) -> Scaled:
        """C^T sum N e since the last solve [n_p, lanes]."""
        largest = np.max(length(self.fresh) - h, axis=0) - 30
        force = scale(self.fresh, largest + h)
        onto = [upper_product(c[own], force[self._c_row[own]]).sum(axis=0) for own in self._columns]
        return Scaled(np.stack(onto), f + largest + 32 + 2 * self.exponent)

    def _solve_for(self, factor: cholesky.Factor, c: Int, force: Int, g: Int) -> tuple[Int, Int, Int]:
        """(rhs, x, h): C^T force, scaled as the rows of q, and its solution x 2^h."""
        rhs = scale(np.stack([(c[own] * force[self._c_row[own]]).sum(axis=0) for own in self._columns]), g)
        return rhs, *cholesky.solve(factor, rhs)

    def _at_rest(self, factor: cholesky.Factor, c: Int, b: Int, g: Int) -> Mask:
        """Whether p is within the dead zone; b scaled as the rows of C."""
        if not (self.dead_zone > 0).any():
            return np.zeros(self.lanes, np.bool_)
        force, down = cholesky.to_block(b, 30)
        rhs, x, exponent = self._solve_for(factor, c, force, g)
        f, more = cholesky.to_block(rhs, _REST_BITS)
        asked = scaled((f * x).sum(axis=0), exponent + more + 2 * down - 62)
        found, expected = self._row_variance(), self.expected_variance
        noise = pick(found.exceeds(expected), expected, found)
        zone = scaled(self.dead_zone * self.dead_zone, -32)
        bound = zone.times(noise.times(scaled(self.correlation, -16)))
        return (self.dead_zone > 0) & ~asked.exceeds(bound)

    def _driving(self, b: Int) -> Int:
        """g b + (1 - g) sum N e since the last solve."""
        if not self.is_rate:
            return b
        both = times_q31(b, 2 * self.gain) + times_q31(self.fresh, 2 * np.minimum(ONE - self.gain, ONE - 1))
        return np.where(self.gain == 0, self.fresh, both)

    def _limited(self, dp: Int, moving: Mask) -> Int:
        """p after the step, shortened to the step limit, within the bounds; p in lanes without a step."""
        size = np.zeros(self.lanes, np.int64)
        for a in range(self.model.n_p):
            reference = self.p[a] if self.model.positive[a] else self.start_sd[a]
            size = np.maximum(size, (np.abs(dp[a]) << SIZE_BITS) // reference)
        self.size = np.where(moving, size, 0)
        limit = self.step_limit << (SIZE_BITS - 16)
        limited = size > limit
        factor = np.minimum((limit << 31) // np.maximum(size, limit + 1), 2**31 - 1)
        x = self.p + np.where(limited, times_q31(dp, factor), dp)
        above, below = x > self.upper, x < self.lower
        x = np.where(above, self.upper, np.where(below, self.lower, x))
        self.counters["limited"] += moving & limited
        self.counters["bounded"] += moving & (above | below).any(axis=0)
        return np.where(moving, x, self.p)

    def _follow(self, p: Int, m: Int, h: Int, b: Int, reason: Reasons, falls_back: Mask, in_dead_zone: Mask) -> Reasons:
        """Moves p, theta, b and rr together: b -= M dtheta, rr -= dtheta^T (b_old + b_new)."""
        model = self.model
        theta = self._theta_of(p)
        step = theta - self.theta
        align = integers(self.align)[:, None]
        v_h = np.max(length(step) - align + h, axis=0) - self._bits
        v = clamp(scale(step, v_h + align - h), ONE // 2)
        b = clamp(b, HELD_LIMIT)
        moved = clamp(scale((m * v[:, None]).sum(axis=0), -(h + v_h)), HELD_LIMIT)
        w, w_h = cholesky.to_block(scale(2 * b - moved, h), 30)
        fall = (v * w).sum(axis=0)
        residual = self.sums[-2] - clamp(scale(fall, -(v_h + w_h)), HELD_LIMIT)
        overflow = (residual > HELD_LIMIT) | (np.abs(b - moved) > HELD_LIMIT).any(axis=0)
        reason[overflow & (reason == Reason.UPDATED) & ~in_dead_zone] = Reason.HELD_SINGULAR
        stepping = (reason == Reason.UPDATED) & ~in_dead_zone
        moving = stepping | (falls_back & ~overflow)
        kept = self.sums[model.moments : -2]
        self.sums[model.moments : -2] = np.where(moving, b - moved, kept)
        self.sums[-2] = np.where(moving, np.maximum(residual, 0), self.sums[-2])
        self.theta = np.where(moving, theta, self.theta)
        self.p = np.where(moving, p, self.p)
        self.counters["updates"] += stepping
        self.counters["held_not_excited"] += reason == Reason.HELD_NOT_EXCITED
        self.counters["held_singular"] += reason == Reason.HELD_SINGULAR
        return reason

    # ---- what is published ----

    def _row_variance(self) -> Scaled:
        """s^2 of a row, divided by 4^exponent as the sums are."""
        found = self._found_variance()
        explained = self._explained_variance()
        from_rows = pick(explained.exceeds(found), explained, found)
        return pick(self._freedom() < (1 << 16), self.expected_variance, from_rows)

    def _freedom(self) -> Int:
        """Degrees of freedom of the residuals, Q16 [lanes]."""
        return np.asarray(self.sums[-1] - (self.model.n_p << 16))

    def _found_variance(self) -> Scaled:
        return scaled(self.sums[-2], 0).over(scaled(np.maximum(self._freedom(), 1 << 16), -16))

    def _explained_variance(self) -> Scaled:
        """What the sensors' noise explains of it."""
        return self.expected.shifted(-2 * self.exponent)

    def set_expected(self, variance: Scaled) -> None:
        """pvid_estimator_set_expected_q31: variance that the sensors' noise gives the rows since the last group."""
        weight = self.sums[-1]
        counted = (self.group_weight > 0) & (weight >= self.group_weight)
        share = scaled(self.group_weight, 0).over(scaled(np.maximum(weight, 1), 0))
        self.expected = pick(counted, self.expected.plus(share.times(variance.minus(self.expected))), self.expected)

    def _misfit(self) -> Int:
        """Residual variance over its expectation, Q16; 0: unknown [lanes]."""
        known = (self._freedom() >= (1 << 16)) & (self.expected.m > 0)
        explained = self._explained_variance()
        one = scaled(np.ones(self.lanes, np.int64), 0)
        misfit = self._found_variance().over(pick(known, explained, one))
        return np.where(known, clamp(misfit.fixed(16), 2**31 - 1), 0)

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimator_assess_q31 of every lane, dtype estimates.Q31 [lanes]."""
        return self.judged()[0]

    def judged(self) -> tuple[npt.NDArray[np.void], Mask]:
        """The assessment, and whether S contains more information than noise of the residual variance [lanes]."""
        n_p = self.model.n_p
        out = np.zeros(self.lanes, estimates.q31_of(n_p))
        out["p"][:, :n_p] = self.p.T
        out["weight"] = np.minimum(self.sums[-1] >> 16, 2**32 - 1)
        out["misfit"] = self._misfit()
        variance = self._row_variance()
        residual, residual_e = root_of(*variance)
        out["residual_sd"] = clamp(scale(residual, -(residual_e + self.exponent + 8)), 2**31 - 1)
        m, h = self._equilibrated()
        c, f = self._jacobian(h)
        s = self._project(c, m)
        above_noise = self._above_noise(s, f, variance)
        wide = root_of(*variance.times(scaled(self.correlation, -16)))
        self.inverse = assess_errors(out, s, f, self.start_sd, *wide)
        return out, above_noise
