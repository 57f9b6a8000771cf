"""Errors of the weak form in C: float32 beside the float64 oracle, fixed point beside float32, on the same runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.mechanisms import design_of, size_of, start_of
from pvid.codegen.weak import weak_model_of
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.configuration.weak import samples_of, weak_config
from pvid.configuration.weak_q31 import weak_q31_for_run
from pvid.configuration.weak_tables import config_of, design_tables, for_core
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows
from pvid.oracle.weak.solve import batch
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import PERFECT, SOFT, simulation_of

Float = npt.NDArray[np.float64]

HEADER = (
    "mechanism",
    "friction",
    "functions",
    "runs",
    "published",
    "RMS % of the identifier",
    "of the oracle",
    "largest ratio: of",
    "ratio",
    "started at the truth",
    "identifier - oracle, s.e.: RMS",
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
    weak, oracle : errors over the parameters' sizes [runs, n_p]
    from_truth : of the identifier that starts at the truth [runs, n_p]
    apart : identifier less oracle in standard errors that the oracle predicts [runs, n_p]
    published : runs in which the identifier published
    functions : K
    """

    weak: Float
    oracle: Float
    from_truth: Float
    apart: Float
    published: int
    functions: int

    def ratios(self) -> Float:
        """RMS error of the identifier over that of the oracle [n_p]."""
        return np.asarray(rms(self.weak) / rms(self.oracle))

    def ratios_from_truth(self) -> Float:
        """The same of the identifier that starts at the truth: without windows that are weighted at a wrong p [n_p]."""
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


def errors_of(case: Case, seeds: int, progress: Callable[[], object] = lambda: None) -> Errors:
    """Runs of a case; the tables are those of the first one at the truth, the starts within +-50 % of it."""
    simulation = simulation_of(case.name)
    compiled = simulation.model
    made, model = ready(compiled), weak_model_of(compiled)
    design = for_core(design_of(simulation, case.law))
    tables: Any = None
    weak, oracle, from_truth, apart, published = [], [], [], [], 0
    for seed in range(seeds):
        run, start = simulation.run(seed, case.law), start_of(simulation, seed)
        rows = WeakRows.of(made, run, design)
        tables = tables or design_tables(model, rows, simulation.truth)
        config = config_of(tables, design.sample_rate, made.parameters)
        core, p = _ran(compiled, config, run, start, tables)
        used = core.counters["rows"] // (design.functions * rows.kinds)
        fit = batch(rows.only(slice(0, used)) if used else rows, start, equation_error=False)
        size = size_of(simulation)
        weak.append((p - simulation.truth) / size)
        _, q = _ran(compiled, config, run, np.asarray(simulation.truth), tables)
        from_truth.append((q - simulation.truth) / size)
        oracle.append((fit.p - simulation.truth) / size)
        apart.append((p - fit.p) / uncertainty(fit).predicted)
        published += core.is_published
        progress()
    return Errors(np.array(weak), np.array(oracle), np.array(from_truth), np.array(apart), published, design.functions)


def _ran(compiled: Any, config: Any, run: Any, begin: Float, tables: Any) -> tuple[Any, Float]:
    """The identifier after a run from a start, and its p."""
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
        str(len(found.weak)),
        str(found.published),
        f"{100 * np.sqrt(np.mean(found.weak**2)):.3g}",
        f"{100 * np.sqrt(np.mean(found.oracle**2)):.3g}",
        simulation_of(case.name).model.p_names[worst],
        f"{ratios[worst]:.3f}",
        f"{found.ratios_from_truth()[worst]:.3f}",
        f"{np.sqrt(np.mean(found.apart**2)):.2g}",
        f"{np.max(np.abs(found.apart)):.2g}",
    )


def table(names: Sequence[str], seeds: int, progress: Callable[[], object] = lambda: None) -> Iterator[tuple[str, ...]]:
    """A row of cells for each case."""
    for case in cases(names):
        yield row_of(case, errors_of(case, seeds, progress))


# ---- fixed point ----

FIXED_HEADER = (
    "mechanism",
    "friction",
    "functions",
    "runs",
    "published: fixed, float",
    "RMS % in fixed point",
    "in float32",
    "largest ratio: of",
    "ratio",
    "apart, s.e.: RMS",
    "largest",
)


@dataclass(frozen=True)
class FixedErrors:
    """Of the runs of a case.

    Attributes
    ----------
    fixed, floating : errors over the parameters' sizes [runs, n_p]
    apart : fixed point less float32 in standard errors of float32 [runs, n_p]
    published : runs in which each published
    functions : K
    """

    fixed: Float
    floating: Float
    apart: Float
    published: tuple[int, int]
    functions: int


def fixed_errors_of(case: Case, seeds: int, progress: Callable[[], object] = lambda: None) -> FixedErrors:
    """Runs of a case; tables and start of both are those of the first one."""
    simulation = simulation_of(case.name)
    design = design_of(simulation, case.law)
    truth = np.asarray(simulation.truth)
    first = simulation.run(0, case.law)
    weak = weak_q31_for_run(simulation.model, first, design, truth)
    library = weak_native_q31(weak.made, weak.parameters, weak.config)
    config = weak_config(simulation.model, first, design, truth)
    start = weak.values(weak.config.estimator.start).astype(np.float32)
    config = replace(config, estimator=replace(config.estimator, start=start))
    fixed, floating, apart, published = [], [], [], np.zeros(2, np.int64)
    for seed in range(seeds):
        counts = weak.counts_of(simulation.run(seed, case.law))
        run = dict(zip(weak.sample_names, (counts * np.array(weak.lsb)).T, strict=True))
        mine = library.identifier()
        p = weak.values(mine.run_samples(counts, sums=False, hashes=False).p[-1])
        theirs = weak_native(simulation.model, config.design).identifier_of(config)
        other = theirs.run_samples(samples_of(config, run), sums=False, hashes=False).p[-1].astype(np.float64)
        se = np.asarray(theirs.estimate["se"], np.float64)[: len(truth)]
        fixed.append((p - truth) / size_of(simulation))
        floating.append((other - truth) / size_of(simulation))
        apart.append((p - other) / se)
        published += (mine.is_published, theirs.is_published)
        progress()
    both = (int(published[0]), int(published[1]))
    return FixedErrors(np.array(fixed), np.array(floating), np.array(apart), both, weak.config.design.functions)


def fixed_row_of(case: Case, found: FixedErrors) -> tuple[str, ...]:
    """Cells as in FIXED_HEADER."""
    ratios = rms(found.fixed) / rms(found.floating)
    worst = int(np.argmax(ratios))
    return (
        case.name,
        case.friction,
        str(found.functions),
        str(len(found.fixed)),
        "{}, {}".format(*found.published),
        f"{100 * np.sqrt(np.mean(found.fixed**2)):.3g}",
        f"{100 * np.sqrt(np.mean(found.floating**2)):.3g}",
        simulation_of(case.name).model.p_names[worst],
        f"{ratios[worst]:.3f}",
        f"{np.sqrt(np.mean(found.apart**2)):.2g}",
        f"{np.max(np.abs(found.apart)):.2g}",
    )


def fixed_table(
    names: Sequence[str], seeds: int, progress: Callable[[], object] = lambda: None
) -> Iterator[tuple[str, ...]]:
    """A row of cells for each case."""
    for case in cases(names):
        yield fixed_row_of(case, fixed_errors_of(case, seeds, progress))
