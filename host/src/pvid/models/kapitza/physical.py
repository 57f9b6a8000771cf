"""Physical parameters of the pendulum and p = (w, d1, d2), either way (theory.md 1)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

# Of a rig: d1 - d2 - 1 is (l2 / rho2)^2.
_LEAST_RATIO, _MOST_RATIO = 0.02, 1e4


def linear(g: float, l2: float, rho2: float, l1: float) -> Float:
    """p = (w, d1, d2) of a pendulum: g [m/s^2], l2, rho2, l1 [m]."""
    ratio = (l2 / rho2) ** 2
    return np.array([g / l1, 1 + ratio * (1 + l1 / l2), (l1 / l2) * ratio])


def physical(p: npt.ArrayLike, l1: float) -> Float:
    """(g, l2, rho2) of p = (w, d1, d2), shape [..., 3]; NaN outside the physical region."""
    w, d1, d2 = np.moveaxis(np.asarray(p, np.float64), -1, 0)
    with np.errstate(all="ignore"):
        big_l2 = d1 - d2 - 1
        l2 = l1 * big_l2 / d2
        out = np.stack([w * l1, l2, l2 / np.sqrt(big_l2)], axis=-1)
    out[~((w > 0) & (d2 > 0) & (big_l2 > 0))] = np.nan
    return out


def physical_gradient(p: npt.ArrayLike, l1: float) -> Float:
    """d (g, l2, rho2) / d (w, d1, d2) at p = (w, d1, d2), [..., 3, 3]."""
    _, d1, d2 = np.moveaxis(np.asarray(p, np.float64), -1, 0)
    with np.errstate(all="ignore"):
        big_l2 = d1 - d2 - 1
        root = np.sqrt(big_l2)
        gradient = np.zeros((*d1.shape, 3, 3))
        gradient[..., 0, 0] = l1
        gradient[..., 1, 1] = l1 / d2
        gradient[..., 1, 2] = -l1 * (d2 + big_l2) / d2**2
        gradient[..., 2, 1] = l1 / (2 * root * d2)
        gradient[..., 2, 2] = -l1 / (2 * root * d2) - l1 * root / d2**2
    return gradient


def is_plausible(p: Float) -> bool:
    """Whether p = (w, d1, d2, ..) is that of a pendulum, within what rigs are."""
    return bool(np.isfinite(p).all() and (p[:3] > 0).all() and _LEAST_RATIO < p[1] - p[2] - 1 < _MOST_RATIO)
