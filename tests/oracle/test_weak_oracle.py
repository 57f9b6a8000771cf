"""The float64 weak form against exact signals, brute force and the truth; and the C core against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.design.weak import WeakDesign, design
from pvid.design.weak_sizing import Bounds, Sizes
from pvid.models.kapitza.physical import linear, physical
from pvid.oracle import weak
from pvid.settings.enums import Reason
from pvid.settings.f32 import EstimatorConfig, TrustConfig, WeakConfig
from pvid.sim.pendulum import (
    STANDARD_PENDULUM,
    Sensors,
    simulate,
    standard_sensors,
    standard_start,
)

TRUTH = STANDARD_PENDULUM.linear
NOMINAL = linear(9.8, 0.1, 0.1, 0.3)
LSB_14 = 2 * np.pi / 2**14


@pytest.fixture(scope="module")
def standard() -> WeakDesign:
    return design(0.3, 1000.0, NOMINAL)


def settings(tables: WeakDesign, seed: int, bits: int = 14, zero: bool = True, **more: object) -> weak.WeakSettings:
    start = np.append(standard_start(seed), [0.0] * zero)
    return weak.WeakSettings(start, weak.row_sd(tables, standard_sensors(bits)), **more)  # type: ignore[arg-type]


def errors(tables: WeakDesign, seeds: int, sensors: Sensors, **more: object) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors of w, d1, d2 after standard runs, and errors over standard errors, [seeds, 3]."""
    relative, standardised = [], []
    for seed in range(seeds):
        run = simulate(sensors=sensors, seed=seed).run
        last = weak.identify_weak(run.phi, run.y, tables, settings(tables, seed, **more)).last  # type: ignore[arg-type]
        relative.append(last.p[:3] / TRUTH - 1)
        standardised.append((last.p[:3] - TRUTH) / last.se[:3])
    return np.array(relative), np.array(standardised)


def test_jacobian_is_the_derivative_of_theta() -> None:
    for p in (np.array([30.0, 9.0, 5.0]), np.array([30.0, 9.0, 5.0, 0.03])):
        for k, step in enumerate(1e-6 * np.maximum(p, 0.1)):
            up, down = p.copy(), p.copy()
            up[k] += step
            down[k] -= step
            slope = (weak.theta(up) - weak.theta(down)) / (2 * step)
            # theta has degree 4 at most: the difference's error is that of rounding, 1e-16 / 1e-6
            np.testing.assert_allclose(weak.jacobian(p)[:, k], slope, rtol=1e-7, atol=1e-7 * np.abs(slope).max())


def test_double_integral_of_a_sine() -> None:
    """Without its constant and line the error is of fourth order: halving dt divides it by 16."""
    worst = []
    for dt in (0.016, 0.008):
        t = np.arange(0, 1.2 + dt / 2, dt)
        error = weak.integrated_twice(np.sin(15 * t), dt) + np.sin(15 * t) / 15**2
        line = np.polynomial.Polynomial.fit(t, error, 1)
        worst.append(np.abs(error - line(t)).max())
    assert worst[1] < 1e-6 / 15**2 * 200  # (omega dt)^4 / 240 of the amplitude 1/omega^2
    assert worst[0] / worst[1] == pytest.approx(16, rel=0.1)


@pytest.mark.parametrize("c", [0.0, 0.05])
def test_rows_hold_for_exact_signals(standard: WeakDesign, c: float) -> None:
    """Y = N^T theta + a A + b B on exact samples, but for the errors of quadrature and smoother."""
    run = simulate(sensors=Sensors(phi_zero=c)).run
    finer = design(0.3, 1000.0, NOMINAL, Sizes(decimation=4, taps=81, pass_hz=20.0), bounds=Bounds(window=451))
    worst = []
    for tables in (standard, finer):
        phi, u = weak.front_end(run.phi, run.y, tables)
        windows = weak.columns(weak.frames(phi, tables), weak.frames(u, tables), tables)
        th = weak.theta(np.append(TRUTH, c))
        left = []
        for window in windows:
            rows = weak.without_directions(window[:9], window[[weak.A, weak.B]])
            left.append(np.sqrt(np.mean((rows[0] - th @ rows[1:]) ** 2)))
        worst.append(max(left))
        assert np.abs(windows[:, weak.Y]).max() > 0.02  # what the residuals are to be compared with
    assert worst[0] < 1e-6  # an eightieth of what the noise of a 14-bit encoder leaves
    assert worst[1] < worst[0] / 4  # of quadrature and filters; a mistake in a formula would stay


def test_ignoring_a_column_is_noticed(standard: WeakDesign) -> None:
    """The test above can fail: without any one of the eight columns the rows do not hold."""
    run = simulate(sensors=Sensors(phi_zero=0.05)).run
    phi, u = weak.front_end(run.phi, run.y, standard)
    window = weak.columns(weak.frames(phi, standard), weak.frames(u, standard), standard)[5]
    rows = weak.without_directions(window[:9], window[[weak.A, weak.B]])
    th = weak.theta(np.append(TRUTH, 0.05))
    for k in range(8):
        without = np.where(np.arange(8) == k, 0.0, th)
        assert np.sqrt(np.mean((rows[0] - without @ rows[1:]) ** 2)) > 2e-4, k


