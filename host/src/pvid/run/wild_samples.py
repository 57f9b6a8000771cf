"""Wild samples of a recording: single ones far from the smooth signal about them, as interference makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.signals import jets
from pvid.rig.breaks import breaks
from pvid.rig.gaps import bridge, stretches
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]

_SPAN = 0.5  # [s] over which a signal may change its character
_SHORTEST = 50  # samples of it
_LONGEST = 5  # samples that one wild sample makes suspect
_MOST = 1e-3  # of the samples: where more are, they belong to the signal
# Far samples: off the median about them by so many times the sensor's noise, what nine of ten samples are off it,
# or twice the usual motion; in runs of a few, with neighbours that are off by a small part of that.
_MEDIAN_OF, _FAR, _RUN, _NEIGHBOUR = 11, 10.0, 3, 0.2
_MOST_FAR = 0.05  # of the samples: with more, the recording is refused


def _without_far_samples(recording: Recording, signal: Signal) -> tuple[Float, str]:
    """A sensor's samples without those that are far from all about them, and a note on these."""
    x = recording.signals[signal.name]
    half = _MEDIAN_OF // 2
    if len(x) <= _MEDIAN_OF:
        return x, ""
    about = np.lib.stride_tricks.sliding_window_view(np.pad(x, half, mode="edge"), _MEDIAN_OF)
    off = np.abs(x - np.partition(about, half, axis=1)[:, half])  # NaN is partitioned to the end
    there = np.isfinite(off)
    moves = np.abs(np.diff(x[there]))
    if not moves.size:
        return x, ""
    limit = _FAR * max(2 * signal.sd, float(np.quantile(off[there], 0.9)), 2 * float(np.median(moves)))
    far = there & (off > limit)
    for first, end in zip(*stretches(far), strict=True):
        beside = [off[k] for k in (first - 1, end) if 0 <= k < len(x) and np.isfinite(off[k])]
        if end - first > _RUN or max(beside, default=np.inf) > _NEIGHBOUR * off[first:end].min():
            far[first:end] = False
    count = int(np.count_nonzero(far))
    if not count:
        return x, ""
    values, times = np.unique(x[far], return_counts=True)
    usual = f"{values[np.argmax(times)]:g} {signal.unit}".rstrip()
    if count > _MOST_FAR * np.count_nonzero(there):
        raise PvidError(
            f"{signal.name} is far from the samples about it in {count} of {len(x)} samples, most often {usual}: an "
            "error code of the sensor, or a loose contact?"
        )
    filled = np.where(far, np.nan, x)
    bridge(filled, recording.sample_rate)
    sound = there & ~far
    filled[far] = np.where(
        np.isfinite(filled[far]), filled[far], np.interp(np.flatnonzero(far), np.flatnonzero(sound), x[sound])
    )
    filled[~far] = x[~far]
    many = f"{count} samples of {signal.name} are" if count > 1 else f"a sample of {signal.name} is"
    what = f"{usual} in {times.max()} of them" if count > 1 else usual
    return (
        filled,
        f"{many} far from those about it ({what}, the first at {recording.t[np.argmax(far)]:.6g} s): interpolated",
    )


def without_wild_samples(recording: Recording, model: CompiledModel) -> Recording:
    """The recording with the wild samples of its coordinates interpolated, and a note for each changed signal.

    A coordinate is a sensor whose acceleration is in the equations: unlike a current, it cannot jump for one sample. A
    sample is wild if its neighbours lie on a smooth curve within their noise and it is off this curve. Jumps and
    corners are kept, and so is a signal of which more than 0.1 % of the samples look wild. Far ones, such as the error
    codes of a sensor, are interpolated up to 5 % of the samples.

    Raises
    ------
    PvidError
        Where more are far.
    """
    changed = dict(recording.signals)
    notes = list(recording.notes)
    span = max(_SHORTEST, round(_SPAN * recording.sample_rate))
    moving = {jet.of for equation in model.equations for jet in jets(equation) if jet.order >= 2}
    for one in model.signals:
        if one.kind != "sensor" or one.name not in moving:
            continue
        x, note = _without_far_samples(recording, one)
        if note:
            changed[one.name] = x
            notes.append(note)
        found = breaks(x, span, one.sd)
        for first, end in zip(*stretches(found), strict=True):
            if end - first > _LONGEST:
                found[first:end] = False
        bridged = np.where(found, np.nan, x)
        bridge(bridged, recording.sample_rate)
        replaced = found & np.isfinite(bridged)
        firsts, _ = stretches(replaced)
        if 0 < len(firsts) <= _MOST * len(x):
            changed[one.name] = np.where(replaced, bridged, x)
            many = f"{len(firsts)} wild samples of {one.name}" if len(firsts) > 1 else f"a wild sample of {one.name}"
            notes.append(f"{many} (at {recording.t[firsts[0]] + 2 / recording.sample_rate:.6g} s): interpolated")
    return replace(recording, signals=changed, notes=tuple(notes))
