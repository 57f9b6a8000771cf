"""Errors of the weak engine in C float32 beside those of the float64 oracle: same runs, same design, same start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.mechanisms import design_of, size_of, start_of
from pvid.codegen.weak import weak_model_of
from pvid.codegen.weak_library import weak_native
from pvid.configuration.weak import samples_of
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import batch
from pvid.setup.weak import config_of, design_tables, for_engine
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import PERFECT, SOFT, simulation_of

Float = npt.NDArray[np.float64]

HEADER = (
    "mechanism",
    "friction",
    "functions",
    "runs",
    "published",
    "RMS % of the engine",
    "of the oracle",
    "largest ratio: of",
    "ratio",
    "started at the truth",
    "engine - oracle, s.e.: RMS",
    "largest",
)


@dataclass(frozen=True)
class Case:
    """A mechanism with one of its laws of friction."""

    name: str
    law: Imperfections

    @property
    def friction(self) -> str:
        """In the table."""
        if not simulation_of(self.name).rig.friction_width:
            return "none"
        return self.law.friction


@dataclass(frozen=True)
class Errors:
    """Of the runs of a case.

    Attributes
    ----------
    engine, oracle : errors over the parameters' sizes [runs, n_p]
    from_truth : of the engine that starts at the truth [runs, n_p]
    apart : engine less oracle in standard errors that the oracle predicts [runs, n_p]
    published : runs in which the engine published
    functions : K
    """

    engine: Float
    oracle: Float
    from_truth: Float
    apart: Float
    published: int
    functions: int

    def ratios(self) -> Float:
        """RMS error of the engine over that of the oracle [n_p]."""
        return np.asarray(rms(self.engine) / rms(self.oracle))

    def ratios_from_truth(self) -> Float:
        """The same of the engine that starts at the truth: without windows that are weighted at a wrong p [n_p]."""
        return np.asarray(rms(self.from_truth) / rms(self.oracle))


def cases(names: Sequence[str]) -> list[Case]:
    """Without friction once, else with a soft and with a sharp one."""
    found = []
    for name in names:
        found.append(Case(name, SOFT))
        if simulation_of(name).rig.friction_width:
            found.append(Case(name, PERFECT))
    return found


def rms(x: Float) -> Float:
    """Over the runs."""
    return np.asarray(np.sqrt(np.mean(np.square(x), axis=0)))


def errors_of(case: Case, seeds: int, progress: Callable[[], object] | None = None) -> Errors:
    """Runs of a case; the tables are those of the first one at the truth, the starts within +-50 % of it."""
    simulation = simulation_of(case.name)
    compiled = simulation.model
    made, model = ready(compiled), weak_model_of(compiled)
    design = for_engine(design_of(simulation, case.law))
    tables: Any = None
    engine, oracle, from_truth, apart, published = [], [], [], [], 0
    for seed in range(seeds):
        run, start = simulation.run(seed, case.law), start_of(simulation, seed)
        rows = WeakRows.of(made, run, design)
        tables = tables or design_tables(model, rows, simulation.truth)
        config = config_of(tables, design.sample_rate, made.parameters)
        core, p = _ran(compiled, config, run, start, tables)
        used = core.counters["rows"] // (design.functions * rows.kinds)
        fit = batch(rows.only(slice(0, used)) if used else rows, start, equation_error=False)
        size = size_of(simulation)
        engine.append((p - simulation.truth) / size)
        _, q = _ran(compiled, config, run, np.asarray(simulation.truth), tables)
        from_truth.append((q - simulation.truth) / size)
        oracle.append((fit.p - simulation.truth) / size)
        apart.append((p - fit.p) / uncertainty(fit).predicted)
        published += core.is_published
        if progress is not None:
            progress()
    return Errors(
        np.array(engine), np.array(oracle), np.array(from_truth), np.array(apart), published, design.functions
    )


def _ran(compiled: Any, config: Any, run: Any, begin: Float, tables: Any) -> tuple[Any, Float]:
    """The engine after a run from a start, and its p."""
    own = replace(config.estimator, start=np.clip(begin, config.estimator.lower, config.estimator.upper))
    core = weak_native(compiled, tables).identifier_of(replace(config, estimator=own))
    record = core.run_samples(samples_of(config, run), sums=False, hashes=False)
    return core, record.p[-1].astype(np.float64)


def row_of(case: Case, found: Errors) -> tuple[str, ...]:
    """Cells as in HEADER."""
    ratios = found.ratios()
    worst = int(np.argmax(ratios))
    return (
        case.name,
        case.friction,
        str(found.functions),
        str(len(found.engine)),
        str(found.published),
        f"{100 * np.sqrt(np.mean(found.engine**2)):.3g}",
        f"{100 * np.sqrt(np.mean(found.oracle**2)):.3g}",
        simulation_of(case.name).model.p_names[worst],
        f"{ratios[worst]:.3f}",
        f"{found.ratios_from_truth()[worst]:.3f}",
        f"{np.sqrt(np.mean(found.apart**2)):.2g}",
        f"{np.max(np.abs(found.apart)):.2g}",
    )


def table(names: Sequence[str], seeds: int, progress: Callable[[], object] | None = None) -> Iterator[tuple[str, ...]]:
    """A row of cells for each case."""
    for case in cases(names):
        yield row_of(case, errors_of(case, seeds, progress))
