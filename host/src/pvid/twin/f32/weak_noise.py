"""Twin of the noise stages of weak/weak_finish_f32.c: what the sensors' noise alone adds to the information."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.twin.f32.pattern import PatternModel
from pvid.twin.f32.weak_white import White

Float32 = npt.NDArray[np.float32]


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

    def add(self, white: White, first: int) -> None:
        """Adds C^T V C of a kind with theta from `first` on, V as in `White.pull`."""
        model = self._model
        pattern = list(zip(model.c_row, model.c_column, self._c, strict=True))
        thetas = len(white.full) - 1
        own = slice(first, first + thetas)
        with np.errstate(all="ignore"):
            for a in range(model.n_p):
                column, product = (np.zeros((model.n_theta, white.full.shape[1]), np.float32) for _ in range(2))
                for row, of, c in pattern:
                    if of == a:
                        column[row] = c
                product[own] = white.pull(np.concatenate([column[own], np.zeros((1, column.shape[1]), np.float32)]))
                for b in range(a, model.n_p):
                    entry = np.zeros(column.shape[1], np.float32)
                    for row, of, c in pattern:
                        if of == b:
                            entry = entry + c * product[row]
                    self.s[a, b] = self.s[a, b] + entry / self._rows
