"""Twin of fourier/noise_f32.c: what the noise of the sensors alone adds to the information of a window."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.fourier import FourierNoise
from pvid.twin.f32.fourier_white import White
from pvid.twin.f32.pattern import PatternModel

Float32 = npt.NDArray[np.float32]

ENTRIES = 1  # of the noise table in a stage
_F = np.float32


def shares(white: White) -> Float32:
    """Q_j of a kind's rows, at most [powers, lanes]."""
    rows = white.rows
    share = np.zeros((rows.powers, white.scale.shape[1]), np.float32)
    sines = rows.parts - rows.cosines
    for h, scale in enumerate(white.scale):
        parts = _F(2) * _F(rows.design.hop) if h <= sines else _F(rows.design.hop)
        weight = parts * (scale * scale)
        for j in range(rows.powers):
            share[j] = share[j] + weight
            weight = weight * rows.square[h]
    return share


class Noise:
    """Information of the noise alone, of unit variance and per unit of the rows' weight.

    Parameters
    ----------
    rows : weight of a window

    Attributes
    ----------
    s : upper triangle [n_p, n_p, lanes]
    """

    def __init__(self, model: PatternModel, p: Float32, rows: Float32) -> None:
        self._model, self._rows = model, rows
        with np.errstate(all="ignore"):
            self._c = model.jacobian(p)
        self.s = np.zeros((model.n_p, model.n_p, p.shape[1]), np.float32)

    def add(self, one: FourierNoise, first: int, thetas: int, share: Float32) -> None:
        """Adds an entry of the noise table, of a kind with so many theta from `first` on."""
        if one.a >= thetas or one.b >= thetas:
            return
        model, same = self._model, one.a == one.b
        whole = (one.factor * share[one.power]) / self._rows
        own = whole if same else _F(0.5) * whole
        pattern = list(enumerate(zip(model.c_row, model.c_column, strict=True)))
        for k, (row, i) in pattern:
            for m, (other, j) in pattern:
                if row != first + one.a or other != first + one.b or (same and j < i):
                    continue
                x = own * (self._c[k] * self._c[m])
                place = (min(i, j), max(i, j))
                self.s[place] = self.s[place] + (x + x if not same and i == j else x)
