"""The Cramer-Rao bound of a run, against known values and against estimates."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from campaign_rigs import standard_motion
from scipy.optimize import least_squares

from bench.campaign.bound import cramer_rao
from bench.campaign.motion import integrate
from pvid.core.native import Native
from pvid.sim.pendulum import STANDARD_PENDULUM, Pendulum

NOISE = math.sqrt(1 / 12 + 1 / 4) * 2 * math.pi / 2**14


def standard_bound(native: Native, *, scale: float = 1.0, duration: float = 40.0, **settings: object) -> np.ndarray:
    state, acceleration, step_s = standard_motion(native, duration, scale)
    arguments = {"density": 1000 * step_s, "noise": NOISE * scale, **settings}
    pendulum = arguments.pop("pendulum", STANDARD_PENDULUM)
    return cramer_rao(native, pendulum, state[0], acceleration, step_s, **arguments)  # type: ignore[arg-type]


def test_small_angles_of_the_standard_rig_have_the_bound_of_the_theory(native: Native) -> None:
    # theory.md 6; angles and noise a hundredth, where the equations are linear
    assert 100 * standard_bound(native, scale=0.01) == pytest.approx([0.0082, 0.0086, 0.0168], abs=5e-5)


def test_full_equations_of_the_standard_rig_have_the_known_bound(native: Native) -> None:
    # measured with another program at 0.108 rad: .0085 / .0089 / .0175 %
    assert 100 * standard_bound(native) == pytest.approx([0.0085, 0.0089, 0.0175], abs=1e-4)


def test_the_bound_follows_noise_and_samples(native: Native) -> None:
    once = standard_bound(native, duration=5.0)
    state, acceleration, step_s = standard_motion(native, 5.0)
    finer = cramer_rao(
        native, STANDARD_PENDULUM, state[0], acceleration, step_s, density=4000 * step_s, noise=NOISE / 4
    )
    assert finer == pytest.approx(once / 8, rel=1e-9)


def test_unknown_friction_makes_it_wider(native: Native) -> None:
    damped = replace(STANDARD_PENDULUM, damping1=1e-3, damping2=1e-4)
    without = standard_bound(native, duration=10.0)
    with_viscous = standard_bound(native, duration=10.0, pendulum=damped)
    with_dry = standard_bound(native, duration=10.0, dry=(1e-4, 1e-4), slip=0.01)
    assert (with_viscous > without).all() and (with_dry > without).all()


def test_run_without_drive_does_not_identify_w(native: Native) -> None:
    """One mode in free motion: amplitude and frequency do not tell three parameters."""
    acceleration = np.zeros(2 * 2000 + 1)
    bound = cramer_rao(
        native, STANDARD_PENDULUM, [1e-3, 2e-3, 0, 0], acceleration, 2.5e-3, density=2.5, noise=1e-2 * NOISE
    )
    assert not (bound < 1.0).all()


def test_least_squares_estimates_scatter_as_wide_as_the_bound(native: Native) -> None:
    state, acceleration, step_s = standard_motion(native, 5.0)
    bound = cramer_rao(native, STANDARD_PENDULUM, state[0], acceleration, step_s, density=1.0, noise=NOISE)
    phi = state[:, 1] - state[:, 0]
    truth = STANDARD_PENDULUM.linear
    sizes = np.array([1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3])

    def residuals(unknown: np.ndarray, measured: np.ndarray) -> np.ndarray:
        q = sizes * unknown
        pendulum = Pendulum.from_linear(truth * np.exp(q[:3]), 0.3)
        moved = integrate(native, pendulum, state[0] + q[4:], acceleration, step_s)
        assert moved is not None
        return np.asarray((moved[:, 1] - moved[:, 0] + q[3] - measured) / NOISE)

    random = np.random.default_rng(1)
    seeds = 60
    errors = []
    for _ in range(seeds):
        measured = phi + NOISE * random.standard_normal(len(phi))
        errors.append(sizes[:3] * least_squares(residuals, np.zeros(8), args=(measured,), method="lm").x[:3])
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / bound
    # of 60 seeds: standard deviation 1 / sqrt(120) of an rms, three parameters
    assert ratio == pytest.approx(1.0, abs=3 / math.sqrt(2 * seeds))
