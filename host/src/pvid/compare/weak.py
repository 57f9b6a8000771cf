"""The C core against its twin on a recording of a described mechanism, bit for bit, after every tick."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy.typing as npt

from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.codegen.weak_q31 import WeakQ31
from pvid.codegen.weak_sizes import sizes_of_model
from pvid.compare.bits import Comparison, first_difference
from pvid.configuration.weak import config_to_identify, samples_of
from pvid.configuration.weak_q31 import weak_q31_to_identify
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.choice import Scored
from pvid.rig.run import Recording
from pvid.settings.cores import CORES
from pvid.settings.enums import Core
from pvid.settings.weak import WeakConfig
from pvid.twin.printed import PrintedTwin

Progress = Callable[[int], None]


def compare_recording(
    compiled: CompiledModel,
    recording: Recording,
    core: Core = "f32",
    progress: Progress | None = None,
    ranking: Sequence[Scored] = (),
) -> Comparison:
    """Runs a recording through the identifier and its twin, with the design that `identify` chooses.

    Raises PvidError when there is no C compiler, or the identifier does not have what the model needs.

    Parameters
    ----------
    ranking : of the analysis of the recording, where there is one: the design is not searched for again
    """
    return _COMPARISONS[core](compiled, recording, progress, ranking)


def _in_float(
    compiled: CompiledModel, recording: Recording, progress: Progress | None, ranking: Sequence[Scored]
) -> Comparison:
    config = config_to_identify(compiled, recording, ranking)
    return compare_samples(compiled, config, samples_of(config, recording.signals), progress)


def _in_fixed_point(
    compiled: CompiledModel, recording: Recording, progress: Progress | None, ranking: Sequence[Scored]
) -> Comparison:
    weak = weak_q31_to_identify(compiled, recording, ranking)
    return compare_counts(weak, weak.counts_of(recording.signals), progress)


_COMPARISONS = dict(zip(CORES, (_in_float, _in_fixed_point), strict=True))


def compare_samples(
    compiled: CompiledModel, config: WeakConfig, samples: npt.ArrayLike, progress: Progress | None = None
) -> Comparison:
    """The same for samples [ticks, samples] and settings."""
    native = weak_native(compiled, config.design)
    identifier, twin = native.identifier_of(config), PrintedTwin(native.sources, config)
    record, own = identifier.run_samples(samples), twin.run(samples, progress)
    moments = sizes_of_model(config.design.model)["PVID_MAX_MOMENTS"]
    return Comparison(
        ticks=len(record.reason),
        core_hash=identifier.running_hash,
        twin_hash=twin.running_hash,
        difference=first_difference(record, own, compiled.p_names, moments),
    )


def compare_counts(weak: WeakQ31, readings: npt.ArrayLike, progress: Progress | None = None) -> Comparison:
    """The same in fixed point, for readings [ticks, samples]."""
    native = weak_native_q31(weak.made, weak.parameters, weak.config)
    identifier, twin = native.identifier(), PrintedTwin(native.sources, weak.config)
    record, own = identifier.run_samples(readings), twin.run(readings, progress)
    return Comparison(
        ticks=len(record.reason),
        core_hash=identifier.running_hash,
        twin_hash=twin.running_hash,
        difference=first_difference(record, own, weak.compiled.p_names, weak.parameters.model.moments),
    )
