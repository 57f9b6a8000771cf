"""Twin of weak/error_f32.c: variance of an equation's own error, from the residuals as the run goes on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.twin.record import Mask

Float32 = npt.NDArray[np.float32]

_F = np.float32
_FEWEST, _MOST = 4, 16
_RISES, _FALLS = _F(10), _F(0.25)
_FAR_BELOW, _FAR_ABOVE = _F(0.2), _F(5)
_VARIANCE_MAX = _F(1e30)


class OwnError:
    """Of the rows of a kind, in several lanes.

    Parameters
    ----------
    least : the design's variance

    Attributes
    ----------
    variance : in use [lanes]
    """

    def __init__(self, least: np.float32, lanes: int) -> None:
        self.least = least
        self.variance = np.full(lanes, least, np.float32)
        self._mean = np.zeros(lanes, np.float32)
        self._windows = np.zeros(lanes, np.int64)

    def take(self, arrived: Mask, residual: Float32, share: Float32) -> Float32:
        """What is left of the information in older rows behind a window, in the lanes that had arrived [lanes]."""
        with np.errstate(all="ignore"):
            anew = (residual < _FAR_BELOW * self._mean) | (residual > _FAR_ABOVE * self._mean)
            windows = np.where(anew, 0, self._windows)
            mean = self._mean + _F(2) / (windows.astype(np.float32) + _F(2)) * (residual - self._mean)
            self._mean = np.where(arrived, mean, self._mean)
            windows = np.where(arrived, np.minimum(windows + 1, _MOST), self._windows)
            found = self.variance + (self._mean - _F(1)) / share
            known = arrived & (windows >= _FEWEST) & (found <= _VARIANCE_MAX)
            rises = known & (self._mean > _RISES)
            changes = rises | (known & (self._mean < _FALLS) & (self.variance > self.least))
            self.variance = np.where(changes, np.where(found > self.least, found, self.least), self.variance)
            self._windows = np.where(changes, 0, windows)
            return np.where(rises, _F(1) / self._mean, _F(1)).astype(np.float32, copy=False)
