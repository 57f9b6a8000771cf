"""The fixed-point weak identifier for a rig: formats, tables and settings, from a recording or a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.codegen.weak import WeakFunctions, weak_functions_of
from pvid.codegen.weak_q31 import FixedWeak, JetReaches, ParametersQ31, WeakQ31, fixed_parameters, fixed_weak
from pvid.configuration.weak import Run, design_and_p, simulated_run_of, weak_tables
from pvid.configuration.weak_formats_q31 import config_of_q31, row_formats, with_noisy_means
from pvid.configuration.weak_tables import drive_min_of
from pvid.design.weak_q31 import Sensing, fixed_design, most_counts
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.choice import Scored
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import Identified, ready
from pvid.oracle.weak.parameters import UNKNOWN, Parameters
from pvid.rig.run import Recording
from pvid.settings.weak_q31 import WeakConfigQ31

_INPUT_BITS = 15  # of an input that is known exactly: counts of its reach
HIGHEST_JET = 2.0  # reach of a derivative over the largest of the run
FULL_SCALE = 1.5  # over the reach of a signal
_SE_BITS = 24  # of se_max
_ON_GRID = 1e-3  # of a count: digits of a file
_FINER_BITS = 10  # at most
_LONGEST_RUN_S = 3600.0  # of integrals since the start of the run, at least


def weak_q31_for_run(
    compiled: CompiledModel,
    run: Run,
    design: WeakDesign,
    p: Float | None = None,
    *,
    start_there: bool = False,
    between_counts: bool = False,
    soft_signs: Mapping[str, float] | None = None,
    shared: bool = False,
    found: Identified | None = None,
) -> WeakQ31:
    """The identifier for a rig, from a run of it.

    Raises PvidError where fixed point, or the identifier, does not have what the model or the design needs.

    Parameters
    ----------
    design : of the oracle; the identifier gets the nearest one that it has
    p : parameters near those of the rig [n_p]; None: the guesses
    start_there : the identifier starts at the parameters of this run; False: at the guesses
    between_counts : samples of the run that lie between counts, as with an offset taken off, are not rounded to them:
        the identifier gets finer counts; False: those of the sensor, as of a board
    soft_signs : argument of a sgn, as in phi_1 -> width of the soft sign v / (|v| + width) in its place
    shared, found : as of weak_config
    """
    functions = weak_functions_of(compiled)
    tables_of_run = weak_tables(compiled, run, design, p)
    known = {one.name: one for one in compiled.signals}
    lsb = lsb_of(compiled, functions.samples)
    largest = [float(np.nanmax(np.abs(np.asarray(run[one], np.float64)))) for one in functions.samples]
    limits = most_counts(functions.signal, len(lsb), tables_of_run.tables.decimation)
    tops = [max(FULL_SCALE * known[one].reach, top) for one, top in zip(functions.samples, largest, strict=True)]
    if between_counts:
        lsb = tuple(
            finer(step, run[one], limit / (top / step))
            for one, step, top, limit in zip(functions.samples, lsb, tops, limits, strict=True)
        )
    full_scale = tuple(
        max(round(min(top / step, limit)), 16) for step, top, limit in zip(lsb, tops, limits, strict=True)
    )
    of_jets = {str(jet): x for jet, x in tables_of_run.rows.record.grid.jets.items()}
    reaches = {one: HIGHEST_JET * float(np.max(np.abs(of_jets[one]))) or 1.0 for one in functions.jet_names}
    seconds = len(next(iter(of_jets.values()))) * tables_of_run.tables.decimation / design.sample_rate
    made = fixed_weak(functions, JetReaches(run_s=max(2 * seconds, _LONGEST_RUN_S), of=reaches))
    parameters_of = tables_of_run.rows.compiled.parameters
    parameters = _parameters(functions, parameters_of)
    sizes = with_noisy_means(
        tables_of_run.tables.with_soft_widths(soft_signs or {}), tables_of_run.rows, tables_of_run.p
    )
    tables = fixed_design(made.model, sizes, Sensing(lsb, full_scale, design.sample_rate), made.formats)
    formats = row_formats(tables_of_run.rows, tables_of_run.p, tables_of_run.errors)
    config = config_of_q31(
        tables,
        parameters_of,
        formats,
        parameters.p_bits,
        (0,) * len(lsb),
        design.sample_rate,
        tables_of_run.p if start_there else None,
        tables_of_run.tables.overlap,
    )
    still = drive_min_of(tables_of_run.tables, tables_of_run.rows.compiled.model)
    if still is not None:
        least = tuple(min(round(float(x) / step), 2**24) for x, step in zip(still, lsb, strict=True))
        config = replace(config, drive_min=least)
    if shared:
        errors = tables_of_run.shared(run, found)
        trust = replace(config.trust, shared=errors.counts(parameters.p_bits))
        config = replace(config, trust=trust, causes=errors.lines(compiled.unknowns))
    return WeakQ31(compiled, made, parameters, config, design.sample_rate, lsb)


def finer(step: float, samples: npt.ArrayLike, room: float) -> float:
    """A count for samples: the sensor's, by a power of 2 finer where they lie between counts. room: at most so much."""
    counts = np.asarray(samples, np.float64) / step
    if room < 2 or np.nanmax(np.abs(counts - np.rint(counts))) < _ON_GRID:
        return step
    return step / 2.0 ** min(_FINER_BITS, math.floor(math.log2(room)))


