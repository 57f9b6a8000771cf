"""Wild samples of a recording: single ones far from the smooth signal about them, as interference makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.model.compiled import CompiledModel, Signal
from pvid.model.signals import order_of
from pvid.rig.breaks import breaks
from pvid.rig.gaps import bridge, stretches
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_SPAN = 0.5  # [s] over which a signal may change its character
_SHORTEST = 50  # samples of it
_LONGEST = 5  # samples that one wild sample makes suspect
_MOST = 1e-3  # of the samples: where more are, they belong to the signal
# Far samples: off the median about them by so many times the sensor's noise, what nine of ten samples are off it,
# or twice the usual motion; in runs of a few, with neighbours that are off by a small part of that.
_MEDIAN_OF, _FAR, _RUN, _NEIGHBOUR = 11, 10.0, 3, 0.2
# An error code: so many samples in a row, so often where both neighbours agree, while no input moves by so much of its
# range, nor did a few samples before: a fast current has its peak that long after a step of the voltage. Off by few
# steps of the sensor's resolution, or times the noise that the samples themselves have, is no code.
_CODES, _FEWEST_CODES, _STEADY, _LATER, _STEPS, _NOISES = 8, 4, 0.05, 3, 4, 6
_MEDIAN_BEND = 1.65  # of the second differences of white noise, over its standard deviation
# One or two values that no motion reaches: so many spans of eight of ten samples away from them, time and again, not in
# the long runs of a pulse.
_SPANS, _MOST_VALUES, _TENTH = 10.0, 2, 0.1
# Or any values of a sensor in runs of a few: so many spans away, between samples within one, while no other sensor
# moves by so many times its usual motion from two samples before to two behind, as it would with a true pulse.
_ALONE, _BESIDE, _MOVED = 3.0, 2, 3.0
MOST_FAR = 0.05  # of the samples: with more, the recording is refused


def far_from_median(x: Float, sd: float) -> Mask:
    """Samples that are far from the median about them, alone or in runs of a few."""
    half = _MEDIAN_OF // 2
    about = np.lib.stride_tricks.sliding_window_view(np.pad(x, half, mode="edge"), _MEDIAN_OF)
    off = np.abs(x - np.partition(about, half, axis=1)[:, half])  # NaN is partitioned to the end
    there = np.isfinite(off)
    moves = np.abs(np.diff(x[there]))
    if not moves.size:
        return np.zeros(len(x), np.bool_)
    limit = _FAR * max(2 * sd, float(np.quantile(off[there], 0.9)), 2 * float(np.median(moves)))
    far = there & (off > limit)
    for first, end in zip(*stretches(far), strict=True):
        beside = [off[k] for k in (first - 1, end) if 0 <= k < len(x) and np.isfinite(off[k])]
        if end - first > _RUN or max(beside, default=np.inf) > _NEIGHBOUR * off[first:end].min():
            far[first:end] = False
    return np.asarray(far)


def _error_codes(x: Float, sd: float, steady: Mask) -> Mask:
    """Samples of a sensor that cannot jump that have, alone or in runs of a few, one value time and again, off both
    neighbours in the same direction: at first where these agree and the inputs are steady, then wherever it stands. A
    peak of fast oscillations is off by less than the usual motion from sample to sample."""
    far = np.zeros(len(x), np.bool_)
    moves = np.abs(np.diff(x))
    step = float(np.min(moves[moves > 0], initial=np.inf))
    if not np.isfinite(step):
        return far
    noise = float(np.nanmedian(np.abs(np.diff(x, 2)))) / _MEDIAN_BEND
    limit = max(2 * _FAR * sd, _STEPS * step, 2 * float(np.nanmedian(moves)), _NOISES * noise)
    for run in range(1, _CODES + 1):
        first = np.arange(1, len(x) - run)
        inside = np.array([x[first + k] for k in range(run)])
        before, after = x[first - 1] - inside[0], x[first + run] - inside[0]
        same = (inside == inside[0]).all(axis=0) & (np.sign(before) == np.sign(after))
        off = np.minimum(np.abs(before), np.abs(after))
        with np.errstate(invalid="ignore"):
            alone = same & (off > limit)
            clear = alone & (np.abs(before - after) < _NEIGHBOUR * off)
        clear &= np.lib.stride_tricks.sliding_window_view(steady, run + 2).all(axis=1)
        values, times = np.unique(inside[0][clear], return_counts=True)
        codes = values[times >= _FEWEST_CODES]
        begins = first[alone & np.isin(inside[0], codes)]
        for k in range(run):
            far[begins + k] = True
    return far


def _out_of_reach(x: Float) -> Mask:
    """Samples of any signal that have a value far outside all others, such as -9999."""
    none = np.zeros(len(x), np.bool_)
    there = np.isfinite(x)
    low, high = np.quantile(x[there], [_TENTH, 1 - _TENTH])
    if low == high:
        return none
    outside = there & (np.maximum(low - x, x - high) > _SPANS * (high - low))
    values, times = np.unique(x[outside], return_counts=True)
    if not 0 < values.size <= _MOST_VALUES or times.min() < _FEWEST_CODES:
        return none
    first, end = stretches(outside)
    return outside if np.median(end - first) <= _RUN else none


def _alone(x: Float, others: Sequence[Float]) -> Mask:
    """Samples of a sensor, of a drive or of what jumps with it, far beyond all that is about them, if nothing else that
    is measured moves with them."""
    far = np.zeros(len(x), np.bool_)
    low, high = np.quantile(x[np.isfinite(x)], [_TENTH, 1 - _TENTH])
    off = np.maximum(low - x, x - high)
    first, end = stretches(off > high - low)
    inner = (end - first <= _RUN) & (first >= _BESIDE) & (end + _BESIDE <= len(x))
    for one, last in zip(first[inner], end[inner], strict=True):
        far[one:last] = off[one:last].min() > _ALONE * (high - low)
    at = np.flatnonzero(far)
    for other in others if at.size else ():
        moves = np.ptp(np.lib.stride_tricks.sliding_window_view(other, 2 * _BESIDE + 1), axis=1)
        if np.nanmedian(moves[at - _BESIDE]) > _MOVED * np.nanmedian(moves):
            return np.zeros(len(x), np.bool_)
    return far


def _steady(recording: Recording, model: CompiledModel) -> Mask:
    """Samples shortly before which no input moves by much."""
    moved = np.zeros(len(recording), np.bool_)
    for one in model.signals:
        if one.driven or one.kind == "input":
            u = recording.signals[one.name]
            moved[1:] |= np.abs(np.diff(u)) > _STEADY * (np.nanmax(u) - np.nanmin(u))
    return np.asarray(np.convolve(moved, np.ones(1 + _LATER))[: len(moved)] == 0)


def _without_far_samples(recording: Recording, signal: Signal, find: Callable[[Float], Mask]) -> tuple[Float, str]:
    """A signal's samples without those that are far from all about them, and a note on these."""
    x = recording.signals[signal.name]
    there = np.isfinite(x)
    if np.count_nonzero(there) <= _MEDIAN_OF:
        return x, ""
    far = find(x) | _out_of_reach(x)
    count = int(np.count_nonzero(far))
    if not count:
        return x, ""
    values, times = np.unique(x[far], return_counts=True)
    usual = f"{values[np.argmax(times)] if times.max() > 1 else x[np.argmax(far)]:g} {signal.unit}".rstrip()
    if count > MOST_FAR * np.count_nonzero(there):
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
    what = usual + (f" in {times.max()} of them" if times.max() > 1 else "")
    at = f"the first at {recording.t[np.argmax(far)]:.6g} s"
    return filled, f"{many} far from those about it ({what}, {at}): interpolated"


