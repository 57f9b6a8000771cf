"""The shipped simulated rigs: they run within their ranges, and show their unknowns as well as those of the audit."""

import numpy as np
import pytest
from pendulum_plant import STANDARD_DRIVE, STANDARD_PENDULUM, STANDARD_RELEASE, Sensors, simulate

from pvid.models.mechanisms import compiled_of, names
from pvid.models.simulated_rig import simulated_rig
from pvid.sim.bound import bound
from pvid.sim.simulated_run import SOFT, RigSimulation, rig_of_guess, simulation_of


@pytest.mark.parametrize("name", names())
def test_rig_moves_within_the_ranges_of_its_signals(name: str) -> None:
    one = simulation_of(name)
    run = one.run(0)
    assert list(run) == ["t", *(signal.name for signal in one.model.signals)]
    for signal in one.model.signals:
        assert 0.0 < np.ptp(run[signal.name]) and np.abs(run[signal.name]).max() <= signal.reach, signal.name
    assert set(one.rig.truth) == set(one.model.p_names)


@pytest.mark.parametrize("name", [name for name in names() if simulated_rig(name).friction_width])
def test_sharp_friction_leaves_no_rig_far_from_the_soft_one(name: str) -> None:
    one = simulation_of(name)
    soft, sharp = one.motion(SOFT), one.motion()
    for signal in one.model.signals:
        if signal.kind == "sensor" and not signal.driven:
            apart = np.ptp(soft[signal.name] - sharp[signal.name])
            assert 0.0 < apart < 0.1 * np.ptp(soft[signal.name]), signal.name


# Bounds of the audit in % of the truth, which its table rounds to two digits.
BOUNDS = {
    "dc_motor": {"R": 0.0005, "L": 0.0023, "k": 0.0004, "J": 0.0008, "b": 0.012, "Tc": 0.005},
    "cart_pendulum": {"mt": 0.0004, "ml": 0.0015, "J": 0.0026, "b": 0.0027, "Fc": 0.0059, "bp": 0.029},
    "two_mass_drive": {"J1": 0.0027, "J2": 0.0014, "k": 0.0018, "c": 0.019, "b1": 0.089, "b2": 0.043, "Tc": 0.003},
    "battery_2rc": {"R0": 0.016, "R1": 0.028, "T1": 0.057},
}


@pytest.mark.parametrize("name", BOUNDS)
def test_bound_is_that_of_the_audit(name: str) -> None:
    """The drives are those of the audit but for a few per cent of amplitude, the audit left the last window out (1.3 to
    4.3 %) and rounded (up to 13 %); the battery's steps are of other seeds. A wrong noise or window errs by more."""
    one = simulation_of(name)
    se = dict(zip(one.model.p_names, bound(one), strict=True))
    for parameter, percent in BOUNDS[name].items():
        assert 100.0 * se[parameter] / one.rig.truth[parameter] == pytest.approx(percent, rel=0.2), parameter


def test_pendulum_of_small_angles_moves_as_the_one_of_the_hand_made_simulation() -> None:
    moved = simulation_of("kapitza").motion()
    true = simulate(
        STANDARD_PENDULUM, STANDARD_DRIVE, Sensors(), 1000.0, 40.0, release=STANDARD_RELEASE, truth="linear"
    )
    # RK4 at 0.1 ms over 40 s of 24 rad/s: 40 (w h)^4 w/120 = 3e-10 of an amplitude
    np.testing.assert_allclose(moved["phi"], true.state[:, 1] - true.state[:, 0], atol=1e-9)


@pytest.mark.parametrize("drive", ["steps", "two sines + PRBS", "chirp"])
def test_rig_of_a_guess_turns_the_motor_by_a_drive_of_the_list(drive: str) -> None:
    model = compiled_of("dc_motor")
    rig = rig_of_guess(model, drive, 0.5, 10.0, rate=1000.0, duration=3.0)
    one = RigSimulation.of(model, rig)
    run = one.run(0)
    np.testing.assert_array_equal(one.truth, [unknown.guess for unknown in model.unknowns])
    assert 3.0 < np.abs(run["V"]).max() <= 6.0 and np.ptp(run["phi"]) > 1.0
