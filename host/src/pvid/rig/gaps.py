"""Missing samples of one signal: a sensor's short gaps are interpolated, a held input keeps its value."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_BRIDGED_S = 0.02
_DEGREE = 5
_BESIDE = 6
# The rms departure of the samples beside a gap from its polynomial that is taken for noise, in units of the noise.
_FITTING = 2.0
_NOISE_SAMPLES = 1 << 18
# A column of which so many cells are blank, or so many blank stretches are long, holds the changes of an input alone
# if a cell hardly ever repeats the one before it.
_BLANK_SHARE = 0.5
_LONG_BLANKS = 5
_REPEATS = 0.01
# A sensor whose samples are so many ticks apart, as a rule, is a slow one; beyond so many of its periods it has a gap.
_SLOW_TICKS = 2
SLOW_GAP = 2.5


def stretches(flags: BoolArray) -> tuple[IntArray, IntArray]:
    """First and last + 1 of each stretch of true flags."""
    outside = np.zeros(1, np.int8)
    edges = np.flatnonzero(np.diff(np.concatenate([outside, flags.view(np.int8), outside])))
    return edges[::2], edges[1::2]


def at_its_ends(x: FloatArray) -> Iterator[tuple[float, str, IntArray, IntArray]]:
    """The largest and the smallest value of a signal, in a word, and the stretches in which it stands there."""
    for end, word in ((float(np.nanmax(x)), "largest"), (float(np.nanmin(x)), "smallest")):
        yield end, word, *stretches(x == end)


def longest_stretch(flags: BoolArray) -> slice:
    """The longest stretch of true flags; empty where there is none."""
    firsts, ends = stretches(flags)
    if not firsts.size:
        return slice(0, 0)
    longest = int(np.argmax(ends - firsts))
    return slice(int(firsts[longest]), int(ends[longest]))


def bridge(signal: FloatArray, sample_rate: float) -> tuple[IntArray, IntArray]:
    """Interpolates the short gaps of a sensor in place; returns first and last + 1 of all its gaps.

    A gap takes the polynomial of degree 5, by least squares, through as many samples on either side as are missing, at
    least 6. It stays NaN when it is longer than 20 ms and than one tick, or when the polynomial misses those samples by
    more than their noise.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        What is missing at its ends stays so.
    sample_rate : float
        [Hz].
    """
    missing = np.isnan(signal)
    firsts, ends = stretches(missing)
    if not firsts.size:
        return firsts, ends
    longest = longest_bridged(sample_rate)
    unit = _unit(signal)
    largest = _FITTING * _noise(signal[:_NOISE_SAMPLES] / unit)
    fits: dict[tuple[bytes, int, int], tuple[FloatArray, FloatArray, FloatArray]] = {}
    filled = []
    for first, end in zip(firsts.tolist(), ends.tolist(), strict=True):
        if end - first > longest or first == 0 or end == signal.size:
            continue
        beside = max(_BESIDE, end - first)
        low, high = max(0, first - beside), min(missing.size, end + beside)
        gone = missing[low:high]
        key = (gone.tobytes(), first - low, end - first)
        if key not in fits:
            fits[key] = _polynomial(np.flatnonzero(~gone), first - low, end - low, high - low)
        inverse, powers, within = fits[key]
        beside_it = signal[low:high][~gone] / unit
        coefficients = inverse @ beside_it
        residual = beside_it - powers @ coefficients
        free = powers.shape[0] - powers.shape[1]
        if free <= 0 or float(residual @ residual) <= free * largest**2:
            with np.errstate(over="ignore"):  # next to the largest number of all
                filled.append((slice(first, end), within @ coefficients * unit))
    for gap, values in filled:
        signal[gap] = values
    return firsts, ends


def longest_bridged(sample_rate: float) -> int:
    """Samples of the longest gap that is interpolated: 20 ms, and one at least."""
    return max(1, int(_BRIDGED_S * sample_rate + 1e-9))


def _polynomial(known: IntArray, first: int, end: int, size: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of a gap, places first..end - 1 of so many: coefficients from the known samples, and values there and in it."""
    middle, scale = (first + end - 1) / 2, size / 2
    powers = np.vander((known - middle) / scale, min(_DEGREE + 1, known.size), increasing=True)
    within = np.vander((np.arange(first, end) - middle) / scale, powers.shape[1], increasing=True)
    return np.asarray(np.linalg.pinv(powers)), np.asarray(powers), np.asarray(within)