def without_wild_samples(recording: Recording, model: CompiledModel) -> Recording:
    """The recording with the wild samples of its coordinates interpolated, and a note for each changed signal.

    A coordinate is a sensor whose acceleration is in the equations: unlike a current, it has no corners. A
    sample is wild if its neighbours lie on a smooth curve within their noise and it is off this curve. Jumps and
    corners are kept, and so is a signal of which more than 0.1 % of the samples look wild. Far ones, such as the error
    codes of a sensor, are interpolated up to 5 % of the samples. Of a sensor whose rate alone is in the equations those
    are error codes that have one value time and again; of any other signal, which may jump, those that no motion
    reaches.

    Raises PvidError where more are far.
    """
    changed = dict(recording.signals)
    notes = list(recording.notes)
    span = max(_SHORTEST, round(_SPAN * recording.sample_rate))
    orders = {
        one.name: max((order_of(equation, [one.name]) for equation in model.equations), default=0)
        for one in model.signals
    }
    if model.chain is not None:
        orders |= {one.name: 2 for one in model.signals if one.kind == "sensor"}
    steady = _steady(recording, model)
    sensors = [one.name for one in model.signals if one.kind == "sensor"]
    for one in model.signals:
        find: Callable[[Float], Mask] = partial(far_from_median, sd=one.sd)
        if one.kind != "sensor":
            find = _out_of_reach
        elif one.driven or not orders[one.name]:
            find = partial(_alone, others=[recording.signals[name] for name in sensors if name != one.name])
        elif orders[one.name] < 2:
            find = partial(_error_codes, sd=one.sd, steady=steady)
        x, note = _without_far_samples(recording, one, find)
        if note:
            changed[one.name] = x
            notes.append(note)
        if one.kind != "sensor" or one.driven or orders[one.name] < 2:
            continue
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
