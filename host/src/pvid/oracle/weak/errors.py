"""Standard errors of a fit: what the sensors predict, and what the scatter from window to window shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import EquationError
from pvid.oracle.weak.solve import RIDGE, Fit, inverse, of_fit

_NOISE_SHARE = 0.1  # of the information along a direction, below which its standard error is that of the whole
_CHANCE = 3.0  # standard deviations of that share


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
    more = without_motion(fit, designs)
    if drifted is not None:
        more = more + drifted.excess_of(fit.parameters.names)
    weighted = _chi2(fit, residuals)
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


def _free(fit: Fit) -> int:
    return max(sum(one.free for one in fit.white) - fit.parameters.free(fit.p), 1)


def _chi2(fit: Fit, residuals: list[Float]) -> float:
    return sum(float(np.sum(e**2)) for e in residuals) / _free(fit)


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
    information = np.diag(fit.parameters.prior(fit.start)) + _of_rows(designs)
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


def _of_rows(designs: list[Float]) -> Float:
    """Information of the rows [n_p, n_p]."""
    return np.asarray(sum(own @ own.T for own in (flat(d.transpose(0, 2, 1)) for d in designs)))


def of_noise(fit: Fit) -> Float:
    """The part of the information which the sensors' noise in the regressors makes, E[dN R^-1 dN^T] [n_p, n_p]."""
    jacobian, k = fit.parameters.jacobian(fit.p), fit.rows.functions.count
    out = np.zeros((len(fit.p), len(fit.p)))
    for one in fit.white:
        total = one.whitener.total_inverse()
        for i, a in enumerate(one.kinds):
            for j, b in enumerate(one.kinds):
                of_columns = fit.rows.noise.within(a, b, total[i * k : (i + 1) * k, j * k : (j + 1) * k])
                left, right = jacobian[a], jacobian[b]
                out += left.T @ of_columns[: len(left), : len(right)] @ right
    return out


def _spread_of_noise(fit: Fit, step: Float) -> float:
    """Relative standard deviation of the information that noise makes along a step [n_p]: few rows may have most."""
    jacobian, total, squares = fit.parameters.jacobian(fit.p), 0.0, 0.0
    for one in fit.white:
        thetas = {kind: jacobian[kind] @ step for kind in one.kinds}
        rows = [[fit.rows.noise.covariance(a, thetas[a], b, thetas[b], 0.0) for b in one.kinds] for a in one.kinds]
        own = one.whitener.base @ np.block(rows) @ one.whitener.base.T
        total += fit.rows.windows * float(np.trace(own))
        squares += fit.rows.windows * float(np.sum(own**2))
    return float(np.sqrt(2 * 2 * squares)) / max(total, 1e-300)  # neighbours have half their samples in common


def without_motion(fit: Fit, designs: list[Float]) -> Float:
    """What the covariance of p lacks, because noise in the regressors looks like motion [n_p, n_p], in units of p.

    With v^T S v = 1 and S_n v = lambda S v, S the information of the rows and S_n its part of the noise, the scores,
    which are compensated for noise, move p by 1 / (1 - lambda) of what S^-1 gives along v. Where 1 - lambda is within
    chance, nothing moves along v, and p may be anywhere on that line: its deviation there takes one parameter as far as
    its size. Parts below `_NOISE_SHARE` are left as they are.

    Parameters
    ----------
    designs : of `fit`
    """
    parameters, unit = fit.parameters, fit.parameters.unit(fit.p)
    basis = np.diag(1 / unit) if fit.tangent is None else fit.tangent
    s, by_noise = (basis.T @ one @ basis for one in (_of_rows(designs), of_noise(fit)))
    scale = 1 / np.sqrt(np.maximum(np.diag(s), 1e-300))
    root = np.linalg.cholesky(s * np.outer(scale, scale) + RIDGE * np.eye(len(s)))
    half = np.linalg.solve(root, np.linalg.solve(root, by_noise * np.outer(scale, scale)).T)
    share, turned = np.linalg.eigh((half + half.T) / 2)
    if share[-1] < _NOISE_SHARE:
        return np.zeros((len(unit), len(unit)))
    better = _chi2(fit, fit.residuals()) * (1 + _CHANCE * np.sqrt(2 / _free(fit)))  # sensors than declared
    share *= min(1.0, better)
    there = share >= _NOISE_SHARE
    steps = (basis * scale) @ np.linalg.solve(root.T, turned[:, there])
    v, rest = unit[:, np.newaxis] * steps, 1 - share[there]
    size = np.maximum(np.abs(fit.p), np.where(parameters.positive, parameters.guess, parameters.sd))
    reach = np.min(size[:, np.newaxis] / np.maximum(np.abs(v), 1e-300), axis=0)
    by_chance = [_CHANCE * _spread_of_noise(fit, step) for step in steps.T]
    grown = np.where(rest < by_chance, np.maximum(reach, 1.0), 1 / np.maximum(rest, 1e-300))
    return np.asarray((v * (grown**2 - 1)) @ v.T)


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


@of_fit
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
