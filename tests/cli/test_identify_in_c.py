"""`identify --core f32|q31` and `compare` of described mechanisms, from the recording to the printed answer."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from pendulum_plant import STANDARD_PENDULUM, STANDARD_RELEASE, simulate
from pendulum_run import write_run

from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED
from pvid.base.errors import PvidError
from pvid.board.mechanism_board import MechanismBoard, board_of
from pvid.board.target import HOST_TARGET
from pvid.cli.identify_run import recording_of
from pvid.cli.main import commands
from pvid.configuration.refine import refine_design
from pvid.configuration.weak import config_to_identify
from pvid.identification.analysis import analysed
from pvid.identification.core import identify_in_c
from pvid.log.rig_choice import rig_of
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.enums import Reason
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import WeakConfig
from pvid.twin.printed import PrintedTwin


def pvid(*arguments: str | Path) -> Result:
    """A command in this process; a refusal raises."""
    return CliRunner().invoke(commands, [str(one) for one in arguments], catch_exceptions=False, standalone_mode=False)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Simulated runs by mechanism, each with its rig file beside it."""
    folder = tmp_path_factory.mktemp("recorded")
    paths = {}
    for name, duration in (("rigid_body", "8"), ("dc_motor", "6")):
        paths[name] = folder / f"{name}.csv"
        done = pvid("model", "simulate", name, paths[name], "--duration", duration, "--seed", "3")
        assert done.return_value == DONE
    return paths


@pytest.mark.parametrize(("name", "arithmetic"), [("rigid_body", "f32"), ("dc_motor", "f32"), ("dc_motor", "q31")])
def test_the_core_identifies_a_recording_as_the_oracle_does(
    name: str, arithmetic: str, recorded: dict[str, Path]
) -> None:
    core = json.loads(pvid("identify", recorded[name], "--core", arithmetic, "--json").stdout)
    oracle = json.loads(pvid("identify", recorded[name], "--json").stdout)
    assert set(oracle) < set(core)  # the same keys, and the core's own
    assert core["core"] == arithmetic and oracle["core"] == "f64"
    assert core["identified"] and core["reason"] == "updated" and 0.5 < core["chi2"] < 2
    assert oracle["reasons"].items() <= core["reasons"].items()
    truth = simulated_rig(name).truth
    assert list(core["parameters"]) == list(oracle["parameters"])
    for parameter, one in core["parameters"].items():
        exact = oracle["parameters"][parameter]
        assert one["unit"] == exact["unit"] and one["se"] >= one["se_noise"] > 0
        assert abs(one["value"] - truth[parameter]) < 5 * one["se"], parameter
        # The oracle locates each reversal of friction, and chooses its own window; the core takes the mean of signs.
        assert abs(one["value"] - exact["value"]) < 5 * max(one["se"], exact["se"]), parameter


def test_the_answer_is_a_table_with_the_reason_of_the_last_window(recorded: dict[str, Path]) -> None:
    answer = pvid("identify", recorded["rigid_body"], "--core", "f32")
    assert answer.return_value == DONE
    assert "weak form, C in float32" in answer.stdout and "Ixx [kg*m^2]" in answer.stdout
    assert "last window: updated; chi2 " in answer.stdout


def test_a_simulated_run_of_the_described_pendulum_is_identified_from_its_description(tmp_path: Path) -> None:
    """Its rig file names the mechanism that the core has a form of its own for."""
    run = tmp_path / "run.csv"
    assert pvid("model", "simulate", "kapitza", run, "--duration", "20").return_value == DONE
    answer = json.loads(pvid("identify", run, "--json").stdout)
    assert answer["identified"] and answer["core"] == "f64"
    truth = simulated_rig("kapitza").truth
    assert all(abs(answer["parameters"][name]["value"] / truth[name] - 1) < 0.01 for name in ("w", "d1", "d2"))


