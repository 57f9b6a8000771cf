"""Twin of weak/columns_f32.c: columns of a kind from the sums of a window, and the projection on what the nuisances
leave."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import NONE
from pvid.twin.f32.weak_white import White, total

Float32 = npt.NDArray[np.float32]

_F = np.float32
_SKIP = _F(1e-6)
_SMALLEST, _LARGEST = _F(1.17549435e-38), _F(3.4e38)


def parts_of_columns(white: White, window: Float32) -> Float32:
    """Sums over the terms of each column, factor (-1)^m (i omega)^m S_h over its standard deviation
    [columns, 2, harmonics, lanes].

    window: sums of the channels [channels, 2, harmonics]
    """
    rows, model = white.rows, white.rows.design.model
    rate = (np.arange(rows.harmonics).astype(np.float32) * rows.omega)[:, None]
    sines = slice(0, rows.families[1].stop)
    out = np.zeros((model.kind[white.kind].columns, 2, *white.scale.shape), np.float32)
    with np.errstate(all="ignore"):
        for one in model.terms_of(white.kind):
            factor, column = _F(one.factor), out[one.column]
            if model.channel[one.channel].gain == NONE:
                whole = white.scale[0] * (factor * (_F(2) * _F(rows.design.hop)))
                column[0, 0] = column[0, 0] + (whole if one.order == 0 else _F(0))
                continue
            turned, negative = one.order % 2 == 1, (one.order + 1) % 4 >= 2
            re, im = window[one.channel][::-1] if turned else window[one.channel]
            sign = -factor if negative else factor
            weight = white.scale
            for _ in range(one.order):
                weight = weight * rate
            column[0] = column[0] + ((-sign if turned else sign) * weight) * re[:, None]
            column[1, sines] = column[1, sines] + ((sign * weight) * im[:, None])[sines]
    return out


def projected(columns: Float32, thetas: int) -> tuple[Float32, Float32]:
    """Columns [columns, rows, lanes] without their parts along the nuisances, which are those behind thetas and Y.

    Also how many nuisances are live [lanes].
    """
    x, first = columns.copy(), thetas + 1
    live = np.zeros(columns.shape[2], np.float32)
    with np.errstate(all="ignore"):
        whole = [total(one * one) for one in columns[first:]]
        for place in range(first, len(x)):
            nuisance = x[place].copy()
            left = total(nuisance * nuisance)
            kept = (left >= _SMALLEST) & (left <= _LARGEST) & (left > _SKIP * whole[place - first])
            inverse = np.where(kept, _F(1) / left, _F(0)).astype(np.float32, copy=False)
            live = live + kept.astype(np.float32)
            for column in (*range(first), *range(place + 1, len(x))):
                x[column] = x[column] - (total(nuisance * x[column]) * inverse) * nuisance
    return x[:first], live
