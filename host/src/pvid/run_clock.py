"""The uniform clock of a recorded run: found from its time stamps, and what is wrong with them bridged and told.

A run whose t departs from a uniform clock by at most a tenth of a period is left as it is, bit for bit. Else each row
gets its tick, so that missing samples are seen, and one of two things holds:

* t is only rounded, or samples are missing: the samples stay as they are, each at its tick.
* t jitters. Whether the samples were taken at irregular times or only stamped late cannot be seen from t. But it can
  often be seen from phi and y: a motion is smoother at its true times. Where it is clearly smoother at uniform times,
  the samples stay as they are; else phi and y are interpolated at uniform times from the recorded ones, by cubic
  polynomials.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.errors import PvidError
from pvid.run_gaps import roughness
from pvid.run_table import Table

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Largest departure of t from a uniform clock that is left as it is [periods]. On the standard rig at 1 kHz (phi' up to
# 1 rad/s) it is 1e-4 rad, half the encoder's noise, and it leaves room for time stamps with few decimals.
_JITTER_PERIODS = 0.1
# A step of t longer than this many periods is a gap: a sample is missing.
_GAP_PERIODS = 1.5
# Half of what t is rounded to, and a little more.
_ROUNDING = 0.55
# w is proportional to the square of the sample rate: 1e-4 changes it by 0.02 %, a good run's standard error. So much
# the rig file's sample rate may differ from t without a word.
_RATE_TOLERANCE = 1e-4
# A quartz is off by 1e-4, a ceramic resonator by 5e-3, the RC oscillator of a microcontroller by 3e-2; beyond that t
# has another unit, or the rig file is another one's.
_RATE_LIMIT = 0.05
_RATE_RANGE_HZ = (1e-3, 1e9)
# Rows on either side of a gap that their mean tells the number of missing ticks from: jitter averages out.
_ROWS_BESIDE_GAP = 20
# Stamps that come in bursts (a PC's, of what a serial port hands over) are late by up to this [s].
_LATE_S = 0.05
_BURST_SHARE = 0.1
# Ticks that may be missing, of all: what is left is less than a recording.
_MISSING_SHARE = 0.5
_CHUNK = 1 << 18


@dataclass(frozen=True, eq=False)
class Uniform:
    """Samples on a uniform clock.

    Attributes
    ----------
    t, phi, y : ndarray, shape (n,)
        [s], [rad], [m]; phi and y are NaN at ticks without a sample.
    sample_rate : float
        [Hz].
    notes : what was found and done, a sentence each
    """

    t: FloatArray
    phi: FloatArray
    y: FloatArray
    sample_rate: float
    notes: tuple[str, ...]


def uniform(table: Table, promised: float | None) -> Uniform:
    """Samples of a table on a uniform clock.

    Parameters
    ----------
    table
        At least 3 rows; t is finite.
    promised
        The rig file's sample rate [Hz].

    Raises
    ------
    PvidError
        When time runs backwards, more is missing than there, or t and the promise contradict each other.
    """
    t = table.t
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # times near the end of float64's range
        period = float(t[-1] - t[0]) / (t.size - 1)
        if not np.isfinite(period):
            raise table.error(t.size - 1, "t", f"{t[-1]!s} s is too far from the first time, {t[0]!s} s")
        if period > 0 and _largest_departure(t, period) <= _JITTER_PERIODS:
            rate, note = _rate(table, 1 / period, _end_error(t, period), promised)
            return Uniform(t, table.phi, table.y, rate, note)
        return _from_stamps(table, promised)


def _from_stamps(table: Table, promised: float | None) -> Uniform:
    t = table.t
    steps = np.diff(t)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0)) + 1
        raise table.error(
            row, "t", f"{t[row]!s} s runs back from the time before it, {t[row - 1]!s} s (two recordings in one file?)"
        )
    if t[-1] == t[0]:
        raise table.error(1, "t", f"{t[1]!s} s repeats the time before it, as all times do")
    quantum = _quantum(t)
    fits = [_fit(t)]
    if fits[0].largest > _JITTER_PERIODS + _ROUNDING * quantum / fits[0].period:
        fits = _fits_with_gaps(table, steps, quantum, fits[0])
    repeats = steps == 0
    del steps  # 8 bytes a row, in front of what takes more
    fit = min(fits, key=lambda one: one.largest * one.period)
    rate, note = _rate(table, 1 / fit.period, fit.error, promised)
    if fit.largest <= _JITTER_PERIODS + _ROUNDING * quantum / fit.period:
        if fit.largest > _JITTER_PERIODS:
            note += (f"t is rounded to {quantum:g} s: the samples are taken as uniform at {rate:g} Hz",)
        return _placed(table, fit.ticks, rate, note)
    return _with_jitter(table, repeats, fit, rate, promised, note)


def _with_jitter(
    table: Table,
    repeats: npt.NDArray[np.bool_],
    fit: _Fit,
    rate: float,
    promised: float | None,
    note: tuple[str, ...],
) -> Uniform:
    size = f"by up to {fit.largest:.2g} periods ({fit.largest * fit.period:.2g} s, {table.place(fit.worst)})"
    late = fit.largest * fit.period <= _LATE_S
    if repeats.any():
        if not late or np.count_nonzero(repeats) < _BURST_SHARE * repeats.size:
            row = int(np.argmax(repeats)) + 1
            raise table.error(row, "t", f"{table.t[row]!s} s repeats the time before it")
        note += (
            f"t comes in bursts, it departs from a uniform clock {size}: the samples are taken as uniform at "
            f"{rate:g} Hz, and a missing one would not be seen",
        )
        return _placed(table, None, rate, note)
    if late and _smoother_when_uniform(table, fit):
        note += (
            f"t departs from a uniform clock {size}, but phi and y are smoother without that: the samples are taken as "
            f"uniform at {rate:g} Hz",
        )
        return _placed(table, fit.ticks, rate, note)
    # the recorded times are believed: any rate near theirs will do
    rate = promised if promised is not None else _shortest_decimal(1 / fit.period, 1e-3)
    t, phi, y = _interpolated(table, rate, fit.period)
    told = f"t jitters {size}: phi and y are interpolated at {rate:g} Hz from the recorded times"
    return Uniform(t, phi, y, rate, (told,))


def _placed(table: Table, ticks: IntArray | None, rate: float, notes: tuple[str, ...]) -> Uniform:
    """Each sample at its tick, NaN elsewhere; a sample a tick where none are given."""
    count = table.t.size if ticks is None else int(ticks[-1]) + 1
    t = _times(table.t[0], count, rate)
    if ticks is None or count == ticks.size:
        return Uniform(t, table.phi, table.y, rate, notes)
    phi, y = np.full(t.size, np.nan), np.full(t.size, np.nan)
    phi[ticks], y[ticks] = table.phi, table.y
    return Uniform(t, phi, y, rate, notes)


def _times(first: float, count: int, rate: float) -> FloatArray:
    t = np.arange(count, dtype=np.float64)
    t /= rate
    t += first
    return t


# --- departure from a uniform clock ------------------------------------------------------------------------------


def _largest_departure(t: FloatArray, period: float) -> float:
    """Of t from a clock through its ends [periods]; inf when t is not finite. In pieces, to save memory."""
    largest = 0.0
    for first in range(0, t.size, _CHUNK):
        piece = t[first : first + _CHUNK]
        departure = float(np.abs((piece - t[0]) / period - np.arange(first, first + piece.size)).max())
        largest = max(largest, departure) if departure == departure else np.inf
    return largest


def _end_error(t: FloatArray, period: float) -> float:
    """Relative error of a rate found from both ends of t, by the rounding of float64."""
    largest = max(abs(float(t[0])), abs(float(t[-1])))
    return 4 * float(np.spacing(largest)) / (period * (t.size - 1))


def _quantum(t: FloatArray) -> float:
    """The decimal that t is rounded to at the run's begin or at its end, the larger one [s]; 0: none.

    A logger that prints six digits rounds ever more as t grows.
    """
    found = 0.0
    for piece in (t[:500], t[-500:]):
        for digits in range(10):
            scaled = piece * 10.0**digits
            slack = 1e-3 + 4 * float(np.spacing(np.abs(scaled).max()))
            if np.abs(scaled - np.rint(scaled)).max() <= slack:
                found = max(found, 10.0**-digits)
                break
    return found


@dataclass(frozen=True, eq=False)
class _Fit:
    """A uniform clock through the stamps: tick of each row [n], None where each row is one; period [s], its relative
    standard error, the largest departure of a stamp [periods] and its row."""

    ticks: IntArray | None
    period: float
    error: float
    largest: float
    worst: int


def _fit(t: FloatArray, ticks: IntArray | None = None) -> _Fit:
    """By least squares; each row is a tick where none are given. In pieces, to save memory."""

    def pieces() -> Iterator[tuple[int, FloatArray, FloatArray]]:
        for first in range(0, t.size, _CHUNK):
            part = slice(first, first + _CHUNK)
            own = np.arange(first, min(first + _CHUNK, t.size)) if ticks is None else ticks[part]
            yield first, own.astype(np.float64) - middle, t[part] - mean

    mean = float(t.mean())
    middle = (t.size - 1) / 2 if ticks is None else float(ticks.mean())
    energy = product = squares = largest = 0.0
    for _, centred, times in pieces():
        energy += float(centred @ centred)
        product += float(centred @ times)
    period = product / energy
    worst = 0
    for first, centred, times in pieces():
        departure = times / period - centred
        squares += float(departure @ departure)
        row = int(np.argmax(np.abs(departure)))
        if abs(departure[row]) > largest:
            largest, worst = float(abs(departure[row])), first + row
    return _Fit(ticks, period, float(np.sqrt(squares / t.size / energy)), largest, worst)


def _fits_with_gaps(table: Table, steps: FloatArray, quantum: float, without: _Fit) -> list[_Fit]:
    """Clocks that leave ticks out where t steps far; `without` is the one that leaves out none.

    There are two: where t is rounded as coarsely as its period, a long step may be rounding or a missing sample.
    """
    some = steps[:: -(-steps.size // _CHUNK)]
    usual = float(np.median(some[some > 0])) if (some > 0).any() else without.period
    fits = []
    for longest in [_GAP_PERIODS * usual, _GAP_PERIODS * usual + quantum][: 2 if quantum > 0.1 * usual else 1]:
        period = float(steps.mean(where=steps <= longest))
        gaps = np.flatnonzero(steps > max(longest, _GAP_PERIODS * period))
        if not gaps.size:
            fits.append(without)
            continue
        lengths = steps[gaps] / period
        if float(lengths.sum()) > _MISSING_SHARE / (1 - _MISSING_SHARE) * table.t.size + gaps.size:
            if without.largest * without.period <= _LATE_S:
                return [without]  # stamps in bursts
            worst = int(gaps[np.argmax(lengths)])
            raise table.error(
                worst + 1,
                "t",
                f"a gap of {steps[worst]:.6g} s, {lengths.max():.4g} periods, comes before it, and more of the run is "
                f"missing than there (several recordings in one file?)",
            )
        ticks = np.ones(table.t.size, np.int64)
        ticks[0] = 0
        ticks[gaps + 1] = _ticks_across(table.t, gaps, period)
        fits.append(_fit(table.t, np.cumsum(ticks, out=ticks)))
    return fits


def _ticks_across(t: FloatArray, gaps: IntArray, period: float) -> IntArray:
    """Ticks between the rows on either side of each gap, from the mean times of some rows there."""
    edges = np.concatenate([[-1], gaps, [t.size - 1]])
    ticks = np.empty(gaps.size, np.int64)
    for k, gap in enumerate(gaps):
        before = t[max(edges[k], gap - _ROWS_BESIDE_GAP) + 1 : gap + 1]
        after = t[gap + 1 : min(edges[k + 2], gap + _ROWS_BESIDE_GAP) + 1]
        between = float(after.mean() - before.mean()) / period - (before.size + after.size - 2) / 2
        ticks[k] = max(1, round(between))
    return ticks


# --- rate --------------------------------------------------------------------------------------------------------


def _rate(table: Table, measured: float, error: float, promised: float | None) -> tuple[float, tuple[str, ...]]:
    """The run's sample rate [Hz], and a note where it is not the promised one."""
    name = table.columns["t"].name
    low, high = _RATE_RANGE_HZ
    if not low <= measured <= high:
        raise PvidError(
            f"{table.path}, column {name}: a sample rate of {measured:.6g} Hz is out of range (is t in seconds?)."
        )
    if promised is None:
        return _shortest_decimal(measured, 1e-9 + 3 * error), ()
    off = measured / promised - 1
    # t is trusted only to within the jitter at each end
    if abs(off) <= _RATE_TOLERANCE + 3 * error + 2 * _JITTER_PERIODS / (table.t.size - 1):
        return float(promised), ()
    if abs(off) > _RATE_LIMIT:
        raise PvidError(
            f"{table.path}, column {name}: the samples come at {measured:.6g} Hz, but the rig's sample rate is "
            f"{promised:.6g} Hz{_cause(name, measured / promised, measured)}."
        )
    rate = _shortest_decimal(measured, max(1e-9, 0.01 * abs(off)))
    return rate, (f"t runs at {rate:g} Hz, {100 * off:+.2g} % off the rig's sample rate: t is believed",)


