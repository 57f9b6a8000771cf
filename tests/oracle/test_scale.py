"""Gains that scale p: residuals do not show them; they are named, or a part of the standard errors."""

from dataclasses import replace

import numpy as np
import pytest

from bench.mechanisms import design_of, start_of
from pvid.oracle.weak.identify import identify
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
