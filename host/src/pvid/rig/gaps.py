"""Missing ticks of a run: short gaps are interpolated, long ones stay empty, and both are reported."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_BRIDGED_S = 0.02
_DEGREE = 5
_BESIDE = 6
# The rms departure of the samples beside a gap from its polynomial that is taken for noise, in units of the noise.
_FITTING = 2.0
_NOISE_SAMPLES = 1 << 18


def stretches(flags: npt.NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """First and last + 1 of each stretch of true flags."""
    outside = np.zeros(1, np.int8)
    edges = np.flatnonzero(np.diff(np.concatenate([outside, flags.view(np.int8), outside])))
    return edges[::2], edges[1::2]


def longest_stretch(flags: npt.NDArray[np.bool_]) -> slice:
    """The longest stretch of true flags; empty where there is none."""
    firsts, ends = stretches(flags)
    if not firsts.size:
        return slice(0, 0)
    longest = int(np.argmax(ends - firsts))
    return slice(int(firsts[longest]), int(ends[longest]))


def bridge(signals: Sequence[FloatArray], sample_rate: float) -> tuple[IntArray, IntArray]:
    """Interpolates the short gaps in place; returns first and last + 1 of all gaps.

    A tick is missing when a signal is NaN there. A gap takes the polynomial of degree 5, by least squares, through as
    many samples on either side as are missing, at least 6. It stays NaN, in all signals, when it is longer than 20 ms
    and than one tick, or when the polynomial misses those samples by more than their noise.

    Parameters
    ----------
    signals : of ndarray, shape (n,)
        The first and the last sample are there.
    sample_rate : float
        [Hz].
    """
    missing = np.logical_or.reduce([np.isnan(signal) for signal in signals])
    firsts, ends = stretches(missing)
    if not firsts.size:
        return firsts, ends
    longest = max(1, int(_BRIDGED_S * sample_rate + 1e-9))
    units = [_unit(signal) for signal in signals]
    noise = [_FITTING * _noise(signal[:_NOISE_SAMPLES] / unit) for signal, unit in zip(signals, units, strict=True)]
    for first, end in zip(firsts.tolist(), ends.tolist(), strict=True):
        gap = slice(first, end)
        if end - first > longest:
            for signal in signals:
                signal[gap] = np.nan
            continue
        beside = max(_BESIDE, end - first)
        low, high = max(0, first - beside), min(missing.size, end + beside)
        known = np.arange(low, high)[~missing[low:high]]
        middle, scale = (first + end - 1) / 2, (high - low) / 2
        powers = np.vander((known - middle) / scale, min(_DEGREE + 1, known.size), increasing=True)
        inverse = np.linalg.pinv(powers)
        within = np.vander((np.arange(first, end) - middle) / scale, powers.shape[1], increasing=True)
        free = known.size - powers.shape[1]
        found = []
        for signal, unit, largest in zip(signals, units, noise, strict=True):
            beside_it = signal[known] / unit
            coefficients = inverse @ beside_it
            residual = beside_it - powers @ coefficients
            if free > 0 and float(residual @ residual) > free * largest**2:
                break
            with np.errstate(over="ignore"):  # next to the largest number of all
                found.append(within @ coefficients * unit)
        for k, signal in enumerate(signals):
            signal[gap] = found[k] if len(found) == len(signals) else np.nan
    return firsts, ends


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
