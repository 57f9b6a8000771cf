"""The peers' bench in short, with what the product's environment has: recordings, tools, the table's sums."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench.case import chosen
from bench.peers import compare
from bench.peers.arm import JOINTS, standard_of, write_arm
from bench.peers.compare import HEADER, TOOLS, fitted, interpreter, report, row, statements, tool_of
from bench.peers.rigs import CLEAN, LACKING, OFF, RIGS
from pvid.base.errors import PvidError

OWN = [name for name in TOOLS if not tool_of(name).PACKAGE]


def test_every_tool_has_a_mechanism_and_every_mechanism_a_tool() -> None:
    named = {one for name in TOOLS for one in tool_of(name).RIGS}
    assert named == {*RIGS, "arm3"}
    assert OWN == ["pvid_itself", "pvid_refined", "scipy_simulation", "textbook"]


def test_none_that_are_named_are_all() -> None:
    assert chosen([], among=OWN) == chosen((), among=OWN) == tuple(OWN)
    assert chosen([], ["kapitza"]) == ("kapitza",)


@pytest.mark.parametrize("name", RIGS)
def test_a_recording_solves_the_equations_of_its_rig(name: str) -> None:
    """By Runge-Kutta at the samples, whose error is below the sensors' steps, from the truth and the start."""
    rig = RIGS[name]
    run = rig.recording(1, CLEAN)
    tool = tool_of("scipy_simulation")
    found = tool.simulated(rig, run, np.array([*rig.truth.values(), *rig.start])[:, np.newaxis])[:, 0]
    measured = np.stack([run[one] / step for one, step in rig.sensors.items() if one != rig.input], 1).ravel()
    assert np.std(found - measured) == pytest.approx(np.sqrt(1 / 4 + 1 / 12), rel=0.1)  # half a step, and rounding


@pytest.mark.parametrize("name", RIGS)
def test_starts_are_off_by_turns_and_possible(name: str) -> None:
    rig = RIGS[name]
    for seed in range(6):
        start = rig.guess(seed)
        off = {abs(start[k] - v) / rig.absolute.get(k, v) for k, v in rig.truth.items()}
        assert rig.possible(start) and np.allclose([*off], OFF[seed % 2])


@pytest.mark.parametrize("name", OWN)
def test_a_tool_finds_the_truth_as_modelled_and_not_with_the_effect(name: str, tmp_path: Path) -> None:
    rig = RIGS["free_pendulum"]
    found = {}
    for case in (CLEAN, LACKING):
        place = tmp_path / case
        place.mkdir()
        np.savez(place / "0.npz", **rig.recording(0, case))  # type: ignore[arg-type]
        cells = dict(zip(HEADER, row(rig, case, name, *fitted(name, rig.name, place, 60)), strict=True))
        assert cells["answered"] == "1 of 1" and int(cells["statements"]) > 5
        found[case] = float(cells["worst %"])
        if name.startswith("pvid"):
            assert (cells["warned"] == "1") == (case == LACKING) and cells["in 2 s.e. %"] == "100"
    assert found[CLEAN] < 1 and found[LACKING] > 50  # dry friction looks like viscous friction


def test_base_parameters_of_the_arm_are_those_of_its_file(tmp_path: Path) -> None:
    from pvid.models.mechanisms import compiled_of

    arm = write_arm(tmp_path)
    chain = compiled_of(tmp_path / "arm3.py").chain
    assert chain is not None
    of_file = {chain.name_of(one): chain.of_file(one) for one in chain.base}
    assert all(value is None or arm.truth[name] == pytest.approx(value, abs=1e-9) for name, value in of_file.items())
    assert arm.of(standard_of(), np.arange(2.0 * JOINTS))["Fc3"] == 5


def test_cells_of_a_row() -> None:
    rig = RIGS["free_pendulum"]
    answers = [
        {"seed": 0, "values": {"w2": 31.31, "k": 0.04}, "errors": {"w2": 0.1, "k": 1e-3}, "said": "", "s": 1.0},
        {"seed": 1, "values": {"w2": 31.0, "k": 0.06}, "errors": {"w2": 0.1, "k": 0.04}, "said": "late", "s": 3.0},
        {"seed": 2, "values": {}, "errors": {}, "said": "ValueError", "s": 2.0},
    ]
    cells = dict(zip(HEADER, row(rig, CLEAN, "textbook", answers, ""), strict=True))
    assert cells["answered"] == "2 of 3" and cells["warned"] == "2" and cells["CPU s a run"] == "2"
    assert cells["median %, start 50 % off"] == "25" and cells["worst %"] == "50"
    assert cells["worst s.e."] == "3.1" and cells["in 2 s.e. %"] == "75"
    assert row(rig, LACKING, "textbook", [], "no wheel")[:4] == (
        "free_pendulum", "dry friction", TOOLS["textbook"], "not available: no wheel",
    )  # fmt: skip


def test_a_tool_that_fails_is_a_row_with_the_reason(tmp_path: Path) -> None:
    np.savez(tmp_path / "0.npz", t=np.arange(3.0))
    (told,) = fitted("textbook", "free_pendulum", tmp_path, 60)[0]
    assert told["values"] == {} and told["said"].startswith("KeyError")
    assert fitted("textbook", "no_such", tmp_path, 60)[1] != ""


@pytest.mark.parametrize(
    ("tool", "mechanism", "sentence"),
    [
        (["pvid"], [], "no such tool: pvid; there are pvid_itself, pvid_refined, "),
        ([], ["arm3", "arm"], "no such mechanism: arm; there are dc_motor, .*, arm3$"),
    ],
)
def test_an_unknown_name_is_one_sentence(tool: list[str], mechanism: list[str], sentence: str) -> None:
    with pytest.raises(PvidError, match=sentence):
        report(1, 1, tool, mechanism, lambda: None)


def test_a_tool_without_an_answer_in_time_is_a_row_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compare, "_PATIENCE", 1)
    rig = RIGS["cart_pendulum"]
    np.savez(tmp_path / "0.npz", **rig.recording(0, LACKING))  # type: ignore[arg-type]
    found = fitted("scipy_simulation", rig.name, tmp_path, 0)  # takes 17 s
    assert row(rig, LACKING, "scipy_simulation", *found)[3] == "not available: no answer within 1 s of the processor"


def test_peers_do_not_need_the_product() -> None:
    """Their processes are of an environment without it."""
    text = "import sys; sys.modules['pvid'] = None; import importlib\n"
    peers = [name for name in TOOLS if name not in OWN]
    text += "".join(f"importlib.import_module('bench.peers.{name}')\n" for name in [*peers, "worker"])
    told = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    assert interpreter("") == (sys.executable, "")
    assert json.dumps(statements("pvid_itself", RIGS["cell"])) != "0"
