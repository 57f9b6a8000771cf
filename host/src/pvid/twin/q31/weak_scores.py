"""Twin of weak/scores_q31.c: standard errors from the scatter of the windows' scores, in integers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.twin.q31.estimator import EstimatorQ31, length
from pvid.twin.q31.integer import Int, clamp, integers, root_of, scale, times_q31, upper_product
from pvid.twin.q31.scaled import Scaled, pick, scaled

_DIGITS, _FIRST_DIGITS = 14, 11
_LEAST_SQUARE = 2**20
_SCORE_MAX, _MEAN_MAX = 2**14, 2**29
_WINDOWS_MAX = 0xFFFF
_FAR_BELOW = Scaled(integers(858993459), integers(-34))  # 0.05


class Scores:
    """Mean products of the windows' scores, of a window with itself and with the one before, in several lanes.

    Attributes
    ----------
    alone : the next window has no neighbour before it
    """

    def __init__(self, n_p: int, lanes: int) -> None:
        self.alone = False
        self._shape = (n_p, lanes)
        self.begin_anew()

    def begin_anew(self) -> None:
        """No windows yet."""
        n_p, lanes = self._shape
        self.windows = np.zeros(lanes, np.int64)
        self.known = np.zeros(lanes, np.bool_)
        self.unit = np.zeros(self._shape, np.int64)
        self.before = np.zeros(self._shape, np.int64)
        self.residual = scaled(np.zeros(lanes, np.int64), 0)
        self.same = np.zeros((n_p, n_p, lanes), np.int64)  # upper triangles
        self.neighbour = np.zeros((n_p, n_p, lanes), np.int64)

    def skip(self) -> None:
        """A window without a score."""
        self.known = np.zeros_like(self.known)

    def add(self, estimator: EstimatorQ31, rss: Int, free: Int) -> None:
        """Adds the score of the last solve to the means; in lanes without rows there is none.

        rss, free : of the window's rows before its steps [lanes]
        """
        if (rss == 0).all():
            self.skip()
            return
        residual = scaled(rss, 0).over(scaled(free, 0))
        self._restart(self.residual.times(_FAR_BELOW).exceeds(residual))
        fading = (2**31 - estimator.retention) * estimator.divider
        newest = (2**32 - 1) // (self.windows + 2)
        weight = np.minimum(np.maximum(newest, fading // estimator.block), 2**31 - 1)
        change = scaled(weight, -31).times(residual.minus(self.residual))
        self.residual = self.residual.plus(change).packed()
        own = np.stack([self._own(a, Scaled(*(x[a] for x in estimator.score))) for a in range(len(self.unit))])
        for a, b in zip(*np.triu_indices(len(own)), strict=True):
            same = own[a] * own[b] - self.same[a, b]
            both = own[a] * self.before[b] + self.before[a] * own[b] - self.neighbour[a, b]
            self.same[a, b] += times_q31(same, weight)
            self.neighbour[a, b] += np.where(self.known, times_q31(both, weight), 0)
        self.before = own
        self.known = np.ones_like(self.known)
        self.windows = np.minimum(self.windows + 1, _WINDOWS_MAX)

    def _restart(self, where: npt.NDArray[np.bool_]) -> None:
        """No windows yet in these lanes."""
        for name in ("windows", "known", "unit", "before", "same", "neighbour"):
            value = getattr(self, name)
            setattr(self, name, np.where(where, np.zeros_like(value), value))
        nothing = Scaled(np.zeros_like(self.residual.m), self.residual.e)
        self.residual = pick(where, nothing, self.residual)

    def _own(self, a: int, score: Scaled) -> Int:
        """The score of p[a] in its unit, which is made to fit it [lanes]."""
        highest = score.e + 30
        up = highest - _DIGITS - self.unit[a]
        square = self.same[a, a]
        some = score.m != 0
        begins = some & (square == 0)
        moves = some & ~begins & ((up > 0) | ((up < 0) & (square < _LEAST_SQUARE)))
        self._change_unit(a, np.where(moves, np.where(up > 0, up, -1), 0))
        self.unit[a] = np.where(begins, highest - _FIRST_DIGITS, self.unit[a])
        return np.where(some, clamp(score.fixed(-self.unit[a]), _SCORE_MAX), 0)

    def _change_unit(self, a: int, up: Int) -> None:
        """The unit of p[a] becomes 2^up times what it was."""
        self.unit[a] += up
        self.before[a] = clamp(scale(self.before[a], up), _SCORE_MAX)
        for means in (self.same, self.neighbour):
            for b, c in zip(*np.triu_indices(len(means)), strict=True):
                shift = (int(b == a) + int(c == a)) * up
                means[b, c] = clamp(scale(means[b, c], shift), _MEAN_MAX)

    def widen(self, candidate: npt.NDArray[np.void], estimator: EstimatorQ31, rows: int) -> None:
        """The larger of the two standard errors of each parameter of estimates [lanes]; rows: of a score."""
        inverse = estimator.inverse
        windows = scaled(candidate["weight"].astype(np.int64), 0).over(scaled(integers(rows), 0))
        n_p = len(self.unit)
        for a in range(n_p):
            correlation = candidate["correlation"][:, a, :n_p].T.astype(np.int64)
            z = upper_product(correlation, inverse.r)
            exponent = inverse.e + self.unit + 2
            largest = np.max(length(z) + exponent, axis=0) - _DIGITS
            z = scale(z, largest - exponent)
            same, neighbour = np.zeros((2, len(estimator.p[0])), np.int64)
            for b, c in zip(*np.triu_indices(n_p), strict=True):
                both = (1 if b == c else 2) * (z[b] * z[c])
                same = same + upper_product(both, self.same[b, c])
                neighbour = neighbour + upper_product(both, self.neighbour[b, c])
            total = np.maximum(np.where(neighbour > 0, same + neighbour, same), 0)
            square = windows.times(scaled(total, 2 * largest + 32 - 4 * estimator.exponent))
            own = inverse.error(a, *root_of(*square))
            se = candidate["se"][:, a]
            candidate["se"][:, a] = np.where(inverse.ok, np.maximum(se, own), se)
