"""The layout of an estimate (pvid_estimate_f32, pvid_estimate_q31), as numpy holds it."""

from __future__ import annotations

import numpy as np

MAX_P = 6  # places for parameters


def _layout(number: type[np.generic], matrix: str, weight: type[np.generic]) -> np.dtype[np.void]:
    per_parameter = [("p", number, (MAX_P,)), ("se", number, (MAX_P,)), (matrix, number, (MAX_P, MAX_P))]
    scalars = [(name, number) for name in ("kappa", "least_pivot", "residual_sd")]
    return np.dtype([*per_parameter, *scalars, ("weight", weight), ("misfit", number)])


F32 = _layout(np.float32, "covariance", np.float32)
Q31 = _layout(np.int32, "correlation", np.uint32)