def lsb_of(compiled: CompiledModel, samples: Sequence[str]) -> tuple[float, ...]:
    """Value of a count of each sample: a sensor's resolution, of an input a part of its reach."""
    known = {one.name: one for one in compiled.signals}
    return tuple(known[one].resolution or known[one].reach / 2**_INPUT_BITS for one in samples)


def _parameters(functions: WeakFunctions, known: Parameters) -> ParametersQ31:
    bounds = [(min(one.low, x), max(one.high, x)) for one, x in zip(known.model.unknowns, known.guess, strict=True)]
    return fixed_parameters(functions.functions, bounds)


def weak_q31_of_parts(compiled: CompiledModel, made: FixedWeak, config: WeakConfigQ31, sample_rate: float) -> WeakQ31:
    """An identifier whose formats and settings are known, as from a log."""
    parameters = _parameters(made.functions, ready(compiled).parameters)
    lsb = lsb_of(compiled, made.functions.samples)
    return WeakQ31(compiled, made, parameters, config, sample_rate, lsb)


def weak_q31_for_recording(
    compiled: CompiledModel,
    recording: Recording,
    functions: int | None = None,
    soft_signs: Mapping[str, float] | None = None,
    ranking: Sequence[Scored] = (),
    *,
    between_counts: bool = False,
    shared: bool = True,
    found: Identified | None = None,
) -> WeakQ31:
    """For the rig that made a recording, with the design that float32 gets.

    Parameters
    ----------
    functions : K; None: chosen
    soft_signs, between_counts : as of weak_q31_for_run
    ranking : as of pvid.configuration.weak.design_for_recording
    shared, found : as of pvid.configuration.weak.weak_config
    """
    ranking = ranking or (() if found is None else found.ranking)
    design, p, known = design_and_p(compiled, recording, functions, ranking)
    return weak_q31_for_run(
        compiled,
        recording.signals,
        design,
        p,
        start_there=known,
        between_counts=between_counts,
        soft_signs=soft_signs,
        shared=shared,
        found=found,
    )


def weak_q31_to_identify(compiled: CompiledModel, recording: Recording, ranking: Sequence[Scored] = ()) -> WeakQ31:
    """The same, to identify the recording itself: as config_to_identify."""
    weak = weak_q31_for_recording(compiled, recording, ranking=ranking, between_counts=True, shared=False)
    trust = replace(weak.config.trust, se_max=round(UNKNOWN * 2**_SE_BITS))
    return replace(weak, config=replace(weak.config, trust=trust))


def weak_q31_for_simulated_rig(compiled: CompiledModel) -> WeakQ31:
    """For the shipped rig of a mechanism, with its own design."""
    return weak_q31_for_run(compiled, *simulated_run_of(compiled))


def weak_q31_for_rig_like_the_shipped(
    compiled: CompiledModel, functions: int | None = None, soft_signs: Mapping[str, float] | None = None
) -> WeakQ31:
    """The same for a real rig that moves as much: as config_for_rig_like_the_shipped."""
    run, design, p = simulated_run_of(compiled, functions)
    return weak_q31_for_run(compiled, run, design, p, soft_signs=soft_signs, shared=True)
