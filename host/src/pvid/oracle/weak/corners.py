"""The signals made of held inputs that a model with corners (pvid.model.corners) has."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from pvid.model.corners import OfInput


def with_jumps(
    run: Mapping[str, npt.ArrayLike], made: Mapping[str, OfInput], sample_rate: float
) -> dict[str, npt.ArrayLike]:
    """A run with these signals of its inputs [n]; the first sample is also the one before it."""
    out = dict(run)
    for name, of in made.items():
        if of.name not in run:
            continue
        u = np.asarray(run[of.name], np.float64)
        before = np.concatenate([u[:1], u[:-1]])
        before = np.where(np.isnan(before) & np.isfinite(u), u, before)
        out[name] = {"jump": (u - before) / (12 * sample_rate), "before": before, "after": u}[of.kind]
    return out
