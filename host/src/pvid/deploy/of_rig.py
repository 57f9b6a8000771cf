"""A deployment from a mechanism's model and the identifier that is designed for its rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from pvid.codegen import files_refine, files_weak
from pvid.codegen.files_weak_q31 import files_of, fitted_of
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.codegen.generated import GeneratedModel, Options
from pvid.codegen.refine import RefineFunctions
from pvid.codegen.weak import WeakFunctions, weak_functions_of
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.codegen.weak_q31 import WeakQ31
from pvid.configuration.excitation import Excitation
from pvid.configuration.weak import Run, samples_of
from pvid.core.weak_native import RefinedRecord
from pvid.deploy.arithmetic import FIXED, FLOAT
from pvid.deploy.deployment import Deployment, Playback, Quantity, SecondStage, Turning
from pvid.model.compiled import CompiledModel
from pvid.settings.enums import Reason
from pvid.settings.record import Record
from pvid.settings.refine import BIG_STEP, RefineConfig
from pvid.settings.weak import Source, WeakConfig

_MOST_NUMBERS = 30_000  # of the example's motion: 60 kB of flash
_LONGER = 3  # half windows behind the first estimate
_LARGEST = 30_000  # count of a signal without a resolution
_TURNING = 2**15  # counts from the reference: a float32 has all of them in the sums of a block
_PUBLISHED = (Reason.UPDATED, Reason.MISFIT)


def deployment_f32(
    compiled: CompiledModel,
    config: WeakConfig,
    run: Run,
    command: str,
    refine: RefineConfig | None = None,
    excitation: Excitation | None = None,
) -> Deployment:
    """In float32.

    Raises PvidError where the identifier does not have what the model needs.

    Parameters
    ----------
    config : settings and tables for the rig
    run : of the rig, for the example: name of each signal -> samples [n]
    command : that makes it, for the banners
    refine : settings of the refinement; None: the package has none
    excitation : of the commissioning; None: the package has none
    """
    made, design = weak_functions_of(compiled), config.design
    model, name = design.model, design.model.name
    units = {one.name: one.unit for one in compiled.signals}
    resolution = {one.name: one.resolution for one in compiled.signals}
    samples = samples_of(config, run)
    largest = np.abs(samples).max(axis=0)
    lsb = np.array(
        [resolution[one] or float(top) / _LARGEST or 1.0 for one, top in zip(model.sample_names, largest, strict=True)],
        np.float32,
    )
    counts = np.rint(samples.astype(np.float64) / lsb).astype(np.int32)[: _most_ticks(model.samples)]
    values = counts.astype(np.float32) * lsb
    record = weak_native(compiled, design).identifier_of(config).run_samples(values, sums=False, hashes=False)
    hop = design.hop * design.decimation
    playback = _playback(counts, lsb.tolist(), record, hop, np.ones(len(compiled.unknowns)))
    whole = GeneratedModel(compiled, command, Options(refine_design=refine))
    generated = files_weak.printed(whole)
    generated[f"{name}_design_f32.h"] = files_weak.design_header(config, compiled, command, config.causes)
    second = None
    if refine is not None:
        functions = whole.refinement.needed
        generated |= files_refine.printed(whole) | files_refine.printed_design(whole)
        refined = weak_native(compiled, design, functions).refined_of(config, refine).run_both(values)
        ticks = _ticks_of(refined, refine, len(playback.counts), len(counts))
        playback = _playback(counts, lsb.tolist(), record, hop, np.ones(len(compiled.unknowns)), ticks)
        second = _second(functions, refined, ticks)
    return Deployment(
        name=name,
        title=compiled.title,
        arithmetic=FLOAT,
        sample_rate=config.sample_rate,
        samples=tuple(Quantity(one, units[one], note=_note(made, k)) for k, one in enumerate(model.sample_names)),
        parameters=tuple(Quantity(one.name, one.unit) for one in compiled.unknowns),
        sizes=fitted_sizes(config, refined=refine is not None),
        generated=generated,
        command=command,
        first_s=config.ticks_needed / config.sample_rate,
        playback=playback,
        second=second,
        turning=_turning(made, config, resolution),
        excitation=excitation,
        causes=config.causes,
    )


def deployment_q31(weak: WeakQ31, run: Run, command: str) -> Deployment:
    """In fixed point; parameters as of deployment_f32."""
    compiled, design = weak.compiled, weak.config.design
    units = {one.name: one.unit for one in compiled.signals}
    counts = weak.counts_of(run)[: _most_ticks(len(weak.lsb))]
    native = weak_native_q31(weak.made, weak.parameters, weak.config)
    record = native.identifier().run_samples(counts, sums=False, hashes=False)
    scale = weak.values(np.ones(len(compiled.unknowns)))
    notes = [
        f"one count is {lsb:.6g} {units[one] or '1'}".rstrip()
        for one, lsb in zip(weak.sample_names, weak.lsb, strict=True)
    ]
    return Deployment(
        name=weak.name,
        title=compiled.title,
        arithmetic=FIXED,
        sample_rate=weak.sample_rate,
        samples=tuple(
            Quantity(one, units[one], lsb, note)
            for one, lsb, note in zip(weak.sample_names, weak.lsb, notes, strict=True)
        ),
        parameters=tuple(
            Quantity(one.name, one.unit, float(x)) for one, x in zip(compiled.unknowns, scale, strict=True)
        ),
        sizes=fitted_of(weak),
        generated=files_of(weak, command),
        command=command,
        first_s=weak.ticks_needed / weak.sample_rate,
        playback=_playback(counts, list(weak.lsb), record, design.hop * design.decimation, scale),
        causes=weak.config.causes,
    )


def _turning(made: WeakFunctions, config: WeakConfig, resolution: Mapping[str, float]) -> tuple[Turning, ...]:
    """Samples that may turn without end, of encoders whose count is known."""
    found = []
    for place, channel in made.turning.items():
        name = made.samples[place]
        lsb = resolution[name]
        if lsb > 0:
            reach = _TURNING * lsb if config.range is None else 0.5 * float(config.range[place])
            found.append(Turning(name, place, channel, lsb, int(min(_TURNING, reach / lsb))))
    return tuple(one for one in found if one.limit > 0)


def _note(made: WeakFunctions, place: int) -> str:
    held = any(one.sample == place and one.source is Source.HELD for one in made.signal)
    return "held until the next" if held else ""


def _most_ticks(samples: int) -> int:
    return _MOST_NUMBERS // samples


def _ticks_of(refined: RefinedRecord, settings: RefineConfig, least: int, most: int) -> int:
    """A block longer than up to the first refined estimate; all of it where there is none."""
    published = np.flatnonzero(refined.told == Reason.UPDATED)
    block = settings.block * BIG_STEP * settings.ratio
    return min(max(least, int(published[0]) + 1 + block), most) if len(published) else most


def _second(made: RefineFunctions, refined: RefinedRecord, ticks: int) -> SecondStage:
    """As it is after so many ticks of the example's motion."""
    is_there = bool(np.any(refined.r[ticks - 1]))  # not withdrawn
    value, error = (np.asarray(one[ticks - 1], np.float64) if is_there else None for one in (refined.r, refined.se))
    parameters = tuple(Quantity(one.name, one.unit) for one in made.parameters)
    return SecondStage(parameters, value, error, Reason(refined.told[ticks - 1]))


def _playback(
    counts: npt.NDArray[np.int32],
    lsb: Sequence[float],
    record: Record,
    hop: int,
    scale: npt.NDArray[np.float64],
    least: int = 0,
) -> Playback:
    """Some half windows longer than up to the first estimate, `least` ticks; all of it where there is none."""
    published = np.flatnonzero(np.isin(record.reason, _PUBLISHED))
    if not len(published):
        judged = record.reason[record.reason != Reason.ACCUMULATED]
        return Playback(counts, tuple(lsb), None, None, Reason(judged[-1]))
    ticks = min(max(int(published[0]) + 1 + _LONGER * hop, least), len(counts))
    value, error = (np.asarray(one[ticks - 1], np.float64) * scale for one in (record.published, record.published_se))
    return Playback(counts[:ticks], tuple(lsb), value, error)
