"""Resolution of an encoder, from its recorded values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]

_MOST_SAMPLES = 200_000
_LEAST_LEVELS = 4
# Of values that are whole numbers of steps the resultant of their phases is 1; of steps rounded to decimals of a third
# of a step it is 0.83; of values that lie anywhere it is below this, whatever step is tried.
_LEAST_RESULTANT = 0.7
_LEAST_STEP = 1e-12  # [rad] or [m], as in a rig file: finer ones are rounding
_LEAST_PART = 1e-6  # of the travel: float32's own steps are finer
_NEAR = 12  # levels
_TRIED = np.linspace(0.7, 1.4, 701)
# A level that a sensor gives is seen about as often as its neighbours; interpolated samples are seen once each.
_RARE = 0.05
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
    values
        As recorded, with any offset [n]; NaN and infinities are left out.

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
    levels = levels[seen > _RARE * usual]
    if len(levels) < _LEAST_LEVELS:
        return None
    gaps = np.diff(levels)
    for guess in (float(np.quantile(gaps, 0.25)), float(gaps.min())):
        if guess < _LEAST_STEP:
            continue
        step = _refined(levels, guess)
        if step is not None and step > _LEAST_PART * (levels[-1] - levels[0]):
            return step
    return None


def _refined(levels: Float, guess: float) -> float | None:
    """The step near a guess that most levels are whole numbers of; None if there is none."""
    middle = len(levels) // 2
    from_middle = levels - levels[middle]
    near = from_middle[max(0, middle - _NEAR) : middle + _NEAR + 1]  # further away a rough guess has lost count
    steps = guess * _TRIED
    resultant = np.abs(np.exp(2j * np.pi * near[None, :] / steps[:, None]).mean(axis=1))
    best = int(np.argmax(resultant))
    if resultant[best] < _LEAST_RESULTANT:
        return None
    step = float(steps[best])
    counts = np.rint(from_middle / step)
    # the whole range gives the step to more digits, as long as the count is not lost
    for reach in (30, 300, len(levels)):
        inner = np.abs(counts) <= reach
        if (counts[inner] ** 2).sum() > 0:
            step = float((counts[inner] * from_middle[inner]).sum() / (counts[inner] ** 2).sum())
            counts = np.rint(from_middle / step)
    whole = abs(np.exp(2j * np.pi * from_middle / step).mean())
    return step if whole >= _LEAST_RESULTANT else None
