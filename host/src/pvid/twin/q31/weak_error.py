"""Twin of weak/error_q31.c: variance of an equation's own error, from the residuals as the run goes on, in integers."""

from __future__ import annotations

import numpy as np

from pvid.twin.q31.integer import Int, clamp
from pvid.twin.q31.scaled import Scaled, pick, scaled
from pvid.twin.record import Mask

NOTHING_LOST = 2**31 - 1

_FEWEST, _MOST = 4, 16
_BITS = 8
_ONE = 1 << _BITS
_MEAN_MAX = 1 << 29
_RISES, _FALLS = 10 * _ONE, _ONE // 4
_FAR = 5
_EXPONENT_MAX = 1000


class OwnError:
    """Of the rows of a kind, in several lanes.

    Parameters
    ----------
    least : the design's variance (m, e)

    Attributes
    ----------
    variance : in use [lanes]
    """

    def __init__(self, least: tuple[int, int], lanes: int) -> None:
        self.variance = self._least = Scaled(*(np.full(lanes, x, np.int64) for x in least))
        self._mean = np.zeros(lanes, np.int64)
        self._windows = np.zeros(lanes, np.int64)

    def take(self, arrived: Mask, residual: Scaled) -> Mask:
        """Takes the residuals of a window in the lanes that had arrived; whether the variance is to be changed."""
        own = clamp(residual.fixed(_BITS), _MEAN_MAX)
        anew = (own * _FAR < self._mean) | (own > self._mean * _FAR)
        windows = np.where(anew, 0, self._windows)
        change = 2 * (own - self._mean)
        mean = self._mean + np.sign(change) * (np.abs(change) // (windows + 2))
        self._mean = np.where(arrived, mean, self._mean)
        self._windows = np.where(arrived, np.minimum(windows + 1, _MOST), self._windows)
        return arrived & self._changes()

    def change(self, share: Scaled) -> Int:
        """Changes the variance where it is to be; what is left of the information in older rows, Q31 [lanes]."""
        excess = scaled(self._mean - _ONE, -_BITS)
        positive = share.m > 0
        safe = pick(positive, share, scaled(np.ones_like(share.m), 0))
        found = self.variance.plus(excess.over(safe))
        changes = self._changes() & positive & (found.e <= _EXPONENT_MAX)
        left = np.where(changes & self._rises(), (_ONE << 31) // np.maximum(self._mean, 1), NOTHING_LOST)
        self.variance = pick(changes, pick(found.exceeds(self._least), found, self._least), self.variance)
        self._windows = np.where(changes, 0, self._windows)
        return left

    def _rises(self) -> Mask:
        return (self._windows >= _FEWEST) & (self._mean > _RISES)

    def _changes(self) -> Mask:
        falls = (self._windows >= _FEWEST) & (self._mean < _FALLS) & self.variance.exceeds(self._least)
        return self._rises() | falls
