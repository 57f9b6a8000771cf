"""An estimate with its standard errors, and whether every parameter of it means something."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.oracle.weak.errors import Uncertainty, uncertainty
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.solve import Fit
from pvid.oracle.weak.verdict import is_known
from pvid.oracle.weak.zero import Bool, near_zero, on_own_scale

ALMOST_0 = 0.01  # standard errors: what replaces 0 and less, as a core and an output of the model may divide by it


@dataclass(frozen=True)
class Assessed:
    """Attributes
    ----------
    fit, found : the estimate and its standard errors
    small, se : which positive parameters may be 0, and standard errors on the scale of those, see `near_zero` [n_p]
    known : every parameter has a value that means something, within the range of the model, or may be 0
    """

    fit: Fit
    found: Uncertainty
    small: Bool
    se: Float
    known: bool

    @classmethod
    def of(cls, fit: Fit) -> Assessed:
        """Raises one of FAILURES where its numbers run away."""
        found = uncertainty(fit)
        small, se = attempted(lambda: near_zero(fit, found.se)) or (np.zeros(len(fit.p), np.bool_), found.se)
        known = attempted(lambda: is_known(fit.rows.compiled.bare, fit, small, se)) or False
        return cls(fit, found, small, se, known)

    @property
    def is_found(self) -> bool:
        """Whether the search came to rest at plausible parameters."""
        return self.fit.settled and self.known


def assessed(fit: Fit) -> Assessed:
    """Without bounds where its numbers run away."""
    none = Uncertainty.unbounded(fit)
    return attempted(lambda: Assessed.of(fit)) or Assessed(fit, none, np.zeros(len(fit.p), np.bool_), none.se, False)


def estimated_near_zero(before: Assessed, equation_error: bool, compensate: bool) -> Assessed:
    """The estimate with those parameters on their own scale that may be 0; the same one where there are none, or where
    that leads nowhere."""
    fit, small = before.fit, before.small
    if fit.diverged or not small.any():
        return before
    other = attempted(lambda: gated(on_own_scale(fit, small).rows, fit.p, equation_error, compensate))
    if other is None or not other.settled:
        return before
    moved = attempted(lambda: _without_negative(other, small))
    return before if moved is None else assessed(moved)


def _without_negative(fit: Fit, which: Bool) -> Fit:
    """The estimate with negative ones of those parameters at 0, and the others where they are likeliest then."""
    found = uncertainty(fit)
    negative = which & (fit.p < ALMOST_0 * found.se)
    if not negative.any():
        return fit
    places = np.flatnonzero(negative)
    gain = found.covariance[:, places] @ np.linalg.inv(found.covariance[np.ix_(places, places)])
    step = gain @ (ALMOST_0 * found.se[places] - fit.p[places])
    return fit.at(fit.parameters.moved(fit.p, np.where(fit.parameters.positive, step / fit.p, step)))
