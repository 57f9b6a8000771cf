"""Twin of weak/white_q31.c, mirror_q31.c and columns_q31.c: white columns of windows, all windows at once.

Arrays have the windows (or lanes) last: a column is [rows, windows].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.weak_q31 import WeakDesignQ31
from pvid.twin.q31.integer import Int, bit_length, round_shift
from pvid.twin.q31.scaled import Scaled, inverse_root, pick, scaled

_BITS, _MANY = 26, 43  # of a column's largest entry; entries with which it has a bit less
_SUM_BITS = 30  # of the sums of a channel
_PRODUCT_DOWN = 33
_NONE = -(2**31)  # exponent where there is no term
_FLOOR_BITS = 33
_LEAST_EXPONENT = -200
_KEPT_BITS = 20
_SQUARE_DOWN = 16
_ONE = 1 << 30


def block(x: Int) -> tuple[Int, Int]:
    """Entries [n, lanes] as a block: (x, exponent [lanes])."""
    longest = bit_length(np.bitwise_or.reduce(np.abs(x), axis=0))
    exponent = np.where(longest > 0, longest - (_BITS if len(x) <= _MANY else _BITS - 1), 0)
    return (x >> np.maximum(exponent, 0)) << np.maximum(-exponent, 0), exponent


def mirror_of(x: Int) -> Int:
    """The reflection that leaves the first entry of x [n, lanes] alone; 0 stays 0."""
    square = np.add.reduce(x * x, axis=0)
    inverse = inverse_root(scaled(np.maximum(square, 1), 0))
    shift = np.broadcast_to(-(inverse.e + 30), x.shape)
    u = round_shift(x * inverse.m, shift)
    size = np.minimum(np.abs(u[0]), _ONE)
    half = inverse_root(scaled(_ONE + size, -30))
    v = round_shift(u * half.m, 30)
    top = round_shift(((_ONE + size) >> 1) * half.m, 29)
    v[0] = np.where(u[0] < 0, -top, top)
    return np.where(square > 0, v, 0)


def mirrored(v: Int, x: Int) -> Int:
    """x - v (v^T x), [n, lanes] each."""
    along = round_shift(np.add.reduce(v * x, axis=0), 30)
    return np.asarray(x - ((v * along) >> 30))


@dataclass(frozen=True)
class White:
    """Of a kind: 1 / sqrt(D_h) = gain 2^exponent of each harmonic, and the reflections.

    Attributes
    ----------
    design : of the weak form
    gain : [H + 1, lanes]
    exponent : [H + 1, lanes]
    mirrors : of the real parts, of the imaginary parts [n/2][entries, lanes]
    """

    design: WeakDesignQ31
    gain: Int
    exponent: Int
    mirrors: tuple[list[Int], list[Int]]

    @property
    def cosines(self) -> int:
        """Real parts."""
        return self.design.highest + 1

    def rows(self, column: Int) -> Int:
        """White rows [K, lanes] of a column [K + n, lanes]."""
        kept = []
        for one, mirrors in zip((column[: self.cosines], column[self.cosines :]), self.mirrors, strict=True):
            kept.append(_reflected(mirrors, one)[len(mirrors) :])
        return np.concatenate(kept)


def _reflected(mirrors: Sequence[Int], x: Int) -> Int:
    found = x.copy()
    for k, v in enumerate(mirrors):
        found[k:] = mirrored(v, found[k:])
    return found


def _weight(gain: Int, order: int, h: int) -> Int:
    """h^order / sqrt(D_h) [lanes], but for the exponents of h."""
    weight: Int = gain[h]
    for _ in range(order):
        weight = (weight * (h << (30 - h.bit_length()))) >> 30
    return weight


def _exponent(exponent: Int, order: int, h: int) -> Int:
    """Of that [lanes]."""
    return np.asarray(exponent[h] + order * h.bit_length())


def _number(x: int, like: Int) -> Scaled:
    return scaled(np.full_like(like, x), 0)


def spectrum(design: WeakDesignQ31, kind: int, theta: Scaled, error_variance: Scaled) -> tuple[Int, Int]:
    """1 / sqrt(D_h) [H + 1, lanes] with the exponents, at theta of the kind [thetas, lanes]."""
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
    found = []
    for h in range(design.highest + 1):
        total = nothing
        for j in range(powers - 1, -1, -1):
            total = total.times(_number(h * h, like)).plus(weight[j])
            if j == design.error_order[kind]:
                total = total.plus(error_variance)
        total = total.times(_number(2 * design.hop if h == 0 else design.hop, like))
        found.append(pick(total.m > 0, total, nothing))
    mean = nothing
    for one_h in found:
        mean = mean.plus(one_h)
    mean = mean.over(_number(design.highest + 1, like)).shifted(-_FLOOR_BITS)
    least = pick(mean.m > 0, mean, scaled(np.ones_like(like), _LEAST_EXPONENT))
    out = []
    for one_h in found:
        out.append(inverse_root(pick(least.exceeds(one_h), least, one_h)))
    return np.stack([one.m for one in out]), np.stack([one.e for one in out])


def _mirrors(design: WeakDesignQ31, gain: Int, exponent: Int, first: int, count: int) -> list[Int]:
    """Of a family of `count` harmonics from `first` on."""
    found: list[Int] = []
    for k in range(design.power // 2):
        order = 2 * k + (first > 0)
        harmonics = range(first, first + count)
        exponents = np.stack([_exponent(exponent, order, h) for h in harmonics])
        largest = exponents[1 if order and not first else 0 :].max(axis=0)
        below = np.clip(largest - exponents, 0, 63)
        vector = np.stack([_weight(gain, order, h) for h in harmonics]) >> below
        rest = _reflected(found, block(vector)[0])[k:]
        found.append(mirror_of(block(rest)[0]))
    return found


def white(design: WeakDesignQ31, kind: int, theta: Scaled, error_variance: Scaled) -> White:
    """At theta of the kind [thetas, lanes]."""
    gain, exponent = spectrum(design, kind, theta, error_variance)
    cosines = design.highest + 1
    mirrors = (
        _mirrors(design, gain, exponent, 0, cosines),
        _mirrors(design, gain, exponent, 1, design.parts - cosines),
    )
    return White(design, gain, exponent, mirrors)


def column(made: White, kind: int, place: int, window: Int) -> tuple[Int, Int]:
    """A column [K + n, lanes] in standard deviations with its exponent [lanes], before it is reflected.

    window: S_h [lanes, channels, H + 1, 2].
    """
    design = made.design
    own = design.model.kind[kind]
    terms = [t for t in range(own.first, own.end) if design.model.term[t].column == place and design.factor[t][0]]
    lanes = window.shape[0]
    found: list[
        tuple[int, int, Int, Int, npt.NDArray[np.bool_]]
    ] = []  # term, harmonic, bits that its sums are lifted, exponent, in use
    for t in terms:
        term = design.model.term[t]
        length = bit_length(np.bitwise_or.reduce(np.abs(window[:, term.channel]), axis=-1))
        for h in range(1 if term.order else 0, made.cosines):
            lift = np.maximum(_SUM_BITS - length[:, h], 0)
            exponent = design.factor[t][1] - lift + _exponent(made.exponent, term.order, h)
            found.append((t, h, lift, np.where(length[:, h] > 0, exponent, _NONE), length[:, h] > 0))
    top = np.max([np.full(lanes, _NONE), *(one[3] for one in found)], axis=0)
    total = np.zeros((design.parts, lanes), np.int64)
    for t, h, lift, exponent, used in found:
        term = design.model.term[t]
        negative = (term.order % 4 >= 2, (term.order + 1) % 4 >= 2)
        below = top - exponent
        whole = (_weight(made.gain, term.order, h) * design.factor[t][0]) >> 30
        weight = np.where(used & (below < _SUM_BITS), whole >> np.clip(below, 0, 63), 0)
        for part in range(2 if h and made.cosines + h <= design.parts else 1):
            s = window[:, term.channel, h, (part + term.order) % 2] << lift
            place_of = h if part == 0 else made.cosines + h - 1
            total[place_of] += (s * (-weight if negative[part] else weight)) >> _PRODUCT_DOWN
    x, shift = block(total)
    return x, np.where(top > _NONE, top + 30 + _PRODUCT_DOWN, 0) + shift


def square(x: Int) -> Int:
    """sum x^2 2^-16 of columns [rows, lanes]."""
    return np.asarray(np.add.reduce((x * x) >> _SQUARE_DOWN, axis=0))


@dataclass(frozen=True)
class Columns:
    """White columns of a kind: theta's, Y. A value is x 2^exponent.

    Attributes
    ----------
    x : [columns, K, lanes]; of these rows the first `live` are left out
    exponent : [columns, lanes]
    live : nuisances that were projected out [lanes]
    """

    x: Int
    exponent: Int
    live: Int


def columns(made: White, kind: int, window: Int) -> Columns:
    """Of windows' sums [lanes, channels, H + 1, 2], without what the test functions and the nuisances leave out."""
    own = made.design.model.kind[kind]
    plain = [column(made, kind, place, window) for place in range(own.columns)]
    x = np.stack([made.rows(one) for one, _ in plain])
    whole = [square(one) for one in x]
    live = np.zeros(window.shape[0], np.int64)
    for place in range(own.thetas + 1, own.columns):
        for begin in np.unique(live).tolist():  # lanes may differ in what is left
            at = np.flatnonzero(live == begin)
            rest = x[place][begin:, at]
            left = square(rest)
            kept = (left > 0) & (left > (whole[place][at] >> _KEPT_BITS))
            mirror = mirror_of(block(rest)[0]) if len(rest) else rest
            for other in [*range(own.thetas + 1), *range(place + 1, own.columns)]:
                before = x[other][begin:, at]
                x[other][begin:, at] = np.where(kept, mirrored(mirror, before), before)
            live[at] = begin + kept
    used = own.thetas + 1
    return Columns(x[:used], np.stack([e for _, e in plain[:used]]), live)
