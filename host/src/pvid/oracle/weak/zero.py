"""Positive unknowns that may be 0: a friction that is not there, a superfluous term.

Their logarithm is searched, and 0 is at minus infinity: the search runs away, and the standard error of the logarithm
means nothing. Their own scale has an estimate, of either sign, and a standard error. Where that standard error is small
beside the guess, the unknown is near 0; the others are estimated together with it, and the estimate is moved to 0 along
their covariance where it is negative.
"""

from __future__ import annotations

import copy
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from pvid.oracle.weak.errors import covariance_of, moments_of, without_motion
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import UNKNOWN
from pvid.oracle.weak.rows import Compiled, WeakRows
from pvid.oracle.weak.solve import Fit

Bool = npt.NDArray[np.bool_]

# Its own scale is that of its guess: a standard error beyond this part of the guess determines nothing.
_OF_GUESS = 0.5

_CERTAINTY = 0.95


def on_their_own_scale(compiled: Compiled, which: Bool) -> Compiled:
    """The model with some of the positive unknowns searched on their own scale in place of their logarithm's."""
    if not which.any():
        return compiled
    out = copy.copy(compiled)
    out.parameters = compiled.parameters.on_their_own_scale(which)
    return out


def near_zero(fit: Fit, se: Float) -> tuple[Bool, Float]:
    """Which positive parameters may be 0 [n_p], and standard errors of all on the scale of those [n_p].

    Parameters
    ----------
    se : of the fit
    """
    parameters = fit.parameters
    # What is without a limit in se is so in its logarithm: all that are beyond the limit are looked at together.
    doubtful = parameters.positive & (parameters.low <= 0) & ~(se <= UNKNOWN * np.abs(fit.p))
    none = np.zeros(len(fit.p), np.bool_)
    if not doubtful.any():
        return none, se
    own = on_own_scale(fit, doubtful)
    designs = own.designs()
    information, neighbours = moments_of(own, designs)
    covariance = covariance_of(information, neighbours, own.tangent)
    variance = own.parameters.unit(own.p) ** 2 * np.diag(covariance) + np.diag(without_motion(own, designs))
    own_se = np.sqrt(variance)
    small = doubtful & (own_se <= _OF_GUESS * parameters.guess) & (fit.p * UNKNOWN <= own_se)
    return small, np.where(small, own_se, se)


def upper_bound(value: float, se: float) -> float:
    """Below which a parameter is with 95 %, of those that are not negative."""
    normal = NormalDist()
    from_0 = normal.cdf(max(value, 0.0) / se)
    return max(value, 0.0) + se * normal.inv_cdf(1 - (1 - _CERTAINTY) * from_0)


def on_own_scale(fit: Fit, which: Bool) -> Fit:
    """The same estimate of the model with these parameters on their own scale."""
    rows: WeakRows = copy.copy(fit.rows)
    rows.compiled = on_their_own_scale(fit.rows.compiled, which)
    return Fit(fit.p, rows, fit.white, fit.errors, fit.start, fit.settled)
