"""Mechanisms in files of one's own, with a recording of each: one without an input, one that is no motion, one with as
many unknowns as the core takes."""

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

from conftest import ROOT

from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.rig.run import Recording
from pvid.sim.simulated_run import RigSimulation, rig_of_guess

TICKS = 3600  # of a recording


@dataclass(frozen=True)
class OwnMechanism:
    """A model file, and how a rig of its guess is run.

    Attributes
    ----------
    path : of the file
    rate : of the samples [Hz]
    band : of the drive [Hz]
    start : coordinates at the first sample
    """

    path: Path
    rate: float
    band: tuple[float, float]
    start: dict[str, float] = field(default_factory=dict)

    @property
    def compiled(self) -> CompiledModel:
        """The model."""
        return compiled_of(self.path)


OWN = {
    "free_pendulum": OwnMechanism(  # its one signal is an angle
        ROOT / "tests" / "data" / "recordings" / "free_pendulum.py", 500.0, (0.1, 1.0), {"q": 2.5}
    ),
    "heated_plate": OwnMechanism(Path(__file__).with_name("heated_plate.py"), 10.0, (0.005, 0.1)),
    "mass_chain": OwnMechanism(Path(__file__).with_name("mass_chain.py"), 200.0, (0.2, 5.0)),
}


@cache
def own_recording(name: str, **factors: float) -> Recording:
    """TICKS samples of a simulated rig of the guess, some of its parameters so many times as large."""
    own = OWN[name]
    length = TICKS / own.rate
    rig = rig_of_guess(own.compiled, "steps", *own.band, rate=own.rate, duration=length, start=own.start)
    rig = replace(rig, truth={one: factors.get(one, 1.0) * value for one, value in rig.truth.items()})
    run = RigSimulation.of(own.compiled, rig).run()
    return Recording(run.pop("t"), run, own.rate)
