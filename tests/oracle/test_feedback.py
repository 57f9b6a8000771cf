"""`feedback` is a controller's: an input that is a function of the outputs for another reason has no warning."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from pvid.model import Model, sgn, sin
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import identify

Float = npt.NDArray[np.float64]
Law = Callable[[int, float], float]

RATE = 500.0
SAMPLES = 6000
LSB = 2 * np.pi / 4096


def smooth_noise(seed: int, size: float) -> Float:
    """Of a hand or a load: no faster than some Hz."""
    walk = np.cumsum(np.random.default_rng(seed).normal(size=SAMPLES))
    slow = np.convolve(walk, np.ones(50) / 50, "same")
    slow -= np.convolve(slow, np.ones(1000) / 1000, "same")
    return np.asarray(size * slow / np.std(slow))


def pendulum() -> CompiledModel:
    model = Model("driven pendulum")
    u = model.input("u", "N*m", hold="zoh", reach=10, gain_sd=0)
    q = model.sensor("q", "rad", resolution=LSB, reach=4)
    J, G, b = (model.unknown("J", "kg*m^2", 0.15), model.unknown("G", "N*m", 3.0), model.unknown("b", "N*m*s", 0.05))
    model.equation(J * q.d(2) + G * sin(q) + b * q.d() - u)
    return model.compiled("pendulum")


def pendulum_run(law: Law, push: Float | None = None, start: float = 0.0) -> dict[str, Float]:
    """J 0.19, G 3.7, b 0.3; the law reads what the encoder measures, an external torque pushes."""
    random, dt, parts = np.random.default_rng(2), 1 / RATE, 4
    external = np.zeros(SAMPLES) if push is None else push
    angle, speed = start, 0.0
    u, q = np.empty(SAMPLES), np.empty(SAMPLES)
    for k in range(SAMPLES):
        q[k] = np.rint((angle + random.normal(0.0, 0.5 * LSB)) / LSB) * LSB
        u[k] = law(k, q[k])
        for _ in range(parts):  # of the midpoint rule
            middle = angle + speed * dt / parts / 2
            rate = (u[k] + external[k] - 3.7 * np.sin(middle) - 0.3 * speed) / 0.19
            angle, speed = angle + (speed + rate * dt / parts / 2) * dt / parts, speed + rate * dt / parts
    return {"u": u, "q": q}


def regulated(kp: float, kd: float = 0.0, ki: float = 0.0, wanted: Float | None = None) -> Law:
    """PID of what is measured, the rate from differences."""
    last, total = 0.0, 0.0
    reference = np.full(SAMPLES, 0.3) if wanted is None else wanted

    def law(k: int, q: float) -> float:
        nonlocal last, total
        error = reference[k] - q
        total += error / RATE
        rate, last = (q - last) * RATE, q
        return float(kp * error - kd * rate + ki * total)

    return law


def warned(model: CompiledModel, run: dict[str, Float], rate: float = RATE, window_s: float = 1.0) -> bool:
    found = identify(model, run, rate, design=WeakDesign(rate, window_s, 12, 6))
    return any(one.name == "feedback" for one in found.verdict.reasons)


LOOPS: dict[str, Callable[[], dict[str, Float]]] = {
    "PD, constant reference, pushed": lambda: pendulum_run(regulated(12, 0.6), smooth_noise(1, 2.0)),
    "PD, constant reference, released": lambda: pendulum_run(regulated(6, 0.05), start=1.0),
    "PID, constant reference, pushed": lambda: pendulum_run(regulated(12, 0.6, 10.0), smooth_noise(1, 2.0)),
    "gravity compensated, pushed": lambda: pendulum_run(lambda k, q: 3.7 * float(np.sin(q)), smooth_noise(1, 0.5)),
    "gravity compensated, torque read back in steps": lambda: pendulum_run(
        lambda k, q: 0.0088 * round(3.7 * float(np.sin(q)) / 0.0088), smooth_noise(1, 0.5)
    ),
}


@pytest.mark.parametrize("name", LOOPS)
def test_controller_without_excitation_is_named(name: str) -> None:
    assert warned(pendulum(), LOOPS[name]())


@pytest.mark.parametrize("amplitude", [0.3, 1.0])
def test_loop_with_excitation_is_none(amplitude: float) -> None:
    """A reference that moves, or a dither: they are what identifies the mechanism."""
    random = np.random.default_rng(3)
    wanted, dither = (np.repeat(amplitude * random.uniform(-1, 1, SAMPLES // each), each) for each in (500, 50))
    shaken = regulated(12, 0.6)
    assert not warned(pendulum(), pendulum_run(regulated(12, 0.6, wanted=wanted)))
    assert not warned(pendulum(), pendulum_run(lambda k, q: shaken(k, q) + dither[k]))


def motor() -> CompiledModel:
    model = Model("motor")
    V = model.input("V", "V", hold="zoh", reach=12, gain_sd=0)
    i = model.sensor("i", "A", resolution=0.0025, reach=5)
    w = model.sensor("w", "rad/s", resolution=0.05, reach=200)
    R, L, k = model.unknown("R", "ohm", 2.0), model.unknown("L", "H", 3e-3), model.unknown("k", "N*m/A", 0.04)
    J, Tc = model.unknown("J", "kg*m^2", 1e-4), model.unknown("Tc", "N*m", 0.01)
    model.equation(L * i.d() + R * i + k * w - V)
    model.equation(J * w.d() + Tc * sgn(w) - k * i)
    return model.compiled("motor")


def motor_run(V: Float, drop: float = 0.0) -> dict[str, Float]:
    """200 Hz: L/R is 1.1 ms, so that V = R i + k w holds at every sample; a brush drop that the equations lack."""
    random, dt, parts = np.random.default_rng(4), 5e-3, 40
    current, speed = 0.0, 0.0
    out = np.empty((len(V), 2))
    for k, now in enumerate(V):
        out[k] = current, speed
        for _ in range(parts):
            back = 2.1 * current + 0.042 * speed + drop * np.tanh(current / 0.02)
            current += (now - back) / 2.3e-3 * dt / parts
            speed += (0.042 * current - 0.01 * np.tanh(speed / 0.5)) / 1.3e-4 * dt / parts
    noise = random.normal(0.0, 0.5, out.shape)
    i, w = (np.rint(out[:, k] / lsb + noise[:, k]) * lsb for k, lsb in enumerate((0.0025, 0.05)))
    return {"V": V, "i": i, "w": w}


_T = np.arange(4000) * 5e-3
DRIVES: dict[str, Float] = {
    "two levels": np.where(np.sin(2 * np.pi * 0.3 * _T) > 0, 6.0, -4.0),
    "random steps": np.repeat(np.random.default_rng(5).uniform(-9, 9, 100), 40),
    "a ramp": np.linspace(1.0, 11.0, 4000),
    "a triangle": 9.0 * (2 * np.abs((0.1 * _T) % 1 - 0.5) - 0.5) * 2,
    "a slow sine": 9.0 * np.sin(2 * np.pi * 0.2 * _T),
    "sines": 5.0 * np.sin(2 * np.pi * 0.2 * _T) + 3.0 * np.sin(2 * np.pi * 1.3 * _T),
}


@pytest.mark.parametrize("drop", [0.0, 0.5])
@pytest.mark.parametrize("name", DRIVES)
def test_drive_of_a_mechanism_that_is_fast_beside_it_is_none(name: str, drop: float) -> None:
    """The outputs explain more than 99 % of it, and more than the model where that lacks a term."""
    assert not warned(motor(), motor_run(DRIVES[name], drop), 200.0, 2.0)


def test_duty_of_a_measured_supply_is_none() -> None:
    """V = d vb: the model has no row in which d is known."""
    model = Model("motor on a bridge")
    d = model.input("d", "", hold="zoh", reach=1, gain_sd=0)
    vb = model.sensor("vb", "V", resolution=5e-3, reach=15, driven=True)
    i = model.sensor("i", "A", resolution=0.0025, reach=5)
    w = model.sensor("w", "rad/s", resolution=0.05, reach=200)
    R, L, k, J = (
        model.unknown("R", "ohm", 2.0),
        model.unknown("L", "H", 3e-3),
        model.unknown("k", "N*m/A", 0.04),
        model.unknown("J", "kg*m^2", 1e-4),
    )
    model.equation(L * i.d() + R * i + k * w - d * vb)
    model.equation(J * w.d() - k * i)
    supply = 12 + 0.2 * np.sin(2 * np.pi * 0.7 * _T)
    run = motor_run(DRIVES["sines"])
    run |= {"d": run.pop("V") / 12, "vb": np.rint(supply / 5e-3) * 5e-3}
    assert not warned(model.compiled("bridge"), run, 200.0, 2.0)
