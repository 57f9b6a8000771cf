"""What is missing between two masses, behind a measured drive, and in slow sensors. The plants are integrated here."""

import re
from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from pvid.model import Integral, Model, sgn, sin
from pvid.oracle.weak.identify import Identified, identify
from pvid.oracle.weak.naming import terms_of
from pvid.oracle.weak.terms import ACTS, Recorded

Float = npt.NDArray[np.float64]
RATE, SAMPLES, SUBSTEPS = 500.0, 5000, 3
M, K, C, KT, MU = 300.0, 1.7e4, 1300.0, 2e5, 45.0


def quarter_car() -> Model:
    model = Model("quarter car")
    z = model.sensor("z", "m", resolution=1e-5, reach=0.2, driven=True)
    s, u = (model.sensor(name, "m", resolution=1e-5, reach=0.3) for name in "su")
    m, k, c = model.known("m", "kg", M), model.unknown("k", "N/m", 2e4), model.unknown("c", "N*s/m", 1500.0)
    mu, kt = model.unknown("mu", "kg", 40.0), model.unknown("kt", "N/m", 1.8e5)
    model.equation(m * s.d(2) + c * (s.d() - u.d()) + k * (s - u))
    model.equation(mu * u.d(2) - c * (s.d() - u.d()) - k * (s - u) + kt * (u - z))
    return model


def leg() -> Model:
    model = Model("leg of a platform")
    i = model.sensor("i", "A", resolution=5e-3, reach=10, driven=True)
    x = model.sensor("x", "m", resolution=2e-6, reach=0.4)
    m, b, fc = model.unknown("m", "kg", 20.0), model.unknown("b", "N*s/m", 80.0), model.unknown("Fc", "N", 15.0)
    w = model.unknown("w", "N", 50.0, positive=False, sd=100.0)
    kf = model.known("kf", "N/A", 60.0)
    model.equation(m * x.d(2) + b * x.d() + fc * sgn(x.d()) + w - kf * i)
    return model


def drive(parts: tuple[tuple[float, float], ...]) -> Float:
    t = np.arange(SAMPLES) / RATE
    return np.asarray(sum(a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(parts)))


def integrated(slope: Callable[[Float, float], Float], start: Float, u: Float) -> Float:
    """States at the samples [n, states], by Runge and Kutta; u is a straight line between samples."""
    h, x, out = 1 / RATE / SUBSTEPS, start, []
    fine = np.interp(np.arange(2 * SUBSTEPS * len(u) + 1) / (2 * SUBSTEPS), np.arange(len(u)), u)
    for k in range(len(u)):
        out.append(x)
        for a, b, c in (fine[2 * (SUBSTEPS * k + j) :][:3] for j in range(SUBSTEPS)):
            one = slope(x, a)
            two = slope(x + h / 2 * one, b)
            three = slope(x + h / 2 * two, b)
            x = x + h / 6 * (one + 2 * two + 2 * three + slope(x + h * three, c))
    return np.array(out)


def measured(x: Float, resolution: float, seed: int) -> Float:
    noise = np.random.default_rng(seed).normal(0, resolution / 2, len(x))
    return np.asarray(np.round((x + noise) / resolution) * resolution)


@cache
def car(cubic: float) -> dict[str, Float]:
    z = drive(((0.008, 1.1), (0.006, 2.9), (0.004, 7.3)))

    def slope(x: Float, road: float) -> Float:
        s, v, u, w = x
        force = C * (v - w) + K * (s - u) + cubic * (s - u) ** 3
        return np.array([v, -force / M, w, (force - KT * (u - road)) / MU])

    x = integrated(slope, np.zeros(4), z)
    return {name: measured(own, 1e-5, k) for k, (name, own) in enumerate((("z", z), ("s", x[:, 0]), ("u", x[:, 2])))}


def found(model: Model, run: dict[str, Float]) -> Identified:
    return identify(model.compiled("own"), run, RATE)


def test_law_of_a_spring_is_named_in_both_equations_with_a_line_that_adds_it() -> None:
    one = found(quarter_car(), car(4e6))
    assert one.named is not None and one.named.complete and one.verdict.status == "warning"
    term = terms_of(one.fit, one.named)[0]
    assert term.text.startswith("equation 1 seems to lack") and "*(s - u)**3 and equation 2 -" in term.text
    assert term.size is not None and abs(term.size / 4e6 - 1) < 0.05 and term.typed is not None
    model = quarter_car()
    model.add(term.typed.format(a="k3"), sd=1e7)
    again = found(model, car(4e6))
    assert again.verdict.status == "good" and abs(again.values["k3"][0] / 4e6 - 1) < 0.02
    assert abs(again.values["k"][0] / K - 1) < 0.005
    assert found(quarter_car(), car(0.0)).named is None


