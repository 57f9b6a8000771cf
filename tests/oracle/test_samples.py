"""Clipping, standstill, a rate that is too low, guesses off by one factor: named in one sentence, and only where so."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from pvid.model import Model, sgn
from pvid.model.compiled import CompiledModel
from pvid.models.drive import RandomSteps
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import Identified, identify
from pvid.oracle.weak.samples import clipped, repeating
from pvid.sim.simulated_run import RigSimulation, simulation_of

Float = npt.NDArray[np.float64]
Run = dict[str, Float]


def texts(found: Identified) -> dict[str, str]:
    return {one.name: one.text for one in found.verdict.reasons}


@cache
def driven(rate: float) -> RigSimulation:
    """The shipped motor, L/R = 2.5 ms, with a voltage of random levels, held for 20 ms."""
    shipped = simulation_of("dc_motor")
    levels = {"V": RandomSteps(4.0, 0.02, seed=1, normal=True)}
    substeps = round(shipped.rig.substeps * 1000 / rate)
    rig = replace(shipped.rig, drive=levels, sample_rate=rate, substeps=substeps)
    return RigSimulation.of(shipped.model, rig)


def motor(rate: float, change: Callable[[Run], Run] = dict) -> dict[str, str]:
    """All reasons."""
    simulation = driven(rate)
    run = simulation.run(3)
    return texts(identify(simulation.model, run | change(run), rate, design=WeakDesign(rate, 1.0, 12, 6)))


@pytest.mark.parametrize("rate", [200.0, 100.0])
def test_rate_too_low_for_the_current_is_named_in_place_of_its_consequences(rate: float) -> None:
    found = motor(rate)
    assert found["rate"].startswith(f"L is hardly identifiable at {rate:g} Hz: its time constant is 0.00")
    assert "Sample at" in found["rate"]
    assert not {"feedback", "sensor", "missing", "friction"} & set(found)


def test_no_rate_is_advised_where_the_equations_explain_nothing() -> None:
    """An angle of the opposite sign: the time constant is that of no motor."""
    found = motor(1000.0, lambda run: {"phi": -run["phi"]})
    assert "hardly identifiable" in found["rate"] and "Sample at" not in found["rate"]
    assert re.search(r"the standard error of L is [\d.]+ H, beside a value of [\d.]+ H", found["not_identified"])


def test_rate_that_shows_the_current_is_not_named() -> None:
    assert "rate" not in motor(1000.0)


def test_delay_of_a_sample_is_named_at_a_low_rate_too() -> None:
    """The current is read a sample late: no motion within a sample looks like this. To the equations it is a term in
    the second derivative of the current and one in the first; which of both descriptions fits better is chance."""
    found = motor(200.0, lambda run: {"i": np.concatenate([run["i"][:1], run["i"][:-1]])})
    text = found.get("sensor") or found["missing"]
    assert re.match(r"i seems to be delayed by 0\.00|Equation 1 seems to lack [\de.-]+\*i\.d\(2\) and equation 2", text)


@pytest.mark.parametrize(
    ("limit", "side"),
    [
        *((0.8, "both"), (1.5, "largest"), (0.8, "smallest")),
        *(pytest.param(*one, marks=pytest.mark.night) for one in ((1.5, "both"), (0.8, "largest"), (1.5, "smallest"))),
    ],
)
def test_sensor_that_clips_is_named(limit: float, side: str) -> None:
    low, high = (-limit if side != "largest" else -np.inf), (limit if side != "smallest" else np.inf)
    found = motor(1000.0, lambda run: {"i": np.clip(run["i"], low, high)})
    value = f"-{limit:g} A" if side == "smallest" else f"{limit:g} A"
    assert f"i stands at its {side if side != 'both' else 'largest'} value, {value}" in found["clipped"]
    assert not {"sensor", "missing", "friction"} & set(found)


@pytest.mark.parametrize("rate", [500, 5000, 50000])
@pytest.mark.parametrize("counts", [20, 80, 4000])
def test_coarse_counts_at_the_turns_of_a_tone_are_no_limit(counts: int, rate: int) -> None:
    """The resolution is not declared; a motion that ends three quarters of the way clips."""
    model = compiled_of("mass_on_spring")
    x, force = model.signal("x"), np.sin(6 * np.arange(5 * rate) / rate)
    counted = np.round(counts * force + 0.2) / counts
    sensor = replace(x, resolution=0.0)
    assert not clipped(model, sensor, {"x": counted, "F": force})
    assert clipped(model, sensor, {"x": np.minimum(counted, 0.75), "F": force})


@pytest.mark.parametrize("deceleration", [0.3, 1.0, 4.0])
def test_a_stop_by_friction_is_no_limit(deceleration: float) -> None:
    """It stays at its largest value until the force turns it; at the end of its way it would not have slowed down."""
    model = compiled_of("mass_on_spring")
    k = np.arange(600.0)
    since_stop = np.maximum(np.maximum(300 - k, k - 340), 0)
    x: Float = np.round(-deceleration * since_stop**2 / 2)
    sensor = replace(model.signal("x"), resolution=1.0)
    assert not clipped(model, sensor, {"x": x, "F": x})
    assert clipped(model, sensor, {"x": np.minimum(x, -30 * deceleration), "F": x})


def test_record_of_a_drive_that_clips_is_noted_where_the_equations_do_not_explain_the_run() -> None:
    """Not where the drive itself may end there: of what comes to it in steps, or with equations that hold."""
    shipped = simulation_of("dc_motor")
    run = shipped.run(3)
    identified = [
        texts(identify(shipped.model, {**run, "V": V}, 1000.0, design=WeakDesign(1000.0, 1.0, 12, 6)))
        for V in (np.clip(run["V"], -4, 4), run["V"])
    ]
    assert identified[0]["clipped"].endswith("does what records it clip, or does V itself end there?")
    assert "V stands at its largest value, 4 V, in " in identified[0]["clipped"] and "clipped" not in identified[1]
    steps = motor(1000.0, lambda run: {"V": np.clip(run["V"], -3, 3)})
    assert "clipped" not in steps


def test_imposed_current_clips_where_it_comes_to_its_largest_value_steadily_and_not_in_steps() -> None:
    model, random = simulation_of("battery_2rc").model, np.random.default_rng(1)
    v = 3.7 + np.cumsum(random.normal(0, 1e-3, 3000))
    levels = random.normal(0, 2, 200).repeat(15)
    swing = np.clip(3 * np.sin(np.arange(3000) / 40), -9, 2)
    for i, names in ((levels, []), (swing, ["clipped"])):
        assert [one.name for one in clipped(model, model.signal("i"), {"v": v, "i": i})] == names


def flywheel() -> CompiledModel:
    model = Model("flywheel")
    u = model.input("u", "N*m", hold="zoh", reach=1, gain_sd=0)
    a = model.sensor("a", "rad", resolution=2 * np.pi / 4096, reach=1000)
    J, b, Tc = model.unknown("J", "kg*m^2", 0.01), model.unknown("b", "N*m*s", 0.01), model.unknown("Tc", "N*m", 0.02)
    model.equation(J * a.d(2) + b * a.d() + Tc * sgn(a.d()) - u)
    return model.compiled("flywheel")


def flywheel_run(rest_s: float) -> Run:
    """12 s with sines, then rest."""
    rate, lsb = 500, 2 * np.pi / 4096
    moving, n = 12 * rate, 12 * rate + round(rest_s * rate)
    t, random = np.arange(n) / rate, np.random.default_rng(1)
    u = np.where(t < 12, 0.25 * np.sin(3 * t) + 0.2 * np.sin(11 * t), 0.0)
    angle, speed, a = 0.0, 0.0, np.empty(n)
    for k in range(n):
        a[k] = angle
        for _ in range(8 if k < moving or abs(speed) > 1e-3 else 0):
            speed += (u[k] - 0.012 * speed - 0.03 * np.tanh(speed / 0.002)) / 0.013 / rate / 8
            angle += speed / rate / 8
    return {"u": u, "a": np.rint(a / lsb + 0.5 + random.normal(0, 0.2, n)) * lsb}


@pytest.mark.parametrize("rest_s", [0.0, 12.0])
def test_encoder_that_toggles_at_rest_is_named(rest_s: float) -> None:
    run = flywheel_run(rest_s)
    if rest_s:  # half a step from the next one
        rest = run["a"][12 * 500 + 400 :]
        rest[:] = rest[0] + 2 * np.pi / 4096 * np.random.default_rng(2).integers(0, 2, len(rest))
    found = texts(identify(flywheel(), run, 500.0, design=WeakDesign(500.0, 1.0, 12, 6)))
    assert ("resting" in found) == bool(rest_s)
    if rest_s:
        assert "a toggles between two values in 4" in found["resting"]


@pytest.mark.parametrize(("factor", "named"), [(1.0, False), (3.0, False), (255 / 12, True), (1e-3, True)])
def test_guesses_off_by_one_factor_are_named(factor: float, named: bool) -> None:
    """PWM counts in place of volts: every parameter is 21 times its guess, with residuals as small as before."""
    found = motor(1000.0, lambda run: {"V": factor * run["V"]})
    assert ("guesses" in found) == named
    if named:
        assert f"L, R and k are all about {factor:.2g} times their guesses: is V in another unit" in found["guesses"]


@pytest.mark.parametrize(("counts", "second", "repeats"), [(40, 0.0, True), (100, 0.0, True), (40, 0.6, False)])
def test_counts_that_repeat_with_the_motion_are_named(counts: int, second: float, repeats: bool) -> None:
    """Their error looks like motion at harmonics of the tone."""
    t = np.arange(5000) / 500.0
    x = np.sin(7.07 * t) + second * np.sin(4.3 * t + 1.0) + second * np.sin(11.9 * t)
    x *= counts / np.ptp(x)
    model = Model("m")
    sensor = model.sensor("x", "m", resolution=1.0)
    model.equation(model.unknown("k", "1/s", 1.0) * sensor + sensor.d())
    signal = model.compiled("m").signal("x")
    assert [one.name for one in repeating(signal, np.rint(x))] == ["counts"] * repeats
    noisy = np.rint(x + np.random.default_rng(0).normal(0.0, 0.4, len(t)))
    assert repeating(signal, noisy) == []
