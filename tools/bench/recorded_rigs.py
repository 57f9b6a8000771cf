"""Recordings of real rigs: identified from one run, beside the published values, and another run predicted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.case import Advance, Report, columns
from bench.recordings import KEPT, MECHANISMS, PIECES, SOURCES, Source, write_source
from bench.replay import Match, Replay
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import batch
from pvid.rig.run import Recording
from pvid.sim.plant import SHARP, Friction

Float = npt.NDArray[np.float64]

HEADER = ("rig", "parameter", "identified on one run", "on the other", "published", "the two apart")
PREDICTIONS = columns(
    "rig | sensor | R^2 of the second run from the first | of the first from the second | of the second, "
    "published | RMS error of the second"
)
VERDICTS = ("rig", "alarms of the first run", "of the second", "beyond 4 s.e. between the runs")

TRAPS = ("rig", "run that must raise", "alarms", "R^2 of the rows", "first parameter")

# Estimates differ by so many standard errors: their difference is not covered.
CLASH = 4.0
_LEAST_R2 = 0.9
_SOFT = 0.02  # width of a soft friction [unit of the velocity]


@dataclass(frozen=True)
class Design:
    """Windows of a rig.

    Attributes
    ----------
    window_s : [s], about two periods of its slow motion
    functions : as few as the motion needs; what lies above is friction and cogging that no equation has
    rate_taps : of the velocity
    decimation : raw samples a step
    sensors_only : weights of the sensors' noise alone
    """

    window_s: float
    functions: int
    rate_taps: int = 15
    decimation: int = 1
    sensors_only: bool = False


DESIGNS: Mapping[str, Design] = {
    "double_pendulum_a": Design(2.0, 9),
    "double_pendulum_c": Design(2.0, 9),
    "simple_pendulum": Design(1.0, 5, rate_taps=11),
    "free_pendulum": Design(1.0, 13, decimation=4),
    "free_double_pendulum": Design(1.0, 13, decimation=4),
    "cell_dmegc": Design(600.0, 12, sensors_only=True),
    "motor_generator": Design(6.0, 12),
    "bicycle_fork": Design(4.8, 8),
    "torso_lift": Design(10.0, 20, rate_taps=5),
}


@dataclass(frozen=True)
class Estimate:
    """p and its standard errors [n_p]; the names of the verdict's alarms."""

    p: Float
    se: Float
    alarms: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rig:
    """A rig's two runs.

    Attributes
    ----------
    source : where they are from
    model : its mechanism
    runs : the two recordings
    estimates : from each run
    """

    source: Source
    model: CompiledModel
    runs: tuple[Recording, Recording]
    estimates: tuple[Estimate, Estimate]

    @property
    def published(self) -> Float | None:
        """p [n_p] where every unknown but offsets is published: 0 where it is not. None: nothing is."""
        if not self.source.published:
            return None
        return np.array([self.source.published.get(name, 0.0) for name in self.model.p_names])

    def clash(self) -> Float:
        """Distance of the two estimates in standard errors of it [n_p]."""
        one, other = self.estimates
        return np.asarray(np.abs(one.p - other.p) / np.hypot(one.se, other.se))

    def replay(self, run: int, friction: Friction = SHARP) -> Replay:
        """The plant under one run's inputs."""
        return Replay(self.model, self.runs[run], friction=friction)

    def predicted(self) -> Mapping[str, Match]:
        """The second run, with the parameters of the first."""
        return self.replay(1).matches(self.estimates[0].p)


def windows_of(run: Recording, design: Design) -> WeakDesign:
    """At a run's rate."""
    return WeakDesign(
        run.sample_rate,
        design.window_s,
        design.functions,
        decimation=design.decimation,
        rate_taps=design.rate_taps,
    )


def identified(model: CompiledModel, run: Recording, design: Design) -> Estimate:
    """From all windows of a run."""
    windows = windows_of(run, design)
    if design.sensors_only:
        fit = batch(WeakRows.of(ready(model), run.signals, windows), equation_error=False)
        return Estimate(fit.p, uncertainty(fit).se)
    found = identify(model, run.signals, run.sample_rate, design=windows)
    return Estimate(found.p, found.se, tuple(one.name for one in found.verdict.reasons if one.alarm))


def rig_of(source: Source, runs: tuple[Recording, Recording], design: Design) -> Rig:
    """Identifies both runs."""
    model = source.model()
    first, second = (identified(model, run, design) for run in runs)
    return Rig(source, model, runs, (first, second))


def rigs(folder: Path, sources: Sequence[Source] = SOURCES) -> Iterator[Rig]:
    """Of the pieces that `bench recordings --cut` wrote, or of those kept in tests/data/recordings."""
    for source in sources:
        first, second = (source.load(folder, piece) for piece in PIECES)
        yield rig_of(source, (first, second), DESIGNS[source.name])


