"""Errors of the weak engine in fixed point beside those of float32: same runs as counts, same design, same start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.engine import Case, cases, rms
from bench.mechanisms import design_of, size_of
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.configuration.weak import engine_config, samples_of
from pvid.configuration.weak_q31 import fixed_engine
from pvid.oracle.weak.functions import Float
from pvid.sim.simulated_run import simulation_of

HEADER = (
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
class Errors:
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


def errors_of(case: Case, seeds: int, progress: Callable[[], object] | None = None) -> Errors:
    """Runs of a case; tables and start of both are those of the first one."""
    simulation = simulation_of(case.name)
    design = design_of(simulation, case.law)
    truth = np.asarray(simulation.truth)
    first = simulation.run(0, case.law)
    engine = fixed_engine(simulation.model, first, design, truth)
    library = weak_native_q31(engine.made, engine.parameters, engine.config)
    config = engine_config(simulation.model, first, design, truth)
    start = engine.values(engine.config.estimator.start).astype(np.float32)
    config = replace(config, estimator=replace(config.estimator, start=start))
    fixed, floating, apart, published = [], [], [], np.zeros(2, np.int64)
    for seed in range(seeds):
        counts = engine.counts_of(simulation.run(seed, case.law))
        run = dict(zip(engine.sample_names, (counts * np.array(engine.lsb)).T, strict=True))
        mine = library.identifier()
        p = engine.values(mine.run_samples(counts, sums=False, hashes=False).p[-1])
        theirs = weak_native(simulation.model, config.design).identifier_of(config)
        other = theirs.run_samples(samples_of(config, run), sums=False, hashes=False).p[-1].astype(np.float64)
        se = np.asarray(theirs.estimate["se"], np.float64)[: len(truth)]
        fixed.append((p - truth) / size_of(simulation))
        floating.append((other - truth) / size_of(simulation))
        apart.append((p - other) / se)
        published += (mine.is_published, theirs.is_published)
        if progress is not None:
            progress()
    both = (int(published[0]), int(published[1]))
    return Errors(np.array(fixed), np.array(floating), np.array(apart), both, engine.config.design.functions)


def row_of(case: Case, found: Errors) -> tuple[str, ...]:
    """Cells as in HEADER."""
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


def table(names: Sequence[str], seeds: int, progress: Callable[[], object] | None = None) -> Iterator[tuple[str, ...]]:
    """A row of cells for each case."""
    for case in cases(names):
        yield row_of(case, errors_of(case, seeds, progress))
