"""Cross-validation of settings of the weak form: one half of a run's blocks predicts the other half.

    settings -> rows of the even blocks -> p -> residuals of the reference rows in the odd blocks, and vice versa

The reference rows are the same for all settings: one design, whitened at one p. If the settings have the correction for
large angles or friction, the reference rows have them too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.weak_sizing import HOST
from pvid.oracle.weak import VALID_ANGLE
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.rows import JOLT, RunRows, energy_at, least_squares
from pvid.run.survey import sized_for
from pvid.setup.f32 import nominal_start, weak_design_of

Float = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

# Length of a block in windows, if the run is long enough for more than two blocks.
_WINDOWS_A_BLOCK = 4
# Fewest reference windows and fewest windows for p in each half.
_LEAST_WINDOWS = 2
# If fewer windows than this have small angles, all windows are used.
_FEWEST = 8
# Pass band of the reference: as wide as its decimation lets it be.
_WIDEST_HZ = 1e6
_ROUNDS = 3  # p and its correction depend on each other
# Neighbouring windows share half their samples, which doubles the variance of a sum of theirs.
_OVERLAP = 2.0


@dataclass(frozen=True)
class Equations:
    """The equations of a rig file (large angles, friction), with p of the whole run and moments of the reference rows.

    Attributes
    ----------
    p : w, d1, d2, c and, with friction, its two coefficients
    moments : of (Y, N) of each reference window [windows, n, n]
    """

    full_angle: bool
    p: Float
    moments: Float


class HeldBack:
    """Judges settings on a run.

    Raises
    ------
    PvidError
        When the run is too short for two halves, or its pivot stands still.
    """

    def __init__(self, run: Run, rig: RigFile) -> None:
        """`rig` has the run's survey as its nominal; its own sizes are not used."""
        identifier = replace(rig.identifier, window_s=0.0, test_functions=HOST.functions, decimation=0, smoothing_s=0.0)
        wide = sized_for(replace(rig, identifier=replace(identifier, pass_hz=_WIDEST_HZ)), run)
        self.run, self.rig = run, rig
        self.design = weak_design_of(wide, run.sample_rate)
        self.start = np.append(nominal_start(rig), float(np.nanmedian(run.phi)))
        self.rows = RunRows.of(wide, run, self.design).within(self.start[3], VALID_ANGLE, _FEWEST)
        duration = len(run.t) / run.sample_rate
        longest = self.design.window_s + self.design.taps / run.sample_rate
        pairs = max(1, math.floor(duration / (2 * _WINDOWS_A_BLOCK * longest)))
        self.block_s = duration / (2 * pairs)
        self.halves = self._halves(self.rows)
        if min(int((self.halves == half).sum()) for half in (0, 1)) < _LEAST_WINDOWS:
            raise PvidError(
                f"the run of {duration:.3g} s is too short to judge settings on held-out data: each half "
                f"must contain {_LEAST_WINDOWS} driven windows of {self.design.window_s:.2g} s"
            )
        self.equations: dict[tuple[bool, bool], Equations] = {}
        self.kept = np.ones(len(self.halves), np.bool_)
        linear = self._fitted(full_angle=False, damping=False)
        residuals = energy_at(linear.moments, linear.p)
        self.kept = residuals <= JOLT * np.median(residuals)

    def equations_of(self, rig: RigFile) -> Equations:
        """The equations of a rig file, fitted to all reference rows.

        Raises
        ------
        PvidError
            When the fit has no plausible parameters.
        """
        asked = (rig.identifier.full_angle, rig.identifier.damping)
        if asked not in self.equations:
            self.equations[asked] = self._fitted(*asked)
        return self.equations[asked]

    def _fitted(self, full_angle: bool, damping: bool) -> Equations:
        p = np.append(self.start, [0.0, 0.0]) if damping else self.start
        moments = np.empty(0)
        for _ in range(_ROUNDS if full_angle or damping else 1):
            rows = self.rows.corrected(p, full_angle) if full_angle or damping else self.rows
            moments = _moments_of(rows.whitened(self.start))
            p = least_squares(moments[self.kept].sum(axis=0), p)
            if not self.rig.mechanism.model.is_plausible(p):
                raise PvidError("the least-squares solution of the run is not physical")
        return Equations(full_angle, p, moments)

    def residuals(self, rig: RigFile) -> Float:
        """Energy of the reference windows held back, predicted with a rig file's settings [windows held back].

        Raises
        ------
        PvidError
            When a half has too few windows with these settings, or no plausible parameters.
        """
        model = self.equations_of(rig)
        design = weak_design_of(rig, self.run.sample_rate)
        rows = RunRows.of(rig, self.run, design)
        if model.full_angle:  # the core drops windows that it cannot correct
            rows = rows.within(model.p[3], VALID_ANGLE, _FEWEST)
        if model.full_angle or rig.identifier.damping:
            rows = rows.corrected(model.p, model.full_angle)
        moments = _moments_of(rows.whitened(model.p))
        residuals = energy_at(moments, model.p)
        halves = np.where(residuals <= JOLT * np.median(residuals), self._halves(rows), -1)
        predicted = np.full(len(self.halves), np.nan)
        for half in (0, 1):
            seen = halves == half
            if int(seen.sum()) < _LEAST_WINDOWS:
                raise PvidError(f"windows of {design.window_s:.3g} s are too long for a half of the run")
            p = least_squares(moments[seen].sum(axis=0), model.p)
            if not self.rig.mechanism.model.is_plausible(p):
                raise PvidError("half of the run leads to no plausible parameters")
            held = self.halves == 1 - half
            predicted[held] = energy_at(model.moments[held], p)
        return predicted[self.kept & (self.halves >= 0)]

    def innovations(self, rig: RigFile, forgetting_s: float) -> Float:
        """Energy of each reference window after the first quarter, predicted from the windows before it [windows].

        Parameters
        ----------
        forgetting_s
            Time constant of forgetting [s]; 0: none.
        """
        model = self.equations_of(rig)
        moments = model.moments[self.kept]
        keep = math.exp(-self.design.hop_s / forgetting_s) if forgetting_s > 0 else 1.0
        settled = max(len(moments) // 4, _LEAST_WINDOWS)
        p, seen = model.p, np.zeros_like(moments[0])
        out = []
        for number, one in enumerate(moments):
            if number >= settled:
                p = least_squares(seen, p)
                out.append(float(energy_at(one, p)))
            seen = keep * seen + one
        return np.array(out)

    def _halves(self, rows: RunRows) -> npt.NDArray[np.int64]:
        """Parity (0 or 1) of the block that contains a window; -1 if it lies in two blocks."""
        blocks = np.floor(rows.spans / self.block_s).astype(np.int64)
        return np.where(blocks[:, 0] == blocks[:, 1], blocks[:, 0] % 2, -1)


def _moments_of(white: Float) -> Float:
    """Moments of each window's rows [windows, n, n]."""
    return np.asarray(white @ white.transpose(0, 2, 1))


def sigmas(energies: Float, reference: Float) -> float:
    """Difference of two sums of energies of the same windows [standard errors]; negative: the first is smaller."""
    gain = energies - reference
    spread = float(np.std(gain)) * math.sqrt(_OVERLAP * len(gain))
    return float(np.sum(gain)) / spread if spread > 0 else 0.0
