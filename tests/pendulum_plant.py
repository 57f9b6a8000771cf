"""A two-link pendulum on a driven pivot, integrated here and not by pvid, with the sensors of its rig.

The equations are those of theory.md 1, with sines (full) or for small angles (linear), per unit of the mass of body 2.
Angles of the state are absolute: phi1 and phi1 + phi.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt
from pendulum_run import Run
from scipy.integrate import solve_ivp

Float = npt.NDArray[np.float64]
Truth = Literal["linear", "full"]

SLIP = 1e-3  # rate over which a dry friction changes its sign [rad/s]


@dataclass(frozen=True)
class Pendulum:
    """Lengths [m], gravity in the plane [m/s^2]; per unit of body 2's mass the viscous torques of pivot and joint
    [m^2/s] and their dry ones [m^2/s^2]; the slide's slant [rad]. The last two are of the full equations alone."""

    l1: float
    l2: float
    rho2: float
    g: float
    damping1: float = 0.0
    damping2: float = 0.0
    dry1: float = 0.0
    dry2: float = 0.0
    slant: float = 0.0

    @property
    def linear(self) -> Float:
        """(w [1/s^2], d1, d2)."""
        ratio2 = (self.l2 / self.rho2) ** 2
        d2 = ratio2 * self.l1 / self.l2
        return np.array([self.g / self.l1, 1 + ratio2 + d2, d2])


@dataclass(frozen=True)
class Tone:
    """One sine of the pivot."""

    amplitude_m: float
    frequency_hz: float
    phase_rad: float = 0.0


@dataclass(frozen=True)
class Sensors:
    """Resolution [rad, m] and white noise before rounding [resolutions]; 0: exact.

    Attributes
    ----------
    phi_zero : reading at rest [rad]
    random_offset : the encoder's grid lies anywhere within half a resolution
    skew_s : the pivot is sampled so much later [s]
    """

    phi_lsb: float = 0.0
    phi_noise_lsb: float = 0.0
    phi_zero: float = 0.0
    random_offset: bool = False
    y_lsb: float = 0.0
    y_noise_lsb: float = 0.0
    skew_s: float = 0.0

    def measure(self, phi: Float, y: Float, seed: int) -> tuple[Float, Float]:
        """What is read of the true values [n]."""
        random = np.random.default_rng(seed)
        offset = random.uniform(-0.5, 0.5) * self.random_offset
        phi_noise, y_noise = (random.standard_normal(len(phi)) for _ in range(2))
        if self.phi_lsb > 0:
            phi = self.phi_lsb * (np.round(phi / self.phi_lsb + self.phi_noise_lsb * phi_noise + offset) - offset)
        if self.y_lsb > 0:
            y = self.y_lsb * np.round(y / self.y_lsb + self.y_noise_lsb * y_noise)
        return phi + self.phi_zero, y


STANDARD_PENDULUM = Pendulum(l1=0.3, l2=0.12, rho2=0.08, g=9.5)
STANDARD_DRIVE = (Tone(6e-3, 1.1, 0.3), Tone(5e-3, 2.3, 1.7), Tone(4e-3, 4.1, 4.0))
STANDARD_RELEASE = (0.06, 0.14)


def standard_sensors(bits: int = 14) -> Sensors:
    """An encoder of so many bits a turn, and a pivot sensor of 5 um."""
    return Sensors(2 * math.pi / 2**bits, 0.5, random_offset=True, y_lsb=5e-6, y_noise_lsb=0.4)


@dataclass(frozen=True, eq=False)
class Simulation:
    """What the sensors read, and the true state [n, 4]: angles and their rates."""

    run: Run
    state: Float


def simulate(
    pendulum: Pendulum = STANDARD_PENDULUM,
    drive: Sequence[Tone] = STANDARD_DRIVE,
    sensors: Sensors | None = None,
    sample_rate: float = 1000.0,
    duration: float = 40.0,
    release: tuple[float, float] = STANDARD_RELEASE,
    truth: Truth = "linear",
    seed: int = 0,
) -> Simulation:
    """A run from rest at the angles of the release [rad]; without arguments, of the standard rig of theory.md 6."""
    sensors = standard_sensors() if sensors is None else sensors
    tones = tuple(drive)
    t = np.arange(round(duration * sample_rate)) / sample_rate
    state = _motion(pendulum, tones, sample_rate, len(t), tuple(release), truth)
    y = sum((one.amplitude_m * np.sin(_phase(one, t + sensors.skew_s)) for one in tones), np.zeros(len(t)))
    phi, y = sensors.measure(state[:, 1] - state[:, 0], y, seed)
    return Simulation(Run(t=t, phi=phi, y=y, sample_rate=float(sample_rate)), state)


def _phase(one: Tone, t: Float) -> Float:
    return 2 * math.pi * one.frequency_hz * t + one.phase_rad


@lru_cache(maxsize=16)
def _motion(
    of: Pendulum, tones: tuple[Tone, ...], rate: float, n: int, release: tuple[float, ...], truth: Truth
) -> Float:
    """DOP853 to 1e-12 a step."""
    rates = [(2 * math.pi * one.frequency_hz, one.phase_rad, one.amplitude_m) for one in tones]
    m11, m22, l1, l2 = of.l1**2, of.l2**2 + of.rho2**2, of.l1, of.l2
    up, across = math.cos(of.slant), math.sin(of.slant)
    full = truth == "full"

    def slope(t: float, x: Float) -> tuple[float, float, float, float]:
        a1, a2, v1, v2 = x.tolist()
        along = -sum(size * w * w * math.sin(w * t + phase) for w, phase, size in rates)
        gravity = of.g + along * up
        joint, m12 = of.damping2 * (v2 - v1), l1 * l2
        if not full:
            torque1 = -gravity * l1 * a1 - of.damping1 * v1 + joint
            torque2 = -gravity * l2 * a2 - joint
        else:
            swing = m12 * math.sin(a1 - a2)
            m12 *= math.cos(a1 - a2)
            joint += of.dry2 * math.tanh((v2 - v1) / SLIP)
            first = of.damping1 * v1 + of.dry1 * math.tanh(v1 / SLIP)
            aside = along * across
            torque1 = -swing * v2 * v2 - l1 * (gravity * math.sin(a1) + aside * math.cos(a1)) - first + joint
            torque2 = swing * v1 * v1 - l2 * (gravity * math.sin(a2) + aside * math.cos(a2)) - joint
        det = m11 * m22 - m12 * m12
        return v1, v2, (m22 * torque1 - m12 * torque2) / det, (m11 * torque2 - m12 * torque1) / det

    times = np.arange(n) / rate
    given = {"method": "DOP853", "t_eval": times, "rtol": 1e-12, "atol": 1e-14}
    solution = solve_ivp(slope, (0.0, times[-1]), [*release, 0.0, 0.0], **given)
    state = np.ascontiguousarray(solution.y.T)
    state.setflags(write=False)
    return state
