"""What the strong form is worth: the core against the float64 oracle and against the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.strong_pendulum import identify
from pvid.core.native import Native
from pvid.oracle import strong as oracle
from pvid.rig.file import Core, RigFile
from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import GateConfig
from pvid.setup.f32 import strong_config
from pvid.sim.pendulum import STANDARD_PENDULUM, Simulation, simulate, standard_sensors, standard_start
from pvid.twin.kapitza.strong import regressors
from pvid.twin.strong import StrongTwin

TRUTH = STANDARD_PENDULUM.linear
STANDARD = RigFile.standard()
STRONG = replace(STANDARD, identifier=replace(STANDARD.identifier, form="strong"))


@pytest.fixture(scope="module")
def exact() -> tuple[np.ndarray, np.ndarray]:
    """Exact derivatives of the standard rig: phi [40001, 5] and u [40001, 3]."""
    found = simulate(truth="linear").exact
    assert found is not None
    return found.phi, found.u


def errors_of(native: Native, exact: tuple[np.ndarray, np.ndarray], seed: int, law: Law, exact_every: int) -> float:
    """Largest relative error of the final p from a start."""
    config = replace(strong_config(STRONG, 1000.0, standard_start(seed)), exact_every=exact_every)
    config = replace(config, estimator=replace(config.estimator, law=law), gate=GateConfig())
    record = native.of_derivatives(config).run(*exact, sums=False, hashes=False)
    return float(np.abs(record.p[-1] / TRUTH - 1).max())


@pytest.mark.parametrize("exact_every", [1, 8])
def test_exact_derivatives_stationary_law_reaches_a_hundredth_of_a_percent_from_all_starts(
    native: Native, exact: tuple[np.ndarray, np.ndarray], exact_every: int
) -> None:
    assert max(errors_of(native, exact, seed, Law.STATIONARY, exact_every) for seed in range(40)) < 1e-4


def test_exact_derivatives_pseudovelocity_law_stops_short_of_it(
    native: Native, exact: tuple[np.ndarray, np.ndarray]
) -> None:
    """theory.md 4: (5) alone leaves F where the early steps put it; `pvid bench laws` prints the whole table."""
    assert sum(errors_of(native, exact, seed, Law.PSEUDOVELOCITY, 0) < 1e-4 for seed in range(40)) <= 10


def test_twenty_bit_sensor_savitzky_golay_within_a_tenth_of_a_percent_in_w(native: Native) -> None:
    for seed in range(5):
        run = simulate(sensors=standard_sensors(20), truth="linear", seed=seed).run
        result = identify(run, STRONG, native, start=standard_start(seed))
        assert abs(result.value["w"] / TRUTH[0] - 1) < 1e-3


def test_core_is_as_near_the_oracle_as_its_conditioning_allows(native: Native, standard_20_bits: Simulation) -> None:
    """Final p of float32 against the float64 solution of the same rows.

    Each sum is exact to about 2 ulp (two levels), each entry of F to a few ulp of its largest term t, so F is known
    to eps_F = 16 * 2^-24 * t; the solution moves by S^-1 F. Relative to p that is |S^-1| |eps_F| / p, computed here
    in float64 from the same sums; nothing is tuned.
    """
    run = standard_20_bits.run
    config = strong_config(STRONG, 1000.0, standard_start(3))
    rows, row_reason = StrongTwin(config).rows(run.phi, run.y)
    n32, y32 = regressors(rows)
    ready = row_reason == Reason.UPDATED
    n, y = n32[ready].astype(np.float64), y32[ready].astype(np.float64)
    n = n * oracle.BINOMIAL
    m, b = n.T @ n, n.T @ y
    reference = oracle.constrained_least_squares(m, b, TRUTH)
    identifier = native.identifier(config)
    record = identifier.run(run.phi, run.y, sums=False, hashes=False)
    jacobian = oracle.jacobian(reference)
    s = jacobian.T @ m @ jacobian
    largest_term = np.abs(jacobian).T @ np.maximum(np.abs(b), np.abs(m) @ np.abs(oracle.theta(reference)))
    bound = np.abs(np.linalg.inv(s)) @ (16 * 2.0**-24 * largest_term)
    assert (np.abs(record.p[-1] - reference) < bound).all(), (record.p[-1] - reference, bound)
    assert (bound < 0.05 * reference).all()  # the bound itself says something


def test_standard_errors_and_kappa_agree_with_the_oracle(native: Native, standard_20_bits: Simulation) -> None:
    run = standard_20_bits.run
    config = strong_config(STRONG, 1000.0)
    identifier = native.identifier(config)
    identifier.run(run.phi, run.y, sums=False, hashes=False)
    last = identifier.assess()
    rows, row_reason = StrongTwin(config).rows(run.phi, run.y)
    n32, y32 = regressors(rows)
    ready = row_reason == Reason.UPDATED
    n = n32[ready].astype(np.float64) * oracle.BINOMIAL
    y = y32[ready].astype(np.float64)
    p = last["p"][:3].astype(np.float64)
    estimate = oracle.assess(
        p,
        n.T @ n,
        n.T @ y,
        float(y @ y),
        float(len(y)),
        config.estimator.start_sd,
        config.estimator.correlation,
    )
    # s^2 is a difference of sums that agree to about 1e-3: float32 keeps four digits of it
    np.testing.assert_allclose(last["se"][:3], estimate.se, rtol=0.02)
    np.testing.assert_allclose(last["kappa"], estimate.kappa, rtol=0.01)


@pytest.mark.parametrize("core", ["f32", "f64"])
@pytest.mark.parametrize("bits", [14, 20])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_without_drive_the_start_is_held_and_reported(native: Native, core: Core, bits: int, seed: int) -> None:
    """The noise of a still pivot sensor, differentiated, must not pass for a drive (w came out 93 % off)."""
    rig = replace(STRONG, identifier=replace(STRONG.identifier, core=core))
    run = simulate(drive=(), sensors=standard_sensors(bits), truth="linear", duration=6.0, seed=seed).run
    start = standard_start(seed)
    result = identify(run, rig, native, start=start)
    assert not result.identified
    assert result.reason == Reason.HELD_NOT_EXCITED
    np.testing.assert_array_equal([result.value[name] for name in ("w", "d1", "d2")], start.astype(np.float32))
    assert result.se["w"] == pytest.approx(0.5 * start[0], rel=1e-6)
