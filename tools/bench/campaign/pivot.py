"""Motion of the pivot: sums of tones, or a swept sine, whose acceleration is exact at any instant."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

KINDS = ("tones1", "tones2", "tones3", "tones4", "chirp", "noise", "hand")

_NOISE_TONES = 40
_HAND_TONES = 12
_HAND_HZ = (0.7, 3.5)  # band of what an arm does
_SWEEP_S = 15.0  # a sweep goes up and down once in twice this


@dataclass(frozen=True, eq=False)
class PivotMotion:
    """Height of the pivot over time.

    Attributes
    ----------
    tones : ndarray, shape (n, 3)
        Amplitude [m], frequency [Hz], phase [rad] of each sine.
    sweep : (amplitude [m], lowest, highest [Hz], period [s], phase [rad]) or None
        A sine whose frequency goes up and down between the two, itself as a cosine of that period.
    """

    tones: Float
    sweep: tuple[float, float, float, float, float] | None = None

    @property
    def highest_hz(self) -> float:
        """Highest frequency in it."""
        sweep = 0.0 if self.sweep is None else self.sweep[2]
        return max(sweep, float(self.tones[:, 1].max(initial=0.0)))

    def scaled(self, factor: float) -> PivotMotion:
        """The same motion, larger."""
        sweep = None if self.sweep is None else (factor * self.sweep[0], *self.sweep[1:])
        return PivotMotion(self.tones * np.array([factor, 1.0, 1.0]), sweep)

    def position(self, t: Float) -> Float:
        """y at t [s], [m]."""
        y = np.zeros_like(t)
        for amplitude, hz, phase in self.tones:
            y += amplitude * np.sin(2 * math.pi * hz * t + phase)
        if self.sweep is not None:
            y += self.sweep[0] * np.sin(self._angle(t)[0])
        return y

    def acceleration(self, t: Float) -> Float:
        """y'' at t [s], [m/s^2]."""
        acceleration = np.zeros_like(t)
        for amplitude, hz, phase in self.tones:
            rate = 2 * math.pi * hz
            acceleration -= amplitude * rate * rate * np.sin(rate * t + phase)
        if self.sweep is not None:
            angle, rates, rise = self._angle(t)
            acceleration += self.sweep[0] * (rise * np.cos(angle) - rates**2 * np.sin(angle))
        return acceleration

    def _angle(self, t: Float) -> tuple[Float, Float, Float]:
        """Angle of the sweep's sine and its first two derivatives."""
        assert self.sweep is not None
        _, low, high, period, phase = self.sweep
        middle, half, slow = math.pi * (low + high), math.pi * (high - low), 2 * math.pi / period
        angle = middle * t - half / slow * np.sin(slow * t) + phase
        return angle, middle - half * np.cos(slow * t), half * slow * np.sin(slow * t)


def draw_motion(
    kind: str,
    modes_hz: tuple[float, float],
    random: np.random.Generator,
    travel: float,
    acceleration_rms: float,
    least_rms: float,
) -> PivotMotion | None:
    """A random drive of a kind, for a rig with these modes, of that rms acceleration [m/s^2].

    It is less where `travel` [m], from the lowest to the highest point, does not suffice; None when it would be less
    than `least_rms`.
    """
    low, high = 0.6 * modes_hz[0], 1.5 * modes_hz[1]
    phases = random.uniform(0, 2 * math.pi, _NOISE_TONES)
    sweep = None
    if kind.startswith("tones"):
        count = int(kind.removeprefix("tones"))
        hz = np.exp(random.uniform(math.log(low), math.log(high), count))
        # accelerations alike within a factor of 3
        sizes = np.exp(random.uniform(0.0, math.log(3.0), count)) / hz**2
    elif kind == "chirp":
        low, high = np.sort(np.exp(random.uniform(math.log(low), math.log(high), 2)))
        high = max(high, 1.5 * low)
        hz, sizes = np.zeros(0), np.zeros(0)
        sweep = (1.0, float(low), float(high), 2 * _SWEEP_S * float(random.uniform(0.5, 1.5)), float(phases[0]))
    elif kind == "noise":
        low = max(low, high / 8)  # what lies below takes travel and accelerates nothing
        hz = random.uniform(low, high, _NOISE_TONES)
        sizes = random.rayleigh(1.0, _NOISE_TONES) / hz**2
    else:
        hz = random.uniform(*_HAND_HZ, _HAND_TONES)
        sizes = random.rayleigh(1.0, _HAND_TONES) / hz**1.5
        # an arm rests now and then: each tone comes and goes as 1 + cos, three tones in place of one
        slow = random.uniform(0.03, 0.15, _HAND_TONES)
        hz = np.concatenate([hz, hz - slow, hz + slow])
        sizes = np.concatenate([sizes, sizes / 2, sizes / 2])
        phases = np.concatenate([phases[:_HAND_TONES]] * 3)
    motion = PivotMotion(np.column_stack([sizes, hz, phases[: len(hz)]]), sweep)
    t = np.arange(0.0, 60.0, 1 / (20 * motion.highest_hz))
    unscaled = float(np.sqrt(np.mean(motion.acceleration(t) ** 2)))
    factor = min(acceleration_rms / unscaled, travel / float(np.ptp(motion.position(t))))
    return motion.scaled(factor) if factor * unscaled >= least_rms else None
