"""The mathematics in float64, as in theory.md 2 to 4; read both together.

Neither fast nor bit-exact: the reference for twin and C core.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError

Float = npt.NDArray[np.float64]
Law = Literal["stationary", "pseudovelocity"]

N_THETA = 11
N_P = 3

# The core keeps the binomial coefficients in theta, not in N (kapitza.h): the N of theory.md = BINOMIAL * the core's.
BINOMIAL = np.array([1, 1, 1, 3, 3, 1, 1, 4, 6, 4, 1], np.float64)


# ---- section 2: the strong form


def theta(p: npt.ArrayLike) -> Float:
    """theta = f(p), shape [11]."""
    w, d1, d2 = np.asarray(p, np.float64)
    return np.array([w, w**2, d1, d1 * w, d1 * w**2, d1 * w**3, d2, d2 * w, d2 * w**2, d2 * w**3, d2 * w**4])


def jacobian(p: npt.ArrayLike) -> Float:
    """C = d theta / d p, shape [11, 3]: 18 non-zero entries."""
    w, d1, d2 = np.asarray(p, np.float64)
    c = np.zeros((N_THETA, N_P))
    c[:, 0] = [1, 2 * w, 0, d1, 2 * d1 * w, 3 * d1 * w**2, 0, d2, 2 * d2 * w, 3 * d2 * w**2, 4 * d2 * w**3]
    c[2:6, 1] = [1, w, w**2, w**3]
    c[6:11, 2] = [1, w, w**2, w**3, w**4]
    return c


def strong_rows(phi: npt.ArrayLike, u: npt.ArrayLike) -> tuple[Float, Float]:
    """N [n, 11] and Y [n] from phi [n, 5] (orders 0 to 4) and u [n, 3] (u, u', u'')."""
    phi0, _, phi2, phi3, phi4 = np.asarray(phi, np.float64).T
    u0, u1, u2 = np.asarray(u, np.float64).T
    y = u0**2 * phi4 - 2 * u0 * u1 * phi3 + (2 * u1**2 - u0 * u2) * phi2
    n = np.stack(
        [
            -2 * u0 * phi4 + 2 * u1 * phi3 + u2 * phi2,
            -phi4,
            -(u0**3) * phi2,
            -3 * u0**2 * phi2,
            -3 * u0 * phi2,
            -phi2,
            -(u0**4) * phi0,
            -4 * u0**3 * phi0,
            -6 * u0**2 * phi0,
            -4 * u0 * phi0,
            -phi0,
        ],
        axis=1,
    )
    return n, y


def driven(u: npt.ArrayLike, rate: float, threshold: float) -> npt.NDArray[np.bool_]:
    """Where the rms of u [n] over about a second (first-order lag) reaches `threshold` [1/s^2]."""
    mean_square, mask = 0.0, []
    for value in np.asarray(u, np.float64):
        mean_square += min(1.0, 1 / rate) * (value**2 - mean_square)
        mask.append(mean_square >= threshold**2)
    return np.array(mask, np.bool_)


# ---- section 4: the identifier


def _solve(s: Float, rhs: Float) -> Float:
    """S^-1 rhs after diagonal equilibration (S is badly scaled, not badly conditioned)."""
    d = 1 / np.sqrt(np.diag(s))
    return np.asarray(d * np.linalg.solve(s * np.outer(d, d), d * rhs))


def kappa_of(s: Float) -> float:
    """1 - S_wd S_dd^-1 S_dw / S_ww: the part of w's information that d1, d2 cannot imitate; 0 if S is singular."""
    with np.errstate(all="ignore"):
        d = 1 / np.sqrt(np.diag(s))
        scaled = s * np.outer(d, d)
        try:
            value = float(1 - scaled[0, 1:] @ np.linalg.solve(scaled[1:, 1:], scaled[1:, 0]))
        except np.linalg.LinAlgError:
            return 0.0
        return value if math.isfinite(value) else 0.0


@dataclass(frozen=True)
class Estimate:
    """p, its standard errors and covariance, kappa and the residual's standard deviation."""

    p: Float
    se: Float
    covariance: Float
    kappa: float
    residual_sd: float


def assess(
    p: Float,
    m: Float,
    b: Float,
    yy: float,
    weight: float,
    start_sd: npt.ArrayLike,
    correlation: float = 1.0,
) -> Estimate:
    """Standard errors at p from the sums: (S / s^2 + 1 / start_sd^2)^-1, s^2 = correlation * residual / (weight - 3).

    The second term is the prior information of the start; it matters only for few data.
    """
    if not weight > N_P:
        raise PvidError(f"{weight:g} rows are too few for the standard errors of {N_P} parameters")
    c, t = jacobian(p), theta(p)
    s = c.T @ m @ c
    if not s.any():
        sd = np.asarray(start_sd, np.float64)
        return Estimate(p, sd, np.diag(sd**2), 0.0, 0.0)
    variance = max(float(yy - 2 * b @ t + t @ m @ t), 0.0) / (weight - N_P)
    wide = variance * correlation
    information = s + np.diag(wide / np.asarray(start_sd, np.float64) ** 2)
    d = 1 / np.sqrt(np.diag(information))
    covariance = wide * np.linalg.inv(information * np.outer(d, d)) * np.outer(d, d)
    return Estimate(p, np.sqrt(np.diag(covariance)), covariance, kappa_of(s), math.sqrt(variance))


@dataclass(frozen=True)
class Identified:
    """Outcome of identify_strong: p after every tick [n, 3], ticks that moved p [n], and the last Estimate.

    `estimates` holds (tick, Estimate) every `estimate_every` ticks.
    """

    p: Float
    updated: npt.NDArray[np.bool_]
    estimates: list[tuple[int, Estimate]]
    last: Estimate


@dataclass(frozen=True)
class Settings:
    """Settings of the estimator, as in estimator.h; rate in ticks a second."""

    start: Float
    start_sd: Float
    lower: Float
    upper: Float
    row_sd: float
    rate: float
    law: Law = "stationary"
    feedback_hz: float = 0.0
    forgetting_s: float = 0.0
    correlation: float = 1.0
    step_limit: float = 0.3
    kappa_min: float = 1e-5
    divider: int = 1

    @property
    def gain(self) -> float:
        """g: 0 is equation (5) alone, 1 a Gauss-Newton step at every solve."""
        if self.law == "pseudovelocity":
            return 0.0
        return min(1.0, self.feedback_hz * self.divider / self.rate) if self.feedback_hz > 0 else 1.0


def identify_strong(n: Float, y: Float, settings: Settings, estimate_every: int = 0) -> Identified:
    """Steps through rows N [ticks, 11], Y [ticks] by either law.

    Per tick: M, B, yy take the row in; with S = C^T M C + H0 and F = C^T (B - M theta),
    dp = S^-1 (g F + (1 - g) sum C^T N e), shortened to step_limit, within the bounds.
    """
    p = settings.start.astype(np.float64).copy()
    prior = (settings.row_sd / settings.start_sd) ** 2
    keep = math.exp(-1 / (settings.forgetting_s * settings.rate)) if settings.forgetting_s > 0 else 1.0
    gain = settings.gain
    m, b, yy, weight = np.zeros((N_THETA, N_THETA)), np.zeros(N_THETA), 0.0, 0.0
    innovation = np.zeros(N_P)
    trajectory = np.empty((len(y), N_P))
    updated = np.zeros(len(y), np.bool_)
    estimates = []
    for tick, (row, value) in enumerate(zip(n, y, strict=True)):
        c, t = jacobian(p), theta(p)
        m = keep * m + np.outer(row, row)
        b = keep * b + row * value
        yy = keep * yy + value**2
        weight = keep * weight + 1
        innovation += c.T @ row * (value - row @ t)
        if (tick + 1) % settings.divider == 0:
            s = c.T @ m @ c + np.diag(prior)
            rhs = gain * (c.T @ (b - m @ t)) + (1 - gain) * innovation
            innovation = np.zeros(N_P)
            kappa = kappa_of(s)
            if kappa >= settings.kappa_min and (settings.kappa_min == 0 or kappa * s[0, 0] >= 2 * prior[0]):
                dp = _solve(s, rhs)
                size = float(np.max(np.abs(dp / p)))
                p = np.clip(p + dp * min(1.0, settings.step_limit / max(size, 1e-300)), settings.lower, settings.upper)
                updated[tick] = True
        trajectory[tick] = p
        if estimate_every and tick % estimate_every == 0 and weight > N_P + 1:
            estimates.append((tick, assess(p, m, b, yy, weight, settings.start_sd, settings.correlation)))
    if weight <= N_P + 1:
        raise PvidError(f"{len(y)} rows are too few to identify {N_P} parameters")
    last = assess(p, m, b, yy, weight, settings.start_sd, settings.correlation)
    return Identified(trajectory, updated, estimates, last)


def constrained_least_squares(m: Float, b: Float, start: npt.ArrayLike, iterations: int = 200) -> Float:
    """The p that minimises theta^T M theta - 2 B^T theta: Gauss-Newton with step halving, to convergence.

    Raises
    ------
    PvidError
        When it does not converge.
    """
    p = np.asarray(start, np.float64).copy()

    def cost(q: Float) -> float:
        t = theta(q)
        return float(t @ m @ t - 2 * b @ t)

    previous = math.inf
    for _ in range(iterations):
        c = jacobian(p)
        dp = _solve(c.T @ m @ c, c.T @ (b - m @ theta(p)))
        size = float(np.max(np.abs(dp / p)))
        if size < 1e-6 and size > previous / 2:  # no longer shrinking: the rounding of F is reached
            return p
        factor = min(1.0, 0.5 / size) if size > 0 else 1.0
        # Rounding hides the cost of relative steps below sqrt(eps / kappa), 1e-6: ask it well above.
        while size > 1e-4 and factor > 1e-6 and cost(p + factor * dp) > cost(p):
            factor /= 2
        p = p + factor * dp
        previous = size
    raise PvidError("constrained least squares did not converge")