def test_whitened_rows_have_the_noise_they_are_said_to_have(standard: WeakDesign) -> None:
    """White noise alone, through the front end, at a p away from the nominal: covariance row_sd^2 times 1."""
    p = TRUTH
    random = np.random.default_rng(3)
    noise = random.standard_normal(300_000)
    phi, _ = weak.front_end(noise, np.zeros_like(noise), standard)
    filters = weak.residual_filters(standard, p)
    inverse = np.linalg.inv(np.linalg.cholesky(weak.noise_gram(standard, p)))
    rows = weak.frames(phi, standard) @ filters @ inverse.T
    covariance = rows.T @ rows / len(rows)
    # rounding alone, then with a variance of 1
    expected = weak.row_sd(standard, Sensors(phi_lsb=np.sqrt(12))) ** 2
    # 350 half-overlapping windows: an entry is known to 1 / sqrt(350) = 5.3 %; of 100 some are 3.5 times that
    np.testing.assert_allclose(covariance, expected * np.eye(standard.functions), atol=0.25 * expected)
    # the smoother lets the rows' frequencies pass, but for the edges that the weights at the ends make
    assert expected == pytest.approx(1 / standard.decimation, rel=0.03)


def test_starts_off_by_half_converge_to_one_answer(standard: WeakDesign) -> None:
    run = simulate(seed=0).run
    ends = [weak.identify_weak(run.phi, run.y, standard, settings(standard, s)).last for s in range(10)]
    for last in ends[1:]:
        # the first windows are whitened at the start's own p: a different weighting of the same data
        assert np.all(np.abs(last.p - ends[0].p) < ends[0].se)


@pytest.mark.parametrize(
    ("bits", "allowed"), [(12, (0.06, 0.06, 0.15)), (14, (0.014, 0.014, 0.036)), (16, (0.009, 0.009, 0.02))]
)
def test_accuracy_is_within_its_requirement(
    standard: WeakDesign, bits: int, allowed: tuple[float, float, float]
) -> None:
    relative, standardised = errors(standard, 10, standard_sensors(bits), bits=bits)
    # ten seeds know an RMS to 22 %; the limits are 1.2 to 1.9 times what 60 seeds measure
    assert (100 * np.sqrt(np.mean(relative**2, axis=0)) < allowed).all()
    assert np.abs(standardised).max() < 4


def test_the_zero_is_found_and_costs_nothing(standard: WeakDesign) -> None:
    plain, _ = errors(standard, 5, standard_sensors(14))
    moved, _ = errors(standard, 5, replace(standard_sensors(14), phi_zero=0.02))
    np.testing.assert_allclose(moved, plain, atol=1e-5)  # a tenth of the error itself
    run = simulate(sensors=replace(standard_sensors(14), phi_zero=0.02), seed=0).run
    last = weak.identify_weak(run.phi, run.y, standard, settings(standard, 0)).last
    assert last.p[3] == pytest.approx(0.02, abs=LSB_14 / 2)  # the grid lies at random within half an LSB
    ignored = weak.identify_weak(run.phi, run.y, standard, settings(standard, 0, zero=False)).last
    assert abs(ignored.p[2] / TRUTH[2] - 1) > 0.5


def test_full_angles_are_corrected(standard: WeakDesign) -> None:
    for seed in range(3):
        run = simulate(truth="full", seed=seed).run
        plain = weak.identify_weak(run.phi, run.y, standard, settings(standard, seed)).last
        result = weak.identify_weak(run.phi, run.y, standard, settings(standard, seed, full_angle=True))
        assert abs(plain.p[0] / TRUTH[0] - 1) > 3e-3  # the bias is there
        assert abs(result.last.p[0] / TRUTH[0] - 1) < 6e-4  # an RMS of 0.04 %, times 1.5
        l2 = physical(result.last.p[:3], 0.3)[1]
        assert abs(l2 / 0.12 - 1) < 3.75e-3
        assert result.valid
        assert not result.corrected[:4].any() and result.corrected[-1]


def test_damping_is_estimated(standard: WeakDesign) -> None:
    damped = replace(STANDARD_PENDULUM, damping1=1e-4, damping2=1e-4)
    for seed in range(2):
        run = simulate(damped, truth="full", seed=seed).run
        more = settings(standard, seed, full_angle=True, damping=True)
        last = weak.identify_weak(run.phi, run.y, standard, more).last
        assert abs(last.p[0] / TRUTH[0] - 1) < 6.75e-4  # an RMS of 0.045 %, times 1.5
        assert abs(physical(last.p[:3], 0.3)[1] / 0.12 - 1) < 3.75e-3
        assert last.p[5] == pytest.approx(1e-4, rel=0.2)  # 5 s.e.; that of the pivot is biased (see the docs)
        # with the exact linear truth as well, the damping's columns find nothing where there is none
    run = simulate(seed=0).run
    last = weak.identify_weak(run.phi, run.y, standard, settings(standard, 0, damping=True)).last
    assert abs(last.p[5]) < 2e-5


