"""Compares a published estimate with the whole run: do all windows agree with it, and how much motion is unexplained?

No real rig fits its equations to within the encoder's noise, so an alarm for this alone would be raised for every rig.
The test is whether all windows agree with the estimate. The scores of the windows, C^T N e, sum to 0 at the least
squares solution. Their scatter gives standard errors that need no model of the noise (clustered by window). A sum far
from 0 shows that the estimate fits only a part of the run. The larger of these standard errors and the core's is
published, together with the share of the motion that the equations do not explain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.oracle.weak import VALID_ANGLE
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.rows import FEWEST, RunRows
from pvid.run.skew import skew_of
from pvid.setup.f32 import weak_design_of

Float = npt.NDArray[np.float64]

# Most windows that are evaluated; in a longer run they are evenly spread.
_WINDOWS = 300
_WINDOWS_OF_SKEW = 100
# Parts of the run disagree if the windows' standard error, or their distance from p, exceeds this many of the core's.
DISAGREES = 3.0


@dataclass(frozen=True)
class Verdict:
    """Result for an estimate p = (w, d1, d2, c), with friction (w, d1, d2, c, c1, c2).

    Attributes
    ----------
    se : standard errors of p [n_p] from the scatter of the windows, their distance from p and the effect of a skew of
        the sensors; 0 if there are too few windows
    scatter : the part of them that the scatter of the windows makes [n_p]
    unexplained : rms of the rows' residuals beyond the encoder's noise, relative to the rms of the rows (0 to 1)
    skew : estimated delay of y after phi [s]; 0 if a delay does not reduce the residuals
    judged : whether the run has enough windows that can be corrected at p
    """

    se: Float
    scatter: Float
    unexplained: float
    skew: float = 0.0
    judged: bool = True


def verdict(rig: RigFile, run: Run, p: Float) -> Verdict:
    """Evaluates the windows of the run at p, which the core published; large angles are corrected."""
    at = p if len(p) > 3 else np.append(p, 0.0)
    nothing = Verdict(np.zeros(len(at)), np.zeros(len(at)), 0.0, judged=False)
    try:
        rows = _rows(rig, run, at, _WINDOWS)
        fit = rows.judged(at)
        bare = replace(rig, identifier=replace(rig.identifier, disturbance=0.0))
        plain = replace(rows, design=weak_design_of(bare, run.sample_rate)).judged(at)
        if len(fit.energy) < FEWEST:
            return nothing
        wanted = np.linalg.solve(fit.information, fit.scores.sum(axis=0))
        skew, aligned_fit = skew_of(run, lambda shifted: _rows(rig, shifted, at, _WINDOWS_OF_SKEW).fitted(at))
        by_skew = np.zeros(len(at)) if aligned_fit is None else aligned_fit.p - at
    except (PvidError, np.linalg.LinAlgError):
        return nothing
    beyond = float(plain.energy.sum()) - len(plain.energy) * (rows.design.functions - 2) * rows.row_sd**2
    unexplained = math.sqrt(max(beyond, 0.0) / max(float(plain.signal.sum()), 1e-300))
    share = rows.part  # share of the windows that is used: the whole run has smaller errors
    scatter = fit.clustered_se * math.sqrt(share)
    se = np.sqrt(scatter**2 + wanted**2 + by_skew**2)
    return Verdict(se, scatter, min(unexplained, 1.0), skew)


def _rows(rig: RigFile, run: Run, at: Float, most: int) -> RunRows:
    """Rows of the valid windows, at most `most` of them, corrected at p."""
    rows = RunRows.of(rig, run, weak_design_of(rig, run.sample_rate)).thinned(most)
    rows = rows.within(at[3], VALID_ANGLE, FEWEST)
    if rig.identifier.full_angle or rig.identifier.damping:
        rows = rows.corrected(at, rig.identifier.full_angle).sound_only()
    return rows
