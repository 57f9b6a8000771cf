"""The noise in integrals since the start of a run: within a window, and the walk that later windows share."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from pvid.oracle.weak.functions import Float, TestFunctions


class Walks:
    """What a sample of noise adds to the rows of its own window and of later ones.

    In gain(t) I^r[n] a sample at t enters with chi_(-r)(t), chi_0 = chi gain, chi_(-r)(t) = -int_t^T chi_(1 - r): each
    is the derivative of the next. d steps before the window that is sum over a < r of chi_(a - r)(0) (-d dt)^a / a!.

    Parameters
    ----------
    parts : steps of each segment of the run, in each of which an integral begins anew
    """

    def __init__(self, functions: TestFunctions, parts: Sequence[slice]) -> None:
        self._functions = functions
        hop = functions.hop
        self._counts = [(one.stop - one.start) // hop - 1 for one in parts]  # windows
        places = [one.start // hop + np.arange(count) for one, count in zip(parts, self._counts, strict=True)]
        self._halves = np.concatenate(places).astype(np.int64)  # the first of each window
        self._folds: list[int] = []
        self._kernels: list[Float] = []  # chi_(-r) [windows or 1, 2 hop, K]
        self._starts: list[list[Float]] = []  # chi_0(0) .. chi_(-r)(0) [windows or 1, K]

    def __len__(self) -> int:
        return len(self._folds)

    def add(self, fold: int, gain: Float) -> None:
        """An integral in the rows; its number is that of those before it.

        Parameters
        ----------
        gain : at every step [n]
        """
        functions, hop = self._functions, self._functions.hop
        gain = np.nan_to_num(gain)
        constant = not np.any(gain != gain[0])
        windows = np.full((1, 2 * hop), gain[0])
        if not constant:
            halves = functions.halves(gain)
            windows = np.concatenate([halves[self._halves], halves[self._halves + 1]], axis=1)
        kernel = functions.values(0) * windows[:, :, np.newaxis]
        starts = [kernel[:, 0]]
        for _ in range(fold):
            kernel = -functions.dt * np.cumsum(kernel[:, ::-1], axis=1)[:, ::-1]
            starts.append(kernel[:, 0])
        self._folds.append(fold)
        self._kernels.append(kernel)
        self._starts.append(starts)

    def kernel(self, order: int) -> Float:
        """chi^(order), or of a negative order that of the integral of number -1 - order [windows or 1, 2 hop, K]."""
        return self._functions.values(order)[np.newaxis] if order >= 0 else self._kernels[-1 - order]

    def gram(self, first: int, second: int) -> Float:
        """Sum over the samples of a window, mean over the windows [K, K]."""
        return _mean_product(self.kernel(first), self.kernel(second))

    def overlap(self, first: int, second: int) -> Float:
        """The same over the half that two neighbours share."""
        a, b, hop = self.kernel(first), self.kernel(second), self._functions.hop
        a, b = (a if len(a) == 1 else a[:-1])[:, hop:], (b if len(b) == 1 else b[1:])[:, :hop]
        return _mean_product(a, b)

    def before(self, first: int, second: int, windows: int) -> Float:
        """Sum over the samples before a window, mean over the windows [K, K]; `windows`, 0 or 1: times their number."""
        r, s = self._folds[-1 - first], self._folds[-1 - second]
        sums = self._sums_before(r + s - 1, windows)
        out = np.zeros((self._functions.count, self._functions.count))
        for a, b in itertools.product(range(r), range(s)):
            left, right = self._starts[-1 - first][r - a], self._starts[-1 - second][s - b]
            weight = sums[:, a + b, np.newaxis] / (math.factorial(a) * math.factorial(b))
            if len(left) == len(right) == 1:
                out += float(np.sum(weight)) * np.outer(left, right)
            else:
                out += np.broadcast_to(weight * left, (len(sums), left.shape[1])).T @ np.broadcast_to(
                    right, (len(sums), right.shape[1])
                )
        return out

    def _sums_before(self, count: int, windows: int) -> Float:
        """Sums of (-d dt)^a over the steps d from each window's start back, over the number of windows [windows,
        count]."""
        hop, out = self._functions.hop, []
        for own in self._counts:
            steps = -self._functions.dt * np.arange(1, hop * max(own - 1, 0) + 1)
            of_halves = (steps[:, np.newaxis] ** np.arange(count)).reshape(-1, hop, count).sum(axis=1)
            whole = np.concatenate([np.zeros((1, count)), np.cumsum(of_halves, axis=0)])[:own]
            out.append(whole * own**windows / sum(self._counts))
        return np.concatenate(out)


def _mean_product(a: Float, b: Float) -> Float:
    """Mean over the windows of a^T b of kernels [windows or 1, n, K]."""
    if len(a) == 1 or len(b) == 1:
        return np.asarray(np.mean(a, axis=0).T @ np.mean(b, axis=0))
    return np.asarray(np.tensordot(a, b, axes=([0, 1], [0, 1])) / len(a))
