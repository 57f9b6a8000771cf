"""Twin of weak/scores_f32.c: standard errors from the scatter of the windows' scores."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.twin.f32.pattern import PatternModel

Float32 = npt.NDArray[np.float32]

_F = np.float32
_WINDOWS_MAX = 0xFFFF
_FAR_BELOW = _F(0.05)


class Scores:
    """Mean products of the windows' scores s, of a window with itself and with the one before, in several lanes.

    Parameters
    ----------
    n_p : parameters
    memory : windows in the estimator's memory [lanes]; 0: all
    """

    def __init__(self, n_p: int, memory: Float32) -> None:
        with np.errstate(all="ignore"):
            self.least = np.where(memory > 0, _F(1) / memory, _F(0)).astype(np.float32, copy=False)
        self.own = np.zeros((n_p, len(memory)), np.float32)
        self.begin_anew()

    def begin_anew(self) -> None:
        """No windows yet."""
        n_p, lanes = self.own.shape
        self.windows = np.zeros(lanes, np.int64)
        self.known = np.zeros(lanes, np.bool_)
        self.residual = np.zeros(lanes, np.float32)
        self.before = np.zeros((n_p, lanes), np.float32)
        self.same = np.zeros((n_p, n_p, lanes), np.float32)
        self.neighbour = np.zeros((n_p, n_p, lanes), np.float32)

    def skip(self) -> None:
        """A window without a score."""
        self.known = np.zeros_like(self.known)

    def take(self, model: PatternModel, p: Float32, total: Float32) -> None:
        """The score of a window from sum N e + g [n_theta, lanes] at the present p."""
        with np.errstate(all="ignore"):
            self.own = model.transpose_times(model.jacobian(p), total)

    def add(self, residual: Float32) -> None:
        """Adds it to the means; residual: mean square of the window's rows before its steps of p [lanes]."""
        own, before = self.own, self.before
        with np.errstate(all="ignore"):
            anew = residual < _FAR_BELOW * self.residual
            self.windows = np.where(anew, 0, self.windows)
            self.neighbour = np.where(anew, _F(0), self.neighbour)
            known = self.known & ~anew
            newest = _F(2) / (self.windows.astype(np.float32) + _F(2))
            weight = np.where(newest > self.least, newest, self.least).astype(np.float32, copy=False)
            self.residual = self.residual + weight * (residual - self.residual)
            a, b = np.triu_indices(len(own))
            self.same[a, b] = self.same[a, b] + weight * (own[a] * own[b] - self.same[a, b])
            both = own[a] * before[b] + before[a] * own[b]
            moved = self.neighbour[a, b] + weight * (both - self.neighbour[a, b])
            self.neighbour[a, b] = np.where(known, moved, self.neighbour[a, b])
        self.before = own.copy()
        self.known = np.ones_like(self.known)
        self.windows = np.minimum(self.windows + 1, _WINDOWS_MAX)

    def variance(self, a: int, covariance: Float32, wide: Float32, windows: Float32) -> Float32:
        """Variance of p[a] from the scatter [lanes], given the covariance of an assessment [n_p, n_p, lanes]."""
        n_p = len(self.own)
        same = np.zeros(len(wide), np.float32)
        neighbour = same
        for b in range(n_p):
            of_b = covariance[a, b] / wide
            for c in range(b, n_p):
                both = _F(1 if b == c else 2) * (of_b * (covariance[a, c] / wide))
                same = same + both * self.same[b, c]
                neighbour = neighbour + both * self.neighbour[b, c]
        return windows * np.where(neighbour > 0, same + neighbour, same)
