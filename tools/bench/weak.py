"""Errors of the weak form in C: float32 beside the float64 oracle, fixed point beside float32, on the same runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.case import Advance, columns
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

HEADER = columns(
    "mechanism | friction | functions | runs | published | RMS % of the identifier | of the oracle | largest "
    "ratio: of | ratio | started at the truth | identifier - oracle, s.e.: RMS | largest"
)
FIXED_HEADER = columns(
    "mechanism | friction | functions | runs | published: fixed, float | RMS % in fixed point | in float32 | "
    "largest ratio: of | ratio | apart, s.e.: RMS | largest"
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
    """Of the runs of a case, by an identifier in C and by what it is compared with.

    Attributes
    ----------
    mine, other : errors over the parameters' sizes [runs, n_p]
    apart : mine less other in standard errors [runs, n_p]
    published : runs in which the identifier published, and the other one in C
    functions : K
    from_truth : of the identifier that starts at the truth [runs, n_p]; it weights no window at a wrong p
    """

    mine: Float
    other: Float
    apart: Float
    published: tuple[int, ...]
    functions: int
    from_truth: Float | None = None

    def ratios(self, of: Float | None = None) -> Float:
        """RMS error of the identifier over that of the other one [n_p]."""
        return np.asarray(rms(self.mine if of is None else of) / rms(self.other))


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


def errors_of(case: Case, seeds: int, advance: Advance = lambda: None) -> Errors:
    """In float32 beside the oracle; the tables are those of the first run at the truth, the starts within +-50 %."""
    simulation = simulation_of(case.name)
    compiled, truth, size = simulation.model, np.asarray(simulation.truth), size_of(simulation)
    made, model = ready(compiled), weak_model_of(compiled)
    design = for_core(design_of(simulation, case.law))
    tables: Any = None
    mine, other, apart, from_truth, published = [], [], [], [], 0
    for seed in range(seeds):
        run, start = simulation.run(seed, case.law), start_of(simulation, seed)
        rows = WeakRows.of(made, run, design)
        tables = tables or design_tables(model, rows, truth)
        config = config_of(tables, design.sample_rate, made.parameters)
        (core, p), (_, q) = (_ran(compiled, config, run, one, tables) for one in (start, truth))
        used = core.counters["rows"] // (design.functions * rows.kinds)
        fit = batch(rows.only(slice(0, used)) if used else rows, start, equation_error=False)
        mine.append((p - truth) / size)
        from_truth.append((q - truth) / size)
        other.append((fit.p - truth) / size)
        apart.append((p - fit.p) / uncertainty(fit).predicted)
        published += core.is_published
        advance()
    found = [np.array(one) for one in (mine, other, apart)]
    return Errors(found[0], found[1], found[2], (published,), design.functions, np.array(from_truth))


def _ran(compiled: Any, config: Any, run: Any, begin: Float, tables: Any) -> tuple[Any, Float]:
    """The identifier after a run from a start, and its p."""
    own = replace(config.estimator, start=np.clip(begin, config.estimator.lower, config.estimator.upper))
    core = weak_native(compiled, tables).identifier_of(replace(config, estimator=own))
    record = core.run_samples(samples_of(config, run), sums=False, hashes=False)
    return core, record.p[-1].astype(np.float64)


def fixed_errors_of(case: Case, seeds: int, advance: Advance = lambda: None) -> Errors:
    """In fixed point beside float32; tables and start of both are those of the first run."""
    simulation = simulation_of(case.name)
    design, truth, size = design_of(simulation, case.law), np.asarray(simulation.truth), size_of(simulation)
    first = simulation.run(0, case.law)
    weak = weak_q31_for_run(simulation.model, first, design, truth)
    library = weak_native_q31(weak.made, weak.parameters, weak.config)
    config = weak_config(simulation.model, first, design, truth)
    start = weak.values(weak.config.estimator.start).astype(np.float32)
    config = replace(config, estimator=replace(config.estimator, start=start))
    found, apart, published = [], [], np.zeros(2, np.int64)
    for seed in range(seeds):
        counts = weak.counts_of(simulation.run(seed, case.law))
        run = dict(zip(weak.sample_names, (counts * np.array(weak.lsb)).T, strict=True))
        mine = library.identifier()
        p = weak.values(mine.run_samples(counts, sums=False, hashes=False).p[-1])
        theirs = weak_native(simulation.model, config.design).identifier_of(config)
        other = theirs.run_samples(samples_of(config, run), sums=False, hashes=False).p[-1].astype(np.float64)
        found.append([(p - truth) / size, (other - truth) / size])
        apart.append((p - other) / np.asarray(theirs.estimate["se"], np.float64)[: len(truth)])
        published += (mine.is_published, theirs.is_published)
        advance()
    both = np.array(found)
    return Errors(both[:, 0], both[:, 1], np.array(apart), tuple(published.tolist()), weak.config.design.functions)


def row_of(case: Case, found: Errors) -> tuple[str, ...]:
    """Cells as in HEADER, or in FIXED_HEADER, which has none of the start at the truth."""
    ratios = found.ratios()
    worst = int(np.argmax(ratios))
    return (
        case.name,
        case.friction,
        str(found.functions),
        str(len(found.mine)),
        ", ".join(map(str, found.published)),
        f"{100 * np.sqrt(np.mean(found.mine**2)):.3g}",
        f"{100 * np.sqrt(np.mean(found.other**2)):.3g}",
        simulation_of(case.name).model.p_names[worst],
        f"{ratios[worst]:.3f}",
        *([] if found.from_truth is None else [f"{found.ratios(found.from_truth)[worst]:.3f}"]),
        f"{np.sqrt(np.mean(found.apart**2)):.2g}",
        f"{np.max(np.abs(found.apart)):.2g}",
    )


def table(names: Sequence[str], seeds: int, advance: Advance) -> Iterator[tuple[str, ...]]:
    """A row of HEADER for each case."""
    return (row_of(case, errors_of(case, seeds, advance)) for case in cases(names))


def fixed_table(names: Sequence[str], seeds: int, advance: Advance) -> Iterator[tuple[str, ...]]:
    """A row of FIXED_HEADER for each case."""
    return (row_of(case, fixed_errors_of(case, seeds, advance)) for case in cases(names))
