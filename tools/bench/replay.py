"""A mechanism simulated under the inputs of a recorded run: what its parameters predict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording
from pvid.sim.plant import SHARP, Friction, Plant

Float = npt.NDArray[np.float64]

_FIRST = 11  # samples that a rate at the start is fitted to


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """A recorded input: straight between samples; a held one is read at the samples alone.

    Attributes
    ----------
    t : [s], shape (n,)
    recorded : [SI], shape (n,)
    """

    t: Float
    recorded: Float

    def values(self, t: npt.NDArray[Any], order: int = 0) -> Float:
        """Its derivative of order 0 or 1 at the times t; see `pvid.models.drive.Drive`."""
        if order == 0:
            return np.asarray(np.interp(t, self.t, self.recorded), dtype=np.float64)
        assert order == 1, "a recorded input has no second derivative"
        slopes = np.diff(self.recorded) / np.diff(self.t)
        at = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(slopes) - 1)
        return np.asarray(slopes[at])


@dataclass(frozen=True)
class Match:
    """How well a simulated signal follows the recorded one.

    Attributes
    ----------
    r2 : 1 - squared error over the squared deviation from the mean
    rms : of the error [SI]
    """

    r2: float
    rms: float

    @classmethod
    def of(cls, recorded: Float, simulated: Float) -> Match:
        error = recorded - simulated
        spread = float(np.sum((recorded - recorded.mean()) ** 2))
        return cls(1.0 - float(np.sum(error**2)) / spread, float(np.sqrt(np.mean(error**2))))


class Replay:
    """The plant of a model under the inputs of one recorded run."""

    def __init__(self, model: CompiledModel, run: Recording, *, substeps: int = 4, friction: Friction = SHARP) -> None:
        self.model, self.run = model, run
        self.plant = Plant(model)
        self.substeps, self.friction = substeps, friction
        self.drives = {one.name: RecordedDrive(run.t, run.signals[one.name]) for one in model.signals if one.driven}
        self.measured = tuple(one.name for one in model.signals if not one.driven)

    def start(self) -> Float:
        """The state at the first sample: a parabola through the first samples of each sensor; the rest is 0."""
        values: dict[str, float] = {}
        states = {str(one) for one in self.plant.motion.states}
        for name in self.measured:
            t, y = self.run.t[:_FIRST] - self.run.t[0], self.run.signals[name][:_FIRST]
            fitted = np.polynomial.Polynomial.fit(t, y, 2).convert().coef
            values |= {name: float(fitted[0]), f"{name}_1": float(fitted[1])}
        return self.plant.start({name: value for name, value in values.items() if name in states})

    def simulated(self, p: Float, start: Float | None = None) -> Mapping[str, Float]:
        """Every sensor at the samples [SI], each [n]; from `start`, else from `self.start()`."""
        begun = self.start() if start is None else start
        motion = self.plant.driven(
            self.plant.constants(p),
            begun,
            self.drives,
            self.run.sample_rate,
            len(self.run),
            substeps=self.substeps,
            friction=self.friction,
        )
        return {name: motion[name] for name in self.measured}

    def matches(self, p: Float) -> dict[str, Match]:
        """Each sensor, recorded against simulated."""
        return {name: Match.of(self.run.signals[name], values) for name, values in self.simulated(p).items()}