def test_measured_drive_that_acts_less_at_its_peaks_is_named() -> None:
    i = drive(((1.0, 1.7), (0.8, 4.1), (0.5, 9.0)))

    def slope(x: Float, amps: float) -> Float:
        force = 60 * amps * (1 - 0.1 * abs(amps)) - 110 * x[1] - 18 * np.tanh(x[1] / 1e-3)
        return np.array([x[1], force / 25])

    run = {"i": measured(i, 5e-3, 1), "x": measured(integrated(slope, np.zeros(2), i)[:, 0], 2e-6, 2)}
    one = found(leg(), run)
    assert one.named is not None and one.named.complete
    assert terms_of(one.fit, one.named)[0].text.startswith("i acts as i*(1 - 0.")


def test_slow_noisy_sensor_that_is_late_is_named_with_its_delay() -> None:
    model = Model("tanks")
    a = model.sensor("a", "K", resolution=0.05, reach=20, driven=True)
    b, c = (model.sensor(name, "K", resolution=0.05, reach=20) for name in "bc")
    p, q, r = (model.unknown(name, "1/s", guess) for name, guess in (("p", 2.0), ("q", 1.5), ("r", 1.5)))
    model.equation(b.d() + p * (b - a) + q * (b - c))
    model.equation(c.d() + r * (c - b))
    u = 5 * drive(((1.0, 0.11), (0.8, 0.37), (0.6, 0.9)))

    def slope(x: Float, warm: float) -> Float:
        return np.array([2.5 * (warm - x[0]) + 1.2 * (x[1] - x[0]), 2.0 * (x[0] - x[1])])

    x = integrated(slope, np.zeros(2), u)
    late = np.interp(np.arange(SAMPLES) - 15, np.arange(SAMPLES), x[:, 0])
    run = {"a": measured(u, 0.05, 1), "b": measured(late, 0.05, 2), "c": measured(x[:, 1], 0.05, 3)}
    one = found(model, run)
    assert one.named is not None and one.named.complete
    (text,) = (term.text for term in terms_of(one.fit, one.named))
    delay = re.fullmatch(r"b seems to be delayed by ([\d.]+) s", text)
    assert delay is not None and float(delay[1]) == pytest.approx(0.030, abs=1.5e-3)  # 15 samples
    assert found(model, run | {"b": measured(x[:, 0], 0.05, 2)}).verdict.status == "good"


def test_curved_sensor_beyond_what_it_can_show_stays_finite() -> None:
    curved = next(act.exact for act in ACTS if act.exact is not None and act.text.startswith("shows"))
    assert curved is not None
    signal = leg().compiled("own").signal("x")
    of = Recorded(signal, np.linspace(-1, 1, 101), RATE, 1.0, 1.0)
    assert all(np.isfinite(curved.of(of, level)).all() for level in (-0.9, -0.1, 0.14, 0.2, 0.9))


def geared() -> Model:
    model = Model("elastic axis behind a gear")
    torque = model.sensor("T", "N*m", resolution=1e-4, reach=1, driven=True)
    a = model.sensor("a", "rad", resolution=2e-4, reach=2000)
    b = model.sensor("b", "rad", resolution=1e-5, reach=100)
    n, j1 = model.known("N", "", 20.0), model.unknown("J1", "kg*m^2", 5e-5)
    j2, k = model.unknown("J2", "kg*m^2", 0.1), model.unknown("k", "N*m/rad", 100.0)
    d, b1 = model.unknown("d", "N*m*s/rad", 0.1), model.unknown("b1", "N*m*s/rad", 1e-3)
    b2 = model.unknown("b2", "N*m*s/rad", 0.05)
    spring = k * (a / n - b) + d * (a.d() / n - b.d())
    model.equation(j1 * a.d(2) + b1 * a.d() + spring / n - torque)
    model.equation(j2 * b.d(2) + b2 * b.d() - spring)
    return model


@cache
def axis(cubic: float) -> tuple[Float, Float]:
    """Torque, and the states of the motor and the load."""
    torque = 0.1 * drive(((1.0, 0.9), (0.7, 4.6), (0.5, 11.3)))

    def slope(x: Float, u: float) -> Float:
        a, v, b, w = x
        force = 80 * (a / 20 - b) + 0.06 * (v / 20 - w) + cubic * (a / 20 - b) ** 3
        return np.array([v, (u - 4e-4 * v - force / 20) / 1.1e-4, w, (force - 0.12 * w) / 0.05])

    return torque, integrated(slope, np.zeros(4), torque)


def of_axis(torque: Float, a: Float, b: Float) -> dict[str, Float]:
    return {"T": measured(torque, 1e-4, 1), "a": measured(a, 2e-4, 2), "b": measured(b, 1e-5, 3)}


def test_spring_behind_a_gear_acts_in_each_equation_by_its_ratio() -> None:
    torque, x = axis(2e4)
    one = found(geared(), of_axis(torque, x[:, 0], x[:, 2]))
    assert one.named is not None and one.named.complete
    typed = terms_of(one.fit, one.named)[0].typed
    assert typed == "equation 1: {a}*(a/20 - b)**3; equation 2: -20*{a}*(a/20 - b)**3"


