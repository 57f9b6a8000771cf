"""Corners of signals at the edges of held inputs that are multiplied by measured signals."""

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm

from pvid.identification.analysis import analysed
from pvid.identification.core import identify_in_c
from pvid.model import Model
from pvid.model.compiled import CompiledModel, Edge
from pvid.model.corners import OfInput, feedthroughs, slopes, with_corners
from pvid.oracle.weak.identify import identify
from pvid.rig.run import Recording
from pvid.settings.enums import Core

Float = npt.NDArray[np.float64]

MOTOR = {"R": 1.2, "L": 3e-3, "k": 0.05, "J": 2e-4, "b": 1e-4}
CONVERTER = {"L": 2.7e-5, "C": 1.5e-4, "RL": 0.07, "Ro": 2.4, "Rc": 0.013}


def motor_on_a_bridge() -> CompiledModel:
    """What every motor bridge logs: the duty, and the voltage of its supply."""
    model = Model("motor on a bridge")
    d = model.input("d", "", hold="zoh", reach=1, gain_sd=0)
    vb = model.sensor("vb", "V", resolution=5e-3, reach=15, driven=True, gain_sd=0)
    i, w = model.sensor("i", "A", resolution=2.5e-3, reach=5), model.sensor("w", "rad/s", resolution=0.02, reach=300)
    R, L, k = model.unknown("R", "ohm", 1.0), model.unknown("L", "H", 2.5e-3), model.unknown("k", "N*m/A", 0.06)
    J, b = model.unknown("J", "kg*m^2", 1.5e-4), model.unknown("b", "N*m*s", 2e-4)
    model.equation(L * i.d() + R * i + k * w - d * vb)
    model.equation(J * w.d() + b * w - k * i)
    return model.compiled("bridge")


def converter() -> CompiledModel:
    """The output voltage has the corners of the coil's current, by the resistance of the capacitor."""
    model = Model("buck converter")
    d = model.input("d", "", hold="zoh", reach=1, gain_sd=0)
    vin = model.sensor("vin", "V", resolution=20 / 2**12, reach=20, driven=True, gain_sd=0)
    i = model.sensor("i", "A", resolution=20 / 2**12, reach=10)
    v = model.sensor("v", "V", resolution=10 / 2**12, reach=10)
    L, C = model.unknown("L", "H", 2e-5), model.unknown("C", "F", 1e-4)
    RL, Ro, Rc = model.unknown("RL", "ohm", 0.05), model.unknown("Ro", "ohm", 2.0), model.unknown("Rc", "ohm", 0.02)
    vc = model.unmeasured("vc", "V")
    model.equation(L * i.d() + RL * i + v - d * vin)
    model.equation(C * vc.d() - i + v / Ro)
    model.equation(v - vc - Rc * (i - v / Ro))
    return model.compiled("buck")


def exact(a: Float, b: Float, u: Float, dt: float) -> Float:
    """x' = a x + b u from rest, u held [samples, states]."""
    n = len(a)
    whole = expm(np.block([[a, b[:, None]], [np.zeros((1, n + 1))]]) * dt)
    x = np.zeros((len(u), n))
    for k in range(len(u) - 1):
        x[k + 1] = whole[:n, :n] @ x[k] + whole[:n, n] * u[k]
    return x


def read(x: Float, lsb: float, rng: np.random.Generator) -> Float:
    return np.asarray(np.rint(x / lsb + rng.normal(0.0, 0.5, len(x))) * lsb)


