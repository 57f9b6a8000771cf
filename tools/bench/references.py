"""What the weak form is measured against: offline output error and an extended Kalman filter, in float64.

Both take the linear model phi'' = G q, q'' = -d1 G q - d2 G phi with G = w + u (theory.md 5), the measured angle
sample by sample, and u from the measured pivot through the weak form's own second derivative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from pvid.base.errors import PvidError
from pvid.design.fir import savitzky_golay

Float = npt.NDArray[np.float64]

_TAPS, _DEGREE = 71, 6

# From the weak form's answer 20 evaluations do; what wanders longer is lost.
_EVALUATIONS = 200


def smoothed_drive(y: npt.ArrayLike, sample_rate: float, l1: float) -> tuple[Float, slice]:
    """u = y''/l1 [1/s^2] at every sample that has a whole window around it, and which samples these are."""
    bank = savitzky_golay(_TAPS, _DEGREE)
    u = bank.apply(y, sample_rate)[2] / l1
    return u, slice(bank.delay, bank.delay + len(u))


# ---- output error


def transitions(p: Float, u: Float, dt: float) -> Float:
    """Matrices [n - 1, 4, 4] that take (phi, phi', q, q') from sample to sample: one RK4 step each.

    u [n]; between the samples it is a cubic through the nearest four.
    """
    w, d1, d2 = p
    padded = np.concatenate([[2 * u[0] - u[1]], u, [2 * u[-1] - u[-2]]])
    middle = (9 * (padded[1:-2] + padded[2:-1]) - padded[:-3] - padded[3:]) / 16

    def rate(drive: Float) -> Float:
        a = np.zeros((len(drive), 4, 4))
        g = w + drive
        a[:, 0, 1] = a[:, 2, 3] = 1
        a[:, 1, 2], a[:, 3, 0], a[:, 3, 2] = g, -d2 * g, -d1 * g
        return a

    one = np.eye(4)
    first, half, last = rate(u[:-1]), rate(middle), rate(u[1:])
    k2 = half @ (one + dt / 2 * first)
    k3 = half @ (one + dt / 2 * k2)
    k4 = last @ (one + dt * k3)
    return np.asarray(one + dt / 6 * (first + 2 * k2 + 2 * k3 + k4))


def free_responses(p: Float, u: Float, dt: float) -> Float:
    """phi [n, 4] from each of the four unit initial states.

    The products of all transitions up to each sample, in two levels so that numpy runs long loops: within
    blocks for all blocks at once, then from block to block.
    """
    n = len(u)
    block = max(1, round(np.sqrt(n)))
    blocks = -(-n // block)
    steps = np.broadcast_to(np.eye(4), (blocks * block, 4, 4)).copy()
    steps[1:n] = transitions(p, u, dt)
    steps = steps.reshape(blocks, block, 4, 4)
    for k in range(1, block):
        steps[:, k] = steps[:, k] @ steps[:, k - 1]
    state = np.eye(4)
    out = np.empty((blocks, block, 4))
    for k in range(blocks):
        out[k] = (steps[k] @ state)[:, 0]
        state = steps[k, -1] @ state
    return out.reshape(-1, 4)[:n]


def output_error(
    phi: npt.ArrayLike,
    y: npt.ArrayLike,
    sample_rate: float,
    start: npt.ArrayLike,
    l1: float,
    zero_unknown: bool = True,
) -> tuple[Float, Float]:
    """Least-squares fit of the simulated angle to the whole measured run.

    The initial states, and the encoder's zero, enter linearly: for each p they are solved for (variable
    projection), so that scipy searches over ln w, ln d1, ln d2 only.

    Returns
    -------
    p = (w, d1, d2) and its standard errors for white noise.

    Raises
    ------
    PvidError
        When a sample is not finite or the search does not converge.
    """
    if not (np.isfinite(phi).all() and np.isfinite(y).all()):
        raise PvidError("output error takes finite samples only")
    u, where = smoothed_drive(y, sample_rate, l1)
    measured = np.asarray(phi, np.float64)[where]
    dt = 1 / sample_rate

    def residual(logarithm: Float) -> Float:
        with np.errstate(all="ignore"):
            basis = free_responses(np.exp(logarithm), u, dt)
        if not np.isfinite(basis).all():
            return np.full(len(measured), 1e3)
        basis = basis / np.abs(basis).max(axis=0)
        if zero_unknown:
            basis = np.column_stack([basis, np.ones(len(basis))])
        orthonormal, _ = np.linalg.qr(basis)
        return np.asarray(measured - orthonormal @ (orthonormal.T @ measured))

    fit = least_squares(
        residual,
        np.log(np.asarray(start, np.float64)),
        method="lm",
        diff_step=1e-6,
        xtol=1e-10,
        ftol=1e-12,
        max_nfev=_EVALUATIONS,
    )
    if not fit.success:
        raise PvidError(f"output error did not converge: {fit.message}")
    p = np.exp(fit.x)
    variance = 2 * fit.cost / (len(measured) - 7 - zero_unknown)
    return p, p * np.sqrt(variance * np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))


# ---- extended Kalman filter


@dataclass(frozen=True)
class KalmanSettings:
    """Tuning of the filter.

    Attributes
    ----------
    angle_sd : of a sample's noise [rad]
    start_sd : of the start, relative
    rate_noise : variance that a sample adds to phi' [rad^2/s^2]; to q', over w^2
    wander : variance that a sample adds to w, d1, d2, relative; 0: constants
    """

    angle_sd: float
    start_sd: float
    rate_noise: float = 1e-9
    wander: float = 0.0


def kalman(u: Float, phi: Float, dt: float, start: Float, settings: KalmanSettings) -> tuple[Float, Float]:
    """Extended Kalman filter on (phi, phi', q, q', w, d1, d2) in several lanes.

    Parameters
    ----------
    u, phi
        [n, lanes], of samples dt [s] apart.
    start
        p = (w, d1, d2) of each lane, [lanes, 3].

    Returns
    -------
    p and its standard errors at the end, [lanes, 3]. A lane that diverges ends as NaN.
    """
    ticks, lanes = phi.shape
    x = np.zeros((lanes, 7))
    x[:, 0], x[:, 4:] = phi[0], start
    covariance = np.zeros((lanes, 7, 7))
    # a release within about 0.2 rad: rates of a rad/s, q = phi''/w of the size of phi
    sd = np.concatenate([np.tile([settings.angle_sd, 1.0, 0.2, 1.0], (lanes, 1)), settings.start_sd * start], axis=1)
    places = np.arange(7)
    covariance[:, places, places] = sd**2
    a = np.zeros((lanes, 7, 7))
    a[:, 0, 1] = a[:, 2, 3] = 1
    one = np.eye(7)
    with np.errstate(all="ignore"):
        for tick in range(ticks):
            gain = covariance[:, :, 0] / (covariance[:, 0, 0] + settings.angle_sd**2)[:, None]
            x = x + gain * (phi[tick] - x[:, 0])[:, None]
            covariance = covariance - gain[:, :, None] * covariance[:, None, 0, :]
            if tick == ticks - 1:
                break
            w, d1, d2 = x[:, 4], x[:, 5], x[:, 6]
            g = w + (u[tick] + u[tick + 1]) / 2
            angle, q = x[:, 0], x[:, 2]
            a[:, 1, 2], a[:, 3, 0], a[:, 3, 2] = g, -d2 * g, -d1 * g
            state, term = x[:, :4].copy(), x[:, :4].copy()
            for order in range(1, 4):
                term = (a[:, :4, :4] @ term[:, :, None])[:, :, 0] * (dt / order)
                state = state + term
            a[:, 1, 4], a[:, 3, 4] = q, -d1 * q - d2 * angle
            a[:, 3, 5], a[:, 3, 6] = -g * q, -g * angle
            f = one + dt * a + (dt**2 / 2) * (a @ a)
            x = np.concatenate([state, x[:, 4:]], axis=1)
            covariance = f @ covariance @ f.transpose(0, 2, 1)
            covariance[:, 1, 1] += settings.rate_noise
            covariance[:, 3, 3] += settings.rate_noise / w**2
            covariance[:, [4, 5, 6], [4, 5, 6]] += settings.wander * x[:, 4:] ** 2
            covariance = (covariance + covariance.transpose(0, 2, 1)) / 2
    return x[:, 4:], np.sqrt(covariance[:, [4, 5, 6], [4, 5, 6]])
