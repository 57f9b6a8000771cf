"""The strong form of described mechanisms: rows, both laws, and what noise does to it."""

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.strong_described import StrongModel, StrongSettings, identify_strong
from pvid.sim.simulated_run import RigSimulation

Float = npt.NDArray[np.float64]


def simulation(name: str) -> RigSimulation:
    return RigSimulation.of(compiled_of(name), simulated_rig(name))


def start(truth: Float, seed: int) -> Float:
    return np.asarray(truth * np.random.default_rng(seed).uniform(0.7, 1.4, len(truth)))


def test_rows_of_the_pendulum_vanish_on_a_motion_of_its_equations() -> None:
    """Exact derivatives of the simulated motion, as the simulator's own states give them."""
    sim = simulation("kapitza")
    model = StrongModel(sim.model)
    assert model.order == 4
    run = sim.run(0)
    clean = sim.motion()
    run["phi"] = clean["phi"]
    run["y"] = sim.rig.drive["y"].values(clean.t)  # type: ignore[union-attr]
    found = identify_strong(sim.model, run, 1000.0, sim.truth, StrongSettings(taps=101, degree=8))
    # Without noise the polynomial's own error is left: 1e-4 of an estimate.
    assert np.allclose(found.p[:3], sim.truth[:3], rtol=2e-3)
    assert min(found.r2.values()) > 0.99999


@pytest.mark.parametrize("law", ["stationary", "pseudovelocity"])
def test_either_law_finds_the_inertias_of_a_rigid_body(law: str) -> None:
    sim = simulation("rigid_body")
    settings = StrongSettings(taps=101, law=law)  # type: ignore[arg-type]
    begun = np.where([one.positive for one in sim.model.unknowns], start(sim.truth, 1), 0.0)
    found = identify_strong(sim.model, sim.run(0), 1000.0, begun, settings)
    assert np.all(np.abs(found.p / sim.truth - 1)[:3] < 1e-3)
    # The paper's law has no feedback of the normal equations: it keeps what its start cost.
    bound = 1e-3 if law == "stationary" else 0.05
    assert np.all(np.abs(found.history[-1] / sim.truth - 1)[:3] < bound)
    assert np.all(np.abs(found.p - sim.truth) < 6 * found.se)
    assert found.history.shape == (len(found.times), 6)


def test_noise_in_derivatives_biases_it_where_the_weak_form_is_right() -> None:
    sim = simulation("furuta")
    run = sim.run(0)
    found = identify_strong(sim.model, run, 1000.0, sim.truth, StrongSettings(taps=61))
    k = sim.model.p_names.index("Jp")
    assert found.p[k] < 0.95 * sim.truth[k]


def test_running_integrals_and_auxiliary_signals_have_their_derivatives() -> None:
    sim = simulation("battery_2rc")
    model = StrongModel(sim.model)
    rows = model.rows(sim.run(0), 1.0, StrongSettings(taps=31, degree=4, every=2))
    theta = model.parameters.theta(sim.truth)[0]
    e = rows.known[0] - rows.regressors[0] @ theta
    charge = rows.regressors[0][:, [str(one) for one in model.model.rows[0].theta].index("s")]
    # The noise of v'' is the largest part; of the charge, 0.1 V of the cell's, nothing is left.
    assert abs(np.polyfit(charge, e, 1)[0]) < 0.1 * sim.rig.truth["s"]
    drive = simulation("two_mass_drive")
    assert StrongModel(drive.model).auxiliary  # derivatives of sgn(th')


def test_a_polynomial_that_cannot_give_the_derivatives_is_refused() -> None:
    sim = simulation("kapitza")
    with pytest.raises(PvidError, match="up to order 4"):
        identify_strong(sim.model, sim.run(0), 1000.0, settings=StrongSettings(taps=61, degree=3))
    with pytest.raises(PvidError, match="odd number of taps"):
        identify_strong(sim.model, sim.run(0), 1000.0, settings=StrongSettings(taps=60))
    with pytest.raises(PvidError, match="too few"):
        run = {name: x[:200] for name, x in sim.run(0).items()}
        identify_strong(sim.model, run, 1000.0, settings=StrongSettings(taps=201, degree=8))
