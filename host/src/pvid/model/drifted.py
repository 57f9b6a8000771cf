"""How the parameters of a model drifted during a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drifted:
    """A course of p, and what it adds to the errors of its end.

    Attributes
    ----------
    names : of p
    t : its begin, the middle of each window, and its end [m], in s of the recording
    p : there, from the whole recording [m, n_p]
    ends, so_far : p at the end of each window that was used [m - 2], from those up to it [m - 2, n_p]
    se : standard errors of p by noise, at the ends also by the lag of a drift that goes on [m, n_p]
    change_se : of the change from begin to end [n_p]
    excess : covariance of the last p, beyond that of parameters that stay [n_p, n_p]
    memory_s : the likeliest time constant of what the rows tell along the drift [s]
    """

    names: tuple[str, ...]
    t: Float
    p: Float
    ends: Float
    so_far: Float
    se: Float
    change_se: Float
    excess: Float
    memory_s: float

    def at(self, t: Float) -> Float:
        """p at other times [.., n_p]: linear between nodes, as at the nearest one beyond them."""
        return _between(t, self.t, self.p)

    def told_at(self, t: Float) -> Float:
        """p from the windows up to other times [.., n_p]."""
        return _between(t, self.ends, self.so_far)

    def excess_of(self, names: Sequence[str]) -> Float:
        """`excess` of these parameters, 0 of those that are no others [n, n]."""
        pick = np.array([[one == name for one in self.names] for name in names], np.float64)
        return np.asarray(pick @ self.excess @ pick.T)


def _between(t: Float, nodes: Float, p: Float) -> Float:
    return np.stack([np.interp(t, nodes, one) for one in p.T], axis=-1)
