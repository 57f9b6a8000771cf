"""Twin of cholesky_f32.c: lanes factor at once, each with a verdict of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

PIVOT_MIN = np.float32(1.0e-6)
_SMALLEST_NORMAL = np.float32(1.17549435e-38)


def _inverse_root_scale(x: Float32) -> Float32:
    exponent = np.ascontiguousarray(x).view(np.uint32) >> np.uint32(23)
    bits = (np.uint32(190) - ((exponent - np.uint32(1)) >> np.uint32(1))) << np.uint32(23)
    return bits.view(np.float32)


@dataclass
class Factor:
    """D S D = U U^T in every lane; valid where `ok`. scale [n, lanes], u [n, n, lanes]."""

    ok: Mask
    scale: Float32
    u: Float32
    first_pivot: Float32


def factor(s: Float32) -> Factor:
    """Factors the upper triangle of s [n, n, lanes]. Lanes that fail compute on with harmless garbage."""
    n, _, lanes = s.shape
    diagonals = s[range(n), range(n)]
    ok: Mask = np.all((diagonals >= _SMALLEST_NORMAL) & (diagonals < np.inf), axis=0)
    scale = _inverse_root_scale(diagonals)
    scaled = (s * scale[:, None]) * scale
    u = np.zeros((n, n, lanes), np.float32)
    first_pivot = np.zeros(lanes, np.float32)
    for j in reversed(range(n)):
        diagonal = scaled[j, j]
        pivot = diagonal
        for k in range(j + 1, n):
            pivot = pivot - u[j, k] * u[j, k]
        ok &= pivot >= PIVOT_MIN * diagonal
        if j == 0:
            first_pivot = np.where(ok, pivot / diagonal, first_pivot)
        u[j, j] = np.float32(1) / np.sqrt(pivot)
        for i in range(j):
            total = scaled[i, j]
            for k in range(j + 1, n):
                total = total - u[i, k] * u[j, k]
            u[i, j] = total * u[j, j]
    return Factor(ok, scale, u, first_pivot)


def solve(f: Factor, rhs: Float32) -> Float32:
    """S^-1 rhs [n, lanes]."""
    n = len(rhs)
    x = np.empty_like(rhs)
    for i in reversed(range(n)):
        total = rhs[i] * f.scale[i]
        for k in range(i + 1, n):
            total = total - f.u[i, k] * x[k]
        x[i] = total * f.u[i, i]
    for i in range(n):
        total = x[i]
        for k in range(i):
            total = total - f.u[k, i] * x[k]
        x[i] = total * f.u[i, i]
    return x * f.scale


def inverse(f: Factor) -> Float32:
    """S^-1 [n, n, lanes], symmetric by construction."""
    n, _, lanes = f.u.shape
    out = np.empty((n, n, lanes), np.float32)
    for j in range(n):
        unit = np.zeros((n, lanes), np.float32)
        unit[j] = 1
        column = solve(f, unit)
        for i in range(j + 1):
            out[i, j] = column[i]
            out[j, i] = column[i]
    return out
