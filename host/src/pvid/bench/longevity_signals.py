"""Samples of the longevity bench: a rig that runs well, then does not, then does again, for any number of ticks.

A run has three parts: the standard drive (a fifth of it), the disturbance (two fifths), the standard drive again.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.rig import STANDARD_DRIVE, STANDARD_PENDULUM

Float = npt.NDArray[np.float64]

RATE_HZ = 1000.0
L1 = 0.3
CHUNK = 20_000  # ticks made at a time
RELEASE = (0.06, 0.08, 0.0, 0.0)  # phi1, phi [rad], and their rates
BEFORE, AFTER = 0.2, 0.6  # parts of the run at which the disturbance begins and ends
CHANGE = 1.2  # of w, where it steps or drifts
STILL = 0.03  # rad, the angle of a mechanism that does not move
SATURATION = 0.05  # rad
WRAP = 0.05  # rad from rest to where the encoder's turn ends
SWITCH_S, RAMP_S = 7.0, 0.5

SCENARIOS = {
    "perfect": "the standard drive all the time",
    "absent": "no drive, no motion",
    "constant": "no drive, no motion, sensors without noise",
    "one tone": "the first of the three tones alone",
    "switching": "the drive on and off every 7 s",
    "stuck sensor": "the encoder keeps its last reading",
    "saturated sensor": "the encoder ends at 0.05 rad",
    "outliers": "1 % of the angles off by 100 sigma",
    "dropped samples": "up to 20 samples missing every 5 s, told as no number",
    "slipping clock": "a sample twice, or left out, every second",
    "sensor wrap": "the encoder's turn ends 0.05 rad from rest",
    "step": "w larger by 20 % from then on",
    "drift": "w becomes larger by 20 %",
}


@dataclass(frozen=True)
class Sensing:
    """What the sensors make of the motion.

    Attributes
    ----------
    phi_lsb : of the encoder [rad]; 0: exact
    y_lsb : of the pivot's sensor [m]; 0: exact
    zero : what the encoder reads at rest [rad]
    """

    phi_lsb: float = 2 * np.pi / 2**14
    y_lsb: float = 5e-6
    zero: float = 0.01

    @property
    def sigma(self) -> float:
        """Noise of the encoder [rad]: its rounding and half an LSB."""
        return max(self.phi_lsb, 2 * np.pi / 2**20) * float(np.sqrt(1 / 12 + 1 / 4))


@dataclass
class Signals:
    """The samples of one scenario, in chunks; the same seed gives the same samples.

    `library` holds longevity_motion of tests/longevity.
    """

    library: ctypes.CDLL
    scenario: str
    ticks: int
    sensing: Sensing
    seed: int = 1

    def __post_init__(self) -> None:
        self.first = int(BEFORE * self.ticks)
        self.last = int(AFTER * self.ticks)

    def chunks(self) -> Iterator[tuple[Float, Float]]:
        """phi [rad] and y [m] of the next ticks; NaN where a sample is missing."""
        random = np.random.default_rng(self.seed)
        state = np.array(RELEASE)
        held = 0.0
        for start in range(0, self.ticks, CHUNK):
            n = min(CHUNK, self.ticks - start)
            tick = start + np.arange(n)
            disturbed = (tick >= self.first) & (tick < self.last)
            motion, height = self._motion(state, tick)
            if self.scenario in ("absent", "constant"):
                motion, height = np.where(disturbed, STILL, motion), np.where(disturbed, 0.0, height)
            quiet = disturbed & (self.scenario == "constant")
            phi = _sensed(motion + self.sensing.zero, self.sensing.phi_lsb, 0.5, quiet, random)
            y = _sensed(height, self.sensing.y_lsb, 0.4, quiet, random)
            if start <= self.first < start + n:
                held = phi[self.first - start]
            yield self._spoilt(phi, y, disturbed, held, random)

    def w(self, part: float) -> float:
        """The truth at this part of the run [1/s^2]."""
        return float(self._w(np.array([part * self.ticks]))[0])

    def _w(self, tick: npt.NDArray[np.int64] | Float) -> Float:
        w = float(STANDARD_PENDULUM.linear[0])
        if self.scenario == "step":
            return np.where(tick >= self.first, CHANGE * w, w)
        if self.scenario == "drift":
            part = np.clip((tick - self.first) / (self.last - self.first), 0.0, 1.0)
            return np.asarray(w * (1 + (CHANGE - 1) * part))
        return np.full(len(tick), w)

    def _motion(self, state: Float, tick: npt.NDArray[np.int64]) -> tuple[Float, Float]:
        """Moves `state` on; phi and y at the ticks."""
        half = np.arange(2 * len(tick) + 1) / 2 + tick[0]
        y, u = self._drive(half)
        phi, w = np.empty(len(tick)), self._w(tick)
        p = np.ascontiguousarray(STANDARD_PENDULUM.linear[1:3])
        arrays = [ctypes.c_void_p(a.ctypes.data) for a in (state, p, w, u, phi)]
        self.library.longevity_motion(arrays[0], ctypes.c_uint32(len(tick)), ctypes.c_double(1 / RATE_HZ), *arrays[1:])
        return phi, y[:-1:2]

    def _drive(self, tick: Float) -> tuple[Float, Float]:
        """y [m] and u = y''/l1 [1/s^2] at fractions of ticks."""
        t = tick / RATE_HZ
        disturbed = (tick >= self.first) & (tick < self.last)
        sums = np.zeros((3, len(t)))  # y, y', y''
        for number, tone in enumerate(STANDARD_DRIVE):
            omega = 2 * np.pi * tone.frequency_hz
            on = ~disturbed | (number == 0) | (self.scenario != "one tone")
            sine, cosine = (tone.amplitude_m * f(omega * t + tone.phase_rad) * on for f in (np.sin, np.cos))
            sums += np.stack([sine, omega * cosine, -(omega**2) * sine])
        if self.scenario == "switching":
            e = np.where(disturbed, np.stack(_envelope(t - self.first / RATE_HZ)), np.array([[1.0], [0.0], [0.0]]))
            y, y1, y2 = sums
            return e[0] * y, (e[2] * y + 2 * e[1] * y1 + e[0] * y2) / L1
        return sums[0], sums[2] / L1

    def _spoilt(
        self, phi: Float, y: Float, disturbed: npt.NDArray[np.bool_], held: float, random: np.random.Generator
    ) -> tuple[Float, Float]:
        """What becomes of the readings while they are disturbed."""
        rest = self.sensing.zero
        n = len(phi)
        if self.scenario == "stuck sensor":
            phi = np.where(disturbed, held, phi)
        elif self.scenario == "saturated sensor":
            phi = np.where(disturbed, np.clip(phi, rest - SATURATION, rest + SATURATION), phi)
        elif self.scenario == "outliers":
            hit = disturbed & (random.random(n) < 0.01)
            phi = phi + hit * random.choice([-100.0, 100.0], n) * self.sensing.sigma
        elif self.scenario == "dropped samples":
            begin = random.random(n) < 1 / (5 * RATE_HZ)
            lost = np.convolve(begin, np.ones(random.integers(1, 21)))[:n] > 0
            phi, y = (np.where(disturbed & lost, np.nan, x) for x in (phi, y))
        elif self.scenario == "slipping clock":
            at = np.arange(n)
            behind = (at // int(RATE_HZ)) % 2  # one sample behind in every other second
            phi, y = (np.where(disturbed, x[np.maximum(at - behind, 0)], x) for x in (phi, y))
        elif self.scenario == "sensor wrap":
            phi = np.where(disturbed & (phi - rest > WRAP), phi - 2 * np.pi, phi)
        return phi, y


def _envelope(t: Float) -> tuple[Float, Float, Float]:
    """On and off with ramps of a polynomial that is smooth to its third derivative, and its first two derivatives."""
    place = np.mod(t, 2 * SWITCH_S)
    down = np.clip(place / RAMP_S, 0.0, 1.0)
    up = np.clip((place - SWITCH_S) / RAMP_S, 0.0, 1.0)
    steps: tuple[Callable[[Float], Float], ...] = (
        lambda x: x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3),
        lambda x: 140 * x**3 * (1 - x) ** 3 / RAMP_S,
        lambda x: 420 * x**2 * (1 - x) ** 2 * (1 - 2 * x) / RAMP_S**2,
    )
    return (1 - steps[0](down) + steps[0](up), steps[1](up) - steps[1](down), steps[2](up) - steps[2](down))


def _sensed(x: Float, lsb: float, noise_lsb: float, quiet: npt.NDArray[np.bool_], random: np.random.Generator) -> Float:
    if lsb <= 0.0:
        return x
    noise = np.where(quiet, 0.0, noise_lsb * lsb * random.standard_normal(len(x)))
    return np.rint((x + noise) / lsb) * lsb
