"""Twin of fourier/columns_f32.c: columns of a kind's rows from the sums of a window, and the projection on what the
nuisances leave."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.fourier import NONE, FourierTerm
from pvid.twin.f32.fourier_white import Shapes

Float32 = npt.NDArray[np.float32]

_F = np.float32
_SKIP = _F(1e-6)
_SMALLEST, _LARGEST = _F(1.17549435e-38), _F(3.4e38)


def _folded(terms: tuple[FourierTerm, ...], columns: int, window: Float32, shapes: Shapes) -> Float32:
    """Sums over the terms of each column, factor (-1)^m (i omega)^m S_h [columns, 2, harmonics]."""
    total = np.zeros((columns, 2, shapes.harmonics), np.float32)
    model = shapes.design.model
    rate = np.arange(shapes.harmonics, dtype=np.float32) * shapes.omega
    for one in terms:
        factor = _F(one.factor)
        if model.channel[one.channel].gain == NONE:
            whole = factor * (_F(2) * _F(shapes.design.hop)) if one.order == 0 else _F(0)
            total[one.column, 0, 0] = total[one.column, 0, 0] + whole
            continue
        turned, negative = one.order % 2 == 1, (one.order + 1) % 4 >= 2
        parts = window[one.channel][::-1] if turned else window[one.channel]
        sign = -factor if negative else factor
        power = np.ones(shapes.harmonics, np.float32)
        for _ in range(one.order):
            power = power * rate
        factors = np.stack([(-sign if turned else sign) * power, sign * power])
        total[one.column] = total[one.column] + factors * parts
    return total


def columns(terms: tuple[FourierTerm, ...], count: int, window: Float32, shapes: Shapes) -> Float32:
    """Columns of a kind [columns, 2, rows] from the sums of a window [channels, 2, harmonics]; 0 behind the sines."""
    with np.errstate(all="ignore"):
        x = _folded(terms, count, window, shapes)
        for turn in range(shapes.power // 2):
            end = shapes.harmonics - 1 - turn
            before = np.concatenate([x[..., 1:2] * np.array([[1], [-1]], np.float32), x[..., : end - 1]], axis=-1)
            x = np.concatenate([_F(0.5) * x[..., :end] - _F(0.25) * (before + x[..., 1 : end + 1])], axis=-1)
    cosines, sines = shapes.rows
    out = np.zeros((count, 2, cosines), np.float32)
    out[:, 0] = x[:, 0, :cosines]
    out[:, 1, :sines] = x[:, 1, 1 : 1 + sines]
    return out


def square(x: Float32) -> Float32:
    """x^T x of x [K, lanes]."""
    total: Float32 = np.add.accumulate(x * x)[-1]
    return total


def inverse_if_kept(nuisance: Float32, whole: Float32) -> Float32:
    """1 over the square of a nuisance [K, lanes] that others have been taken off, 0 where too little of it is left."""
    left = square(nuisance)
    kept = (left >= _SMALLEST) & (left <= _LARGEST) & (left > _SKIP * whole)
    return np.where(kept, _F(1) / left, _F(0)).astype(np.float32, copy=False)


def without(column: Float32, nuisance: Float32, inverse: Float32) -> Float32:
    """A column [K, lanes] without its part along a nuisance."""
    along = np.add.accumulate(nuisance * column)[-1] * inverse
    return column - along * nuisance
