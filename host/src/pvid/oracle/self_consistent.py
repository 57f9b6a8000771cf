"""Terms that the linear rows of one window neglect at large angles, computed together with the ends of its motion.

The neglected terms (`lack`, `Remainder`) depend on the motion inside the window, the motion depends on its end values a
and b, and these depend on the rows minus the neglected terms. A fixed-point iteration over these three steps converges
if the angles of both links are small. If the first link swings far, it diverges, and a root search finds a and b.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.design.weak import WeakDesign
from pvid.oracle.weak import L2_MIN, Remainder, boundary, internal_motion, remainder_of_motion

Float = npt.NDArray[np.float64]

_PASSES = 3
# The passes have converged if the last one changes the neglected terms by less than this share.
_CONVERGED = 0.01
_SOLVED = 1e-4  # of a and b, relative
_EVALUATIONS = 40


def self_consistent(
    p: Float, damping: Float | None, columns: Float, phi: Float, u: Float, design: WeakDesign, full_angle: bool
) -> Remainder | None:
    """Neglected terms of the window with `columns` [11, K], angle phi [W, rad] and u [W, 1/s^2], at p = (w, d1, d2, c),
    with friction `damping` [2]; None: without friction, and k is 0.

    None if no motion is consistent with its neglected terms.

    Cost: 3 evaluations of the motion if the passes converge, else about 12.
    """
    none = Remainder(np.zeros(design.functions), np.zeros((2, design.functions)))
    if p[1] - p[2] - 1 <= L2_MIN:
        return None

    def ends_with(known: Remainder) -> Float:
        return boundary(p, columns, known.y if damping is None else known.y + damping @ known.k)

    def remainder_at(ends: Float) -> Remainder:
        motion = internal_motion(p, ends, phi, u, design)
        return remainder_of_motion(p, motion, phi, u, design, full_angle, friction=damping is not None)

    with np.errstate(over="ignore", invalid="ignore"):
        out, moved = none, np.inf
        for _ in range(_PASSES):
            before, out = out, remainder_at(ends_with(out))
            moved = float(np.linalg.norm(out.y - before.y)) / max(float(np.linalg.norm(out.y)), 1e-300)
        if not full_angle or moved <= _CONVERGED:
            return out if np.isfinite(out.y).all() and np.isfinite(out.k).all() else None
        first = ends_with(none)
        unit = np.maximum(np.abs(first), 1e-9)

        def miss(scaled: Float) -> Float:
            ends = scaled * unit
            wanted = ends_with(remainder_at(ends))
            return np.nan_to_num((wanted - ends) / unit, nan=1e6, posinf=1e6, neginf=-1e6)

        from scipy.optimize import root  # half the start time of a command, and 40 MB in a logger

        found = root(miss, first / unit, options={"xtol": _SOLVED, "maxfev": _EVALUATIONS})
        return remainder_at(found.x * unit) if found.success else None
