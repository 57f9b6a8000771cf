"""Systematic errors of a sensor are found in the residuals, with their size; a perfect rig has none."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from bench.mechanisms import design_of, start_of
from pvid.models.mechanisms import names
from pvid.oracle.weak.identify import Identified, identify
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import PERFECT, SOFT, simulation_of

Float = npt.NDArray[np.float64]


@cache
def answer(name: str, key: str = "", signal: str = "", size: float = 0.0) -> Identified:
    """What a run with sharp friction and one imperfection gives."""
    simulation = simulation_of(name)
    imperfections = Imperfections(**({key: {signal: size}} if key else {}))  # type: ignore[arg-type]
    run, design = simulation.run(3, imperfections), design_of(simulation, imperfections)
    return identify(simulation.model, run, simulation.rig.sample_rate, start_of(simulation, 3), design)


@pytest.mark.parametrize("name", names())
def test_perfect_rig_has_no_sensor_in_error(name: str) -> None:
    found = answer(name)
    assert found.sensor_error is None
    assert found.verdict.status == "good"


@pytest.mark.parametrize(
    ("name", "key", "signal", "size", "kind", "expected"),
    [
        ("dc_motor", "skew", "phi", 1e-3, "delay", 1e-3),
        ("cart_pendulum", "skew", "a", 2e-3, "delay", 2e-3),
        ("cart_pendulum", "backlash", "a", 3.0, "play", 3.0 * 2 * np.pi / 2**12),
        ("furuta", "backlash", "th", 3.0, "play", 3.0 * 2 * np.pi / 2**12),
        ("cart_pendulum", "eccentricity", "a", 3.0, "eccentric", 3.0 * 2 * np.pi / 2**12),
        ("rigid_body", "gain", "m0", 1.01, "gain", -0.01),
    ],
)
def test_error_of_a_sensor_is_named_with_its_size(
    name: str, key: str, signal: str, size: float, kind: str, expected: float
) -> None:
    """To 10 %: the test is of first order, and the play acts on smoothed samples."""
    found = answer(name, key, signal, size)
    error = found.sensor_error
    assert error is not None and (error.signal, error.kind) == (signal, kind)
    assert error.size == pytest.approx(expected, rel=0.1)
    assert found.verdict.status != "good"
    assert any(one.name == "sensor" and signal in one.text for one in found.verdict.reasons)


@pytest.mark.parametrize(("name", "width"), [("dc_motor", 3.0), ("two_mass_drive", 1.0)])
def test_friction_that_is_soft_is_named_with_about_its_width(name: str, width: float) -> None:
    """Estimated with a sign that switches: widths that are tried are a factor of three apart."""
    simulation = simulation_of(name)
    run = simulation.run(3, SOFT)
    found = identify(simulation.model, run, 1000.0, start_of(simulation, 3), design_of(simulation, PERFECT))
    error = found.sensor_error
    assert error is not None and error.kind == "friction"
    assert width / 2 < error.size < 2 * width
    assert "friction" in [one.name for one in found.verdict.reasons if one.alarm]


def test_shift_of_an_error_leads_back_to_the_truth() -> None:
    """The motor's angle a sample late: errors fall from 1 % to below a twentieth of that."""
    found = answer("dc_motor", "skew", "phi", 1e-3)
    error = found.sensor_error
    truth = simulation_of("dc_motor").truth
    assert error is not None
    before, after = np.abs(found.p - truth), np.abs(found.p + error.shift - truth)
    worst = int(np.argmax(before / found.se))
    assert before[worst] > 100 * found.se[worst]
    assert after[worst] < 0.05 * before[worst]


def test_gain_of_a_voltage_scales_the_motor_and_is_said() -> None:
    """R, L and k in proportion to V; J, b and Tc with the torque constant."""
    found = answer("dc_motor")
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


def cell(change: Callable[[dict[str, Float]], dict[str, Float]]) -> Identified:
    """The cell with its signals changed, by the shipped design."""
    simulation = simulation_of("battery_2rc")
    run = simulation.run(3)
    return identify(
        simulation.model, run | change(run), simulation.rig.sample_rate, design=design_of(simulation, PERFECT)
    )


def test_error_that_explains_little_is_no_cause() -> None:
    """A resistance that is 10 % larger for one direction looks like a delay of i by 0.14 s, ten standard errors; but
    that removes a twentieth of the residuals."""
    found = cell(lambda run: {"v": run["v"] - 0.002 * np.maximum(run["i"], 0.0)})
    assert found.sensor_error is not None and found.sensor_error.kind == "unknown"
    assert found.sensor_error.share < 0.2
    texts = {one.name: one.text for one in found.verdict.reasons if one.alarm}
    assert "sensor" not in texts and found.verdict.status != "good"
    assert "for an unknown reason" in texts["unexplained"] and "R0" in texts["unexplained"]


@pytest.mark.parametrize(("samples", "tolerance"), [(0.3, 0.1), (0.5, 0.1), (1.0, 0.3)])
def test_delay_is_named_with_what_explains_the_run_alike(samples: float, tolerance: float) -> None:
    """Of one input and one output no residual shows which is late: of the two, the delay comes first. The size is that
    at the estimate, where a sample's delay has moved R1 by a fifth."""

    def late(run: dict[str, Float]) -> dict[str, Float]:
        place = np.arange(len(run["v"]), dtype=np.float64)
        return {"v": np.interp(place - samples, place, run["v"])}

    error = cell(late).sensor_error
    assert error is not None and (error.signal, error.kind, error.other) == ("v", "delay", "i")
    assert error.size == pytest.approx(samples / simulation_of("battery_2rc").rig.sample_rate, rel=tolerance)
    assert error.share > 0.9 and "v seems to be delayed by" in error.text and "or i to be advanced" in error.text
