"""Error of the estimate from linear rows at large angles: the fixed-point core has no correction for large angles.

The rows replace sin phi and cos phi by their linear terms. This biases p by about (phi / 2)^2 / 2 (relative; phi in
rad), with the same sign in every window, so the scatter of the windows does not show it. The run's own rows give the
bias: the least squares over the rows without correction, minus that over the same rows corrected for large angles.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.rows import FEWEST, RunRows
from pvid.setup.f32 import weak_design_of

Float = npt.NDArray[np.float64]

_WINDOWS = 100
_CORRECTIONS = 3


def linear_error(rig: RigFile, run: Run, p: Float) -> Float | None:
    """Relative errors of the mapped parameters [n_mapped] from the linear rows of a run, at an estimate p, with the
    offset or without it.

    None if the run's angles are too large for the correction.
    """
    model = rig.mechanism.model
    try:
        rows = RunRows.of(rig, run, weak_design_of(rig, run.sample_rate)).thinned(_WINDOWS)
        at = rows.fitted(p if len(p) > 3 else np.append(p, 0.0)).p
        for _ in range(_CORRECTIONS):
            corrected = rows.corrected(at).sound_only()
            if len(corrected.phi) < FEWEST:
                return None
            at = corrected.fitted(at).p
            if not model.is_plausible(at):
                return None
        linear = rows.only(np.isin(rows.number, corrected.number)).fitted(at)
    except (PvidError, np.linalg.LinAlgError):
        return None
    return np.asarray(linear.p[: model.n_mapped] / at[: model.n_mapped] - 1)
