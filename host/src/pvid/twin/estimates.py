"""The layout of an estimate (pvid_estimate_f32, pvid_estimate_q31), as numpy holds it."""

from __future__ import annotations

import numpy as np

MAX_P = 6  # places for parameters


def _layout(number: type[np.generic], matrix: str, weight: type[np.generic], places: int = MAX_P) -> np.dtype[np.void]:
    per_parameter = [("p", number, (places,)), ("se", number, (places,)), (matrix, number, (places, places))]
    scalars = [(name, number) for name in ("kappa", "least_pivot", "residual_sd")]
    return np.dtype([*per_parameter, *scalars, ("weight", weight), ("misfit", number)])


F32 = _layout(np.float32, "covariance", np.float32)
Q31 = _layout(np.int32, "correlation", np.uint32)


def f32_of(n_p: int) -> np.dtype[np.void]:
    """F32, with more places where there are more parameters."""
    return F32 if n_p <= MAX_P else _layout(np.float32, "covariance", np.float32, n_p)


def q31_of(n_p: int) -> np.dtype[np.void]:
    """Q31, with more places where there are more parameters."""
    return Q31 if n_p <= MAX_P else _layout(np.int32, "correlation", np.uint32, n_p)
