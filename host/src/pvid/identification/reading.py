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
from pvid.rig.sensor_noise import with_noise
from pvid.rig.sensor_steps import with_resolutions
from pvid.rig.together import joined

Reader = Callable[[Columns], Recording]

# A mechanism without an input that moves by less than so many standard deviations of its sensors' noise for so many
# samples, and by so many times as much in as many samples behind them, was held.
_STILL, _LEAST_HELD, _RELEASED = 6.0, 20, 30.0


def read_all(
    rig: MechanismRig,
    sources: Sequence[Path | Reader],
    names: Sequence[str],
    columns: str | None,
    *,
    whole: bool = False,
) -> tuple[Recording, CompiledModel]:
    """Recordings of one rig as one, and the model with the values of the rig.

    Raises PvidError when one cannot be read.

    Parameters
    ----------
    sources : a file, or what reads a recording with given columns
    names : of the recordings, where there are several
    columns : the text of --columns
    whole : the longest stretch without a missing sample alone
    """
    model = rig.applied(compiled_of(rig.model))
    given = parsed(columns, channels_of(model))
    parts = [_read(one, rig, model, given) for one in sources]
    recording = parts[0] if len(parts) == 1 else joined(parts, names, given)
    recording, model = with_noise(*with_resolutions(recording, model))
    recording = without_hold(recording, model)
    return recording.whole() if whole else recording, model


def _read(source: Path | Reader, rig: MechanismRig, model: CompiledModel, given: Columns) -> Recording:
    recording = read_recording(source, rig.sample_rate, given) if isinstance(source, Path) else source(given)
    recording.refuse_damaged()
    return without_wild_samples(aligned(recording, model), model)


def without_hold(recording: Recording, model: CompiledModel) -> Recording:
    """Without the samples at the beginning of each stretch in which a mechanism that no input moves is held."""
    if any(one.kind == "input" or one.driven for one in model.signals):
        return recording
    signals, notes = {name: one.copy() for name, one in recording.signals.items()}, list(recording.notes)
    for part in recording.segments:
        off = np.zeros(part.stop - part.start)
        for one in model.signals:
            x = signals[one.name][part]
            off = np.maximum(off, np.abs(x - np.median(x[:_LEAST_HELD])) / (one.sd or np.inf))
        held = int(np.argmax(off > _STILL))
        if held >= _LEAST_HELD and off[held : 2 * held].max() > _RELEASED * _STILL:
            for values in signals.values():
                values[part.start : part.start + held] = np.nan
            begin, end = recording.t[part.start], recording.t[part.start + held]
            notes.append(
                f"nothing moves from {begin:.6g} s to {end:.6g} s, as if held, and no input moves it: left out"
            )
    return replace(recording, signals=signals, notes=tuple(notes)) if len(notes) > len(recording.notes) else recording


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
