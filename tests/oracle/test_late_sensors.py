"""A sensor that is late, where a parameter, a window or a collapse of the mechanism would hide it: it is named, and no
parameter is given as sure beside it."""

import re

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import cont2discrete

from pvid.model import Model
from pvid.oracle.weak.identify import Identified, identify

Float = npt.NDArray[np.float64]


def swing(a: list[list[float]], b: list[float], u: Float, dt: float) -> Float:
    """States [n, k] of x' = a x + b u, with a held input [n]."""
    ad, bd, *_ = cont2discrete((np.array(a), np.array(b)[:, np.newaxis], np.eye(len(b)), 0), dt)
    x = np.zeros((len(u), len(b)))
    for k in range(len(u) - 1):
        x[k + 1] = ad @ x[k] + bd[:, 0] * u[k]
    return x


def steps(rng: np.random.Generator, n: int, longest: int) -> Float:
    """Of random height and length [n]."""
    out, at = np.empty(n), 0
    while at < n:
        length = int(rng.integers(2, longest))
        out[at : at + length] = rng.uniform(-1, 1)
        at += length
    return out


def late(x: Float, samples: float) -> Float:
    place = np.arange(len(x), dtype=np.float64)
    return np.interp(place - samples, place, x)


def of(model: Model, run: dict[str, Float], dt: float) -> Identified:
    return identify(model.compiled(), run, 1 / dt)


@pytest.mark.by_day(1)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_delay_that_a_damping_imitates_in_one_of_two_equations(seed: int) -> None:
    """Displacement late, acceleration not: the spring's force of the delay looks like damping, 80 % more of it."""
    rng, n, dt, m, c, k = np.random.default_rng(seed), 8000, 1e-3, 2.4, 9.0, 4200.0
    force = 20 * steps(rng, n, 400)
    x = swing([[0, 1], [-k / m, -c / m]], [0, 1 / m], force, dt)
    model = Model("shaker")
    F, z = model.input("F", "N", hold="zoh"), model.sensor("z", "m", noise=5e-6)
    a = model.sensor("a", "m/s^2", noise=0.05)
    mass, damping, stiffness = (
        model.unknown(name, unit, guess)
        for name, unit, guess in (
            ("m", "kg", 1.3 * m),
            ("c", "N*s/m", 0.7 * c),
            ("k", "N/m", 1.2 * k),
        )
    )
    own = damping * z.d() + stiffness * z
    model.equation(mass * z.d(2) + own - F)
    model.equation(mass * a + own - F)
    run = {
        "F": force,
        "z": late(x[:, 0], 1.8) + 5e-6 * rng.standard_normal(n),
        "a": (force - c * x[:, 1] - k * x[:, 0]) / m + 0.05 * rng.standard_normal(n),
    }
    found = of(model, run, dt)
    text = " ".join(one.text for one in found.verdict.reasons if one.alarm)
    assert re.search(
        r"z seems to be delayed by 0\.001[6-9] s: with that c would be (8\.9|9\.0)",
        text,
    )
    assert abs(found.p[1] - c) < 2 * found.se[1]


@pytest.mark.by_day(1)
@pytest.mark.parametrize("seed", [309, 409, 509])
def test_delay_that_only_the_windows_left_out_show(seed: int) -> None:
    """A current read late, after steps of the voltage: the windows of few of them were left out as spoiled."""
    rng, n, dt = np.random.default_rng(seed), 8000, 5e-4
    R, L, B, M, c, k = 3.0, 1.5e-3, 5.0, 0.05, 0.9, 600.0
    volts = 6 * steps(rng, n, 1000)
    x = swing(
        [[-R / L, 0, -B / L], [0, 0, 1], [B / M, -k / M, -c / M]],
        [1 / L, 0, 0],
        volts,
        dt,
    )
    model = Model("coil")
    V = model.input("V", "V", hold="zoh")
    i, q = model.sensor("i", "A", noise=2e-3), model.sensor("q", "m", noise=2e-6)
    p = {
        name: model.unknown(name, unit, guess)
        for name, unit, guess in (
            *(("R", "ohm", 1.2 * R), ("L", "H", 1.4 * L), ("B", "N/A", 0.8 * B)),
            *(("M", "kg", 1.3 * M), ("c", "N*s/m", 1.4 * c), ("k", "N/m", 0.8 * k)),
        )
    }
    model.equation(p["L"] * i.d() + p["R"] * i + p["B"] * q.d() - V)
    model.equation(p["M"] * q.d(2) + p["c"] * q.d() + p["k"] * q - p["B"] * i)
    run = {
        "V": volts,
        "i": late(x[:, 0], 1.9) + 2e-3 * rng.standard_normal(n),
        "q": x[:, 1] + 2e-6 * rng.standard_normal(n),
    }
    found = of(model, run, dt)
    text = " ".join(one.text for one in found.verdict.reasons if one.alarm)
    assert "i seems to be delayed by 0.000" in text or "may bias L by" in text
    assert np.all(np.abs(found.p - [R, L, B, M, c, k]) < 3 * found.se)


@pytest.mark.by_day(1)
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("cause", ["u acts late", "h follows behind a lag"])
def test_cause_in_time_is_among_those_named_where_the_sensor_is_noisy(cause: str, seed: int) -> None:
    """The mean of two samples has less noise than one of them, and a corrected lag more: neither decides."""
    rng, n, dt, a, b = np.random.default_rng(seed), 4000, 0.5, 6.8e-3, 9.2e-3
    level = 0.6 + 0.35 * steps(rng, n, 400)
    h = swing([[-b]], [a], level, dt)[:, 0]
    recorded = late(level, -2.5) if cause == "u acts late" else level
    if cause != "u acts late":
        for k in range(1, n):
            h[k] = h[k - 1] + (h[k] - h[k - 1]) / 4
    model = Model("vessel")
    u, sensor = model.input("u", "1", hold="zoh"), model.sensor("h", "m", noise=1e-3)
    gain, rate = model.unknown("a", "m/s", 1.3 * a), model.unknown("b", "1/s", 0.8 * b)
    model.equation(sensor.d() - gain * u + rate * sensor)
    run = {"u": recorded, "h": h + 1e-3 * rng.standard_normal(n)}
    text = " ".join(one.text for one in of(model, run, dt).verdict.reasons if one.alarm)
    assert cause in text
