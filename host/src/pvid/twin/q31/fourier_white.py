"""Twin of fourier/white_q31.c, direction_q31.c and columns_q31.c: white columns of windows, all windows at once.

Arrays have the windows (or lanes) last: a column is [rows, windows].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.fourier_q31 import FourierDesignQ31
from pvid.twin.q31.integer import Int, bit_length, clamp, reciprocal, root_of, round_shift, scale, square_root
from pvid.twin.q31.scaled import Scaled, pick, scaled

_COLUMN_BITS = 27
_GUARD = 4  # bits that products lose at least
_NONE = -(2**31)  # exponent where there is no term
_FLOOR_BITS = 20
_LEAST_EXPONENT = -200
_KEPT_BITS = 20
_SQUARE_DOWN = 16
_ONE = 1 << 30
_MOST = 2**31 - 1


def block(wide: Int) -> tuple[Int, Int]:
    """Entries [n, lanes] as a block: (x, exponent [lanes])."""
    longest = bit_length(np.abs(wide)).max(axis=0)
    exponent = np.where(longest > 0, longest - _COLUMN_BITS, 0)
    return scale(wide, exponent), exponent


def take_off(u: Int, x: Int) -> Int:
    """x - u (u^T x), [n, lanes] each."""
    along = clamp(round_shift(np.add.reduce(u * x, axis=0), 30), _MOST)
    return clamp(x - round_shift(u * along, 30), _MOST)


def normalise(x: Int) -> Int:
    """x over its length, Q30; 0 stays 0."""
    square = np.add.reduce(x * x, axis=0)
    m, k = reciprocal(np.maximum(square_root(square), 1))
    return np.where(square > 0, clamp(round_shift(x * m, np.broadcast_to(31 - k, x.shape)), _ONE), 0)


@dataclass(frozen=True)
class White:
    """1 / sqrt(D_h) [H + 1, lanes] and the basis [n/2, rows, lanes] of a kind."""

    design: FourierDesignQ31
    scale: Scaled
    basis: Int

    @property
    def cosines(self) -> int:
        """Rows of real parts."""
        return self.design.highest + 1

    @property
    def families(self) -> tuple[slice, slice]:
        """Rows of real parts, of imaginary parts."""
        return slice(0, self.cosines), slice(self.cosines, self.design.rows)

    def without_basis(self, column: Int) -> Int:
        """A column [rows, lanes] without all directions."""
        found = column
        for u in self.basis:
            found = np.concatenate([take_off(u[one], found[one]) for one in self.families])
        return found


def _number(x: int, like: Int) -> Scaled:
    return scaled(np.full_like(like, x), 0)


def spectrum(design: FourierDesignQ31, kind: int, theta: Scaled) -> Scaled:
    """1 / sqrt(D_h) [H + 1, lanes] at theta of the kind [thetas, lanes]."""
    like = theta.m[0]
    thetas = design.model.kind[kind].thetas
    powers = design.powers
    nothing = Scaled(np.zeros_like(like), np.zeros_like(like))
    weight = [nothing] * powers

    def of(column: int) -> Scaled:
        return Scaled(theta.m[column], theta.e[column]) if column < thetas else _number(-1, like)

    for one in design.noise:
        if one.kind == kind:
            factor = Scaled(*(np.full_like(like, x) for x in one.factor))
            weight[one.power] = weight[one.power].plus(factor.times(of(one.a).times(of(one.b))))
    error = Scaled(*(np.full_like(like, x) for x in design.error_variance[kind]))
    found = []
    for h in range(design.highest + 1):
        total = nothing
        for j in range(powers - 1, -1, -1):
            total = total.times(_number(h * h, like)).plus(weight[j])
            if j == design.error_order[kind]:
                total = total.plus(error)
        total = total.times(_number(2 * design.hop if h == 0 else design.hop, like))
        found.append(pick(total.m > 0, total, nothing))
    mean = nothing
    for one_h in found:
        mean = mean.plus(one_h)
    mean = mean.over(_number(design.highest + 1, like)).shifted(-_FLOOR_BITS)
    least = pick(mean.m > 0, mean, scaled(np.ones_like(like), _LEAST_EXPONENT))
    out = []
    for one_h in found:
        variance = pick(one_h.minus(least).m < 0, least, one_h)
        out.append(_number(1, like).over(scaled(*root_of(variance.m, variance.e))))
    return Scaled(np.stack([one.m for one in out]), np.stack([one.e for one in out]))


def _harmonics(design: FourierDesignQ31) -> npt.NDArray[np.int64]:
    row = np.arange(design.rows)
    return np.where(row <= design.highest, row, row - design.highest)


def basis(design: FourierDesignQ31, inverse: Scaled) -> Int:
    """Orthonormal directions [n/2, rows, lanes], Q30."""
    h = _harmonics(design)
    families = (slice(0, design.highest + 1), slice(design.highest + 1, design.rows))
    made: list[Int] = []
    for k in range(design.power // 2):
        parts = []
        for place, rows in enumerate(families):
            of = h[rows][:, np.newaxis]
            if k:
                wide = of * of * made[k - 1][rows]
            else:
                m, e = inverse.m[h[rows]], inverse.e[h[rows]]
                wide = scale((of * m if place else m) * 65536, np.max(e, axis=0) - e)
            u = block(wide)[0]
            for _ in range(2):
                for before in made:
                    u = block(take_off(before[rows], u))[0]
            parts.append(normalise(u))
        made.append(np.concatenate(parts))
    return np.stack(made)


def white(design: FourierDesignQ31, kind: int, theta: Scaled) -> White:
    """At theta of the kind [thetas, lanes]."""
    inverse = spectrum(design, kind, theta)
    return White(design, inverse, basis(design, inverse))


def column(made: White, kind: int, place: int, window: Int) -> tuple[Int, Int]:
    """A column [rows, lanes] in standard deviations with its exponent [lanes], before the basis is taken off.

    window: S_h [lanes, channels, H + 1, 2].
    """
    design = made.design
    own = design.model.kind[kind]
    terms = [t for t in range(own.first, own.end) if design.model.term[t].column == place]
    lanes = window.shape[0]
    weights = {(t, h): _weight(made, t, h) for t in terms for h in range(made.cosines)}
    exponents = [np.where(one.m != 0, one.e, _NONE) for one in weights.values()]
    top = np.max([np.full(lanes, _NONE), *exponents], axis=0)
    total = np.zeros((design.rows, lanes), np.int64)
    for (t, h), weight in weights.items():
        term = design.model.term[t]
        turned, negative = term.order % 2 == 1, (term.order + 1) % 4 >= 2
        shift = np.where(weight.m != 0, top - weight.e + _GUARD, 0)
        for part in range(2 if h and made.cosines + h <= design.rows else 1):
            s = window[:, term.channel, h, (1 - part) if turned else part]
            minus = (turned != negative) if part == 0 else negative
            total[h if part == 0 else made.cosines + h - 1] += round_shift((-s if minus else s) * weight.m, shift)
    x, exponent = block(total)
    return x, np.where(top > _NONE, top + _GUARD, 0) + exponent


def _weight(made: White, t: int, h: int) -> Scaled:
    """Of a term at a harmonic, |m| <= 2^30."""
    factor, order = made.design.factor[t], made.design.model.term[t].order
    power = h**order
    both = (factor[0] * made.scale.m[h]) >> 30
    bits = power.bit_length()
    return Scaled((both * power) >> bits, factor[1] + made.scale.e[h] + 30 + bits)


def square(x: Int) -> Int:
    """sum x^2 2^-16 of columns [rows, lanes]."""
    return np.asarray(np.add.reduce((x * x) >> _SQUARE_DOWN, axis=0))


@dataclass(frozen=True)
class Columns:
    """White columns of a kind: theta's, Y. A value is x 2^exponent.

    Attributes
    ----------
    x : [columns, rows, lanes]
    exponent : [columns, lanes]
    live : nuisances that were projected out [lanes]
    """

    x: Int
    exponent: Int
    live: Int


def columns(made: White, kind: int, window: Int) -> Columns:
    """Of windows' sums [lanes, channels, H + 1, 2], without the basis and the nuisances."""
    own = made.design.model.kind[kind]
    plain = [column(made, kind, place, window) for place in range(own.columns)]
    x = [made.without_basis(one) for one, _ in plain]
    whole = [square(one) for one in x]
    live = np.zeros(window.shape[0], np.int64)
    for place in range(own.thetas + 1, own.columns):
        left = square(x[place])
        kept = (left > 0) & (left > (whole[place] >> _KEPT_BITS))
        live = live + kept
        direction = np.where(kept, normalise(block(x[place])[0]), 0)
        for other in [*range(own.thetas + 1), *range(place + 1, own.columns)]:
            x[other] = take_off(direction, x[other])
    used = own.thetas + 1
    return Columns(np.stack(x[:used]), np.stack([e for _, e in plain[:used]]), live)
