"""`pvid tune`: no answer is lost, what is wrong with the defaults is found, nothing is changed for chance."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from program import pvid

from bench.tuning import CASES, Case, errors
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.models.kapitza import MODEL
from pvid.rig.file import RigFile, Unset, load
from pvid.rig.run import Run, write_run
from pvid.run.held_back import HeldBack, sigmas
from pvid.run.identify import identify
from pvid.run.survey import fitted
from pvid.run.tune import STEPS, Tuned, tune
from pvid.sim.pendulum import Pendulum, simulate, standard_sensors

STANDARD, DRIFTING, RUBBING = CASES[0], CASES[6], CASES[7]
SHORT_S = 15.0


@lru_cache
def tuned(case: Case, seed: int = 0) -> Tuned:
    return tune(case.run(seed), case.rig, Native())


def rms(relative: np.ndarray) -> float:
    return float(np.sqrt(np.mean(relative**2)))


@lru_cache
def short_run(truth: str = "full") -> Run:
    return simulate(truth="full" if truth == "full" else "linear", duration=SHORT_S, seed=4).run


def with_identifier(rig: RigFile, **changes: object) -> RigFile:
    return replace(rig, identifier=replace(rig.identifier, **changes))  # type: ignore[arg-type]


# ---- what is chosen


@pytest.mark.long
def test_settings_that_fit_the_rig_are_kept() -> None:
    choice = tuned(STANDARD)
    assert choice.chosen is choice.default
    assert choice.rig.identifier.forgetting_s == 0
    assert "own settings" in choice.reason


def test_friction_is_found() -> None:
    choice = tuned(RUBBING)
    assert choice.rig.identifier.damping
    by_default = identify(RUBBING.run(0), RUBBING.rig, Native())
    # 2e-4 m^2/s moves w by 0.2 % where it is ignored, four times and more the noise's share with it
    assert rms(errors(RUBBING, choice.answer)) < 0.25 * rms(errors(RUBBING, by_default))
    assert choice.chosen.residual_over(choice.default) < 0.5


def test_survey_with_friction_leaves_smaller_disturbances() -> None:
    run = RUBBING.run(0)
    without = fitted(RUBBING.rig, run).identifier.disturbance
    asked = fitted(with_identifier(RUBBING.rig, damping=True), run)
    assert asked.identifier.disturbance < 0.3 * without
    assert asked.nominal.l2 == pytest.approx(0.12, rel=2e-3)  # its standard error is 1e-3


def test_linear_equations_are_taken_where_the_motion_is_linear(native: Native) -> None:
    choice = tune(short_run("linear"), RigFile.standard(), native)
    assert not choice.rig.identifier.full_angle
    assert choice.chosen.residual_over(choice.default) < 0.1  # 0.4 % in w of bias, 1e-4 of noise


def test_linear_equations_are_no_alternative_at_large_angles(native: Native) -> None:
    """They would be published, several per cent off."""
    run = simulate(truth="full", release=(0.12, 0.32), duration=SHORT_S, seed=1).run
    assert identify(run, with_identifier(RigFile.standard(), full_angle=False), native).identified
    assert "held out of range" in refused(native, run)


@pytest.mark.long
def test_bad_sizes_are_replaced(native: Native) -> None:
    """A window of half a slow period, where theory.md 5 says that the weak form collapses."""
    bad = with_identifier(STANDARD.rig, window_s=0.6, test_functions=8)
    run = STANDARD.run(0)
    choice = tune(run, bad, native)
    assert choice.chosen is not choice.default
    assert rms(errors(STANDARD, choice.answer)) < 0.5 * rms(errors(STANDARD, identify(run, bad, native)))


@pytest.mark.long
def test_a_drifting_parameter_is_forgotten_and_a_constant_one_is_not() -> None:
    drifting = tuned(DRIFTING)
    assert drifting.rig.identifier.forgetting_s > 0
    assert "drift" in drifting.reason
    by_default = identify(DRIFTING.run(0), DRIFTING.rig, Native())
    assert rms(errors(DRIFTING, drifting.answer)) < 0.7 * rms(errors(DRIFTING, by_default))
    assert all(one.better_by_sigmas < 3 for one in tuned(STANDARD).forgetting)


def test_no_candidate_has_fewer_than_8_functions() -> None:
    candidates = [one for case in (STANDARD, RUBBING) for one in tuned(case).candidates]
    assert min(one.rig.identifier.test_functions for one in candidates) == 8
    for name in ("full_angle", "damping", "window_s", "decimation", "pass_hz"):
        assert len({getattr(one.rig.identifier, name) for one in candidates}) > 1, name


# ---- the answer


def test_the_written_file_gives_the_answer_again(native: Native) -> None:
    for case in (STANDARD, RUBBING):
        choice = tuned(case)
        again = identify(case.run(0), RigFile.parse(choice.rig.text()), native)
        assert again.hash == choice.answer.hash
        assert again.value == choice.answer.value
        assert again.identified


def test_written_file_is_explicit_and_short() -> None:
    rig = tuned(STANDARD).rig
    own = rig.identifier
    assert not own.survey
    assert min(own.window_s, own.smoothing_s, own.pass_hz, own.test_functions, own.decimation) > 0
    for value in (rig.nominal.g, rig.nominal.l2, rig.nominal.rho2, own.window_s, own.smoothing_s, own.pass_hz):
        assert value == float(f"{value:.4g}")


def test_the_defaults_answer_survives_being_rounded(native: Native) -> None:
    by_default = identify(STANDARD.run(0), STANDARD.rig, native)
    choice = tuned(STANDARD)
    for name in MODEL.mapped_names:  # 4 digits of nominal and window move the estimate by a part of its error
        assert abs(choice.answer.value[name] - by_default.value[name]) < 0.5 * by_default.se[name]


def test_a_run_too_short_to_hold_data_back_keeps_the_defaults(native: Native) -> None:
    run = simulate(truth="full", duration=4.0, seed=3).run
    assert identify(run, RigFile.standard(), native).identified
    choice = tune(run, RigFile.standard(), native)
    assert choice.chosen is choice.default and choice.answer.identified
    assert "too short" in choice.reason


def test_a_run_with_a_gap_is_tuned(native: Native) -> None:
    run = short_run()
    phi = run.phi.copy()
    phi[7000:7020] = np.nan
    choice = tune(replace(run, phi=phi), RigFile.standard(), native)
    assert choice.answer.identified
    assert choice.default.residuals is not None


def test_fixed_point_is_tuned_in_fixed_point(native: Native) -> None:
    choice = tune(short_run(), with_identifier(RigFile.standard(), core="q31"), native)
    assert choice.answer.core == "q31" and choice.rig.identifier.core == "q31"
    assert len({(one.rig.identifier.full_angle, one.rig.identifier.damping) for one in choice.candidates}) == 1


def test_a_strong_forms_rig_file_is_tuned_for_the_weak_one(native: Native) -> None:
    steps: list[int] = []
    rig = with_identifier(RigFile.standard(), form="strong", window_s=0.241)
    choice = tune(short_run(), rig, native, steps.append)
    assert choice.rig.identifier.form == "weak"
    assert choice.default.rig.identifier.window_s > 1
    assert steps == sorted(steps) and steps[-1] == STEPS


# ---- the encoder's resolution


def test_a_resolution_that_the_file_does_not_give_is_found(native: Native) -> None:
    run = simulate(truth="full", sensors=standard_sensors(12), duration=SHORT_S, seed=4).run
    silent = RigFile.parse("l1 = 0.3")
    step = 2 * np.pi / 2**12
    found = tune(run, silent, native)
    assert found.rig.sensor.phi_lsb == pytest.approx(step, rel=1e-3)
    assert found.notes == ("phi moves in steps of 0.001534 rad: taken as phi_lsb, which is not given",)


def test_a_resolution_that_the_file_gives_is_kept() -> None:
    assert tuned(STANDARD).notes == ()
    assert tuned(STANDARD).rig.sensor == STANDARD.rig.sensor
    assert isinstance(RigFile.parse("l1 = 0.3").sensor.phi_lsb, Unset)
    written = RigFile.parse(RigFile.parse("l1 = 0.3").text()).sensor
    assert written == RigFile.parse("l1 = 0.3").sensor and not isinstance(written.phi_lsb, Unset)


# ---- data held back


def held_back(run: Run) -> tuple[HeldBack, RigFile]:
    rig = fitted(RigFile.standard(), run)
    return HeldBack(run, rig), rig


def test_halves_share_no_sample_and_leave_out_windows_between_them() -> None:
    judge, _ = held_back(short_run())
    blocks = np.floor(judge.rows.spans / judge.block_s)
    for half in (0, 1):
        inside = judge.halves == half
        assert inside.sum() >= 2
        assert (blocks[inside] % 2 == half).all()
    assert (judge.halves == -1).any()


def test_better_equations_predict_better() -> None:
    pendulum = Pendulum(0.3, 0.12, 0.08, 9.5, 2e-4, 2e-4)
    judge, rig = held_back(simulate(pendulum, truth="full", duration=40.0, seed=2).run)
    without, linear = judge.residuals(rig), judge.residuals(with_identifier(rig, full_angle=False))
    friction = judge.residuals(with_identifier(rig, damping=True))
    assert sigmas(friction, without) < -3
    assert sigmas(linear, friction) > 3
    assert sigmas(without, without) == 0


def test_residuals_held_back_are_those_of_the_noise() -> None:
    """Of 10 rows a window, two go to its start; p from the other half adds a few per cent."""
    judge, rig = held_back(short_run())
    rows = (judge.design.functions - 2) * len(judge.residuals(rig))
    chi2 = float(judge.residuals(rig).sum()) / rows / judge.rows.row_sd**2
    assert 0.6 < chi2 < 1.5  # some 200 rows: 10 %; the encoder's noise is known to 20 %


# ---- what cannot be tuned


def refused(native: Native, run: Run) -> str:
    with pytest.raises(PvidError) as caught:
        tune(run, RigFile.standard(), native)
    return str(caught.value)


def test_untunable_run_is_reported(native: Native) -> None:
    still = simulate(drive=(), sensors=standard_sensors(14), duration=15.0).run
    said = refused(native, still)
    assert "nothing is identified" in said and "rests" in said
    run = short_run()
    assert "nothing" in refused(native, replace(run, phi=run.y / 0.3))  # driven, but the angle is the pivot's
    assert "nothing" in refused(native, simulate(duration=0.05).run)


# ---- the command


def test_the_command_writes_a_rig_file_that_identifies(tmp_path: Path) -> None:
    write_run(tmp_path / "run.csv", simulate(sensors=standard_sensors(13), truth="full", duration=SHORT_S, seed=4).run)
    (tmp_path / "run.toml").write_text("l1 = 0.3\n", encoding="utf-8")
    done = pvid(tmp_path, "tune", "run.csv")
    assert done.returncode == 0, done.stderr
    for words in ("held back", "window s", "chosen:", "identifies w", "run-tuned.toml", "phi moves in steps of"):
        assert words in done.stdout
    written = load(tmp_path / "run-tuned.toml")
    assert RigFile.parse(written.text()) == written
    again = pvid(tmp_path, "identify", "run.csv", "--rig", "run-tuned.toml")
    assert again.returncode == 0, again.stderr


@pytest.mark.parametrize(
    ("content", "arguments", "named"),
    [
        ("time,angle,pivot\n0,0,0\n0.001,0,0\n", ("--rig", "rig.toml"), "no column"),
        ("t,phi,y\n" + "".join(f"{k / 1000},0,0\n" for k in range(300)), ("--rig", "rig.toml"), "nothing"),
    ],
)
def test_bad_input_is_one_sentence(content: str, arguments: tuple[str, ...], named: str, tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(content, encoding="utf-8")
    RigFile.standard().write(tmp_path / "rig.toml")
    done = pvid(tmp_path, "tune", "run.csv", *arguments)
    assert done.returncode == 2, done.stdout
    assert named in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
