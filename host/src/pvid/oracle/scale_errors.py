"""What wrong scales, of the pivot's sensor and of l1, add to the standard errors: no residual shows them.

With y read (1 + g) times too large, u and with it G = w + u is (1 + g) times too large. q = phi''/G is then 1/(1 + g)
of what it was, and q'' = -d1 phi'' - d2 G phi holds as before with

    w (1 + g),    d1 / (1 + g),    d2 / (1 + g)^2

in both forms: every run is explained as well as with the true parameters. u = y''/l1, so an l1 that is (1 + e) times
too long does the same as g = -e, and besides stretches the lengths that are counted in it: g* = w l1 stays, l2 and
rho2 do not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.oracle import strong as oracle

Float = npt.NDArray[np.float64]

# d log p / d log scale of (w, d1, d2)
_Y_GAIN = np.array([1.0, -1.0, -2.0])
_L1 = -_Y_GAIN


@dataclass(frozen=True)
class ScaleErrors:
    """Standard errors that the scales make, by parameter: p those of (w, d1, d2), physical those of (g, l2, rho2),
    both [..., 3] and of either sign, the sensitivity times the scale's standard deviation; NaN outside the physical
    region."""

    y_gain_p: Float
    y_gain_physical: Float
    l1_p: Float
    l1_physical: Float


def scale_errors(p: npt.ArrayLike, l1: float, y_gain_sd: float, l1_sd: float) -> ScaleErrors:
    """At p = (w, d1, d2) [..., 3] and l1 [m]; y_gain_sd, l1_sd: standard deviations of the scales, relative."""
    at = np.asarray(p, np.float64)
    gradient = oracle.physical_gradient(at, l1)
    physical = oracle.physical(at, l1)

    def through(s: Float) -> Float:
        return np.asarray(np.einsum("...ij,...j->...i", gradient, s))

    gain, rod = at * _Y_GAIN, at * _L1
    with np.errstate(invalid="ignore"):
        return ScaleErrors(
            y_gain_p=y_gain_sd * gain,
            y_gain_physical=y_gain_sd * (through(gain) + 0.0 * physical),
            l1_p=l1_sd * rod,
            l1_physical=l1_sd * (through(rod) + physical),
        )


def added_covariance(p: npt.ArrayLike, y_gain_sd: float, l1_sd: float) -> Float:
    """What both scales add to the covariance of p = (w, d1, d2): [..., 3, 3]."""
    s = np.asarray(p, np.float64) * _Y_GAIN
    return np.asarray((y_gain_sd**2 + l1_sd**2) * s[..., :, None] * s[..., None, :])
