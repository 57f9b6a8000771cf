"""Bounds are constraints: with one that acts, the other parameters are those of the constrained least squares."""

from dataclasses import replace

import numpy as np
import pytest
from motor_run import motor_equations, recording
from scipy.optimize import lsq_linear

import pvid
from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_library_q31 import StrongNativeQ31
from pvid.configuration.strong import strong_design
from pvid.configuration.strong_q31 import fixed_design
from pvid.model import Model
from pvid.model.compiled import CompiledModel
from pvid.oracle.strong_described import StrongModel, StrongSettings, all_rows

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


# ---- the strong form


def motor() -> CompiledModel:
    model = Model("bounded motor")
    given = "R:ohm:1 L:H:1e-3 k:V*s/rad:0.05 J:kg*m^2:1e-4 b:N*m*s/rad:1e-4"
    motor_equations(model, "k", "k", given)
    return model.compiled("bounded_motor")


def test_every_core_of_the_strong_form_stops_at_the_optimum_within_bounds() -> None:
    """Twenty boxes that cut 1 to 20 standard errors off the estimate, R among them, whose excitation the core watches:
    it is that of the active set in float64, from the same rows."""
    compiled = motor()
    free = strong_design(compiled, recording()).fitted
    rng = np.random.default_rng(0)
    for number in range(20):
        unknowns = list(compiled.unknowns)
        acts = rng.random(5) < 0.4
        for k in np.flatnonzero(acts):
            above, share = rng.random() < 0.5, rng.uniform(1, 20)
            cut = float(free.p[k] + (-share if above else share) * free.noise[k])
            ends = (unknowns[k].low, cut) if above else (cut, unknowns[k].high)
            guess = cut * (0.97 if above else 1.03)
            unknowns[k] = replace(unknowns[k], guess=guess, low=ends[0], high=ends[1], bounds=ends)
        bounded = replace(compiled, unknowns=tuple(unknowns))
        design = strong_design(bounded, recording())
        oracle, settings = StrongModel(bounded), StrongSettings(design.fitted.taps, design.fitted.degree, 1)
        rows = oracle.rows(recording().signals, 1000.0, settings)
        best, _ = all_rows(oracle.parameters, rows, oracle.parameters.checked(None))
        core = strong_native(design.strong, design.config).identifier_of(design.config)
        found = [core.run_samples(design.samples, sums=False).p[-1]]
        if number < 3:
            fixed = fixed_design(bounded, recording(), design, between_counts=True)
            stepped = StrongNativeQ31(fixed.strong_q31).started()
            found.append(fixed.strong_q31.values(stepped.run_samples(fixed.counts, sums=False).p[-1]))
        for p in found:
            # the relative weight of the two equations is that of residuals at another p
            assert np.max(np.abs(p - best) / free.noise) < 0.2, (number, acts, p, best)
