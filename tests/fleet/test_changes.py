"""What changed in a fleet: found beyond chance, named with its date, not hidden by warnings or by errors of scale."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from browser import chromium
from fleet_rows import DAY, row

from pvid.fleet.changes import FALSE_ALARMS, Change, Series, series_of
from pvid.fleet.dates import began_of, boards_of
from pvid.fleet.page import Fleet, page, sentence
from pvid.fleet.row import Row

NOISE = 0.01


def series(value: npt.NDArray[np.float64], chance: float = FALSE_ALARMS, apart: float = 0.05) -> Series:
    n = value.size
    return Series("b", "R", "ohm", DAY * np.arange(float(n)), value, np.full(n, NOISE), np.full(n, apart), chance)


@pytest.mark.parametrize("scatter", [1.0, 3.0])  # of what the noise says
@pytest.mark.parametrize("n", [4, 6, 30])
def test_chance_is_named_as_often_as_stated(n: int, scatter: float) -> None:
    draws = np.random.default_rng(n).normal(10, NOISE * scatter, (600, n))
    assert np.mean([bool(series(one).changes) for one in draws]) <= 1.5 * FALSE_ALARMS


@pytest.mark.parametrize("n", [6, 30])
@pytest.mark.parametrize("kind", ["step", "last", "trend", "bump"])
def test_a_change_is_found_where_it_is(kind: str, n: int) -> None:
    """Of a hundred times the noise, from the middle on, in the last recording, over all and in one alone; errors of the
    model five times the noise, which all recordings share, do not hide it."""
    k = np.arange(n)
    shape = {"step": k >= n // 2, "last": k == n - 1, "trend": k / (n - 1), "bump": k == n // 2}[kind]
    steps = {"step": [n // 2], "last": [n - 1], "trend": [0], "bump": [n // 2, n // 2 + 1]}[kind]
    for seed in range(20):
        found = series(10 + shape + np.random.default_rng(seed).normal(0, NOISE, n), FALSE_ALARMS / 30).changes
        assert [one.kind for one in found] == ["trend" if kind == "trend" else "step"] * len(steps)
        assert [one.end for one in found] == ([DAY * (n - 1)] if kind == "trend" else [DAY * one for one in steps])
        assert abs(abs(found[0].part) - 0.1) < 0.004


def test_two_recordings_are_compared_with_all_but_scale() -> None:
    assert not series(np.array([10.0, 10.25])).changes
    (one,) = series(np.array([10.0, 10.5])).changes
    assert one == Change("step", 0.0, DAY, 10.0, 10.5)


def test_a_recording_with_larger_errors_of_its_own_is_no_change() -> None:
    """The equations are off by what the other recordings do not share: the last one was published by another fit."""
    rows = fleet()[:10]
    last = replace(rows[-1], parameters={"g": (9.6, 0.3, "m/s^2")})
    (found,) = series_of([*rows[:-1], replace(last, se_apart={"g": 0.1})])
    assert not found.changes
    assert len(series_of([*rows[:-1], last])[0].changes) == 1


def test_the_mean_is_since_the_last_step_and_not_below_what_recordings_share() -> None:
    value = np.where(np.arange(20) < 12, 10.0, 11.0) + np.random.default_rng(1).normal(0, NOISE, 20)
    mean, se = series(value).latest
    assert abs(mean - 11) < 4 * NOISE / 8**0.5 and 0.048 < se < 0.051
    assert series(value, apart=NOISE).latest[1] < 2 * NOISE / 8**0.5


def test_the_latest_value_of_a_trend_is_its_end_with_the_error_of_a_line() -> None:
    """Standard error at the end of a line through n points: 2 sigma / sqrt(n) for many."""
    draws = []
    for seed in range(80):
        value = 10.0 + 0.3 * np.arange(20) + np.random.default_rng(seed).normal(0, NOISE, 20)
        (one,) = series(value).changes
        assert one.kind == "trend"
        end, se = series(value, apart=NOISE).latest
        draws.append((end - 15.7) / se)
    assert 0.75 < np.std(draws) < 1.25 and abs(np.mean(draws)) < 0.4  # 80 draws: 0.08 and 0.11


def fleet(**other: Any) -> list[Row]:
    """Two boards over ten days: one stays, of the other g falls by 2 %; errors of scale are 3 %."""
    noise = np.random.default_rng(1).normal(0, 0.001, (2, 10))
    apart = {"se_apart": {"g": 0.002}, "se_noise": {"g": 0.001}, **other}
    still = [row("motors/still", k + 1, 9.5 + noise[0, k], 0.3, **apart) for k in range(10)]
    return still + [row("motors/moving", k + 1, 9.5 - 0.19 * k / 9 + noise[1, k], 0.3, **apart) for k in range(10)]


@pytest.mark.parametrize(
    "warning", [None, "phi is late by 2.1e-05 s", "phi is late by 2.1e-05 s\nSlow: sample at 9 Hz."]
)
def test_the_page_says_what_changed_with_warnings_or_without(warning: str | None) -> None:
    found = Fleet.of(fleet(warning=warning))
    (alarm,) = found.changes(alarms=True)
    words = "moving: g fell by 2 % (9.500 to 9.310 m/s²) steadily from 2 to 11 January 1970"
    assert sentence(*alarm) == words and found.title == "Fleet of 2 boards, 2 to 11 January 1970"
    text = page(found, "pvid batch <all>")
    assert f'<strong class="bad">{words}</strong>' in text and "pvid batch &lt;all&gt;" in text
    assert "g 3.2 %" in text and ("2.1e-05 s (alike in 20 of 20 recordings)" in text) == (warning is not None)
    assert ("9 Hz. (alike in 20 of 20 recordings)" in text) == ("\n" in (warning or ""))
    assert text.count("as of all") == (20 if warning else 0) and "http:" not in text.split("<svg")[0]
    assert "refresh" not in text and 'http-equiv="refresh" content="7"' in page(found, "", refresh=7)


def test_the_page_fits_a_telephone(tmp_path: Path) -> None:
    """Nothing is wider than a telephone, with a path that has no place to break."""
    rows = [replace(one, path="fleet/" + 40 * "long" + ".csv") for one in fleet(warning="phi is late")]
    (tmp_path / "fleet.html").write_text(page(Fleet.of(rows), "pvid batch"), encoding="utf-8")
    wide = "(one) => one.scrollWidth > one.clientWidth + 1 && one.clientWidth"
    with chromium(tmp_path / "chromium", 390, 900) as browser:
        browser.get((tmp_path / "fleet.html").as_uri())
        assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")
        found = browser.execute_script(
            f"return [...document.querySelectorAll('body, body :not(svg *)')].filter({wide}).length"
        )
        assert found == 0


def test_a_small_change_is_told_and_is_no_alarm() -> None:
    found = Fleet.of(fleet(), alarm=0.05)
    assert not found.changes(alarms=True) and len(found.changes(alarms=False)) == 1
    text = page(found, "")
    assert "No parameter changed by 5 % or more" in text and "1 smaller change, beyond chance" in text


def test_a_fleet_in_which_nothing_was_identified_has_a_page() -> None:
    text = page(Fleet.of([Row("k", "a.csv", "a", 0.0, failure="it is <empty>")]), "")
    assert "it is &lt;empty&gt;" in text and "<svg" not in text and "1 failed" in text


DATES = {
    "t,V\n2026-11-03T10:20:30.5,1\n": ("x.csv", "recording", 1793701230),
    "# Date: 2026/11/03 10:20\nt,V\n0,1\n": ("x.csv", "recording", 1793701200),
    "t;V\n1793701230.25;1\n": ("x.csv", "recording", 1793701230),
    "t,V\n1793701230250,1\n": ("x.csv", "recording", 1793701230),
    "t,V\n0.0,1\n": ("run_20261103-1020.csv", "name", 1793701200),
    "t,V\n0.001,1\n": ("run-2026-13-03.csv", "file", 1000),
    "t,V\n0.002,12345678901234\n": ("r 20260230.csv", "file", 1000),
}


@pytest.mark.parametrize("text", DATES)
def test_a_recording_says_when_it_began(tmp_path: Path, text: str) -> None:
    name, by, seconds = DATES[text]
    path = tmp_path / name
    path.write_text(text)
    os.utime(path, (1000, 1000))
    assert began_of(path) == (seconds, by)


DAYS = ("2026-09-01", "2026-10-01")
ENDS = ["{}", "{}T14-30-05.123", "{}_143005_877", "{}_9-05", "{}(1)", "{} - Copy", "{}T143005Z", "01.{:.2}.2026"]


@pytest.mark.parametrize("end", ENDS)
def test_what_follows_a_date_is_no_part_of_a_board(end: str) -> None:
    ends = [end.format(day if "{}" in end else day[5:]) for day in DAYS]
    paths = [Path(f"all/{board}_{one}.csv") for board in ("b3", "b4") for one in ends]
    assert list(boards_of(paths).values()) == ["all/b3", "all/b3", "all/b4", "all/b4"]


@pytest.mark.parametrize(
    "groups",
    [
        {"motors/b3": ("b3/run1_{0}", "b3/run2_{1}", "b3/after_{1}"), "motors/b4": ("b4/run1_{0}", "b4/before_{0}")},
        {"motors": ("before_{0}", "after_{1}", "monday", "0007_{0}", "{1}")},
        {"motors": ("board-3", "board-4", "AK80-9", "AK80-64")},
        {"motors/board-3": ("board-3-001", "board-3-002"), "motors/board-4": ("board-4-001", "board-4-017")},
        {"motors/motor_1": ("motor_1_{0}", "motor_1_{1}"), "motors/motor_2": ("motor_2_{0}",)},
        {"motors/motor_01": ("motor_01_{0}", "motor_01_{1}"), "motors/motor_02": ("motor_02_{0}", "motor_02_{1}")},
        {"motors/b3": ("b3_1_{0}", "b3_2_{1}"), "motors/b4": ("b4_1_{0}", "b4_2_{1}")},
        {"motors/b3": ("b3_1_1.09.2026", "b3_2_1.10.2026"), "motors/b4": ("b4_1-09-2026", "b4_1-10-2026_2")},
        {"motors/axis-2": ("{0}_1405 axis-2", "{1}_1405 axis-2"), "motors": ("monday",)},
        {"motors/b3": ("b3/{0}/run", "b3/{1}/run"), "motors/b4": ("b4/2026-09/a",)},
        {"motors/b3": ("2026-09/b3_{0}", "2026-10/b3_{1}"), "motors/b4": ("2026-09/b4_{0}",)},
    ],
)
@pytest.mark.parametrize("suffix", [".csv", ".csv.gz"])
def test_recordings_of_a_board_share_a_folder_or_a_name(groups: dict[str, tuple[str, ...]], suffix: str) -> None:
    right = {Path(f"motors/{name.format(*DAYS)}{suffix}"): board for board, names in groups.items() for name in names}
    assert boards_of(right) == right


def test_a_board_that_differs_from_all_others_is_named() -> None:
    def fleet(last: float) -> Fleet:
        values = {"b1": 10.0, "b2": 10.1, "b3": 9.9, "b4": last, **dict.fromkeys(("b5", "b6", "b7"), 10.0)}
        return Fleet.of([row(board, day, value + 0.001 * day) for board, value in values.items() for day in range(3)])

    assert ">● b4<" in page(fleet(20.0), "") and fleet(20.0).odd == [
        ("b4", "b4: g is 20.0 m/s², of all other boards 9.9 to 10.1")
    ]
    assert not fleet(10.2).odd
