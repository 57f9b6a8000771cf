"""Both stages in C on the simulated rigs of the shipped mechanisms: errors beside the Cramer-Rao bound."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from bench.mechanisms import CASES, size_of, start_of
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.refine import refine_functions
from pvid.codegen.weak_library import weak_native
from pvid.configuration.refine import refine_design
from pvid.configuration.weak import samples_of, weak_config
from pvid.core.weak_native import RefinedIdentifier
from pvid.models import mechanisms
from pvid.models.simulated_rig import SimulatedRig, simulated_rig
from pvid.oracle.weak.design import WeakDesign
from pvid.settings.enums import Reason
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import Float32, WeakConfig
from pvid.sim.bound import bound
from pvid.sim.simulated_run import RigSimulation

Float = npt.NDArray[np.float64]

NAMES = tuple(mechanisms.names())
RATES = {"furuta": (1000.0, 1250.0, 2000.0)}  # beside the rig's own [Hz]
HEADER = (
    *("mechanism", "Hz", "parameter", "bound %", "weak: RMS / bound", "refined: RMS / bound", "RMS / s.e."),
    *("in 2 s.e. %", "refined", "first after s"),
)

FRICTION = ("dc_motor", "cart_pendulum", "two_link_arm", "two_mass_drive")
IMPERFECT = (
    *("mechanism", "imperfection", "runs with an estimate", "of the time %", "median error / s.e.", "largest / s.e."),
    *("largest %", "beyond 5 s.e. and 1 %"),
)


def at_rate(rig: SimulatedRig, rate: float) -> SimulatedRig:
    """The rig with faster samples, and filters of the same lengths in seconds."""
    times = rate / rig.sample_rate
    design = dict(rig.design)
    design["decimation"] = round(design.get("decimation", 1) * times)
    for key in ("taps", "rate_taps"):
        if key in design:
            design[key] = round(design[key] * times) | 1
    return replace(rig, sample_rate=rate, design=design, substeps=max(2, round(rig.substeps / times)))


@dataclass(frozen=True, eq=False)
class Case:
    """A mechanism's rig with both stages; its settings are made from the run of seed 0."""

    simulation: RigSimulation
    config: WeakConfig
    settings: RefineConfig

    @classmethod
    def of(cls, name: str, rate: float) -> Case:
        compiled, rig = mechanisms.compiled_of(name), at_rate(simulated_rig(name), rate)
        simulation = RigSimulation.of(compiled, rig, whole=True)
        run, truth = simulation.run(), simulation.truth
        config = weak_config(compiled, run, WeakDesign(rate, rig.window_s, **rig.design), truth)  # type: ignore[arg-type]
        return cls(simulation, config, refine_design(compiled, config, run, truth))

    def identifier(self, seed: int) -> RefinedIdentifier:
        """That starts within 50 % of the truth."""
        start = start_of(self.simulation, seed).astype(np.float32)
        config = replace(self.config, estimator=replace(self.config.estimator, start=start))
        model = self.simulation.model
        return weak_native(model, config.design, refine_functions(model)).refined_of(config, self.settings)

    def samples(self, seed: int) -> Float32:
        """Of a run."""
        return samples_of(self.config, self.simulation.run(seed))


@dataclass(frozen=True)
class Outcome:
    """Of a run, in the order of p: errors of the weak form; of the refined estimate at the end, its standard errors,
    NaN where there is none; seconds until the first one."""

    weak: Float
    error: Float
    se: Float
    first: float


def run_case(case: Case, seed: int) -> Outcome:
    """One run through both stages."""
    model, truth = case.simulation.model, case.simulation.truth
    identifier = case.identifier(seed)
    found = identifier.run_both(case.samples(seed))
    places = refine_functions(model).places_of_p
    there = np.any(found.r[-1] != 0)
    r, se = (np.where(there, one[-1].astype(np.float64), np.nan)[places] for one in (found.r, found.se))
    weak = np.array(list(identifier.estimator.p), np.float64)[: len(truth)]
    published = np.flatnonzero(found.told == Reason.UPDATED)
    first = published[0] / case.simulation.rig.sample_rate if len(published) else np.nan
    return Outcome(weak - truth, r - truth, se, float(first))


