"""Long runs in short: what a disturbance leaves behind, in every lane."""

import numpy as np
import pytest

from bench.longevity import DISTURBANCES, HEADER, LANES, Disturbance, Outcome, chunks, outcome, rows
from pvid.settings.enums import Reason


def of(name: str) -> Disturbance:
    return next(one for one in DISTURBANCES if one.name == name)


@pytest.mark.parametrize("name", ["kapitza", pytest.param("dc_motor", marks=pytest.mark.night)])
@pytest.mark.parametrize("what", ["all signals stand still", "samples missing", "a sensor keeps its value"])
def test_an_answer_comes_back_or_raises_its_alarm(name: str, what: str) -> None:
    for lane in LANES:
        found = outcome(name, lane, of(what), 120_000)
        assert found.not_finite == 0 and not found.silent
        assert found.percent < 1 or found.reason != Reason.UPDATED


def test_another_mechanism_is_followed_or_raises_the_alarm() -> None:
    for lane in LANES:
        found = outcome("kapitza", lane, of("the first parameter larger by 20 % from then on"), 120_000)
        assert not found.silent


@pytest.mark.parametrize("one", DISTURBANCES[1:-1], ids=lambda one: one.name)
def test_a_disturbance_is_in_the_middle_third_alone(one: Disturbance) -> None:
    disturbed, plain = (list(chunks("dc_motor", each, 120_000)) for each in (one, of("none")))
    same = [
        all(np.array_equal(a[key], b[key], equal_nan=True) for key in a) for a, b in zip(disturbed, plain, strict=True)
    ]
    assert same == [True, True, False, False, True, True]


def test_a_far_answer_without_an_alarm_is_marked() -> None:
    assert "**9.0 s.e.**" in Outcome(1, 0, 2.0, 9.0, Reason.UPDATED).cell
    assert Outcome(1, 0, 2.0, 9.0, Reason.MISFIT).cell == f"2 %, {Reason.MISFIT.text}"
    assert Outcome(1, 0, 0.01, 9.0, Reason.UPDATED).cell == "0.01 %"  # of the motion's bias
    assert Outcome(1, 3, 2.0, 9.0, Reason.UPDATED).cell == "NOT FINITE"


def test_a_row_has_a_cell_for_each_lane() -> None:
    (row,) = rows(["rigid_body"], 20_000, lambda: None, DISTURBANCES[:1])
    assert len(row) == len(HEADER) and row[:2] == ("rigid_body", "none")
