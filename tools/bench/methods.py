"""Methods side by side on the shipped mechanisms: weak form, strong form, output error, pysindy's weak form.

All take the same runs, with sharp friction. Each method gets what flatters it: the strong form the best of its filters
and a start at the truth, output error a start near it and the law of the plant, pysindy parameters worked out by hand.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench import strong_savitzky_golay, weak_sindy
from bench.case import columns
from bench.mechanisms import design_of, size_of, start_of
from bench.output_error import output_error
from bench.replay import Replay
from pvid.base.errors import PvidError
from pvid.oracle.weak.identify import identify
from pvid.rig.run import Recording
from pvid.sim.simulated_run import PERFECT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]

SEEDS = 3
HEADER = columns(
    "mechanism | method | start off | runs with every parameter within 5 % | median parameter % | worst parameter"
    " % | of | s a run"
)
CLOSE = 0.05
_SUBSTEPS = 2  # of output error's simulation in a sample
_MOST = 60  # steps of output error's search
_COUNTED = {"battery_2rc": ("z",)}  # states that are 0 at the start: a charge counted from there


@dataclass(frozen=True)
class Method:
    """A way to identify a run.

    Attributes
    ----------
    name : in the table
    start : how far off it starts, in words
    run : simulation, run and seed -> p [n_p], or PvidError where it has none
    """

    name: str
    start: str
    run: Callable[[RigSimulation, Recording, int], Float]


def _weak(simulation: RigSimulation, run: Recording, seed: int) -> Float:
    design = design_of(simulation, PERFECT)
    return identify(simulation.model, run.signals, run.sample_rate, start_of(simulation, seed), design).p


def _strong(simulation: RigSimulation, run: Recording, seed: int) -> Float:
    del seed
    truth, size = simulation.truth, size_of(simulation)
    return strong_savitzky_golay.best(simulation.model, run.signals, run.sample_rate, truth, size)[0]


def _output_error(off: float) -> Callable[[RigSimulation, Recording, int], Float]:
    """Each parameter starts off by this part, up or down; one of either sign at its guess."""

    def run_of(simulation: RigSimulation, run: Recording, seed: int) -> Float:
        rng = np.random.default_rng([seed, 3])
        positive = [one.positive for one in simulation.model.unknowns]
        away = simulation.truth * (1 + off * rng.choice([-1.0, 1.0], len(simulation.truth)))
        start = np.where(positive, away, [one.guess for one in simulation.model.unknowns])
        replay = Replay(simulation.model, run, substeps=_SUBSTEPS)
        return output_error(replay, start, _MOST, _COUNTED.get(simulation.model.name, ())).p

    return run_of


def _sindy(simulation: RigSimulation, run: Recording, seed: int) -> Float:
    del seed
    return weak_sindy.identified(simulation, run)


METHODS = (
    Method("weak form (this project)", "+-50 %", _weak),
    Method("strong form, best Savitzky-Golay filter", "none", _strong),
    Method("output error (scipy)", "1 %", _output_error(0.01)),
    Method("output error (scipy)", "30 %", _output_error(0.3)),
    Method("weak form of pysindy", "no start", _sindy),
)


@dataclass(frozen=True)
class Outcome:
    """A method on a mechanism.

    Attributes
    ----------
    names : of the parameters
    errors : relative [runs, n_p]
    seconds : of each run
    refusal : why there are none
    """

    names: tuple[str, ...]
    errors: Float
    seconds: float
    refusal: str = ""

    def cells(self) -> tuple[str, ...]:
        """The columns behind the start."""
        if self.refusal:
            return ("-", "-", "-", self.refusal, "-")
        rms = np.sqrt(np.mean(np.square(self.errors), axis=0))
        near = int((np.abs(self.errors) < CLOSE).all(axis=1).sum())
        worst = int(np.argmax(rms))
        return (
            f"{near}/{len(self.errors)}",
            _percent(float(np.median(rms))),
            _percent(float(rms[worst])),
            self.names[worst],
            f"{self.seconds:.2g}",
        )


def _percent(part: float) -> str:
    return f"{float(f'{100 * part:.2g}'):g}" if part < 1 else "> 100"


def outcome(method: Method, simulation: RigSimulation, runs: list[Recording]) -> Outcome:
    """All runs by a method."""
    names = simulation.model.p_names
    errors, seconds = [], []
    for seed, run in enumerate(runs):
        begun = time.perf_counter()
        try:
            p = method.run(simulation, run, seed)
        except PvidError as error:
            return Outcome(names, np.empty((0, len(names))), 0.0, str(error))
        seconds.append(time.perf_counter() - begun)
        errors.append((p - simulation.truth) / size_of(simulation))
    return Outcome(names, np.array(errors), float(np.mean(seconds)))


def recorded(simulation: RigSimulation, seed: int) -> Recording:
    """A run of the simulated rig, with sharp friction where it has any."""
    signals = simulation.run(seed, PERFECT)
    t = signals.pop("t")
    return Recording(t, signals, simulation.rig.sample_rate)


def rows(
    mechanisms: tuple[str, ...], seeds: int = SEEDS, progress: Callable[[], object] = int
) -> Iterator[tuple[str, ...]]:
    """Of the table."""
    for name in mechanisms:
        simulation = simulation_of(name)
        runs = [recorded(simulation, seed) for seed in range(seeds)]
        for method in METHODS:
            yield (name, method.name, method.start, *outcome(method, simulation, runs).cells())
            progress()
