"""The records of tests/data/cell are those that `bench cell` describes, and RC models predict them."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT

from bench import cell
from bench.replay import Replay
from pvid.identification.analysis import analysed
from pvid.identification.judge import judged
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.identify import identify
from pvid.rig.columns import Columns
from pvid.rig.run import read_recording

DATA = ROOT / "tests" / "data" / "cell"


@pytest.mark.parametrize("load", cell.LOADS, ids=lambda load: load.name)
def test_record_has_the_current_of_its_load_and_the_voltage_of_a_cell(load: cell.Load) -> None:
    recording = read_recording(DATA / f"{load.name}.csv.gz", None, Columns(cell.CHANNELS))
    assert recording.notes == ()
    np.testing.assert_array_equal(recording.signals["i"], load.current())
    assert 3.0 < recording.signals["v"].min() < recording.signals["v"].max() < 4.2
    assert np.ptp(recording.signals["v"]) > 0.05  # the load is seen


def test_the_two_loads_of_a_pair_differ() -> None:
    for first, second in zip(cell.LOADS[::2], cell.LOADS[1::2], strict=True):
        correlation = np.corrcoef(first.current(), second.current())[0, 1]
        assert abs(correlation) < 0.1  # 1/sqrt of 30 steps of 240 s is 0.18


def test_provenance_lists_every_record() -> None:
    text = (DATA / "PROVENANCE.md").read_text(encoding="utf-8")
    assert all(f"| {load.name}.csv.gz |" in text for load in cell.LOADS)
    assert "PyBaMM" in text


BAR = 5e-3  # V RMS, of the voltage under a load that the model was not identified on


def test_two_rc_pairs_predict_another_load_at_a_fifth_of_the_capacity_an_hour() -> None:
    found = cell.outcome("2 RC pairs", "battery_2rc", "steps-mild", "drive-mild")
    assert found.other_rms < BAR
    assert found.own_rms < BAR


def test_identify_predicts_another_load_with_the_weights_of_the_sensors_and_by_the_estimate_that_predicts() -> None:
    """Without a design: the command line has none."""
    run, other = cell.recorded("steps-mild"), cell.recorded("drive-mild")
    model = compiled_of("battery_2rc")
    found = identify(model, run.signals, run.sample_rate, weights="sensors")
    assert found.verdict.identified
    assert all(Replay(model, one).matches(found.p)["v"].rms < BAR for one in (run, other))
    default = judged(analysed(run, model)).found
    assert "prediction" in [one.name for one in default.verdict.reasons] and default.verdict.identified
    assert all(Replay(model, one).matches(default.p)["v"].rms < BAR for one in (run, other))


def test_stronger_load_needs_a_resistance_that_falls_with_the_current() -> None:
    """At half the capacity an hour, with peaks of 1.6 times it, the reaction's curve shows."""
    plain, reaction = (cell.outcome(title, name, "steps", "drive") for title, name in cell.MODELS)
    assert reaction.other_rms < BAR < plain.other_rms
    value, error = reaction.values["r"]
    assert value > 3 * error > 0
