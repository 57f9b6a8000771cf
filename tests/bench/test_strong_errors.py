"""The bench of the strong form beside the weak form: its short forms."""

from __future__ import annotations

import numpy as np
import pytest

from bench import strong
from bench.mechanisms import start_of
from pvid.sim.simulated_run import SOFT, simulation_of


def test_a_finer_encoder_helps_the_strong_form_and_the_weak_form_is_better(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(strong, "FINER", (1, 64))
    counted: list[int] = []
    coarse, fine = [
        dict(zip(strong.HEADER, row, strict=True)) for row in strong.rows(["ring_down"], 3, lambda: counted.append(1))
    ]
    assert len(counted) == 6
    assert float(fine["RMS %: strong"]) < float(coarse["RMS %: strong"]) / 10
    assert float(coarse["strong over weak: median"]) > 2 and float(fine["strong over weak: median"]) > 1


@pytest.mark.parametrize("name", ["cart_pendulum", "battery_2rc", "coasting_motor"])
def test_two_standard_errors_contain_the_truth_of_other_runs(name: str) -> None:
    """By rows and other windows alone 42, 43 and 85 % of the parameters: the window is where the bias changes least."""
    simulation = strong.as_sampled(simulation_of(name))
    form, truth = strong.strong_of(simulation), np.asarray(simulation.truth)
    found = [form.of(simulation.run(seed, SOFT), start_of(simulation, seed)) for seed in range(1, 6)]
    off = np.array([(p - truth) / se for p, se in found])
    assert np.mean(np.abs(off) < 2) > 0.9
    assert np.median(np.abs(off), axis=0).max() > 0.3  # no error is far too large for all


def test_only_what_is_differentiated_twice_becomes_finer() -> None:
    motor = simulation_of("dc_motor")
    before, after = (
        {one.name: one.resolution for one in model.signals}
        for model in (motor.model, strong.with_finer_sensors(motor, 4).model)
    )
    assert after == {**before, "phi": before["phi"] / 4}
    lag = strong.with_finer_sensors(simulation_of("cooling"), 2).model  # of the first order: every sensor
    assert all(one.resolution == 0.0625 / 2 for one in lag.signals)


def test_starts_are_a_factor_off_and_the_forms_converge_from_twice_the_truth() -> None:
    kapitza = simulation_of("kapitza")
    off = strong.starts(kapitza, 2.0, 5)[:, :3] / kapitza.truth[:3]  # the others may have either sign
    assert np.allclose(np.abs(np.log(off)), np.log(2.0))
    found = list(strong.radius_rows(["kapitza"], 3, lambda: None))
    assert [row[:3] for row in found] == [("kapitza", "weak", "3"), ("kapitza", "strong", "3")]
    assert all(row[4:7] == ("100 %",) * 3 for row in found)
    assert all(len(row) == len(strong.RADIUS_HEADER) for row in found)


def test_one_norm_of_all_rows_halves_the_errors_of_outputs_with_common_noise() -> None:
    """By sqrt(1 - 0.9^2) = 0.44 where Y alone is noisy; of a single equation there is no norm to choose."""
    (row,) = strong.norm_rows(["kapitza"], 20, lambda: None)
    found = dict(zip(strong.NORM_HEADER, row, strict=True))
    assert found["mechanism"] == "two outputs, common noise" and float(found["correlation"]) == pytest.approx(
        0.9, abs=0.01
    )
    assert 0.3 < float(found["ratio: median"]) < 0.65
    assert (found["products of M: apart"], found["in one"]) == ("2", "3")
