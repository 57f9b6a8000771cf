"""Standard errors of a fit: what the sensors predict, and what the scatter from window to window shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import EquationError
from pvid.oracle.weak.solve import RIDGE, Fit, inverse


@dataclass(frozen=True)
class Uncertainty:
    """How well p is known.

    Attributes
    ----------
    se : published: the larger of the two below [n_p]
    predicted : from the sensors' noise and the equations' errors, neighbours' overlap counted [n_p]
    clustered : from the scatter of the windows' scores, neighbours counted [n_p]
    chi2 : mean square of the residuals over what the sensors alone explain
    weighted_chi2 : over sensors and equations' errors together
    covariance : of p, that of `predicted` [n_p, n_p]
    r2 : of each row kind, part of Y (of the largest column where Y is 0) that the row explains
    """

    se: Float
    predicted: Float
    clustered: Float
    chi2: float
    weighted_chi2: float
    covariance: Float
    r2: list[float]

    @classmethod
    def unbounded(cls, fit: Fit) -> Uncertainty:
        """Of an estimate that ran away."""
        none = np.full(len(fit.p), np.inf)
        return cls(none, none, none, np.inf, np.inf, np.diag(none), [0.0] * fit.rows.kinds)


def uncertainty(fit: Fit) -> Uncertainty:
    """Of an estimate, in units of p."""
    designs, residuals = fit.designs(), fit.residuals()
    unit = fit.parameters.unit(fit.p)
    information, neighbours = moments_of(fit, designs)
    s_inverse = inverse(information, fit.tangent)
    covariance = covariance_of(information, neighbours, fit.tangent)
    drifted = fit.rows.compiled.bare.drifted
    more = np.zeros_like(covariance) if drifted is None else drifted.excess_of(fit.parameters.names)
    free = sum(one.free for one in fit.white) - fit.parameters.free(fit.p)
    weighted = sum(float(np.sum(e**2)) for e in residuals) / max(free, 1)
    predicted = unit * np.sqrt(np.diag(covariance) * max(1.0, weighted))
    scores = sum((np.einsum("wkp,wk->wp", d, e) for d, e in zip(designs, residuals, strict=True)))
    clustered = unit * np.sqrt(clustered_variance(np.asarray(scores), s_inverse))
    predicted, clustered = (np.sqrt(one**2 + np.maximum(np.diag(more), 0)) for one in (predicted, clustered))
    return Uncertainty(
        np.maximum(predicted, clustered),
        predicted,
        clustered,
        chi2_of_sensors(fit),
        weighted,
        covariance * np.outer(unit, unit) + more,
        explained(fit),
    )


def covariance_of(information: Float, neighbours: Float, tangent: Float | None = None) -> Float:
    """Covariance of p from that of the scores of windows and their next ones [n_p, n_p].

    Where the run says nothing of a combination of parameters, as when the input is a law of the output, the information
    is singular, and the products would leave rounding of either sign in place of a variance. There it is that of
    independent windows: the inverse of the information, as large as its ridge allows.

    Parameters
    ----------
    tangent : of constraints; None: there are none
    """
    if tangent is not None:
        own = covariance_of(tangent.T @ information @ tangent, tangent.T @ neighbours @ tangent)
        return np.asarray(tangent @ own @ tangent.T)
    s_inverse = inverse(information)
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    if np.linalg.eigvalsh(information * np.outer(scale, scale))[0] <= RIDGE:
        return s_inverse
    return np.asarray(s_inverse @ (information + neighbours + neighbours.T) @ s_inverse)


def moments_of(fit: Fit, designs: list[Float]) -> tuple[Float, Float]:
    """Information, and covariance of the scores of windows and their next ones, which share samples [n_p, n_p].

    Parameters
    ----------
    designs : of `fit`
    """
    information = np.diag(fit.parameters.prior(fit.start))
    for d in designs:
        own = flat(d.transpose(0, 2, 1))
        information = information + own @ own.T
    neighbours = np.zeros_like(information)
    theta = fit.parameters.theta(fit.p)
    adjacent = np.flatnonzero(np.diff(fit.rows.numbers) == 1)
    for d, white in zip(designs, fit.white, strict=True):
        back = white.whitener.back(d.transpose(0, 2, 1))
        r1 = fit.rows.with_next(white.kinds, theta, fit.errors)
        neighbours += flat(back[adjacent] @ r1) @ flat(back[adjacent + 1]).T
        entries, windows = fit.rows.doubts(white.kinds)
        directions = fit.rows.reversals.directions(white.kinds, theta)
        in_doubt = np.einsum("er,enr->en", directions[entries], back[windows])
        neighbours += fit.rows.reversals.shared(entries, in_doubt)
    return information, neighbours


def inflation(fit: Fit) -> float:
    """Largest factor by which the variance of a parameter exceeds that of independent windows, in a long run."""
    information, neighbours = moments_of(fit, fit.designs())
    windows = fit.rows.windows
    shared = neighbours * windows / max(windows - 1, 1)  # every window has a next one
    s_inverse = inverse(information, fit.tangent)
    factors = np.diag(s_inverse @ (shared + shared.T) @ s_inverse) / np.maximum(np.diag(s_inverse), 1e-300)
    return 1.0 + max(0.0, float(np.max(factors)))


def flat(x: Float) -> Float:
    """[windows, n, R] as [n, windows R]."""
    return x.transpose(1, 0, 2).reshape(x.shape[1], -1)


def clustered_variance(scores: Float, s_inverse: Float) -> Float:
    """Variances [n_p] of a step from the windows' scores [windows, n_p].

    The larger of two: neighbours, which share samples, counted in full; and more distant ones with falling weights, for
    errors that last longer than a window.
    """
    windows = len(scores)
    moves = scores @ s_inverse  # of p by each window: sums of their squares are positive whatever the rounding
    local = np.sum(moves**2, axis=0)
    near, wide = local, local
    reach = max(1, round(1.3 * windows ** (1 / 3)))
    for lag in range(1, min(reach, windows - 1) + 1):
        both = 2 * np.sum(moves[:-lag] * moves[lag:], axis=0)
        if lag == 1:
            near = near + both
        wide = wide + (1 - lag / (reach + 1)) * both
    few = windows / max(windows - 1, 1)
    return np.asarray(few * np.max([local, near, wide], axis=0))


def chi2_of_sensors(fit: Fit) -> float:
    """Mean square of the residuals in the metric of the sensors' noise alone."""
    theta = fit.parameters.theta(fit.p)
    total, free = 0.0, -fit.parameters.free(fit.p)
    for white in fit.white:
        exact = not any(fit.errors[kind].variance for kind in white.kinds)
        plain = white if exact else fit.rows.white(white.kinds, theta, [EquationError()] * fit.rows.kinds)
        total += float(np.sum(plain.residuals(theta) ** 2))
        free += plain.free
    return total / max(free, 1)


def explained(fit: Fit) -> list[float]:
    """R^2 of each row kind, in rows whitened by themselves."""
    out = []
    theta = fit.parameters.theta(fit.p)
    for kind, th in enumerate(theta):
        white = fit.alone(kind)
        reference = float(np.sum(white.known**2))
        if not fit.rows.compiled.bare.rows[kind].known:  # nothing is known but corners
            reference = max(float(np.sum((white.regressors[:, j] * th[j]) ** 2)) for j in range(len(th)))
        out.append(1 - float(np.sum(white.residuals(theta) ** 2)) / max(reference, 1e-300))
    return out
