"""Twin of weak/window_f32.c: the sums of every whole window of a stretch, all windows at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.f32 import WeakTables

Float32 = npt.NDArray[np.float32]

TERMS = 13
_CHI2 = slice(0, 8)
_CHI0 = slice(8, 12)
_CHI4 = slice(12, 13)
_TERM_TABLE = ((_CHI2, 1), (_CHI0, 0), (_CHI4, 2))  # terms, and which table of chi multiplies them


def window_count(decimated: int, hop: int) -> int:
    """Complete windows in `decimated` samples."""
    return max(0, (decimated - 1) // hop - 1)


def curvature_squares(phi: Float32, lag: int) -> tuple[Float32, Float32]:
    """At each decimated sample of a stretch: the square of the second difference that ends there, and 1, or 0 and 0."""
    squares, due = np.zeros(len(phi), np.float32), np.zeros(len(phi), np.float32)
    with np.errstate(all="ignore"):
        for i in range(2 * lag, len(phi), lag):
            curvature = (phi[i] - phi[i - lag]) - (phi[i - lag] - phi[i - 2 * lag])
            squares[i], due[i] = curvature * curvature, 1
    return squares, due


@dataclass(frozen=True)
class Observed:
    """Statistics of every window of one stretch, over all but its last sample [windows].

    drive : variance of u [1/s^4]
    mean, lowest, highest : of phi [rad]
    curvature : mean square of the second differences of phi [rad^2]
    """

    drive: Float32
    mean: Float32
    lowest: Float32
    highest: Float32
    curvature: Float32


def observe(phi: Float32, u: Float32, design: WeakTables) -> Observed:
    """Statistics of each window."""
    hop = (design.window - 1) // 2
    starts = hop * np.arange(window_count(len(u), hop))
    zero = np.zeros(len(starts), np.float32)
    u_sum, u_squares, phi_sum, curvature_sum, curvatures = zero, zero, zero, zero, zero
    squares, due = curvature_squares(phi, design.lag)
    lowest, highest = phi[starts], phi[starts]
    n = np.float32(design.window - 1)
    with np.errstate(all="ignore"):
        for index in range(design.window - 1):
            at = starts + index
            u_sum = u_sum + u[at]
            u_squares = u_squares + u[at] * u[at]
            phi_sum = phi_sum + phi[at]
            lowest = np.where(phi[at] < lowest, phi[at], lowest)
            highest = np.where(phi[at] > highest, phi[at], highest)
            curvature_sum = curvature_sum + squares[at]
            curvatures = curvatures + due[at]
        mean = u_sum / n
        curvature = np.where(curvatures > 0, curvature_sum / curvatures, zero)
        return Observed(u_squares / n - mean * mean, phi_sum / n, lowest, highest, curvature)


@dataclass(frozen=True)
class Window:
    """A complete window: sums [K, 13], samples phi [rad] and u [1/s^2] [W], whether it is driven, whether the
    identifier is frozen, and its statistics from `observe`."""

    sums: Float32
    phi: Float32
    u: Float32
    driven: bool
    frozen: bool
    mean: np.float32
    lowest: np.float32
    highest: np.float32
    curvature: np.float32


def _terms(index: int, samples: int, dt: np.float32, phi: Float32, u: Float32, twice: Float32) -> Float32:
    """The 13 terms [13, windows] at a sample; twice [3, windows] are the double integrals of u phi, phi, u."""
    f = np.float32
    now = np.stack([u * phi, phi, u])
    correction = (dt * dt) / f(6)
    integral = twice - correction * now
    steps = f(index)
    i2_one = (dt * dt) * ((f(0.5) * (steps * steps)) - (f(1) / f(6)))
    t = dt * (steps - (f(0.5) * f(samples - 1)))
    uf = -now[0]
    on_chi2 = [uf, -phi, -(u * integral[0]), -(u * integral[1]), u * integral[2], u * i2_one, u, u * t]
    return np.stack([*on_chi2, uf, -phi, u, np.ones_like(u), phi])


def sums(phi: Float32, u: Float32, design: WeakTables, dt: np.float32) -> Float32:
    """Sums of all windows of one stretch of decimated samples.

    Returns
    -------
    float32 [windows, functions, 13], window m from sample m (window - 1) / 2 on.
    """
    hop = (design.window - 1) // 2
    count = window_count(len(phi), hop)
    total = np.zeros((count, design.functions, TERMS), np.float32)
    if count == 0:
        return total
    starts = hop * np.arange(count)
    chi = np.asarray(design.chi, np.float32)
    half_dt = np.float32(0.5) * dt
    with np.errstate(all="ignore"):
        before = np.stack([u[starts] * phi[starts], phi[starts], u[starts]])
        once = np.zeros_like(before)
        twice = np.zeros_like(before)
        for index in range(1, design.window - 1):
            phi_now, u_now = phi[starts + index], u[starts + index]
            now = np.stack([u_now * phi_now, phi_now, u_now])
            next_once = once + (before + now) * half_dt
            twice = twice + (once + next_once) * half_dt
            once, before = next_once, now
            term = _terms(index, design.window, dt, phi_now, u_now, twice).T[:, None, :]
            for places, order in _TERM_TABLE:
                weight = chi[index, order][None, :, None]
                total[:, :, places] = total[:, :, places] + weight * term[:, :, places]
    return total