def steps(rng: np.random.Generator, n: int, hold: int, low: float, high: float) -> Float:
    return np.asarray(np.repeat(rng.uniform(low, high, n // hold + 1), hold)[:n])


def ripple(size: float, hz: float, n: int, dt: float) -> tuple[Float, Float]:
    """A supply of 12 V with a ripple: its samples, and its values half a sample later."""
    t = dt * np.arange(n, dtype=np.float64)
    at, later = (12 + size * np.sin(2 * np.pi * hz * one) for one in (t, t + dt / 2))
    return np.asarray(at, np.float64), np.asarray(later, np.float64)


def motor_run() -> Recording:
    rng, dt, n = np.random.default_rng(4), 1e-3, 20_000
    one = MOTOR
    vb, mean = ripple(0.3, 3.0, n, dt)
    d = steps(rng, n, 20, -0.7, 0.7)
    a = np.array([[-one["R"] / one["L"], -one["k"] / one["L"]], [one["k"] / one["J"], -one["b"] / one["J"]]])
    x = exact(a, np.array([1 / one["L"], 0.0]), d * mean, dt)
    signals = {"d": d, "vb": read(vb, 5e-3, rng), "i": read(x[:, 0], 2.5e-3, rng), "w": read(x[:, 1], 0.02, rng)}
    return Recording(np.asarray(np.arange(n) * dt, np.float64), signals, 1 / dt)


def converter_run() -> Recording:
    rng, dt, n = np.random.default_rng(5), 2e-5, 20_000
    one = CONVERTER
    g = 1 / (1 + one["Rc"] / one["Ro"])
    vin, mean = ripple(0.4, 37.0, n, dt)
    d = steps(rng, n, 25, 0.15, 0.5)
    a = np.array(
        [
            [-(one["RL"] + g * one["Rc"]) / one["L"], -g / one["L"]],
            [(1 - g * one["Rc"] / one["Ro"]) / one["C"], -g / one["Ro"] / one["C"]],
        ]
    )
    x = exact(a, np.array([1 / one["L"], 0.0]), d * mean, dt)
    v = g * (x[:, 1] + one["Rc"] * x[:, 0])
    lsb = 20 / 2**12
    signals = {"d": d, "vin": read(vin, lsb, rng), "i": read(x[:, 0], lsb, rng), "v": read(v, lsb / 2, rng)}
    return Recording(np.asarray(np.arange(n) * dt, np.float64), signals, 1 / dt)


def test_the_slope_of_a_product_contains_the_measured_signal() -> None:
    assert {key: str(one) for key, one in slopes(motor_on_a_bridge()).items()} == {("i", "d"): "vb/L"}
    found = slopes(converter())
    assert set(found) == {("i", "d"), ("v", "d")} and str(found["i", "d"]) == "vin/L"
    model, jumps = with_corners(converter())
    assert jumps == {"d_jump": OfInput("d", "jump")} and len(model.rows) == 2


@pytest.mark.parametrize("core", [None, "f32", "q31"])
def test_inductance_of_a_motor_whose_bridge_voltage_is_measured(core: Core | None) -> None:
    """Without the corners of the product L is 0.9 % off, 46 standard errors of noise, and d is called delayed."""
    answer = analysed(motor_run(), motor_on_a_bridge())
    values = answer.values if core is None else identify_in_c(answer, core).values
    for name, truth in MOTOR.items():
        one = values[name]
        assert one.value is not None and one.se_noise is not None
        assert abs(one.value - truth) < max(3 * one.se_noise, 5e-4 * truth), name
    assert not any("delayed" in one.text or "advanced" in one.text for one in answer.found.verdict.reasons)


def test_the_converter_is_identified_with_the_corners_of_both_sensors() -> None:
    """Without them C is 0.7 %, its resistance 9 % off."""
    run = converter_run()
    found = identify(converter(), run.signals, run.sample_rate)
    for name, value in zip(converter().p_names, found.p, strict=True):
        assert abs(value / CONVERTER[name] - 1) < (2e-3 if name == "Rc" else 5e-4), name


LADDER = {"R1": 8.0, "C1": 0.04}


def ladder() -> CompiledModel:
    """A resistor that charges a capacitor; its current jumps with the voltage."""
    model = Model("RC element")
    u = model.input("u", "V", hold="zoh", reach=3, gain_sd=0)
    i, v = model.sensor("i", "A", resolution=3e-4, reach=1), model.sensor("v", "V", resolution=2e-3, reach=3)
    R1, C1 = model.unknown("R1", "ohm", 5.0), model.unknown("C1", "F", 0.06)
    model.equation(i - (u - v) / R1)
    model.equation(C1 * v.d() - i)
    return model.compiled("ladder")


def mass() -> CompiledModel:
    """A mass with an accelerometer, which jumps with the force by 1/m."""
    model = Model("mass on a spring")
    force = model.input("F", "N", hold="zoh", reach=3, gain_sd=0)
    x, a = model.sensor("x", "m", resolution=1e-5, reach=1), model.sensor("a", "m/s^2", resolution=2e-3, reach=10)
    m, c, k = model.unknown("m", "kg", 1.0), model.unknown("c", "N*s/m", 2.0), model.unknown("k", "N/m", 60.0)
    model.equation(m * a + c * x.d() + k * x - force)
    model.equation(m * x.d(2) + c * x.d() + k * x - force)
    return model.compiled("mass")


def ladder_run(edge: Edge, hold: int) -> Recording:
    """With the current before each jump of the voltage, or after it."""
    rng, dt, n = np.random.default_rng(6), 0.02, 4000
    r, c = LADDER.values()
    u = steps(rng, n, hold, -2.0, 2.0)
    v = exact(np.array([[-1 / (r * c)]]), np.array([1 / (r * c)]), u, dt)[:, 0]
    set_to = np.concatenate([u[:1], u[:-1]]) if edge == "before" else u
    signals = {"u": u, "i": read((set_to - v) / r, 3e-4, rng), "v": read(v, 2e-3, rng)}
    return Recording(np.asarray(np.arange(n) * dt, np.float64), signals, 1 / dt)


def test_a_sensor_jumps_with_a_held_input_by_what_the_equations_say() -> None:
    assert {key: str(one) for key, one in feedthroughs(ladder()).items()} == {("i", "u"): "1/R1"}
    assert {key: str(one) for key, one in feedthroughs(mass()).items()} == {("a", "F"): "1/m"}
    assert feedthroughs(motor_on_a_bridge()) == {} == feedthroughs(converter())


@pytest.mark.parametrize("hold", [1, 4])
@pytest.mark.parametrize("edge", ["before", "after"])
@pytest.mark.parametrize("core", [None, "f32", "q31"])
def test_a_current_is_right_on_either_side_of_the_jumps_of_the_voltage(
    core: Core | None, edge: Edge, hold: int
) -> None:
    """Halfway between the sides R1 is some 10 % off, or the equations are said to lack something."""
    answer = analysed(ladder_run(edge, hold), ladder())
    assert answer.model.signal("i").edge == edge
    values = answer.values if core is None else identify_in_c(answer, core).values
    for name, truth in LADDER.items():
        one = values[name]
        assert one.value is not None and one.se_noise is not None
        assert abs(one.value - truth) < max(3.5 * one.se_noise, 1e-3 * truth), name
    assert answer.found.verdict.status == "good"
    notes = [one for one in answer.recording.notes if "jump" in one]
    assert notes == [f"i jumps with u: its samples are those {edge} the jump"]


@pytest.mark.parametrize("edge", ["before", "after"])
@pytest.mark.parametrize("seed", [0, 1, 2, 5])
def test_side_of_jumps_that_a_slow_current_hardly_shows_is_in_the_errors(edge: Edge, seed: int) -> None:
    """Halfway R0 is 4.5 % off, 30 standard errors of noise."""
    model = Model("cell")
    i = model.input("i", "A", hold="zoh", reach=21, gain_sd=0)
    v, h = model.sensor("v", "V", resolution=1.4e-3, reach=9, gain_sd=0), model.unmeasured("h", "V")
    E, R0 = model.unknown("E", "V", 7.5), model.unknown("R0", "ohm", 5e-3)
    R1, T1 = model.unknown("R1", "ohm", 3.5e-3), model.known("T1", "s", 12.4)
    model.equation(v - E + R0 * i + h)
    model.equation(T1 * h.d() + h - R1 * i)
    rng, dt, n = np.random.default_rng(seed), 1.09, 3100
    t = np.arange(n) * dt
    growth = np.log(6) / t[-1]
    current = 4 + 14 * np.sin(2 * np.pi * 5e-4 * np.expm1(growth * t) / growth)
    slow = exact(np.array([[-1 / 12.4]]), np.array([5.3e-3 / 12.4]), current, dt)[:, 0]
    set_to = np.concatenate([current[:1], current[:-1]]) if edge == "before" else current
    signals = {"i": current, "v": read(7.47 - 8.6e-3 * set_to - slow, 1.4e-3, rng)}
    answer = analysed(Recording(np.asarray(t, np.float64), signals, 1 / dt), model.compiled("cell"))
    sure = answer.model.signal("v").edge == edge
    for name, truth in {"R0": 8.6e-3, "R1": 5.3e-3}.items():
        one = answer.values[name]
        assert one.value is not None and one.se is not None
        assert abs(one.value - truth) < 2 * one.se, name
        assert one.se < 0.01 * truth if sure else 0.03 * truth < one.se < 0.1 * truth
