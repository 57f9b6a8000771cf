"""White noise of a sensor, from its recorded samples."""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np
import numpy.typing as npt

from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]

_MOST_SAMPLES = 100_000
_LEAST_SAMPLES = 500
# Noise this many times what the rig states is taken from the recording: coarse steps of an encoder reach 1.2.
_LARGER = 1.5
# White noise has one density at a quarter and at half of the sample rate, to some 3 % in 2000 samples. What a white
# force makes of a speed differs by 1.5, of a current with a time constant of two samples by 1.25.
_ALIKE = 1.15
_MEDIAN, _LOW = (0.5, 0.6745), (0.25, 0.3186)  # of sizes, and what it is in normal noise of 1
_FAR = 4.0  # standard deviations: behind steps of an input
_FEW = 0.4  # part of the samples
_LAGS = 4
_OF_INPUTS = 0.1  # part of the variance


def with_noise(recording: Recording, model: CompiledModel) -> tuple[Recording, CompiledModel]:
    """The model with the white noise of each sensor that is clearly larger in the recording than stated, with notes."""
    inputs = [recording.signals[one.name] for one in model.signals if one.kind == "input" or one.driven]
    signals, notes = list(model.signals), list(recording.notes)
    for place, one in enumerate(model.signals):
        if one.kind != "sensor" or one.driven or not one.sd:  # what a drive imposes may itself be white
            continue
        sd = white_noise(recording.signals[one.name], inputs, _LARGER * one.sd)
        if sd is None:
            continue
        noise = float(np.sqrt((sd / one.resolution) ** 2 - 1 / 12)) if one.resolution else sd
        noise = float(f"{noise:.3g}")
        signals[place] = replace(one, noise=noise)
        notes.append(
            f"{one.name} has a white noise of {sd:.2g} {one.unit}".rstrip() + f", {sd / one.sd:.2g} times what its rig "
            f"states: taken as its noise (as --set sensor.{one.name}.noise={noise:g} would)"
        )
    if len(notes) == len(recording.notes):
        return recording, model
    return replace(recording, notes=tuple(notes)), replace(model, signals=tuple(signals))


def white_noise(values: npt.ArrayLike, inputs: list[Float], least: float = 0.0) -> float | None:
    """Standard deviation of the white noise of a sensor, in its unit.

    Sixth differences leave of a motion what is faster than some three samples; of them the median is taken, which steps
    of an input do not move.

    Parameters
    ----------
    values : as recorded [n]; NaN where missing
    inputs : of the mechanism [n]
    least : a smaller one is None

    Returns
    -------
    None where what the differences leave is not white, follows an input, or is less than `least`.
    """
    x = np.asarray(values, np.float64)[:_MOST_SAMPLES]
    if len(x) < _LEAST_SAMPLES:
        return None
    fast = _differences(x, 1, 6)
    if not _spread(fast) > least:  # NaN, too
        return None
    slower = _differences(x, 2, 3)
    quiet = np.arange(len(fast)) >= _LAGS  # behind the first, which have no earlier inputs
    columns = []
    for fast_input in (_differences(u[:_MOST_SAMPLES], 1, 6) for u in inputs):
        columns += [np.roll(fast_input, lag) for lag in range(_LAGS)]
        is_usual = np.abs(fast_input) <= _FAR * _spread(fast_input)  # not about the steps of one that is held
        for lag in range(_LAGS):
            quiet[lag:] &= is_usual[: len(is_usual) - lag]
    quiet &= np.isfinite(fast) & np.isfinite(slower)
    if np.count_nonzero(quiet) < max(_FEW * len(x), _LEAST_SAMPLES // 2):
        return None
    fast, slower = fast[quiet], slower[quiet]
    sd = _spread(fast)
    is_normal = 1 / _ALIKE < _spread(fast, _LOW) / sd < _ALIKE if sd > least else False
    if not is_normal or not 1 / _ALIKE < _spread(slower) / sd < _ALIKE:
        return None
    if columns:
        usual = np.abs(fast) < _FAR * sd
        basis = np.stack(columns, axis=1)[quiet][usual]
        law = np.linalg.lstsq(basis, fast[usual], rcond=1e-9)[0]
        if np.mean((fast[usual] - basis @ law) ** 2) < (1 - _OF_INPUTS) * np.mean(fast[usual] ** 2):
            return None
    return sd


def _differences(x: Float, step: int, order: int) -> Float:
    """Of this order, over `step` samples each; of white noise they have its variance."""
    for _ in range(order):
        x = x[step:] - x[:-step]
    return np.asarray(x / np.sqrt(comb(2 * order, order)))


def _spread(x: Float, of_size: tuple[float, float] = _MEDIAN) -> float:
    """Standard deviation of normal values, from a quantile of their sizes; NaN without any."""
    x = np.abs(x[np.isfinite(x)])
    return float(np.quantile(x, of_size[0])) / of_size[1] if x.size else np.nan
