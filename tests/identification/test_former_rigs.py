"""Rigs that failed once, of the random ones of tests/data/rigs: each is identified now, whatever was wrong with it."""

import json
import subprocess
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest
from conftest import ROOT

from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.cli.identify_run import recording_of
from pvid.compare.weak import compare_recording
from pvid.configuration.weak import config_for_recording
from pvid.configuration.weak_q31 import weak_q31_for_recording
from pvid.core.host_compiler import compiled_once
from pvid.deploy.example import expected
from pvid.deploy.of_rig import deployment_f32, deployment_q31
from pvid.deploy.targets import write_package
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis, Value
from pvid.identification.core import identify_in_c
from pvid.identification.refinement.adoption import refined_answer
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.cores import CORES
from pvid.settings.enums import Core

RIGS = ROOT / "tests" / "data" / "rigs"
TRUTH = toml_document((RIGS / "truth.toml").read_text(encoding="utf-8"))
MOST = 5.0  # standard errors that a good answer is off; the largest here is 2.2
CURED = {
    "ladder": "the current is sampled before the voltage jumps",
    "swing": "the rate in abs(v)*v is blurred by a short filter",
    "cart": "a homogeneous equation shrinks to nothing",
    "pendulum": "a friction that may be 0 is found by the refinement",
    "cell": "the voltage is sampled before the current jumps",
    "coasting": "a drag that ran down to 0 starts the core within float32",
    "press": "a force cell, no mass",
    "braked": "no input, friction of the measured speed",
}


@cache
def answer(name: str) -> Analysis:
    """In float64."""
    return analysed(*recording_of(RIGS / f"{name}.csv.gz", MechanismRig(RIGS / f"{name}.py"), None))


def off(name: str, values: Mapping[str, Value]) -> list[str]:
    """Parameters that are wrong; all are identified."""
    found = {p: (values[p].value, values[p].se) for p in TRUTH[name]}
    return [p for p, (value, se) in found.items() if value is None or abs(value - TRUTH[name][p]) > MOST * (se or 0.0)]


@pytest.mark.parametrize("name", CURED)
def test_a_rig_that_failed_once_is_identified_and_refined(name: str) -> None:
    assert answer(name).found.verdict.status == "good"
    refined, _, _ = refined_answer(answer(name))
    assert (off(name, answer(name).values), off(name, refined.values)) == ([], [])
    json.dumps(refined.as_json(), allow_nan=False)


@pytest.mark.by_day(2)
@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("name", CURED)
def test_and_by_the_cores_with_the_bits_of_their_twins(name: str, core: Core) -> None:
    found = identify_in_c(answer(name), core)
    assert found.identified and off(name, found.values) == []
    of = answer(name)
    assert compare_recording(of.model, of.recording, core, ranking=of.ranking).equal


@pytest.mark.by_day(2)
@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("name", ["press", "coasting"])
def test_and_its_package_prints_what_its_readme_shows(name: str, core: Core, tmp_path: Path) -> None:
    of = answer(name)
    if core == "f32":
        design = config_for_recording(of.model, of.recording, ranking=of.ranking)
        made = deployment_f32(of.model, design, of.recording.signals, "a test")
    else:
        weak = weak_q31_for_recording(of.model, of.recording, ranking=of.ranking)
        made = deployment_q31(weak, of.recording.signals, "a test")
    write_package(made, "amalgamation", tmp_path)
    sources = [str(one) for one in sorted(tmp_path.rglob("*.c"))]
    options = ["-std=c99", "-O0", "-Werror", "-Wall", "-Wextra", f"-I{tmp_path}", f"-I{tmp_path / 'example'}"]
    run(["gcc", *options, *sources, "-o", str(tmp_path / "it"), "-lm"])
    assert run([str(tmp_path / "it")]).splitlines() == expected(made)


def run(command: list[str]) -> str:
    """Standard output."""
    return subprocess.run(command, capture_output=True, text=True, check=True, env=compiled_once()).stdout


@pytest.mark.parametrize("core", CORES)
def test_fewer_functions_than_unknowns_are_refused_by_the_cores_in_a_sentence(core: Core) -> None:
    with pytest.raises(PvidError, match="3 functions of its 4 unknowns"):
        identify_in_c(answer("stores"), core)
