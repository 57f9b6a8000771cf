"""Twin of weak/noise_q31.c: shares of the sensors' noise in the rows of a kind, its information and its bias."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pvid.settings.weak_q31 import WeakDesignQ31
from pvid.twin.q31.estimator import EstimatorQ31
from pvid.twin.q31.integer import Int, integers
from pvid.twin.q31.scaled import Scaled, scaled
from pvid.twin.q31.weak_error import OwnError
from pvid.twin.q31.weak_white import White, mirrored

_ONE = 1 << 30
_UNIT = 1 << 26  # of a direction


def number(x: int, like: Int) -> Scaled:
    """The same in all lanes."""
    return scaled(np.full_like(like, x), 0)


def leverages(white: White) -> Int:
    """Sum over the directions that the test functions leave out of their squares, Q30 [K + n, lanes]."""
    found = []
    for mirrors in white.mirrors:
        total = np.zeros_like(mirrors[0])
        for k in range(len(mirrors)):
            u = np.zeros_like(total)
            u[k] = _UNIT
            for j in range(k, -1, -1):
                u[j:] = mirrored(mirrors[j], u[j:])
            total = total + ((u * u) >> 22)
        found.append(total)
    return np.concatenate(found)


def shares(white: White, design: WeakDesignQ31) -> list[Scaled]:
    """Q_j of each power [lanes]."""
    leverage, cosines = leverages(white), white.cosines
    like = white.gain[0]
    found = [number(0, like)] * design.powers
    for h in range(cosines):
        left = _ONE - leverage[h]
        if h and cosines + h <= design.parts:
            left = left + (_ONE - leverage[cosines + h - 1])
        own = Scaled(white.gain[h], white.exponent[h])
        weight = own.times(own).times(scaled(np.maximum(left, 0), -30))
        weight = weight.times(number((1 if h else 2) * design.hop, like))
        for j in range(design.powers):
            found[j] = found[j].plus(weight)
            weight = weight.times(number(h * h, like))
    return found


class Known:
    """pvid_weak_known_q31: of the window in which it was computed last."""

    def __init__(self, estimator: EstimatorQ31) -> None:
        self.estimator = estimator
        zero = number(0, np.zeros(estimator.lanes, np.int64))
        self.sensors = zero
        self.pull: list[Scaled] = [zero] * estimator.model.n_theta

    def begin(self, design: WeakDesignQ31) -> None:
        """Before the first kind of a window."""
        estimator = self.estimator
        zero = number(0, np.zeros(estimator.lanes, np.int64))
        self.sensors = zero
        self.pull = [zero] * estimator.model.n_theta
        n_p = estimator.model.n_p
        estimator.noise_table = {(a, b): zero for a in range(n_p) for b in range(a, n_p)}
        rows = sum(design.functions - kind.nuisances for kind in design.model.kind)
        estimator.noise_rows = rows if design.noise else 0

    def take(
        self,
        white: White,
        design: WeakDesignQ31,
        kind: int,
        first: int,
        theta: Scaled,
        formats: tuple[Sequence[int], int],
        error: OwnError,
    ) -> Int:
        """Adds a kind, whose first theta is number `first`, at theta [thetas, lanes]; a variance of its own error that
        does not fit its rows is changed. Returns what is then left of the information in older rows [lanes]."""
        share = shares(white, design)
        n_bits, y_bits = formats
        thetas = design.model.kind[kind].thetas
        like = theta.m[0]
        c, f = self.estimator.unscaled_jacobian()

        def of(column: int) -> Scaled:
            return Scaled(theta.m[column], theta.e[column]) if column < thetas else number(-1, like)

        for one in design.noise:
            if one.kind != kind:
                continue
            whole = Scaled(*(np.full_like(like, x) for x in one.factor)).times(share[one.power])
            half = whole.shifted(-1)
            for own, other in ((one.a, one.b), (one.b, one.a)):
                if own < thetas:
                    g = half.times(of(other)).shifted(n_bits[first + own] + y_bits)
                    self.pull[first + own] = self.pull[first + own].plus(g)
            if one.a < thetas and one.b < thetas:
                bits = n_bits[first + one.a] + n_bits[first + one.b]
                part = (whole if one.a == one.b else half).shifted(bits)
                self._add(first + one.a, first + one.b, part, c, f)
        of_error = share[design.error_order[kind]].over(number(design.functions, like))
        if design.noise:
            self.sensors = self.sensors.plus(number(1, like).minus(error.variance.times(of_error)))
        return error.change(of_error)

    def _add(self, a: int, b: int, own: Scaled, c: Int, f: Int) -> None:
        model, table = self.estimator.model, self.estimator.noise_table
        columns = model.c_column
        for k in (k for k, row in enumerate(model.c_row) if row == a):
            part = own.times(scaled(c[k], f[columns[k]]))
            for at in (at for at, row in enumerate(model.c_row) if row == b):
                i, j = columns[k], columns[at]
                if a == b and j < i:
                    continue
                twice = int(a != b and i == j)
                x = part.times(scaled(c[at], f[j] + twice))
                place = (min(i, j), max(i, j))
                table[place] = table[place].plus(x).packed()

    def expected(self, row: Scaled, kinds: int) -> Scaled:
        """Variance of a row by the sensors' noise alone, of `row` in all."""
        positive = self.sensors.m > 0
        safe = Scaled(np.where(positive, self.sensors.m, 1 << 29), self.sensors.e)
        own = row.times(safe.over(number(kinds, self.sensors.m)))
        return Scaled(np.where(positive, own.m, row.m), np.where(positive, own.e, row.e))


def is_used(design: WeakDesignQ31, noise_margin: Int, compensation: bool) -> bool:
    """Whether anything needs it."""
    checked = bool((integers(noise_margin) > 0).any())
    return bool(design.noise) and (compensation or checked) or any(m > 0 for m, _ in design.error_variance)
