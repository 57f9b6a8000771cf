"""Bounds are constraints: with one that acts, the other parameters are those of the constrained least squares."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import pvid

SIGMA = 0.3


def boxes() -> list[tuple[str, list[float], list[float], list[float]]]:
    """Name, truth, lower and upper bounds."""
    return [
        ("friction of 0", [1.0, 0.0, 2.0], [-9.0, 0.0, -9.0], [9.0, 9.0, 9.0]),
        ("a corner", [1.0, 1.0, 1.0], [0.1, 0.1, -9.0], [0.8, 0.9, 9.0]),
        ("two sides", [1.0, -1.0, 0.5], [1.1, -0.9, -9.0], [9.0, 9.0, 9.0]),
        ("all three", [1.0, -1.0, 0.5], [1.1, -0.9, -9.0], [9.0, 9.0, 0.4]),
        ("none acts", [1.0, -1.0, 0.5], [-9.0, -9.0, -9.0], [9.0, 9.0, 9.0]),
    ]


@pytest.mark.parametrize(("truth", "lower", "upper"), [pytest.param(*box[1:], id=box[0]) for box in boxes()])
def test_p_is_the_minimum_within_the_bounds(truth: list[float], lower: list[float], upper: list[float]) -> None:
    """Clamped parameter by parameter, the worst of these was 13.6 standard errors off."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        n = rng.normal(size=(400, 3)) @ (np.eye(3) + 0.5 * rng.normal(size=(3, 3)))
        y = n @ truth + SIGMA * rng.normal(size=400)
        start = np.clip([0.5, 0.5, 0.5], lower, upper)
        core = pvid.Estimator(
            lambda p: p, start=start, start_sd=[100.0] * 3, row_sd=SIGMA, lower=lower, upper=upper,
            positive=[False] * 3, rate=50.0,
        )  # fmt: skip
        found = core.add(n, y).estimate.p
        best = lsq_linear(n, y, (lower, upper), tol=1e-14).x
        errors = SIGMA * np.sqrt(np.diag(np.linalg.inv(n.T @ n)))
        assert np.max(np.abs(found - best) / errors) < 0.02, (seed, found, best)


def test_a_bound_that_no_longer_acts_lets_its_parameter_go() -> None:
    rng = np.random.default_rng(3)
    core = pvid.Estimator(
        lambda p: p, start=[0.5, 0.5], start_sd=[100.0, 100.0], row_sd=SIGMA, lower=[0.0, -9.0], upper=[9.0, 9.0],
        positive=[False, False], rate=50.0,
    )  # fmt: skip
    n = rng.normal(size=(200, 2))
    core.add(n, n @ [-0.2, 1.0] + SIGMA * rng.normal(size=200))
    assert core.estimate.p[0] == 0.0
    more = rng.normal(size=(2000, 2))
    core.add(more, more @ [0.8, 1.0] + SIGMA * rng.normal(size=2000))
    assert core.estimate.p[0] == pytest.approx(0.71, abs=0.05)