def test_late_encoder_whose_delay_looks_like_damping_is_named() -> None:
    torque, x = axis(0.0)
    late = np.interp(np.arange(SAMPLES) - 0.75, np.arange(SAMPLES), x[:, 2])
    one = found(geared(), of_axis(torque, x[:, 0], late))
    assert one.named is not None and one.named.complete
    named = {terms_of(one.fit, one.named)[0].text, *terms_of(one.fit, one.named)[0].instead}
    assert named == {"b seems to be delayed by 0.0015 s", "b follows behind a lag of 0.0015 s"}
    assert found(geared(), of_axis(torque, x[:, 0], x[:, 2])).verdict.status == "good"


def test_law_of_a_running_integral_is_named_with_its_size() -> None:
    model = Model("torsion bench with a rate gyro")
    torque = model.sensor("T", "N*m", resolution=1e-3, reach=2, driven=True)
    w = model.sensor("w", "rad/s", resolution=2e-3, reach=20)
    s = model.define("s", "rad", Integral(w, 1))
    i, b = model.unknown("I", "kg*m^2", 0.01), model.unknown("b", "N*m*s/rad", 0.1)
    model.equation(i * w.d() + b * w + model.unknown("k", "N*m/rad", 1.0) * s - torque)
    u = 0.5 * drive(((1.0, 0.6), (0.7, 1.9), (0.5, 4.7)))

    def slope(x: Float, u: float) -> Float:
        return np.array([x[1], (u - 0.05 * x[1] - 1.5 * x[0] - 0.8 * x[0] ** 3) / 0.02])

    run = {"T": measured(u, 1e-3, 1), "w": measured(integrated(slope, np.zeros(2), u)[:, 1], 2e-3, 2)}
    one = found(model, run)
    assert one.named is not None and one.named.complete
    term = terms_of(one.fit, one.named)[0]
    assert term.typed == "equation 1: {a}*s**3" and term.size is not None and abs(term.size / 0.8 - 1) < 0.05


def test_standard_errors_contain_what_the_run_does_not_distinguish() -> None:
    """A spring to the frame looks like gravity, but for what a sine is more than its angle."""
    model = Model("two coupled pendulums")
    q, r = (model.sensor(name, "rad", resolution=4e-4, reach=3) for name in "qr")
    for this, other, k in ((q, r, 1), (r, q, 2)):
        c, w = model.unknown(f"c{k}", "1/s", 0.1), model.unknown(f"w{k}", "1/s^2", 30.0)
        spring = model.unknown(f"k{k}", "1/s^2", 3.0) * (this - other)
        model.equation(this.d(2) + c * this.d() + w * sin(this) + spring)

    def slope(x: Float, _: float) -> Float:
        a, v, b, w = x
        own = -0.1 * w - 20 * np.sin(b) - 1.3 * b - 2.2 * (b - a)
        return np.array([v, -0.07 * v - 18 * np.sin(a) - 2 * (a - b), w, own])

    x = integrated(slope, np.array([0.9, 0.0, -0.35, 0.0]), np.zeros(SAMPLES))
    one = found(model, {"q": measured(x[:, 0], 4e-4, 1), "r": measured(x[:, 2], 4e-4, 2)})
    truth = {"c1": 0.07, "w1": 18.0, "k1": 2.0, "c2": 0.1, "w2": 20.0, "k2": 2.2}
    assert one.named is not None
    assert all(abs(one.values[name][0] - p) < 2 * one.values[name][1] for name, p in truth.items())


def test_offset_of_an_input_that_multiplies_a_state_is_among_what_may_be_meant() -> None:
    model = Model("stirred reactor")
    q = model.input("q", "1/s", hold="zoh", reach=2)
    c = model.sensor("c", "", resolution=2e-3, reach=3)
    y = model.sensor("y", "K", resolution=0.02, reach=100)
    k, h, u = model.unknown("k", "1/s", 1.0), model.unknown("h", "K", 5.0), model.unknown("U", "1/s", 0.5)
    model.equation(c.d() - q * (2 - c) + k * c)
    model.equation(y.d() + q * y - h * k * c + u * y)
    feed = np.repeat(0.7 + 0.4 * np.random.default_rng(4).uniform(-1, 1, SAMPLES // 400 + 1), 400)[:SAMPLES]
    x, out = np.array([0.9, 8.0]), []
    for flow in feed + 0.06:  # held between samples, each by a step of the exact solution's first terms
        out.append(x)
        for _ in range(4):
            rate = np.array([flow * (2 - x[0]) - 0.6 * x[0], 8 * 0.6 * x[0] - (flow + 0.25) * x[1]])
            mid = x + rate / RATE / 8
            rate = np.array([flow * (2 - mid[0]) - 0.6 * mid[0], 8 * 0.6 * mid[0] - (flow + 0.25) * mid[1]])
            x = x + rate / RATE / 4
    c_, y_ = np.array(out).T
    one = found(model, {"q": feed, "c": measured(c_, 2e-3, 1), "y": measured(y_, 0.02, 2)})
    assert one.named is not None
    texts = [text for term in terms_of(one.fit, one.named) for text in (term.text, *term.instead)]
    assert any(text.startswith("q has an offset of -0.0") for text in texts)
    assert abs(one.values["U"][0] - 0.25) < 2 * one.values["U"][1]
