"""`design --on BOARD`: what a design costs on an emulated board, before one is flashed."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from in_process import pvid

from pvid.base.console import DIFFERENT, DONE
from pvid.base.errors import PvidError
from pvid.board import design_cost, sizes
from pvid.board.boards import BOARDS, Board
from pvid.board.replay_image import ReplayReport
from pvid.configuration import refine as refine_design
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.refine import RefineConfig

BOARD = "mps2-an386"


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with its rig file beside it."""
    run = tmp_path_factory.mktemp("pendulum") / "run.csv"
    assert pvid("simulate", run, "--duration", "8", "--seed", "1").return_value == DONE
    return run


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    MechanismRig("kapitza", 1000.0, known={"l1": 0.3}).write(path)
    return path


def test_the_cost_of_both_stages_is_measured_for_a_recording(tmp_path: Path) -> None:
    run = tmp_path / "run.csv"  # long enough for a second stage with few ticks of its own
    assert pvid("simulate", run, "--duration", "12", "--seed", "1").return_value == DONE
    done = pvid("design", "--run", run, "--on", BOARD, "--refine", "--clock", "168", "--json")
    weak, printed, light = json.loads(done.stdout)["cost"]
    assert [one["form"] for one in (weak, printed, light)] == ["weak", "refined", "refined"]
    assert (printed["jobs"], printed["rests"], light["jobs"], light["rests"]) == (3, 1, 3, 255)
    for one in (weak, printed, light):
        assert one["target"] == BOARD and one["core"] == "f32" and one["model"] == "kapitza"
        assert 0 < one["mean"] < one["longest"]
        assert one["longest_share"] == pytest.approx(one["longest"] / 168_000)  # cycles between samples at 1 kHz
        assert one["mean_share"] == pytest.approx(one["mean"] / 168_000)
    assert all(weak[key] < printed[key] for key in ("mean", "longest", "state", "text", "tables", "stack_bound"))
    assert light["longest"] < printed["longest"] and light["state"] == printed["state"]
    assert 0 < weak["first_s"] < printed["first_s"] < printed["ticks"] / 1000
    assert printed["first_s"] <= light["first_s"] < printed["ticks"] / 1000  # the weak form leaves it fewer ticks


@pytest.mark.night
def test_the_cost_of_a_shipped_rig_is_that_of_sizes() -> None:
    (found,) = json.loads(pvid("design", "--model", "rigid_body", "--on", BOARD, "--json").stdout)["cost"]
    footprint, _ = sizes.measure(sizes.Configuration(BOARDS[BOARD], sizes.WEAK, "f32", "rigid_body"))
    expected = sizes.figures_of(footprint)
    shared = 4 * 6 * 7 // 2  # the triangle of 6 parameters' errors that all windows share, which `sizes` is without
    assert found["state"] == expected["state"] and found["tables"] == expected["tables"] + shared
    assert found["mean"] == pytest.approx(expected["mean"], rel=0.02)  # of other windows
    assert found["longest"] == pytest.approx(expected["longest"], rel=0.02)


def test_the_table_shows_fixed_point_and_warns_of_a_tick_that_is_too_long(pendulum: Path) -> None:
    done = pvid("design", "--run", pendulum, "--on", BOARD, "--core", "q31", "--clock", "1")
    assert done.return_value == DONE and "mps2-an386 (Cortex-M4F), fixed point: instructions of a tick" in done.stdout
    (row,) = [line for line in done.stdout.splitlines() if "weak form" in line]
    mean, mean_share, longest, longest_share = (float(cell) for cell in row.split("│")[2:6])
    assert (mean_share, longest_share) == pytest.approx((mean / 10, longest / 10), rel=0.01)  # % of 1000 cycles
    assert "%: of the 1 ms between samples at 1 MHz" in done.stdout
    (block,) = re.findall(r"in blocks of 24 samples: (\d+) instructions a sample", done.stdout)
    assert 0.9 * mean < float(block) < 1.01 * mean
    assert "weak form: the longest tick takes longer than from sample to sample" in done.stderr


