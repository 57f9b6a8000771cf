"""Twin of weak/noise_f32.c: what the noise of the sensors alone adds to the information of a window."""

from __future__ import annotations

from itertools import groupby

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import WeakDesign32, WeakNoise
from pvid.twin.f32.pattern import PatternModel
from pvid.twin.f32.weak_white import White

Float32 = npt.NDArray[np.float32]

_F = np.float32


def pairs_of(design: WeakDesign32, kind: int) -> list[tuple[WeakNoise, ...]]:
    """Neighbouring entries of the same two regressors of a kind."""
    thetas = design.model.kind[kind].thetas
    groups = groupby(design.noise, key=lambda one: (one.kind, one.a, one.b))
    return [tuple(of_pair) for (own, a, b), of_pair in groups if own == kind and a < thetas and b < thetas]


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

    def add(self, pair: tuple[WeakNoise, ...], first: int, share: Float32) -> None:
        """Adds the entries of two columns, of a kind with theta from `first` on."""
        one = pair[0]
        model, same = self._model, one.a == one.b
        whole = one.factor * share[one.power]
        for entry in pair[1:]:
            whole = whole + entry.factor * share[entry.power]
        own = (whole if same else _F(0.5) * whole) / self._rows
        pattern = list(enumerate(zip(model.c_row, model.c_column, strict=True)))
        for k, (row, i) in pattern:
            for m, (other, j) in pattern:
                if row != first + one.a or other != first + one.b or (same and j < i):
                    continue
                x = own * (self._c[k] * self._c[m])
                place = (min(i, j), max(i, j))
                self.s[place] = self.s[place] + (x + x if not same and i == j else x)
