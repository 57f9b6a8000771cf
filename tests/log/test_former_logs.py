"""Logs that a former version recorded: verified, exported and identified as by that version."""

import csv
import json
from pathlib import Path

import pytest
from in_process import pvid

from pvid.base.console import NOTHING_IDENTIFIED

LOGS = Path(__file__).parents[1] / "data" / "logs"
PENDULUM = {"w": 9.5 / 0.25, "d1": 7.9352, "d2": 4.6875}  # of the simulated sensors, with a rod of 0.25 m
MOTOR = {"R": 1.2, "L": 3e-3, "k": 0.05, "J": 2e-4}

FORMER = [  # checks, samples, truth
    ("pendulum_weak", 126, 1260, PENDULUM),
    ("pendulum_fixed", 125, 1260, PENDULUM),
    ("pendulum_refined", 185, 1240, PENDULUM),
    ("motor_weak", 24, 1200, MOTOR),
]


@pytest.mark.parametrize(("name", "checks", "samples", "truth"), FORMER)
def test_log_of_a_former_version_is_read_as_before(
    name: str, checks: int, samples: int, truth: dict[str, float], tmp_path: Path
) -> None:
    log = LOGS / f"former_{name}.pvlog"
    verified = pvid("verify", log)
    assert verified.return_value == 0
    assert f"in all: {checks} estimates and hashes equal in every bit, {samples} samples verified" in verified.stdout
    assert pvid("export", log, "--to", "csv", "-o", tmp_path / "a").return_value == 0
    last = list(csv.DictReader((tmp_path / "a-estimates.csv").open()))[-1]
    if name.startswith("pendulum"):  # its outputs follow from the rod in the rig file
        assert float(last["g"]) == pytest.approx(0.25 * float(last["w"]), rel=1e-6) and float(last["g_se"]) > 0
    found = json.loads(pvid("identify", log, "--json").stdout)
    assert found["verdict"] == "good" and found["samples"] >= samples
    for parameter, value in truth.items():
        one = found["parameters"][parameter]
        assert abs(one["value"] - value) < 4 * one["se"], parameter
    if name.startswith("pendulum"):  # that of the former version, which contains what small angles neglect
        assert found["parameters"]["w"]["se"] == pytest.approx(0.52, rel=0.1)


def test_log_of_the_former_strong_form_is_exported_and_names_the_version_that_verifies_it(tmp_path: Path) -> None:
    log = LOGS / "former_pendulum_strong.pvlog"
    verified = pvid("verify", log)
    assert verified.return_value == NOTHING_IDENTIFIED
    assert "not verified, version 0.1 verifies logs of its own strong form; export and identify" in verified.stdout
    assert pvid("export", log, "--to", "csv", "-o", tmp_path / "a").return_value == 0
    last = list(csv.DictReader((tmp_path / "a-estimates.csv").open()))[-1]
    assert float(last["g"]) == pytest.approx(0.25 * float(last["w"]), rel=1e-6) and float(last["g_se"]) > 0
