"""What the linear rows of one window lack at large angles: found together with the ends of its motion.

The lack follows from the motion inside the window, the motion from a and b at its ends, and these from the rows less
the lack. Passes around this circle converge where the angles of both links are small; where the first link swings far
they run away, and the two numbers a and b are solved for instead.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.weak_design import WeakDesign
from pvid.weak_oracle import L2_MIN, Remainder, boundary, internal_motion, lack

Float = npt.NDArray[np.float64]

_PASSES = 3
# Passes are enough where the last one changes the lack by less than this share of it.
_CONVERGED = 0.01
_SOLVED = 1e-4  # of a and b, relative
_EVALUATIONS = 40


def self_consistent(
    p: Float, damping: Float, columns: Float, phi: Float, u: Float, design: WeakDesign, full_angle: bool
) -> Remainder | None:
    """Of the window with `columns` [11, K], angle phi and u [W], at p = (w, d1, d2, c), with friction `damping` [2].

    None where no motion is consistent with its lack.

    Cost: 3 evaluations of the motion where passes converge, else some 12.
    """
    none = Remainder(np.zeros(design.functions), np.zeros((2, design.functions)))
    if p[1] - p[2] - 1 <= L2_MIN:
        return None

    def ends_with(known: Remainder) -> Float:
        return boundary(p, columns, known.y + damping @ known.k)

    def lack_at(ends: Float) -> Remainder:
        return lack(p, internal_motion(p, ends, phi, u, design), phi, u, design, full_angle)

    with np.errstate(over="ignore", invalid="ignore"):
        first = ends_with(none)
        out, moved = none, np.inf
        for _ in range(_PASSES):
            before, out = out, lack_at(ends_with(out))
            moved = float(np.linalg.norm(out.y - before.y)) / max(float(np.linalg.norm(out.y)), 1e-300)
        if not full_angle or moved <= _CONVERGED:
            return out if np.isfinite(out.y).all() and np.isfinite(out.k).all() else None
        unit = np.maximum(np.abs(first), 1e-9)

        def miss(scaled: Float) -> Float:
            ends = scaled * unit
            wanted = ends_with(lack_at(ends))
            return np.nan_to_num((wanted - ends) / unit, nan=1e6, posinf=1e6, neginf=-1e6)

        from scipy.optimize import root  # takes half of what any command takes to start, and 40 MB of a logger

        found = root(miss, first / unit, options={"xtol": _SOLVED, "maxfev": _EVALUATIONS})
        return lack_at(found.x * unit) if found.success else None
