"""The layout of an estimate (pvid_estimate_f32, pvid_estimate_q31), as numpy holds it."""

from __future__ import annotations

import numpy as np

MAX_P = 6  # places for parameters


def layout(number: type[np.generic], matrix: str, weight: type[np.generic], max_p: int = MAX_P) -> np.dtype[np.void]:
    """Of a core with so many places for parameters."""
    per_parameter = [("p", number, (max_p,)), ("se", number, (max_p,)), (matrix, number, (max_p, max_p))]
    scalars = [(name, number) for name in ("kappa", "least_pivot", "residual_sd")]
    return np.dtype([*per_parameter, *scalars, ("weight", weight), ("misfit", number)])


F32 = layout(np.float32, "covariance", np.float32)
Q31 = layout(np.int32, "correlation", np.uint32)
