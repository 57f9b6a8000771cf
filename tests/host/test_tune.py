"""`pvid tune`: what it picks is never much worse than the default, far better where the default is bad."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from pvid.bench.tuning import CASES, Case, Outcome, errors, run_case
from pvid.capture import Run, write_run
from pvid.errors import PvidError
from pvid.native import Native
from pvid.rig import simulate, standard_sensors
from pvid.rigfile import RigFile, load
from pvid.tune import CLOSE, KEEP, STEPS, slow_period, tune

STANDARD, SLOW, FAST, FASTER_SAMPLES, DRIFTING = (CASES[index] for index in (0, 2, 4, 5, 6))


@lru_cache
def outcome(case: Case, seeds: int) -> Outcome:
    return run_case(Native(), case, range(seeds))


def test_on_the_standard_rig_tuning_costs_little() -> None:
    # the bound; both settings share the noise, so that a few seeds tell
    assert outcome(STANDARD, 3).ratio < 1.3


def test_bad_settings_on_the_standard_rig_are_replaced(native: Native) -> None:
    """Free to choose, tuning comes to what the default is worth."""
    bad = replace(STANDARD.rig.identifier, window_s=0.6, test_functions=6)
    runs = [STANDARD.run(seed) for seed in range(3)]
    choices = [tune(run, replace(STANDARD.rig, identifier=bad), native) for run in runs]
    for choice in choices:
        assert choice.default is not None
        assert choice.default.error > KEEP * choice.candidates[0].error
        assert choice.chosen.error <= CLOSE * choice.candidates[0].error
    found = [errors(native, STANDARD, choice.rig, run) for choice, run in zip(choices, runs, strict=True)]
    default = [errors(native, STANDARD, STANDARD.rig, run) for run in runs]
    assert np.sqrt(np.mean(np.square(found)) / np.mean(np.square(default))) < 1.3


def test_on_a_slow_rig_tuning_halves_the_error() -> None:
    # the default's window is half a slow period there, where MATH.md 5 says that it collapses
    assert outcome(SLOW, 2).ratio < 0.5


def test_on_a_fast_rig_tuning_finds_settings_where_the_default_has_none() -> None:
    done = outcome(FAST, 1)
    assert done.default is None
    assert all(choice.default_refusal for choice in done.choices)
    assert np.sqrt(np.mean(done.tuned**2, axis=0)).max() < 1e-3  # a 71 ms filter alone is worth a bias of 2e-3 in d2
    assert all(choice.chosen.settings.smoothing_s < 0.06 for choice in done.choices)


def test_a_drifting_parameter_is_forgotten_and_a_constant_one_is_not() -> None:
    drifting, constant = outcome(DRIFTING, 1).choices, outcome(STANDARD, 3).choices
    assert all(choice.chosen.settings.forgetting_s > 0 for choice in drifting)
    assert "drift" in drifting[0].reason
    assert all(choice.chosen.settings.forgetting_s == 0 for choice in constant)
    assert outcome(DRIFTING, 1).ratio < 0.7


def test_expected_errors_are_those_against_the_truth() -> None:
    done = outcome(STANDARD, 3)
    expected = np.sqrt(np.mean([choice.chosen.error**2 for choice in done.choices]))
    actual = np.sqrt(np.mean(done.tuned**2))
    # w, d1, d2 of a run err together: 3 runs are little more than 3 numbers, known to 1/sqrt(6) = 40 %
    assert 0.2 < actual / expected < 1.8


def test_what_is_chosen_is_among_the_candidates_and_explained(native: Native) -> None:
    steps: list[int] = []
    run = simulate(duration=20.0, seed=9).run
    done = tune(run, RigFile.standard(), native, steps.append)
    assert steps == sorted(steps) and steps[-1] == STEPS
    assert done.chosen.settings in [one.settings for one in done.candidates]  # no drift: none forgets
    expected = [one.error for one in done.candidates]
    assert expected == sorted(expected)
    assert done.chosen.error <= KEEP * expected[0]
    assert str(len(expected)) in done.reason
    assert done.forgetting[0].forgetting_s == 0.0 and done.forgetting[0].energy == 1.0


def test_a_bad_smoothing_filter_is_seen(native: Native) -> None:
    """81 ms on the fast rig: the halves agree, the standard error is small, and the estimate is 0.2 % wrong."""
    rig = replace(FAST.rig, identifier=replace(FAST.rig.identifier, window_s=0.6, decimation=4, smoothing_s=0.081))
    run = FAST.run(0)
    default = tune(run, replace(rig, identifier=replace(rig.identifier, test_functions=8)), native).default
    assert default is not None
    wrong = np.abs(default.p[:3] / FAST.truth - 1)
    assert (wrong > 5 * default.se).all()
    assert default.split < 3
    assert (default.bias > 0.3 * wrong).all()
    assert default.error > 0.3 * float(np.sqrt(np.mean(wrong**2)))


def test_at_another_sample_rate_tuning_gains() -> None:
    """2 kHz: the core holds 40 ms of smoothing only, which wants another decimation than 71 ms do."""
    done = outcome(FASTER_SAMPLES, 2)
    for choice in done.choices:
        assert choice.default is not None
        assert choice.chosen.error < 0.6 * choice.default.error
    assert done.ratio < 1  # two runs know a ratio only roughly; `bench tune` shows six


def test_a_strong_forms_rig_file_is_tuned_for_the_weak_one(native: Native) -> None:
    rig = RigFile.standard()
    strong = replace(rig, identifier=replace(rig.identifier, form="strong", window_s=0.241))
    run = simulate(duration=15.0, seed=2).run
    done = tune(run, strong, native)
    assert done.rig.identifier.form == "weak"
    assert done.default is not None and done.default.settings.window_s == 1.25


def test_the_slow_period_is_that_of_math_md() -> None:
    assert 1 / slow_period(STANDARD.truth) == pytest.approx(0.742, abs=5e-4)  # its printed digits


def refused(native: Native, run: Run, rig: RigFile | None = None) -> str:
    with pytest.raises(PvidError) as caught:
        tune(run, rig or RigFile.standard(), native)
    return str(caught.value)


def test_what_cannot_be_tuned_is_said(native: Native) -> None:
    still = simulate(drive=(), sensors=standard_sensors(14), duration=15.0).run
    assert "without a drive" in refused(native, still)
    resting = simulate(drive=(), sensors=standard_sensors(14), duration=15.0, release=(0.0, 0.0)).run
    assert "without a drive" in refused(native, resting)
    # driven, but the angle is the pivot's
    run = simulate(duration=15.0).run
    assert "columns" in refused(native, replace(run, phi=run.y / 0.3, y=run.phi * 0.0 + run.y))
    assert "too short" in refused(native, simulate(duration=2.0).run)
    assert "too short" in refused(native, simulate(duration=0.05).run)


def pvid(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "pvid", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


def test_the_command_writes_a_rig_file_that_identifies(tmp_path: Path) -> None:
    write_run(tmp_path / "run.csv", simulate(duration=20.0, seed=4).run)
    given = RigFile.standard()
    given.write(tmp_path / "run.toml")
    done = pvid("tune", "run.csv", "-o", "better.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for word in ("window s", "split", "misfit", "colour", "chosen", "better.toml", "forgetting", "identifies w"):
        assert word in done.stdout
    better = load(tmp_path / "better.toml")
    assert RigFile.parse(better.text()) == better
    assert (better.l1, better.nominal, better.sensor) == (given.l1, given.nominal, given.sensor)
    assert better.identifier.window_s > 0 and better.identifier.decimation > 0
    assert pvid("identify", "run.csv", "--rig", "better.toml", cwd=tmp_path).returncode == 0


def test_a_model_that_does_not_fit_is_warned_of(tmp_path: Path) -> None:
    """Large angles: no setting cures them, and the expected errors do not hold."""
    run = simulate(sensors=standard_sensors(14), truth="full", duration=20.0, seed=4).run
    write_run(tmp_path / "run.csv", run)
    RigFile.standard().write(tmp_path / "run.toml")
    done = pvid("tune", "run.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "warning" in done.stderr and "large angles" in " ".join(done.stderr.split())
    assert (tmp_path / "run-tuned.toml").is_file()


@pytest.mark.parametrize(
    ("content", "arguments", "named"),
    [
        ("time,angle,pivot\n0,0,0\n0.001,0,0\n", ("--rig", "rig.toml"), "no column"),
        ("t,phi,y\n" + "".join(f"{k / 1000},0,0\n" for k in range(300)), ("--rig", "rig.toml"), "without a drive"),
        ("t,phi,y\n" + "".join(f"{k / 1000},0,0\n" for k in range(300)), (), "run.toml"),
    ],
)
def test_bad_input_is_one_sentence(content: str, arguments: tuple[str, ...], named: str, tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(content, encoding="utf-8")
    RigFile.standard().write(tmp_path / "rig.toml")
    done = pvid("tune", "run.csv", *arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stdout
    assert named in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
