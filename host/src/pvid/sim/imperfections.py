"""What real rigs have and models do not, as options of a simulated run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.wording import listed, shown

Float = npt.NDArray[np.float64]
Law = Literal["soft", "sharp"]

_KINDS = ("backlash", "eccentricity", "skew", "gain")  # with a size by signal
_NOTHING: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True)
class Imperfections:
    """Numbers are by name of the signal.

    Attributes
    ----------
    friction : "sharp": the sign of a friction switches, and it sticks where it exceeds the other forces; "soft": the
        sign is tanh(v / width) with the rig's width
    breakaway : sharp: the friction that holds at rest over the one that slides, >= 1 (stiction)
    backlash : width of the play between what turns and its sensor [resolutions]
    eccentricity : amplitude of an encoder's error that comes back every turn [resolutions]
    skew : delay of a sensor's sample behind those of the others [s]; a multiple of the integration's step
    gain : what acts over what is recorded, of a driven signal; what is recorded over what is true, of another sensor
    process : white disturbance of an equation by its number from 0 [its unit / sqrt(Hz)], held for a sample
    """

    friction: Law = "sharp"
    breakaway: float = 1.0
    backlash: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    eccentricity: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    skew: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    gain: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    process: Mapping[int, float] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        if self.friction not in ("soft", "sharp"):
            raise PvidError(f"friction is soft or sharp, not {self.friction}")
        if self.breakaway != 1.0 and self.friction != "sharp":
            raise PvidError("stiction (a breakaway other than 1) needs a sharp friction")

    @property
    def key(self) -> tuple[object, ...]:
        """What the motion depends on, for a cache."""
        return (self.friction, self.breakaway, *(tuple(sorted(one.items())) for one in (self.gain, self.process)))


def sizes_of(settings: Iterable[str]) -> dict[str, Any]:
    """Fields of Imperfections from KIND.SIGNAL=SIZE, as in skew.phi=1e-3. Raises PvidError where one is not."""
    out: dict[str, dict[str, float]] = {}
    for setting in settings:
        place, _, size = setting.partition("=")
        kind, _, signal = place.strip().partition(".")
        if kind not in _KINDS or not signal:
            raise PvidError(f"{shown(setting)} is not KIND.SIGNAL=SIZE with a KIND of {listed(_KINDS)}")
        try:
            out.setdefault(kind, {})[signal] = float(size)
        except ValueError as error:
            raise PvidError(f"{shown(setting)}: {shown(size)} is no number") from error
    return out


def with_play(values: Float, width: float) -> Float:
    """What a sensor behind a play shows [n]: it stays until one of the flanks, `width` apart, moves it."""
    half = width / 2.0
    at, out = float(values[0]), []
    for low, high in zip((values - half).tolist(), (values + half).tolist(), strict=True):
        if at < low:
            at = low
        elif at > high:
            at = high
        out.append(at)
    return np.array(out)


def eccentric(values: Float, amplitude: float, phase: float) -> Float:
    """What an encoder [n, rad] shows whose disc turns about a point beside its centre."""
    return values + amplitude * np.sin(values + phase)


def disturbance(process: Mapping[int, float], equations: int, samples: int, rate: float, seed: int) -> Float | None:
    """White noise of these densities [unit / sqrt(Hz)], [samples, equations]; None where there is none."""
    if not process:
        return None
    rng = np.random.default_rng([seed, 1])
    out = np.zeros((samples, equations))
    for place, density in process.items():
        if not 0 <= place < equations:
            raise PvidError(f"there is no equation {place}: they are 0 to {equations - 1}")
        out[:, place] = density * math.sqrt(rate / 2.0) * rng.standard_normal(samples)
    return out
