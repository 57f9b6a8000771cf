"""What the strong form is worth: the core against the float64 oracle and against the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pvid.core.native import Native
from pvid.oracle import strong as oracle
from pvid.rig.file import Core, RigFile
from pvid.run.identify import identify
from pvid.settings.enums import Law, Reason
from pvid.settings.f32 import EstimatorConfig
from pvid.setup.f32 import bank_of, estimator_config, strong_config
from pvid.sim.pendulum import STANDARD_PENDULUM, Simulation, simulate, standard_sensors, standard_start
from pvid.twin.strong import StrongTwin

TRUTH = STANDARD_PENDULUM.linear
STANDARD = RigFile.standard()
STRONG = replace(STANDARD, identifier=replace(STANDARD.identifier, form="strong"))


@pytest.fixture(scope="module")
def exact_rows(native: Native) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the standard rig from exact derivatives: N [40001, 11], Y, float32."""
    exact = simulate(truth="linear").exact
    assert exact is not None
    return native.strong_rows(exact.phi, exact.u)


def settings(start: np.ndarray, **changes: object) -> EstimatorConfig:
    return replace(estimator_config(STRONG, bank_of(STRONG, 1000.0), start), **changes)  # type: ignore[arg-type]


def test_exact_derivatives_stationary_law_reaches_a_hundredth_of_a_percent_from_all_starts(
    native: Native, exact_rows: tuple[np.ndarray, np.ndarray]
) -> None:
    n, y = exact_rows
    errors = []
    for seed in range(40):
        core = native.estimator(settings(standard_start(seed), law=Law.STATIONARY), 1000.0)
        record = core.run(n, y, sums=False, hashes=False)
        errors.append(np.abs(record.p[-1] / TRUTH - 1).max())
    assert max(errors) < 1e-4


def test_exact_derivatives_pseudovelocity_law_stops_short_of_it(
    native: Native, exact_rows: tuple[np.ndarray, np.ndarray]
) -> None:
    """theory.md 4: (5) alone leaves F where the early steps put it; `pvid bench laws` prints the whole table."""
    n, y = exact_rows
    reached = 0
    for seed in range(40):
        core = native.estimator(settings(standard_start(seed), law=Law.PSEUDOVELOCITY), 1000.0)
        record = core.run(n, y, sums=False, hashes=False)
        reached += np.abs(record.p[-1] / TRUTH - 1).max() < 1e-4
    assert reached <= 10


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
    n32, y32, row_reason = StrongTwin(config).rows(run.phi, run.y)
    ready = row_reason == Reason.ACCUMULATED
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
    n32, y32, row_reason = StrongTwin(config).rows(run.phi, run.y)
    ready = row_reason == Reason.ACCUMULATED
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
    assert result.status == "held not excited"
    np.testing.assert_array_equal([result.value[name] for name in ("w", "d1", "d2")], start.astype(np.float32))
    assert result.se["w"] == pytest.approx(0.5 * start[0], rel=1e-6)
