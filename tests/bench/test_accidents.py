"""Accidents of a recording: the bench's kinds are what they claim to be, and the table has each of them."""

import numpy as np
import pytest

from bench.accidents import ACCIDENTS, HEADER, MECHANISMS, SEEDS, Accident, Outcome, outcome_of, row_of, spoilt, told
from bench.figures import results_of
from pvid.models.mechanisms import compiled_of


@pytest.mark.parametrize("accident", ACCIDENTS, ids=lambda one: one.label)
def test_an_accident_changes_its_signals_alone(accident: Accident) -> None:
    model = compiled_of("dc_motor")
    before = {one.name: np.sin(np.arange(10_000) / 50.0) for one in model.signals}
    after = spoilt(model, before, accident, 0)
    changed = {name for name in before if not np.array_equal(before[name], after[name])}
    wanted = {"all": set(before), "sensor": {"phi"}, "drive": {"V"}}[accident.of]
    assert changed == (set() if accident.label == "none" else wanted)


@pytest.mark.parametrize("name", ["kapitza", "rigid_body"])
def test_lost_samples_and_wild_ones_leave_the_answer(name: str) -> None:
    for label in ("10 samples lost, t goes on", "10 samples of a sensor off by a tenth of it"):
        (accident,) = (one for one in ACCIDENTS if one.label == label)
        found = told(name, accident, 3)
        assert found.z is not None and found.z < 4.0
        assert found.percent is not None and found.percent < 0.5


def test_a_wrong_answer_counts_unless_it_has_a_warning() -> None:
    values, truth = {"a": (1.1, 0.01), "b": (2.0, 0.1)}, {"a": 1.0, "b": 2.1}
    silent, warned = (outcome_of(values, truth, truth, warned) for warned in (False, True))
    assert silent.is_wrong and not warned.is_wrong and silent.z == pytest.approx(10.0)
    nothing = outcome_of({}, truth, truth, False)
    assert not nothing.is_wrong
    row = dict(zip(HEADER, row_of("m", ACCIDENTS[0], [silent, warned, nothing]), strict=True))
    assert (row["answered"], row["warned"], row["wrong, no warning"]) == ("2 of 3", "1", "1")
    assert row_of("m", ACCIDENTS[0], [Outcome(None, None, True)])[3:6] == ("-", "-", "-")


def test_the_table_of_results_has_every_kind_of_every_mechanism() -> None:
    kept = results_of("accidents")
    assert kept.header == HEADER
    assert [row[:2] for row in kept.rows] == [(name, one.label) for name in MECHANISMS for one in ACCIDENTS]
    assert all(row[2].endswith(f"of {SEEDS}") for row in kept.rows)
