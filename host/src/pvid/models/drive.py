"""Drives of simulated rigs: what an input does over time, in SI, with exact derivatives where it has any."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError

Float = npt.NDArray[np.float64]
Times = npt.NDArray[Any]  # of floats [n, s]

_EDGE = 1e-9  # of a hold: an edge at t belongs to t, whatever t's last bits are


class Drive(Protocol):
    """A function of time."""

    def values(self, t: Times, order: int = 0) -> Float:
        """Its derivative of this order at the times t [n, s], shape (n,)."""


@dataclass(frozen=True)
class Sines:
    """A sum of sines about an offset.

    Attributes
    ----------
    tones : (amplitude [SI], frequency [Hz], phase [rad]) of each
    offset : [SI]
    """

    tones: tuple[tuple[float, float, float], ...]
    offset: float = 0.0

    def values(self, t: Times, order: int = 0) -> Float:
        """Derivative of this order."""
        total = np.full(np.shape(t), self.offset if order == 0 else 0.0)
        for amplitude, hz, phase in self.tones:
            rate = 2.0 * math.pi * hz
            total += amplitude * rate**order * np.sin(rate * t + phase + order * math.pi / 2.0)
        return total


@dataclass(frozen=True)
class Chirp:
    """A sine whose frequency rises evenly, and falls again after `period_s`, and so on.

    Attributes
    ----------
    amplitude : [SI]
    low_hz, high_hz : lowest and highest frequency [Hz]
    period_s : time from the one to the other [s]
    """

    amplitude: float
    low_hz: float
    high_hz: float
    period_s: float

    def values(self, t: Times, order: int = 0) -> Float:
        """Values."""
        _refuse_derivative("a chirp", order)
        legs, rest = np.divmod(t, self.period_s)
        slope = (self.high_hz - self.low_hz) / self.period_s
        up = self.low_hz * rest + slope * rest**2 / 2.0
        down = self.high_hz * rest - slope * rest**2 / 2.0
        whole = (self.low_hz + self.high_hz) / 2.0 * self.period_s
        cycles = legs * whole + np.where(legs % 2 == 0, up, down)
        return np.asarray(self.amplitude * np.sin(2.0 * math.pi * cycles), dtype=np.float64)


@dataclass(frozen=True)
class RandomSteps:
    """A value that jumps at even intervals: two levels at random (a PRBS), or normally distributed ones.

    Attributes
    ----------
    amplitude : level, or standard deviation of the levels [SI]
    hold_s : time between jumps [s]
    seed : of the levels
    normal : normally distributed levels
    delay_s : time of the first jump [s]
    """

    amplitude: float
    hold_s: float
    seed: int
    normal: bool = False
    delay_s: float = 0.0

    def values(self, t: Times, order: int = 0) -> Float:
        """Values."""
        _refuse_derivative("a sequence of steps", order)
        at = np.floor((t - self.delay_s) / self.hold_s + _EDGE).astype(np.int64) + 1
        rng = np.random.default_rng(self.seed)
        many = int(at.max(initial=0)) + 1
        levels = rng.standard_normal(many) if self.normal else rng.choice([-1.0, 1.0], many)
        return self.amplitude * levels[np.maximum(at, 0)]


@dataclass(frozen=True)
class Steps:
    """Given levels, one after the other, and over again.

    Attributes
    ----------
    levels : [SI]
    hold_s : length of each [s]
    """

    levels: tuple[float, ...]
    hold_s: float

    def values(self, t: Times, order: int = 0) -> Float:
        """Values."""
        _refuse_derivative("a sequence of steps", order)
        at = np.floor(t / self.hold_s + _EDGE).astype(np.int64)
        return np.array(self.levels)[at % len(self.levels)]


@dataclass(frozen=True)
class Sum:
    """The sum of drives."""

    parts: tuple[Drive, ...]

    def values(self, t: Times, order: int = 0) -> Float:
        """Derivative of this order."""
        return np.asarray(np.sum([part.values(t, order) for part in self.parts], axis=0))


@dataclass(frozen=True)
class Scaled:
    """A drive that is `gain` times as large and `faster` times as fast."""

    drive: Drive
    gain: float
    faster: float

    def values(self, t: Times, order: int = 0) -> Float:
        """Derivative of this order."""
        return self.gain * self.faster**order * self.drive.values(self.faster * np.asarray(t), order)


def _refuse_derivative(what: str, order: int) -> None:
    if order:
        has_none = f"the equations need derivative {order} of a driven signal, and {what} has none"
        raise PvidError(f'{has_none}: take the drive "two sines"')
