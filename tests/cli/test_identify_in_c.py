"""`identify --core f32|q31` and `compare` of described mechanisms, from the recording to the printed answer."""

import json
import re
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process import pvid
from own_mechanisms import OWN
from pendulum_plant import STANDARD_PENDULUM, STANDARD_RELEASE, simulate
from pendulum_run import write_run

from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED
from pvid.base.errors import PvidError
from pvid.board.mechanism_board import MechanismBoard, board_of
from pvid.board.target import HOST_TARGET
from pvid.board.verify_board import verify_recording
from pvid.cli.identify_run import recording_of
from pvid.configuration.refine import refine_design
from pvid.configuration.weak import config_to_identify
from pvid.identification.analysis import analysed
from pvid.identification.core import CoreAnswer, identify_in_c
from pvid.identification.core_refined import RefinedCoreAnswer, refined_in_c
from pvid.log.rig_choice import rig_of
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.enums import Reason
from pvid.settings.refine import RefineConfig
from pvid.settings.weak import WeakConfig
from pvid.twin.printed import PrintedTwin

RUNS: dict[str, tuple[str, ...]] = {
    "rigid_body": ("--duration", "8"),
    "dc_motor": ("--duration", "6"),
    "kapitza": ("--duration", "15"),
    "free_pendulum": ("--duration", "7", "--rate", "500", "--start", "q=2.5"),  # a file of one's own, without an input
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Simulated runs by mechanism, each with its rig file beside it."""
    folder = tmp_path_factory.mktemp("recorded")
    paths = {name: folder / f"{name}.csv" for name in RUNS}
    for name, options in RUNS.items():
        model = OWN[name].path if name in OWN else name
        assert pvid("model", "simulate", model, paths[name], *options, "--seed", "3").return_value == DONE
    return paths


Answers = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def answers(recorded: dict[str, Path]) -> Answers:
    """What `identify NAME OPTIONS --json` prints, once each."""

    @cache
    def answer(name: str, *options: str) -> dict[str, Any]:
        model = ("--model", OWN[name].path) if name in OWN else ()
        done = pvid("identify", recorded[name], *model, *options, "--json")
        assert done.return_value == DONE, done.output
        shown: dict[str, Any] = json.loads(done.stdout)
        return shown

    return answer


@pytest.fixture(scope="module")
def core(recorded: dict[str, Path]) -> CoreAnswer:
    """Of the C core, for the rigid body."""
    rig = MechanismRig.of_document(tomllib.loads(recorded["rigid_body"].with_suffix(".toml").read_text()))
    return identify_in_c(analysed(*recording_of(recorded["rigid_body"], rig, None)))


@pytest.mark.parametrize(
    ("name", "arithmetic"), [("rigid_body", "f32"), ("dc_motor", "f32"), ("dc_motor", "q31"), ("free_pendulum", "f32")]
)
def test_the_core_identifies_a_recording_as_the_oracle_does(name: str, arithmetic: str, answers: Answers) -> None:
    core = answers(name, "--core", arithmetic)
    oracle = answers(name, "--no-refine")
    assert set(oracle) < set(core)  # the same keys, and the core's own
    assert core["core"] == arithmetic and oracle["core"] == "f64"
    assert core["identified"] and core["reason"] == "updated" and 0.5 < core["chi2"] < 2
    assert oracle["reasons"].items() <= core["reasons"].items()
    truth = {one.name: one.guess for one in OWN[name].compiled.unknowns} if name in OWN else simulated_rig(name).truth
    assert list(core["parameters"]) == list(oracle["parameters"])
    for parameter, one in core["parameters"].items():
        exact = oracle["parameters"][parameter]
        assert one["unit"] == exact["unit"] and one["se"] >= one["se_noise"] > 0
        # The oracle locates each reversal of friction, and chooses its own window; the core takes the mean of signs.
        assert abs(one["value"] - exact["value"]) < 5 * max(one["se"], exact["se"]), parameter
        assert abs(one["value"] - truth[parameter]) < 5 * one["se"], parameter


def test_the_answer_is_a_table_with_the_reason_of_the_last_window(recorded: dict[str, Path]) -> None:
    answer = pvid("identify", recorded["rigid_body"], "--core", "f32", "--verbose")
    assert answer.return_value == DONE
    assert "weak form, C in float32" in answer.stdout and "Ixx [kg*m^2]" in answer.stdout
    assert "last window: updated; valid; chi2 " in answer.stdout


def test_an_answer_of_the_core_that_the_analysis_contradicts_has_a_warning(core: CoreAnswer) -> None:
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


def test_a_core_that_has_published_nothing_is_not_called_good(core: CoreAnswer) -> None:
    silent = replace(core, published=False, reason=Reason.HELD_NOT_EXCITED)
    assert silent.verdict.status == "not_identified"
    assert silent.as_json()["status"] == "not_identified"
    assert silent.verdict.reasons[0].text == "The C core has published no estimate: held not excited."


def test_core_and_analysis_are_compared_by_their_noise(core: CoreAnswer) -> None:
    """The errors of gains are the same in both: they hide no difference."""
    one = core.values["Iyz"]
    assert one.value is not None and one.se_noise is not None
    loud = replace(one, se=100 * one.se_noise)
    apart = replace(loud, value=one.value + 5 * one.se_noise)
    near = replace(loud, value=one.value + 2 * one.se_noise)
    assert replace(core, values={**core.values, "Iyz": apart}).verdict.status == "warning"
    assert replace(core, values={**core.values, "Iyz": near}).verdict.status == "good"


@pytest.mark.parametrize(("steps", "status"), [(2, "good"), (40, "warning")])
def test_values_that_float32_does_not_resolve_are_alike(core: CoreAnswer, steps: int, status: str) -> None:
    """Of sensors without noise the standard errors are far below the last bit of a float."""
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


def test_a_twin_with_other_bits_is_told(recorded: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    changed = "pvid.compare.weak.PrintedTwin"
    monkeypatch.setattr(changed, lambda sources, config: PrintedTwin(sources, replace(config, iterations=1)))
    answer = pvid("compare", recorded["rigid_body"])
    assert answer.return_value == DIFFERENT
    assert "DIFFERENT: tick" in " ".join(answer.stdout.split())


@pytest.mark.parametrize(("name", "extras"), [("rigid_body", []), ("kapitza", ["k1", "k2", "tau"])])
def test_both_stages_in_c_identify_a_recording_and_the_answer_is_the_refined_one(
    name: str, extras: list[str], answers: Answers
) -> None:
    weak, shown = answers(name, "--core", "f32"), answers(name, "--core", "f32", "--refine")
    assert shown["identified"] and shown["refinement"]["adopted"] and shown["refinement"]["reason"] == "updated"
    assert set(weak) < set(shown) and shown["hash"] != weak["hash"] and 0.5 < shown["refinement"]["level"] < 2
    assert list(shown["parameters"]) == [*weak["parameters"], *extras]
    for parameter, value in {**simulated_rig(name).truth, **dict.fromkeys(extras, 0.0)}.items():
        one = shown["parameters"][parameter]
        assert parameter in extras or one["value"] != weak["parameters"][parameter]["value"]
        assert abs(one["value"] - value) < 4 * one["se_noise"], parameter


def test_the_refined_answer_in_c_is_printed_and_is_that_of_a_board(recorded: dict[str, Path], answers: Answers) -> None:
    answer = pvid("identify", recorded["kapitza"], "--core", "f32", "--refine")
    assert answer.return_value == DONE and "Kapitza" in answer.stdout and ": refined, C in float32" in answer.stdout
    assert "refined by the second stage, first after" in answer.stdout
    shown = answers("rigid_body", "--core", "f32", "--refine")
    on_board = answers("rigid_body", "--core", "f32", "--refine", "--on", HOST_TARGET)
    assert on_board["on"] == HOST_TARGET and on_board["hash"] == shown["hash"]  # of both stages, at every report
    assert on_board["parameters"] == shown["parameters"]
    assert answers("rigid_body", "--core", "q31", "--on", HOST_TARGET)["on"] == HOST_TARGET


def test_the_options_of_a_rig_file_reach_the_second_stage_in_c_and_a_board(tmp_path: Path) -> None:
    """Dry friction and a slant without which nothing is refined; the board's frames have eight refined parameters."""
    dry = 3e-4 * STANDARD_PENDULUM.g * STANDARD_PENDULUM.l2  # of each joint [m^2/s^2]
    rough = replace(STANDARD_PENDULUM, dry1=dry, dry2=dry, slant=0.02)
    release = (1.88 * STANDARD_RELEASE[0], 1.88 * STANDARD_RELEASE[1])  # 0.2 rad
    run = tmp_path / "run.csv"
    write_run(run, simulate(rough, duration=15.0, release=release, truth="full").run)
    rig = MechanismRig("kapitza", 1000.0, known={"l1": 0.3}, sensor={"y": {"gain_sd": 0.0}}, known_sd={"l1": 0.0})
    chosen = replace(rig, refine={"dry_friction": True, "slant": True})
    chosen.write(run.with_suffix(".toml"))
    recording, model = recording_of(run, rig_of(run), None)
    answer = analysed(recording, model)
    bare = replace(answer, model=recording_of(run, rig, None)[1])
    assert not refined_in_c(identify_in_c(bare)).adopted
    shown = refined_in_c(identify_in_c(answer))
    assert shown.adopted
    friction = dry / STANDARD_PENDULUM.l1**2
    truth = {**simulated_rig("kapitza").truth, "f1": friction, "f2": friction, "slant": np.sin(0.02)}
    for name in ("w", "d1", "d2", "f1", "f2", "slant"):
        assert error_over_noise(shown, name, truth[name]) < 3.5, name
    assert verify_recording(HOST_TARGET, rig_of(run), recording, ranking=answer.ranking, refined=True).equal
    board = MechanismBoard.of_guess(rig_of(run), refined=True)
    assert [name for name, _ in board.names.refined] == ["k1", "k2", "f1", "f2", "slant", "tau"]
    assert board_of(board.text()).equations.parameters == board.equations.parameters  # type: ignore[union-attr]


def error_over_noise(answer: RefinedCoreAnswer, name: str, truth: float) -> float:
    one = answer.values[name]
    assert one.value is not None and one.se_noise is not None
    return abs(one.value - truth) / one.se_noise


def test_a_small_motion_with_dry_friction_is_refined_behind_the_long_windows_of_its_weak_form(tmp_path: Path) -> None:
    """The windows are chosen from the run, here 4 s; the blocks agree with one another."""
    run = tmp_path / "run.csv"
    assert (
        pvid("simulate", run, "--truth", "f1=0.0033", "--truth", "f2=0.0033", "--duration", "20").return_value == DONE
    )
    rig = MechanismRig("kapitza", 1000.0, known={"l1": 0.3}, refine={"dry_friction": True})
    shown = refined_in_c(identify_in_c(analysed(*recording_of(run, rig, None))))
    assert shown.adopted and shown.as_json()["refinement"]["clash"] < 4.0
    for name in ("w", "d1", "d2"):
        assert error_over_noise(shown, name, simulated_rig("kapitza").truth[name]) < 3.5, name


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
    answer = pvid("compare", recorded["rigid_body"], "--on", HOST_TARGET)
    rows = [line.split() for line in answer.stdout.splitlines() if " host " in line]
    assert answer.return_value == DONE and [row[5] for row in rows] == ["weak", "refined"]
    assert rows[0][11] != rows[1][11] and answer.stdout.count("equal") == 3  # hashes of one stage and of both
    hashes = re.findall(r"\b[0-9a-f]{8}\b", answer.stdout)
    assert hashes[0] == hashes[2] != hashes[1]  # of the weak form, here and there
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


def test_the_physical_parameters_follow_from_the_weak_form_and_from_the_refinement(answers: Answers) -> None:
    """Resolution, guess and gains come from the rig file."""
    weak, own = answers("kapitza", "--no-refine"), answers("kapitza")
    assert weak["identified"] and weak["samples"] == own["samples"] == 15_000
    assert "refinement" not in weak and own["refinement"]["adopted"] and "refined over" in own["refinement"]["text"]
    assert list(weak["parameters"]) == list(own["parameters"]) == ["g", "l2", "rho2", "w", "d1", "d2", "c"]
    for name, one in weak["parameters"].items():
        apart = abs(one["value"] - own["parameters"][name]["value"])
        assert apart < 3 * np.hypot(one["se"], own["parameters"][name]["se"]), name
    for name, truth in simulated_rig("kapitza").truth.items():
        one = own["parameters"][name]
        assert abs(one["value"] - truth) < 3.5 * one["se_noise"], name
    # Small angles are neglected: the largest is about 0.1 rad.
    rough, sharp = weak["parameters"]["w"], own["parameters"]["w"]
    assert 0.003 < rough["se"] / rough["value"] < 0.02
    assert sharp["se_noise"] < 0.1 * rough["se"] and sharp["se_noise"] < 1e-3 * sharp["value"]


@pytest.mark.parametrize(("name", "tone"), [("kapitza", "0.006,1.1,0"), ("dc_motor", "4,1.5,0")])
def test_design_predicts_the_errors_of_a_rig_file_s_guess(name: str, tone: str, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    known = {"l1": 0.25} if name == "kapitza" else {}
    MechanismRig(name, 1000.0, known=known).write(rig)

    def errors(*arguments: str) -> dict[str, float]:
        found = json.loads(pvid("design", "--rig", rig, "--json", *arguments).stdout)
        return {name: one["se"] for name, one in found["parameters"].items()}

    short, long = errors("--duration", "10"), errors("--duration", "20")
    assert all(0 < long[name] < short[name] for name in long)
    assert errors("--duration", "10", "--tone", tone) != short
    with pytest.raises(PvidError, match="positive number of seconds, not -1"):
        pvid("design", "--rig", rig, "--duration", "-1")
    with pytest.raises(PvidError, match="--run contains the drive"):
        pvid("design", "--rig", rig, "--run", "x.csv", "--duration", "3")


def test_a_tone_is_for_a_mechanism_with_one_drive() -> None:
    with pytest.raises(PvidError, match="has 3 drives: --tone is for a mechanism with one"):
        pvid("design", "--model", "rigid_body", "--tone", "1,1,0")


@pytest.mark.parametrize("name", ["rigid_body", "kapitza"])
def test_design_and_tune_show_the_identifier_s_design_for_a_recording(
    name: str, recorded: dict[str, Path], answers: Answers
) -> None:
    run = recorded[name]
    design = json.loads(pvid("design", "--model", name, "--run", run, "--json").stdout)
    core = answers(name, "--core", "f32")
    assert design["identified"] and design["functions"] == core["functions"]
    assert design["window_s"] == pytest.approx(core["window_s"]) and design["decimation"] == core["decimation"]
    for parameter, one in design["parameters"].items():
        found = core["parameters"][parameter]
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
