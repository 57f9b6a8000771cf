"""Accidents of a recording, one a run: what `pvid identify` makes of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.core.native import Native
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.reading import read_all
from pvid.identification.road import identified
from pvid.identification.wild_samples import without_wild_samples
from pvid.models.mechanisms import compiled_of
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording, Run
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors
from pvid.sim.simulated_run import PERFECT, simulation_of

Float = npt.NDArray[np.float64]
Signals = dict[str, Float]

SEEDS = 5
WRONG = 4.0  # standard errors
MOTOR = "dc_motor"
HEADER = (
    "mechanism",
    "accident",
    "answered",
    "largest error: median, s.e.",
    "largest, s.e.",
    "largest, %",
    "warned",
    "wrong, no warning",
)
_AT = 0.5  # of the run: where it happens


@dataclass(frozen=True)
class Accident:
    """One kind.

    Attributes
    ----------
    label : in words
    happens : changes signals in place, or returns shorter ones
    """

    label: str
    happens: Callable[[Signals, np.random.Generator, float], Signals | None]


def _wild(name: str, by: float, count: int) -> Callable[[Signals, np.random.Generator, float], None]:
    def happens(x: Signals, random: np.random.Generator, _: float) -> None:
        x[name][random.choice(np.arange(50, len(x[name]) - 50), count, replace=False)] += by

    return happens


def _stuck(name: str, seconds: float) -> Callable[[Signals, np.random.Generator, float], None]:
    def happens(x: Signals, _: np.random.Generator, rate: float) -> None:
        first = int(_AT * len(x[name]))
        x[name][first : first + round(seconds * rate)] = x[name][first]

    return happens


def _jump(name: str, by: float) -> Callable[[Signals, np.random.Generator, float], None]:
    def happens(x: Signals, _: np.random.Generator, __: float) -> None:
        x[name][int(_AT * len(x[name])) :] += by

    return happens


def _lost(samples: int, seen: bool = False) -> Callable[[Signals, np.random.Generator, float], Signals | None]:
    """Samples that are missing: t goes on as if there were none, or shows them (they are NaN)."""

    def happens(x: Signals, _: np.random.Generator, __: float) -> Signals | None:
        first = int(_AT * len(next(iter(x.values()))))
        gone = slice(first, first + samples)
        if seen:
            for values in x.values():
                values[gone] = np.nan
            return None
        return {name: np.delete(values, gone) for name, values in x.items()}

    return happens


def _repeated(samples: int) -> Callable[[Signals, np.random.Generator, float], None]:
    def happens(x: Signals, _: np.random.Generator, __: float) -> None:
        for values in x.values():
            first = int(_AT * len(values))
            values[first : first + samples] = values[first - samples : first]

    return happens


def _gain(name: str, factor: float) -> Callable[[Signals, np.random.Generator, float], None]:
    def happens(x: Signals, _: np.random.Generator, __: float) -> None:
        x[name][int(_AT * len(x[name])) :] *= factor

    return happens


def _drift(name: str, by: float) -> Callable[[Signals, np.random.Generator, float], None]:
    def happens(x: Signals, _: np.random.Generator, __: float) -> None:
        x[name] += by * np.linspace(0.0, 1.0, len(x[name]))

    return happens


COMMON = (
    Accident("none", lambda *_: None),
    Accident("10 samples lost, t goes on", _lost(10)),
    Accident("100 samples lost, t goes on", _lost(100)),
    Accident("2000 samples lost, t goes on", _lost(2000)),
    Accident("0.5 s missing, visible in t", _lost(500, seen=True)),
    Accident("200 samples twice (a buffer)", _repeated(200)),
)
PENDULUM = (
    *COMMON,
    Accident("10 samples of y off by 0.5 m", _wild("y", 0.5, 10)),
    Accident("10 samples of y off by 2 mm", _wild("y", 2e-3, 10)),
    Accident("10 samples of phi off by 1 rad", _wild("phi", 1.0, 10)),
    Accident("y stands still for 0.3 s", _stuck("y", 0.3)),
    Accident("phi stands still for 0.3 s", _stuck("phi", 0.3)),
    Accident("y jumps by 5 mm", _jump("y", 5e-3)),
    Accident("phi jumps by 5 mrad", _jump("phi", 5e-3)),
    Accident("phi drifts by 2 mrad", _drift("phi", 2e-3)),
    Accident("gain of y 1 % larger from then on", _gain("y", 1.01)),
)
OF_MOTOR = (
    *COMMON,
    Accident("10 samples of phi off by 3 rad", _wild("phi", 3.0, 10)),
    Accident("10 samples of i off by 3 A", _wild("i", 3.0, 10)),
    Accident("V stands still for 0.3 s", _stuck("V", 0.3)),
    Accident("phi jumps by 0.1 rad", _jump("phi", 0.1)),
    Accident("gain of V 1 % larger from then on", _gain("V", 1.01)),
)
STEPS = SEEDS * (len(PENDULUM) + len(OF_MOTOR))


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


def outcome_of(values: Mapping[str, tuple[float, float]], truth: Mapping[str, float], warned: bool) -> Outcome:
    """Of values with their standard errors; none where nothing is identified."""
    if not values:
        return Outcome(None, None, warned)
    z = {name: abs(value - truth[name]) / se for name, (value, se) in values.items()}
    worst = max(z, key=lambda name: z[name])
    return Outcome(z[worst], 100 * abs(values[worst][0] / truth[worst] - 1), warned)


def pendulum_with(accident: Accident, seed: int) -> Outcome:
    """The standard rig, 14 bits, 40 s at 1 kHz, full equations, refined as by default; a note is no warning."""
    run = simulate(sensors=standard_sensors(14), truth="full", duration=40.0, seed=seed).run
    signals = {"phi": run.phi.copy(), "y": run.y.copy()}
    left = accident.happens(signals, np.random.default_rng(seed), run.sample_rate) or signals
    spoilt = Run(run.t[: len(left["y"])], left["phi"], left["y"], run.sample_rate)
    rig = MechanismRig(
        "kapitza", known={"l1": STANDARD_PENDULUM.l1}, known_sd={"l1": 0.0}, sensor={"y": {"gain_sd": 0.0}}
    )
    found = identified(*read_all(rig, [lambda _: spoilt.recording], (), None))
    truth = {"g": STANDARD_PENDULUM.g, "l2": STANDARD_PENDULUM.l2, "rho2": STANDARD_PENDULUM.rho2}
    return outcome_of(_known(found, truth), truth, found.found.verdict.warning is not None)


def motor_with(accident: Accident, seed: int) -> Outcome:
    """The shipped rig of the motor, 10 s, in float64 by the weak form, as by default."""
    simulation = simulation_of(MOTOR)
    model, rate = compiled_of(MOTOR), simulation.rig.sample_rate
    signals = {name: values[: round(10 * rate)].copy() for name, values in simulation.run(seed, PERFECT).items()}
    left = accident.happens(signals, np.random.default_rng(seed), rate) or signals
    recording = Recording(np.arange(len(left["V"])) / rate, left, rate).whole()
    found = analysed(without_wild_samples(recording, model), model)
    truth = dict(zip(model.p_names, map(float, simulation.truth), strict=True))
    return outcome_of(_known(found, truth), truth, found.found.verdict.warning is not None)


def _known(found: Analysis, names: Collection[str]) -> dict[str, tuple[float, float]]:
    """Values and standard errors of these, where they are identified."""
    values = {name: one for name, one in found.values.items() if name in names}
    return {name: (one.value, one.se) for name, one in values.items() if one.value is not None and one.se is not None}


def row_of(mechanism: str, accident: Accident, outcomes: list[Outcome]) -> tuple[str, ...]:
    """Of the table."""
    answered = [one for one in outcomes if one.z is not None]
    z = [one.z for one in answered if one.z is not None]
    percent = [one.percent for one in answered if one.percent is not None]
    figures = (f"{np.median(z):.1f}", f"{max(z):.1f}", f"{max(percent):.2g}") if z else ("-", "-", "-")
    return (
        mechanism,
        accident.label,
        f"{len(answered)} of {len(outcomes)}",
        *figures,
        f"{sum(one.warned for one in outcomes)}",
        f"{sum(one.is_wrong for one in outcomes)}",
    )


def accidents_table(_: Native, progress: Callable[[int], None] = lambda _: None) -> list[tuple[str, ...]]:
    """Every kind on both mechanisms."""
    rows, done = [], 0
    for mechanism, kinds, run in (("pendulum", PENDULUM, pendulum_with), (MOTOR, OF_MOTOR, motor_with)):
        for accident in kinds:
            outcomes = []
            for seed in range(SEEDS):
                outcomes.append(run(accident, seed))
                done += 1
                progress(done)
            rows.append(row_of(mechanism, accident, outcomes))
    return rows