def test_an_answer_of_the_core_that_the_analysis_contradicts_has_a_warning(recorded: dict[str, Path]) -> None:
    rig = MechanismRig.of_document(tomllib.loads(recorded["rigid_body"].with_suffix(".toml").read_text()))
    core = identify_in_c(analysed(*recording_of(recorded["rigid_body"], rig, None)))
    assert core.verdict.status == "good"
    one = core.values["Iyz"]
    assert one.value is not None and one.se is not None
    far = replace(core, values={**core.values, "Iyz": replace(one, value=one.value + 10 * one.se)})
    assert far.verdict.status == "warning" and far.verdict.reasons[0].name == "core"
    assert "disagree on Iyz (Iyz: " in far.verdict.reasons[0].text
    loud = replace(core, reason=Reason.MISFIT, misfit=9.0)
    assert loud.verdict.status == "good" and loud.verdict.reasons[0].text.startswith(
        "The residuals in the C core are 9"
    )


def test_a_core_that_has_published_nothing_is_not_called_good(recorded: dict[str, Path]) -> None:
    rig = MechanismRig.of_document(tomllib.loads(recorded["rigid_body"].with_suffix(".toml").read_text()))
    core = identify_in_c(analysed(*recording_of(recorded["rigid_body"], rig, None)))
    silent = replace(core, published=False, reason=Reason.HELD_NOT_EXCITED)
    assert silent.verdict.status == "not_identified"
    assert silent.as_json()["status"] == "not_identified"
    assert silent.verdict.reasons[0].text == "The C core has published no estimate: held not excited."


def test_core_and_analysis_are_compared_by_their_noise(recorded: dict[str, Path]) -> None:
    """The errors of gains are the same in both: they hide no difference."""
    rig = MechanismRig.of_document(tomllib.loads(recorded["rigid_body"].with_suffix(".toml").read_text()))
    core = identify_in_c(analysed(*recording_of(recorded["rigid_body"], rig, None)))
    one = core.values["Iyz"]
    assert one.value is not None and one.se_noise is not None
    loud = replace(one, se=100 * one.se_noise)
    apart = replace(loud, value=one.value + 5 * one.se_noise)
    near = replace(loud, value=one.value + 2 * one.se_noise)
    assert replace(core, values={**core.values, "Iyz": apart}).verdict.status == "warning"
    assert replace(core, values={**core.values, "Iyz": near}).verdict.status == "good"


@pytest.mark.parametrize(("steps", "status"), [(2, "good"), (40, "warning")])
def test_values_that_float32_does_not_resolve_are_alike(recorded: dict[str, Path], steps: int, status: str) -> None:
    """Of sensors without noise the standard errors are far below the last bit of a float."""
    rig = MechanismRig.of_document(tomllib.loads(recorded["rigid_body"].with_suffix(".toml").read_text()))
    core = identify_in_c(analysed(*recording_of(recorded["rigid_body"], rig, None)))
    one = core.values["Iyz"]
    assert one.value is not None
    exact = replace(one, value=float(np.float32(one.value)), se_noise=1e-12 * abs(one.value))
    assert exact.value is not None
    apart = replace(exact, value=exact.value + steps * float(np.spacing(np.float32(abs(one.value)))))
    analysis = replace(core.analysis, values={**core.analysis.values, "Iyz": exact})
    assert replace(core, analysis=analysis, values={**core.values, "Iyz": apart}).verdict.status == status


