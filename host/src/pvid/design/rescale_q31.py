"""From sums to another fixed-point format (pvid_rescale_q31 of pvid/model_q31.h)."""

from __future__ import annotations

import math

from pvid.base.errors import PvidError
from pvid.settings.weak_q31 import Rescale

_FIRST = 30  # bits of the first factor: one is spare


def shift_to(most: float, bits: float) -> int:
    """Shift right, not negative, that brings |x| <= most to 2^bits at most."""
    return max(0, math.ceil(math.log2(most) - bits)) if most > 0 else 0


def rescale_to(most: float, gain: float, name: str) -> Rescale:
    """From sums of at most `most` to `gain` times them; beyond, the result saturates.

    Raises PvidError where no shift of 64 bits does it.
    """
    down = shift_to(most, _FIRST)
    factor = gain * 2.0**down
    shift = 30 - math.floor(math.log2(factor))
    multiplier = round(factor * 2.0**shift)
    if multiplier == 2**31:
        multiplier, shift = 2**30, shift - 1
    if not (0 <= shift <= 62 and down <= 62):
        raise PvidError(f"the fixed-point core cannot hold {name}: its unit and that of its sensor differ too much")
    return Rescale(down, shift, multiplier)
