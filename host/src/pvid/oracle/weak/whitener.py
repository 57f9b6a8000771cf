"""Whitening of the rows of many windows whose covariances differ by a few directions each.

R_w = R + U_w U_w^T with one R of the run and the directions U_w of the reversals in window w. With R = L L^T and
V = L^-1 U the rows y = L^-1 x have the covariance I + V V^T. With I + V^T V = K K^T

    x -> (I - V B^T V^T) L^-1 x,   B = K^-T (I + K)^-1

whitens them (Andrews' square root): one factorisation of the run, and matrices of the size of the number of reversals
for each window. Windows with about as many directions are computed together: most windows of a run have few or none.
Of a window with more directions than rows, as where a friction sticks, V is replaced by a square factor of V V^T.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.oracle.weak.functions import Float, product

_LEAF = 4  # rows of a half, up to which inverses are formed at once


@dataclass(frozen=True)
class Holders:
    """Windows that hold about as many directions; r is the largest number of theirs.

    Attributes
    ----------
    windows : their places [w]
    entries : of the directions of each [w, r], -1 where it has fewer
    """

    windows: npt.NDArray[np.int64]
    entries: npt.NDArray[np.int64]


def holders(windows: npt.NDArray[np.int64], entries: npt.NDArray[np.int64]) -> list[Holders]:
    """From the window of each direction, rising, and its entry [directions]."""
    own, first, count = np.unique(windows, return_index=True, return_counts=True)
    octave = np.frexp(count - 0.5)[1]
    padded = np.append(entries, -1)
    out = []
    for alike in (np.flatnonzero(octave == one) for one in np.unique(octave)):
        steps = np.arange(count[alike].max())
        there = steps < count[alike, np.newaxis]
        out.append(Holders(own[alike], padded[np.where(there, first[alike, np.newaxis] + steps, -1)]))
    return out


@dataclass(frozen=True)
class _Alike:
    """The directions of windows that hold about as many.

    Attributes
    ----------
    held : by which windows
    whole : L^-1 U_w [w, R, r]
    v : the same, or a factor of as many directions as there are rows where r is larger [w, R, min(r, R)]
    small : B [w, r', r'], r' = min(r, R)
    inner : K^-1 [w, r', r']
    """

    held: Holders
    whole: Float
    v: Float
    small: Float
    inner: Float

    @classmethod
    def of(cls, held: Holders, whole: Float) -> _Alike:
        """From their directions."""
        v = whole
        if v.shape[2] > v.shape[1]:
            v = np.asarray(np.linalg.qr(v.transpose(0, 2, 1), mode="r")).transpose(0, 2, 1)
        one = np.eye(v.shape[2])
        k = np.asarray(np.linalg.cholesky(one + v.transpose(0, 2, 1) @ v), np.float64)
        inner = inverse_of_lower(k)
        return cls(held, whole, v, inner.transpose(0, 2, 1) @ inverse_of_lower(one + k), inner)

    def only(self, kept: npt.NDArray[np.int64]) -> _Alike:
        """Of some of all windows, at their new places."""
        there = np.isin(self.held.windows, kept)
        held = Holders(np.searchsorted(kept, self.held.windows[there]), self.held.entries[there])
        whole, v, small, inner = (one[there] for one in (self.whole, self.v, self.small, self.inner))
        return _Alike(held, whole, v, small, inner)

    def turn(self, y: Float, transposed: bool = False) -> None:
        """(I - V B^T V^T) y of these windows' part of y [windows, columns, R], or its transpose; in place."""
        small = self.small.transpose(0, 2, 1) if transposed else self.small
        windows = self.held.windows
        y[windows] -= ((y[windows] @ self.v) @ small) @ self.v.transpose(0, 2, 1)

    def shrunk(self) -> Float:
        """V K^-T [w, R, r'], whose square is V (I + V^T V)^-1 V^T."""
        return np.asarray(self.v @ self.inner.transpose(0, 2, 1))


