"""The weak identifier's design and settings for a rig: from a recording of it, or from a shipped rig's simulation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.weak import weak_model_of
from pvid.configuration.shared import Run as Run
from pvid.configuration.shared import Shared
from pvid.configuration.weak_tables import LONGEST_HOP, config_of, design_tables, for_core
from pvid.model.compiled import CompiledModel
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.choice import MODEL_ERROR, Scored, ranked, ranked_for_core, score_of
from pvid.oracle.weak.design import Reversals, WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.gate import gated
from pvid.oracle.weak.identify import Identified, ready
from pvid.oracle.weak.parameters import UNKNOWN
from pvid.oracle.weak.rows import Compiled, EquationError, WeakRows
from pvid.oracle.weak.solve import Fit
from pvid.rig.run import Recording
from pvid.settings.weak import WeakConfig, WeakDesign32
from pvid.sim.simulated_run import RigSimulation

# A design that costs less is taken if its score is at most this many times the best one's.
_COST = 1.2
_DECIMATIONS = (2, 4, 8, 16, 32)
_FEWER = (24, 16, 12)

# Length and degree of the polynomials before decimation, as in the designs of the shipped rigs.
_TAPS_A_STEP = 7.6
_DEGREE, _LOW_DEGREE = 6, 4
_SHORT = 15  # taps, for which the lower degree is


def weak_config(
    compiled: CompiledModel,
    run: Run,
    design: WeakDesign,
    p: Float | None = None,
    *,
    start_there: bool = False,
    shared: bool = False,
    found: Identified | None = None,
) -> WeakConfig:
    """Settings of the identifier for a rig, from a run of it.

    Raises PvidError where the identifier does not have what the model or the design needs.

    Parameters
    ----------
    run : name of each signal -> samples [n]
    design : of the oracle; the identifier gets the nearest one that it has
    p : parameters near those of the rig [n_p]; None: the guesses
    start_there : the identifier starts at the parameters of this run; False: at the guesses
    shared : its standard errors contain those that all windows share; False: the run is all that is judged
    found : the analysis of this run, whose shared errors they are; None: those of the design
    """
    made = weak_tables(compiled, run, design, p)
    there = made.p if compiled.drifted is None else compiled.drifted.p[0]
    config = config_of(
        made.tables, design.sample_rate, made.rows.compiled.parameters, there if start_there else None, run
    )
    if compiled.drifts and compiled.drift_s < 4 * config.hop_s:
        raise PvidError(
            f"{compiled.name}: the memory of its drift, {compiled.drift_s:g} s, is below the four half windows of "
            f"{config.hop_s:.3g} s that the identifier needs: record at a higher rate, or give memory_s more"
        )
    if not shared:
        return config
    errors = made.shared(run, found)
    trust = replace(config.trust, shared=errors.triangle)
    return replace(config, trust=trust, causes=errors.lines(compiled.unknowns))


@dataclass(frozen=True, eq=False)
class WeakTables:
    """What the settings of both cores follow from.

    Attributes
    ----------
    rows : of the run, in float64
    fit : to it
    tables : of the float32 identifier
    """

    rows: WeakRows
    fit: Fit
    tables: WeakDesign32

    @property
    def p(self) -> Float:
        """Fitted [n_p]."""
        return self.fit.p

    @property
    def errors(self) -> list[EquationError]:
        """Of the equations themselves, of each kind."""
        return list(self.fit.errors)

    def shared(self, run: Run, found: Identified | None = None) -> Shared:
        """Errors that all windows share; found: as of weak_config."""
        if found is not None:
            return Shared.of_answer(found, self.fit)
        return Shared.of_design(run, self.rows.record.grid.design, self.fit)


def weak_tables(compiled: CompiledModel, run: Run, design: WeakDesign, p: Float | None = None) -> WeakTables:
    """Tables of the identifier for a rig, from a run of it; parameters as of weak_config."""
    tables_of = weak_model_of(compiled)
    rows = WeakRows.of(ready(compiled), run, for_core(design))
    fit = gated(rows, p)
    return WeakTables(rows, fit, design_tables(tables_of, rows, fit.p, fit.errors))


def config_for_recording(
    compiled: CompiledModel,
    recording: Recording,
    functions: int | None = None,
    ranking: Sequence[Scored] = (),
    reversals: Reversals = "averaged",
    found: Identified | None = None,
) -> WeakConfig:
    """Settings for the rig that made a recording; the estimate starts at what the recording shows.

    Parameters
    ----------
    functions : K; None: chosen
    ranking, reversals : as of design_for_recording
    found : the analysis of the recording, whose errors of scale and of the model a microcontroller publishes as well;
        None: it publishes those of the design
    """
    ranking = ranking or (() if found is None else found.ranking)
    design, p, known = design_and_p(compiled, recording, functions, ranking, reversals)
    return weak_config(compiled, recording.signals, design, p, start_there=known, shared=True, found=found)


def design_and_p(
    compiled: CompiledModel,
    recording: Recording,
    functions: int | None = None,
    ranking: Sequence[Scored] = (),
    reversals: Reversals = "averaged",
) -> tuple[WeakDesign, Float, bool]:
    """The design that is chosen for a recording, the parameters that it was chosen at [n_p], whether to start there."""
    best = design_for_recording(ready(compiled), recording.signals, recording.sample_rate, ranking, reversals)
    return _with(best.design, functions), best.p, best.known


def config_to_identify(compiled: CompiledModel, recording: Recording, ranking: Sequence[Scored] = ()) -> WeakConfig:
    """The same, to identify the recording itself: the limit of a standard error is that of the analysis, whose verdict
    judges the answer and whose standard errors contain the shared ones, not that of a microcontroller on its
    own."""
    design, p, known = design_and_p(compiled, recording, ranking=ranking)
    config = weak_config(compiled, recording.signals, design, p, start_there=known)
    return replace(config, trust=replace(config.trust, se_max=UNKNOWN))


def design_for_recording(
    model: Compiled, run: Run, sample_rate: float, ranking: Sequence[Scored] = (), reversals: Reversals = "averaged"
) -> Scored:
    """The design of the identifier with the least predicted errors, then a cheaper one that is nearly as good.

    A model with corners keeps its sample rate: filters before decimation blur them (measured: 0.2 % of a motor's L).

    Parameters
    ----------
    ranking : of the analysis of the same run in float64, from the guesses on; used where the identifier's is the same
    reversals : "averaged", or "decided": for a commissioning, whose bursts are made so that enough windows remain
    """
    tried = ranked_for_core(model, ranking) or ranked(model, run, sample_rate, reversals=reversals)
    best = tried[0]

    def scored(designs: Iterable[WeakDesign]) -> list[Scored]:
        tried = (score_of(model, run, one, best.p, best.chi2 > MODEL_ERROR) for one in designs)
        return [one for one in tried if one is not None]

    slower = [] if model.jumps else scored(_decimated(best.design))
    found = _cheapest([best, *slower], best)
    return _cheapest([found, *scored(_with_fewer_functions(found.design))], best)


def _cheapest(tried: Sequence[Scored], best: Scored) -> Scored:
    """The last one that is nearly as good as the best and agrees with it, or the best of those that the core has."""
    possible = [one for one in tried if one.design.hop <= LONGEST_HOP]
    if not possible:
        raise PvidError(
            f"half a window of {tried[0].design.window_s / 2:.3g} s has more than {LONGEST_HOP} samples, the most of "
            "the weak identifier: record at a lower rate"
        )
    good = [one for one in possible if one.score <= _COST * best.score and np.all(np.abs(one.p - best.p) <= best.error)]
    return good[-1] if good else min(possible, key=lambda one: one.score)


def _decimated(design: WeakDesign) -> Iterator[WeakDesign]:
    """With fewer steps a second, behind filters that let nothing fold into the band of the test functions."""
    for decimation in _DECIMATIONS:
        taps = round(_TAPS_A_STEP * decimation) | 1
        degree = _DEGREE if taps > _SHORT else _LOW_DEGREE
        rates = (taps, degree) if design.rate_taps < taps else (design.rate_taps, design.rate_degree)
        try:
            found = replace(design, decimation=decimation, taps=taps, degree=degree)
            yield for_core(replace(found, rate_taps=rates[0], rate_degree=rates[1]))
        except PvidError:  # too few steps
            return


def _with_fewer_functions(design: WeakDesign) -> Iterator[WeakDesign]:
    for count in _FEWER:
        if count < design.functions:
            yield replace(design, functions=count)


def config_for_simulated_rig(compiled: CompiledModel) -> WeakConfig:
    """Settings for the shipped rig of a mechanism, with its own design, and for its simulation, which is exact: there
    are no shared errors.

    Raises PvidError where the mechanism has no shipped rig.
    """
    run, design, p = simulated_run_of(compiled)
    return weak_config(compiled, run, design, p)


def config_for_rig_like_the_shipped(compiled: CompiledModel, functions: int | None = None) -> WeakConfig:
    """The same for a real rig that moves as much, with the shared errors of its signals, constants and equations."""
    run, design, p = simulated_run_of(compiled, functions)
    return weak_config(compiled, run, design, p, shared=True)


def simulated_run_of(compiled: CompiledModel, functions: int | None = None) -> tuple[Run, WeakDesign, Float]:
    """A run of the shipped rig of a mechanism, the rig's own design, and its parameters [n_p]."""
    rig = simulated_rig(compiled.name)
    simulation = RigSimulation.of(compiled, rig)
    design = WeakDesign(rig.sample_rate, rig.window_s, **rig.design)  # type: ignore[arg-type]
    return simulation.run(), _with(design, functions), np.asarray(simulation.truth)


def samples_of(config: WeakConfig, run: Run) -> npt.NDArray[np.float32]:
    """The argument of step at every tick [ticks, samples]."""
    return np.stack([np.asarray(run[name], np.float32) for name in config.design.model.sample_names], axis=1)


def _with(design: WeakDesign, functions: int | None) -> WeakDesign:
    return design if functions is None else replace(design, functions=functions)
