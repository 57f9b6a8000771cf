"""Stamps that run back: counters that wrap, rows out of order, wild stamps, restarts, rows written twice."""

import re

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.rig.columns import Channel, Columns, parsed
from pvid.rig.run import Recording, recording_of_arrays

Float = npt.NDArray[np.float64]

CHANNELS = (Channel("F", "N", held=True), Channel("x", "m"))
T = np.arange(4000) / 500.0
US = np.rint(T * 1e6).astype(np.int64)
FORCE = np.sin(3.0 * T).round(3)
X = (0.02 * np.sin(6.0 * T) + 0.01 * np.sin(17.0 * T)).round(6)


def read(t: npt.ArrayLike, unit: str = "s", rows: npt.ArrayLike | None = None) -> Recording:
    """The run, or some of its rows, with these stamps."""
    kept = np.arange(T.size) if rows is None else np.asarray(rows)
    data = {"t": np.asarray(t, np.float64), "F": FORCE[kept], "x": X[kept]}
    return recording_of_arrays(data, None, parsed(f"t=t:{unit}", CHANNELS))


def assert_as_it_was(found: Recording, note: str) -> None:
    assert found.sample_rate == 500.0
    assert found.signals["x"].tobytes() == X.tobytes() and found.signals["F"].tobytes() == FORCE.tobytes()
    assert np.abs(np.diff(found.t) - 0.002).max() < 1e-9
    assert len(found.notes) == 1 and re.search(note, found.notes[0]), found.notes


@pytest.mark.parametrize(
    ("stamps", "unit", "note"),
    [
        (
            (US + 2**32 - 1_500_000) % 2**32,
            "us",
            r"t starts over after 4294\.967296 s, once \(first: row 751\): joined",
        ),
        ((US - 1_500_000 + 2**32) % 2**32 - 2**31, "us", "t starts over after 4294.967296 s, once"),
        (((US // 1000) + 63_000) % 2**16, "ms", "t starts over after 65.536 s, once"),
        (US % 2**16, "us", "t starts over after 0.065536 s, 122 times"),
        (((US + 2**32 - 1_500_000) % 2**32) / 1e6, "s", "t starts over after 4294.967296 s"),
    ],
    ids=["us", "signed us", "16 bits of ms", "16 bits of us", "us in seconds"],
)
def test_counter_of_time_that_wraps_is_joined(stamps: npt.ArrayLike, unit: str, note: str) -> None:
    assert_as_it_was(read(stamps, unit), note)


def test_counter_that_wraps_within_lost_rows_is_joined() -> None:
    rows = np.delete(np.arange(T.size), np.arange(745, 760))
    found = read(((US + 2**32 - 1_500_000) % 2**32)[rows], "us", rows)
    assert len(found) == T.size and "starts over" in found.notes[0]


def test_rows_out_of_order_are_sorted() -> None:
    rows = np.arange(T.size)
    rows[[100, 101, 2000, 2001]] = rows[[101, 100, 2001, 2000]]
    rows[3000:3010] = rows[[*range(3005, 3010), *range(3000, 3005)]]
    assert_as_it_was(read(T[rows], rows=rows), r"rows out of order: 3 \(first: row 101\), sorted by t")


def test_single_wild_stamps_are_interpolated() -> None:
    t = T.copy()
    t[[2000, 3000]] = [0.0, 1e6]
    found = read(t)
    assert_as_it_was(found, r"t is 0 s between 3\.998 s and 4\.002 s \(row 2001\), and 1 more like it: interpolated")


@pytest.mark.parametrize(
    ("stamps", "note", "segments"),
    [
        (np.where(T < 4.0, T, T - 0.3), "t runs back from 3.998 s to 3.7 s", 2),
        (np.where(T < 4.0, T, T - 4.0), "t runs back from 3.998 s to 0 s", 2),
        (np.where(T < 3.0, T, np.where(T < 6.0, T - 3.0, T - 6.0)), "and at 1 more places", 3),
        (np.where(T < 4.0, T, T + 3600.0), "t jumps from 3.998 s to 3604 s", 2),
    ],
    ids=["set back", "restart", "two restarts", "an hour on"],
)
def test_clock_that_starts_over_begins_a_segment(stamps: Float, note: str, segments: int) -> None:
    found = read(stamps)
    assert found.sample_rate == 500.0 and len(found) < T.size + 500
    assert note in found.notes[0] and "a new segment begins there" in found.notes[0]
    assert len(found.segments) == segments
    np.testing.assert_array_equal(np.concatenate([found.signals["x"][part] for part in found.segments]), X)


def test_rows_in_the_order_of_another_column_are_sorted_where_their_stamps_are_a_clock() -> None:
    rows = np.random.default_rng(1).permutation(T.size)
    found = read(T[rows], rows=rows)
    np.testing.assert_array_equal(found.signals["x"], X)
    assert "sorted" in found.notes[0]
    rows = rows[: T.size // 2]
    with pytest.raises(PvidError, match=r"runs back from the time before it, .* as at \d+ more rows: is this column"):
        read(T[rows], rows=rows)


@pytest.mark.parametrize("count", [3, 100])
def test_rows_that_were_written_twice_are_left_out(count: int) -> None:
    again = np.sort(np.random.default_rng(2).choice(T.size, count, replace=False))
    rows = np.sort(np.append(np.arange(T.size), again))
    note = rf"rows that repeat the one before them, left out: {count} \(first: row {again[0] + 2}\)"
    assert_as_it_was(read(T[rows], rows=rows), note)


def test_rows_that_were_written_twice_with_the_next_stamp_are_left_out() -> None:
    again = np.arange(10, 3900, 40)
    rows = np.sort(np.append(np.arange(T.size), again))
    stamps = T[rows].copy()
    second = np.flatnonzero(np.diff(rows) == 0) + 1
    stamps[second] = T[rows[second] + 1]
    assert_as_it_was(read(stamps, rows=rows), rf"rows that repeat the one before them, left out: {again.size}")


def test_coarse_stamps_of_a_mechanism_at_rest_repeat_no_row() -> None:
    """Rows alike at one stamp: t is rounded to 10 ms, and nothing moves in the first half."""
    resting = np.where(T < 4.0, 0.0, X)
    data = {"t": np.floor(T * 100 + 1e-6) / 100, "F": np.where(T < 4.0, 0.0, FORCE), "x": resting}
    found = recording_of_arrays(data, None, Columns(CHANNELS))
    assert len(found) == T.size and found.sample_rate == pytest.approx(500.0, rel=1e-3)
