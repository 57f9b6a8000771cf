"""Output error of any model: the simulation that fits the whole recorded run best (scipy), for comparison."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from bench.replay import Replay
from pvid.base.errors import PvidError

Float = npt.NDArray[np.float64]

_LOST = 1e6  # standard deviations: in place of a motion that is no number
_SETTLED = 1e-10  # of the sum of squares


@dataclass(frozen=True)
class OutputError:
    """A fit.

    Attributes
    ----------
    p : [n_p]
    converged : the search ended before its limit of evaluations
    evaluations : of the residuals, those for the derivatives counted
    """

    p: Float
    converged: bool
    evaluations: int


def output_error(replay: Replay, p: Float, most: int = 100, known: tuple[str, ...] = ()) -> OutputError:
    """Least squares from p and the replay's own start; the start of the motion is free, but for `known` states.

    Positive unknowns are searched in their logarithms.

    Parameters
    ----------
    most : steps of the search
    known : states that start where the replay has them, such as a charge that is counted from the start
    """
    model = replay.model
    positive = np.array([one.positive for one in model.unknowns])
    reach = np.array([one.sd for one in model.unknowns])
    sd = {one.name: one.sd for one in model.signals}
    begun = replay.start()
    free = [k for k, one in enumerate(replay.plant.motion.states) if str(one) not in known]
    spans = np.maximum(np.abs(begun[free]), 1e-3)
    count = 0

    def parameters(x: Float) -> Float:
        step = x[: len(p)]
        return np.where(positive, p * np.exp(np.clip(step, -20, 20)), p + step * reach)

    def residuals(x: Float) -> Float:
        nonlocal count
        count += 1
        try:
            start = begun.copy()
            start[free] += x[len(p) :] * spans
            simulated = replay.simulated(parameters(x), start)
        except PvidError:  # a singular mass matrix on the way
            return np.full(len(replay.run) * len(replay.measured), _LOST)
        errors = [(replay.run.signals[name] - simulated[name]) / sd[name] for name in replay.measured]
        return np.clip(np.nan_to_num(np.concatenate(errors), nan=_LOST), -_LOST, _LOST)

    found = least_squares(
        residuals, np.zeros(len(p) + len(free)), x_scale="jac", max_nfev=most, ftol=_SETTLED, xtol=_SETTLED, gtol=None
    )
    return OutputError(parameters(found.x), bool(found.status > 0), count)
