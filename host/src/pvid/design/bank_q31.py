"""Filters of the fixed-point strong form, as in pvid/bank_q31.h: a folded bank of derivatives with integer weights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.design.fir import ORDERS, FirBank

_WORD = 30  # bits of a weight
_SUM = 61  # bits of a sum: below 2^62, with room for the rounding of the weights
FULL_SCALE_LIMIT = 2**24
HELD_UNITS = 24  # of a count of a held input
HELD_MOST = HELD_UNITS + 4  # of them, over full scale


@dataclass(frozen=True, eq=False)
class BankQ31:
    """Integer weights of a bank.

    Attributes
    ----------
    weights : int32 [5, half]: those of the bank times 2^bits
    bits : of each order
    """

    weights: npt.NDArray[np.int32]
    bits: tuple[int, ...]

    @property
    def half(self) -> int:
        """Taps on each side."""
        return int(self.weights.shape[1])

    @property
    def centre(self) -> int:
        """Weight of the middle sample in order 0."""
        return 1 << self.bits[0]


def integer_bank(bank: FirBank, largest: int) -> BankQ31:
    """The bank with all the bits that exact sums of points within +-largest leave."""
    bits, rows = [], []
    for order in range(ORDERS):
        weights = bank.weights[order]
        most = max(float(np.abs(weights).max()), 1.0 if order == 0 else 0.0)
        total = float(np.abs(weights).sum()) + (1.0 if order == 0 else 0.0)
        own = min(_WORD - math.log2(most), _SUM - math.log2(4.0 * largest * total))
        bits.append(math.floor(own))
        rows.append(np.rint(weights * 2.0 ** bits[-1]))
    return BankQ31(np.array(rows).astype(np.int32), tuple(bits))
