"""What the sensors of a random rig record: the motion, and each imperfection by what it does."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign_rigs import MOTION, RELEASE, RIG, standard_motion

from bench.campaign.motion import accelerations, integrate, relative_angle
from bench.campaign.pivot import PivotMotion
from bench.campaign.population import RandomRig, parse, shipped
from bench.campaign.truth import kept_rig, measure, rig_file, simulate_rig
from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.sim.pendulum import STANDARD_PENDULUM, Pendulum, Sensors, simulate

AT_REST = PivotMotion(np.zeros((0, 3)))


def test_the_motion_is_that_of_the_simulated_rig(native: Native) -> None:
    state, _, step_s = standard_motion(native, 10.0)
    other = simulate(sensors=Sensors(), truth="full", release=RELEASE, duration=10.0)
    phi = relative_angle(state, step_s, other.run.t)
    # a five hundredth of the LSB of 17 bits
    assert np.abs(phi - (other.state[:, 1] - other.state[:, 0])).max() < 2e-7


def test_viscous_friction_is_that_of_the_simulated_rig(native: Native) -> None:
    damped = replace(STANDARD_PENDULUM, damping1=2e-3, damping2=5e-4)
    _, acceleration, step_s = standard_motion(native, 10.0)
    state = integrate(native, damped, [*RELEASE, 0, 0], acceleration, step_s)
    assert state is not None
    other = simulate(damped, sensors=Sensors(), truth="full", release=RELEASE, duration=10.0)
    assert np.abs(relative_angle(state, step_s, other.run.t) - (other.state[:, 1] - other.state[:, 0])).max() < 2e-7


def energy(state: np.ndarray, pendulum: Pendulum) -> np.ndarray:
    a1, a2, v1, v2 = state.T
    l1, l2 = pendulum.l1, pendulum.l2
    kinetic = (l1 * v1) ** 2 / 2 + (l2**2 + pendulum.rho2**2) * v2**2 / 2 + l1 * l2 * np.cos(a1 - a2) * v1 * v2
    return np.asarray(kinetic - pendulum.g * (l1 * np.cos(a1) + l2 * np.cos(a2)))


def test_dry_friction_takes_energy_at_the_rate_of_the_links_and_nothing_else_does(native: Native) -> None:
    acceleration = np.zeros(2 * 4000 + 1)
    start, dry, slip = [0.1, 0.2, 0.0, 0.0], (1e-3, 5e-4), 1e-3
    free = integrate(native, STANDARD_PENDULUM, start, acceleration, 1e-3)
    held = integrate(native, STANDARD_PENDULUM, start, acceleration, 1e-3, dry=dry, slip=slip)
    assert free is not None and held is not None
    assert np.ptp(energy(free, STANDARD_PENDULUM)) < 1e-9
    rates = np.column_stack([held[:, 2], held[:, 3] - held[:, 2]])
    power = (np.array(dry) * rates * np.tanh(rates / slip)).sum(axis=1)
    lost = energy(held, STANDARD_PENDULUM)[0] - energy(held, STANDARD_PENDULUM)[-1]
    assert lost == pytest.approx(np.sum((power[1:] + power[:-1]) / 2) * 1e-3, rel=1e-3)


def test_a_slanted_drive_pushes_sideways(native: Native) -> None:
    """A pendulum at rest stays at rest under a vertical drive, and is pushed by -sin(slant) y'' under a slanted one."""
    step_s = 1e-3
    acceleration = accelerations(MOTION, 100, step_s)
    upright = integrate(native, STANDARD_PENDULUM, np.zeros(4), acceleration, step_s)
    pushed = integrate(native, STANDARD_PENDULUM, np.zeros(4), acceleration, step_s, slant=0.02)
    assert upright is not None and pushed is not None
    assert not upright.any()
    # in the first step nothing but the push acts on either link: M a'' = -(l1, l2) across
    l1, l2, rho2 = STANDARD_PENDULUM.l1, STANDARD_PENDULUM.l2, STANDARD_PENDULUM.rho2
    mass = np.array([[l1 * l1, l1 * l2], [l1 * l2, l2 * l2 + rho2 * rho2]])
    wanted = np.linalg.solve(mass, -np.array([l1, l2]) * math.sin(0.02) * acceleration[1])
    assert pushed[1, 2:] / step_s == pytest.approx(wanted, rel=1e-3, abs=1e-5)  # the mean over a step: of its middle


def test_diverging_motion_is_refused(native: Native) -> None:
    acceleration = 300.0 * np.sin(2 * math.pi * 1.5 * np.arange(20001) * 5e-4)
    assert integrate(native, STANDARD_PENDULUM, [0.1, 0.1, 0, 0], acceleration, 1e-3) is None


# ---- sensors


def counts(native: Native, rig: RandomRig) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Measured phi [rad] and y [m], and the true ones at the nominal instants."""
    state, _, step_s = standard_motion(native, rig.duration + 0.001)
    phi, y = measure(rig, state, step_s)
    t = np.arange(len(phi)) / rig.sample_rate
    return rig.phi_lsb * phi, rig.y_lsb * y, relative_angle(state, step_s, t), MOTION.position(t)


# 23 bits and 1 nm, so that nothing but the imperfection shows
FINE = replace(RIG, bits=23, y_lsb=1e-9)
LSB = FINE.phi_lsb


