"""Twin of weak/scores_q31.c: standard errors from the scatter of the windows' scores, in integers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.twin.q31.estimator import EstimatorQ31, length
from pvid.twin.q31.integer import Int, clamp, root_of, round_shift, scale, times_q31, upper_product
from pvid.twin.q31.scaled import Scaled

_DIGITS, _FIRST_DIGITS = 13, 10
_LEAST_SQUARE = 2**18
_SCORE_MAX, _MEAN_MAX = 2**13, 2**27
_Z_DOWN, _WINDOWS_BITS = 15, 8
_WINDOWS_MAX, _MOST = 0xFFFF, 2**31 - 1
_FAR_BELOW = 20
_STATE = ("windows", "known", "unit", "before", "residual", "same", "neighbour")


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
        self.residual = np.zeros(lanes, np.int64)
        self.same = np.zeros((n_p, n_p, lanes), np.int64)  # upper triangles
        self.neighbour = np.zeros((n_p, n_p, lanes), np.int64)

    def skip(self) -> None:
        """A window without a score."""
        self.known = np.zeros_like(self.known)

    def add(self, estimator: EstimatorQ31, variance_ratio: Int) -> None:
        """Adds the score of the last solve, if it was due, to the means; a lane without rows has none.

        variance_ratio : residual variance of the window's rows before its steps over its expectation, Q24 [lanes]
        """
        none = variance_ratio == 0
        if estimator.was_due:
            kept = {name: getattr(self, name).copy() for name in _STATE}
            self._add(estimator, variance_ratio)
            for name, value in kept.items():
                setattr(self, name, np.where(none, value, getattr(self, name)))
        self.known = self.known & ~none

    def _add(self, estimator: EstimatorQ31, variance_ratio: Int) -> None:
        residual = clamp(round_shift(variance_ratio, 12), _MOST)
        anew = residual * _FAR_BELOW < self.residual
        for name in _STATE:
            setattr(self, name, np.where(anew, 0, getattr(self, name)))
        fading = (2**31 - estimator.retention) // estimator.block * estimator.divider
        newest = (2**32 - 1) // (self.windows + 2)
        weight = np.maximum(newest, np.minimum(fading, _MOST))
        self.residual = self.residual + times_q31(residual - self.residual, weight)
        own = np.stack([self._own(a, Scaled(*(x[a] for x in estimator.score))) for a in range(len(self.unit))])
        for a, b in zip(*np.triu_indices(len(own)), strict=True):
            both = own[a] * self.before[b] + self.before[a] * own[b]
            known = _mean_with(self.neighbour[a, b], both, weight)
            self.same[a, b] = _mean_with(self.same[a, b], own[a] * own[b], weight)
            self.neighbour[a, b] = np.where(self.known, known, self.neighbour[a, b])
        self.before = own
        self.known = np.ones_like(self.known, np.bool_)
        self.windows = np.minimum(self.windows + 1, _WINDOWS_MAX)

    def _own(self, a: int, score: Scaled) -> Int:
        """The score of p[a] in its unit, which is made to fit it [lanes]."""
        highest = length(score.m) + score.e
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
        windows = np.minimum((candidate["weight"].astype(np.int64) << _WINDOWS_BITS) // rows, _MOST)
        n_p = len(self.unit)
        exponent = inverse.e + self.unit
        largest = exponent.max(axis=0)
        down = _Z_DOWN + np.minimum(largest - exponent, 31 - _Z_DOWN)
        for a in range(n_p):
            correlation = candidate["correlation"][:, a, :n_p].T.astype(np.int64)
            z = upper_product(correlation, inverse.r) >> down
            same, neighbour = np.zeros((2, len(windows)), np.int64)
            for b, c in zip(*np.triu_indices(n_p), strict=True):
                both = (1 if b == c else 2) * (z[b] * z[c])
                same = same + upper_product(both, self.same[b, c])
                neighbour = neighbour + upper_product(both, self.neighbour[b, c])
            total = np.maximum(same + np.maximum(neighbour, 0), 0)
            of_square = 2 * (largest + _Z_DOWN + 2) + 32 - 4 * estimator.exponent - _WINDOWS_BITS
            own = inverse.error(a, *root_of(total * windows, of_square))
            se = candidate["se"][:, a]
            candidate["se"][:, a] = np.where(inverse.ok & (total > 0), np.maximum(se, own), se)


def _mean_with(mean: Int, x: Int, weight: Int) -> Int:
    """A mean with a new value, rounded; weight in Q31."""
    return mean + ((upper_product(4 * (x - mean), weight) + 1) >> 1)
