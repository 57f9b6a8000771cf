"""What wrong scales of y and l1 do to the parameters, and that the standard errors say so."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from pvid.cli.main import commands
from pvid.models.kapitza import MODEL
from pvid.models.model import ScaleError
from pvid.rig.file import RigFile
from pvid.rig.run import Run, write_run
from pvid.run.engine_identify import identify_by_engine
from pvid.run.identify import Identification
from pvid.sim.pendulum import STANDARD_PENDULUM, Sensors, simulate, standard_sensors

P = STANDARD_PENDULUM.linear
L1 = STANDARD_PENDULUM.l1
STEP = 1e-3
STANDARD = RigFile.standard()
RIG = STANDARD
MECHANISM = STANDARD.mechanism
LINEAR, PHYSICAL = MODEL.mapped_names, MODEL.physical_names


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate(sensors=Sensors(), truth="linear", duration=15.0).run


def scale_errors(p: npt.ArrayLike, y_gain: float, l1: float) -> tuple[ScaleError, ScaleError]:
    found = MECHANISM.scale_errors(p, {"y_gain": y_gain, "l1": l1})
    return found["y_gain"], found["l1"]


def added_covariance(p: npt.ArrayLike, y_gain: float, l1: float) -> npt.NDArray[np.float64]:
    return MECHANISM.added_covariance(p, {"y_gain": y_gain, "l1": l1})


def exact(result: Identification) -> dict[str, float]:
    assert result.identified
    return result.value


@pytest.mark.parametrize("core", ["f64", "f32"])
def test_too_large_y_scale_moves_the_estimate_as_predicted(run: Run, core: str) -> None:
    rig = RIG
    rig = replace(rig, identifier=replace(rig.identifier, core=core))  # type: ignore[arg-type]
    told, _ = scale_errors(P, STEP, 0.0)
    right = exact(identify_by_engine(run, rig))
    wrong = exact(identify_by_engine(replace(run, y=(1 + STEP) * run.y), rig))
    for names, shifts in ((LINEAR, told.p), (PHYSICAL, told.physical)):
        for name, shift in zip(names, shifts, strict=True):
            # the next order is 0.1 to 0.5 % of the step; float32 rounds by some 1e-6 of the value
            assert wrong[name] - right[name] == pytest.approx(shift, rel=0.02, abs=1e-5 * right[name]), name
    assert wrong["w"] / right["w"] - 1 == pytest.approx(STEP, rel=0.01)
    assert wrong["d1"] / right["d1"] - 1 == pytest.approx(-STEP, rel=0.01)
    assert wrong["d2"] / right["d2"] - 1 == pytest.approx(-2 * STEP, rel=0.01)


def test_too_long_l1_moves_the_estimate_as_predicted(run: Run) -> None:
    rig = RIG
    rig = replace(rig, identifier=replace(rig.identifier, core="f64"))
    _, told = scale_errors(P, 0.0, STEP)
    right = exact(identify_by_engine(run, rig))
    wrong = exact(identify_by_engine(run, replace(rig, l1=(1 + STEP) * L1)))
    for names, shifts in ((LINEAR, told.p), (PHYSICAL, told.physical)):
        for name, shift in zip(names, shifts, strict=True):
            assert wrong[name] - right[name] == pytest.approx(shift, rel=0.02, abs=1e-7 * right[name]), name
    assert told.physical[0] == pytest.approx(0.0, abs=1e-12)  # g* = w l1 does not depend on l1


def test_the_covariance_of_both_scales_is_their_products() -> None:
    gain, rod = (one.p for one in scale_errors(P, 0.003, 0.001))
    expected = np.outer(gain, gain) + np.outer(rod, rod)
    np.testing.assert_allclose(added_covariance(P, 0.003, 0.001), expected, rtol=1e-12)
    np.testing.assert_allclose(added_covariance(np.stack([P, 2 * P]), 0.003, 0.001)[0], expected, rtol=1e-12)


def test_physical_errors_of_the_gain_are_those_of_its_covariance() -> None:
    through = MECHANISM.physical_errors(P, added_covariance(P, 0.003, 0.0))
    np.testing.assert_allclose(np.abs(scale_errors(P, 0.003, 0.0)[0].physical), through, rtol=1e-9)


def test_outside_the_physical_region_there_are_no_physical_errors() -> None:
    for told in scale_errors(np.array([11.56, 0.25, 0.2]), 0.003, 0.001):
        assert np.isnan(told.physical).all()
        assert np.isfinite(told.p).all()


@pytest.mark.parametrize("core", ["f32", "q31", "f64"])
def test_standard_errors_contain_the_scales_and_keep_the_cores_own(core: str) -> None:
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=15.0, seed=2).run
    exactly = RIG
    exactly = replace(exactly, identifier=replace(exactly.identifier, core=core))  # type: ignore[arg-type]
    roughly = replace(exactly, l1_sd=0.001, sensor=replace(exactly.sensor, y_gain_sd=0.003))
    alone, wide = identify_by_engine(run, exactly), identify_by_engine(run, roughly)
    assert alone.value == wide.value and alone.hash == wide.hash
    assert wide.se["c"] == alone.se["c"]
    assert wide.se["w"] == pytest.approx(np.hypot(alone.se["w"], 0.00316 * wide.value["w"]), rel=1e-3)
    for name in (*LINEAR, *PHYSICAL):
        assert alone.se[name] == alone.parts[name].noise == pytest.approx(wide.parts[name].noise, rel=1e-12)
        assert not any(alone.parts[name].scales.values())
    assert wide.parts["g"].scales["l1"] < 1e-9 < wide.parts["l2"].scales["l1"]
    assert wide.trajectory.se[-1, 0] > alone.trajectory.se[-1, 0]


def test_a_start_has_no_errors_of_scales() -> None:
    run = simulate(drive=(), sensors=standard_sensors(14), duration=8.0).run
    rig = RigFile.parse("l1 = 0.3")
    held = identify_by_engine(run, rig)
    assert not held.identified and held.parts == {}


def test_identify_lists_the_parts_of_the_standard_errors(tmp_path: Path) -> None:
    made = simulate(sensors=standard_sensors(14), release=(0.02, 0.05), truth="full", duration=15.0)
    write_run(tmp_path / "run.csv", made.run)
    (tmp_path / "run.toml").write_text("l1 = 0.3\nl1_sd = 0.002\n[sensor]\ny_gain_sd = 0.01\n", encoding="utf-8")
    arguments = ["identify", str(tmp_path / "run.csv"), "--rig", str(tmp_path / "run.toml")]
    told = CliRunner().invoke(commands, arguments, standalone_mode=False)
    assert told.return_value == 0, told.output
    assert "from the gain of y, known to 1 % (y_gain_sd), g 1 %, l2 3.1 %" in told.output
    assert "from l1, known to 0.2 % (l1_sd), l2 0.41 %" in told.output
    answer = json.loads(CliRunner().invoke(commands, [*arguments, "--json"], standalone_mode=False).stdout)
    g = answer["parameters"]["g"]
    assert g["se_y_gain"] == pytest.approx(0.01 * g["value"], rel=1e-6)
    assert g["se"] == pytest.approx(np.sqrt(g["se_noise"] ** 2 + g["se_y_gain"] ** 2 + g["se_l1"] ** 2), rel=1e-9)
    (tmp_path / "run.toml").unlink()
    RigFile.standard().write(tmp_path / "run.toml")
    told = CliRunner().invoke(commands, arguments, standalone_mode=False)
    assert "the gain of y and l1 count as exact" in told.output
