"""Mechanisms of a user, simulated in closed form or by tests/runge_kutta.py: what only they showed."""

import re
from functools import cache
from math import tanh

import numpy as np
import numpy.typing as npt
import pytest
from runge_kutta import States, motion

from pvid.configuration.weak_q31 import weak_q31_to_identify
from pvid.identification.advice import advice_on
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.core import CoreAnswer, identify_in_c
from pvid.identification.core_refined import RefinedCoreAnswer, refined_in_c
from pvid.identification.refinement.inputs import smooth
from pvid.identification.refinement.problem import RefinedMechanism, refine_mechanism
from pvid.model import Model
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.identify import ready
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]


def read(x: Float, lsb: float, seed: int) -> Float:
    """By a sensor with white noise of half a step."""
    noise = np.random.default_rng(seed).normal(0.0, 0.5 * lsb, len(x))
    return np.asarray(np.rint((x + noise) / lsb) * lsb)


def held_at_random(n: int, low: int, high: int, reach: float, seed: int) -> Float:
    """Random values, each for low to high samples."""
    random = np.random.default_rng(seed)
    lengths = random.integers(low, high, n // low + 1)
    return np.repeat(random.uniform(-reach, reach, len(lengths)), lengths)[:n]


def recorded(dt: float, **signals: Float) -> Recording:
    n = len(next(iter(signals.values())))
    return Recording(np.asarray(np.arange(n) * dt, np.float64), signals, 1 / dt)


def of_core(found: CoreAnswer | RefinedCoreAnswer, name: str) -> tuple[float, float]:
    """Value and standard error."""
    one = found.values[name]
    assert one.value is not None and one.se is not None
    return one.value, one.se


def errors_over_se(found: RefinedMechanism, truth: dict[str, float]) -> Float:
    return np.array([(found.values[name] - one) / found.errors[name] for name, one in truth.items()])


def test_a_sampled_input_is_a_cubic_between_its_samples() -> None:
    """Of a sine with 20 samples a period a straight line is up to 1.2 % short, the cubic 0.02 %."""
    w = 2 * np.pi / 20
    k = np.arange(60, dtype=np.float64)
    sampled: Float = np.sin(w * k, dtype=np.float64)
    found = smooth(sampled, 2).reshape(60, 2, 3)
    place = k[:, None, None] + np.array([[0, 0.25, 0.5], [0.5, 0.75, 1]])
    assert np.abs(found - np.sin(w * place))[1:-2].max() < 3e-4
    assert np.abs(found - np.sin(w * place))[:-1].max() < 5e-3  # at the ends a parabola
    line = smooth(2.0 * k, 4).reshape(60, 4, 3)
    assert np.abs(line[:, 0, 0] - 2.0 * k).max() < 1e-12 and np.abs(line[:, 3, 2] - 2.0 * (k + 1)).max() < 1e-12


def test_the_refinement_of_a_mass_on_a_shaker_has_the_stiffness_that_its_samples_show() -> None:
    """Sampled 20 times in the period of the fastest sine, as the documentation wants it."""
    model = Model("mass on a shaker")
    r = model.sensor("r", "m", resolution=1e-6, reach=0.02, driven=True, gain_sd=0)
    x = model.sensor("x", "m", resolution=1e-5, reach=0.05)
    c, k = model.unknown("c", "1/s", 10.0), model.unknown("k", "1/s^2", 700.0)
    model.equation(x.d(2) + c * x.d() + k * (x - r))
    truth = {"c": 14.0, "k": 1000.0}
    dt, n = 1 / 200, 4000
    t = np.arange(n) * dt
    shaken, moved = np.zeros(n), np.zeros(n)
    for hz, size, phase in ((1.3, 5e-3, 0.3), (4.1, 4e-3, 1.0), (10.0, 8e-3, 2.0)):
        s = 2j * np.pi * hz
        wave = size * np.exp(s * t + 1j * phase)
        shaken += wave.real
        moved += (wave * truth["k"] / (s**2 + truth["c"] * s + truth["k"])).real
    signals = {"r": read(shaken, 1e-6, 1), "x": read(moved, 1e-5, 2)}
    found = refine_mechanism(model.compiled("shaker"), signals, 1 / dt, np.array([14.2, 990.0]), 2.0)
    assert found.found.converged and found.found.slow_chi2 < 1.3
    assert np.abs(errors_over_se(found, truth)).max() < 3  # with a straight line between samples 15


DRAG = {"J": 0.03, "D": 0.012, "G": 1.3}


def drag_model() -> CompiledModel:
    model = Model("body in water")
    u = model.input("u", "N*m", hold="zoh", reach=1, gain_sd=0)
    a = model.sensor("a", "rad", resolution=2 * np.pi / 2**12, reach=2)
    J, D, G = (model.unknown("J", "kg*m^2", 0.02), model.unknown("D", "kg*m^2", 0.01), model.unknown("G", "N*m", 1.0))
    model.equation(J * a.d(2) + D * abs(a.d()) * a.d() + G * a - u)
    return model.compiled("water")


def drag_answer() -> Analysis:
    """Driven by steps, 24 s at 500 Hz."""
    dt = 1 / 500
    u = held_at_random(12_000, 60, 500, 0.9, 3)

    def rate(x: States, torque: float) -> States:
        return x[1], (torque - DRAG["D"] * abs(x[1]) * x[1] - DRAG["G"] * x[0]) / DRAG["J"]

    a = motion(rate, (0.0, 0.0), u, dt, 4)[:, 0]
    return analysed(recorded(dt, u=u, a=read(a, 2 * np.pi / 2**12, 4)), drag_model())


def test_an_absolute_value_is_refined() -> None:
    """|v| v, whose derivative has the sign of v."""
    answer = drag_answer()
    found = refine_mechanism(answer.model, answer.recording.signals, 500.0, answer.found.p, 4.0)
    assert found.found.converged and found.found.slow_chi2 < 1.3
    assert np.abs(errors_over_se(found, DRAG)).max() < 3.5


def test_a_drive_of_steps_is_refined_in_c() -> None:
    """A circuit, whose equations are of the first order. A jump of the voltage within a step of Adams, which is several
    samples long, was an error of the motion: no block fitted."""
    model = Model("series circuit")
    V = model.input("V", "V", hold="zoh", reach=5, gain_sd=0)
    i = model.sensor("i", "A", resolution=1 / 2**12, reach=0.5)
    v = model.sensor("v", "V", resolution=20 / 2**12, reach=10)
    R, L, C = model.unknown("R", "ohm", 5.0), model.unknown("L", "H", 0.1), model.unknown("C", "F", 1e-3)
    model.equation(L * i.d() + R * i + v - V)
    model.equation(C * v.d() - i)
    truth, dt = {"R": 4.0, "L": 0.08, "C": 1.4e-3}, 5e-4
    voltage = held_at_random(8000, 10, 200, 5.0, 5)

    def rate(x: States, now: float) -> States:
        return (now - truth["R"] * x[0] - x[1]) / truth["L"], x[0] / truth["C"]

    x = motion(rate, (0.0, 0.0), voltage, dt, 2)
    recording = recorded(dt, V=voltage, i=read(x[:, 0], 1 / 2**12, 6), v=read(x[:, 1], 20 / 2**12, 7))
    found = refined_in_c(identify_in_c(analysed(recording, model.compiled("circuit")), "f32"))
    assert found.adopted and found.level is not None and found.level < 1.3
    for name, one in truth.items():
        value, se = of_core(found, name)
        assert abs(value - one) < 3.5 * se


def test_an_input_that_is_known_exactly_costs_fixed_point_no_digits() -> None:
    """Of a mass with a force alone the mean of a window has no noise, and the force lies between counts: with that of
    15 bits of the reach the standard errors were 2.7 times those of float32, with the full weight of the mean 4.5."""
    model = Model("cart that is pushed")
    u = model.input("u", "N", hold="zoh", reach=3, gain_sd=0)
    x = model.sensor("x", "m", resolution=1e-4, reach=20)
    m, b = model.unknown("m", "kg", 0.4), model.unknown("b", "N*s/m", 0.3)
    model.equation(m * x.d(2) + b * x.d() - u)
    truth = {"m": 0.55, "b": 0.4}
    dt, n = 1e-3, 20_000
    force = held_at_random(n, 50, 400, 1.2, 1)
    keep = np.exp(-truth["b"] / truth["m"] * dt)
    v, place = np.zeros(n), np.zeros(n)
    for k in range(n - 1):
        end = force[k] / truth["b"]
        v[k + 1] = end + (v[k] - end) * keep
        place[k + 1] = place[k] + end * dt + (v[k] - end) * truth["m"] / truth["b"] * (1 - keep)
    answer = analysed(recorded(dt, u=force, x=read(place, 1e-4, 1)), model.compiled("pushed"))
    single, fixed = identify_in_c(answer, "f32"), identify_in_c(answer, "q31")
    assert fixed.misfit is not None and fixed.misfit < 1.3
    for name, one in truth.items():
        value, se = of_core(fixed, name)
        assert se < 1.5 * of_core(single, name)[1]
        assert abs(value - one) < 3.5 * se
    weak = weak_q31_to_identify(answer.model, answer.recording, answer.ranking)
    place_of_u = weak.sample_names.index("u")
    assert weak.lsb[place_of_u] < ready(answer.model).model.signal("u").reach / 2**15


SPRING = {"m": 1.3, "c": 3.0, "k": 400.0}


@cache
def spring_run(friction: float = 0.0) -> dict[str, Float]:
    """A mass on a spring, pushed by steps, 20 s at 1 kHz."""
    force = held_at_random(20_000, 50, 500, 10.0, 11)

    def rate(x: States, now: float) -> States:
        brake = SPRING["c"] * x[1] + friction * tanh(x[1] / 2e-3)
        return x[1], (now - brake - SPRING["k"] * x[0]) / SPRING["m"]

    return {"F": force, "x": read(motion(rate, (0.0, 0.0), force, 1e-3, 2)[:, 0], 0.1 / 2**12, 12)}


def spring_answer(signals: dict[str, Float], step: float = 1e-3) -> Analysis:
    model = Model("mass and spring")
    F = model.input("F", "N", hold="zoh", reach=10, gain_sd=0)
    x = model.sensor("x", "m", resolution=0.1 / 2**12, reach=0.1)
    m, c, k = model.unknown("m", "kg", 1.0), model.unknown("c", "N*s/m", 4.0), model.unknown("k", "N/m", 300.0)
    model.equation(m * x.d(2) + c * x.d() + k * x - F)
    return analysed(recorded(step, **signals), model.compiled("spring"))


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_dry_friction_that_the_equations_lack_is_named(friction: float) -> None:
    """It counts as 35 % more viscous friction, 14 standard errors; the residuals are an error of the equation."""
    warning = spring_answer(spring_run(friction)).found.verdict.warning
    if not friction:
        assert warning is None
    else:
        assert warning is not None
        named = re.search(r"Equation 1 seems to lack ([0-9.]+)\*sgn\(x\.d\(\)\): with that c would be", warning)
        assert named is not None and abs(float(named[1]) / friction - 1) < 0.1


@pytest.mark.parametrize(
    ("name", "factor", "sentence"),
    [
        ("F", 1.0, None),
        ("F", -1.0, "F seems to have the opposite sign: --columns F=F:-1 (or x: --columns x=x:-1)"),
        ("x", 1e3, "x seems to be in mm, not m: --columns x=x:mm"),
        ("F", 0.0, "F is 0 in every sample: is it the column of the drive?"),
    ],
)
def test_a_sign_or_a_unit_that_is_wrong_is_named(name: str, factor: float, sentence: str | None) -> None:
    run = spring_run()
    found = spring_answer({**run, name: factor * run[name]})
    assert advice_on(found) == ((sentence,) if sentence else ())


@pytest.mark.parametrize(("step", "unit"), [(1.0, "ms"), (1e3, "us")])
def test_a_time_in_another_unit_is_named(step: float, unit: str) -> None:
    """The motion fits as well, with other parameters: only their guesses tell."""
    assert advice_on(spring_answer(spring_run(), step)) == (f"t seems to be in {unit}, not s: --columns t=t:{unit}",)
