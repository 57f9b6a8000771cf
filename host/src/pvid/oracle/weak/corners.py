"""The jumps of held inputs that a model with corners (pvid.model.corners) has as signals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt


def with_jumps(
    run: Mapping[str, npt.ArrayLike], jumps: Mapping[str, str], sample_rate: float
) -> dict[str, npt.ArrayLike]:
    """A run with the scaled jumps of its inputs, dt/12 (u_k - u_(k-1)) [n]."""
    out = dict(run)
    for jump, name in jumps.items():
        if name in run:
            u = np.asarray(run[name], np.float64)
            jumped = np.diff(u, prepend=u[:1]) / (12 * sample_rate)
            out[jump] = np.where(np.isnan(jumped) & np.isfinite(u), 0.0, jumped)
    return out
