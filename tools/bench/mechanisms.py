"""The shipped mechanisms on their simulated rigs: errors of the weak form in float64 beside the Cramer-Rao bound, and
what imperfect rigs do to them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.case import Advance, Report, Table, chosen, columns
from pvid.model.compiled import CompiledModel, Signal
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import Identified, identify
from pvid.sim.bound import bound
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import PERFECT, SOFT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]

OFF = 0.5  # of a start: within +-50 % of the truth
CLOSE = 0.05  # "within 5 %"
WRONG = 4.0  # standard errors: an error above is not covered

ACCURACY = ("mechanism", "parameter", "bound %", "RMS %", "RMS / bound", "mean error %", "RMS / s.e.", "in 2 s.e. %")
SUMMARY = columns("mechanism | friction | chi2 | within 5 % after s: median | longest | warnings | s to identify")
TWO_WINDOWS = columns(
    "mechanism | friction | parameter | runs beyond 5 % | RMS error there % | s.e. of two windows % | bound of "
    "two windows %"
)
IMPERFECT = columns(
    "mechanism | imperfection | largest error: of | % | in s.e. | chi2 | warnings | wrong without a warning"
)


@dataclass(frozen=True)
class Imperfection:
    """A case of the table of imperfections.

    Attributes
    ----------
    name : in words
    of : what it is on a rig; None where the rig cannot have it
    gain_sd : that the model declares of what is driven
    """

    name: str
    of: Callable[[RigSimulation], Imperfections | None]
    gain_sd: float = 0.0


def _encoder(simulation: RigSimulation) -> str:
    """The first encoder's name; "" where the mechanism has none."""
    angles = (one.name for one in simulation.model.signals if _measures(one) and one.unit == "rad")
    return next(angles, "")


def _measures(signal: Signal) -> bool:
    return signal.kind == "sensor" and not signal.driven


def _gain(simulation: RigSimulation) -> Imperfections:
    driven = next(one.name for one in simulation.model.signals if one.driven or one.kind == "input")
    return replace(PERFECT, gain={driven: 1.01})


def _skew(simulation: RigSimulation) -> Imperfections:
    late = [one.name for one in simulation.model.signals if _measures(one)][-1]
    return replace(PERFECT, skew={late: 1.0 / simulation.rig.sample_rate})


def _stiction(simulation: RigSimulation) -> Imperfections | None:
    return Imperfections(breakaway=1.3) if simulation.rig.friction_width else None


def _soft(simulation: RigSimulation) -> Imperfections | None:
    return SOFT if simulation.rig.friction_width else None


def _on_encoder(key: str, size: float) -> Callable[[RigSimulation], Imperfections | None]:
    def of(simulation: RigSimulation) -> Imperfections | None:
        name = _encoder(simulation)
        turns = bool(name) and np.ptp(simulation.motion()[name]) > 2.0  # else an eccentricity is part of its zero
        given: dict[str, Any] = {key: {name: size}}
        return replace(PERFECT, **given) if name and (turns or key == "backlash") else None

    return of


CASES = (
    Imperfection("none", lambda _: PERFECT),
    Imperfection("soft friction", _soft),
    Imperfection("stiction, 1.3 times the friction", _stiction),
    Imperfection("backlash of 3 LSB before the encoder", _on_encoder("backlash", 3.0)),
    Imperfection("eccentric encoder, 3 LSB", _on_encoder("eccentricity", 3.0)),
    Imperfection("one sensor a sample late", _skew),
    Imperfection("input 1 % larger than recorded, gain_sd = 0", _gain),
    Imperfection("the same, gain_sd = 1 %, the default", _gain, gain_sd=0.01),
)


def design_of(simulation: RigSimulation, imperfections: Imperfections) -> WeakDesign:
    """The rig's own design; a soft friction is known to be soft."""
    rig = simulation.rig
    design: dict[str, Any] = {**rig.design}
    if rig.friction_width and imperfections.friction == "soft":
        design |= {"reversals": "soft", "soft": rig.friction_width}
    return WeakDesign(rig.sample_rate, rig.window_s, **design)


def start_of(simulation: RigSimulation, seed: int) -> Float:
    """The truth times 0.5 to 1.5; the guess where a parameter may have either sign."""
    rng = np.random.default_rng([seed, 2])
    factor = rng.uniform(1 - OFF, 1 + OFF, len(simulation.truth))
    positive = [one.positive for one in simulation.model.unknowns]
    return np.where(positive, simulation.truth * factor, [one.guess for one in simulation.model.unknowns])


