"""Accidents of a recording: the bench's kinds are what they say, and the page has no wrong answer without a warning."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT

from bench.accidents import HEADER, OF_MOTOR, PENDULUM, SEEDS, Outcome, outcome_of, pendulum_with, row_of


@pytest.mark.parametrize("accident", PENDULUM + OF_MOTOR, ids=lambda one: one.label)
def test_an_accident_changes_the_signals(accident) -> None:  # type: ignore[no-untyped-def]
    n = 10_000
    before = {name: np.sin(np.arange(n) / 50.0) for name in ("phi", "y", "i", "V")}
    signals = {name: values.copy() for name, values in before.items()}
    left = accident.happens(signals, np.random.default_rng(0), 1000.0) or signals
    same = all(np.array_equal(left[name], values) for name, values in before.items())
    assert same == (accident.label == "none")


def test_lost_samples_and_wild_ones_leave_the_answer() -> None:
    for label in ("100 samples lost, t goes on", "10 samples of y off by 2 mm"):
        (accident,) = (one for one in PENDULUM if one.label == label)
        found = pendulum_with(accident, 3)
        assert found.z is not None and found.z < 4.0
        assert found.percent is not None and found.percent < 0.2


def test_a_wrong_answer_counts_unless_it_has_a_warning() -> None:
    values, truth = {"a": (1.1, 0.01), "b": (2.0, 0.1)}, {"a": 1.0, "b": 2.1}
    silent, warned = (outcome_of(values, truth, warned) for warned in (False, True))
    assert silent.is_wrong and not warned.is_wrong and silent.z == pytest.approx(10.0)
    nothing = outcome_of({}, truth, False)
    assert not nothing.is_wrong
    row = dict(zip(HEADER, row_of("m", PENDULUM[0], [silent, warned, nothing]), strict=True))
    assert (row["answered"], row["warned"], row["wrong, no warning"]) == ("2 of 3", "1", "1")
    assert row_of("m", PENDULUM[0], [Outcome(None, None, True)])[3:6] == ("-", "-", "-")


def test_the_page_has_every_kind_and_no_wrong_answer_without_a_warning() -> None:
    text = (ROOT / "host/docs/benchmarks/robustness.md").read_text(encoding="utf-8")
    lines = text.partition("<!-- accidents -->")[2].partition("<!-- /accidents -->")[0].strip().splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert tuple(rows[0]) == HEADER
    assert [row[1] for row in rows[2:]] == [one.label for one in PENDULUM + OF_MOTOR]
    assert all(row[2].endswith(f"of {SEEDS}") and row[-1] == "0" for row in rows[2:])