def test_sensors_round_and_are_noisy(native: Native) -> None:
    phi, y, true_phi, true_y = counts(native, RIG)
    # rounding and noise, 10 000 samples: 0.7 % of standard deviation
    assert np.std(phi - true_phi) == pytest.approx(RIG.phi_lsb * math.sqrt(1 / 12 + 0.25), rel=0.03)
    assert np.std(y - true_y) == pytest.approx(RIG.y_lsb * math.sqrt(1 / 12 + 0.16), rel=0.03)


def test_the_reading_at_rest_is_added(native: Native) -> None:
    phi, _, true_phi, _ = counts(native, replace(FINE, zero=-0.07))
    assert phi - true_phi == pytest.approx(-0.07, abs=4 * LSB)


def test_skew_samples_the_pivot_later(native: Native) -> None:
    phi, y, true_phi, _ = counts(native, replace(FINE, skew=2e-3))
    assert phi == pytest.approx(true_phi, abs=4 * LSB)
    assert y == pytest.approx(MOTION.position(np.arange(len(y)) / 1000 + 2e-3), abs=4e-9)


def test_gain_scales_the_pivot(native: Native) -> None:
    _, y, _, true_y = counts(native, replace(FINE, gain=-0.01))
    assert y == pytest.approx(0.99 * true_y, abs=4e-9)


def test_jitter_moves_both_sensors_by_the_same_instant(native: Native) -> None:
    phi, y, true_phi, true_y = counts(native, replace(FINE, jitter=0.1))
    delay_y, delay_phi = (y - true_y) / np.gradient(true_y, 1e-3), (phi - true_phi) / np.gradient(true_phi, 1e-3)
    moving = (np.abs(np.gradient(true_y, 1e-3)) > 0.03) & (np.abs(np.gradient(true_phi, 1e-3)) > 0.1)
    moving[:2] = False  # an instant before the first sample counts as that
    assert delay_phi[moving] == pytest.approx(delay_y[moving], abs=2e-5)
    assert np.std(delay_phi[moving]) == pytest.approx(1e-4, rel=0.05)


def test_backlash_lags_by_half_the_play_on_either_side(native: Native) -> None:
    phi, _, true_phi, _ = counts(native, replace(FINE, backlash=1e-3))
    lag = phi - true_phi
    assert np.abs(lag).max() < 5e-4 + 4 * LSB
    moving = np.abs(np.gradient(true_phi, 1e-3)) > 0.3
    assert np.quantile(lag[moving], 0.02) == pytest.approx(-5e-4, abs=4 * LSB)
    assert np.quantile(lag[moving], 0.98) == pytest.approx(5e-4, abs=4 * LSB)


def test_hysteresis_is_a_play_in_counts(native: Native) -> None:
    phi, _, true_phi, _ = counts(native, replace(RIG, hysteresis=3.0, phi_noise=0.0))
    lag = (phi - true_phi) / RIG.phi_lsb
    assert np.abs(lag).max() < 3.5 + 1e-6 and np.abs(lag).max() > 3.0


def test_eccentricity_is_a_once_a_turn_error_that_is_0_at_rest(native: Native) -> None:
    phi, _, true_phi, _ = counts(native, replace(FINE, eccentricity=0.02, eccentric_at=1.0))
    wanted = 0.02 * (np.sin(true_phi + 1.0) - math.sin(1.0))
    assert phi - true_phi == pytest.approx(wanted, abs=4 * LSB)


# ---- rigs


def test_a_rig_is_simulated_alike_every_time(native: Native) -> None:
    one, other = (simulate_rig(native, shipped(), 6, 3) for _ in range(2))
    assert np.array_equal(one.run.phi, other.run.phi) and np.array_equal(one.run.y, other.run.y)
    assert np.array_equal(one.bound, other.bound)


def test_a_kept_rig_is_the_simulated_one(native: Native, tmp_path: Path) -> None:
    fresh = simulate_rig(native, shipped(), 6, 0)
    for _ in range(2):
        kept = kept_rig(native, shipped(), 6, 0, tmp_path / "cache")
        assert np.array_equal(kept.run.phi, fresh.run.phi) and np.array_equal(kept.run.y, fresh.run.y)
        assert np.array_equal(kept.bound, fresh.bound) and kept.file == fresh.file and kept.largest == fresh.largest
    assert len(list((tmp_path / "cache").iterdir())) == 1


def test_campaign_rig_file_contains_rod_1_sensors_and_guess_only() -> None:
    tilted = replace(RIG, pendulum=replace(STANDARD_PENDULUM, g=6.0))
    file = rig_file(tilted)
    assert file.known == {"l1": 0.3}
    assert file.sensor == {"phi": {"resolution": RIG.phi_lsb}, "y": {"resolution": RIG.y_lsb}}
    assert file.nominal == {"l2": 0.1, "rho2": 0.1, "g": 9.8}
    assert file.sample_rate == 1000.0


def test_angles_stay_in_the_condition_s_range(native: Native) -> None:
    text = "[base]\nduration = [5, 20]\n[conditions.small]\n[conditions.large]\nangle = [0.12, 0.35]\n"
    for index in range(20):
        simulated = simulate_rig(native, parse(text), 1, index)
        assert simulated.largest <= (0.12 if simulated.rig.condition == "small" else 0.35)
        assert np.abs(simulated.run.phi - simulated.rig.zero).max() <= simulated.largest + 4 * simulated.rig.phi_lsb


def test_a_population_that_cannot_be_drawn_is_a_sentence(native: Native) -> None:
    slow = parse("[conditions.slow]\nsample_rate = [5]\n")
    with pytest.raises(PvidError, match="rig 0 of condition slow cannot be drawn"):
        simulate_rig(native, slow, 1, 0)
