"""The runs that the refinement is measured on, and the Cramer-Rao bound of their parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from bench.campaign.motion import integrate
from pvid.core.native import Native
from pvid.models.kapitza.refinement import sample_sd
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Drive,
    Pendulum,
    Sensors,
    simulate,
    standard_sensors,
)

Float = npt.NDArray[np.float64]

RATE_HZ = 1000.0
L1 = STANDARD_PENDULUM.l1
TRUTH = STANDARD_PENDULUM.linear
# Of the standard release: the largest angles are those of the table.
RELEASE = {0.1: 1.0, 0.2: 1.88, 0.3: 2.85}
_STEPS = np.array([1e-6] * 3 + [1e-5] * 2 + [1.0, 1e-6] + [1e-6] * 2)  # of log w, .., start, for the bound
# Tones of an unknown drive: up to the end of the pass band of the refinement's filter; their common period is a little
# longer than the run, so that the drive may differ at its two ends.
_BAND_HZ, _LONGER = 8.0, 1.05
_TONE_STEP = 1e-7  # [m], of a central difference
_EVERY = 8  # samples of the rows: the angle has nothing above some Hz


@dataclass(frozen=True)
class Case:
    """The standard rig, full equations, 40 s, starts of the weak form within +-50 %."""

    angle: float
    bits: int
    damping: tuple[float, float] = (0.0, 0.0)  # [m^2/s]
    skew_s: float = 0.0
    duration: float = 40.0
    exact_drive: bool = False

    @property
    def label(self) -> str:
        """What is added to the standard rig."""
        friction = f"friction {self.damping[0]:g}, {self.damping[1]:g} m^2/s" if any(self.damping) else ""
        skew = f"skew {1e3 * self.skew_s:g} ms" if self.skew_s else ""
        drive = "exact drive" if self.exact_drive else ""
        return ", ".join(one for one in (friction, skew, drive) if one) or "standard"

    @property
    def motion(self) -> Case:
        """The same for all sensors."""
        return Case(self.angle, 0, self.damping, duration=self.duration)


_FRICTION = (0.002, 0.0005)
CASES = (
    *(Case(angle, bits) for angle in RELEASE for bits in (12, 14, 16)),
    *(Case(angle, 14, _FRICTION) for angle in RELEASE),
    *(Case(angle, 14, skew_s=0.001) for angle in RELEASE),
    Case(0.2, 14, _FRICTION, 0.001),
    Case(0.2, 16, _FRICTION, 0.001),
    Case(0.2, 16, exact_drive=True),
    Case(0.3, 16, exact_drive=True),
)


def _angle(case: Case, change: Float) -> Float:
    """The exact angle with changes of (log w, log d1, log d2, k1, k2, -, offset, angles of the start)."""
    scale = RELEASE[case.angle]
    pendulum = replace(
        Pendulum.from_linear(TRUTH * np.exp(change[:3]), L1),
        damping1=case.damping[0] + change[3] * L1**2,
        damping2=case.damping[1] + change[4] * L1**2,
    )
    release = (STANDARD_RELEASE[0] * scale + change[7], STANDARD_RELEASE[1] * scale + change[8])
    state = simulate(pendulum, sensors=Sensors(), truth="full", release=release, duration=case.duration).state
    return np.asarray(state[:, 1] - state[:, 0] + change[6])


@lru_cache(4)
def _slopes(case: Case) -> Float:
    """Derivatives of the angle with respect to what `_angle` changes, [samples, 9]."""
    exact = _angle(case, np.zeros(len(_STEPS)))
    columns = [
        (_angle(case, step * unit) - exact) / step for step, unit in zip(_STEPS, np.eye(len(_STEPS)), strict=True)
    ]
    columns[5] = np.gradient(exact, 1 / RATE_HZ)
    return np.stack(columns, axis=1)


@lru_cache(1)
def _drive_slopes(case: Case) -> tuple[Float, Float]:
    """Of the angle and of y with respect to the amplitudes of the drive's tones, [samples / 8, tones]."""
    native, step = Native(), 1 / RATE_HZ
    pendulum = replace(STANDARD_PENDULUM, damping1=case.damping[0], damping2=case.damping[1])
    start = [*(RELEASE[case.angle] * np.array(STANDARD_RELEASE)), 0.0, 0.0]
    samples = round(case.duration * RATE_HZ)
    t = np.arange(2 * samples - 1, dtype=np.float64) * (step / 2)
    known = Drive(STANDARD_DRIVE).derivatives(t)[:, 2]
    angles, heights = [], []
    for number in range(1, int(_BAND_HZ * _LONGER * case.duration) + 1):
        omega = 2 * np.pi * number / (_LONGER * case.duration)
        for tone in (np.cos(omega * t), np.sin(omega * t)):
            ends = []
            for sign in (1.0, -1.0):
                acceleration = known - sign * _TONE_STEP * omega**2 * tone
                state = integrate(native, pendulum, start, acceleration, step)
                if state is None:
                    raise ValueError("the standard rig runs away")
                ends.append((state[:, 1] - state[:, 0])[::_EVERY])
            angles.append((ends[0] - ends[1]) / (2 * _TONE_STEP))
            heights.append(tone[:: 2 * _EVERY])
    return np.stack(angles, axis=1), np.stack(heights, axis=1)


def bound_of(case: Case, since_s: float = 0.0, until_s: float | None = None) -> Float:
    """Relative standard deviations of w, d1, d2 [3]: all that the refinement estimates is unknown, the drive is known.

    The start's rates are left out; that of the skew is the angle's own rate. Samples before `since_s`, and those from
    `until_s` on, are not used.
    """
    jacobian = _slopes(case.motion)[_between(since_s, until_s)]
    covariance = np.linalg.inv(jacobian.T @ jacobian) * sample_sd(case.bits) ** 2
    return np.sqrt(np.diag(covariance)[:3])


def bound_of_measured(case: Case, since_s: float = 0.0, until_s: float | None = None) -> Float:
    """The same for a drive that is given by the readings of its sensor, and by its band, alone."""
    if case.exact_drive:
        return bound_of(case, since_s, until_s)
    sensors = standard_sensors(case.bits)
    variance = sample_sd(case.bits) ** 2 / _EVERY
    of_y = sensors.y_lsb**2 * (1 / 12 + sensors.y_noise_lsb**2) / _EVERY
    rows = _between(since_s, until_s, _EVERY)
    angle, height = _drive_slopes(case.motion)
    jacobian, angle, height = _slopes(case.motion)[::_EVERY][rows], angle[rows], height[rows]
    # Schur complement: the amplitudes of the drive's tones are eliminated
    drive = angle.T @ angle / variance + height.T @ height / of_y
    both = angle.T @ jacobian / variance
    scale = np.diag(drive) ** -0.5
    scaled = scale[:, None] * both
    information = jacobian.T @ jacobian / variance
    information -= scaled.T @ np.linalg.lstsq(scale[:, None] * drive * scale, scaled, rcond=1e-13)[0]
    return np.sqrt(np.diag(np.linalg.inv(information))[:3])


def _between(since_s: float, until_s: float | None, every: int = 1) -> slice:
    first, last = (None if t is None else round(t * RATE_HZ) // every for t in (since_s, until_s))
    return slice(first, last)
