"""Errors in variables: what the encoder's noise adds to M and B of the weak form, and the form without it.

The rows hold the noise of the angle not only in Y but in N1..N5 too. On average M is too large by the noise's second
moment, and B with it: the estimate is biased, the more the noisier the angle is against its motion. The rows are
linear in the window's samples of phi, with kernels that the test functions and u give, so that the moment is known:

    E (Y, N)_i (Y, N)_j - its value without noise = variance sum over the window of kernel_i kernel_j

`CompensatedOracle` takes it off, window by window. It shows what the bias is worth; the C core does without
(`pvid bench noise`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pvid.design.weak import WeakDesign
from pvid.oracle.strong import Estimate
from pvid.oracle.weak import A, B, WeakOracle, integrated_twice, without_directions

Float = npt.NDArray[np.float64]

# Columns that hold phi: Y and N1..N5; c's own, N6..N8, are made of u alone.
_NOISY = 6


def kernels(u: Float, design: WeakDesign) -> Float:
    """Weights of a window's samples of phi in its columns Y, N1..N5, for u [W]: [6, W, K]."""
    chi, chi2, chi4 = design.chi[:, 0], design.chi[:, 1], design.chi[:, 2]
    responses = integrated_twice(np.eye(design.window), design.dt)  # row j: I2 of a unit at sample j
    adjoint = responses @ (u[:, None] * chi2)  # of phi -> int chi'' u I2(phi)
    drive = u[:, None]
    return np.stack([chi4, -drive * chi2, -chi2, -drive * adjoint, -adjoint - drive * chi, -chi])


def noise_moments(u: Float, window_columns: Float, inverse_factor: Float, design: WeakDesign) -> Float:
    """What noise of unit variance on every decimated sample adds to the second moments of a window's rows.

    Parameters
    ----------
    u
        [W], of the window.
    window_columns
        [11, K], of which a and b are used: they are projected out of the rows.
    inverse_factor
        L^-1 of the whitening [K, K].

    Returns
    -------
    Of Y, N1..N5, summed over the window's rows, [6, 6].
    """
    projection = without_directions(np.eye(design.functions), window_columns[[A, B]] @ inverse_factor.T)
    seen = kernels(u, design) @ inverse_factor.T @ projection
    flat = seen.reshape(_NOISY, -1)
    return np.asarray(flat @ flat.T)


@dataclass
class CompensatedOracle(WeakOracle):
    """The estimator with the noise's share taken off M and B.

    row_sd of the settings must be the noise of a decimated sample [rad], which is white where the rows listen. While
    what remains of S is no information (not positive definite) p stays and its uncertainty is the start's.
    """

    _moments: Float | None = field(default=None, repr=False)

    def rows(self, window_columns: Float, phi: Float, u: Float) -> tuple[Float, Float]:
        """The rows as they are; what the noise adds to their moments is kept for `add`."""
        x, inverse_factor = super().rows(window_columns, phi, u)
        self._moments = noise_moments(u, window_columns, inverse_factor, self.design)
        return x, inverse_factor

    def add(self, x: Float, inverse_factor: Float) -> None:
        """Sums of a window's rows, less the noise's share. rr keeps it: it is what the noise is known by."""
        super().add(x, inverse_factor)
        assert self._moments is not None  # rows makes them before every add
        share = self.settings.row_sd**2 * self._moments
        n = slice(0, _NOISY - 1)
        self.m[n, n] -= share[1:, 1:]
        self.b[n] -= share[1:, 0] - share[1:, 1:] @ self.theta()[n]

    def assess(self) -> Estimate:
        """As ever, or the start's uncertainty while what remains of S is no information."""
        if not self._informed():
            return Estimate(self.p.copy(), self.sd.copy(), np.diag(self.sd**2), 0.0, 0.0)
        return super().assess()

    def sandwich(self) -> Float:
        """As ever, or the start's uncertainty while what remains of S is no information."""
        return super().sandwich() if self._informed() else self.sd.copy()

    def _step(self) -> bool:
        return self._informed() and super()._step()

    def _informed(self) -> bool:
        """Whether S is positive definite."""
        s = self.information()
        diagonal = np.diag(s)
        return bool((diagonal > 0).all()) and bool(np.linalg.eigvalsh(s / np.sqrt(np.outer(diagonal, diagonal)))[0] > 0)