def _cause(name: str, ratio: float, measured: float) -> str:
    """Why t may run at another rate than the rig file promises."""
    for unit, per_second in (("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        if abs(ratio * per_second - 1) < 2 * _RATE_LIMIT:
            return f": t looks like {unit}: use --columns t={name}:{unit}"
    return f": if t is right, use --set sample_rate={_shortest_decimal(measured, 1e-3):g}"


def _shortest_decimal(value: float, tolerance: float) -> float:
    """The shortest number within a relative ``tolerance``: 1000 rather than 1000.0000000000001."""
    for digits in range(1, 17):
        candidate = float(f"{value:.{digits}g}")
        if abs(candidate - value) <= tolerance * value:
            return candidate
    return value


# --- jitter ------------------------------------------------------------------------------------------------------


def _smoother_when_uniform(table: Table, fit: _Fit) -> bool:
    """Whether phi and y are clearly smoother at uniform times than at the recorded ones.

    Noise alone makes no difference.
    """
    rows = min(table.t.size, _CHUNK)
    ticks = (np.arange(rows) if fit.ticks is None else fit.ticks[:rows]).astype(np.float64)
    stamps = (table.t[:rows] - table.t[0]) / fit.period
    score = 0.0
    for signal in (table.phi[:rows], table.y[:rows]):
        uniform_energy, stamped_energy = roughness(signal, ticks), roughness(signal, stamps)
        if uniform_energy > 0 and stamped_energy > 0:
            score += float(np.log(uniform_energy / stamped_energy))
    return bool(score < -6 / np.sqrt(rows))  # some three standard deviations of the score of noise


def _interpolated(table: Table, rate: float, period: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """t, phi and y at uniform times from the cubics through the four samples around them; NaN within gaps."""
    there = np.isfinite(table.phi) & np.isfinite(table.y)
    times, phi, y = table.t, table.phi, table.y
    if not there.all():
        times, phi, y = times[there], phi[there], y[there]
    first, last = float(times[0]), float(times[-1])
    t = _times(first, int(np.floor((last - first) * rate * (1 + 1e-12))) + 1, rate)
    out = np.empty((2, t.size))
    for begin in range(0, t.size, _CHUNK):
        at = t[begin : begin + _CHUNK]
        right = np.clip(np.searchsorted(times, at, side="right"), 1, times.size - 1)
        start = np.clip(right - 2, 0, times.size - 4)
        gaps = [times[start + k] - at for k in range(4)]
        piece = out[:, begin : begin + _CHUNK]
        piece[:] = 0.0
        for i in range(4):
            weight = np.ones(at.size)
            for j in range(4):
                if j != i:
                    weight *= gaps[j] / (gaps[j] - gaps[i])
            piece[0] += weight * phi[start + i]
            piece[1] += weight * y[start + i]
        # a sample within half a period is as good as one at the tick
        nearest = np.minimum(np.abs(times[right] - at), np.abs(at - times[right - 1]))
        within = (times[right] - times[right - 1] > _GAP_PERIODS * period) & (nearest > period / 2)
        piece[:, within] = np.nan
    return t, out[0], out[1]