@dataclass(frozen=True)
class Whitener:
    """L_w^-1 of every window; R is the number of rows.

    Attributes
    ----------
    base : L^-1 [R, R]
    windows : how many
    alike : those with directions
    """

    base: Float
    windows: int
    alike: tuple[_Alike, ...]

    @classmethod
    def of_covariance(
        cls, covariance: Float, windows: int, directions: Float | None = None, held: Sequence[Holders] = ()
    ) -> Whitener:
        """From R [R, R] and the directions [entries, R] of the windows that hold any."""
        base = inverse_of_lower(np.asarray(np.linalg.cholesky(covariance), np.float64))
        alike = []
        if directions is not None and held:
            turned = np.append(directions @ base.T, np.zeros((1, len(base))), axis=0)  # entry -1: none
            alike = [_Alike.of(one, turned[one.entries].transpose(0, 2, 1)) for one in held]
        return cls(base, windows, tuple(alike))

    def only(self, windows: slice | npt.NDArray[np.bool_]) -> Whitener:
        """Of some of the windows."""
        kept = np.arange(self.windows)[windows]
        return replace(self, windows=len(kept), alike=tuple(one.only(kept) for one in self.alike))

    def of(self, x: Float, rows: slice = slice(None)) -> Float:
        """L_w^-1 x_w for each of several columns x [windows, columns, R]; those that fill some rows only are short."""
        y = product(x, self.base[:, rows].T)
        for one in self.alike:
            one.turn(y)
        return y

    def back(self, y: Float) -> Float:
        """L_w^-T y_w of [windows, columns, R]."""
        y = y.copy()
        for one in self.alike:
            one.turn(y, transposed=True)
        return product(y, self.base)

    def total_inverse(self) -> Float:
        """Sum over the windows of R_w^-1 [R, R]."""
        rows = len(self.base)
        total = self.windows * np.eye(rows)
        for one in self.alike:
            flat = one.shrunk().transpose(1, 0, 2).reshape(rows, -1)
            total -= flat @ flat.T
        return np.asarray(self.base.T @ total @ self.base)

    def inverse_of_directions(self) -> tuple[npt.NDArray[np.int64], Float]:
        """Entries [n], and R_w^-1 U_w of each [n, R]."""
        entries, out = [np.zeros(0, np.int64)], [np.zeros((0, len(self.base)))]
        for one in self.alike:
            inside = one.shrunk()
            if one.whole.shape == one.v.shape:
                rows = inside @ one.inner
            else:
                rows = one.whole - inside @ (inside.transpose(0, 2, 1) @ one.whole)
            there = one.held.entries >= 0
            entries.append(one.held.entries[there])
            out.append(rows.transpose(0, 2, 1)[there] @ self.base)
        return np.concatenate(entries), np.concatenate(out)

    def log_determinant(self) -> float:
        """Sum over the windows of log det R_w."""
        inner = [np.diagonal(one.inner, axis1=1, axis2=2) for one in self.alike]
        return -2 * (self.windows * _logarithms(np.diag(self.base)) + sum(map(_logarithms, inner)))

    def trace(self, q: Float) -> float:
        """Sum over the windows of tr(R_w^-1 Q)."""
        return float(np.sum(self.total_inverse() * q))

    def energy(self, q: Float, e: Float) -> float:
        """Sum over the windows of e^T L_w^-1 Q L_w^-T e, e whitened [windows, R]."""
        f = self.back(e[:, np.newaxis, :])[:, 0]
        return float(np.sum((f @ q) * f))


def inverse_of_lower(k: Float) -> Float:
    """Inverses of lower triangular matrices [..., n, n], by halves: a third of the time of those of full ones."""
    half = k.shape[-1] // 2
    if half <= _LEAF:
        return np.asarray(np.linalg.inv(k))
    out = np.zeros_like(k)
    out[..., :half, :half] = inverse_of_lower(k[..., :half, :half])
    out[..., half:, half:] = inverse_of_lower(k[..., half:, half:])
    out[..., half:, :half] = -(out[..., half:, half:] @ k[..., half:, :half]) @ out[..., :half, :half]
    return out


def _logarithms(x: Float) -> float:
    return float(np.sum(np.log(np.abs(x))))
