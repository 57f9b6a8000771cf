"""Twin of the stages of weak/weak_finish_f32.c that find what the noise of the sensors alone adds to the information."""

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
        own = range(first, first + len(white.full) - 1)
        with np.errstate(all="ignore"):
            for a in range(model.n_p):
                column = np.zeros_like(white.full)
                for row, of, c in pattern:
                    if of == a and row in own:
                        column[row - first] = c
                product = white.pull(column)
                sums = np.zeros((model.n_p, column.shape[1]), np.float32)
                for row, of, c in pattern:
                    if row in own:
                        sums[of] = sums[of] + c * product[row - first]
                for b in range(a, model.n_p):
                    self.s[a, b] = self.s[a, b] + sums[b] / self._rows
