"""Accidents of a recording, one a run, of any mechanism: what `pvid identify` makes of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.case import columns
from pvid.identification.reading import read_all
from pvid.identification.road import identified
from pvid.model.compiled import CompiledModel
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.sim.simulated_run import PERFECT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]
Signals = dict[str, Float]

SEEDS = 2
WRONG = 4.0  # standard errors
SECONDS = 20.0  # of a run at 1 kHz; so many samples at another rate
MECHANISMS = ("kapitza", "rigid_body")
HEADER = columns(
    "mechanism | accident | answered | largest error: median, s.e. | largest, s.e. | largest, % | warned | wrong,"
    " no warning"
)
_AT = 0.5  # of the run: where it happens


@dataclass(frozen=True)
class Accident:
    """One kind.

    Attributes
    ----------
    label : in words
    of : which signals it is of: "sensor" (the last one that measures), "drive" (the first one that the run sets), "all"
    happens : the values of one signal [n] afterwards, from those before, the random numbers and the signal's span
    """

    label: str
    of: str
    happens: Callable[[Float, np.random.Generator, float], Float]


def _from_then(change: Callable[[Float, float], Float]) -> Callable[[Float, np.random.Generator, float], Float]:
    def happens(x: Float, _: np.random.Generator, span: float) -> Float:
        first = int(_AT * len(x))
        return np.concatenate([x[:first], change(x[first:], span)])

    return happens


def _part(
    samples: int, what: Callable[[Float, int, int], object]
) -> Callable[[Float, np.random.Generator, float], Float]:
    """Changes `samples` samples in place."""

    def happens(x: Float, _: np.random.Generator, __: float) -> Float:
        first, out = int(_AT * len(x)), x.copy()
        what(out, first, first + samples)
        return out

    return happens


def _set(x: Float, first: int, last: int, value: float | Float) -> None:
    x[first:last] = value


def _wild(x: Float, random: np.random.Generator, span: float, by: float) -> Float:
    out = x.copy()
    out[random.choice(np.arange(50, len(x) - 50), 10, replace=False)] += by * span
    return out


def _lost(samples: int) -> Callable[[Float, np.random.Generator, float], Float]:
    return lambda x, *_: np.delete(x, slice(int(_AT * len(x)), int(_AT * len(x)) + samples))


ACCIDENTS = (
    Accident("none", "all", lambda x, *_: x),
    *(Accident(f"{n} samples lost, t goes on", "all", _lost(n)) for n in (10, 100, 2000)),
    Accident("500 samples missing, visible in t", "all", _part(500, lambda x, a, b: _set(x, a, b, np.nan))),
    Accident("200 samples twice (a buffer)", "all", _part(200, lambda x, a, b: _set(x, a, b, x[2 * a - b : a].copy()))),
    Accident("10 samples of a sensor off by its span", "sensor", lambda x, random, span: _wild(x, random, span, 1.0)),
    Accident(
        "10 samples of a sensor off by a tenth of it", "sensor", lambda x, random, span: _wild(x, random, span, 0.1)
    ),
    Accident("10 samples of a drive off by its span", "drive", lambda x, random, span: _wild(x, random, span, 1.0)),
    *(
        Accident(f"a {one} stands still for 300 samples", one, _part(300, lambda x, a, b: _set(x, a, b, x[a])))
        for one in ("sensor", "drive")
    ),
    Accident("a sensor jumps by a thirtieth of its span", "sensor", _from_then(lambda x, span: x + span / 30)),
    Accident("a sensor drifts by a hundredth", "sensor", lambda x, _, span: x + span / 100 * np.linspace(0, 1, len(x))),
    Accident("gain of a drive 1 % larger from then on", "drive", _from_then(lambda x, _: 1.01 * x)),
)


def role_of(model: CompiledModel, of: str) -> list[str]:
    """Names of the signals that an accident is of."""
    measured = [one.name for one in model.signals if one.kind == "sensor" and not one.driven]
    driven = [one.name for one in model.signals if one.driven or one.kind == "input"]
    return {"sensor": measured[-1:], "drive": driven[:1], "all": [*driven, *measured]}[of]


def spoilt(model: CompiledModel, signals: Mapping[str, Float], accident: Accident, seed: int) -> Signals:
    """The signals [n] of a run after an accident."""
    random, found = np.random.default_rng(seed), role_of(model, accident.of)
    return {name: accident.happens(x, random, float(np.ptp(x))) if name in found else x for name, x in signals.items()}


@dataclass(frozen=True)
class Outcome:
    """Of one run: its largest error, in standard errors and in %, None where nothing is identified; and whether the
    answer has a warning."""

    z: float | None
    percent: float | None
    warned: bool

    @property
    def is_wrong(self) -> bool:
        """Without a warning."""
        return self.z is not None and self.z > WRONG and not self.warned


def outcome_of(
    values: Mapping[str, tuple[float, float]], truth: Mapping[str, float], size: Mapping[str, float], warned: bool
) -> Outcome:
    """Of values with their standard errors; none where nothing is identified. `size`: what an error is relative to."""
    if not values:
        return Outcome(None, None, warned)
    z = {name: abs(value - truth[name]) / se for name, (value, se) in values.items()}
    worst = max(z, key=lambda name: z[name])
    return Outcome(z[worst], 100 * abs(values[worst][0] - truth[worst]) / size[worst], warned)


def run_of(simulation: RigSimulation, accident: Accident, seed: int) -> Recording:
    """A run of a shipped rig after an accident."""
    rate = simulation.rig.sample_rate
    run = {name: x[: round(SECONDS * 1000)] for name, x in simulation.run(seed, PERFECT).items() if name != "t"}
    signals = spoilt(simulation.model, run, accident, seed)
    return Recording(np.arange(len(next(iter(signals.values())))) / rate, signals, rate)


def told(name: str, accident: Accident, seed: int) -> Outcome:
    """What `identify` answers, with gains that are exact; a note is no warning."""
    simulation = simulation_of(name)
    model = simulation.model
    exact = {
        one.name: {"gain_sd": 0.0, **({"neglected": 0.0} if one.kind == "sensor" else {})} for one in model.signals
    }
    knowns = {one.name: one.value for one in model.knowns if one.required}
    known_sd = {one.name: 0.0 for one in simulation.plant.model.knowns if one.required}
    rig = MechanismRig(name, known=knowns, known_sd=known_sd, sensor=exact, clock_sd=0.0)
    answer = identified(*read_all(rig, [lambda _: run_of(simulation, accident, seed)], (), None), refine=False)
    truth = dict(zip(model.p_names, map(float, simulation.truth), strict=True))
    size = {one.name: abs(truth[one.name]) if one.positive else one.sd for one in model.unknowns}
    values = {
        key: (one.value, one.se)
        for key, one in answer.values.items()
        if key in truth and one.value is not None and one.se
    }
    return outcome_of(values, truth, size, answer.found.verdict.warning is not None)


def row_of(mechanism: str, accident: Accident, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """Of the table."""
    z = [one.z for one in outcomes if one.z is not None]
    percent = [one.percent for one in outcomes if one.percent is not None]
    figures = (f"{np.median(z):.1f}", f"{max(z):.1f}", f"{max(percent):.2g}") if z else ("-", "-", "-")
    return (
        mechanism,
        accident.label,
        f"{len(z)} of {len(outcomes)}",
        *figures,
        f"{sum(one.warned for one in outcomes)}",
        f"{sum(one.is_wrong for one in outcomes)}",
    )


def rows(names: Sequence[str], seeds: int, progress: Callable[[], object]) -> Iterator[tuple[str, ...]]:
    """Every kind on mechanisms."""
    for name in names:
        for accident in ACCIDENTS:
            outcomes = []
            for seed in range(seeds):
                outcomes.append(told(name, accident, seed))
                progress()
            yield row_of(name, accident, outcomes)