def size_of(simulation: RigSimulation) -> Float:
    """What errors are relative to: the truth, or the guess's standard deviation of one that may have either sign."""
    unknowns = simulation.model.unknowns
    return np.where([one.positive for one in unknowns], simulation.truth, [one.sd for one in unknowns])


@dataclass
class Outcome:
    """What the runs of a mechanism gave."""

    simulation: RigSimulation
    found: list[Identified] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    @property
    def errors(self) -> Float:
        """[runs, n_p]"""
        return np.array([one.p for one in self.found]) - self.simulation.truth

    @property
    def se(self) -> Float:
        """Published [runs, n_p]."""
        return np.array([one.se for one in self.found])

    @property
    def rms(self) -> Float:
        """Of the errors [n_p]."""
        return np.asarray(np.sqrt(np.mean(np.square(self.errors), axis=0)))

    @property
    def chi2(self) -> float:
        """Mean."""
        return float(np.mean([one.chi2 for one in self.found]))

    @property
    def warnings(self) -> str:
        """Names of the alarms, with how many of the runs had them."""
        alarms = ({reason.name for reason in one.verdict.reasons if reason.alarm} for one in self.found)
        counts = Counter(name for names in alarms for name in names)
        return ", ".join(f"{name} {count}/{len(self.found)}" for name, count in counts.most_common()) or "-"

    @property
    def confident_wrong(self) -> int:
        """Runs with an error above 4 s.e. and no warning."""
        beyond = np.any(np.abs(self.errors) > WRONG * self.se, axis=1)
        return sum(bool(bad) and one.verdict.status == "good" for bad, one in zip(beyond, self.found, strict=True))

    @property
    def close_s(self) -> Float:
        """Of each run the time from which on every parameter is within 5 % [s]; inf: never."""
        out = []
        for one in self.found:
            far = np.any(np.abs(one.history - self.simulation.truth) > CLOSE * size_of(self.simulation), axis=1)
            first = int(np.flatnonzero(far)[-1]) + 1 if far.any() else 0
            out.append(float(one.times[first]) if first < len(one.times) else np.inf)
        return np.array(out)


def identified(
    name: str,
    seeds: int,
    imperfections: Imperfections,
    *,
    own_design: bool = False,
    gain_sd: float = 0.0,
    advance: Advance = lambda: None,
) -> Outcome:
    """Runs 0 to `seeds` - 1 of a mechanism.

    Parameters
    ----------
    own_design : the rig's own design; else the one that the identification chooses on each run
    gain_sd : that the model declares of what is driven
    """
    outcome = Outcome(simulation_of(name))
    simulation = outcome.simulation
    model = declared(name, gain_sd)
    for seed in range(seeds):
        run = simulation.run(seed, imperfections)
        design = design_of(simulation, imperfections) if own_design else None
        begun = time.perf_counter()
        outcome.found.append(identify(model, run, simulation.rig.sample_rate, start_of(simulation, seed), design))
        outcome.seconds.append(time.perf_counter() - begun)
        advance()
    return outcome


@cache
def declared(name: str, gain_sd: float) -> CompiledModel:
    """The model with this error of the gains of what is driven."""
    model = simulation_of(name).model
    signals = (replace(one, gain_sd=gain_sd) if one.driven else one for one in model.signals)
    return replace(model, signals=tuple(signals)) if gain_sd else model


def smooth(name: str, seeds: int, advance: Advance = lambda: None) -> Outcome:
    """Runs with a soft friction of known width, or none, with the rig's design."""
    return identified(name, seeds, SOFT, own_design=True, advance=advance)


def accuracy_rows(name: str, outcome: Outcome) -> Iterator[tuple[str, ...]]:
    """A row for each parameter."""
    simulation = outcome.simulation
    least, rms, se = bound(simulation), outcome.rms, outcome.se
    truth = np.where(simulation.truth != 0.0, np.abs(simulation.truth), size_of(simulation))
    mean = np.mean(outcome.errors, axis=0)
    covered = np.mean(np.abs(outcome.errors) <= 2 * se, axis=0)
    for k, parameter in enumerate(simulation.model.p_names):
        yield (
            name,
            parameter,
            f"{100 * least[k] / truth[k]:.2g}",
            f"{100 * rms[k] / truth[k]:.2g}",
            f"{rms[k] / least[k]:.2g}",
            f"{100 * mean[k] / truth[k]:+.1g}",
            f"{rms[k] / np.mean(se[:, k]):.2f}",
            f"{100 * covered[k]:.0f}",
        )


