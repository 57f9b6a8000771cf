"""The noise inside the weak form's rows: its moments are those predicted, and taking them off takes the bias off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.hard import Case
from bench.noise import CASES, HEADER, LABELS, Bias, errors_of, made_by_noise, row
from pvid.oracle.weak import WeakOracle, WeakSettings, columns, frames, front_end, identify_weak
from pvid.oracle.weak_noise import CompensatedOracle, kernels, noise_moments
from pvid.rig.file import RigFile
from pvid.setup.f32 import weak_design_of
from pvid.sim.pendulum import STANDARD_PENDULUM, Sensors, simulate, standard_start

DESIGN = weak_design_of(RigFile.standard(), 1000.0)
TRUTH = np.append(STANDARD_PENDULUM.linear, 0.0)
NOISE = 0.01  # rad, on every sample: 26 LSB of 14 bits


def test_the_columns_are_the_kernels_sums() -> None:
    """Y and N1..N5 are linear in phi: exact but for rounding."""
    random = np.random.default_rng(1)
    phi, u = random.standard_normal(DESIGN.window), 7 * random.standard_normal(DESIGN.window)
    expected = columns(phi[None], u[None], DESIGN)[0, :6]
    got = np.einsum("iwk,w->ik", kernels(u, DESIGN), phi)
    np.testing.assert_allclose(got, expected, atol=1e-11 * np.abs(expected).max(axis=1, keepdims=True).max())


def test_white_noise_on_the_samples_has_the_moments_predicted() -> None:
    """Noise for phi, the standard drive for y, at the true p: through the smoother and the decimation, 40 runs."""
    y = simulate(sensors=Sensors()).run.y
    settings = WeakSettings(TRUTH, NOISE / np.sqrt(DESIGN.decimation))
    oracle = WeakOracle(DESIGN, settings)
    random = np.random.default_rng(2)
    found, predicted = [], np.zeros((6, 6))
    for number in range(40):
        smooth, u = front_end(NOISE * random.standard_normal(len(y)), y, DESIGN)
        angles, drives = frames(smooth, DESIGN), frames(u, DESIGN)
        total = np.zeros((6, 6))
        for one, angle, drive in zip(columns(angles, drives, DESIGN), angles, drives, strict=True):
            x, inverse_factor = oracle.rows(one, angle, drive)
            total += x[:6] @ x[:6].T
            if number == 0:
                predicted += settings.row_sd**2 * noise_moments(drive, one, inverse_factor, DESIGN)
        found.append(total)
    scale = np.sqrt(np.outer(np.diag(predicted), np.diag(predicted)))
    spread = np.std(found, axis=0, ddof=1) / np.sqrt(len(found)) / scale
    off = (np.mean(found, axis=0) - predicted) / scale
    assert spread.max() < 0.03  # else the next line says nothing
    assert (np.abs(off) < 4 * spread).all(), (off.round(3), spread.round(3))  # 21 numbers


def test_taking_the_noise_off_takes_the_bias_off() -> None:
    """At 64 LSB: differences on 4 runs show the noise's share, as in the table; errors stay what they were."""
    case = next(one for one in CASES if one.label == "14 bits, noise of 64 LSB")
    plain, compensated = (errors_of(case, 4, kind) for kind in (WeakOracle, CompensatedOracle))
    share = made_by_noise(plain, compensated)
    # the table's: 0.40, -0.43, -0.48 of a standard error
    np.testing.assert_allclose(share, [0.40, -0.43, -0.48], atol=0.08)
    assert (np.abs(compensated.errors) < 4 * plain.middle).all()


def test_with_a_14_bit_encoder_there_is_nothing_to_take_off() -> None:
    plain, compensated = (errors_of(Case("14 bits"), 2, kind) for kind in (WeakOracle, CompensatedOracle))
    assert (np.abs(made_by_noise(plain, compensated)) < 0.02).all()


def test_noise_taken_for_information_is_not_divided_by() -> None:
    """A still pendulum: nothing is left of S; no step, nothing but finite numbers, p stays where it started."""
    run = simulate(release=(0.0, 0.0), duration=10.0, seed=1).run
    settings = WeakSettings(np.append(standard_start(1), 0.0), 2e-4)  # somewhat more than there is
    result = identify_weak(run.phi, run.y, DESIGN, settings, CompensatedOracle)
    assert np.isfinite(result.p).all()
    assert not result.updated.any()


def test_the_table_has_every_case_and_a_row_its_figures() -> None:
    assert tuple(case.label for case in CASES) == LABELS
    plain = Bias(np.full((2, 3), 0.03), np.full((2, 3), 0.01))
    compensated = replace(plain, errors=np.full((2, 3), 0.005))
    cells = row(CASES[0], 1, plain, compensated)
    assert len(cells) == len(HEADER)
    assert cells[1:] == ("1/2", "3/3/3", "0.5/0.5/0.5", "1/1/1", "2.500/2.500/2.500")


def test_rows_must_come_before_their_sum() -> None:
    oracle = CompensatedOracle(DESIGN, WeakSettings(TRUTH, 1e-4))
    with pytest.raises(AssertionError):
        oracle.add(np.zeros((9, 12)), np.eye(12))
