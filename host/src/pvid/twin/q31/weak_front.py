"""Twin of weak/front_q31.c: exact sums of counts, one rounding each for F and U."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.tables import WeakTablesQ31
from pvid.twin.q31.integer import Int, round_shift
from pvid.twin.weak_schedule import Schedule


def _folded(counts: Int, weights: npt.NDArray[np.int32], centres: Int) -> Int:
    middle = counts[centres]
    total = np.zeros_like(middle)
    for i, weight in enumerate(weights):
        total = total + int(weight) * ((counts[centres + (i + 1)] - middle) + (counts[centres - (i + 1)] - middle))
    return total


def decimate(phi: Int, y: Int, design: WeakTablesQ31) -> tuple[Int, Int]:
    """F and U at the decimated instants of one stretch of counts within full scale [ticks]."""
    centres = Schedule.of(design).centres(len(phi))
    f = (phi[centres] << design.smooth_bits) + _folded(phi, design.smooth, centres)
    return round_shift(f, design.phi_shift), round_shift(_folded(y, design.second, centres), design.u_shift)
