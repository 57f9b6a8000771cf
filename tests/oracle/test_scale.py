"""Gains that scale p: residuals do not show them; they are named, or a part of the standard errors."""

from dataclasses import replace

import numpy as np
import pytest

import pvid
from bench.mechanisms import design_of, start_of
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.identify import identify
from pvid.rig.mechanism_file import MechanismRig
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import PERFECT, simulation_of


def test_gain_of_a_voltage_scales_the_motor_and_is_said() -> None:
    """R, L and k in proportion to V; J, b and Tc with the torque constant."""
    simulation = simulation_of("dc_motor")
    run, design = simulation.run(3, PERFECT), design_of(simulation, PERFECT)
    found = identify(simulation.model, run, simulation.rig.sample_rate, start_of(simulation, 3), design)
    by_gain = dict(zip(found.names, found.by_gain["V"] / found.p, strict=True))
    for name in ("R", "L", "k", "J", "b", "Tc"):
        assert by_gain[name] == pytest.approx(1.0, abs=0.01), name
    scale = next(one for one in found.verdict.reasons if one.name == "scale")
    assert not scale.alarm and "V (1 % of" in scale.text


def test_declared_gain_is_part_of_the_standard_errors_and_needs_no_note() -> None:
    """1 % of the force: every parameter of the cart but the encoder's zero."""
    simulation = simulation_of("cart_pendulum")
    signals = tuple(replace(one, gain_sd=0.01 if one.name == "F" else 0.0) for one in simulation.model.signals)
    run = simulation.run(3, Imperfections(gain={"F": 1.01}))
    plain, declared = (
        identify(model, run, simulation.rig.sample_rate, design=design_of(simulation, PERFECT))
        for model in (simulation.model, replace(simulation.model, signals=signals))
    )
    assert np.any(np.abs(plain.p - simulation.truth) > 100 * plain.se)
    assert np.all(np.abs(declared.p - simulation.truth) < 4 * declared.se)
    positive = [one.positive for one in simulation.model.unknowns]
    np.testing.assert_allclose((declared.se / declared.p)[positive], 0.01, rtol=0.05)
    texts = [next(reason.text for reason in one.verdict.reasons if reason.name == "scale") for one in (plain, declared)]
    assert "F (1 % of" in texts[0] and "F (" not in texts[1]


@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc", "rigid_body"])
def test_error_of_the_clock_is_what_another_sample_rate_gives(name: str) -> None:
    """L and J of a motor are proportional to the time, T1 and T2 of a cell too."""
    simulation = simulation_of(name)
    run, rate, design = simulation.run(3, PERFECT), simulation.rig.sample_rate, design_of(simulation, PERFECT)
    start = start_of(simulation, 3)
    model = replace(simulation.model, clock_sd=1e-3)
    found = identify(model, run, rate, start, design)
    assert found.by_clock.any() and np.all(found.se >= 1e-3 * np.abs(found.by_clock))
    faster = replace(design, sample_rate=1.001 * rate, window_s=2 * design.hop * design.dt / 1.001)
    other = identify(simulation.model, run, 1.001 * rate, found.p, faster)
    np.testing.assert_allclose(found.p - other.p, 1e-3 * found.by_clock, atol=0.4 * found.predicted.max(), rtol=0.03)


def test_scales_that_nobody_declared_are_not_0() -> None:
    """Sensors half a per cent, inputs one; an encoder has a whole number of counts a turn; a quartz has 50 ppm."""
    motor = compiled_of("dc_motor")
    assert {one.name: one.gain_sd for one in motor.signals} == {"V": 0.01, "i": 0.005, "phi": 0.0}
    assert motor.clock_sd == 5e-5
    rig = MechanismRig.parse('clock_sd = 0\n[model]\nname = "dc_motor"\n[sensor.i]\ngain_sd = 0.002\n')
    assert MechanismRig.parse(rig.text()) == rig
    own = rig.applied(motor)
    assert own.signal("i").gain_sd == 0.002 and own.signal("V").gain_sd == 0.01 and own.clock_sd == 0.0


def test_parts_of_an_error_add_up_and_runs_of_a_rig_have_its_scale_in_common() -> None:
    """Two runs of one motor differ by their noise; the scale, here 30 times it, is in the published errors alone."""
    simulation = simulation_of("dc_motor")
    results = []
    for seed in (1, 2):
        frame = {"t": (run := simulation.run(seed)).pop("t"), **run}
        results.append(pvid.identify(frame, model="dc_motor"))
    for name, one in results[0].details["parameters"].items():
        assert one["se"] == pytest.approx(np.sqrt(one["se_noise"] ** 2 + one["se_scale"] ** 2 + one["se_model"] ** 2))
        if name != "i0":
            assert one["se_scale"] > 30 * one["se_noise"]
    apart = results[0].compare(results[1])
    assert 0.01 < max(map(abs, apart.values())) < 5
