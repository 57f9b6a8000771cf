"""Motion of the rigs: the equations of host/native/pendulum.c, integrated."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bench.campaign.pivot import PivotMotion
from pvid.core.native import Native
from pvid.sim.pendulum import Pendulum

Float = npt.NDArray[np.float64]

# Steps per period of the fastest mode or tone: the phase is then off by 3e-7 rad a period, a tenth of an LSB of 17
# bits after 120 s at 0.12 rad.
STEPS_A_PERIOD = 128.0
# A step is at most this part of the time constant in which dry friction brings a link to rest.
_STIFFNESS = 0.4
# Beyond this angle [rad] no rig of a campaign moves: it is running away.
_LIMIT = 1.5


def step_of(
    pendulum: Pendulum, fast_hz: float, motion: PivotMotion, dry: tuple[float, float], slip: float, duration: float
) -> tuple[int, float]:
    """Number of steps and their length [s] that integrate a run of this duration [s]."""
    longest = 1 / (STEPS_A_PERIOD * max(fast_hz, motion.highest_hz))
    if max(dry) > 0:
        m11, m12, m22 = pendulum.l1**2, pendulum.l1 * pendulum.l2, pendulum.l2**2 + pendulum.rho2**2
        # dry friction's rate of decay: at the joint, whose inertia is the smaller one
        inverse = (m11 + m22 + 2 * m12) / (m11 * m22 - m12 * m12)
        longest = min(longest, _STIFFNESS * slip / (2 * max(dry) * inverse))
    steps = math.ceil(duration / longest)
    return steps, duration / steps


def accelerations(motion: PivotMotion, steps: int, step_s: float) -> Float:
    """y'' at every half step, shape (2 steps + 1,) [m/s^2]."""
    return motion.acceleration(np.arange(2 * steps + 1, dtype=np.float64) * (step_s / 2))


def integrate(
    native: Native,
    pendulum: Pendulum,
    start: npt.ArrayLike,
    acceleration: Float,
    step_s: float,
    *,
    dry: tuple[float, float] = (0.0, 0.0),
    slip: float = 1.0,
    slant: float = 0.0,
) -> Float | None:
    """States phi1, phi1 + phi [rad] and their rates [rad/s] at every step, shape (steps + 1, 4).

    `start` is the first of them; `acceleration` as from `accelerations`. None when the motion runs away.
    """
    steps = (len(acceleration) - 1) // 2
    out = np.empty((steps + 1, 4))
    begin = np.ascontiguousarray(start, np.float64)
    headers = native.headers
    rig = headers.ffi.new("pvid_pendulum *")
    rig.l1, rig.l2, rig.rho2, rig.g = pendulum.l1, pendulum.l2, pendulum.rho2, pendulum.g
    rig.viscous, rig.dry = [pendulum.damping1, pendulum.damping2], list(dry)
    rig.slip, rig.slant = slip, slant
    pointers = map(headers.pointer, (begin, acceleration))
    written = native.library.pvid_pendulum_run(rig, *pointers, steps, step_s, _LIMIT, headers.pointer(out))
    return out if written == steps + 1 and bool(np.isfinite(out[-1]).all()) else None


def relative_angle(state: Float, step_s: float, t: Float) -> Float:
    """phi at the instants t [s], between the steps by their cubic (error 1e-8 of the amplitude)."""
    place = np.clip(t / step_s, 0.0, len(state) - 1.0)
    at = np.minimum(place.astype(np.int64), len(state) - 2)
    s = place - at
    phi = state[:, 1] - state[:, 0]
    rate = (state[:, 3] - state[:, 2]) * step_s
    rise = phi[at + 1] - phi[at]
    curved = (1 - s) * (rate[at] - rise) + s * (rise - rate[at + 1])
    return np.asarray(phi[at] + s * (rise + (1 - s) * curved))
