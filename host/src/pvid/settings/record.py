"""What a run through an identifier leaves, of the C core or of a lane of its twin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass
class Record:
    """One entry a tick along the first axis; float32, or integers in fixed point.

    p
        The estimator's parameters [ticks, n_p].
    sums
        M, B, yy and weight [ticks, n] (fixed point: int64, M, b, rr times 4^-exponent, and weight).
    exponent
        Of the sums [ticks] in fixed point; else empty.
    reason
        Outcome of each tick, uint8 [ticks].
    hash
        Running hash after each tick, uint32 [ticks].
    published, published_se
        What the weak form publishes and its standard errors [ticks, n_p]; else empty.
    estimate
        Every so many ticks an estimate, structured. In fixed point it is the published one in the weak form.
    """

    p: Array
    sums: Array
    exponent: npt.NDArray[np.uint8]
    reason: npt.NDArray[np.uint8]
    hash: npt.NDArray[np.uint32]
    published: Array
    published_se: Array
    estimate: npt.NDArray[np.void]