def test_a_simulation_of_the_guess_is_replayed_in_the_core_that_is_asked_for(rig: Path) -> None:
    """Without a recording."""
    given = ("design", "--rig", rig, "--duration", "10", "--on", BOARD, "--json")
    (found,) = json.loads(pvid(*given, "--core", "q31").stdout)["cost"]
    assert found["core"] == "q31" and 0 < found["mean"] < found["longest"] and 0 < found["ticks"] <= 10_000
    block = found["block"]
    assert block["samples"] == 24 and block["mean"] < 1.01 * found["mean"] and found["longest"] < block["longest"]


@pytest.mark.night
def test_the_reason_why_there_is_no_second_stage_is_that_of_model_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any) -> RefineConfig:
        raise PvidError("rigid_body has no steps for it")

    monkeypatch.setattr(design_cost, "refine_for_simulated_rig", refused)
    monkeypatch.setattr(refine_design, "refine_for_simulated_rig", refused)
    done = pvid("design", "--model", "rigid_body", "--on", BOARD, "--refine", "--json")
    assert [one["form"] for one in json.loads(done.stdout)["cost"]] == ["weak"]
    (sentence,) = [line for line in done.stderr.splitlines() if "no refinement" in line]
    assert "rigid_body has no steps for it" in sentence
    assert sentence in pvid("model", "build", "rigid_body", "-o", tmp_path).stderr.splitlines()


def test_a_stage_that_does_not_fit_is_named_and_the_other_is_measured(
    pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(board: Board, _: Any) -> None:
        raise PvidError(f"{board.name}: the image does not fit: RAM lacks 204 bytes")

    monkeypatch.setattr(design_cost, "build_refined_image", full)
    done = pvid("design", "--run", pendulum, "--on", BOARD, "--refine", "--json")
    assert done.return_value == DONE and [one["form"] for one in json.loads(done.stdout)["cost"]] == ["weak"]
    assert "both, jobs 3, rests 1: mps2-an386: the image does not fit: RAM lacks 204 bytes" in done.stderr


def test_no_cost_is_printed_where_the_board_computes_other_bits(
    pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = sizes.measured

    def other(board: Board, built: sizes.BuiltImage) -> tuple[sizes.Footprint, ReplayReport]:
        footprint, report = measured(board, built)
        return footprint, replace(report, hash=report.hash ^ 1)

    monkeypatch.setattr(design_cost, "measured", other)
    done = pvid("design", "--run", pendulum, "--on", BOARD)
    assert done.return_value == DIFFERENT and "mean" not in done.stdout
    assert "mps2-an386: its hashes are not those of this computer" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--on", "/dev/ttyACM0"), "/dev/ttyACM0 is no emulated board: the cost is measured on microbit, "),
        (("--on", "stream-host"), "stream-host is no emulated board"),
        (("--refine",), "--core, --refine and --clock are for the cost on a board: --on BOARD"),
        (("--core", "f32"), "--core, --refine and --clock are for the cost on a board"),
        (("--clock", "16"), "--core, --refine and --clock are for the cost on a board"),
        (("--on", BOARD, "--refine", "--core", "q31"), "the second stage is in float32 alone"),
        (("--on", "atmega2560"), "atmega2560: float32 has no bits of the twin on an AVR"),
    ],
)
def test_what_cannot_be_measured_is_refused(arguments: tuple[str, ...], sentence: str, rig: Path) -> None:
    with pytest.raises(PvidError, match=sentence):
        pvid("design", "--rig", rig, *arguments)


@pytest.mark.parametrize(
    ("mechanism", "what"),
    [
        pytest.param("kapitza", "stack exceeds", marks=pytest.mark.night),  # no guard below: the emulator stops it
        pytest.param("battery_2rc", "stack exceeds", marks=pytest.mark.long),  # and this one computes other bits
        ("furuta", "variables exceed"),
    ],
)
def test_an_image_that_does_not_fit_an_avr_is_refused_in_words(mechanism: str, what: str, pendulum: Path) -> None:
    given = ("--run", pendulum) if mechanism == "kapitza" else ("--model", mechanism)
    with pytest.raises(PvidError, match=f"atmega2560: the image does not fit: its {what} the RAM"):
        pvid("design", *given, "--on", "atmega2560", "--core", "q31")
