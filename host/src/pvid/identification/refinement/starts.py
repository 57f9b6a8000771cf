"""Where a refinement starts: at the weak form's estimate, at the guess, and at guesses that are scaled."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from pvid.identification.values import output_at
from pvid.model.compiled import CompiledModel
from pvid.model.together import shifted_sensors
from pvid.oracle.weak.identify import Identified
from pvid.rig.run import NUMBER

Float = npt.NDArray[np.float64]

_SCALES = (1.0, 0.45, 2.2)  # of a guess
# Levels of up to four factors in nine starts: every two factors meet in all combinations (Taguchi's L9).
_LEVELS = ("0000", "0111", "0222", "1012", "1120", "1201", "2021", "2102", "2210")
_STEPS = 8  # towards a scaled guess
_PASSES = 20
_SOLVED = 1e-9  # of a logarithm
_NEAR = 3.0  # standard deviations of a guess: an offset beyond is none


def weak_start(weak: Identified) -> Float:
    """p, but half of its bound for what may be 0: its logarithm has run down, where nothing moves it."""
    half = [p if one.below is None else max(p, one.below / 2) for p, one in zip(weak.p, weak.judged, strict=True)]
    return np.array(half, np.float64)


def starts_of(model: CompiledModel, weak: Identified, signals: Mapping[str, Float]) -> Iterator[Float]:
    """p to start from, the likeliest first: that of the weak form, then guesses [n_p each].

    Scaled are the outputs of the model where they determine its positive unknowns, else these unknowns. Of the outputs
    those stay that follow from one unknown alone, unless all do: a search finds that unknown from any guess.
    """
    first = weak_start(weak)
    if np.isfinite(first).all():
        yield first
    number = signals.get(NUMBER, np.zeros(1))
    guess = np.empty(len(model.unknowns))
    for k, places in enumerate(model.places):
        own = {name: x[number == k] if len(number) > 1 else x for name, x in signals.items()}
        guess[list(places)] = _guess(model.alone, own)
    alone = guess[list(model.places[0])]
    for levels in _LEVELS:
        moved = _scaled(model.alone, alone, levels)
        if moved is None:
            continue
        p, factors = guess.copy(), np.divide(moved, alone, out=np.ones_like(alone), where=alone != 0)
        for places in model.places:
            p[list(places)] = guess[list(places)] * factors
        yield p


def _guess(model: CompiledModel, signals: Mapping[str, Float]) -> Float:
    """The guesses, with the offset of a sensor at its median."""
    out = []
    for one in model.unknowns:
        shifted = [] if one.positive else shifted_sensors(model, one)
        at = shifted[0][1] * float(np.nanmedian(signals[shifted[0][0]])) if shifted else one.guess
        out.append(at if abs(at - one.guess) <= _NEAR * one.sd else one.guess)
    return np.array(out, np.float64)


def _factor(k: int, levels: str) -> float:
    """Of the k-th scaled quantity; beyond the fourth the levels return, exchanged."""
    level = int(levels[k % len(levels)])
    return _SCALES[level if k // len(levels) % 2 == 0 else -level]


def _scaled(model: CompiledModel, guess: Float, levels: str) -> Float | None:
    """The guess with its outputs, or positive unknowns, scaled; None where no p has such outputs."""
    positive = np.array([one.positive for one in model.unknowns])
    if not _determine(model, guess, positive):
        out = guess.copy()
        out[positive] *= [_factor(k, levels) for k in range(int(positive.sum()))]
        return out
    mixed = [len(one.value.free_symbols & set(model.p)) > 1 for one in model.outputs]
    mixed = mixed if any(mixed) else [True] * len(mixed)
    scales = iter(_factor(k, levels) for k in range(len(mixed)))
    factors = np.log([next(scales) if one else 1.0 for one in mixed])
    wanted = np.log([output_at(model, guess, one)[0] for one in model.outputs])
    p = guess.copy()
    for _ in range(_STEPS):
        wanted = wanted + factors / _STEPS
        solved = _solved(model, p, positive, wanted)
        if solved is None:
            return None
        p = solved
    return p


def _determine(model: CompiledModel, guess: Float, positive: npt.NDArray[np.bool_]) -> bool:
    """Whether the outputs are as many positive numbers as there are positive unknowns, and follow from them."""
    if len(model.outputs) != positive.sum():
        return False
    values, slopes = _logarithms(model, guess, positive)
    return bool(np.isfinite(values).all() and np.linalg.cond(slopes) < 1 / _SOLVED)


def _logarithms(model: CompiledModel, p: Float, positive: npt.NDArray[np.bool_]) -> tuple[Float, Float]:
    """Logarithms of the outputs and their slopes by those of the positive unknowns; NaN where there are none."""
    found = [output_at(model, p, one) for one in model.outputs]
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.log([one for one, _ in found])
        slopes = np.array([slope[positive] * p[positive] / value for value, slope in found])
    return values, np.where(np.isfinite(slopes), slopes, 0.0)


def _solved(model: CompiledModel, p: Float, positive: npt.NDArray[np.bool_], wanted: Float) -> Float | None:
    """p whose outputs have these logarithms, by Newton's steps from a p that is near; None where they lead nowhere."""
    values, slopes = _logarithms(model, p, positive)
    for _ in range(_PASSES):
        if not np.isfinite(values).all():
            return None
        if np.abs(values - wanted).max() < _SOLVED:
            return p
        step = np.linalg.lstsq(slopes, wanted - values, rcond=None)[0]
        for share in (1.0, 0.5, 0.25, 0.125):
            near = p.copy()
            near[positive] *= np.exp(share * step)
            values, slopes = _logarithms(model, near, positive)
            if np.isfinite(values).all():
                break
        p = near
    return None
