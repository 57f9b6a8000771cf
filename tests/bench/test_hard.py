"""The hard cases, in short: what is published is covered by its standard errors or comes with an alarm."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from fourier_rig import assert_equals_the_twin

from bench.board_engine import FloatBoard
from bench.hard import CASES, HEADER, LARGEST, ZERO, Case, Outcome, modes, row, run_case
from pvid.sim.pendulum import Sensors, simulate, standard_start

SEEDS = 5


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
        "start x0.01, angle up to 2.8 LSB, 14 bits",
        "drive x0.1, 12 bits",
    ],
)
def test_noise_raises_errors_and_standard_errors(label: str) -> None:
    """Errors grow to per cents of w; 15 numbers lie within 3 standard errors (of 40 runs 97 to 100 % do)."""
    assert outcome(label).published.all()
    assert outcome(label).covered.all()
    assert not outcome(label).alarmed.any()
    assert np.median(outcome(label).standard_errors[:, 0]) > 0.003  # 30 times those of the plain 14-bit run


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
        held=("held pivot",),
    )
    none = replace(few, published=np.zeros(4, np.bool_))
    cells = row(CASES[0], few, none)
    assert len(cells) == len(HEADER)
    assert cells[1] == "3/4"
    assert cells[5] == "1"  # median of 0.01, per cent
    assert cells[6] == "33/67/67"
    assert cells[7:] == ("1/3", "1", "held pivot", "0/4", "0")
    assert row(CASES[0], none, few)[1:] == ("0/4", *["-"] * 6, "0", "held pivot", "3/4", "1")
