"""How long it lives: up to millions of ticks of any mechanism, a third of them disturbed, with and without forgetting.

The shipped rig's run is played again and again with other noise, a gap between; in the middle third one thing is wrong
with its signals or with the mechanism. Looked for: anything that is not finite; an answer that is far from the truth by
its own standard errors at the end, and raises no alarm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from bench.board_weak import FixedBoard, FloatBoard, board_of
from bench.mechanisms import design_of, size_of, start_of
from pvid.core.native import Publisher
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.enums import Core, Reason
from pvid.sim.simulated_run import PERFECT, RigSimulation

Float = npt.NDArray[np.float64]
Signals = Mapping[str, Float]

FAR = 5.0  # standard errors of the end; the runs' own, of some ten parameters, reach 3
BIAS = 0.1  # per cent: one motion again and again, whose bias does not become smaller as the standard errors do
RUNS_OF_MEMORY = 2.0  # forgetting over the length of a run
HEADER = ("mechanism", "disturbance", "ticks", "f32", "f32 with forgetting", "q31")
STEP = 1.2  # of the first parameter, from the disturbance on


@dataclass(frozen=True)
class Disturbance:
    """What is wrong in the middle third.

    Attributes
    ----------
    of : which signals (role_of)
    happens : a signal [n] from the true one, random numbers and its resolution
    changes : the mechanism is another one from then on, to the end
    """

    name: str
    of: str = "all"
    happens: Callable[[Float, np.random.Generator, float], Float] = lambda x, *_: x
    changes: bool = False


def role_of(model: CompiledModel, of: str) -> list[str]:
    """Names of the signals that a disturbance is of: "sensor" (the last one that measures), "drive" (the first one that
    the run sets), "all"."""
    measured = [one.name for one in model.signals if one.kind == "sensor" and not one.driven]
    driven = [one.name for one in model.signals if one.driven or one.kind == "input"]
    return {"sensor": measured[-1:], "drive": driven[:1], "all": [*driven, *measured]}[of]


def _dropped(x: Float, random: np.random.Generator, _: float) -> Float:
    out = x.copy()
    for first in random.integers(0, len(x), 4):
        out[first : first + 20] = np.nan
    return out


def _slipping(x: Float, *_: object) -> Float:
    late = np.arange(len(x)) // 1000 % 2
    return np.asarray(x[np.maximum(np.arange(len(x)) - late, 0)])


DISTURBANCES = (
    Disturbance("none"),
    Disturbance(
        "all signals stand still, with their noise",
        "all",
        lambda x, random, lsb: x[0] + np.round(random.normal(0, 0.5, len(x))) * lsb,
    ),
    Disturbance("all signals stand still", "all", lambda x, *_: np.full(len(x), x[0])),
    Disturbance("no drive is recorded", "drive", lambda x, *_: np.zeros(len(x))),
    Disturbance("a sensor keeps its value", "sensor", lambda x, *_: np.full(len(x), x[0])),
    Disturbance(
        "a sensor ends at half its span",
        "sensor",
        lambda x, *_: np.clip(x, np.mean(x) - np.ptp(x) / 4, np.mean(x) + np.ptp(x) / 4),
    ),
    Disturbance(
        "1 % of a sensor's samples off by 100 resolutions",
        "sensor",
        lambda x, random, lsb: x + 100 * lsb * random.choice([-1, 0, 1], len(x), p=[0.005, 0.99, 0.005]),
    ),
    Disturbance("samples missing", "all", _dropped),
    Disturbance("a sensor a sample late for every other 1000", "sensor", _slipping),
    Disturbance("the first parameter larger by 20 % from then on", changes=True),
)


@dataclass(frozen=True)
class Lane:
    """A core, with or without forgetting."""

    core: Core
    forgets: bool = False


LANES = (Lane("f32"), Lane("f32", forgets=True), Lane("q31"))


@cache
def simulation_of(name: str, changed: bool) -> RigSimulation:
    """The shipped rig, or that with another first parameter."""
    rig = simulated_rig(name)
    first = next(one.name for one in compiled_of(name).unknowns if one.positive)
    truth = {key: (STEP if changed and key == first else 1.0) * value for key, value in rig.truth.items()}
    return RigSimulation.of(compiled_of(name), replace(rig, truth=truth))


@cache
def board(name: str, lane: Lane) -> FloatBoard | FixedBoard:
    """With the settings from a run of the shipped rig."""
    of = simulation_of(name, False)
    made = board_of(of.model, of.run(0), design_of(of, PERFECT), of.truth, lane.core)
    if not lane.forgets or not isinstance(made, FloatBoard):
        return made
    memory = RUNS_OF_MEMORY * of.rig.duration
    config = made.config
    estimator, gate = replace(config.estimator, forgetting_s=memory), replace(config.gate, patience_s=memory)
    return replace(made, config=replace(config, estimator=estimator, gate=gate))


@dataclass
class Outcome:
    """What became of a lane.

    Attributes
    ----------
    not_finite : ticks at which p or a standard error was not
    percent, z : largest error at the end, over the size of its parameter [%] and over its standard error
    reason : of the last window that was judged
    """

    ticks: int = 0
    not_finite: int = 0
    percent: float = np.nan
    z: float = np.nan
    reason: Reason = Reason.WARMING_UP

    @property
    def silent(self) -> bool:
        """Far from the truth, and nothing raised."""
        return self.reason == Reason.UPDATED and not self.z <= FAR and not self.percent <= BIAS

    @property
    def cell(self) -> str:
        """Of the table."""
        if self.not_finite:
            return "NOT FINITE"
        error = f"{self.percent:.2g} %" + (f", **{self.z:.1f} s.e.**" if self.silent else "")
        return error if self.reason == Reason.UPDATED else f"{error}, {self.reason.text}"


def chunks(name: str, disturbance: Disturbance, ticks: int, seed: int = 0) -> Iterator[Signals]:
    """Runs [n] one after the other."""
    played, number = 0, 0
    while played < ticks:
        third = 3 * played // ticks
        of = simulation_of(name, disturbance.changes and third >= 1)
        run, random = of.run(1000 * seed + number), np.random.default_rng([seed, number])
        if third == 1:
            touched = role_of(of.model, disturbance.of)
            run |= {one: disturbance.happens(run[one], random, of.model.signal(one).resolution) for one in touched}
        yield {one.name: run[one.name] for one in of.model.signals}
        played, number = played + len(run["t"]), number + 1


def outcome(name: str, lane: Lane, disturbance: Disturbance, ticks: int) -> Outcome:
    """A lane under a disturbance, from a start within +-50 %."""
    made, found = board(name, lane), Outcome()
    identifier: Publisher = made.identifier(start_of(simulation_of(name, False), 1))
    for run in chunks(name, disturbance, ticks):
        record = identifier.run_samples(made.samples(run), sums=False, hashes=False)  # type: ignore[attr-defined]
        identifier.gap()
        finite = np.isfinite(record.p.astype(np.float64)).all(axis=1)
        finite &= np.isfinite(record.published_se.astype(np.float64)).all(axis=1)
        found.ticks, found.not_finite = found.ticks + len(finite), found.not_finite + int((~finite).sum())
        judged = record.reason[~np.isin(record.reason, (Reason.ACCUMULATED, Reason.WARMING_UP))]
        found.reason = Reason(int(judged[-1])) if len(judged) else found.reason
        last = record.published[-1], record.published_se[-1]
    p, se = (made.weak.values(one) if isinstance(made, FixedBoard) else one.astype(np.float64) for one in last)
    of = simulation_of(name, disturbance.changes)
    off = np.abs(p - of.truth)
    found.percent, found.z = 100 * float(np.max(off / size_of(of))), float(np.max(off / se))
    return found


def rows(
    names: Sequence[str], ticks: int, progress: Callable[[], object], disturbances: Sequence[Disturbance] = DISTURBANCES
) -> Iterator[tuple[str, ...]]:
    """Every disturbance of mechanisms, as in HEADER."""
    for name in names:
        for one in disturbances:
            found = []
            for lane in LANES:
                found.append(outcome(name, lane, one, ticks))
                progress()
            yield name, one.name, f"{found[0].ticks:.1e}".replace("e+0", "e"), *(each.cell for each in found)
