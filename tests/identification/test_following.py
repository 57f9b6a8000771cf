"""Both cores of the weak identifier, and the refinement, have the forgetting and the gate of the rig file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from own_mechanisms import OWN

from pvid.cli.main import commands
from pvid.codegen.refine import refine_functions
from pvid.configuration.refine import refine_settings
from pvid.configuration.weak import config_for_simulated_rig, simulated_run_of
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.model.compiled import Following
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.mechanism_file import MechanismRig

GIVEN = {"forgetting_s": 20.0, "outlier_gate": 5.0, "outlier_patience_s": 8.0, "dead_zone": 0.5}


def settings_of(following: Following) -> tuple[dict[str, float], dict[str, float]]:
    """Of the identifier for the motor in float32, and in fixed point in the same units."""
    compiled = replace(compiled_of("dc_motor"), following=following)
    config, fixed = config_for_simulated_rig(compiled), weak_q31_for_simulated_rig(compiled)
    estimator, whole = config.estimator, fixed.config.estimator
    in_float: dict[str, Any] = {
        "forgetting_s": estimator.forgetting_s,
        "outlier_gate": config.gate.sigmas,
        "outlier_patience_s": config.gate.patience_s,
        "dead_zone": estimator.dead_zone,
    }
    in_fixed = {
        "forgetting_s": whole.forgetting_groups * fixed.hop_s,
        "outlier_gate": fixed.config.gate.sigmas / 2**16,
        "outlier_patience_s": fixed.config.gate.patience_groups * fixed.hop_s,
        "dead_zone": whole.dead_zone / 2**16,
    }
    return in_float, in_fixed


def test_both_cores_have_the_settings_of_the_rig() -> None:
    rig = MechanismRig.of_document({"model": {"name": "dc_motor"}, "identifier": GIVEN})
    following = rig.applied(compiled_of("dc_motor")).following
    for found in settings_of(following):
        assert found == pytest.approx(GIVEN, rel=0.02)  # fixed point counts windows


def test_what_a_rig_file_does_not_say_has_its_default() -> None:
    for found in settings_of(Following()):
        patience = found.pop("outlier_patience_s")
        assert found == {"forgetting_s": 0.0, "outlier_gate": 4.0, "dead_zone": 0.0}
        assert 10.0 < patience < 40.0  # 100 windows
    for found in settings_of(Following(forgetting_s=12.0)):
        assert found["outlier_patience_s"] == pytest.approx(6.0, rel=0.05)  # half of it; fixed point counts windows


def test_the_refinement_forgets_alike() -> None:
    compiled = replace(compiled_of("kapitza"), following=Following(forgetting_s=15.0))
    run, rate = simulated_run_of(compiled)[0], simulated_rig("kapitza").sample_rate
    p = np.array([one.guess for one in compiled.unknowns])
    assert refine_settings(refine_functions(compiled), run, rate, p, 1.0).forgetting_s == 15.0


@pytest.mark.parametrize(("model", "run_of"), [("dc_motor", "12"), (str(OWN["free_pendulum"].path), "7")])
def test_identify_notes_that_the_float64_analysis_does_not_forget(tmp_path: Path, model: str, run_of: str) -> None:
    run, rig = tmp_path / "run.csv", tmp_path / "run.toml"
    release = ["--start", "q=2.5", "--rate", "500"] if model != "dc_motor" else []
    made = CliRunner().invoke(commands, ["model", "simulate", model, str(run), "--duration", run_of, *release])
    assert made.exit_code == 0, made.output
    rig.write_text(rig.read_text(encoding="utf-8") + "\n[identifier]\nforgetting_s = 20.0\n", encoding="utf-8")
    for core in ("f64", "f32"):
        told = CliRunner().invoke(commands, ["identify", str(run), "--model", model, "--core", core, "--no-refine"])
        assert told.exit_code == 0, told.output
        assert ("[identifier] has no effect" in told.stderr) == (core == "f64")
