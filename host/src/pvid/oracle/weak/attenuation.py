"""Noise inside the motion shrinks an estimate: the same rows with the highest derivative as the dependent signal.

A force that no equation has (cogging, friction that is not Coulomb's) moves the mechanism. Regression of the known
input on the motion takes that motion for an answer to the input and finds too small an inertia. Regression of the
highest derivative on the rest (Frisch's other line) errs to the other side. Where the two are apart by more than the
standard errors, these do not cover the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.solve import Fit, solved

_STEPS = 40
_SETTLED = 1e-8  # a step below this ends the search
_STEP_LIMIT = 0.3  # of log p, or of p over its reach


@dataclass(frozen=True)
class _Kind:
    """A row kind as residuals X a(p) with a = (-theta, 1) / theta_dependent.

    Attributes
    ----------
    products : X^T X of the columns, theta's and Y, weighted by the kind's residuals [thetas + 1, thetas + 1]
    dependent : place of the column with the highest derivative; None: the rows stay as they are
    """

    products: Float
    dependent: int | None


def other_line(fit: Fit) -> Float | None:
    """p [n_p] with the highest derivative as the dependent signal; None where that is no other question.

    Only rows with an error of their own are turned round: where the sensors explain the residuals, their noise has its
    place in the weights.
    """
    theta = fit.parameters.theta(fit.p)
    kinds = [_kind(fit, kind, th) for kind, th in enumerate(theta)]
    if all(one.dependent is None for one in kinds):
        return None
    p = fit.p
    prior = np.diag(fit.parameters.prior(fit.start))
    reach = fit.parameters.reach()
    for _ in range(_STEPS):
        s, f = prior.copy(), np.zeros(len(p))
        for one, th, c in zip(kinds, fit.parameters.theta(p), fit.parameters.jacobian(p), strict=True):
            a, slope = _combination(th, c, one.dependent)
            s += slope.T @ one.products @ slope
            f -= slope.T @ one.products @ a
        if not (np.isfinite(s).all() and np.isfinite(f).all()):
            return None
        step = solved(s, f, fit.parameters.tangent(p))
        size = float(np.max(np.abs(step) / reach))
        p = fit.parameters.moved(p, step * min(1.0, _STEP_LIMIT / max(size, 1e-300)))
        if size < _SETTLED:
            return p
    return p


def _combination(theta: Float, jacobian: Float, dependent: int | None) -> tuple[Float, Float]:
    """a(p) [thetas + 1] and d a / d step [thetas + 1, n_p]."""
    a = np.append(-theta, 1.0)
    slope = np.vstack([-jacobian, np.zeros(jacobian.shape[1])])
    if dependent is None:
        return a, slope
    scale = theta[dependent]
    a = a / scale
    return a, slope / scale - np.outer(a, jacobian[dependent] / scale)


def _kind(fit: Fit, kind: int, theta: Float) -> _Kind:
    white = fit.alone(kind)
    columns = np.concatenate([white.regressors, white.known[:, np.newaxis, :]], axis=1)
    flat = columns.transpose(1, 0, 2).reshape(columns.shape[1], -1)
    products = flat @ flat.T
    dependent = _dependent(fit, kind, products, theta)
    if dependent is not None:
        products = products * theta[dependent] ** 2
    return _Kind(products, dependent)


def _dependent(fit: Fit, kind: int, products: Float, theta: Float) -> int | None:
    """The column with the highest derivative, of several the one that counts most; None: Y is it, or nothing is Y."""
    row = fit.rows.compiled.model.rows[kind]
    if not fit.errors[kind].variance or products[-1, -1] == 0.0:
        return None
    orders = [max(part, default=0) for part in row.regressors]
    top = max(orders, default=0)
    if top == 0 or max(row.known, default=0) >= top:
        return None
    weight = [theta[j] ** 2 * products[j, j] if order == top else -1.0 for j, order in enumerate(orders)]
    return int(np.argmax(weight))
