"""A published estimate held against the whole run: do all parts of it agree, and how much does it leave unexplained?

A real rig never fits its equations to its encoder's noise, and an alarm for that alone would sound for every rig. What
counts is whether the estimate is what all windows want. The scores of the windows, C^T N e, sum to 0 at the least
squares; their scatter gives standard errors that need no model of the noise (clustered by window), and a sum that is
far from 0 shows that the estimate belongs to a part of the run only. The larger of these and of the core's is
published. The share of the motion that no pendulum explains is reported beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.capture import Run
from pvid.errors import PvidError
from pvid.rigfile import RigFile
from pvid.run_rows import FEWEST, RunRows
from pvid.setup import weak_design_of
from pvid.skew import skew_of
from pvid.weak_oracle import VALID_ANGLE

Float = npt.NDArray[np.float64]

# Windows that are looked at, evenly spread over a longer run.
_WINDOWS = 300
_WINDOWS_OF_SKEW = 100
# Parts of the run disagree when the windows' own standard error, or what they want of p, is so many times the core's.
DISAGREES = 3.0


@dataclass(frozen=True)
class Verdict:
    """Of an estimate p = (w, d1, d2, c), with friction (w, d1, d2, c, c1, c2).

    Attributes
    ----------
    se : standard errors of p [n_p] from the scatter of the windows, their distance from p, and what a skew of the
        sensors does; 0 where there are too few windows
    unexplained : rms of the rows' residuals beyond the encoder's noise, over that of the rows (0 to about 1)
    skew : how much later y seems to be sampled than phi [s]; 0 where that explains nothing
    """

    se: Float
    unexplained: float
    skew: float = 0.0


def verdict(rig: RigFile, run: Run, p: Float) -> Verdict:
    """What the run's windows say of p, which the core published; large angles are corrected."""
    at = p if len(p) > 3 else np.append(p, 0.0)
    nothing = Verdict(np.zeros(len(at)), 0.0)
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
    share = rows.part  # of the windows: the whole run knows p better
    se = np.sqrt(fit.clustered_se**2 * share + wanted**2 + by_skew**2)
    return Verdict(se, min(unexplained, 1.0), skew)


def _rows(rig: RigFile, run: Run, at: Float, most: int) -> RunRows:
    """Of the windows that can be judged, so many at most, corrected at p."""
    rows = RunRows.of(rig, run, weak_design_of(rig, run.sample_rate)).thinned(most)
    rows = rows.within(at[3], VALID_ANGLE, FEWEST)
    if rig.identifier.full_angle or rig.identifier.damping:
        rows = rows.corrected(at, rig.identifier.full_angle).sound_only()
    return rows