def summary_row(name: str, friction: str, outcome: Outcome) -> tuple[str, ...]:
    """A row for a mechanism."""
    close = outcome.close_s
    return (
        name,
        friction,
        f"{outcome.chi2:.2f}",
        f"{np.median(close):.3g}",
        f"{close.max():.3g}",
        outcome.warnings,
        f"{np.mean(outcome.seconds):.2g}",
    )


def two_window_rows(name: str, friction: str, outcome: Outcome) -> Iterator[tuple[str, ...]]:
    """A row for each parameter that some runs have beyond 5 % at the end of the second window or later.

    Beside it what two windows of these runs can tell: the standard errors that their rows predict, and the Cramer-Rao
    bound of the same samples (medians of the runs).
    """
    simulation = outcome.simulation
    size, truth = size_of(simulation), simulation.truth
    off = [np.abs(one.history[1:] - truth) / size for one in outcome.found]
    beyond = np.array([np.any(one > CLOSE, axis=0) for one in off])
    if not beyond.any():
        return
    rms = np.sqrt(np.mean([one[0] ** 2 for one in off], axis=0))
    predicted = np.median([uncertainty(one.fit.only(slice(0, 2))).predicted for one in outcome.found], axis=0)
    lengths = [one.fit.rows.functions.length for one in outcome.found]
    least = {length: bound(simulation, 1.5 * length, windows=1) for length in set(lengths)}
    middle = np.median([least[length] for length in lengths], axis=0)
    for k in np.flatnonzero(beyond.any(axis=0)):
        yield (
            name,
            friction,
            simulation.model.p_names[k],
            f"{beyond[:, k].sum()}/{len(off)}",
            f"{100 * rms[k]:.2g}",
            f"{100 * predicted[k] / size[k]:.2g}",
            f"{100 * middle[k] / size[k]:.2g}",
        )


def imperfection_rows(name: str, seeds: int, advance: Advance = lambda: None) -> Iterator[tuple[str, ...]]:
    """A row for each imperfection that the mechanism can have."""
    simulation = simulation_of(name)
    for case in CASES:
        imperfections = case.of(simulation)
        if imperfections is None:
            continue
        outcome = identified(name, seeds, imperfections, gain_sd=case.gain_sd, advance=advance)
        ratio = np.median(np.abs(outcome.errors) / outcome.se, axis=0)
        worst = int(np.argmax(ratio))
        yield (
            name,
            case.name,
            simulation.model.p_names[worst],
            f"{100 * outcome.rms[worst] / size_of(simulation)[worst]:.2g}",
            f"{ratio[worst]:.2g}",
            f"{outcome.chi2:.3g}",
            outcome.warnings,
            f"{outcome.confident_wrong}/{seeds}",
        )


def number_of_cases(name: str) -> int:
    """Imperfections that a mechanism can have."""
    simulation = simulation_of(name)
    return sum(case.of(simulation) is not None for case in CASES)


def report(mechanism: Collection[str], number: int, advance: Advance) -> Report:
    """See bench.case; imperfect rigs have a fourth of the runs."""
    accuracy, sharp, summary, early, cases = [], [], [], [], []
    for name in chosen(mechanism):
        soft = smooth(name, number, advance)
        accuracy += list(accuracy_rows(name, soft))
        sharply = identified(name, number, PERFECT, advance=advance)
        rubs = bool(soft.simulation.rig.friction_width)
        sharp += list(accuracy_rows(name, sharply))
        own, free = ("soft, of known width", "sharp; design chosen") if rubs else ("none", "none; design chosen")
        summary += [summary_row(name, own, soft), summary_row(name, free, sharply)]
        early += [*two_window_rows(name, own, soft), *two_window_rows(name, free, sharply)]
        if number >= 4:
            cases += list(imperfection_rows(name, number // 4, advance))
    made: list[Table] = [
        ("mechanisms", ACCURACY, accuracy),
        ("mechanisms-chosen", ACCURACY, sharp),
        ("mechanisms-summary", SUMMARY, summary),
        ("mechanisms-two-windows", TWO_WINDOWS, early),
        ("imperfections", IMPERFECT, cases),
    ]
    return Report(made)
