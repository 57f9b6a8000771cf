"""Twin of weak/whiten_f32.c: the noise covariance of a window's rows at p, its Cholesky factor, the noise traces."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.f32 import WeakTables
from pvid.twin.f32.cholesky import PIVOT_MIN

Float32 = npt.NDArray[np.float32]


def gram(design: WeakTables, p: Float32) -> Float32:
    """R0 at p [n_p, lanes]: packed lower triangle by rows [K (K + 1) / 2, lanes]."""
    factor2 = p[1] * p[0]
    factor0 = (p[2] * p[0]) * p[0]
    factors = (factor2, factor0, factor2 * factor2, factor2 * factor0, factor0 * factor0)
    tables = np.asarray(design.gram, np.float32)[:, :, None]
    total = np.broadcast_to(tables[0], (tables.shape[1], p.shape[1]))
    for table, one in zip(tables[1:], factors, strict=True):
        total = total + one * table
    return total


def factor(packed: Float32, functions: int) -> tuple[Float32, npt.NDArray[np.bool_]]:
    """The Cholesky factor [K, K, lanes] with inverted diagonal, and whether it exists [lanes]."""
    lanes = packed.shape[1]
    low = np.zeros((functions, functions, lanes), np.float32)
    rows, columns = np.tril_indices(functions)
    low[rows, columns] = packed
    whitened = np.ones(lanes, np.bool_)
    for row in range(functions):
        diagonal = low[row, row].copy()
        pivot = diagonal
        for j in range(row):
            total = low[row, j]
            for i in range(j):
                total = total - low[row, i] * low[j, i]
            low[row, j] = total * low[j, j]
            pivot = pivot - low[row, j] * low[row, j]
        whitened = whitened & (pivot > PIVOT_MIN * diagonal) & np.isfinite(pivot)
        low[row, row] = np.float32(1) / np.sqrt(np.where(whitened, pivot, np.float32(1)))
    return low, whitened


def whiten(x: Float32, low: Float32, whitened: npt.NDArray[np.bool_]) -> Float32:
    """L^-1 of the columns x [columns, K, lanes]."""
    out = x.copy()
    for row in range(x.shape[1]):
        for j in range(row):
            out[:, row] = out[:, row] - low[row, j] * out[:, j]
        out[:, row] = out[:, row] * low[row, row]
    return np.where(whitened, out, x)


def inverse_row(low: Float32, row: int) -> Float32:
    """Entries 0..row of a row of L^-1 [row + 1, lanes]."""
    out = np.empty((row + 1, low.shape[2]), np.float32)
    out[row] = low[row, row]
    for j in reversed(range(row)):
        total = np.zeros(low.shape[2], np.float32)
        for k in range(j + 1, row + 1):
            total = total + out[k] * low[k, j]
        out[j] = -(total * low[j, j])
    return out


def traces(design: WeakTables, low: Float32) -> Float32:
    """trace(R0^-1 G22), trace(R0^-1 G20), trace(R0^-1 G00), each over K [3, lanes]."""
    functions, lanes = design.functions, low.shape[2]
    tables = np.asarray(design.gram, np.float32)[3:, :, None]  # G22, G20 + G02, G00
    sums = np.zeros((3, lanes), np.float32)
    two = np.float32(2)
    for row in range(functions):
        inverse = inverse_row(low, row)
        start = 0
        for a in range(row + 1):
            below = np.zeros((3, lanes), np.float32)
            for b in range(a):
                below = below + inverse[b] * tables[:, start + b]
            sums = sums + inverse[a] * ((two * below) + (inverse[a] * tables[:, start + a]))
            start += a + 1
    a_row = np.float32(1) / np.float32(functions)
    return sums * np.array([a_row, np.float32(0.5) * a_row, a_row], np.float32)[:, None]
