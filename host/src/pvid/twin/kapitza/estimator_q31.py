"""Twin of the fixed-point strong form's estimator (kapitza_sums_q31.c to kapitza_assess_q31.c), one lane a start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.settings.enums import Reason
from pvid.settings.q31 import EstimatorConfigQ31
from pvid.settings.tables import RATE_BITS, RowFormatQ31
from pvid.twin import estimates
from pvid.twin.kapitza.strong_q31 import A, E, X, Y, Z, innovation
from pvid.twin.q31 import cholesky
from pvid.twin.q31.estimator import (
    ONE,
    SIZE_BITS,
    STEP_MAX,
    SUM_LIMIT,
    SUM_LOW,
    assess_errors,
    forgetting,
    square_ratio,
)
from pvid.twin.q31.integer import WIDE, Int, bit_length, clamp, integers, root_of, round_shift, scale, times_q31
from pvid.twin.q31.scaled import Scaled, pick, scaled
from pvid.twin.record import COUNTERS

Mask = npt.NDArray[np.bool_]
Reasons = npt.NDArray[np.uint8]

N_SUMS, WEIGHT = 58, 57
W, D1, D2 = range(3)
W_BITS = RATE_BITS + 1
MANTISSA_BITS, DELTA_BITS, L_BITS, PIVOT_SHIFT, RHS_BITS, SOLUTION_BITS = 28, W_BITS - 2, 29, 20, 27, 27
_FEW = 2**16  # of a square after the shift: fewer bits are too few
_FAR_BITS, _FAR_TIME = 53, 2
_FORCE_MAX = 2**61
_KEEP = 2**31 - 1
_GUARD_BITS = 5

# The entries of a row whose product each sum is, and the power of G in it, where A counts as 1 and Y as 2.
_FAMILIES = [
    *[(A, A), (A, E), (E, E), (Y, A), (Y, E), (Y, Y)],
    *[(one, X + k) for one in (A, E, Y) for k in range(4)],
    *[(one, Z + k) for one in (A, E, Y) for k in range(5)],
    *[(X, X + k) for k in range(4)],
    *[(X + 3, X + k) for k in (1, 2, 3)],
    *[(Z, X + k) for k in range(4)],
    *[(X + 3, Z + k) for k in range(1, 5)],
    *[(Z, Z + k) for k in range(5)],
    *[(Z + 4, Z + k) for k in range(1, 5)],
]
_LEFT, _RIGHT = np.array(_FAMILIES).T
_POWER = np.array([1, 0, 3, 2, 1, 0, 4, 3, 2, 1, 0, 2])
_POWERS = (_POWER[_LEFT] + _POWER[_RIGHT])[:, None]
_AX, _AZ, _XX, _XZ, _ZZ = 6, 18, 33, 40, 48


def _places() -> npt.NDArray[np.intp]:
    """Which sum holds the product of two entries of a row, [12, 12]."""
    places = np.full((Y + 1, Y + 1), -1, np.intp)
    for k, (i, j) in reversed(list(enumerate(_FAMILIES))):
        places[i, j] = places[j, i] = k
    along = np.arange(max(Z - X, Y - Z))
    powers = along[:, None] + along  # products of one power of G are one sum
    x, z = Z - X, Y - Z
    places[X:Z, X:Z] = _XX + powers[:x, :x]
    places[X:Z, Z:Y] = _XZ + powers[:x, :z]
    places[Z:Y, X:Z] = places[X:Z, Z:Y].T
    places[Z:Y, Z:Y] = _ZZ + powers[:z, :z]
    return places


_PLACES = _places()
_TRIPLES = {"k22": _XX, "k20": _XZ, "k00": _ZZ}
_SQUARES = [0, 2, 5, _XX, _XX + 6, _ZZ, _ZZ + 8]
_BINOMIALS = {2: (2, 1), 3: (3, 3, 1), 4: (4, 6, 4, 1), 5: (5, 10, 10, 5, 1), 6: (6, 15, 20, 15, 6, 1)}
_THETA_BINOMIALS = (1, 1, 1, 3, 3, 1, 1, 4, 6, 4, 1)


def _out(x: Int) -> Int:
    return round_shift(x, 30)


def _part(a: Int, b: Int) -> Int:
    return _out(a * b)


def _by_l(a: Int, b: Int) -> Int:
    return round_shift(a * b, L_BITS)


def _moved(x: Int, shift: Int) -> Int:
    """x 2^shift rounded half up."""
    return np.where(shift >= 0, x << np.maximum(shift, 0), round_shift(x, np.maximum(-shift, 0)))


def _half_beyond(square: Int) -> Int:
    """Half the bits that a square has beyond those of a mantissa, rounded up."""
    return (np.maximum(bit_length(square) - MANTISSA_BITS, 0) + 1) // 2


class _System:
    """S, F and their scales at the present p: pvid_kapitza_system_q31."""

    scale_a: Int
    scale_x: Int
    scale_z: Int
    of_x: Int
    of_z: Int

    def __init__(self, sums: Int, p: Int, reference: Int, bits: tuple[int, int]) -> None:
        beyond = p[W] - reference
        lengths = bit_length(3 * p[D1]) - bits[0], bit_length(4 * p[D2]) - bits[1]
        near = bit_length(np.abs(beyond)) <= DELTA_BITS
        self.time = np.zeros_like(beyond)
        self._scale(sums, lengths)
        d = np.where(near, beyond, 0) << (30 - W_BITS)
        m = self._shifted(self._mantissas(sums), d)
        far = ~near | (m["k22"][2] < _FEW) | (m["k00"][2] < _FEW)
        if far.any():
            before = self.time, self.scale_x, self.scale_z, self.scale_a, self.of_x, self.of_z
            own, d_far = self._shifted_far(sums, beyond, lengths)
            d = np.where(far, d_far, d)
            m = {name: np.where(far, own[name], values) for name, values in m.items()}
            now = self.time, self.scale_x, self.scale_z, self.scale_a, self.of_x, self.of_z
            chosen = (np.where(far, b, a) for a, b in zip(before, now, strict=True))
            self.time, self.scale_x, self.scale_z, self.scale_a, self.of_x, self.of_z = chosen
        d1 = np.minimum(_moved(p[D1], self.of_x - bits[0] + 30), ONE // 6)
        d2 = np.minimum(_moved(p[D2], self.of_z - bits[1] + 30), ONE // 8)
        self._combine(m, d, d1, d2)

    def _scale(self, sums: Int, lengths: tuple[Int, Int]) -> None:
        self.scale_x = np.maximum(_half_beyond(sums[_XX + 6]), _half_beyond(sums[_XX]))
        self.scale_z = np.maximum(_half_beyond(sums[_ZZ + 8]), _half_beyond(sums[_ZZ]))
        self._relate(np.maximum.reduce([_half_beyond(sums[k]) for k in (0, 2, 5)]), lengths)

    def _relate(self, of_a: Int, lengths: tuple[Int, Int]) -> None:
        """The scale of A, E, Y: at least of_a; 3 d1 and 4 d2 in units of the residual are below a half."""
        t = self.time
        of_d = self.scale_x + t + lengths[0] + 1, self.scale_z + 2 * t + lengths[1] + 1
        self.scale_a = np.maximum.reduce([of_a, *of_d])
        self.of_x = self.scale_x + t - self.scale_a
        self.of_z = self.scale_z + 2 * t - self.scale_a

    def _shifted_far(self, sums: Int, beyond: Int, lengths: tuple[Int, Int]) -> tuple[dict[str, Int], Int]:
        """The shift in 64 bits, its scales, and d in their time unit."""
        t = np.maximum(bit_length(np.abs(beyond)) - W_BITS, 0)
        d = clamp(round_shift(beyond << (31 - W_BITS), t), 2**31 - 1)

        def length(x: Int) -> Int:
            return np.where(x > 0, bit_length(np.maximum(x, 0)), 0)

        def half(bits: int, *squares: tuple[Int, Int | int]) -> Int:
            longest = np.maximum.reduce([length(x) - less for x, less in squares])
            return np.asarray((longest - bits + 1) >> 1)

        a = half(_FAR_BITS, (sums[2], 0), (sums[0], 2 * t), (sums[5], 4 * t))
        x = half(_FAR_BITS, (sums[_XX + 6], 0), (sums[_XX], 6 * t))
        z = half(_FAR_BITS, (sums[_ZZ + 8], 0), (sums[_ZZ], 8 * t))
        m = scale(sums[:WEIGHT], self._shifts(a, x, z) + _POWERS * t)
        for at, count in [*((_AX + 4 * k, 4) for k in range(3)), *((_AZ + 5 * k, 5) for k in range(3))]:
            self._shift_64(m, at, count, d)
        for at, count in ((_XX, 7), (_XZ, 8), (_ZZ, 9)):
            self._shift_64(m, at, count, d)
        far = _FAR_TIME
        more_a = half(MANTISSA_BITS, (m[2], 0), (m[0], 2 * far), (m[5], 4 * far))
        more_x = np.maximum(half(MANTISSA_BITS, (m[_XX + 2], 4 * far), (m[_XX], 6 * far)), -x)
        more_z = np.maximum(half(MANTISSA_BITS, (m[_ZZ + 2], 6 * far), (m[_ZZ], 8 * far)), -z)
        self.time = t + far
        self.scale_x, self.scale_z = x + more_x, z + more_z
        self._relate(np.maximum(a + more_a, 0), lengths)
        out = clamp(scale(m, self._shifts(self.scale_a - a, more_x, more_z) + far * _POWERS), 1 << MANTISSA_BITS)
        alone = dict(zip(("aa", "ae", "ee", "ya", "ye"), out[:5], strict=True))
        pairs = {f"{one}2": out[[_AX + 4 * k + 1, _AX + 4 * k]] for k, one in enumerate("aey")}
        pairs |= {f"{one}0": out[[_AZ + 5 * k + 1, _AZ + 5 * k]] for k, one in enumerate("aey")}
        triples = {name: out[[at + 2, at + 1, at]] for name, at in _TRIPLES.items()}
        return alone | pairs | triples, round_shift(d, far + 1)

    @staticmethod
    def _shift_64(m: Int, at: int, count: int, d: Int) -> None:
        for left in range(count - 1, 0, -1):
            m[at : at + left] += times_q31(m[at + 1 : at + left + 1], d)

    @staticmethod
    def _shifts(a: Int, x: Int, z: Int) -> Int:
        repeated: Int = np.repeat([2 * a, a + x, a + z, 2 * x, x + z, 2 * z], [6, 12, 15, 7, 8, 9], axis=0)
        return repeated

    def _mantissas(self, sums: Int) -> Int:
        shifts = self._shifts(self.scale_a, self.scale_x, self.scale_z)
        return round_shift(sums[:WEIGHT], shifts)

    @staticmethod
    def _powers(d: Int) -> list[Int]:
        """d, d^2 .. d^6."""
        d2 = _part(d, d)
        d3, d4 = _part(d2, d), _part(d2, d2)
        return [d, d2, d3, d4, _part(d4, d), _part(d3, d3)]

    def _shifted(self, m: Int, d: Int) -> dict[str, Int]:
        """Moments at the present rate of mantissas m: one, two or three powers of it."""
        powers = self._powers(d)
        coefficients = {r: [b * x for b, x in zip(row, powers, strict=False)] for r, row in _BINOMIALS.items()}

        def along(at: int, r: int) -> Int:
            total: Int = m[at] << 30
            for i, c in enumerate(coefficients[r]):
                total = total + c * m[at + 1 + i]
            return total

        def pair(at: int, r: int) -> Int:
            low = _out(along(at + 1, r))
            return np.stack([low, _out(along(at, r) + d * low)])

        def triple(at: int, r: int) -> Int:
            low = _out(along(at + 2, r))
            first = along(at + 1, r)
            mid = _out(first + d * low)
            return np.stack([low, mid, _out(along(at, r) + (d * _out(first) + d * mid))])

        alone = dict(zip(("aa", "ae", "ee", "ya", "ye"), m[:5], strict=True))
        pairs = {f"{one}2": pair(_AX + 4 * k, 2) for k, one in enumerate("aey")}
        pairs |= {f"{one}0": pair(_AZ + 5 * k, 3) for k, one in enumerate("aey")}
        return alone | pairs | {name: triple(at, r) for (name, at), r in zip(_TRIPLES.items(), (4, 5, 6), strict=True)}

    def _combine(self, m: dict[str, Int], d: Int, d1: Int, d2: Int) -> None:
        aa, ae, ee, ya, ye, a2, e2, y2, a0, e0, y0, k22, k20, k00 = m.values()
        d1_3, d2_4, two_d, dd = 3 * d1, 4 * d2, 2 * d, _part(d, d)
        x_2 = a2[0] + _part(two_d, e2[0])
        x_0 = a0[0] + _part(two_d, e0[0])
        a_e = ae + _part(two_d, ee)
        x_x = aa + _part(two_d, ae + a_e)
        n_2 = x_2 + _out(d1_3 * k22[0] + d2_4 * k20[0])
        n_0 = x_0 + _out(d1_3 * k20[0] + d2_4 * k00[0])
        s_ww = x_x + _out(d1_3 * x_2 + d1_3 * n_2 + d2_4 * x_0 + d2_4 * n_0)
        s_w1 = a2[1] + _out(two_d * e2[1] + d1_3 * k22[1] + d2_4 * k20[1])
        s_w2 = a0[1] + _out(two_d * e0[1] + d1_3 * k20[1] + d2_4 * k00[1])
        self.s = np.stack([s_ww, s_w1, s_w2, k22[2], k20[2], k00[2]])

        q_a = _out(d * aa + dd * ae)
        q_e = _out(d * ae + dd * ee)
        q_2 = _out(d * a2[0] + dd * e2[0])
        q_0 = _out(d * a0[0] + dd * e0[0])
        f_w = ((ya - q_a) << 30) + two_d * (ye - q_e) + d1_3 * (y2[0] - q_2) + d2_4 * (y0[0] - q_0)
        f_w = f_w - d1 * s_w1 - d2 * s_w2
        f_1 = (y2[1] << 30) - d * a2[1] - dd * e2[1] - d1 * k22[2] - d2 * k20[2]
        f_2 = (y0[1] << 30) - d * a0[1] - dd * e0[1] - d1 * k20[2] - d2 * k00[2]
        self.f = np.stack([f_w, f_1, f_2])

    @property
    def columns(self) -> Int:
        """Exponents of n_w, n_1, n_2 [3, lanes]."""
        return np.stack([self.scale_a + self.time, self.scale_x + 3 * self.time, self.scale_z + 4 * self.time])

    @property
    def of_row(self) -> Int:
        """Exponent of the residual."""
        return np.asarray(self.scale_a + 2 * self.time)


class _Factor:
    """S + H0 = L D L^T of every lane; `ok` where every pivot is data."""

    def __init__(self, s: Int, priors: Int) -> None:
        s00, s11, s22 = s[0] + priors[W], s[3] + priors[D1], s[5] + priors[D2]
        positive = (s00 > 0) & (s11 > 0) & (s22 > 0)
        s00, s11, s22 = (np.where(positive, one, 1 << 28) for one in (s00, s11, s22))
        self.g = g = cholesky.half_exponent(np.stack([s00, s11, s22]))
        self.up = np.zeros_like(self.g)
        self.inverse = np.zeros_like(self.g)

        def beside(x: Int, shift: Int) -> Int:
            return clamp(np.where(shift >= -31, _moved(x, -np.maximum(shift, -31)), 0), ONE)

        def diagonal(x: Int, a: int) -> Int:
            return clamp(scale(x, 2 * g[a]), ONE)

        q01, q02, q12 = beside(s[1], g[W] + g[D1]), beside(s[2], g[W] + g[D2]), beside(s[4], g[D1] + g[D2])
        q11 = diagonal(s11, D1)
        self.s00, self.prior = diagonal(s00, W), diagonal(priors[W], W)
        self._invert(D2, diagonal(s22, D2))
        self.l02, self.l12 = self._entry(D2, q02), self._entry(D2, q12)
        p1 = q11 - _by_l(self.l12, q12)
        self.ok = positive & (p1 > q11 >> PIVOT_SHIFT)
        self._invert(D1, np.where(self.ok, p1, ONE))
        c01 = clamp(q01 - _by_l(self.l02, q12), ONE)
        self.l01 = self._entry(D1, c01)
        self.p0 = np.minimum(self.s00 - _by_l(self.l02, q02) - _by_l(self.l01, c01), ONE)
        self.ok = self.ok & (self.p0 > self.s00 >> PIVOT_SHIFT)
        self._invert(W, np.where(self.ok, self.p0, ONE))

    def _invert(self, a: int, pivot: Int) -> None:
        below = np.minimum(pivot, ONE - 1)
        self.up[a] = 30 - bit_length(below)
        d = below << self.up[a]
        r = (1 << 31) // (d >> 14)
        rest = round_shift((1 << 45) - d * r, 15)
        self.inverse[a] = r * 8192 + round_shift(rest * r, 17)

    def _over(self, a: int, x: Int) -> Int:
        return _by_l(x, self.inverse[a])

    def _entry(self, a: int, x: Int) -> Int:
        most = np.int64(ONE - 1) >> self.up[a]
        limited = np.minimum(np.maximum(self._over(a, x), -most), most)
        return np.asarray(limited << self.up[a])

    def solve(self, f: Int) -> tuple[Int, Int, Int, Int]:
        """x [3, lanes], its exponent, b [3, lanes] and its exponent."""
        lengths = np.where(f == 0, -200, bit_length(np.abs(f))) - self.g
        h = lengths.max(axis=0) - RHS_BITS
        b = scale(f, self.g + h)
        z1 = b[D1] - _by_l(self.l12, b[D2])
        z0 = b[W] - _by_l(self.l02, b[D2]) - _by_l(self.l01, z1)
        y = np.stack([self._over(W, z0), self._over(D1, z1), self._over(D2, b[D2])])
        down = np.maximum(bit_length(np.abs(y)) + self.up - SOLUTION_BITS, 0).max(axis=0)
        own = _moved(y, self.up - down)
        x0 = own[W]
        x1 = own[D1] - _by_l(self.l01, x0)
        x2 = own[D2] - _by_l(self.l02, x0) - _by_l(self.l12, x1)
        return np.stack([x0, x1, x2]), h - 30 - L_BITS + down, b, h - 30


class KapitzaEstimatorQ31:
    """pvid_kapitza_estimator_q31 in every lane; all share formats, reference, divider and whether the law is a rate.

    p int64 [3, lanes]; sums int64 [58, lanes]: 57 moments times 4^-exponent, weight in Q16.
    """

    def __init__(self, configs: Sequence[EstimatorConfigQ31], row_format: RowFormatQ31) -> None:
        first = configs[0]
        if any((c.p_bits, c.divider, c.gain < ONE) != (first.p_bits, first.divider, first.gain < ONE) for c in configs):
            raise PvidError("lanes of one twin must share formats, divider and whether the law is a rate")
        lanes = len(configs)

        def stacked(name: str) -> Int:
            return np.stack([integers(getattr(c, name)) for c in configs], axis=1)

        def lane(name: str) -> Int:
            return integers([getattr(c, name) for c in configs])

        self.p = stacked("start")
        self.start_sd, self.lower, self.upper = stacked("start_sd"), stacked("lower"), stacked("upper")
        self.row_sd, self.correlation = lane("row_sd"), lane("correlation")
        self.step_limit, self.kappa_min, self.dead_zone = lane("step_limit"), lane("kappa_min"), lane("dead_zone")
        self.gain = lane("gain")
        self.is_rate = first.gain < ONE
        self.divider = first.divider
        self.bits = (first.p_bits[D1] + row_format.finer[0], first.p_bits[D2] + row_format.finer[1])
        self._p_bits = integers([W_BITS, *self.bits])[:, None]
        self.reference = np.full(lanes, 2 * row_format.reference, np.int64)
        self.block, self.retention = integers([forgetting(c.forgetting_groups) for c in configs]).T
        self.prior, self.prior_exponent = square_ratio(self.row_sd, integers(-8), self.start_sd)
        self.phase = 0
        self.age = np.zeros(lanes, np.int64)
        self.exponent = np.zeros(lanes, np.int64)
        self.sums = np.zeros((N_SUMS, lanes), np.int64)
        self.fresh = np.zeros((3, lanes), np.int64)
        self.counters = {name: np.zeros(lanes, np.int64) for name in COUNTERS}

    @property
    def lanes(self) -> int:
        """Number of lanes."""
        return int(self.p.shape[1])

    @property
    def expected_variance(self) -> Scaled:
        """row_sd^2 [lanes], in units of the sums."""
        return scaled(self.row_sd * self.row_sd, -2 * (8 + self.exponent))

    def innovation(self, row: Int) -> tuple[Int, Int, Mask]:
        """e [lanes], its gradient [3, lanes], and whether the row [13] or [13, lanes] can be taken."""
        return innovation(row, self.p, self.reference, self.bits)

    def take(self, row: Int, e: Int, gradient: Int) -> Reasons:
        """Adds a row that can be taken to every lane, and solves if that is due."""
        wide = np.broadcast_to(row[:-1] if row.ndim == 2 else row[:-1, None], (12, self.lanes))
        n = round_shift(wide, self.exponent)
        sums = self.sums.copy()
        sums[:WEIGHT] += n[_LEFT] * n[_RIGHT]
        sums[WEIGHT] += 1 << 16
        self.sums = sums
        if self.is_rate:
            self.fresh = clamp(self.fresh + gradient * e, WIDE)
        self.counters["rows"] += 1
        self.phase += 1
        reason = np.full(self.lanes, Reason.ACCUMULATED, np.uint8)
        if self.phase >= self.divider:
            self.phase = 0
            reason = self._solve()
            self.fresh = np.zeros_like(self.fresh)
        self._end_row()
        return reason

    # ---- sums ----

    def _end_row(self) -> None:
        self.age = self.age + 1
        ends = self.age >= self.block
        looks = ends | (self.age % 8 == 0)
        largest = self.sums[_SQUARES].max(axis=0)
        high = looks & (largest > SUM_LIMIT)
        low = looks & (largest < SUM_LOW) & (self.exponent > 0) & ~high
        if (high | low).any():
            moments = self.sums[:WEIGHT]
            grown = 4 * clamp(moments, WIDE // 4)
            self.sums[:WEIGHT] = np.where(high, round_shift(moments, 2), np.where(low, grown, moments))
            self.exponent = self.exponent + high - low
        self.age = np.where(ends, 0, self.age)
        forgets = ends & (self.retention < _KEEP)
        if forgets.any():
            self.sums = np.where(forgets, times_q31(self.sums, self.retention), self.sums)

    # ---- the solve ----

    def _system(self) -> _System:
        return _System(self.sums, self.p, self.reference, self.bits)

    def _priors(self, system: _System) -> Int:
        shift = self.prior_exponent + 2 * (system.columns - self._p_bits + self.exponent)
        return np.where(shift < 32, clamp(scale(self.prior, np.minimum(shift, 32)), WIDE // 4), 0)

    def _solve(self) -> Reasons:
        system = self._system()
        factor = _Factor(system.s, self._priors(system))
        excited = (factor.p0 >= _part(self.kappa_min, factor.s00)) & (factor.p0 >> 1 >= factor.prior)
        excited |= self.kappa_min == 0
        reason = np.full(self.lanes, Reason.UPDATED, np.uint8)
        reason[~excited] = Reason.HELD_NOT_EXCITED
        reason[~factor.ok] = Reason.HELD_SINGULAR
        updated = reason == Reason.UPDATED
        at_rest = updated & self._at_rest(system, factor)
        x, exponent, _, _ = factor.solve(self._driven(system))
        bits = np.stack([W_BITS + system.time, self.bits[0] - system.of_x, self.bits[1] - system.of_z])
        dp = clamp(scale(x, -(exponent - factor.g + bits)), STEP_MAX)
        self._move(dp, updated & ~at_rest)
        self.counters["in_dead_zone"] += at_rest
        self.counters["updates"] += updated & ~at_rest
        self.counters["held_not_excited"] += reason == Reason.HELD_NOT_EXCITED
        self.counters["held_singular"] += reason == Reason.HELD_SINGULAR
        return reason

    def _driven(self, system: _System) -> Int:
        """sum gradient e + g (F - sum gradient e)."""
        if not self.is_rate:
            return system.f
        shift = system.columns + system.of_row + 2 * self.exponent - 30
        fresh = clamp(scale(self.fresh, shift), _FORCE_MAX)
        part = np.minimum(2 * self.gain, 2**31 - 1)
        both = np.where(self.gain == ONE, system.f, fresh + times_q31(system.f - fresh, part))
        return np.where(self.gain == 0, fresh, both)

    def _at_rest(self, system: _System, factor: _Factor) -> Mask:
        """Whether p is within the dead zone."""
        if not (self.dead_zone > 0).any():
            return np.zeros(self.lanes, np.bool_)
        x, exponent, b, of_b = factor.solve(system.f)
        asked = scaled(np.zeros(self.lanes, np.int64), 0)
        for a in range(3):
            asked = asked.plus(scaled(b[a], of_b).times(scaled(x[a], exponent)))
        asked = asked.shifted(2 * system.of_row)
        found, expected = self._variance(), self.expected_variance
        noise = pick(found.exceeds(expected), expected, found)
        zone = scaled(self.dead_zone * self.dead_zone, -32)
        return (self.dead_zone > 0) & ~asked.exceeds(zone.times(noise.times(scaled(self.correlation, -16))))

    def _move(self, dp: Int, moving: Mask) -> None:
        """p + dp, shortened to the step limit, within the bounds."""
        most = (self.p * self.step_limit) >> 16
        long = (np.abs(dp) > most).any(axis=0)
        size = ((np.abs(dp) << SIZE_BITS) // self.p).max(axis=0)
        limit = self.step_limit << (SIZE_BITS - 16)
        limited = long & (size > limit)
        factor = np.minimum((limit << 31) // np.maximum(size, limit + 1), 2**31 - 1)
        x = self.p + np.where(limited, times_q31(dp, factor), dp)
        within = np.minimum(np.maximum(x, self.lower), self.upper)
        self.counters["limited"] += moving & limited
        self.counters["bounded"] += moving & (within != x).any(axis=0)
        self.p = np.where(moving, within, self.p)

    # ---- what is published ----

    def _theta(self) -> tuple[Int, Int]:
        """theta with d = w - w_r in place of w: mantissas [11, lanes] and their exponent, less 31."""
        d = scaled(self.p[W] - self.reference, -W_BITS)
        theta = [d, d.times(d)]
        for a, bits, count in ((D1, self.bits[0], 4), (D2, self.bits[1], 5)):
            theta.append(scaled(self.p[a], -bits))
            for _ in range(count - 1):
                theta.append(theta[-1].times(d))
        theta = [one.times(scaled(b, 0)) for one, b in zip(theta, _THETA_BINOMIALS, strict=True)]
        largest = np.max([np.where(one.m != 0, one.e + 31, 0) for one in theta], axis=0)
        largest = np.maximum(largest, 0)
        return np.stack([clamp(one.fixed(31 - largest), 2**31 - 1) for one in theta]), largest

    def _residual(self) -> Int:
        """The sum of squares of the residuals at the present p."""
        theta, exponent = self._theta()
        known = times_q31(round_shift(self.sums[_PLACES[:Y, :Y]], _GUARD_BITS), theta).sum(axis=1)
        of_y = round_shift(self.sums[_PLACES[Y, :Y]], exponent + _GUARD_BITS)
        residual = round_shift(self.sums[5], 2 * exponent + _GUARD_BITS)
        residual = residual + times_q31(clamp(known - 2 * of_y, WIDE // 8), theta).sum(axis=0)
        return np.maximum(scale(clamp(residual, WIDE), -(2 * exponent + _GUARD_BITS)), 0)

    def _variance(self) -> Scaled:
        """s^2 of a row, divided by 4^exponent as the sums are."""
        freedom = self.sums[WEIGHT] - (3 << 16)
        found = scaled(self._residual(), 0).over(scaled(np.maximum(freedom, 1 << 16), -16))
        return pick(freedom < (1 << 16), self.expected_variance, found)

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_kapitza_estimator_assess_q31 of every lane, dtype estimates.Q31 [lanes]."""
        out = np.zeros(self.lanes, estimates.q31_of(3))
        out["p"][:, :3] = self.p.T
        out["weight"] = np.minimum(self.sums[WEIGHT] >> 16, 2**32 - 1)
        variance = self._variance()
        residual, residual_e = root_of(*variance)
        out["residual_sd"] = clamp(scale(residual, -(residual_e + self.exponent + 8)), 2**31 - 1)
        system = self._system()
        places = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
        f = system.columns - self._p_bits - 28
        root = root_of(*variance.times(scaled(self.correlation, -16)))
        assess_errors(out, system.s[places] << 24, f, self.start_sd, *root)
        return out