def value_rows(rig: Rig) -> list[tuple[str, ...]]:
    """Rows of the table of values."""
    rows: list[tuple[str, ...]] = []
    clash = rig.clash()
    for k, (name, unknown) in enumerate(zip(rig.model.p_names, rig.model.unknowns, strict=True)):
        values = [f"{one.p[k]:.4g} +- {one.se[k]:.1g}" for one in rig.estimates]
        published = rig.source.published.get(name)
        theirs = "-" if published is None else f"{published:.4g}"
        shown = f"{name} {unknown.unit}".strip()
        rows.append((rig.source.name, shown, *values, theirs, f"{clash[k]:.1f} s.e."))
    return rows


def prediction_rows(rig: Rig) -> list[tuple[str, ...]]:
    """Rows of the table of predictions: the second run from the first, the first from the second."""
    forth = rig.predicted()
    back = rig.replay(0).matches(rig.estimates[1].p)
    published = rig.published
    theirs = None if published is None else rig.replay(1, friction_of(published, rig.model)).matches(published)
    rows: list[tuple[str, ...]] = []
    for name, match in forth.items():
        unit = rig.model.signal(name).unit
        of_theirs = "-" if theirs is None else f"{theirs[name].r2:.4f}"
        cells = (f"{match.r2:.4f}", f"{back[name].r2:.4f}", of_theirs, f"{match.rms:.3g} {unit}".strip())
        rows.append((rig.source.name, name, *cells))
    return rows


def verdict_rows(rig: Rig) -> list[tuple[str, ...]]:
    """Rows of the table of alarms."""
    differing = listed([name for name, apart in zip(rig.model.p_names, rig.clash(), strict=True) if apart > CLASH])
    return [(rig.source.name, *(listed(list(one.alarms)) for one in rig.estimates), differing)]


def missed(rig: Rig) -> list[str]:
    """The bars that a rig misses, a sentence each.

    The second run is predicted open loop to its end, and better than by the published values; the estimates of both
    runs agree but for offsets, or there is an alarm.
    """
    faults = []
    predicted = rig.predicted()
    published = rig.published
    theirs = None if published is None else rig.replay(1, friction_of(published, rig.model)).matches(published)
    for name, match in predicted.items():
        if not match.r2 > _LEAST_R2:
            faults.append(f"{rig.source.name}: {name} is predicted with R^2 {match.r2:.4f}, not above {_LEAST_R2}")
        if theirs is not None and not match.r2 > theirs[name].r2:
            faults.append(f"{rig.source.name}: the published values predict {name} better")
    apart = [name for name, clash in zip(rig.model.p_names, rig.clash(), strict=True) if clash > CLASH]
    differing = [name for name in apart if not name.startswith("o")]
    if differing and not any(one.alarms for one in rig.estimates):
        faults.append(f"{rig.source.name}: the runs disagree on {listed(differing)}, and there is no alarm")
    return faults


def trap_rows(source: Source, folder: Path) -> list[tuple[str, ...]]:
    """Rows of the table of runs that do not show the mechanism."""
    rows: list[tuple[str, ...]] = []
    for trap in source.traps:
        run = source.load(folder, trap)
        windows = windows_of(run, DESIGNS[source.name])
        found = identify(source.model(), run.signals, run.sample_rate, design=windows)
        alarms: list[str] = [one.name for one in found.verdict.reasons if one.alarm]
        name, (value, error) = next(iter(found.values.items()))
        r2 = listed([f"{one:.4f}" for one in found.r2.values()])
        rows.append((source.name, trap, listed(alarms), r2, f"{name} {value:.3g} +- {error:.1g}"))
    return rows


def listed(names: list[str]) -> str:
    """In a cell."""
    return ", ".join(names) or "-"


def friction_of(p: Float, model: CompiledModel) -> Friction:
    """Sharp; soft where a friction is 0, which the simulation would look for at every reversal."""
    none = any(name.startswith("c") and value == 0.0 for name, value in zip(model.p_names, p, strict=True))
    return Friction(_SOFT) if none else SHARP


def _report(sources: Sequence[Source], folder: Path, origins: Path | None, prefix: str) -> Report:
    """Of the pieces in a folder; with `origins`, they are cut from there instead."""
    if origins is not None:
        return Report(said=[f"{path} written" for one in sources for path in write_source(one, origins, folder)])
    found = list(rigs(folder, sources))
    traps = [row for one in found for row in trap_rows(one.source, folder)]
    faults = [fault for one in found for fault in missed(one)]
    faults += [
        f"{row[0]}: the run {row[1]} does not raise its alarm" for row in traps if row[1] not in row[2].split(", ")
    ]
    tables = [
        (prefix + name, header, [row for one in found for row in rows_of(one)])
        for name, header, rows_of in (
            ("recordings", HEADER, value_rows),
            ("predictions", PREDICTIONS, prediction_rows),
            ("verdicts", VERDICTS, verdict_rows),
        )
    ]
    return Report([*tables, ("traps", TRAPS, traps)], faults)


def report(folder: Path, cut: Path | None, advance: Advance) -> Report:
    """See bench.case."""
    return _report(SOURCES, folder, cut, "")


def kept_report(cut: Path | None, advance: Advance) -> Report:
    """See bench.case."""
    return _report(KEPT, MECHANISMS, cut, "kept-")
