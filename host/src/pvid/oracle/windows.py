"""A run cut into the weak form's windows, and the residuals of their rows, in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.design.weak import WeakDesign
from pvid.oracle.weak import WeakOracle, WeakSettings, columns, frames, front_end
from pvid.rig.run import Run

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Windows:
    """A run as a design sees it: windows of columns [windows, 11, K], angle and u [windows, W]."""

    design: WeakDesign
    columns: Float
    phi: Float
    u: Float

    @classmethod
    def of(cls, run: Run, design: WeakDesign) -> Windows:
        smooth, u = front_end(run.phi, run.y, design)
        phi_frames, u_frames = frames(smooth, design), frames(u, design)
        return cls(design, columns(phi_frames, u_frames, design), phi_frames, u_frames)

    def estimated(self, settings: WeakSettings, part: slice = slice(None)) -> WeakOracle:
        """The estimator after the windows of a part of the run."""
        oracle = WeakOracle(self.design, settings)
        for one, phi, u in zip(self.columns[part], self.phi[part], self.u[part], strict=True):
            oracle.window(one, phi, u)
        return oracle

    def residuals(self, oracle: WeakOracle) -> Float:
        """Residuals of all rows at the estimator's p [windows, K]."""
        rows = []
        for one, phi, u in zip(self.columns, self.phi, self.u, strict=True):
            x, _ = oracle.rows(one, phi, u)
            rows.append(x[0] - oracle.theta() @ x[1:])
        return np.array(rows)

    def innovations(self, settings: WeakSettings) -> Float:
        """Energy of each window's residuals at the estimate from those before it [windows]."""
        oracle = WeakOracle(self.design, settings)
        energies = []
        for one, phi, u in zip(self.columns, self.phi, self.u, strict=True):
            x, _ = oracle.rows(one, phi, u)
            e = x[0] - oracle.theta() @ x[1:]
            energies.append(float(e @ e))
            oracle.window(one, phi, u)
        return np.array(energies)
