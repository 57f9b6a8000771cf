"""Twin of weak_finish_f32.c: a complete window becomes rows and steps, one stage a tick."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from pvid.native import Reason, WeakTables
from pvid.twin.cholesky import PIVOT_MIN
from pvid.twin.estimator import RelativeEstimator

Float32 = npt.NDArray[np.float32]
Reasons = npt.NDArray[np.uint8]

COLUMNS = 12
_Y, _A, _B = 8, 9, 10
_FUNCTIONS_A_STAGE = 6


def assemble(sums: Float32) -> Float32:
    """Columns N1..N8, Y, a, b, 0 [12, functions] from the sums [functions, 13] of a window."""
    s = sums.T
    n = [s[0], s[1], s[2], s[3] + s[8], s[9], s[4], s[5] + s[10], s[11]]
    return np.stack([*n, s[12], s[6], s[7], np.zeros_like(s[0])])


def gram(design: WeakTables, p: Float32) -> Float32:
    """R0 at p [n_p, lanes]: packed lower triangle by rows [K (K + 1) / 2, lanes]."""
    two = p[1] * p[0]
    zero = (p[2] * p[0]) * p[0]
    tables = np.asarray(design.gram, np.float32)[:, :, None]
    total = np.broadcast_to(tables[0], (tables.shape[1], p.shape[1]))
    for table, factor in zip(tables[1:], (two, zero, two * two, two * zero, zero * zero), strict=True):
        total = total + factor * table
    return total


def factor(packed: Float32, functions: int) -> tuple[Float32, npt.NDArray[np.bool_]]:
    """The Cholesky factor [K, K, lanes] with inverted diagonal, and where there is one [lanes]."""
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
    """L^-1 of the columns x [12, K, lanes]."""
    out = x.copy()
    for row in range(x.shape[1]):
        for j in range(row):
            out[:, row] = out[:, row] - low[row, j] * out[:, j]
        out[:, row] = out[:, row] * low[row, row]
    return np.where(whitened, out, x)


def remove(x: Float32, column: int) -> Float32:
    """Columns x [12, K, lanes] without their components along one of them."""
    functions = x.shape[1]
    square = np.zeros(x.shape[2], np.float32)
    for k in range(functions):
        square = square + x[column, k] * x[column, k]
    usable = (square >= np.float32(1.17549435e-38)) & (square <= np.float32(3.4e38))
    inverse = np.float32(1) / np.sqrt(np.where(usable, square, np.float32(1)))
    direction = np.where(usable, x[column] * inverse, np.float32(0)).astype(np.float32, copy=False)
    along = np.zeros((COLUMNS, x.shape[2]), np.float32)
    for k in range(functions):
        along = along + direction[k] * x[:, k]
    return x - direction[None] * along[:, None]


def rows(sums: Float32, design: WeakTables, p: Float32) -> Float32:
    """Whitened, projected columns [12, K, lanes] of a window with sums [K, 13] at p [n_p, lanes]."""
    with np.errstate(all="ignore"):
        x = np.repeat(assemble(sums)[:, :, None], p.shape[1], axis=2)
        low, whitened = factor(gram(design, p), design.functions)
        return remove(remove(whiten(x, low, whitened), _A), _B)


def stages(
    sums: Float32, design: WeakTables, iterations: int, estimator: RelativeEstimator
) -> Iterator[Reasons | None]:
    """Works a window off: one stage a step, yielding what there is to tell of it [lanes], else None."""
    x = rows(sums, design, estimator.p)
    parts = -(-design.functions // _FUNCTIONS_A_STAGE)
    for _ in range(3 * design.functions + 2 + 4 * parts):
        yield None
    for k in range(design.functions):
        added = estimator.add(x[: estimator.model.n_theta, k], x[_Y, k])
        yield None if (added == Reason.ACCUMULATED).all() else added
    for iteration in range(iterations):
        reason = None
        for reason in estimator.solve(ends_group=iteration == 0):
            if reason is None:
                yield None
        last = iteration + 1 == iterations or not estimator.was_due
        yield reason if last else None
        if last:
            return
