"""The refinement in C behind the weak engine: errors, standard errors, seconds, beside the bound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from bench.pendulum import RIGS, design_for
from bench.refine_cases import CASES, L1, RATE_HZ, RELEASE, TRUTH, Case, bound_of, bound_of_measured
from pvid.codegen.refine import RefineFunctions, refine_functions
from pvid.codegen.weak import weak_model_of
from pvid.codegen.weak_library import weak_native
from pvid.configuration.refine import rig_with_options
from pvid.core.weak_native import RefinedIdentifier, WeakNative
from pvid.design.refine import refine_config
from pvid.models.kapitza.refinement import refine_rig, sample_sd
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows
from pvid.rig.file import RigFile
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import WeakConfig
from pvid.setup.weak import config_of, design_tables, for_engine
from pvid.sim.pendulum import (
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Pendulum,
    Sensors,
    simulate,
    standard_sensors,
)
from pvid.sim.pendulum import standard_start as start_of

Float = npt.NDArray[np.float64]
Kind = TypeVar("Kind")
Found = TypeVar("Found")

SEEDS = 80
HEADER = (
    "rad",
    "bits",
    "rig",
    "published",
    "w / d1 / d2 %",
    "over the bound",
    "drive measured",
    "in 2 s.e.",
    "first after s",
    "median, worst at 3.5 s %",
    "bound at 3.5 s %",
    "residual level",
)

_SOON_S = 3.5


@lru_cache(4)
def _truth(case: Case) -> tuple[Float, Float]:
    """The exact angle and pivot; the pivot is read `skew_s` later than the angle."""
    pendulum = replace(STANDARD_PENDULUM, damping1=case.damping[0], damping2=case.damping[1])
    scale = RELEASE[case.angle]
    found = simulate(
        pendulum,
        sensors=Sensors(skew_s=case.skew_s),
        truth="full",
        release=(STANDARD_RELEASE[0] * scale, STANDARD_RELEASE[1] * scale),
        duration=case.duration,
    )
    return np.asarray(found.state[:, 1] - found.state[:, 0]), found.run.y


@dataclass(frozen=True)
class Outcome:
    """Of a run: relative errors and standard errors of w, d1, d2 [3] at its end; NaN if nothing was published.

    Attributes
    ----------
    first : seconds until the first publication
    soon : relative errors 3.5 s after the start [3]
    level : residual variance over its expectation
    """

    error: Float
    se: Float
    first: float
    soon: Float
    level: float


@dataclass(frozen=True)
class Engine:
    """Both stages of the pendulum for an encoder: the library, settings of the weak engine and of the refinement."""

    library: WeakNative
    weak: WeakConfig
    refine: RefineConfig
    equations: RefineFunctions

    def identifier(self, start: Float, **changes: Any) -> RefinedIdentifier:
        """From p of the weak form."""
        begun = np.append(start, 0.0).astype(np.float32)
        weak = replace(self.weak, estimator=replace(self.weak.estimator, start=begun))
        return self.library.refined_of(weak, replace(self.refine, **changes))


@lru_cache(8)
def engine_of(bits: int, options: tuple[str, ...] = ()) -> Engine:
    """Tables from the first run at the truth; the refinement knows the rig file's guess. `options` of the refinement,
    as in a rig file."""
    rig = next(one for one in RIGS if one.name == "standard" and one.bits == bits)
    sensor = {"phi": {"resolution": 2 * np.pi / 2**bits}}
    model = MechanismRig("kapitza", RATE_HZ, known={"l1": L1}, sensor=sensor).compiled()
    phi, y = standard_sensors(bits).measure(*_truth(Case(0.1, bits)), 0)
    made, engine = ready(model), weak_model_of(model)
    rows = WeakRows.of(made, {"phi": phi, "y": y}, for_engine(design_for(rig)))
    weak = config_of(design_tables(engine, rows, np.append(TRUTH, 0.0)), RATE_HZ, made.parameters)
    nominal = RigFile.standard().nominal
    guess = Pendulum(L1, nominal.l2, nominal.rho2, nominal.g).linear
    about = refine_rig(RATE_HZ, L1, guess, sample_sd(bits), y_gain_sd=0.0, samples=("y", "phi"))
    equations = refine_functions(compiled_of("kapitza").with_options(options))
    about = rig_with_options(equations, about, np.append(guess, 0.0))
    return Engine(weak_native(model, weak.design, equations), weak, refine_config(about), equations)


def run_case(case: Case, seed: int, **changes: Any) -> Outcome:
    """One run through both stages; `changes` of the refinement's settings."""
    phi, y = standard_sensors(case.bits).measure(*_truth(case), seed)
    if case.exact_drive:
        y = _truth(case)[1]
    identifier = engine_of(case.bits).identifier(start_of(seed), **changes)
    found = identifier.run_both(np.stack([y, phi], axis=1))
    with np.errstate(invalid="ignore"):
        error = np.where(found.r[:, :3] == 0, np.nan, found.r[:, :3] / TRUTH - 1)
    answered = found.r[:, 0] > 0
    first = float(np.argmax(answered)) / RATE_HZ if answered.any() else np.nan
    soon = error[min(int(_SOON_S * RATE_HZ), len(error) - 1)]
    return Outcome(error[-1], found.se[-1, :3] / TRUTH, first, soon, float(identifier.refinement.estimate.level))


def row_of(case: Case, runs: list[Outcome]) -> tuple[str, ...]:
    """Cells as in HEADER."""
    error, se = np.array([one.error for one in runs]), np.array([one.se for one in runs])
    done = np.isfinite(error[:, 0])
    if not done.any():
        return (f"{case.angle:g}", str(case.bits), case.label, f"0 of {len(runs)}", *("-",) * 8)
    error, se = error[done], se[done]
    rms = np.sqrt(np.mean(error**2, axis=0))
    soon = np.array([np.abs(one.soon).max() for one in runs])
    early = soon[np.isfinite(soon)]
    return (
        f"{case.angle:g}",
        str(case.bits),
        case.label,
        f"{done.sum()} of {len(runs)}",
        " / ".join(f"{100 * one:.2g}" for one in rms),
        *(" / ".join(f"{one:.2f}" for one in rms / bound) for bound in (bound_of(case), bound_of_measured(case))),
        f"{100 * np.mean(np.abs(error) < 2 * se):.0f} %",
        f"{np.nanmedian([one.first for one in runs]):.1f}",
        f"{100 * np.median(early):.2g}, {100 * early.max():.2g} of {early.size}" if early.size else "-",
        f"{100 * bound_of_measured(case, until_s=_SOON_S).max():.2g}",
        f"{np.median([one.level for one in runs]):.2f}",
    )


def table_of(
    cases: Sequence[Kind],
    seeds: int,
    progress: Callable[[], None],
    run: Callable[[Kind, int], Found],
    row: Callable[[Kind, list[Found]], tuple[str, ...]],
) -> list[tuple[str, ...]]:
    """A row for each case, of its runs with seeds from 0."""
    rows = []
    for case in cases:
        runs = []
        for seed in range(seeds):
            runs.append(run(case, seed))
            progress()
        rows.append(row(case, runs))
    return rows


def refine_table(seeds: int, progress: Callable[[], None], cases: Sequence[Case] = CASES) -> list[tuple[str, ...]]:
    """A row for each case."""
    return table_of(cases, seeds, progress, run_case, row_of)
