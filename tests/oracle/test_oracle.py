"""The float64 oracle against closed forms, finite differences and the truth of a simulated rig."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.oracle import strong as oracle
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_start

Float = npt.NDArray[np.float64]

TRUTH = STANDARD_PENDULUM.linear


@pytest.fixture(scope="module")
def rows() -> tuple[Float, Float]:
    """N [n, 11] and Y [n] of the standard rig from exact derivatives."""
    exact = simulate(truth="linear").exact
    assert exact is not None
    return oracle.strong_rows(exact.phi, exact.u)


@pytest.fixture(scope="module")
def sums(rows: tuple[Float, Float]) -> tuple[Float, Float, float]:
    n, y = rows
    return n.T @ n, n.T @ y, float(y @ y)


def around(start: Float, **changes: object) -> oracle.Settings:
    """Settings for a start that may be wrong by half; row_sd as pvid.setup.f32 gives it."""
    settings = oracle.Settings(
        start=start,
        start_sd=0.5 * start,
        lower=start / 20.0,
        upper=20.0 * start,
        row_sd=0.1 * float(start[0]) ** 4,
        rate=1000.0,
    )
    return replace(settings, **changes)  # type: ignore[arg-type]


# ---- section 2


def test_jacobian_is_the_derivative_of_theta_with_18_entries() -> None:
    """theta is a polynomial of degree 5 at most: complex steps give its derivative to rounding."""
    h = 1e-30
    c = oracle.jacobian(TRUTH)
    assert np.count_nonzero(c) == 18
    w, d1, d2 = TRUTH
    for i in range(3):
        q = [w + 0j, d1 + 0j, d2 + 0j]
        q[i] += 1j * h
        a, b, e = q
        theta = np.array([a, a**2, b, b * a, b * a**2, b * a**3, e, e * a, e * a**2, e * a**3, e * a**4])
        np.testing.assert_allclose(theta.real, oracle.theta(TRUTH), rtol=1e-14)
        np.testing.assert_allclose(theta.imag / h, c[:, i], rtol=1e-14)


def test_rows_of_a_true_motion_satisfy_the_model(rows: tuple[Float, Float]) -> None:
    n, y = rows
    largest = np.max(np.abs(n * oracle.theta(TRUTH)), axis=1)
    # Exact derivatives: only rounding is left, a few dozen eps of the largest of twelve terms.
    assert np.max(np.abs(y - n @ oracle.theta(TRUTH)) / largest) < 1e-13
    assert np.max(np.abs(y)) > 1e3  # and the rows are not all zero


def test_one_row_by_hand() -> None:
    """theory.md 2 with phi = (2, 0, 3, 5, 7), u = (1, 2, 4) and small whole numbers throughout."""
    n, y = oracle.strong_rows([[2.0, 99.0, 3.0, 5.0, 7.0]], [[1.0, 2.0, 4.0]])
    assert y[0] == 7 - 2 * 2 * 5 + (2 * 4 - 4) * 3
    assert n[0].tolist() == [-14 + 20 + 12, -7, -3, -9, -9, -3, -2, -8, -12, -8, -2]


# ---- section 4


def test_batch_solution_is_the_truth_for_exact_rows(sums: tuple[Float, Float, float]) -> None:
    m, b, _ = sums
    for seed in range(10):
        p = oracle.constrained_least_squares(m, b, standard_start(seed))
        # The rows are good to 1e-13; S (equilibrated) has a condition below 1e3, kappa takes two digits more.
        np.testing.assert_allclose(p, TRUTH, rtol=1e-8)


def test_feedback_vanishes_at_the_batch_solution(rows: tuple[Float, Float]) -> None:
    """With noise in Y the solution is not the truth, but F = C^T (B - M theta) is zero there."""
    n, y = rows
    noisy = y + 0.05 * np.std(y) * np.random.default_rng(5).standard_normal(y.size)
    m, b = n.T @ n, n.T @ noisy
    p = oracle.constrained_least_squares(m, b, TRUTH)
    assert np.max(np.abs(p / TRUTH - 1.0)) > 1e-6
    c = oracle.jacobian(p)
    f = c.T @ (b - m @ oracle.theta(p))
    terms = np.abs(c).T @ np.abs(b)
    assert np.max(np.abs(f) / terms) < 1e-11


@pytest.mark.parametrize("seed", range(4))
def test_stationary_law_ends_at_the_batch_solution(
    seed: int, rows: tuple[Float, Float], sums: tuple[Float, Float, float]
) -> None:
    n, y = rows[0][::4], rows[1][::4]
    result = oracle.identify_strong(n, y, around(standard_start(seed), rate=250.0))
    reference = oracle.constrained_least_squares(n.T @ n, n.T @ y, TRUTH)
    # H0 slows the step (S + H0 against S) but does not move its target, F = 0.
    np.testing.assert_allclose(result.p[-1], reference, rtol=1e-7)


def test_pseudovelocity_law_is_equation_5(rows: tuple[Float, Float]) -> None:
    """Three ticks recomputed by hand from the definitions, within the step limit and the bounds."""
    n, y = rows[0][1000:1003], rows[1][1000:1003]
    settings = around(1.02 * TRUTH, law="pseudovelocity", kappa_min=0.0)
    result = oracle.identify_strong(np.vstack([n, n[:2]]), np.concatenate([y, y[:2]]), settings)
    p = settings.start
    m = np.zeros((11, 11))
    h0 = np.diag((settings.row_sd / settings.start_sd) ** 2)
    for tick in range(3):
        c = oracle.jacobian(p)
        m += np.outer(n[tick], n[tick])
        e = y[tick] - n[tick] @ oracle.theta(p)
        p = p + np.linalg.inv(c.T @ m @ c + h0) @ c.T @ n[tick] * e
        # inv of an S that is not equilibrated: condition near 1e5, times eps
        np.testing.assert_allclose(result.p[tick], p, rtol=1e-9)
    assert np.max(np.abs(result.p[0] / settings.start - 1.0)) > 1e-9


def test_the_gain_between_the_laws() -> None:
    settings = around(TRUTH)
    assert settings.gain == 1.0
    assert replace(settings, law="pseudovelocity").gain == 0.0
    assert replace(settings, feedback_hz=10.0).gain == pytest.approx(0.01)
    assert replace(settings, feedback_hz=10.0, divider=5).gain == pytest.approx(0.05)
    assert replace(settings, feedback_hz=1e6).gain == 1.0


def test_a_step_is_limited_and_bounded(rows: tuple[Float, Float]) -> None:
    n, y = rows[0][:2000], rows[1][:2000]
    start = 0.4 * TRUTH
    settings = around(start, step_limit=0.1, upper=1.5 * start, kappa_min=0.0)
    p = np.vstack([start, oracle.identify_strong(n, y, settings).p])
    change = np.abs(np.diff(p, axis=0) / p[:-1])
    assert change.max() == pytest.approx(0.1, rel=1e-12)
    assert np.all(p <= settings.upper) and np.all(p >= settings.lower)
    assert np.any(p[-1] == settings.upper)


def test_forgetting_follows_a_change(rows: tuple[Float, Float]) -> None:
    """The second half of the data belongs to another w: only with forgetting is it found."""
    other = replace(STANDARD_PENDULUM, g=1.2 * STANDARD_PENDULUM.g)
    exact = simulate(pendulum=other, truth="linear").exact
    assert exact is not None
    n2, y2 = oracle.strong_rows(exact.phi, exact.u)
    pick = slice(0, 40000, 8)
    n = np.vstack([rows[0][pick], n2[pick]])
    y = np.concatenate([rows[1][pick], y2[pick]])
    settings = around(TRUTH, rate=125.0)
    kept = oracle.identify_strong(n, y, settings).p[-1]
    forgot = oracle.identify_strong(n, y, replace(settings, forgetting_s=2.0)).p[-1]
    # 40 s are 20 time constants: exp(-20) = 2e-9 of the old rows is left.
    np.testing.assert_allclose(forgot, other.linear, rtol=1e-6)
    assert np.max(np.abs(kept / other.linear - 1.0)) > 0.01


def test_the_divider_solves_every_so_many_rows(rows: tuple[Float, Float]) -> None:
    n, y = rows[0][:1000], rows[1][:1000]
    result = oracle.identify_strong(n, y, around(1.1 * TRUTH, divider=7, kappa_min=0.0))
    assert np.flatnonzero(result.updated).tolist() == list(range(6, 1000, 7))
    moved = np.any(np.diff(result.p, axis=0) != 0.0, axis=1)
    assert np.flatnonzero(moved).tolist() == [tick - 1 for tick in range(6, 1000, 7)]


def test_without_a_drive_the_estimate_is_held_at_its_start() -> None:
    """u = 0: the rows cannot tell w from d1, d2 (theory.md 4: kappa near 1e-16)."""
    exact = simulate(drive=(), truth="linear", duration=10.0).exact
    assert exact is not None
    n, y = oracle.strong_rows(exact.phi, exact.u)
    start = standard_start(2)
    # A start that is nearly unknown, so that the prior itself excites nothing.
    settings = around(start, start_sd=1e3 * start, row_sd=1e-3)
    result = oracle.identify_strong(n[::10], y[::10], replace(settings, rate=100.0))
    late = result.p[len(result.p) // 2 :]
    assert not result.updated[len(late) :].any()
    assert result.last.kappa < 1e-10


def test_kappa_is_the_schur_complement() -> None:
    root = np.array([[3.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.5, -1.0, 1.0]])
    s = root @ root.T
    expected = 1.0 / (np.linalg.inv(s)[0, 0] * s[0, 0])
    assert oracle.kappa_of(s) == pytest.approx(expected, rel=1e-13)
    scale = np.diag([1e-6, 1.0, 1e5])
    assert oracle.kappa_of(scale @ s @ scale) == pytest.approx(expected, rel=1e-12)
    assert oracle.kappa_of(np.zeros((3, 3))) == 0.0
    assert oracle.kappa_of(np.ones((3, 3))) == 0.0


def test_kappa_separates_a_driven_rig_from_a_resting_one(sums: tuple[Float, Float, float]) -> None:
    c = oracle.jacobian(TRUTH)
    assert oracle.kappa_of(c.T @ sums[0] @ c) > 1e-3  # theory.md 4: weak 1e-4, good 1e-2


def test_standard_errors_cover_the_truth(rows: tuple[Float, Float]) -> None:
    """White noise on Y, 60 seeds: 2 s.e. hold the truth as often as a normal variable does.

    180 trials of 95.4 %: expected 172, standard deviation below 5 with correlated parameters (60 independent
    seeds); four of them allowed.
    """
    n, y = rows[0][::40], rows[1][::40]
    m = n.T @ n
    covered, random = 0, np.random.default_rng(1)
    for _ in range(60):
        noisy = y + 0.02 * np.std(y) * random.standard_normal(y.size)
        b, yy = n.T @ noisy, float(noisy @ noisy)
        p = oracle.constrained_least_squares(m, b, TRUTH)
        estimate = oracle.assess(p, m, b, yy, float(y.size), start_sd=1e3 * TRUTH)
        covered += int(np.sum(np.abs(p - TRUTH) < 2.0 * estimate.se))
        assert estimate.residual_sd == pytest.approx(0.02 * np.std(y), rel=0.12)  # 1000 rows: 2.2 % (1 s.d.)
    assert 152 <= covered < 180


def test_standard_errors_fall_back_to_the_start_without_information() -> None:
    """Rows without drive that speak of d1 and d2 alone: w keeps what the start knew."""
    random = np.random.default_rng(3)
    n = np.zeros((200, 11))
    n[:, [2, 6]] = random.standard_normal((200, 2))
    y = n @ oracle.theta(TRUTH) + 0.01 * random.standard_normal(200)
    start_sd = 0.5 * TRUTH
    estimate = oracle.assess(TRUTH, n.T @ n, n.T @ y, float(y @ y), 200.0, start_sd)
    assert estimate.se[0] == pytest.approx(start_sd[0], rel=1e-12)
    # 200 rows of unit size and noise 0.01: 0.01 / sqrt(200), itself known to 1 / sqrt(200), 7 %
    np.testing.assert_allclose(estimate.se[1:], 0.01 / np.sqrt(200.0), rtol=0.3)


def test_too_few_rows_are_refused() -> None:
    with pytest.raises(PvidError, match="4 rows are too few"):
        oracle.identify_strong(np.ones((4, 11)), np.ones(4), around(TRUTH))


def settings_of(**changes: object) -> oracle.Settings:
    plain = oracle.Settings(TRUTH, 0.5 * TRUTH, TRUTH / 20.0, 20.0 * TRUTH, row_sd=1.0, rate=100.0)
    return replace(plain, **changes)  # type: ignore[arg-type]


def noisy_rows(count: int, sd: float, seed: int = 0) -> tuple[Float, Float]:
    random = np.random.default_rng(seed)
    n = random.standard_normal((count, 11)) / np.abs(oracle.theta(TRUTH))
    return n, n @ oracle.theta(TRUTH) + sd * random.standard_normal(count)


def test_assess_by_its_definition() -> None:
    n, y = noisy_rows(12, 0.1)
    m, b, yy, sd = n.T @ n, n.T @ y, float(y @ y), 3.0 * TRUTH
    estimate = oracle.assess(TRUTH, m, b, yy, 12.0, sd, correlation=7.0)
    variance = float(np.sum((y - n @ oracle.theta(TRUTH)) ** 2)) / (12 - 3)
    c = oracle.jacobian(TRUTH)
    expected = np.linalg.inv(c.T @ m @ c / (7.0 * variance) + np.diag(sd**-2.0))
    # yy - 2 B theta + theta M theta cancels to 1e-3 of yy here: a few 1e-13.
    assert estimate.residual_sd == pytest.approx(np.sqrt(variance), rel=1e-10)
    np.testing.assert_allclose(estimate.covariance, expected, rtol=1e-9)
    np.testing.assert_allclose(estimate.se, np.sqrt(np.diag(expected)), rtol=1e-9)


def test_all_sums_forget_alike() -> None:
    """The published residual is that of the rows remembered, each with its weight."""
    n, y = noisy_rows(60, 0.1)
    y[:20] += 5.0  # an old disturbance, so that forgetting matters
    result = oracle.identify_strong(n, y, settings_of(forgetting_s=0.1))
    weights = np.exp(-np.arange(59, -1, -1) / 10.0)
    residual = weights @ (y - n @ oracle.theta(result.last.p)) ** 2
    assert result.last.residual_sd == pytest.approx(np.sqrt(residual / (weights.sum() - 3.0)), rel=1e-9)


def test_a_gain_between_0_and_1_mixes_both_right_sides() -> None:
    n, y = noisy_rows(9, 0.1)
    settings = settings_of(feedback_hz=10.0, divider=3, kappa_min=0.0, start=1.1 * TRUTH, step_limit=0.9)
    assert settings.gain == pytest.approx(0.3)
    result = oracle.identify_strong(n, y, settings)
    p, m, b, prior = settings.start, np.zeros((11, 11)), np.zeros(11), np.diag(settings.start_sd**-2.0)
    for first in range(0, 9, 3):
        c, t, part = oracle.jacobian(p), oracle.theta(p), slice(first, first + 3)
        m, b = m + n[part].T @ n[part], b + n[part].T @ y[part]
        rhs = 0.3 * c.T @ (b - m @ t) + 0.7 * c.T @ n[part].T @ (y[part] - n[part] @ t)
        dp = np.linalg.solve(c.T @ m @ c + prior, rhs)
        p = p + dp * min(1.0, 0.9 / float(np.max(np.abs(dp / p))))
        np.testing.assert_allclose(result.p[first + 2], p, rtol=1e-9)


@pytest.mark.parametrize(("row_sd", "held"), [(0.98, False), (1.02, True)])
def test_a_step_needs_as_much_information_as_the_start(row_sd: float, held: bool) -> None:
    """kappa (S + H0)_ww >= 2 H0_ww; rows of w alone have kappa 1, so S_ww >= H0_ww = row_sd^2 here."""
    n = np.zeros((5, 11))
    n[:, 0] = np.sqrt(0.2)  # five rows: S_ww = 1 at the last
    settings = settings_of(row_sd=row_sd, start_sd=np.ones(3), divider=5)
    assert oracle.identify_strong(n, np.full(5, 14.0), settings).updated[-1] != held


def test_requested_estimates_contain_the_state_of_their_tick() -> None:
    n, y = noisy_rows(40, 0.1)
    result = oracle.identify_strong(n, y, settings_of(), estimate_every=10)
    assert [tick for tick, _ in result.estimates] == [10, 20, 30]  # at tick 0 one row is too few
    for tick, estimate in result.estimates:
        np.testing.assert_array_equal(estimate.p, result.p[tick])


def test_missing_convergence_is_reported() -> None:
    with pytest.raises(PvidError, match="did not converge"):
        oracle.constrained_least_squares(np.eye(11), np.ones(11), TRUTH, iterations=2)


def test_defaults_are_the_cores() -> None:
    assert (settings_of().step_limit, settings_of().kappa_min) == (0.3, 1e-5)  # pvid_estimator_defaults_f32
    n = np.array([1, 1, 1, 3, 3, 1, 1, 4, 6, 4, 1])
    assert oracle.BINOMIAL.tolist() == n.tolist()


@pytest.mark.parametrize("weight", [2.0, 3.0])
def test_assess_with_too_few_rows_is_refused(weight: float) -> None:
    with pytest.raises(PvidError):
        oracle.assess(TRUTH, np.eye(11), np.zeros(11), 1.0, weight, TRUTH)


def test_rows_of_nothing_leave_the_start() -> None:
    last = oracle.identify_strong(np.zeros((20, 11)), np.zeros(20), settings_of()).last
    np.testing.assert_allclose(last.se, 0.5 * TRUTH)
