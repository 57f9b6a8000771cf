"""End to end through the command line: what a user types, what comes back, and the exit code."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from conftest import ROOT
from pendulum_plant import STANDARD_PENDULUM, simulate, standard_sensors
from pendulum_run import write_run
from program import pvid

from pvid.cli.demo import target


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a good run (run.csv, 20 bits, 12 s) and its rig file (run.toml)."""
    folder = tmp_path_factory.mktemp("cli")
    done = pvid(folder, "simulate", "run.csv", "--duration", "12", "--set", "sensor.phi.resolution=6e-6", "--rows")
    assert done.returncode == 0, done.stderr
    return folder


def strong(*arguments: str) -> tuple[str, ...]:
    return (*arguments, "--rig", "run.toml", "--form", "strong")


def test_simulate_writes_a_run_and_its_rig_file(place: Path) -> None:
    assert (place / "run.csv").read_text(encoding="utf-8").splitlines()[0].startswith("t,y,phi")
    assert (place / "run.toml").is_file()


DOCUMENTED = {
    *("identified", "verdict", "status", "warning", "advice", "reasons", "parameters", "missing", "chi2", "r2"),
    *("prediction", "window_s", "windows", "weights", "input", "samples", "model", "core", "form"),
}


def test_identify_json_has_all_documented_keys(place: Path) -> None:
    done = pvid(place, "identify", "run.csv", "--rig", "run.toml", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert {*DOCUMENTED, "refinement"} == set(answer)
    assert answer["samples"] == 12_000 and answer["model"] == "kapitza" and answer["verdict"] == "good"
    assert list(answer["parameters"]) == ["g", "l2", "rho2", "w", "d1", "d2", "c"]
    g = answer["parameters"]["g"]
    assert abs(g["value"] - STANDARD_PENDULUM.g) < 4 * g["se"]
    assert {"adopted", "text", "chi2", "slow_chi2", "blocks", "parameters"} == set(answer["refinement"])


def test_the_weak_form_refuses_the_other_law(place: Path) -> None:
    done = pvid(place, "identify", "run.csv", "--rig", "run.toml", "--core", "f64", "--law", "pseudovelocity")
    assert done.returncode == 2
    assert "omit --law" in done.stderr


def test_the_paper_s_law_can_be_chosen(place: Path) -> None:
    usual, other = (
        json.loads(pvid(place, *strong("identify", "run.csv", "--json", *law)).stdout)
        for law in ((), ("--law", "pseudovelocity"))
    )
    assert (other["form"], other["identified"]) == ("strong", True) and other["hash"] != usual["hash"]


@pytest.mark.night  # by day: its answers and hashes, test_demo_run.py
def test_demo_prints_its_lines_and_draws_the_picture_of_the_readme(tmp_path: Path) -> None:
    done = pvid(tmp_path, "demo", PVID_CALLED="./tools/pvid")
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [line.rstrip() for line in done.stdout.rstrip().splitlines()]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = readme.split("<!-- demo -->")[1].split("<!-- /demo -->")[0].strip().strip("`").strip("\n")
    assert shown == "\n".join(lines), "./tools/pvid bench demo --update README.md"
    picture = next(place for place, line in enumerate(lines) if line.startswith("Picture:"))
    assert picture < 10 and "Cortex-M4F" in lines[0] and all("✓" in line for line in lines[1:4])
    assert done.stdout.count("in every bit (hash ") == 2 and "DIFFERS" not in done.stdout
    drawn, kept = (plt.imread(one) for one in (tmp_path / "pvid-demo.png", ROOT / "host/docs/images/demo.png"))
    np.testing.assert_array_equal(drawn, kept, "./tools/pvid demo --figure host/docs/images/demo.png")


def test_without_an_emulator_the_demo_says_where_it_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert target().where == "mps2-an386, Cortex-M4F in QEMU"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert target().where == "this machine, over a pseudo-terminal"
    assert target().lacking == "mps2-an386 needs arm-none-eabi-gcc and qemu-system-arm"


def test_a_run_without_motion_is_not_identified(tmp_path: Path) -> None:
    run = simulate(sensors=standard_sensors(20), truth="linear", duration=3.0, release=(0.0, 0.0)).run
    run.phi[:] = 0.0
    write_run(tmp_path / "still.csv", run)
    (tmp_path / "still.toml").write_text("[known]\nl1 = 0.3\n[model]\nname = 'kapitza'\n", encoding="utf-8")
    for form in ("weak", "strong"):
        done = pvid(tmp_path, "identify", "still.csv", "--form", form)
        assert done.returncode == 2
        assert "phi has the same value in all 3000 samples: is the sensor connected?" in done.stderr


BAD_RUNS = {
    "empty": "",
    "header only": "t,phi,y\n",
    "wrong columns": "time,angle,pivot\n0,0,0\n0.001,0,0\n",
    "text in numbers": "t,phi,y\n"
    + "".join(f"{k / 1000},0.1,0\n" for k in range(400))
    + "0.4,fast,0\n" * 40
    + "0.44,0,0",
    "too short": "t,phi,y\n0,0.1,0\n0.001,0.1,0\n0.002,0.1,0\n",
}


@pytest.mark.parametrize("case", BAD_RUNS)
def test_a_bad_run_is_one_sentence_and_exit_code_2(case: str, place: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text(BAD_RUNS[case], encoding="utf-8")
    done = pvid(tmp_path, "identify", bad, "--rig", place / "run.toml", "--form", "strong")
    assert done.returncode == 2, done.stdout
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "bad.csv" in done.stderr or case == "too short"
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("break_", [lambda k: k + (k > 200) * 500, lambda k: k % 200], ids=["gap", "clock runs back"])
def test_a_run_of_two_segments_is_read_and_its_fault_is_named(
    break_: Callable[[int], int], place: Path, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("t,phi,y\n" + "".join(f"{break_(k) / 1000},0.1,0\n" for k in range(400)), encoding="utf-8")
    done = pvid(tmp_path, "identify", bad, "--rig", place / "run.toml", "--form", "strong")
    assert done.returncode == 2 and "has the same value" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("identify", "absent.csv", "--rig", "run.toml"), "absent.csv"),
        (("identify", "run.csv", "--rig", "absent.toml"), "absent.toml"),
        (("identify", "lone.csv"), "lone.csv does not exist"),
        (("identify", "run.csv", "--set", "l3=1"), "'l3' is not a key of the rig file"),
        (("identify", "run.csv", "--columns", "phi=angle:grad"), "'grad' is no unit of phi"),
        (("identify", "run.csv", "--rig", "run.toml", "--core", "f16"), "f16"),
        (("simulate", "out.csv", "--truth", "l3=1"), "the model has no such unknown"),
        (("simulate", "out.csv", "--duration", "-1"), "-1.0 is not in the range"),
        (("nonsense",), "nonsense"),
        (("identify", "run.csv", "--l1", "0.25"), "l1 is a key of the rig file: use --set known.l1=VALUE"),
        (("plot", "run.csv", "--clock-sd", "0.001"), "use --set clock_sd=VALUE"),
        (("demo", "--l1", "0.25"), "No such option '--l1'"),
    ],
)
def test_bad_usage_is_one_sentence_that_names_it(arguments: tuple[str, ...], named: str, place: Path) -> None:
    done = pvid(place, *arguments)
    assert done.returncode == 2, done.stdout
    assert named in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr


def test_without_a_command_the_help_is_printed_as_text(tmp_path: Path) -> None:
    done = pvid(tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    assert "\nIdentify:\n" in done.stdout and "identify RUN.csv --model MODEL --set l1=0.25" in done.stdout


def test_an_unknown_zero_of_the_encoder_is_found(tmp_path: Path) -> None:
    lsb = 2 * math.pi / 2**14
    pvid(tmp_path, "simulate", "run.csv", "--truth", "c=0.02", "--duration", "20")
    answer = json.loads(pvid(tmp_path, "identify", "run.csv", "--rig", "run.toml", "--json").stdout)
    assert answer["form"] == "weak"
    zero = answer["parameters"]["c"]
    assert zero["value"] == pytest.approx(0.02, abs=lsb)
    assert 0 < zero["se"] < lsb
