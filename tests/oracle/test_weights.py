"""An equation's error that is not white is tried as a white one, and the distance is part of the standard errors."""

from dataclasses import replace

import numpy as np
from conftest import ROOT

from pvid.models.drive import Sines
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import SimulatedRig
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.errors import uncertainty
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.rows import EquationError, WeakRows
from pvid.oracle.weak.solve import batch
from pvid.oracle.weak.weights import as_white_force
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import RigSimulation

MODEL = compiled_of(ROOT / "tests" / "data" / "recordings" / "simple_pendulum.py")
RATE = 250.0
RIG = SimulatedRig(
    model=MODEL.name,
    truth={"J": 0.18, "G": 3.6, "b": 0.05, "c": 0.1, "o": 0.02},
    drive={"tau": Sines(((1.0, 0.45, 0.0), (0.8, 0.8, 1.0)))},
    sample_rate=RATE,
    duration=20.0,
    substeps=4,
    friction_width=0.3,
)
DESIGN = WeakDesign(RATE, window_s=2.0, functions=9, rate_taps=15)


def run(noise: float) -> dict[str, np.ndarray]:
    imperfections = Imperfections(process={0: noise} if noise else {})
    return RigSimulation.of(MODEL, RIG).run(0, imperfections)


def test_white_force_is_what_it_is_taken_for() -> None:
    fit = batch(WeakRows.of(ready(MODEL), run(0.05), DESIGN))
    assert [one.order for one in fit.errors] == [0]
    assert as_white_force(fit) is None


def test_white_force_that_was_taken_for_another_error_is_found_again() -> None:
    fit = batch(WeakRows.of(ready(MODEL), run(0.05), DESIGN))
    mistaken = replace(fit, errors=[EquationError(1e-3, 1)], p=1.1 * fit.p)
    again = as_white_force(mistaken)
    assert again is not None
    assert (np.abs(again - fit.p) < 0.01 * uncertainty(fit).se).all()  # two searches for one minimum


def test_standard_errors_contain_the_distance() -> None:
    """A torque with the derivative of white noise on it: an error of order 1."""
    noisy = run(0.0)
    noisy["tau"] = noisy["tau"] + 0.3 * np.diff(np.random.default_rng(3).normal(size=noisy["tau"].size + 1))
    found = identify(MODEL, noisy, RATE, design=DESIGN)
    assert [one.order for one in found.equation_errors.values()] == [1]
    other = as_white_force(found.fit)
    assert other is not None
    assert (found.se >= np.abs(other - found.p)).all()


def test_log_determinant_is_that_of_every_windows_covariance() -> None:
    fit = batch(WeakRows.of(ready(MODEL), run(0.05), DESIGN))
    (white,) = fit.white
    theta = fit.parameters.theta(fit.p)
    plain = fit.rows.covariance((0,), theta, fit.errors)
    directions, (entries, windows) = fit.rows.reversals.directions((0,), theta), fit.rows.doubts((0,))
    held = (directions[entries[windows == window]] for window in range(fit.rows.windows))
    expected = sum(np.linalg.slogdet(plain + u.T @ u)[1] for u in held)
    np.testing.assert_allclose(white.whitener.log_determinant(), expected, rtol=0, atol=1e-3)  # but for the ridge
