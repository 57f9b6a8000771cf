"""A figure of a described mechanism shows the answer that is printed, for every shipped mechanism."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import pvid
from bench.kinds import KINDS
from pvid.cli.main import commands
from pvid.models.mechanisms import path_of
from pvid.show.axis_limits import plain_ticks

MOTOR = "dc_motor"
SECONDS = {"kapitza": "20", "battery_2rc": "7200", "rigid_body": "10"}  # the others: 8
BY_DAY = ("kapitza", "battery_2rc", "rigid_body")  # and the motor, in the other tests


def run_pvid(*words: str | Path) -> Result:
    return CliRunner().invoke(commands, [str(one) for one in words], standalone_mode=False, catch_exceptions=False)


def texts(svg: Path) -> str:
    """matplotlib draws texts as curves and keeps them in comments."""
    return "\n".join(re.findall(r"<!-- (.*?) -->", svg.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def motor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("figure") / "motor.csv"
    run_pvid("model", "simulate", MOTOR, path, "--duration", "8")
    return path


def shown_in(drawn: str, result: pvid.Result, parameters: Sequence[str]) -> None:
    for name in parameters:
        told = result[name].shown
        assert told is not None
        assert re.search(rf"\b{name} +{' +'.join(map(re.escape, told.texts))}", drawn), name


@pytest.mark.parametrize("core", [None, "f32"])
def test_result_plot_draws_the_numbers_of_the_result(motor: Path, core: str | None, tmp_path: Path) -> None:
    result = pvid.identify(motor, core=core)  # type: ignore[arg-type]
    drawn = texts(result.plot(tmp_path / "a.svg"))
    for words in ("95 % interval", "measured", "predicted", "phi [rad]", "L [mH]", "time of the recording [s]"):
        assert words in drawn, words
    assert ("in C, as it runs" in drawn) == (core is not None)


def test_plot_takes_a_model_file_and_the_refinement(motor: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    own.write_text(path_of(MOTOR)[1].read_text(encoding="utf-8"), encoding="utf-8")
    run = tmp_path / "recorded.csv"
    run.write_bytes(motor.read_bytes())
    done = run_pvid("plot", run, "--model", own, "--refine", "-o", tmp_path / "a.svg")
    assert done.return_value == 0 and done.output.endswith("a.svg\n")
    drawn = texts(tmp_path / "a.svg")
    assert "recorded.csv: " in drawn and "predicted" in drawn
    shown_in(drawn, pvid.identify(run, model=own, refine=True), ["R", "L", "k", "J", "b", "Tc", "i0"])


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in BY_DAY else pytest.mark.night) for name in KINDS]
)
def test_plot_draws_every_shipped_mechanism(name: str, tmp_path: Path) -> None:
    """The rig file beside the run names the mechanism; no option is needed."""
    run = tmp_path / "run.csv"
    run_pvid("model", "simulate", name, run, "--duration", SECONDS.get(name, "8"))
    assert run_pvid("plot", run, "-o", tmp_path / "a.svg").return_value == 0
    drawn = texts(tmp_path / "a.svg")
    assert "run.csv: " in drawn and ": good. The values can be used." in drawn and "95 % interval" in drawn


def test_plot_of_a_run_with_a_gap_simulates_its_longest_segment(motor: Path, tmp_path: Path) -> None:
    header, *rows = motor.read_text(encoding="utf-8").splitlines()
    gap = [*rows[:3000], *rows[3100:]]
    (tmp_path / "run.csv").write_text("\n".join([header, *gap]) + "\n", encoding="utf-8")
    (tmp_path / "run.toml").write_bytes(motor.with_suffix(".toml").read_bytes())
    assert run_pvid("plot", tmp_path / "run.csv", "-o", tmp_path / "a.svg").return_value == 0
    drawn = texts(tmp_path / "a.svg")
    assert ": good. The values" in drawn and "predicted" in drawn


def test_numbers_at_an_axis_are_whole_and_apart() -> None:
    from matplotlib.figure import Figure

    axis = Figure().add_subplot()
    axis.set_ylim(1.19999, 1.20001)
    plain_ticks(axis)
    labels = [axis.yaxis.get_major_formatter()(value, 0) for value in (1.199995, 1.2, 1.200005)]
    assert len(set(labels)) == 3 and float(labels[0]) == pytest.approx(1.199995, abs=1e-9)
    axis.set_ylim(-20_000, 20_000)
    assert axis.yaxis.get_major_formatter()(-20_000.0, 0) == "-20000"