@cache
def cases(names: tuple[str, ...] = NAMES) -> list[tuple[str, float, Case]]:
    """Of mechanisms whose equations the second stage in C takes."""
    taken = [one for one in names if GeneratedModel(mechanisms.compiled_of(one), "").refinement.refusal is None]
    given = [(name, rate) for name in taken for rate in RATES.get(name, (simulated_rig(name).sample_rate,))]
    return [(name, rate, Case.of(name, rate)) for name, rate in given]


def rows_of(name: str, rate: float, case: Case, runs: list[Outcome]) -> Iterator[tuple[str, ...]]:
    """A row for each parameter: cells as in HEADER."""
    simulation = case.simulation
    least, size = bound(RigSimulation.of(simulation.model, simulation.rig)), size_of(simulation)
    weak = np.sqrt(np.mean([one.weak**2 for one in runs], axis=0))
    refined = [one for one in runs if np.isfinite(one.error).all()]
    first = [one.first for one in runs if np.isfinite(one.first)]
    for k, parameter in enumerate(simulation.model.p_names):
        cells = ("-", "-", "-")
        if refined:
            error, se = (np.array([getattr(one, key)[k] for one in refined]) for key in ("error", "se"))
            rms = float(np.sqrt(np.mean(error**2)))
            share = 100 * np.mean(np.abs(error) < 2 * se)
            cells = f"{rms / least[k]:.2g}", f"{rms / np.mean(se):.2f}", f"{share:.0f}"
        yield (
            name,
            f"{rate:g}",
            parameter,
            f"{100 * least[k] / size[k]:.2g}",
            f"{weak[k] / least[k]:.2g}",
            *cells,
            f"{len(refined)} of {len(runs)}",
            f"{np.median(first):.1f}" if first else "-",
        )


def imperfect_rows(name: str, case: Case, seeds: int) -> Iterator[tuple[str, ...]]:
    """A row for each imperfection but those of gains: errors of all published estimates, of their worst parameter."""
    simulation = case.simulation
    size = size_of(simulation)
    places = refine_functions(simulation.model).places_of_p
    for imperfection in CASES:
        imperfections = imperfection.of(simulation)
        if imperfections is None or imperfections.gain:
            continue
        ratios: list[Float] = []
        shares: list[Float] = []
        share_of_time = []
        for seed in range(seeds):
            samples = samples_of(case.config, simulation.run(seed, imperfections))
            found = case.identifier(seed).run_both(samples)
            there = np.any(found.r != 0, axis=1)
            new = there & np.concatenate([[True], np.any(found.r[1:] != found.r[:-1], axis=1)])
            error = np.abs(found.r[new][:, places] - simulation.truth)
            share_of_time.append(float(np.mean(there)))
            if np.any(new):
                ratios.append(error / found.se[new][:, places])
                shares.append(error / size)
        cells = ("-", "-", "-", "0")
        if ratios:
            ratio, share = np.concatenate(ratios), np.concatenate(shares)
            wrong = int(np.sum(np.any((ratio > 5) & (share > 0.01), axis=1)))
            cells = f"{np.median(ratio.max(1)):.1f}", f"{ratio.max():.1f}", f"{100 * share.max():.2g}", str(wrong)
        yield name, imperfection.name, f"{len(ratios)} of {seeds}", f"{100 * np.mean(share_of_time):.0f}", *cells


def refined_rows(names: tuple[str, ...], seeds: int, progress: Callable[[], object]) -> list[tuple[str, ...]]:
    """Rows of HEADER."""
    rows = []
    for name, rate, case in cases(names):
        runs = []
        for seed in range(seeds):
            runs.append(run_case(case, seed))
            progress()
        rows += list(rows_of(name, rate, case, runs))
    return rows


def friction_rows(names: tuple[str, ...], seeds: int, _: Callable[[], object]) -> list[tuple[str, ...]]:
    """Rows of IMPERFECT, of half as many seeds."""
    given = [(name, case) for name, _, case in cases(names) if name in FRICTION]
    return [row for name, case in given for row in imperfect_rows(name, case, seeds // 2)]