def test_large_angles_are_not_valid(standard: WeakDesign) -> None:
    run = simulate(release=(0.15, 0.36), truth="full", duration=10.0).run  # 0.28 rad
    assert not weak.identify_weak(run.phi, run.y, standard, settings(standard, 0, full_angle=True)).valid


def test_misfit_is_one_when_the_model_holds_and_large_when_not(standard: WeakDesign) -> None:
    sensors = standard_sensors(12)  # where the pivot sensor's noise adds nothing
    run = simulate(sensors=sensors, seed=0).run
    result = weak.identify_weak(run.phi, run.y, standard, settings(standard, 0, bits=12))
    # 35 windows of 8 degrees of freedom: known to sqrt(2/280) = 8 %, and R0 leaves out u
    assert result.misfit[10:].mean() == pytest.approx(1.0, abs=0.3)
    damped = replace(STANDARD_PENDULUM, damping1=1e-4, damping2=1e-4)
    run = simulate(damped, sensors=sensors, seed=0).run
    result = weak.identify_weak(run.phi, run.y, standard, settings(standard, 0, bits=12))
    assert result.misfit[10:].mean() > 3


def test_a_still_pivot_moves_nothing(standard: WeakDesign) -> None:
    run = simulate(drive=(), duration=10.0).run
    given = settings(standard, 0)
    result = weak.identify_weak(run.phi, run.y, standard, given)
    assert not result.updated.any()
    np.testing.assert_array_equal(result.last.p[:3], given.start[:3])  # the zero is that of the first window
    assert (result.last.se[:3] > 0.1 * given.start[:3]).all()
    gated = weak.identify_weak(run.phi, run.y, standard, replace(given, drive_min=0.37))
    np.testing.assert_array_equal(gated.last.se, gated.last.se * 0 + given.sd)


def test_forgetting_keeps_less(standard: WeakDesign) -> None:
    run = simulate(seed=1).run
    whole = weak.identify_weak(run.phi, run.y, standard, settings(standard, 1)).last
    short = weak.identify_weak(run.phi, run.y, standard, settings(standard, 1, forgetting_s=5.0)).last
    # 40 s of rows against 5 s of them: sqrt(8) = 2.8 when the motion is stationary, which it is only roughly
    assert 2 < (short.se[:3] / whole.se[:3]).mean() < 4


def test_unidentifiable_run_is_reported(standard: WeakDesign) -> None:
    given = settings(standard, 0)
    with pytest.raises(PvidError, match="smoothing window"):
        weak.identify_weak(np.zeros(10), np.zeros(10), standard, given)
    with pytest.raises(PvidError, match="longer"):
        weak.identify_weak(np.zeros(500), np.zeros(500), standard, given)
    with pytest.raises(PvidError, match="finite"):
        weak.identify_weak(np.full(5000, np.nan), np.zeros(5000), standard, given)


@pytest.mark.parametrize("zero", [True, False])
def test_the_core_gives_the_oracles_answer(native: Native, standard: WeakDesign, zero: bool) -> None:
    """Same samples, tables and settings: float32 against float64, window by window, within the noise."""
    run = simulate(seed=2).run
    given = settings(standard, 2, zero=zero)
    bound = np.append(20 * given.start[:3], [3.0] * zero)
    lower = np.append(given.start[:3] / 20, [-3.0] * zero)
    config = EstimatorConfig(
        start=given.start.astype(np.float32),
        start_sd=given.sd.astype(np.float32),
        lower=lower.astype(np.float32),
        upper=bound.astype(np.float32),
        row_sd=given.row_sd,
        kappa_min=given.kappa_min,
    )
    identifier = native.identifier(WeakConfig(1000.0, 0.3, standard.f32, config, zero, trust=TrustConfig(renewal=0.0)))
    record = identifier.run(run.phi, run.y, sums=False, hashes=False)
    answer = identifier.assess()
    result = weak.identify_weak(run.phi, run.y, standard, given)
    judged = (Reason.UPDATED, Reason.MISFIT, Reason.HELD_UNCERTAIN)
    worked_off = record.p[np.isin(record.reason, judged)]
    count = len(worked_off)
    assert count >= len(result.p) - 1  # the core may still be at work on the last one
    # the residuals are 1e-3 of Y, float32 knows Y to 1e-7: 1e-4 of an error, more where the sums are few
    assert (np.abs(worked_off - result.p[:count])[2:] < 0.02 * result.se[2:count]).all()
    # but the residuals' energy is what remains of sums that are 1e7 times as large: seeds 2 to 4 differ by up to 2.9 %
    np.testing.assert_allclose(answer["se"][: 3 + zero], result.se[count - 1], rtol=0.04)
