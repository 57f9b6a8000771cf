"""Where it gets hard, for any mechanism: coarse sensors, little drive, little motion, none, noise that nobody gave.

The weak form runs as on a board: its settings are made once, from a run of the shipped rig; its own trust alone judges.
What must not happen is a published answer that is far from the truth by its own standard errors and raises no alarm,
more often than chance explains.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import stats

from bench.board_weak import Answer, FixedBoard, FloatBoard, board_of
from bench.case import columns
from bench.mechanisms import design_of, size_of, start_of
from pvid.models.drive import Drive, Scaled
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import Servo, SimulatedRig, simulated_rig
from pvid.settings.enums import Core
from pvid.sim.simulated_run import PERFECT, RigSimulation

Float = npt.NDArray[np.float64]

SEEDS = 20
RARE = 1e-3  # probability below which chance is no explanation
BEYOND = 3.0  # standard errors
HEADER = columns(
    "mechanism | case | published | RMS % of each parameter | in 3 s.e. % | alarm | wrong, no alarm | else held |"
    " fixed point: published | fixed point: wrong, no alarm | by chance | fault"
)


@dataclass(frozen=True)
class Case:
    """What differs from a shipped rig.

    Attributes
    ----------
    coarser : factor on the resolution of each sensor, and so on its noise; the settings contain it
    noisier : factor on the noise alone, which the settings do not contain
    drive, start : factors on the drives, and on the first sample's coordinates and rates
    whole : with the equations of the refinement, where it has its own; those of the rows neglect something
    """

    label: str
    coarser: float = 1.0
    noisier: float = 1.0
    drive: float = 1.0
    start: float = 1.0
    whole: bool = False


CASES = (
    *(Case("as shipped" if k == 1 else f"sensors {k} times as coarse", coarser=k) for k in (1, 4, 16, 64, 256)),
    Case("10 times the noise that the settings contain", noisier=10.0),
    *(Case(f"drive x{k:g}", drive=k) for k in (0.3, 0.1, 0.03, 0.01)),
    Case("no drive", drive=0.0),
    Case("no drive, no motion", drive=0.0, start=0.0),
    *(Case(f"equations that the rows neglect, motion x{k:g}", start=k, whole=True) for k in (1, 0.5, 0.25)),
)


def cases_of(name: str) -> tuple[Case, ...]:
    """That a mechanism can have."""
    own = bool(compiled_of(name).refinement.equations)
    return tuple(one for one in CASES if own or not one.whole)


@cache
def simulation_for(name: str, case: Case) -> RigSimulation:
    """The rig of a case."""
    compiled, rig = compiled_of(name), simulated_rig(name)
    signals = tuple(
        replace(one, resolution=one.resolution * case.coarser, noise=one.noise * case.noisier)
        if one.kind == "sensor"
        else one
        for one in compiled.signals
    )
    keys = ("start", "whole_start")
    starts: dict[str, Any] = {
        key: {name: case.start * value for name, value in getattr(rig, key).items()} for key in keys
    }
    changed = replace(rig, drive=_drives(rig, case.drive), **starts)
    return RigSimulation.of(replace(compiled, signals=signals), changed, whole=case.whole)


def _drives(rig: SimulatedRig, by: float) -> dict[str, Drive | Servo]:
    found: dict[str, Drive | Servo] = {}
    for name, one in rig.drive.items():
        if isinstance(one, Servo):
            tones = tuple((by * size, hz, phase) for size, hz, phase in one.reference.tones)
            found[name] = replace(one, reference=replace(one.reference, tones=tones))
        else:
            found[name] = one if by == 1 else Scaled(one, by, 1.0)
    return found


@cache
def board(name: str, core: Core, coarser: float, whole: bool = False) -> FloatBoard | FixedBoard:
    """With settings from a run of the shipped rig with these sensors; where it is of whole equations, what the rows
    neglect is part of the standard errors, by the largest of the recorded signals."""
    of = simulation_for(name, Case("", coarser=coarser, whole=whole))
    run = of.run(0)
    return board_of(of.model, run, design_of(of, PERFECT), of.truth, core, shared=True)


def answer_of(name: str, case: Case, seed: int, core: Core = "f32") -> Answer:
    """A run of a case, from a start within +-50 %."""
    of = simulation_for(name, case)
    return board(name, core, case.coarser, case.whole).answer(of.run(seed), start_of(of, seed))


@dataclass(frozen=True)
class Outcome:
    """What became of the runs of a case.

    Attributes
    ----------
    published, alarmed : [runs]
    errors, se : of the parameters, over their sizes [runs, n_p]
    correlation : of the errors as published [runs, n_p, n_p]
    held : reasons of the runs that published nothing
    """

    published: npt.NDArray[np.bool_]
    alarmed: npt.NDArray[np.bool_]
    errors: Float
    se: Float
    correlation: Float
    held: tuple[str, ...] = field(default=())

    @classmethod
    def of(cls, name: str, case: Case, found: Sequence[Answer]) -> Outcome:
        """Of the answers to the runs of a case."""
        of = simulation_for(name, case)
        size = size_of(of)
        return cls(
            np.array([one.published for one in found]),
            np.array([one.alarm for one in found]),
            np.array([(one.p - of.truth) / size for one in found]),
            np.array([one.se / size for one in found]),
            np.array([one.correlation for one in found]),
            tuple(one.last.text for one in found if not one.published),
        )

    @property
    def covered(self) -> npt.NDArray[np.bool_]:
        """Errors within three standard errors [runs, n_p]."""
        return np.asarray(np.abs(self.errors) <= BEYOND * self.se)

    @property
    def silent(self) -> npt.NDArray[np.bool_]:
        """Runs that publish without an alarm [runs]."""
        return self.published & ~self.alarmed

    @property
    def wrong(self) -> int:
        """Silent runs with a parameter beyond three standard errors."""
        return int((self.silent & ~self.covered.all(axis=1)).sum())

    @property
    def chance(self) -> float:
        """Probability of such a run under normal errors with the published covariance."""
        if not self.silent.any():
            return 0.0
        cov = np.median(self.correlation[self.silent], axis=0)
        beyond = np.full(len(cov), BEYOND)
        normal = stats.multivariate_normal(cov=cov, allow_singular=True, seed=0)
        return max(0.0, 1.0 - float(normal.cdf(beyond, lower_limit=-beyond)))

    @property
    def fault(self) -> str:
        """What chance explains in fewer than one of 1000 rows; "": nothing."""
        runs = int(self.silent.sum())
        if not runs:
            return ""
        if stats.binom.sf(self.wrong - 1, runs, self.chance) < RARE:
            return "wrong"
        mean = np.abs(np.mean((self.errors / self.se)[self.silent], axis=0))
        beyond = 2 * mean.size * stats.norm.sf(mean.max() * np.sqrt(runs))
        return "biased" if beyond < RARE else ""


def run_case(
    name: str, case: Case, seeds: int = SEEDS, core: Core = "f32", progress: Callable[[], object] = lambda: None
) -> Outcome:
    """All runs of a case."""
    found = []
    for seed in range(seeds):
        found.append(answer_of(name, case, seed, core))
        progress()
    return Outcome.of(name, case, found)


def row(name: str, case: Case, floating: Outcome, fixed: Outcome) -> tuple[str, ...]:
    """Cells as in HEADER; errors are the RMS of each parameter over the published runs in float32."""
    shown, runs = floating.published, len(floating.published)
    figures = ["-", "-"]
    if shown.any():
        rms = 100 * np.sqrt(np.mean(np.square(floating.errors[shown]), axis=0))
        figures = [" / ".join(f"{one:.2g}" for one in rms), f"{100 * floating.covered[shown].mean():.0f}"]
    reasons = Counter(floating.held).most_common(1)
    return (
        name,
        case.label,
        f"{shown.sum()}/{runs}",
        *figures,
        f"{(shown & floating.alarmed).sum()}/{shown.sum()}" if shown.any() else "-",
        str(floating.wrong),
        reasons[0][0] if reasons else "",
        f"{fixed.published.sum()}/{runs}",
        str(fixed.wrong),
        f"{floating.silent.sum() * floating.chance:.2f}" if floating.silent.any() else "-",
        ", ".join(f"{core}: {one.fault}" for core, one in (("f32", floating), ("q31", fixed)) if one.fault),
    )


def rows(names: Sequence[str], seeds: int, progress: Callable[[], object]) -> Iterator[tuple[str, ...]]:
    """All cases of mechanisms."""
    for name in names:
        for case in cases_of(name):
            floating = run_case(name, case, seeds, "f32", progress)
            yield row(name, case, floating, run_case(name, case, seeds, "q31"))
