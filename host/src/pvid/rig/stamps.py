"""Time stamps that are no seconds, or do not rise: counters that wrap, rows out of order, wild stamps, clocks that
start over."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.base.units import Scale, scale_to
from pvid.rig.columns import unit_in
from pvid.rig.gaps import longest_bridged
from pvid.rig.table import Table

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# Periods of the counters that time stamps come from [s], and in the column's own unit.
_COUNTERS = [2.0**bits * tick for bits in (16, 24, 32) for tick in (1e-9, 1e-6, 1e-3)]
_COUNTS = [2.0**bits for bits in (16, 24, 32)]
_CLOCKS = (1.0, 60.0, 3600.0, 86_400.0)  # fractions of a second, seconds of a minute, ... [s]
# Stamps of 2015 to 2040 since 1970, in parts of a second, whose rows follow each other within so many seconds.
_SINCE_1970, _LONGEST_STEP = (1.42e9, 2.21e9), 20.0
_PARTS = {"ms": 1e3, "us": 1e6, "ns": 1e9}
# Days of 2000 to 2050 since the beginning of 1900, -4712, 1858 and 0: of spreadsheets, of astronomers, of MATLAB.
_DAYS = ((36_526.0, 54_790.0), (2_451_544.0, 2_469_808.0), (51_544.0, 69_808.0), (730_486.0, 748_750.0))
_DAY_S = 86_400.0
_FAST = 1.2e-5  # [s]: days at 1 Hz and more
_EVEN, _EVEN_AT_MOST = 1e-7, 2e-6  # part of a period, within which it is a round one
_OF_DAYS = re.compile(r"\bdoy\b|day.?of.?(the.?)?year|julian|\bm?jd\b|^days?$|datenum|serial.?(date|day)", re.I)
# A wrap leaves a step that is the usual one within this part, or both ends of the counter's range beside it.
_USUAL_PART = 0.25
_AT_ENDS = 50.0  # usual steps
_LEAST_TICKS = 8.0  # usual steps of a counter's period
_REGULAR_PART = 0.5  # of a step, that rows brought to their place may depart
_FARTHEST = 16  # rows that a row out of order stands from its place
_SHUFFLED = 0.05  # of the steps run back: the rows are in the order of something else
_WILD_SHARE = 0.01  # of the stamps, at most
_SEGMENT_ROWS = 50  # rows of a segment, as a rule: with more jumps the stamps mean nothing
# Ticks between segments, at least: no gap is interpolated over so many. Longer pauses are shortened where more of the
# run would be missing than there.
_APART = 64
_SLOW_SAMPLES = 4  # of the slowest sensor between two segments
# So few rows are taken for repeated, of all; of more only where hardly another row is like the one before it.
_FEW_REPEATED, _RESTING = 0.01, 0.1


def in_seconds(table: Table, days: bool = True) -> Table:
    """A table whose stamps are seconds, with a note where neither the file, the column's name nor the user stated their
    unit and the name or the size tells it: days, or parts of a second since 1970.

    Parameters
    ----------
    days : they may be: not where times are seconds by contract
    """
    column = table.columns["t"]
    t = table.t[np.isfinite(table.t)]
    stated = column.unit_given or column.unit_of_file or scale_to("s", unit_in(column.name, "s") or "") == Scale()
    if stated or (column.factor, column.divisor) != (1.0, 1.0) or t.size < 2:
        return table
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.abs(np.diff(t))
        period = float(t[-1] - t[0]) / (t.size - 1)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    if not 0 < step < np.inf:
        return table
    for unit, parts in _PARTS.items():
        low, high = _SINCE_1970
        if low <= t[0] / parts < high and step / parts <= _LONGEST_STEP:
            return _scaled(table, 1 / parts, f"{column.name} is taken as {unit} since 1970, by its size")
    if not days:
        return table
    if _OF_DAYS.search(column.name) and step < 1:
        return _scaled(table, _DAY_S, f"{column.name} is taken as days, by its name")
    if not period > 0 or not any(low <= t[0] < high for low, high in _DAYS):
        return table
    rounding = max(8 * float(np.spacing(t[-1])), float(np.ptp(np.diff(t))))
    error = min(max(_EVEN, rounding / (period * (t.size - 1))), _EVEN_AT_MOST)
    in_seconds_too = _is_round(period, error) or _is_round(1 / period, error)
    if period < _FAST or (not in_seconds_too and _is_round(period * _DAY_S, error)):
        return _scaled(table, _DAY_S, f"{column.name} is taken as days, by its size and its steps")
    return table


def _is_round(value: float, error: float) -> bool:
    """Whether a number has three digits at most, within a relative error."""
    return abs(float(f"{value:.3g}") / value - 1) <= error


def _scaled(table: Table, factor: float, note: str) -> Table:
    values = table.t / round(1 / factor) if factor < 1 else table.t * factor
    return replace(table, t=values, notes=(*table.notes, f"{note}: --columns with a unit says otherwise"))


def with_rising_stamps(table: Table) -> Table:
    """A table whose stamps do not run back, with a note on what was done; itself where nothing can be.

    Wraps of a counter are joined. A few rows out of order are sorted. A single stamp that is 0 or wild gets the mean of
    those beside it. Where the clock runs back by anything else, or pauses for longer than the run lasts, a segment
    begins: its times follow the ones before it, some ticks apart.
    """
    steps = np.diff(table.t)
    if not steps.size or not np.isfinite(steps).all():
        return table
    forward = steps[steps > 0]
    usual = float(np.median(forward)) if forward.size else 0.0
    if not usual or (steps.min() >= 0 and steps.max() <= _APART * usual):
        return table
    for repaired in (_unwrapped, _sorted, _without_wild, _in_segments):
        table = repaired(table, usual)
    return table


def _unwrapped(table: Table, usual: float) -> Table:
    t, steps = table.t, np.diff(table.t)
    unit = abs(float(table.columns["t"].in_si(np.ones(1))[0]))
    for period in _CLOCKS:
        over = steps[steps < 0] + period
        if over.size and (np.abs(over - usual) <= _USUAL_PART * usual).all() and t.min() >= 0 and t.max() < period:
            if t[0] <= usual:
                return table  # segments of that length, or a clock that began with the run
            name = table.columns["t"].name
            note = f"{name} starts over after {period:.10g} s, {over.size} times: joined (a part of a clock's time)"
            return _joined(table, period, steps < 0, note)
    for period in sorted({*_COUNTERS, *(unit * counts for counts in _COUNTS)}):
        back = np.flatnonzero(steps < -period / 2)
        if not back.size or period < _LEAST_TICKS * usual:
            continue
        over = steps[back] + period
        fits = np.abs(over - usual) <= _USUAL_PART * usual
        near = (over > 0) & (over < _AT_ENDS * usual)
        for low in (0.0, -period / 2):
            ends = (t[back] > low + period - _AT_ENDS * usual) & (t[back + 1] < low + _AT_ENDS * usual)
            fits |= near & ends & (t[back] < low + period) & (t[back + 1] >= low)
        if fits.all():
            times = "once" if back.size == 1 else f"{back.size} times"
            note = (
                f"{table.columns['t'].name} starts over after {period:.10g} s, {times} (first: "
                f"{table.place(int(back[0]) + 1)}): joined (a counter of the board)"
            )
            return _joined(table, period, steps < -period / 2, note)
    return table


def _joined(table: Table, period: float, wraps: BoolArray, note: str) -> Table:
    """With a period more behind each wrap [n - 1]."""
    turns = np.concatenate([[0], np.cumsum(wraps)])
    return replace(table, t=table.t + period * turns, notes=(*table.notes, note))


def _sorted(table: Table, usual: float) -> Table:
    """Rows that stand a few rows from their place are brought there if the stamps are then as regular as the others;
    rows in the order of another column, if their stamps are a uniform clock without a gap."""
    back = int(np.count_nonzero(np.diff(table.t) < 0))
    if not back:
        return table
    order = np.argsort(table.t, kind="stable")
    moved = np.flatnonzero(order != np.arange(order.size))
    rising = np.diff(table.t[order])
    if back > _SHUFFLED * rising.size and np.ptp(rising) < _REGULAR_PART * rising.mean():
        note = f"the rows are not in the order of {table.columns['t'].name}: sorted by it"
    else:
        if np.abs(order[moved] - moved).max() > _FARTHEST or moved.size > order.size * _FARTHEST * _WILD_SHARE:
            return table
        beside = np.unique(np.clip(np.concatenate([moved, moved - 1]), 0, order.size - 2))
        if np.abs(rising[beside] / usual - 1).max() > _REGULAR_PART:
            return table
        note = f"rows out of order: {back} (first: {table.place(int(moved[0]))}), sorted by {table.columns['t'].name}"
    return replace(table.rows(order, lambda row: table.place(int(order[row])), note), t=table.t[order])


def _without_wild(table: Table, usual: float) -> Table:
    """Single stamps beside their neighbours, which are two steps apart, get the mean of these."""
    t = table.t.copy()
    between = t[2:] - t[:-2]
    wild = (between > 0) & (between < 4 * usual) & ((t[1:-1] <= t[:-2]) | (t[1:-1] >= t[2:]))
    wild &= np.abs(t[1:-1] - (t[2:] + t[:-2]) / 2) > 0.7 * between
    places = np.flatnonzero(wild) + 1
    if not 0 < places.size <= max(1, _WILD_SHARE * t.size):
        return table
    note = (
        f"{table.columns['t'].name} is {t[places[0]]:.6g} s between {t[places[0] - 1]:.6g} s and "
        f"{t[places[0] + 1]:.6g} s ({table.place(int(places[0]))})"
        + (f", and {places.size - 1} more like it" if places.size > 1 else "")
        + ": interpolated"
    )
    t[places] = (t[places - 1] + t[places + 1]) / 2
    return replace(table, t=t, notes=(*table.notes, note))


def _in_segments(table: Table, usual: float) -> Table:
    t, steps = table.t, np.diff(table.t)
    pauses = steps > _APART * usual
    if float(steps[pauses].sum()) < usual * t.size:
        pauses[:] = False
    begins = (steps < 0) | pauses
    count = int(np.count_nonzero(begins))
    if not 0 < count <= max(1, t.size // _SEGMENT_ROWS):
        return table
    slowest = max(float(np.median(np.diff(np.flatnonzero(np.isfinite(one))))) for one in table.signals.values())
    apart = usual * max(_APART, longest_bridged(1 / usual) + 2, round(_SLOW_SAMPLES * slowest))
    shift = np.cumsum(np.where(begins, apart - steps, 0.0))
    first = int(np.argmax(begins))
    how = "runs back" if steps[first] < 0 else "jumps"
    note = (
        f"{table.columns['t'].name} {how} from {t[first]:.6g} s to {t[first + 1]:.6g} s ({table.place(first + 1)})"
        + (f", and at {count - 1} more places" if count > 1 else "")
        + ": a new segment begins there, and its times follow those before it"
    )
    return replace(table, t=t + np.concatenate([[0.0], shift]), notes=(*table.notes, note))


def without_repeated_rows(table: Table) -> Table:
    """Rows that a logger wrote twice are left out: with the same stamp and the same numbers, or with the stamp of the
    next row. Not where t is rounded so coarsely that it repeats anyway."""
    steps = np.diff(table.t)
    again = np.flatnonzero(steps == 0) + 1
    if not again.size:
        return table
    alike = _alike(table)
    twice = again[alike[again]]
    stale = again[~alike[again]] - 1
    if not alike[stale].all():
        return table
    gone = np.union1d(twice, stale)
    kept = np.delete(np.arange(table.t.size), gone)
    left = np.diff(table.t[kept])
    # where a mechanism rests, rows are alike whatever their stamps
    others = np.count_nonzero(alike) - gone.size
    few = gone.size < _FEW_REPEATED * table.t.size
    if (left <= 0).any() or not (few or others <= _RESTING * table.t.size):
        return table
    note = f"rows that repeat the one before them, left out: {gone.size} (first: {table.place(int(gone[0]))})"
    return table.rows(kept, lambda row: table.place(int(kept[row])), note)


def _alike(table: Table) -> BoolArray:
    """Whether each row has the numbers of the one before it [n]."""
    same = np.logical_and.reduce(
        [(one[1:] == one[:-1]) | (np.isnan(one[1:]) & np.isnan(one[:-1])) for one in table.signals.values()]
    )
    return np.concatenate([[False], same])