def holds_changes(signal: FloatArray, longest: int) -> bool:
    """Whether a column of a held input [n] contains changes alone: most cells are blank, or many blank stretches are
    longer than `longest`, and hardly a cell repeats the one before it; or it is blank but for a regular few."""
    there = np.isfinite(signal)
    places = np.flatnonzero(there)
    if places.size < 2:
        return True
    steps = np.diff(places)
    if 1 - places.size / (places[-1] - places[0] + 1) >= _BLANK_SHARE:
        return True
    repeats = float(np.mean(signal[places[1:]] == signal[places[:-1]]))
    return bool(repeats <= _REPEATS and np.count_nonzero(steps > longest + 1) >= _LONG_BLANKS)


def last_values(signal: FloatArray) -> FloatArray:
    """Each blank cell of a signal [n] as the last one before it; NaN in front of the first."""
    at = np.maximum.accumulate(np.where(np.isfinite(signal), np.arange(signal.size), 0))
    return signal[at]


def bridge_held(signal: FloatArray, sample_rate: float) -> tuple[IntArray, IntArray]:
    """Fills gaps of a held input in place; returns first and last + 1 of all its gaps.

    A short gap is interpolated like a sensor's where the input is smooth. Else a gap with the same value on either side
    takes this value if it is no longer than the input usually keeps one, and a short one with different values goes
    straight from one to the other, which is the mean over all instants at which the input may have changed.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        What is missing at its ends stays so.
    sample_rate : float
        [Hz].
    """
    firsts, ends = stretches(np.isnan(signal))
    if not firsts.size:
        return firsts, ends
    before, after = signal[firsts - 1], signal[np.minimum(ends, signal.size - 1)]  # NaN where there is none
    before[firsts == 0] = np.nan
    changes = np.flatnonzero(np.diff(last_values(signal)) != 0)
    kept = float(np.median(np.diff(changes))) if changes.size > 1 else float(signal.size)
    if kept <= 1:
        bridge(signal, sample_rate)
    longest = longest_bridged(sample_rate)
    for first, end, a, b in zip(firsts.tolist(), ends.tolist(), before.tolist(), after.tolist(), strict=True):
        if np.isfinite(signal[first]):
            continue
        if a == b and end - first <= max(kept, longest):
            signal[first:end] = a
        elif end - first <= longest:
            signal[first:end] = a + (b - a) * np.arange(1, end - first + 1) / (end - first + 1)
    return firsts, ends


def ticks_between(signal: FloatArray) -> float:
    """Mean ticks from one sample of a signal [n] to the next where it is a slow one, gaps left out; else 1."""
    places = np.flatnonzero(np.isfinite(signal))
    if places.size in (0, signal.size):
        return 1.0
    steps = np.diff(places)
    usual = float(np.median(steps)) if steps.size else 1.0
    if usual < _SLOW_TICKS:
        return 1.0
    return float(steps.mean(where=steps <= SLOW_GAP * usual))


def spread(times: FloatArray, values: FloatArray, at: FloatArray, longest: float) -> FloatArray:
    """Values [n] of a sensor at other times [n], ascending, by splines of degree 5 through the samples between gaps.

    Parameters
    ----------
    times, values : of its samples, the times rising [m]; of those at one time the last counts
    at : wanted times [n]
    longest : time between two samples beyond which there is a gap: NaN
    """
    from scipy.interpolate import make_interp_spline  # takes a quarter of a second

    out = np.full(at.size, np.nan)
    last = np.append(np.diff(times) > 0, True)
    times, values = times[last], values[last]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(times) > longest) + 1, [times.size]])
    for first, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if end - first <= _DEGREE:
            continue
        own = slice(*np.searchsorted(at, times[[first, end - 1]] + [-1e-9 * longest, 1e-9 * longest]))
        origin = times[first]
        out[own] = make_interp_spline(times[first:end] - origin, values[first:end], _DEGREE)(at[own] - origin)
    return out


def _unit(x: FloatArray) -> float:
    """A power of two above the largest of x [n], in which no square overflows; divided by it x keeps its bits."""
    return math.ldexp(1.0, min(math.frexp(float(np.nanmax(np.abs(x))))[1], 1023))


def _noise(x: FloatArray) -> float:
    """Standard deviation of the noise in x [n], and at least what float64 rounds."""
    return max(math.sqrt(_variance(x)), 1e-12 * float(np.nanmax(np.abs(x))))


def _variance(x: FloatArray) -> float:
    """Mean square of the departures of x [n] from the cubics through their neighbours, in units of what noise gives.

    Each sample is compared with the cubic through its two neighbours on either side. NaN is left out.
    """
    departure = x[2:-2] - (4 * (x[1:-3] + x[3:-1]) - x[:-4] - x[4:]) / 6
    square = departure[np.isfinite(departure)] ** 2 / (1 + (2 * 4**2 + 2) / 36)
    return float(square.mean()) if square.size else 0.0
