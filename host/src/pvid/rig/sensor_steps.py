"""Resolution of an encoder, from its recorded values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_MOST_SAMPLES = 200_000
_LEAST_LEVELS = 4
# Of values that are whole numbers of steps the resultant of their phases is 1; of steps rounded to decimals of a third
# of a step it is 0.83; of values that lie anywhere it is below this, whatever step is tried.
_LEAST_RESULTANT = 0.7
# With 5 % of the samples interpolated, halfway between two steps at worst, it is 0.9.
_MOST_RESULTANT = 0.88
_LEAST_STEP = 1e-12  # [rad] or [m], as in a rig file: finer ones are rounding
_LEAST_PART = 1e-6  # of the travel: float32's own steps are finer
_NEAR = 12  # levels
_TRIED = np.append(np.linspace(0.7, 1.4, 701), 1.0)
# A level that a sensor gives is seen about as often as its neighbours; interpolated samples are seen once each.
_RARE = 0.05
_SURE = 10  # samples of a level
_COARSEST = 0.05  # rad: an encoder of 7 bits
_DIGITS = 4
_SAME = 0.01


def with_resolutions(recording: Recording, model: CompiledModel) -> tuple[Recording, CompiledModel]:
    """The model of a shipped mechanism with the resolution of each encoder that the recording shows, where the rig file
    does not state it, and a note on it."""
    signals, notes = [], list(recording.notes)
    for one in model.signals:
        is_open = one.kind == "sensor" and one.unit == "rad" and one.resolution > 0 and not one.given
        step = resolution_of(recording.signals[one.name]) if is_open else None
        if step is None or step > _COARSEST or abs(step / one.resolution - 1) < _SAME:
            signals.append(one)
            continue
        resolution = float(f"{step:.{_DIGITS}g}")
        signals.append(replace(one, resolution=resolution))
        notes.append(f"{one.name} moves in steps of {resolution:g} rad: taken as its resolution, which is not given")
    if len(notes) == len(recording.notes):
        return recording, model
    return replace(recording, notes=tuple(notes)), replace(model, signals=tuple(signals))


def resolution_of(values: npt.ArrayLike) -> float | None:
    """The step between the values that a sensor gives, in their unit.

    Parameters
    ----------
    values : as recorded, with any offset [n]; NaN and infinities are left out

    Returns
    -------
    The step; None where none can be seen: values that lie anywhere, or fewer than four different ones.
    """
    given = np.asarray(values, np.float64)[:_MOST_SAMPLES]
    given = given[np.isfinite(given)]
    levels, seen = np.unique(given, return_counts=True)
    if len(levels) < _LEAST_LEVELS:
        return None
    gaps = np.diff(levels)
    # decimals of text, or float32, leave copies of one level beside each other
    first = np.concatenate([[True], gaps >= 1e-3 * np.median(gaps)])
    seen = np.add.reduceat(seen, np.flatnonzero(first))
    levels = levels[first]
    usual = np.median(np.repeat(seen, seen))  # how often the level of a typical sample is seen
    levels, seen = levels[seen > _RARE * usual], seen[seen > _RARE * usual]
    if len(levels) < _LEAST_LEVELS:
        return None
    gaps = np.diff(levels)
    # Interpolated samples lie between the levels: of a slow encoder most motions from sample to sample are one step
    # yet, of a fast one, whose levels are seen once each, most gaps.
    guesses = [_mode(np.abs(np.diff(given))), _mode(gaps), float(np.quantile(gaps, 0.25)), float(gaps.min())]
    for guess, least in [(guess, least) for least in (_MOST_RESULTANT, _LEAST_RESULTANT) for guess in guesses]:
        if guess < _LEAST_STEP:
            continue
        step = _refined(levels, np.minimum(seen, _SURE), guess, least)
        if step is not None and step > _LEAST_PART * (levels[-1] - levels[0]):
            return step
    return None


def _mode(sizes: Float) -> float:
    """The most frequent one but 0, to a small part of it."""
    sizes = np.sort(sizes[sizes > _LEAST_STEP])
    if not sizes.size:
        return 0.0
    alike = np.searchsorted(sizes, (1 + _SAME) * sizes, side="right") - np.arange(sizes.size)
    first = int(np.argmax(alike))
    return float(np.median(sizes[first : first + int(alike[first])]))


def _refined(levels: Float, seen: IntArray, guess: float, least: float) -> float | None:
    """The step near a guess that most samples are whole numbers of, to this resultant; None if there is none."""
    middle = len(levels) // 2
    from_middle, weights = levels - levels[middle], seen / seen.sum()
    about = slice(max(0, middle - _NEAR), middle + _NEAR + 1)  # further away a rough guess has lost count
    steps = guess * _TRIED
    sums = np.exp(2j * np.pi * from_middle[None, about] / steps[:, None]) @ weights[about]
    resultant = np.abs(sums) / weights[about].sum()
    best = int(np.argmax(resultant)) if resultant[-1] < least else -1
    if resultant[best] < _LEAST_RESULTANT:  # of few levels
        return None
    step = float(steps[best])
    from_middle -= np.angle(sums[best]) / (2 * np.pi) * step  # the middle one may be an interpolated one
    counts = np.rint(from_middle / step)
    # the whole range gives the step to more digits, as long as the count is not lost
    for reach in (30.0, 300.0, 3e3, 3e4, np.inf):
        inner = np.abs(counts) <= reach
        own = weights[inner] * counts[inner]
        if np.count_nonzero(own) >= min(_NEAR, len(levels) - 1):  # of fewer an interpolated one could turn it
            step = float(own @ from_middle[inner] / (own @ counts[inner]))
            counts = np.rint(from_middle / step)
    whole = float(np.abs(np.exp(2j * np.pi * from_middle / step) @ weights))
    return step if whole >= least else None
