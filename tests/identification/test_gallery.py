"""The mechanisms that no heavy test takes: recognised by their columns, and identified by the core from their rigs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from program import pvid

from bench.kinds import KINDS
from pvid.identification.survey import proposals, surveyed
from pvid.identification.validation import Motion
from pvid.identification.wild_samples import without_wild_samples
from pvid.models.mechanisms import compiled_of, names
from pvid.models.registry import most_specific
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.run import Recording
from pvid.sim.simulated_run import RigSimulation, simulation_of

SHORT = {"ball_on_beam": 10.0, "mecanum": 10.0, "pmsm": 0.5, "thrust_stand": 5.0}  # [s], of long runs
ROWS = 1500  # of a file that is only looked at
SURE = 5.0  # standard errors: the rigs have 77 parameters, and the core averages the sign of a friction


@pytest.mark.parametrize("name", [name for name in names() if name not in KINDS])
def test_the_core_identifies_its_rig_and_its_columns_name_it(name: str, tmp_path: Path) -> None:
    run, rig = tmp_path / "run.csv", simulated_rig(name)
    length = ("--duration", str(SHORT.get(name, rig.duration)))
    assert pvid(tmp_path, "simulate", run, "--model", name, *length).returncode == 0
    answer = json.loads(pvid(tmp_path, "identify", run, "--core", "f32", "--json").stdout)
    assert answer["identified"] and answer["status"] in ("good", "usable", "warning")
    for parameter, truth in rig.truth.items():
        one = answer["parameters"][parameter]
        assert one["se"] is not None and abs(one["value"] - truth) < SURE * one["se"], parameter
    bare = tmp_path / "bare.csv"
    bare.write_text("\n".join(run.read_text(encoding="utf-8").splitlines()[: ROWS + 1]) + "\n", encoding="utf-8")
    found = proposals(surveyed(bare))
    assert found[0].mechanism == name and not found[0].columns


def test_blocks_of_an_unstable_plant_are_shorter_than_an_error_of_the_start_grows_beyond_the_motion() -> None:
    """The ball leaves the beam by exp(4.4 t): blocks of 4 s could not be simulated, and a right answer was doubted."""
    blocks = {}
    for name in ("ball_on_beam", "mass_on_spring"):
        simulation = simulation_of(name)
        run, rate = simulation.run(0), simulation.rig.sample_rate
        signals = {one.name: run[one.name] for one in simulation.model.signals}
        blocks[name] = Motion.near(simulation.model, signals, rate, simulation.truth).block(1.0, 3) / rate
    assert 0.3 < blocks["ball_on_beam"] < 1.5 and blocks["mass_on_spring"] == 4.0


def test_peaks_of_a_fast_oscillation_are_no_error_codes() -> None:
    """A converter's current that rings at a twentieth of the sample rate has one value at many of its peaks."""
    rig = replace(simulated_rig("buck_converter"), sample_rate=50e3, duration=0.4)
    model = compiled_of("buck_converter")
    run = RigSimulation.of(model, rig).run(0)
    recording = Recording(run.pop("t"), run, rig.sample_rate)
    assert without_wild_samples(recording, model).notes == ()


def test_a_file_of_a_driven_motor_is_not_of_one_that_runs_out(tmp_path: Path) -> None:
    t = np.arange(400) / 1000
    columns = [t, np.sign(np.sin(40 * t)), np.sin(50 * t), np.sin(9 * t)]
    np.savetxt(tmp_path / "run.csv", np.column_stack(columns), "%.9g", ",", header="t,V,i,phi", comments="")
    assert [one.mechanism for one in proposals(surveyed(tmp_path / "run.csv"))] == ["dc_motor"]


def test_mechanisms_that_use_the_same_columns_are_all_named() -> None:
    columns = {"coasting": {"phi"}, "motor": {"V", "i", "phi"}, "winding": {"V", "i"}, "other": {"phi", "y"}}
    assert most_specific(columns) == ("motor", "other")
    assert most_specific({"one": {"x"}, "two": {"x"}}) == ("one", "two")
