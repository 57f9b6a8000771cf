"""A recording as it is identified: without wild samples, its sensors at common instants, their resolutions known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pvid.identification.wild_samples import without_wild_samples
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.rig.columns import Columns, parsed
from pvid.rig.mechanism_file import MechanismRig, channels_of
from pvid.rig.run import Recording, read_recording
from pvid.rig.sensor_steps import with_resolutions
from pvid.rig.together import joined

Reader = Callable[[Columns], Recording]


def read_all(
    rig: MechanismRig,
    sources: Sequence[Path | Reader],
    names: Sequence[str],
    columns: str | None,
    *,
    whole: bool = False,
) -> tuple[Recording, CompiledModel]:
    """Recordings of one rig as one, and the model with the values of the rig.

    Parameters
    ----------
    sources : a file, or what reads a recording with given columns
    names : of the recordings, where there are several
    columns : the text of --columns
    whole : the longest stretch without a missing sample alone

    Raises
    ------
    PvidError
        When one cannot be read.
    """
    model = rig.applied(compiled_of(rig.model))
    given = parsed(columns, channels_of(model))
    parts = [_read(one, rig, model, given) for one in sources]
    recording = parts[0] if len(parts) == 1 else joined(parts, names, given)
    return with_resolutions(recording.whole() if whole else recording, model)


def _read(source: Path | Reader, rig: MechanismRig, model: CompiledModel, given: Columns) -> Recording:
    recording = read_recording(source, rig.sample_rate, given) if isinstance(source, Path) else source(given)
    recording.refuse_damaged()
    return without_wild_samples(aligned(recording, model), model)


def aligned(recording: Recording, model: CompiledModel) -> Recording:
    """With the samples of a sensor that is sampled later than the others at their instants, by linear interpolation."""
    late = {one.name: one.delay for one in model.signals if one.delay}
    if not late:
        return recording
    clock = np.arange(len(recording), dtype=np.float64)
    signals, notes = dict(recording.signals), list(recording.notes)
    for name, delay in late.items():
        signals[name] = np.interp(clock - delay * recording.sample_rate, clock, signals[name])
        notes.append(f"{name} was moved by {1e3 * delay:.3g} ms (sensor.{name}.delay of the rig file)")
    return replace(recording, signals=signals, notes=tuple(notes))
