"""Whitening of the rows of many windows whose covariances differ by a few directions each.

R_w = R + U_w U_w^T with one R of the run and the directions U_w of the reversals in window w. With R = L L^T and
V = L^-1 U the rows y = L^-1 x have the covariance I + V V^T, and

    x -> (I - V B V^T) L^-1 x,   (I - V B V^T)^2 = (I + V V^T)^-1

whitens them: one factorisation of the run, and matrices of the size of the number of reversals for each window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.oracle.fourier.functions import Float


@dataclass(frozen=True)
class Whitener:
    """L_w^-1 of every window; R is the number of rows, r of directions.

    Attributes
    ----------
    base : L^-1 [R, R]
    v : L^-1 U_w [windows, R, r]
    small : B [windows, r, r]
    shrink : (I + V^T V)^-1 [windows, r, r]
    """

    base: Float
    v: Float
    small: Float
    shrink: Float

    @classmethod
    def of_covariance(cls, covariance: Float, directions: Float) -> Whitener:
        """From R [R, R] and the directions of each window [windows, r, R], zeros where there are fewer."""
        base = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), np.float64)
        v = base @ directions.transpose(0, 2, 1)
        s2, e = np.linalg.eigh(v.transpose(0, 2, 1) @ v)
        s2 = np.maximum(s2, 0.0)
        root = np.sqrt(1 + s2)
        # (1 - 1/sqrt(1 + s^2))/s^2, without the difference of near numbers
        b = 1 / (root * (1 + root))
        small = (e * b[:, np.newaxis, :]) @ e.transpose(0, 2, 1)
        shrink = (e * (1 / (1 + s2))[:, np.newaxis, :]) @ e.transpose(0, 2, 1)
        return cls(base, v, small, shrink)

    def only(self, windows: slice) -> Whitener:
        """Of some of the windows."""
        return Whitener(self.base, self.v[windows], self.small[windows], self.shrink[windows])

    def of(self, x: Float, rows: slice = slice(None)) -> Float:
        """L_w^-1 x_w for each of several columns x [windows, columns, R]; those that fill some rows only are short."""
        return self._turned(x @ self.base[:, rows].T)

    def back(self, y: Float) -> Float:
        """L_w^-T y_w of [windows, columns, R]."""
        return np.asarray(self._turned(y) @ self.base)

    def _turned(self, y: Float) -> Float:
        if not self.v.shape[2]:
            return np.asarray(y)
        return np.asarray(y - ((y @ self.v) @ self.small) @ self.v.transpose(0, 2, 1))

    def total_inverse(self) -> Float:
        """Sum over the windows of R_w^-1 [R, R]."""
        inner = len(self.v) * np.eye(len(self.base))
        inner = inner - np.einsum("war,wrs,wbs->ab", self.v, self.shrink, self.v, optimize=True)
        return np.asarray(self.base.T @ inner @ self.base)

    def inverse_of_directions(self) -> Float:
        """R_w^-1 U_w as rows [windows, r, R]."""
        return np.asarray(self.shrink @ self.v.transpose(0, 2, 1) @ self.base)

    def trace(self, q: Float) -> float:
        """Sum over the windows of tr(R_w^-1 Q)."""
        return float(np.sum(self.total_inverse() * q))

    def energy(self, q: Float, e: Float) -> float:
        """Sum over the windows of e^T L_w^-1 Q L_w^-T e, e whitened [windows, R]."""
        f = self.back(e[:, np.newaxis, :])[:, 0]
        return float(np.einsum("wk,kl,wl->", f, q, f, optimize=True))
