"""Windows that something else has spoiled: a spike, a slip, a hand on the mechanism. They are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import PASSES, SETTLED, Fit, batch

# A window is spoiled if its residuals have this many times the energy of the median window's. Windows of one sample's
# spike are at 1e3 and more; without spoiled ones the largest of a hundred windows of 24 rows is below 3.
_SPOILED = 30.0

# What happens in more than this part of the windows belongs to the mechanism.
_FEW = 0.1

_ROUNDS = 3


def energies(fit: Fit) -> Float:
    """Mean square of each window's whitened residuals [windows]."""
    whole = np.concatenate(fit.residuals(), axis=1)
    return np.asarray(np.mean(whole**2, axis=1))


def spoiled(fit: Fit) -> npt.NDArray[np.bool_]:
    """Which windows are [windows]; none where they are too many."""
    of_windows = energies(fit)
    out = of_windows > _SPOILED * np.median(of_windows)
    return out if out.sum() <= max(2, _FEW * len(out)) else np.zeros(len(out), np.bool_)


def gated(
    rows: WeakRows,
    start: Float | None = None,
    equation_error: bool = True,
    compensate: bool = True,
    passes: int = PASSES,
    settled: float = SETTLED,
) -> Fit:
    """The estimate from the windows that are not spoiled."""
    fit = batch(rows, start, equation_error, compensate, passes, settled)
    for _ in range(_ROUNDS):
        bad = spoiled(fit)
        if not bad.any():
            break
        again = batch(fit.rows.only(~bad), fit.p, equation_error, compensate, passes, settled)
        fit = replace(again, start=fit.start)
    return fit
