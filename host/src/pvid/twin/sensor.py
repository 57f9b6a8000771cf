"""The simulated sensor of firmware/apps/stream/sensor.c: the rig of a board without sensors in field mode.

The standard rig's pendulum (theory.md 1, linear) on a pivot that moves in its three tones, integrated in float32
by steps whose only operations are + - *, so that every machine gets the same counts. A tone and the pendulum are
advanced alike: velocity by the acceleration here and now, then position by that velocity (leapfrog), which neither
gains nor loses energy over any length of run. Velocities are per step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.design.c_tables import float_literal
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_PENDULUM, STANDARD_RELEASE

# Steps a second at least: the leapfrog's error in the fastest motion, 25 rad/s, is 3e-5 of its frequency.
_STEPS_A_SECOND = 1000.0

_SEED = 2463534242
_NOISE_DRAWS = 3  # of one LSB's width each: 0.5 LSB standard deviation together


@dataclass(frozen=True)
class SensorConstants:
    """Constants of sensor.c by its names: float32, `steps` an int. tones: (position [m], velocity [m/step],
    stiffness [1/step^2], share of u [1/(m s^2)]) each."""

    steps: int
    step_squared: np.float32  # [s^2]
    w: np.float32
    ratio2: np.float32  # (l2 / rho2)^2
    coupling: np.float32  # ratio2 (1 + l1 / l2)
    phi1: np.float32  # release [rad]
    phi: np.float32
    counts_per_rad: np.float32
    counts_per_m: np.float32
    tones: tuple[tuple[np.float32, np.float32, np.float32, np.float32], ...]

    @classmethod
    def standard(cls, l1: float, sample_rate: float, phi_lsb: float, y_lsb: float) -> SensorConstants:
        """The standard pendulum on a rod of l1 [m], read by sensors with these resolutions [rad], [m]."""
        pendulum = STANDARD_PENDULUM
        steps = math.ceil(_STEPS_A_SECOND / sample_rate)
        step = 1.0 / (sample_rate * steps)
        ratio2 = (pendulum.l2 / pendulum.rho2) ** 2
        f = np.float32
        tones = []
        for tone in STANDARD_DRIVE:
            rate = 2 * math.pi * tone.frequency_hz
            before = tone.phase_rad - rate * step
            position = tone.amplitude_m * math.sin(tone.phase_rad)
            velocity = position - tone.amplitude_m * math.sin(before)
            stiffness = (2 * math.sin(rate * step / 2)) ** 2
            tones.append((f(position), f(velocity), f(stiffness), f(-(rate**2) / l1)))
        release1, release2 = STANDARD_RELEASE
        return cls(
            steps=steps,
            step_squared=f(step**2),
            w=f(pendulum.g / l1),
            ratio2=f(ratio2),
            coupling=f(ratio2 * (1 + l1 / pendulum.l2)),
            phi1=f(release1),
            phi=f(release2 - release1),
            counts_per_rad=f(1 / phi_lsb),
            counts_per_m=f(1 / y_lsb),
            tones=tuple(tones),
        )

    @property
    def c_initializer(self) -> str:
        """Of sensor.c's `sensor_constants`."""
        tones = ", ".join("{" + ", ".join(float_literal(value) for value in tone) + "}" for tone in self.tones)
        names = ("step_squared", "w", "ratio2", "coupling", "phi1", "phi", "counts_per_rad", "counts_per_m")
        numbers = ", ".join(f".{name} = {float_literal(getattr(self, name))}" for name in names)
        return f"{{.steps = {self.steps}u, {numbers}, .tones = {{{tones}}}}}"


def counts(constants: SensorConstants, n: int) -> npt.NDArray[np.int32]:
    """The first n samples [n, 2]: counts of phi and y. Cost: 20 us a step."""
    f = np.float32
    c = constants
    phi1, phi, velocity1, velocity = c.phi1, c.phi, f(0), f(0)
    tones = [list(tone) for tone in c.tones]
    seed = _SEED
    out = np.empty((n, 2), np.int32)

    def read(value: np.float32, per_unit: np.float32) -> int:
        nonlocal seed
        noise = 0
        for _ in range(_NOISE_DRAWS):
            seed = (seed * 1664525 + 1013904223) % 2**32
            noise += (seed >> 16) - 32768
        return math.floor(f(value * per_unit + f(noise) * f(1 / 65536)) + f(0.5))

    for tick in range(n):
        y = f(0)
        for tone in tones:
            y = y + tone[0]
        out[tick] = read(phi, c.counts_per_rad), read(y, c.counts_per_m)
        for _ in range(c.steps):
            gain = c.w
            for tone in tones:
                gain = gain + tone[3] * tone[0]
            gain = gain * c.step_squared
            velocity1 = velocity1 + gain * (c.ratio2 * phi - phi1)
            velocity = velocity + gain * (phi1 - c.coupling * phi)
            phi1 = phi1 + velocity1
            phi = phi + velocity
            for tone in tones:
                tone[1] = tone[1] - tone[2] * tone[0]
                tone[0] = tone[0] + tone[1]
    return out
