"""The uniform clock of a recorded run: found from its time stamps; faults of these are corrected and reported.

A run whose t departs from a uniform clock by at most a tenth of a period is left as it is, bit for bit. Else each row
gets its tick, so that missing samples are seen, and one of two things holds:

* t is only rounded, or samples are missing: the samples stay as they are, each at its tick.
* t jitters. Whether the samples were taken at irregular times or only stamped late cannot be seen from t. But it can
  often be seen from the signals: a motion is smoother at its true times. Where it is clearly smoother at uniform times,
  the samples stay as they are; else they are interpolated at uniform times from the recorded ones, by cubic
  polynomials.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.rig.gaps import spread
from pvid.rig.stamps import with_rising_stamps, without_repeated_rows
from pvid.rig.table import Table

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.integer]

# Largest departure of t from a uniform clock that is left as it is [periods]. On the standard rig at 1 kHz (phi' up to
# 1 rad/s) it is 1e-4 rad, half the encoder's noise, and it leaves room for time stamps with few decimals.
_JITTER_PERIODS = 0.1
# A step of t longer than this many periods is a gap: a sample is missing.
_GAP_PERIODS = 1.5
# Between jittering stamps a longer step is empty; in a shorter one, of a late sample or a missing one, the cubic
# through the samples around it lets 0.8 times their noise through.
_EMPTY_PERIODS = 2.5
# Half of what t is rounded to, and a little more.
_ROUNDING = 0.55
# w is proportional to the square of the sample rate: 1e-4 changes it by 0.02 %, a good run's standard error. So much
# the rig file's sample rate may differ from t without a word.
RATE_TOLERANCE = 1e-4
# A quartz is off by 1e-4, a ceramic resonator by 5e-3, the RC oscillator of a microcontroller by 3e-2; beyond that t
# has another unit, or the rig file is another one's.
RATE_LIMIT = 0.05
_RATE_RANGE_HZ = (1e-3, 1e9)
USUAL_RATES = (20.0, 20_000.0)  # Hz
# By unit of a clock, how many are a second; the ticks are those of a watch's quartz.
CLOCKS = {"ms": 1e3, "us": 1e6, "1/32768": 32_768.0, "ns": 1e9, "min": 1 / 60, "h": 1 / 3600, "d": 1 / 86_400}
_LONGEST_S = 1e20  # nanoseconds taken for seconds, since 1970, are 2e18
# Rows on either side of a gap whose mean gives the number of missing ticks: jitter averages out.
_ROWS_BESIDE_GAP = 20
# So few gaps in exact stamps are no rounding.
_CERTAIN_GAPS = 2
# Stamps that come in bursts (a PC's, of what a serial port hands over) are late by up to this [s].
_LATE_S = 0.05
_BURST_SHARE = 0.1
# Ticks that may be missing, of all: what is left is less than a recording.
_MISSING_SHARE = 0.5
# A polynomial of this degree follows a motion of 20 rad/s for so long, to 1e-4 of it.
_FOLLOWED_S, _DEGREE = 0.128, 5
_LEAST_ROWS = 32
_BLOCKS, _LEAST_BLOCKS = 400, 8
_CLEARLY = 4.0  # standard errors
_CHUNK = 1 << 16
# More incomplete rows than this part of all: sensors with stamps of their own stand in one table.
_INCOMPLETE_SHARE = 0.1
# A sensor of another clock has a gap beyond so many of its usual steps.
_OWN_GAP = 2.5


@dataclass(frozen=True, eq=False)
class Uniform:
    """Samples on a uniform clock.

    Attributes
    ----------
    t : ndarray, shape (n,)
        [s].
    signals : of each name an ndarray, shape (n,)
        In SI; NaN at ticks without a sample.
    sample_rate : float
        [Hz].
    notes : what was found and done, a sentence each
    ticks_between : by name: mean ticks from sample to sample of a sensor that is slower, where it is interpolated
    """

    t: FloatArray
    signals: Mapping[str, FloatArray]
    sample_rate: float
    notes: tuple[str, ...]
    ticks_between: Mapping[str, float] = field(default_factory=dict)


def uniform(table: Table, promised: float | None) -> Uniform:
    """Samples of a table on a uniform clock.

    Raises PvidError when time runs backwards, more is missing than there, or t and the promise contradict each other.

    Parameters
    ----------
    table : at least 3 rows; t is finite
    promised : the rig file's sample rate [Hz]
    """
    t = table.t
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # times near the end of float64's range
        period = float(t[-1] - t[0]) / (t.size - 1)
        if not abs(period) < _LONGEST_S / t.size:
            raise table.error(t.size - 1, "t", f"{t[-1]!s} s is too far from the first time, {t[0]!s} s")
        if period > 0 and _largest_departure(t, period) <= _JITTER_PERIODS:
            rate, note = _rate(table, 1 / period, _end_error(t, period), promised)
            return Uniform(t, table.signals, rate, (*table.notes, *note))
        return _from_stamps(with_rising_stamps(table), promised)


def _from_stamps(table: Table, promised: float | None) -> Uniform:
    steps = np.diff(table.t)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0)) + 1
        more = int(np.count_nonzero(steps < 0)) - 1
        before = f"the time before it, {table.t[row - 1]!s} s, as at {more} more rows: is this column the time?"
        raise table.error(row, "t", f"{table.t[row]!s} s runs back from {before}")
    if table.t[-1] == table.t[0]:
        raise table.error(1, "t", f"{table.t[1]!s} s repeats the time before it, as all times do")
    table = _on_one_clock(table)
    table = without_repeated_rows(table)
    steps = np.diff(table.t)
    quantum = _quantum(table.t)
    fit = _chosen(_fits(table, steps, quantum), quantum)
    repeats = steps == 0
    del steps  # 8 bytes a row, in front of what takes more
    rate, note = _rate(table, 1 / fit.period, fit.error, promised)
    note = (*table.notes, *note)
    if fit.keeps_time(quantum):
        if fit.largest > _JITTER_PERIODS:
            note += (f"t is rounded to {quantum:g} s: the samples are taken as uniform at {rate:g} Hz",)
        placed = _placed(table, fit.ticks, rate, note)
    else:
        placed = _with_jitter(table, repeats, fit, rate, promised, note)
    return placed


def _on_one_clock(table: Table) -> Table:
    """Of a table in which sensors have stamps of their own: the rows of the one with most numbers, the other signals at
    its stamps; a held input as its mean until the next one."""
    named = {name: one for name, one in table.signals.items() if name not in table.kept}
    clock = max(named, key=lambda name: int(np.count_nonzero(np.isfinite(named[name]))))
    rows = np.flatnonzero(np.isfinite(table.signals[clock]))
    t = table.t[rows]
    incomplete = np.count_nonzero(~table.complete)
    if rows.size == table.t.size or not (incomplete > _INCOMPLETE_SHARE * table.t.size or _keeps_time(t)):
        return table
    signals = {}
    for name, values in table.signals.items():
        own = np.isfinite(values)
        if name in table.columns.held:
            signals[name] = means_of_held(table.t[own], values[own], t, np.append(np.diff(t), t[-1] - t[-2]))
        elif own[rows].all():
            signals[name] = values[rows]
        else:
            longest = _OWN_GAP * float(np.median(np.diff(table.t[own])))
            signals[name] = spread(table.t[own], values[own], t, max(longest, _LATE_S))
    there = np.logical_and.reduce([np.isfinite(one) for one in signals.values()])
    first, last = int(np.argmax(there)), there.size - 1 - int(np.argmax(there[::-1]))
    note = f"the signals have stamps of their own: they are interpolated at those of {table.columns[clock].name}"
    less = replace(table, signals={name: one[first : last + 1] for name, one in signals.items()}, t=t[first : last + 1])
    return replace(less, place=lambda row: table.place(int(rows[row + first])), notes=(*table.notes, note))


def _keeps_time(t: FloatArray) -> bool:
    if not t[-1] > t[0]:
        return False
    fit = _fit(t)
    return fit.period > 0 and fit.keeps_time(_quantum(t))


def means_of_held(times: FloatArray, values: FloatArray, at: FloatArray, spans: FloatArray | float) -> FloatArray:
    """Means of an input that keeps each value until its next time, from each of `at` on over a span [n].

    Parameters
    ----------
    times, values : rising [m]; the first value holds before its time too, the last one for ever
    at : wanted times [n]
    spans : lengths [same unit]
    """
    changes = np.concatenate([[True], values[1:] != values[:-1]])
    times, values = times[changes], values[changes]
    first = np.clip(np.searchsorted(times, at, side="right") - 1, 0, None)
    last = np.clip(np.searchsorted(times, at + spans * (1 - 1e-9), side="left") - 1, 0, None)
    whole = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(times))])
    until = [whole[k] + values[k] * (end - times[k]) for k, end in ((first, at), (last, at + spans))]
    means = np.clip((until[1] - until[0]) / spans, values.min(), values.max())
    return np.where(last <= first, values[first], means)


def _with_jitter(
    table: Table, repeats: npt.NDArray[np.bool_], fit: _Fit, rate: float, promised: float | None, note: tuple[str, ...]
) -> Uniform:
    size = f"by up to {fit.largest:.2g} periods ({fit.largest * fit.period:.2g} s, {table.place(fit.worst)})"
    stamped_late = fit.largest * fit.period <= _LATE_S
    if repeats.any():
        if not stamped_late or np.count_nonzero(repeats) < _BURST_SHARE * repeats.size:
            row = int(np.argmax(repeats)) + 1
            raise table.error(row, "t", f"{table.t[row]!s} s repeats the time before it")
        note += (
            f"t arrives in bursts and departs from a uniform clock {size}: the samples are taken as uniform at "
            f"{rate:g} Hz, and a missing one would not be seen",
        )
        return _placed(table, None, rate, note)
    if stamped_late and _smoother_when_uniform(table, fit):
        note += (
            f"t departs from a uniform clock {size}, but {table.called()} are smoother without that: the "
            f"samples are taken as uniform at {rate:g} Hz",
        )
        return _placed(table, fit.ticks, rate, note)
    # the recorded times are believed: any rate near theirs will do
    rate = promised if promised is not None else _shortest_decimal(1 / fit.period, 1e-3)
    t, signals = interpolated(table, rate, fit.period)
    text = f"t jitters {size}: {table.called()} are interpolated at {rate:g} Hz from the recorded times"
    long = int(np.count_nonzero(np.diff(table.t) > _GAP_PERIODS * fit.period))
    if long:
        text += f"; steps longer than {_GAP_PERIODS:g} periods, of late samples or missing ones: {long}"
    return Uniform(t, signals, rate, (*table.notes, text))


def _placed(table: Table, ticks: IntArray | None, rate: float, notes: tuple[str, ...]) -> Uniform:
    """Each sample at its tick, NaN elsewhere; a sample a tick where none are given."""
    count = table.t.size if ticks is None else int(ticks[-1]) + 1
    t = _times(table.t[0], count, rate)
    if ticks is None or count == ticks.size:
        return Uniform(t, table.signals, rate, notes)
    signals = {name: np.full(t.size, np.nan) for name in table.signals}
    for name, values in table.signals.items():
        signals[name][ticks] = values
    return Uniform(t, signals, rate, notes)


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
    standard error, the largest departure of a stamp [periods] and its row; the number of gaps."""

    ticks: IntArray | None
    period: float
    error: float
    largest: float
    worst: int
    gaps: int

    def keeps_time(self, quantum: float) -> bool:
        """Whether no stamp departs by more than what is usual, and what t is rounded to [s]."""
        return self.largest <= _JITTER_PERIODS + _ROUNDING * quantum / self.period


