"""Rigs for the tests of the campaign: the standard rig as a campaign draws one, without imperfections."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bench.campaign.motion import accelerations, integrate, step_of
from bench.campaign.pivot import PivotMotion
from bench.campaign.population import RandomRig, modes_hz
from pvid.core.native import Native
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_PENDULUM

Float = npt.NDArray[np.float64]

MOTION = PivotMotion(np.array([[tone.amplitude_m, tone.frequency_hz, tone.phase_rad] for tone in STANDARD_DRIVE]))
RELEASE = (0.06, 0.14)

RIG = RandomRig(
    seed=3,
    index=0,
    attempt=0,
    condition="clean",
    combined=("clean",),
    pendulum=STANDARD_PENDULUM,
    motion=MOTION,
    drive="tones3",
    sample_rate=1000.0,
    duration=10.0,
    bits=14,
    phi_noise=0.5,
    zero=0.0,
    y_lsb=5e-6,
    y_noise=0.4,
    angle=0.14,
    angle_range=(0.01, 0.2),
    release=(math.cos(1.0), math.sin(1.0)),
    guess_l2=0.1,
    guess_rho2=0.1,
    dry=(0.0, 0.0),
    skew=0.0,
    jitter=0.0,
    gain=0.0,
    backlash=0.0,
    hysteresis=0.0,
    eccentricity=0.0,
    eccentric_at=0.0,
    slant=0.0,
)


def standard_motion(native: Native, duration: float, scale: float = 1.0) -> tuple[Float, Float, float]:
    """States of the standard rig, full equations, its accelerations and the step [s]."""
    steps, step_s = step_of(STANDARD_PENDULUM, modes_hz(STANDARD_PENDULUM)[1], MOTION, (0.0, 0.0), 1.0, duration)
    acceleration = accelerations(MOTION, steps, step_s)
    state = integrate(native, STANDARD_PENDULUM, [scale * RELEASE[0], scale * RELEASE[1], 0, 0], acceleration, step_s)
    assert state is not None
    return state, acceleration, step_s