def test_without_a_second_stage_the_answer_is_that_of_the_first(tmp_path: Path) -> None:
    """A motor without inductance, whose current is a reading that contains parameters of the motion."""
    model, run = tmp_path / "motor.py", tmp_path / "motor.csv"
    model.write_text(
        "from pvid.model import Model\n"
        "model = Model('motor without inductance')\n"
        "V = model.input('V', 'V', hold='zoh', reach=12)\n"
        "i, w = model.sensor('i', 'A', noise=5e-3), model.sensor('w', 'rad/s', noise=0.05, reach=300)\n"
        "R, k = model.unknown('R', 'ohm', 1.2), model.unknown('k', 'N*m/A', 0.05)\n"
        "J, b = model.unknown('J', 'kg*m^2', 2e-4), model.unknown('b', 'N*m*s', 1e-4)\n"
        "model.equation(R * i + k * w - V)\n"
        "model.equation(J * w.d() + b * w - k * i)\n",
        encoding="utf-8",
    )
    assert pvid("model", "simulate", model, run, "--duration", "8").return_value == DONE
    found = pvid("identify", run, "--model", model, "--core", "f32", "--refine")
    assert found.return_value == DONE and "weak form, C in float32" in found.stdout
    assert "not refined: motor: the second stage in C needs readings" in found.stderr
    shown = json.loads(pvid("identify", run, "--model", model, "--core", "f32", "--refine", "--json").stdout)
    assert shown["identified"] and not shown["refinement"]["adopted"] and "i depends on" in shown["refinement"]["text"]