def _fit(t: FloatArray, ticks: IntArray | None = None, gaps: int = 0) -> _Fit:
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
    return _Fit(ticks, period, float(np.sqrt(squares / t.size / energy)), largest, worst, gaps)


def _fits(table: Table, steps: FloatArray, quantum: float) -> list[_Fit]:
    """Clocks that leave ticks out where t steps far, the one without gaps first.

    There are two with gaps: where t is rounded as coarsely as its period, a long step may be rounding or a missing
    sample.
    """
    fits = [_fit(table.t)]
    some = steps[:: -(-steps.size // _CHUNK)]
    usual = float(np.median(some[some > 0])) if (some > 0).any() else fits[0].period
    for longest in [_GAP_PERIODS * usual + quantum, _GAP_PERIODS * usual][0 if quantum > 0.1 * usual else 1 :]:
        period = float(steps.mean(where=steps <= longest))
        gaps = np.flatnonzero(steps > max(longest, _GAP_PERIODS * period))
        if not gaps.size:
            continue
        lengths = steps[gaps] / period
        if float(lengths.sum()) > _MISSING_SHARE / (1 - _MISSING_SHARE) * table.t.size + gaps.size:
            if any(one.keeps_time(quantum) for one in fits) or fits[0].largest * fits[0].period <= _LATE_S:
                continue
            worst = int(gaps[np.argmax(lengths)])
            raise table.error(
                worst + 1,
                "t",
                f"a gap of {steps[worst]:.6g} s, {lengths.max():.4g} periods, precedes it, and more of the run is "
                f"missing than there (several recordings in one file?)",
            )
        ticks = np.ones(table.t.size, np.int32)  # half the memory; 2^31 of them would be 25 days at 1 kHz
        ticks[0] = 0
        ticks[gaps + 1] = _ticks_across(table.t, gaps, period)
        fits.append(_fit(table.t, np.cumsum(ticks, out=ticks), gaps.size))
    return fits


def _chosen(fits: list[_Fit], quantum: float) -> _Fit:
    """Of those that keep time the one with the fewest gaps, else the one that departs least.

    One or two long steps in stamps that are exact else are missing samples rather than rounding, which would make many.
    """
    exact = [one for one in fits if one.largest <= _JITTER_PERIODS and one.gaps <= _CERTAIN_GAPS]
    keeping = [one for one in fits if one.keeps_time(quantum)]
    if exact or keeping:
        return (exact or keeping)[0]
    return min(fits, key=lambda one: one.largest * one.period)


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
    if promised is None:
        low, high = _RATE_RANGE_HZ
        if not low <= measured <= high:
            text = f"a sample rate of {measured:.6g} Hz is out of range"
            raise PvidError(f"{table.path}, column {name}: {text}{_unit(name, measured)}.")
        return _shortest_decimal(measured, 1e-9 + 3 * error), ()
    off = measured / promised - 1
    # t is trusted only to within the jitter at each end
    if abs(off) <= RATE_TOLERANCE + 3 * error + 2 * _JITTER_PERIODS / (table.t.size - 1):
        return float(promised), ()
    if abs(off) > RATE_LIMIT:
        raise PvidError(
            f"{table.path}, column {name}: the samples come at {measured:.6g} Hz, but the rig's sample rate is "
            f"{promised:.6g} Hz{_cause(name, measured / promised, measured)}."
        )
    rate = _shortest_decimal(measured, max(1e-9, 0.01 * abs(off)))
    return rate, (f"t runs at {rate:g} Hz, {100 * off:+.2g} % off the rig's sample rate: t is used",)


def _cause(name: str, ratio: float, measured: float) -> str:
    """Why t may run at another rate than the rig file promises."""
    for unit, per_second in CLOCKS.items():
        if abs(ratio * per_second - 1) < 2 * RATE_LIMIT:
            return f": t looks like {unit}: use --columns t={name}:{unit}"
    return f": if t is right, use --set sample_rate={_shortest_decimal(measured, 1e-3):g}"


def _unit(name: str, rate: float) -> str:
    """What unit t is in, likely, where its rate in seconds [Hz] is impossible."""
    unit = _likely(rate)
    return f": t looks like {unit}: use --columns t={name}:{unit}" if unit else " (is t in seconds?)"


def _likely(rate: float) -> str:
    usual = (unit for unit, parts in CLOCKS.items() if USUAL_RATES[0] <= rate * parts <= USUAL_RATES[1])
    return next(usual, "")


def unit_of_slow(t: FloatArray) -> str:
    """The likely unit of stamps [n] whose rate in seconds is too small for any recording; "" of others."""
    steps = np.diff(t[np.isfinite(t)])
    step = float(np.median(steps)) if steps.size else 0.0
    return _likely(1 / step) if step > 1 / _RATE_RANGE_HZ[0] else ""


def _shortest_decimal(value: float, tolerance: float) -> float:
    """The shortest number within a relative ``tolerance``: 1000 rather than 1000.0000000000001."""
    for digits in range(1, 17):
        candidate = float(f"{value:.{digits}g}")
        if abs(candidate - value) <= tolerance * value:
            return candidate
    return value


# --- jitter ------------------------------------------------------------------------------------------------------


def _smoother_when_uniform(table: Table, fit: _Fit) -> bool:
    """Whether the signals are clearly smoother at uniform times than at the recorded ones.

    Blocks of rows all over the run are compared with a polynomial, by least squares, at either times.
    """
    length = max(_LEAST_ROWS, int(_FOLLOWED_S / fit.period))
    blocks = table.t.size // length
    chosen = np.unique(np.linspace(0, blocks - 1, min(blocks, _BLOCKS)).astype(int)) if blocks else np.zeros(0, int)
    rows = (chosen * length)[:, None] + np.arange(length)
    ticks = rows.astype(np.float64) if fit.ticks is None else fit.ticks[rows].astype(np.float64)
    stamps = table.t[rows] / fit.period
    scores = np.zeros(len(rows))
    for signal in (one[rows] for one in table.signals.values()):
        scores += np.log(_unexplained(signal, ticks) / _unexplained(signal, stamps))
    scores = scores[np.isfinite(scores)]
    if scores.size < _LEAST_BLOCKS:
        return False
    return bool(scores.mean() < -_CLEARLY * scores.std() / np.sqrt(scores.size))


def _unexplained(x: FloatArray, t: FloatArray) -> FloatArray:
    """Energy of each row of x [blocks, n] that a polynomial in its times t [blocks, n] does not explain."""
    begin, end = t[:, :1], t[:, -1:]
    powers = ((2 * t - begin - end) / (end - begin))[:, :, None] ** np.arange(_DEGREE + 1)
    explained = np.linalg.qr(powers)[0]
    coefficients = explained.transpose(0, 2, 1) @ x[:, :, None]
    energy: FloatArray = np.sum((x - (explained @ coefficients)[:, :, 0]) ** 2, axis=1)
    return energy


def interpolated(table: Table, rate: float, period: float) -> tuple[FloatArray, dict[str, FloatArray]]:
    """t and the signals at uniform times; NaN within gaps.

    A sensor is interpolated by the cubics through four samples around a time, a slow one by splines; a held input is
    its mean until the next time.

    Parameters
    ----------
    rate : of the uniform times [Hz]
    period : usual step of the table's times [s]
    """
    first, last = float(table.t[0]), float(table.t[-1])
    t = _times(first, int(np.floor((last - first) * rate * (1 + 1e-12))) + 1, rate)
    out = np.empty((len(table.signals), t.size))
    for row, (name, values) in zip(out, table.signals.items(), strict=True):
        own = np.isfinite(values)
        times, values = (table.t, values) if own.all() else (table.t[own], values[own])
        usual = float(np.median(np.diff(times)))
        slow = usual > _GAP_PERIODS * period
        if name in table.columns.held:
            row[:] = means_of_held(times, values, t, 1 / rate)
        elif slow:
            row[:] = spread(times, values, t, max(_OWN_GAP * usual, _LATE_S))
        for begin in range(0, t.size, _CHUNK):
            at, piece = t[begin : begin + _CHUNK], row[begin : begin + _CHUNK]
            right = np.clip(np.searchsorted(times, at, side="right"), 1, times.size - 1)
            if name not in table.columns.held and not slow:
                piece[:] = _by_cubics(times, values, at, right)
            # a sample within half a period is as good as one at the tick
            nearest = np.minimum(np.abs(times[right] - at), np.abs(at - times[right - 1]))
            within = (times[right] - times[right - 1] > _EMPTY_PERIODS * max(period, usual)) & (nearest > period / 2)
            piece[within] = np.nan
    there = np.flatnonzero(np.isfinite(out).any(axis=0))
    if not there.size:
        raise table.error(1, "t", f"the times fit no uniform clock: none of its ticks at {rate:g} Hz is near a sample")
    end = int(there[-1]) + 1
    return t[:end], dict(zip(table.signals, out[:, :end], strict=True))


def _by_cubics(times: FloatArray, values: FloatArray, at: FloatArray, right: IntArray) -> FloatArray:
    """Of samples [m] at times `at` [n], whose next samples are `right`."""
    start = np.clip(right - 2, 0, times.size - 4)
    gaps = [times[start + k] - at for k in range(4)]
    found = np.zeros(at.size)
    for i in range(4):
        weight = np.ones(at.size)
        for j in range(4):
            if j != i:
                weight *= gaps[j] / (gaps[j] - gaps[i])
        found += weight * values[start + i]
    return found
