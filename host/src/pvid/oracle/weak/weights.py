"""What the error of an equation is taken for is a part of the uncertainty.

The residuals of a short run do not tell a white force from one that is white after integration, and the two weigh slow
and fast motion differently. Recorded runs of real rigs moved by up to 4 standard errors between them.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import EquationError
from pvid.oracle.weak.solve import Fit, compensated, gauss_newton, sharpened

# Rows are weighted by the sensors' noise and an error of the equations that is estimated from the residuals, or by the
# sensors' noise alone.
Weights = Literal["residuals", "sensors"]

_PASSES = 10  # of whitening
_STEPS = 10  # of Gauss-Newton between two
_SETTLED = 1e-4  # a step below this ends the search


def as_white_force(fit: Fit) -> Float | None:
    """p [n_p] with the equations' own errors taken for white ones; None where that is what they are taken for."""
    if not any(one.variance and one.order for one in fit.errors):
        return None
    rows, parameters = fit.rows, fit.parameters
    errors = [_of_order_0(fit, one) for one in fit.errors]
    prior = parameters.prior(fit.start)
    p = fit.p
    for _ in range(_PASSES):
        theta = parameters.theta(p)
        errors = [
            sharpened(rows.unexplained(kind, theta), rows.functions, one) if fit.errors[kind].order else one
            for kind, one in enumerate(errors)
        ]
        white = [rows.white(group, theta, errors) for group in rows.groups]
        p, size = gauss_newton(parameters, compensated(rows, white, theta), p, prior, _STEPS)
        if not np.isfinite(p).all():
            raise FloatingPointError("p is not finite")
        if size < _SETTLED:
            break
    return p


def _of_order_0(fit: Fit, error: EquationError) -> EquationError:
    """With the same variance of the rows."""
    if not error.order:
        return error
    power = [float(np.trace(fit.rows.functions.gram(order, order))) for order in (error.order, 0)]
    return EquationError(error.variance * power[0] / power[1], 0)
