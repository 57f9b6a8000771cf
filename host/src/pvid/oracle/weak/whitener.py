"""Whitening of the rows of many windows whose covariances differ by a few directions each.

R_w = R + U_w U_w^T with one R of the run and the directions U_w of the reversals in window w. With R = L L^T and
V = L^-1 U the rows y = L^-1 x have the covariance I + V V^T. With I + V^T V = K K^T

    x -> (I - V B^T V^T) L^-1 x,   B = K^-T (I + K)^-1

whitens them (Andrews' square root): one factorisation of the run, and matrices of the size of the number of reversals
for each window. Of a window with more directions than rows, as where a friction sticks, V is replaced by a square
factor of V V^T.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.oracle.weak.functions import Float


@dataclass(frozen=True)
class Whitener:
    """L_w^-1 of every window; R is the number of rows, r of directions.

    Attributes
    ----------
    base : L^-1 [R, R]
    whole : L^-1 U_w [windows, R, r]
    v : the same, or a factor of as many directions as there are rows where r is larger [windows, R, min(r, R)]
    small : B [windows, r', r'], r' = min(r, R)
    shrink : (I + V^T V)^-1 [windows, r', r']
    """

    base: Float
    whole: Float
    v: Float
    small: Float
    shrink: Float

    @classmethod
    def of_covariance(cls, covariance: Float, directions: Float) -> Whitener:
        """From R [R, R] and the directions of each window [windows, r, R], zeros where there are fewer."""
        base = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), np.float64)
        v = whole = base @ directions.transpose(0, 2, 1)
        if not v.shape[2]:
            nothing = np.zeros((len(v), 0, 0))
            return cls(base, v, v, nothing, nothing)
        if v.shape[2] > v.shape[1]:
            v = np.asarray(np.linalg.qr(v.transpose(0, 2, 1), mode="r")).transpose(0, 2, 1)
        one = np.eye(v.shape[2])
        k = np.linalg.cholesky(one + v.transpose(0, 2, 1) @ v)
        back = np.linalg.inv(k)
        small = back.transpose(0, 2, 1) @ np.linalg.inv(one + k)
        return cls(base, whole, v, small, back.transpose(0, 2, 1) @ back)

    def only(self, windows: slice) -> Whitener:
        """Of some of the windows."""
        return Whitener(self.base, self.whole[windows], self.v[windows], self.small[windows], self.shrink[windows])

    def of(self, x: Float, rows: slice = slice(None)) -> Float:
        """L_w^-1 x_w for each of several columns x [windows, columns, R]; those that fill some rows only are short."""
        return self._turned(x @ self.base[:, rows].T, self.small)

    def back(self, y: Float) -> Float:
        """L_w^-T y_w of [windows, columns, R]."""
        return np.asarray(self._turned(y, self.small.transpose(0, 2, 1)) @ self.base)

    def _turned(self, y: Float, small: Float) -> Float:
        if not self.v.shape[2]:
            return np.asarray(y)
        return np.asarray(y - ((y @ self.v) @ small) @ self.v.transpose(0, 2, 1))

    def total_inverse(self) -> Float:
        """Sum over the windows of R_w^-1 [R, R]."""
        rows = len(self.base)
        flat = self.v.transpose(1, 0, 2).reshape(rows, -1)
        shrunk = (self.shrink @ self.v.transpose(0, 2, 1)).reshape(-1, rows)
        return np.asarray(self.base.T @ (len(self.v) * np.eye(rows) - flat @ shrunk) @ self.base)

    def inverse_of_directions(self) -> Float:
        """R_w^-1 U_w as rows [windows, r, R]."""
        back = self.v.transpose(0, 2, 1)
        if self.whole.shape == self.v.shape:
            return np.asarray(self.shrink @ back @ self.base)
        inside = self.whole - self.v @ (self.shrink @ (back @ self.whole))
        return np.asarray(inside.transpose(0, 2, 1) @ self.base)

    def log_determinant(self) -> float:
        """Sum over the windows of log det R_w."""
        of_base = -2 * float(np.sum(np.log(np.abs(np.diag(self.base)))))
        return len(self.v) * of_base - float(np.sum(np.linalg.slogdet(self.shrink)[1]))

    def trace(self, q: Float) -> float:
        """Sum over the windows of tr(R_w^-1 Q)."""
        return float(np.sum(self.total_inverse() * q))

    def energy(self, q: Float, e: Float) -> float:
        """Sum over the windows of e^T L_w^-1 Q L_w^-T e, e whitened [windows, R]."""
        f = self.back(e[:, np.newaxis, :])[:, 0]
        return float(np.sum((f @ q) * f))
