"""Cramer-Rao bound of a run: what no unbiased estimator can be more accurate than.

The drive is taken as exact; the encoder has white noise. Unknown are w, d1, d2, the encoder's reading at rest, the four
numbers of the start, and the friction where there is one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.campaign.motion import integrate
from pvid.core.native import Native
from pvid.sim.pendulum import Pendulum

Float = npt.NDArray[np.float64]

# Central differences: relative steps of the parameters, steps of the start [rad, rad/s]. Their error is of the second
# order, 1e-6 after 120 s; that of rounding 1e-9.
_STEP = 1e-5
_START_STEP = 1e-5


def cramer_rao(
    native: Native,
    pendulum: Pendulum,
    start: npt.ArrayLike,
    acceleration: Float,
    step_s: float,
    *,
    density: float,
    noise: float,
    dry: tuple[float, float] = (0.0, 0.0),
    slip: float = 1.0,
    slant: float = 0.0,
) -> Float:
    """Bound of the relative standard errors of w, d1, d2, shape (3,); infinite where the run says nothing of them.

    Parameters
    ----------
    start, acceleration, step_s
        As for `integrate`.
    density
        Samples per step: the information is taken at the steps and scaled by this.
    noise
        Standard deviation of the encoder [rad].
    """
    viscous = pendulum.damping1 > 0 or pendulum.damping2 > 0
    names = ["w", "d1", "d2", "x0", "x1", "x2", "x3"]
    names += ["viscous1", "viscous2"] if viscous else []
    names += ["dry1", "dry2"] if max(dry) > 0 else []
    columns = [np.ones(len(acceleration) // 2 + 1)]  # the reading at rest
    for name in names:
        sides = []
        for sign in (1.0, -1.0):
            moved, x, friction = _moved(pendulum, np.asarray(start, np.float64), dry, name, sign)
            state = integrate(native, moved, x, acceleration, step_s, dry=friction, slip=slip, slant=slant)
            if state is None:
                return np.full(3, np.inf)
            sides.append(state[:, 1] - state[:, 0])
        columns.append((sides[0] - sides[1]) / (2 * (_START_STEP if name.startswith("x") else _STEP)))
    jacobian = np.column_stack(columns)
    size = np.sqrt((jacobian**2).sum(axis=0))
    if not (np.isfinite(size).all() and (size > 0).all()):
        return np.full(3, np.inf)
    triangle = np.linalg.qr(jacobian / size, mode="r")
    if not (np.abs(np.diag(triangle)) > 1e-9).all():
        return np.full(3, np.inf)
    inverse = np.linalg.inv(triangle)
    errors = noise / np.sqrt(density) * np.sqrt((inverse**2).sum(axis=1)) / size
    return np.asarray(errors[1:4])


def _moved(
    pendulum: Pendulum, start: Float, dry: tuple[float, float], name: str, sign: float
) -> tuple[Pendulum, Float, tuple[float, float]]:
    """Rig, start and dry friction with one of the unknowns moved by a step."""
    factor = float(np.exp(sign * _STEP))
    if name.startswith("x"):
        start = start.copy()
        start[int(name[1])] += sign * _START_STEP
    elif name.startswith("viscous"):
        key = "damping" + name[-1]
        pendulum = replace(pendulum, **{key: factor * getattr(pendulum, key)})
    elif name.startswith("dry"):
        dry = (factor * dry[0], dry[1]) if name == "dry1" else (dry[0], factor * dry[1])
    else:
        p = pendulum.linear
        p[("w", "d1", "d2").index(name)] *= factor
        moved = Pendulum.from_linear(p, pendulum.l1)
        pendulum = replace(moved, damping1=pendulum.damping1, damping2=pendulum.damping2)
    return pendulum, start, dry
