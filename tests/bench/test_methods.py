"""The methods that the weak form is compared with do what they are named after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import methods, strong_savitzky_golay, weak_sindy
from bench.mechanisms import size_of
from bench.output_error import output_error
from bench.replay import Match, RecordedDrive, Replay
from pvid.rig.run import Recording
from pvid.sim.simulated_run import RigSimulation, simulation_of


def shortened(name: str, duration: float) -> RigSimulation:
    simulation = simulation_of(name)
    return RigSimulation.of(simulation.model, replace(simulation.rig, duration=duration))


def test_replay_at_the_truth_is_the_recorded_run() -> None:
    """But for rounding of the sensors and the start, which is read from the first samples."""
    motor = shortened("dc_motor", 2.0)
    for match in Replay(motor.model, methods.recorded(motor, 0)).matches(motor.truth).values():
        assert match.r2 > 0.9999


def test_recorded_drive_is_straight_between_samples() -> None:
    drive = RecordedDrive(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 1.0]))
    at = np.array([0.25, 1.0, 1.5])
    np.testing.assert_allclose(drive.values(at), [0.5, 2.0, 1.5])
    np.testing.assert_allclose(drive.values(at, 1), [2.0, -1.0, -1.0])


def test_match_of_the_mean_is_zero() -> None:
    x = np.array([1.0, 2.0, 3.0])
    assert Match.of(x, np.full(3, 2.0)).r2 == pytest.approx(0.0)
    assert Match.of(x, x) == Match(1.0, 0.0)


def test_output_error_finds_the_motor_from_near() -> None:
    motor = shortened("dc_motor", 0.8)
    found = output_error(Replay(motor.model, methods.recorded(motor, 0), substeps=1), 1.01 * motor.truth, most=20)
    np.testing.assert_allclose(found.p[:3], motor.truth[:3], rtol=5e-4)  # 12-bit sensors, 0.8 s


def test_strong_form_has_the_back_emf_and_not_the_inductance() -> None:
    motor = shortened("dc_motor", 5.0)
    run = methods.recorded(motor, 0)
    p, smoother = strong_savitzky_golay.best(motor.model, run.signals, run.sample_rate, motor.truth, size_of(motor))
    values = dict(zip(motor.model.p_names, p / motor.truth - 1, strict=True))
    assert abs(values["k"]) < 0.005
    assert abs(values["L"]) > 0.02
    assert (smoother.taps, smoother.degree) in strong_savitzky_golay.FILTERS


def test_pysindys_coefficients_of_a_motor_give_its_parameters() -> None:
    """x' = C (1, i, velocity, V, sign), written down."""
    motor = shortened("dc_motor", 0.1)
    v = dict(zip(motor.model.p_names, motor.truth, strict=True))
    electric = [v["R"] * v["i0"], -v["R"], -v["k"], 1.0, 0.0]
    mechanical = [-v["k"] * v["i0"], v["k"], -v["b"], 0.0, -v["Tc"]]
    coefficients = np.array([np.array(electric) / v["L"], np.array(mechanical) / v["J"]])
    form = weak_sindy.FORMS["dc_motor"](motor, methods.recorded(motor, 0))
    np.testing.assert_allclose(form.parameters(coefficients), motor.truth, rtol=1e-12)


def test_what_a_method_cannot_express_is_a_sentence_in_the_table() -> None:
    cart = shortened("cart_pendulum", 0.5)
    sindy = methods.METHODS[-1]
    cells = methods.outcome(sindy, cart, [methods.recorded(cart, 0)]).cells()
    assert cells[3] == "pysindy's weak form cannot express cart_pendulum"


def test_errors_are_summed_up_over_runs() -> None:
    errors = np.array([[0.01, 0.02, 0.3], [-0.01, 0.02, 0.4]])
    cells = methods.Outcome(("a", "b", "c"), errors, 1.5).cells()
    assert cells == ("0/2", "2", "35", "c", "1.5")


def test_recorded_run_is_a_recording() -> None:
    run = methods.recorded(shortened("battery_2rc", 60.0), 0)
    assert isinstance(run, Recording) and len(run) == 60