def test_where_the_core_publishes_nothing_the_values_are_null(
    recorded: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Standard errors of a millionth are the limit of publication."""

    def strict(*given: Any) -> WeakConfig:
        config = config_to_identify(*given)
        return replace(config, trust=replace(config.trust, se_max=1e-6))

    monkeypatch.setattr("pvid.identification.core.config_to_identify", strict)
    answer = pvid("identify", recorded["rigid_body"], "--core", "f32", "--json")
    shown = json.loads(answer.stdout)
    assert answer.return_value == NOTHING_IDENTIFIED and not shown["identified"]
    assert shown["reason"] == "held uncertain" and shown["chi2"] is None
    assert all(one["value"] is None and one["se"] is None for one in shown["parameters"].values())
    assert "nothing identified: held uncertain" in answer.stderr


def test_core_and_twin_are_compared_in_every_bit(recorded: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    answer = pvid("compare", recorded["dc_motor"], "--core", "all")
    assert answer.return_value == DONE and answer.stdout.count("equal") == 3 and "6000" in answer.stdout
    assert "f32" in answer.stdout and "q31" in answer.stdout
    changed = "pvid.compare.weak.PrintedTwin"
    monkeypatch.setattr(changed, lambda sources, config: PrintedTwin(sources, replace(config, iterations=1)))
    answer = pvid("compare", recorded["rigid_body"])
    assert answer.return_value == DIFFERENT
    assert "DIFFERENT: tick" in " ".join(answer.stdout.split())


def test_both_stages_in_c_identify_a_recording_and_the_answer_is_the_refined_one(recorded: dict[str, Path]) -> None:
    answer = pvid("identify", recorded["rigid_body"], "--core", "f32", "--refine")
    assert answer.return_value == DONE
    assert "rigid body, gyros and torques: refined, C in float32" in answer.stdout
    assert "refined by the second stage, first after" in answer.stdout
    shown = json.loads(pvid("identify", recorded["rigid_body"], "--core", "f32", "--refine", "--json").stdout)
    weak = json.loads(pvid("identify", recorded["rigid_body"], "--core", "f32", "--json").stdout)
    assert shown["identified"] and shown["refinement"]["adopted"] and shown["refinement"]["reason"] == "updated"
    assert set(weak) < set(shown) and shown["hash"] != weak["hash"] and 0.5 < shown["refinement"]["level"] < 2
    for name, truth in simulated_rig("rigid_body").truth.items():
        one = shown["parameters"][name]
        assert one["value"] != weak["parameters"][name]["value"]
        assert abs(one["value"] - truth) < 4 * one["se"], name


def test_both_stages_in_c_refine_a_pendulum_of_its_own_rig_file(tmp_path: Path) -> None:
    """Full equations: the linear ones of the weak form are 0.5 % off, which its standard errors contain."""
    run = tmp_path / "run.csv"
    assert pvid("simulate", run, "--duration", "12", "--seed", "2").return_value == DONE
    shown = json.loads(pvid("identify", run, "--core", "f32", "--refine", "--json").stdout)
    assert shown["refinement"]["adopted"] and list(shown["parameters"])[-3:] == ["k1", "k2", "tau"]
    for name, truth in {**simulated_rig("kapitza").truth, "k1": 0.0, "k2": 0.0, "tau": 0.0}.items():
        one = shown["parameters"][name]
        assert abs(one["value"] - truth) < 3.5 * one["se_noise"], name
    assert shown["parameters"]["w"]["se_noise"] < 1e-3 * shown["parameters"]["w"]["value"]
    streamed = pvid("identify", run, "--core", "f32", "--refine", "--on", HOST_TARGET, "--json")
    on_board = json.loads(streamed.stdout)
    assert on_board["on"] == HOST_TARGET and on_board["hash"] == shown["hash"]  # of both stages, at every report
    assert on_board["parameters"] == shown["parameters"]
    answer = pvid("compare", run, "--core", "f32")
    assert answer.return_value == DONE and "refined" in answer.stdout and answer.stdout.count("equal") == 2
    rig = tmp_path / "described.toml"
    step = 2 * np.pi / 2**14
    rig.write_text(
        f'sample_rate = 1000\n[model]\nname = "kapitza"\n[known]\nl1 = 0.3\n[sensor.phi]\nresolution = {step}\n',
        encoding="utf-8",
    )
    described = json.loads(pvid("identify", run, "--rig", rig, "--refine", "--json").stdout)
    assert "refined over" in described["refinement"]["text"]
    for name, truth in simulated_rig("kapitza").truth.items():
        assert abs(described["parameters"][name]["value"] - truth) < 3.5 * described["parameters"][name]["se_noise"], (
            name
        )


def test_the_options_of_a_rig_file_reach_the_second_stage_in_c_and_a_board(tmp_path: Path) -> None:
    """Dry friction and a slant without which nothing is refined; the board's frames have eight refined parameters."""
    dry = 3e-4 * STANDARD_PENDULUM.g * STANDARD_PENDULUM.l2  # of each joint [m^2/s^2]
    rough = replace(STANDARD_PENDULUM, dry1=dry, dry2=dry, slant=0.02)
    release = (1.88 * STANDARD_RELEASE[0], 1.88 * STANDARD_RELEASE[1])  # 0.2 rad
    run = tmp_path / "run.csv"
    write_run(run, simulate(rough, duration=15.0, release=release, truth="full").run)
    rig = MechanismRig("kapitza", 1000.0, known={"l1": 0.3}, sensor={"y": {"gain_sd": 0.0}}, known_sd={"l1": 0.0})
    rig.write(run.with_suffix(".toml"))
    bare = json.loads(pvid("identify", run, "--core", "f32", "--refine", "--json").stdout)
    assert not bare["refinement"]["adopted"]
    chosen = replace(rig, refine={"dry_friction": True, "slant": True})
    chosen.write(run.with_suffix(".toml"))
    shown = json.loads(pvid("identify", run, "--core", "f32", "--refine", "--json", "--on", HOST_TARGET).stdout)
    assert shown["refinement"]["adopted"]
    friction = dry / STANDARD_PENDULUM.l1**2
    truth = {**simulated_rig("kapitza").truth, "f1": friction, "f2": friction, "slant": np.sin(0.02)}
    for name in ("w", "d1", "d2", "f1", "f2", "slant"):
        one = shown["parameters"][name]
        assert abs(one["value"] - truth[name]) < 3.5 * one["se_noise"], name
    board = MechanismBoard.of_guess(rig_of(run), refined=True)
    assert [name for name, _ in board.names.refined] == ["k1", "k2", "f1", "f2", "slant", "tau"]
    assert board_of(board.text()).equations.parameters == board.equations.parameters  # type: ignore[union-attr]


def test_a_small_motion_with_dry_friction_is_refined_behind_the_long_windows_of_its_weak_form(tmp_path: Path) -> None:
    """The windows are chosen from the run, here 4 s; the blocks agree with one another."""
    run = tmp_path / "run.csv"
    assert (
        pvid("simulate", run, "--truth", "f1=0.0033", "--truth", "f2=0.0033", "--duration", "20").return_value == DONE
    )
    rig = MechanismRig("kapitza", 1000.0, known={"l1": 0.3}, refine={"dry_friction": True})
    rig.write(run.with_suffix(".toml"))
    shown = json.loads(pvid("identify", run, "--core", "f32", "--refine", "--json").stdout)
    assert shown["refinement"]["adopted"] and shown["refinement"]["clash"] < 4.0
    for name in ("w", "d1", "d2"):
        one = shown["parameters"][name]
        assert abs(one["value"] - simulated_rig("kapitza").truth[name]) < 3.5 * one["se_noise"], name


def test_where_nothing_is_refined_the_answer_is_that_of_the_weak_form_and_says_so(
    recorded: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A noise of a millionth of the sensors': no block fits."""

    def exact(*given: Any) -> RefineConfig:
        settings = refine_design(*given)
        return replace(settings, sd=settings.sd * np.float32(1e-6))

    monkeypatch.setattr("pvid.identification.core_refined.refine_design", exact)
    answer = pvid("identify", recorded["rigid_body"], "--core", "f32", "--refine")
    assert answer.return_value == DONE and "weak form, C in float32" in answer.stdout
    assert "not refined: held searching; the estimate is that of the weak form" in answer.stdout


def test_the_second_stage_is_compared_with_its_twin_too(
    recorded: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = pvid("compare", recorded["rigid_body"])
    rows = [line.split() for line in answer.stdout.splitlines() if "host" in line]
    assert answer.return_value == DONE and [row[5] for row in rows] == ["weak", "refined"]
    assert rows[0][11] != rows[1][11] and answer.stdout.count("equal") == 2  # hashes of one stage and of both
    changed = "pvid.identification.core_refined.PrintedTwin"
    monkeypatch.setattr(changed, lambda sources, weak, own: PrintedTwin(sources, weak, replace(own, gate=1.0)))
    answer = pvid("compare", recorded["rigid_body"])
    assert answer.return_value == DIFFERENT
    assert answer.stdout.count("equal") == 1 and "DIFFERENT: tick" in " ".join(answer.stdout.split())
    why = "no steps for it"

    def refused(*_: Any) -> RefineConfig:
        raise PvidError(why)

    monkeypatch.setattr("pvid.identification.core_refined.refine_design", refused)
    assert f"note: no second stage: {why}" in pvid("compare", recorded["rigid_body"]).stderr


@pytest.mark.parametrize(
    ("command", "arguments", "sentence"),
    [
        ("identify", ("--law", "stationary"), "--law stationary: dc_motor is identified in float64, or in C by"),
        ("compare", ("--law", "pseudovelocity"), "--law pseudovelocity: dc_motor is compared in float32"),
    ],
)
def test_wrong_combinations_are_refused(
    command: str, arguments: tuple[str, ...], sentence: str, recorded: dict[str, Path]
) -> None:
    with pytest.raises(PvidError) as caught:
        pvid(command, recorded["dc_motor"], *arguments)
    assert sentence in str(caught.value)


def test_without_a_compiler_there_is_one_sentence(
    recorded: dict[str, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(PvidError, match="--core f32: .* needs a C compiler"):
        pvid("identify", recorded["rigid_body"], "--core", "f32")


def test_the_pendulum_s_own_rig_file_goes_through_the_identifier_and_the_refinement(tmp_path: Path) -> None:
    """Columns, resolution, guess and gains come from the rig file."""
    run = tmp_path / "run.csv"
    assert pvid("simulate", run, "--duration", "15", "--seed", "2").return_value == DONE
    weak = json.loads(pvid("identify", run, "--no-refine", "--json").stdout)
    own = json.loads(pvid("identify", run, "--json").stdout)
    assert weak["identified"] and weak["samples"] == own["samples"] == 15_000
    assert "refinement" not in weak and own["refinement"]["adopted"]
    assert list(weak["parameters"]) == list(own["parameters"]) == ["g", "l2", "rho2", "w", "d1", "d2", "c"]
    for name, one in weak["parameters"].items():
        apart = abs(one["value"] - own["parameters"][name]["value"])
        assert apart < 3 * np.hypot(one["se"], own["parameters"][name]["se"]), name
    # Small angles are neglected: the largest is about 0.1 rad.
    rough, sharp = weak["parameters"]["w"], own["parameters"]["w"]
    assert 0.003 < rough["se"] / rough["value"] < 0.02
    assert sharp["se_noise"] < 0.1 * rough["se"]
    assert pvid("compare", run).return_value == DONE
    assert "window s" in pvid("tune", run).stdout
    design = json.loads(pvid("design", "--run", run, "--json").stdout)
    assert design["identified"] and set(design["parameters"]) == {"w", "d1", "d2", "c"}


@pytest.mark.parametrize(("name", "tone"), [("kapitza", "0.006,1.1,0"), ("dc_motor", "4,1.5,0"), ("rigid_body", None)])
def test_design_predicts_the_errors_of_a_rig_file_s_guess(name: str, tone: str | None, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    known = {"l1": 0.25} if name == "kapitza" else {}
    MechanismRig(name, 1000.0, known=known).write(rig)

    def errors(*arguments: str) -> dict[str, float]:
        found = json.loads(pvid("design", "--rig", rig, "--json", *arguments).stdout)
        return {name: one["se"] for name, one in found["parameters"].items()}

    usual, short, long = errors(), errors("--duration", "10"), errors("--duration", "20")
    assert all(0 < long[name] < short[name] for name in long)
    if tone is None:
        with pytest.raises(PvidError, match="has 3 drives: --tone is for a mechanism with one"):
            pvid("design", "--rig", rig, "--tone", "1,1,0")
    else:
        assert errors("--tone", tone) != usual
    with pytest.raises(PvidError, match="positive number of seconds, not -1"):
        pvid("design", "--rig", rig, "--duration", "-1")
    with pytest.raises(PvidError, match="--run contains the drive"):
        pvid("design", "--rig", rig, "--run", "x.csv", "--duration", "3")


def test_design_and_tune_show_the_identifier_s_design_for_a_recording(recorded: dict[str, Path]) -> None:
    run = recorded["rigid_body"]
    design = json.loads(pvid("design", "--model", "rigid_body", "--run", run, "--json").stdout)
    core = json.loads(pvid("identify", run, "--core", "f32", "--json").stdout)
    assert design["identified"] and design["functions"] == core["functions"]
    assert design["window_s"] == pytest.approx(core["window_s"]) and design["decimation"] == core["decimation"]
    for name, one in design["parameters"].items():
        found = core["parameters"][name]
        assert one["unit"] == found["unit"] and abs(one["value"] - found["value"]) < 5 * found["se"]
        assert 0.2 < one["se"] / found["se_noise"] < 5
    tuned = pvid("tune", run)
    assert tuned.return_value == DONE and "analysis" in tuned.stdout and "C core" in tuned.stdout
    assert f"{design['window_s']:.4g}" in tuned.stdout


def test_tune_shows_how_far_each_design_is_from_the_refined_answer(recorded: dict[str, Path], tmp_path: Path) -> None:
    run = recorded["rigid_body"]
    tuned = pvid("tune", run, "--refine", "--figure", tmp_path / "tuned.png")
    assert tuned.return_value == DONE and "pvid: refined over" in tuned.stderr
    rows = [line for line in tuned.stdout.splitlines() if line.startswith("│")]
    distances = [float(line.split("│")[-2]) for line in rows]
    assert len(distances) > 4 and all(0.05 < one < 5 for one in distances)
    assert (tmp_path / "tuned.png").stat().st_size > 10_000
    with pytest.raises(PvidError, match="--figure is of the refinement: add --refine"):
        pvid("tune", run, "--figure", tmp_path / "tuned.png")


def test_design_of_a_shipped_rig_needs_no_run() -> None:
    done = pvid("design", "--model", "rigid_body")
    assert done.return_value == DONE and "Ixx [kg*m^2]" in done.stdout and "test functions: " in done.stdout
