"""The hard cases, in short: what is published is covered by its standard errors or comes with an alarm."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pytest
from weak_rig import assert_equals_the_twin

from bench.board_engine import FloatBoard
from bench.hard import CASES, HEADER, LARGEST, ZERO, Case, Outcome, modes, row, run_case
from pvid.settings.enums import Core, Reason
from pvid.sim.pendulum import Sensors, simulate, standard_start

SEEDS = 5
FAULT_SEEDS = 12

Float = npt.NDArray[np.float64]


@lru_cache
def outcome(label: str) -> Outcome:
    return run_case(case(label), SEEDS)


def case(label: str) -> Case:
    return next(one for one in CASES if one.label == label)


@pytest.mark.parametrize(
    "label",
    [
        "encoder of 8 bits",
        "14 bits, noise of 32 LSB",
        "drive x0.1, 12 bits",
    ],
)
def test_noise_raises_errors_and_standard_errors(label: str) -> None:
    """Errors grow to per cents of w; 15 numbers lie within 3 standard errors (of 40 runs 97 to 100 % do)."""
    assert outcome(label).published.all()
    assert outcome(label).covered.all()
    assert not outcome(label).alarmed.any()
    assert np.median(outcome(label).standard_errors[:, 0]) > 0.003  # 30 times those of the plain 14-bit run


def test_an_angle_of_a_few_steps_of_the_encoder_tells_enough_or_is_held() -> None:
    """Of 20 runs 18 are published, the others held."""
    found = outcome("start x0.01, angle up to 2.8 LSB, 14 bits")
    assert found.published.sum() >= SEEDS - 1
    assert set(found.held) <= {Reason.HELD_UNCERTAIN.text}
    assert found.covered[found.published].all() and not found.alarmed.any()


@pytest.mark.parametrize(
    "label",
    [
        "no drive, free swing",
        "no drive, no motion",
        "drive, no motion",
        "drive x0.03, 14 bits",
        "14 bits, noise of 128 LSB",
        "slow mode only, one tone, 14 bits",
        "slow mode only, 12 bits",
        "fast mode only, 12 bits",
    ],
)
def test_estimate_without_information_is_not_published(label: str) -> None:
    assert not outcome(label).published.any()
    assert len(outcome(label).held) == SEEDS
    assert all(reason.startswith(("held", "rejected")) for reason in outcome(label).held)


@pytest.mark.parametrize(
    "label",
    [
        "friction of 0.0001 m^2/s, 14 bits",
        "full equations, 0.107 rad, 14 bits",
        "14 bits, noise of 64 LSB, phi_lsb set for 0.58",
    ],
)
def test_unmodelled_effects_raise_the_alarm(label: str) -> None:
    assert (outcome(label).alarmed | ~outcome(label).published).all()
    assert outcome(label).wrong == 0


def test_configured_noise_raises_no_alarm() -> None:
    assert not outcome("14 bits, noise of 64 LSB").alarmed[outcome("14 bits, noise of 64 LSB").published].any()


@pytest.mark.parametrize(
    "label",
    [
        "14 bits, noise of 512 LSB",
        "drive x0.03, 14 bits",
        "drive, no motion",
        "slow mode only, 14 bits",
        "fast mode only, 16 bits",
        "friction of 0.0003 m^2/s, 14 bits",
        "full equations, 0.107 rad, 14 bits",
    ],
)
def test_the_twin_has_the_same_bits_where_it_is_hard(label: str) -> None:
    """12 s: first windows, steps that are held, limited or led astray by noise."""
    one = case(label)
    run, board = one.run(3, duration=12.0), one.board()
    assert isinstance(board, FloatBoard)
    config = board.config_from(np.append(standard_start(3), 0.0))
    assert_equals_the_twin(board.library, config, board.samples({"phi": run.phi, "y": run.y}))


def test_the_modes_are_modes() -> None:
    """Released in a mode without a drive, phi is one cosine: at 0.742 and 2.56 Hz (theory.md 6)."""
    for shape, frequency in zip(modes(), (0.742, 2.56), strict=True):
        run = simulate(drive=(), sensors=Sensors(), release=(0.1 * shape[0], 0.1 * shape[1]), duration=10.0).run
        spectrum = np.abs(np.fft.rfft(run.phi * np.hanning(len(run.phi))))
        top = int(np.argmax(spectrum))
        assert abs(top / 10.0 - frequency) <= 0.1  # a bin
        rate = 1000 * np.arccos((run.phi[2] + run.phi[0]) / (2 * run.phi[1]))
        cosine = run.phi[0] * np.cos(rate * run.t)
        # the integrator's 1e-12 makes the rate from three samples uncertain by 1e-6 of it: nothing in 160 rad
        np.testing.assert_allclose(run.phi, cosine, atol=1e-3 * abs(run.phi[0]))


def test_cases_are_the_stated_rigs() -> None:
    assert len({one.label for one in CASES}) == len(CASES)
    assert all(one.sensors.phi_zero == ZERO for one in CASES)
    largest = float(np.abs(simulate(sensors=Sensors()).run.phi).max())
    assert largest == pytest.approx(LARGEST, rel=0.015)


def test_row_contains_the_verdicts_of_its_runs() -> None:
    few = Outcome(
        published=np.array([True, True, True, False]),
        alarmed=np.array([False, True, False, False]),
        errors=np.array([[0.01, 0.02, 0.02], [0.5, 0.5, 0.5], [0.5, 0.0, 0.0], [9.0, 9.0, 9.0]]),
        standard_errors=np.full((4, 3), 0.01),
        correlation=np.tile(np.eye(3), (4, 1, 1)),
        held=("held singular",),
    )
    none = replace(few, published=np.zeros(4, np.bool_))
    cells = row(CASES[0], few, none)
    assert len(cells) == len(HEADER)
    assert cells[1] == "3/4"
    assert cells[5] == "1"  # median of 0.01, per cent
    assert cells[6] == "33/67/67"
    assert cells[7:] == ("1/3", "1", "held singular", "0/4", "0", "0.02", "f32: biased")
    assert row(CASES[0], none, few)[1:] == ("0/4", *["-"] * 6, "0", "held singular", "3/4", "1", "-", "q31: biased")


def silent_runs(errors: Float, correlation: float = 0.0) -> Outcome:
    """Runs without alarm whose errors are in standard errors [runs, 3]."""
    runs = len(errors)
    matrix = np.full((3, 3), correlation) + (1 - correlation) * np.eye(3)
    none = np.zeros(runs, np.bool_)
    return Outcome(~none, none, errors, np.ones((runs, 3)), np.tile(matrix, (runs, 1, 1)), ())


def test_chance_is_that_of_errors_with_the_published_covariance() -> None:
    """0.27 % of normal numbers lie beyond 3 standard deviations."""
    none = np.zeros((2, 3))
    assert silent_runs(none).chance == pytest.approx(1 - 0.9973002**3, abs=1e-5)
    assert silent_runs(none, 0.999999).chance == pytest.approx(0.0026998, abs=3e-5)
    assert replace(silent_runs(none), alarmed=np.ones(2, np.bool_)).chance == 0.0


def test_a_fault_is_what_chance_does_not_explain() -> None:
    """Of 40 runs one or two are beyond 3 standard errors by chance, three are not; nor is a mean error of one."""
    few = np.zeros((40, 3))
    few[:2, 0] = 3.1, -3.1
    assert silent_runs(few).fault == ""
    few[2:5, 0] = 3.1, -3.1, 3.1
    assert silent_runs(few).fault == "wrong"
    assert silent_runs(np.full((40, 3), 0.5)).fault == ""
    assert silent_runs(np.full((40, 3), 1.0)).fault == "biased"
    assert replace(silent_runs(few), alarmed=np.ones(40, np.bool_)).fault == ""


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_neglected_terms_make_no_fault(core: Core, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 0.05 rad the residuals of half of the runs show nothing of a bias of 2 standard errors of the noise."""
    full = case("full equations, 0.053 rad, 14 bits")
    found = run_case(full, FAULT_SEEDS, core)
    assert found.published.all() and found.silent.sum() >= FAULT_SEEDS // 4
    assert found.wrong == 0 and found.fault == ""
    monkeypatch.setattr(Case, "neglected", 0.0)
    assert run_case(full, FAULT_SEEDS, core).fault == "biased"
