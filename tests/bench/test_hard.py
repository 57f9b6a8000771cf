"""The hard cases in short: what is published is covered by its standard errors, or comes with an alarm."""

import numpy as np
import pytest

from bench.hard import CASES, HEADER, Case, Outcome, row, run_case, simulation_for

NAMES = ("kapitza", pytest.param("dc_motor", marks=pytest.mark.night))


def case(label: str) -> Case:
    return next(one for one in CASES if one.label == label)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("label", ["as shipped", "sensors 16 times as coarse", "drive x0.1"])
def test_nothing_wrong_is_published_in_silence(name: str, label: str) -> None:
    found = run_case(name, case(label), 3)
    assert found.wrong <= 1  # of three: 0.04 by chance
    assert found.published.all() or label != "as shipped"


@pytest.mark.parametrize("name", NAMES)
def test_without_motion_nothing_is_published_and_the_row_has_the_reason(name: str) -> None:
    still = case("no drive, no motion")
    found = run_case(name, still, 2)
    assert not found.published.any() and len(found.held) == 2
    cells = dict(zip(HEADER, row(name, still, found, found), strict=True))
    assert (
        cells["published"] == "0/2"
        and cells["RMS % of each parameter"] == "-"
        and cells["else held"].startswith("held")
    )


def test_a_case_changes_the_rig_as_it_is_named() -> None:
    shipped = simulation_for("dc_motor", case("as shipped"))
    coarse, quiet = (simulation_for("dc_motor", case(one)) for one in ("sensors 16 times as coarse", "no drive"))
    assert coarse.model.signal("phi").resolution == 16 * shipped.model.signal("phi").resolution
    assert np.ptp(quiet.run(0)["V"]) == 0 < np.ptp(shipped.run(0)["V"])


def test_a_bias_and_wrong_runs_are_faults() -> None:
    n = 20
    ones, correlation = np.ones((n, 2)), np.tile(np.eye(2), (n, 1, 1))
    yes, no = np.ones(n, bool), np.zeros(n, bool)
    noise = np.random.default_rng(1).normal(size=(n, 2))
    assert Outcome(yes, no, noise, ones, correlation).fault == ""
    assert Outcome(yes, no, noise + 2, ones, correlation).fault in ("wrong", "biased")
    assert Outcome(yes, no, 5 * ones, ones, correlation).fault == "wrong"
    assert Outcome(yes, yes, 5 * ones, ones, correlation).fault == ""
