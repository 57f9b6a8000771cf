"""How well an answer predicts a recording that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvid.base.errors import PvidError
from pvid.base.rounding import percent
from pvid.base.wording import with_unit
from pvid.rig.run import Recording
from pvid.run.mechanism import MechanismAnswer
from pvid.run.refined_mechanism import simulated_on

_WINDOWS = 4  # of a block: two of a short design predict alike whatever the parameters are
_LEAST = 30  # samples of a block
_BLOCKS = 6  # at least


@dataclass(frozen=True)
class Predicted:
    """A sensor's signal, simulated with an answer.

    Attributes
    ----------
    sensor, unit : as described
    rms : of measured less simulated samples [unit]
    noise : standard deviation of the sensor [unit]
    r2 : part of the signal's variance that the simulation explains
    """

    sensor: str
    unit: str
    rms: float
    noise: float
    r2: float

    @property
    def text(self) -> str:
        """A clause."""
        times = f", {self.rms / self.noise:.2g} times the sensor's noise" if self.noise else ""
        return (
            f"{self.sensor} is predicted to {percent(np.sqrt(max(1 - self.r2, 0.0)))} of its motion "
            f"(rms {with_unit(self.rms, self.unit, 2)}{times})"
        )


@dataclass(frozen=True)
class Validation:
    """Of an answer.

    Attributes
    ----------
    block_s : length of the blocks that are simulated freely, from states that are fitted to each [s]
    blocks : how many
    sensors : by signal
    """

    block_s: float
    blocks: int
    sensors: tuple[Predicted, ...]

    @property
    def text(self) -> str:
        """In words."""
        clauses = "; ".join(one.text for one in self.sensors)
        return f"{self.blocks} blocks of {self.block_s:.3g} s, simulated freely: {clauses}"


def validated(answer: MechanismAnswer, recording: Recording) -> Validation:
    """The longest segment of another recording of the same mechanism, simulated in blocks of four windows with the
    values of an answer. No parameter is fitted to it; the state at the start of each block is.

    Raises
    ------
    PvidError
        Where a parameter has no value, the recording is too short, or the equations are not simulated.
    """
    model, whole = answer.model, recording.whole()
    p = [answer.values[name].value for name in model.p_names]
    if None in p:
        raise PvidError(f"not validated: {model.p_names[p.index(None)]} is not identified")
    samples = max(round(_WINDOWS * answer.found.design.window_s * whole.sample_rate), _LEAST)
    samples = min(samples, len(whole) // _BLOCKS)
    if samples < _LEAST:
        raise PvidError(f"not validated: {len(whole)} samples are too few for {_BLOCKS} blocks of {_LEAST}")
    simulated = simulated_on(model, whole, np.array(p, np.float64), samples)
    problem, found = simulated.problem, simulated.found
    if not np.isfinite(found.sum_of_squares):
        raise PvidError("not validated: the simulated motion runs away")
    names = problem.kernel.made.outputs
    motion = problem.simulated(found.r, found.cut, found.starts).reshape(-1, len(names))
    measured = found.cut.rows(problem.measured.z).reshape(-1, len(names))
    sensors = []
    for k, name in enumerate(names):
        rms = float(np.sqrt(np.nanmean((measured[:, k] - motion[:, k]) ** 2)))
        spread = float(np.nanvar(measured[:, k]))
        signal = model.signal(name)
        sensors.append(Predicted(name, signal.unit, rms, signal.sd, 1 - rms**2 / max(spread, 1e-300)))
    return Validation(found.cut.samples / whole.sample_rate, len(found.cut.first), tuple(sensors))
