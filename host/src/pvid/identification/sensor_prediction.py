"""How well the samples of a sensor are predicted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pvid.base.rounding import part_of_one, percent
from pvid.base.wording import with_unit

_MOST_TIMES = 10_000  # what is beyond has no digits
_RUNS_AWAY = 1000.0  # times the motion


@dataclass(frozen=True)
class SensorPrediction:
    """Residual of a sensor: measured less simulated samples.

    Attributes
    ----------
    rms : of measured less simulated [unit]
    of_motion : over the rms of the motion within a block
    of_noise : over the standard deviation of a sample; None where the model gives none
    r2 : 1 - of_motion^2
    """

    name: str
    unit: str
    rms: float
    of_motion: float
    of_noise: float | None

    @property
    def r2(self) -> float:
        """Part of the motion that is predicted."""
        return 1.0 - self.of_motion**2

    @property
    def times_noise(self) -> str:
        """The difference over the noise; "": the noise is not known."""
        if self.of_noise is None:
            return ""
        if not self.of_noise < _MOST_TIMES:
            return f"more than {_MOST_TIMES}"
        return f"{self.of_noise:.2g}" if self.of_noise < 100 else f"{self.of_noise:.0f}"

    def __str__(self) -> str:
        if not self.of_motion < _RUNS_AWAY:
            return f"{self.name} not at all (the simulated motion leaves the measured one without bounds)"
        noise = f", {self.times_noise} times the sensor's noise" if self.times_noise else ""
        rms = with_unit(self.rms, self.unit, 2)
        return (
            f"{self.name} to {percent(self.of_motion)} of its motion (rms {rms}{noise}; R^2 {part_of_one(self.r2, 5)})"
        )

    def as_json(self) -> dict[str, Any]:
        """Its entry in a JSON object."""
        return {
            "rms": self.rms,
            "unit": self.unit,
            "of_motion": self.of_motion,
            "of_noise": self.of_noise,
            "r2": self.r2,
        }
