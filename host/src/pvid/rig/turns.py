"""Joins what a counter that starts over takes apart: the angle of an encoder after a turn, counts at any modulus."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_TURN = 2.0 * math.pi
_FEWEST = 100  # samples; with fewer the usual step between samples is not known
_MOST_SHARE = 0.1  # largest share of steps that are wraps: noise at the wrap position repeats them
# An unwrapped step is at most this many times the largest of the other steps.
_SMOOTH = 3.0
# A counter's jump is so many times the largest motion between two other samples, at least.
_MUCH_LARGER = 4.0
_CERTAIN = 4.0  # standard deviations of the change of the motion from sample to sample
_SURE_COUNT = 2.0  # error [counts] below which the nearest whole number is taken: it shifts what follows by so little
_LARGEST_COUNT, _SOME, _WHOLE = 2.0**40, 5000, 0.05
_WORDS = (2.0**16, 2.0**24, 2.0**32)
_ALONE = 10.0  # a wild sample is so many times as far from its neighbours as these from one another


def joined(phi: FloatArray) -> tuple[FloatArray, int]:
    """phi without jumps of a whole turn, and the number of jumps.

    phi is returned unchanged if there are too many jumps, or if a jump differs from a whole turn by more than the angle
    moves between two samples: then the encoder does not wrap. The median of an unwrapped angle is within half a turn
    of 0.

    Parameters
    ----------
    phi : ndarray, shape (n,)
        [rad]; NaN where there is no sample.
    """
    if phi.size < _FEWEST or not np.nanmax(phi) - np.nanmin(phi) > 0.75 * _TURN:
        return phi, 0
    there = np.isfinite(phi)
    values = phi[there]
    steps = np.diff(values)
    jumps = np.abs(steps) > 0.5 * _TURN
    count = int(np.count_nonzero(jumps))
    if not 0 < count <= _MOST_SHARE * steps.size:
        return phi, 0
    largest = float(np.abs(steps[~jumps]).max())
    turns = np.rint(steps / _TURN)
    if np.abs(steps - _TURN * turns)[jumps].max() > _SMOOTH * largest or largest > 0.25 * _TURN:
        return phi, 0
    values[1:] -= _TURN * np.cumsum(np.where(jumps, turns, 0.0))
    values -= _TURN * np.rint(np.median(values) / _TURN)
    out = phi.copy()
    out[there] = values
    return out, count


@dataclass(frozen=True, eq=False)
class Counter:
    """A signal without the jumps of the counter that it comes from.

    Attributes
    ----------
    values : ndarray, shape (n,)
        [its unit]; NaN where there is no sample.
    modulus : at which the counter starts over [its unit]
    jumps : how often
    """

    values: FloatArray
    modulus: float
    jumps: int


def counted_on(x: FloatArray, count: float) -> Counter | None:
    """A signal whose counter starts over at any modulus, joined; None where it jumps by nothing of the kind.

    A counter jumps from one end of its range to the other, always by its modulus less the motion between two samples,
    which those before and behind the jump show. The modulus is then a power of 2, or a round number of counts, or the
    whole number of counts that all jumps agree on; one jump alone must be of 16, 24 or 32 bits.

    Parameters
    ----------
    x : ndarray, shape (n,)
        [its unit]; NaN where there is no sample.
    count : what the column counts in [its unit]
    """
    there = np.isfinite(x)
    if np.count_nonzero(there) < _FEWEST or not np.nanmax(np.abs(x)) < _LARGEST_COUNT * count:
        return None
    count = _count_of(x[there], count)
    if not count:
        return None
    values = x[there] / count
    found = _jumps(values)
    if found is None:  # wild samples beside the wraps
        outer = (values[2:] + values[:-2]) / 2
        wild = np.abs(values[1:-1] - outer) > _ALONE * (np.abs(values[2:] - values[:-2]) + np.ptp(values) * 1e-3)
        kept = np.concatenate([[True], ~wild, [True]])
        found = _jumps(values[kept]) if wild.any() else None
        if found is None:
            return None
        modulus = found[1]
        smooth = values[kept] - modulus * np.cumsum(found[0])
        before = np.clip(np.cumsum(kept) - 1, 0, smooth.size - 1)
        joined_values = np.where(kept, smooth[before], values - modulus * np.rint((values - smooth[before]) / modulus))
    else:
        modulus = found[1]
        joined_values = values - modulus * np.cumsum(found[0])
    out = x.copy()
    out[there] = joined_values * count
    return Counter(out, modulus * count, int(np.count_nonzero(found[0])))


def _count_of(values: FloatArray, count: float) -> float:
    """The count that all values [n] are multiples of: the one given, or the least step between them; 0: neither is."""
    apart = np.diff(np.unique(values[:_SOME]))
    for one in (count, float(apart[apart > 1e-9 * np.abs(values).max()].min(initial=np.inf))):
        if one < np.ptp(values) / 10 and np.abs(values / one - np.rint(values / one)).max() < _WHOLE:
            return one
    return 0.0


def _jumps(values: FloatArray) -> tuple[FloatArray, float] | None:
    """Turns of the counter that begin at each sample [n], -1, 0 or 1, and its modulus [counts]."""
    steps = np.diff(values)
    reach = float(np.ptp(values))
    jumps = np.flatnonzero(np.abs(steps) > 0.5 * reach)
    if not 0 < jumps.size <= _MOST_SHARE * steps.size:
        return None
    others = np.abs(np.delete(steps, jumps)).max()
    if others * _MUCH_LARGER > reach:
        return None
    motion = np.where(np.isin(np.arange(steps.size), jumps), np.nan, steps)
    beside = jumps[:, np.newaxis] + np.array([-2, -1, 1, 2])
    near = motion[np.clip(beside, 0, steps.size - 1)]
    with np.errstate(invalid="ignore"):
        known = np.isfinite(near).sum(axis=1)
        usual = np.where(known > 0, np.nansum(near, axis=1) / np.maximum(known, 1), 0.0)
        bends = np.diff(motion)
        spread = max(float(np.nanstd(bends)), 1e-9 * reach)
    sizes = np.abs(steps[jumps] - usual)
    error = _CERTAIN * spread
    # from one end of the range to the other, less the motion of one sample at either
    if np.abs(sizes - np.median(sizes)).max() > error + 0.5 * float(others):
        return None
    modulus = float(np.median(sizes))
    if not reach - error <= modulus <= reach + 2 * float(others) + error:
        return None
    named = _named(modulus, error / np.sqrt(jumps.size), alone=jumps.size == 1)
    if named is None:
        return None
    turns = np.zeros(values.size)
    turns[jumps + 1] = np.rint((steps[jumps] - usual) / named)
    return turns, named


def _named(modulus: float, error: float, *, alone: bool) -> float | None:
    """The modulus that a counter has within an error [counts]; None where it is not known."""
    if modulus <= 0:
        return None
    power = 2.0 ** round(math.log2(modulus))
    if abs(power - modulus) <= error and (not alone or power in _WORDS):
        return power
    if alone:
        return None
    for step in (1000.0, 360.0, 100.0):
        round_one = step * round(modulus / step)
        if round_one and abs(round_one - modulus) <= error and error < step / 4:
            return round_one
    return float(round(modulus)) if error < _SURE_COUNT < modulus else None
