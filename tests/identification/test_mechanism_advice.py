"""Advice on signs and units: right where a column is wrong, silent on clean recordings and on missing terms."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from pendulum_plant import simulate
from runge_kutta import States, motion

from pvid.base.wording import listed
from pvid.identification.advice import advice_on, advised
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.model import Model, sgn, sin
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import identify
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.rig.sensor_steps import with_resolutions
from pvid.sim.simulated_run import simulation_of

Float = npt.NDArray[np.float64]

SECONDS = 12.0


@dataclass(frozen=True)
class Case:
    """A mechanism with its recordings: `rate_of(extra)` is x' of (x, u), with a term that the model lacks."""

    model: CompiledModel
    rate: float
    drive: Callable[[Float], Float]
    rate_of: Callable[[float], Callable[[States, float], States]]
    states: int
    lsb: float

    def run(self, extra: float, seed: int) -> dict[str, Float]:
        """The input, then the sensor."""
        random = np.random.default_rng(seed)
        n = round(SECONDS * self.rate)
        steps = np.repeat(random.uniform(-0.5, 0.5, n // 50 + 1), 50)[:n]
        u = self.drive(np.arange(n) / self.rate) * (1 + steps)
        y = motion(self.rate_of(extra), (0.0,) * self.states, u, 1 / self.rate, 4)[:, 0]
        given, sensor = (one.name for one in self.model.signals)
        return {given: u, sensor: np.rint(y / self.lsb + random.normal(0.0, 0.5, n)) * self.lsb}


def _spring() -> Case:
    model = Model("cart on a spring")
    F, x = (model.input("F", "N", hold="zoh", reach=10, gain_sd=0), model.sensor("x", "m", resolution=1e-5, reach=0.2))
    m, c, k = model.unknown("m", "kg", 1.0), model.unknown("c", "N*s/m", 1.5), model.unknown("k", "N/m", 100.0)
    model.equation(m * x.d(2) + c * x.d() + k * x - F)

    def rate_of(extra: float) -> Callable[[States, float], States]:
        return lambda s, u: (s[1], (u - 1.7 * s[1] - 82 * s[0] - extra * 2e3 * s[0] ** 3) / 1.3)

    return Case(model.compiled("spring"), 500.0, lambda t: 4 * np.sin(4.0 * t) + 2 * np.sin(13 * t), rate_of, 2, 1e-5)


def _pendulum() -> Case:
    model = Model("pendulum with a motor")
    lsb = 2 * np.pi / 4096
    u, q = (model.input("u", "N*m", hold="zoh", reach=5, gain_sd=0), model.sensor("q", "rad", resolution=lsb, reach=4))
    J, G, b = model.unknown("J", "kg*m^2", 0.15), model.unknown("G", "N*m", 3.0), model.unknown("b", "N*m*s", 0.1)
    model.equation(J * q.d(2) + G * sin(q) + b * q.d() - u)

    def rate_of(extra: float) -> Callable[[States, float], States]:
        return lambda s, v: (s[1], (v - 3.7 * math.sin(s[0]) - 0.2 * s[1] - extra * s[0]) / 0.19)

    return Case(model.compiled("pendulum"), 500.0, lambda t: 2 * np.sin(3 * t) + 1.5 * np.sin(7.1 * t), rate_of, 2, lsb)


def _vehicle() -> Case:
    model = Model("vehicle")
    F, v = (
        model.input("F", "N", hold="zoh", reach=400, gain_sd=0),
        model.sensor("v", "m/s", resolution=0.01, reach=20),
    )
    m, Fr, b = model.unknown("m", "kg", 80.0), model.unknown("Fr", "N", 10.0), model.unknown("b", "N*s/m", 15.0)
    model.equation(m * v.d() + Fr * sgn(v) + b * v - F)

    def rate_of(extra: float) -> Callable[[States, float], States]:
        return lambda s, u: ((u - 13.5 * math.tanh(s[0] / 0.01) - 22 * s[0] - extra * 20 * s[0] * abs(s[0])) / 92,)

    return Case(model.compiled("vehicle"), 200.0, lambda t: 150 * np.sin(1.1 * t), rate_of, 1, 0.01)


CASES = {"spring": _spring(), "pendulum": _pendulum(), "vehicle": _vehicle()}


@cache
def run_of(name: str, extra: float = 0.0, seed: int = 1) -> dict[str, Float]:
    return CASES[name].run(extra, seed)


def advice_of(case: Case, signals: Mapping[str, Float]) -> tuple[str, ...]:
    found = identify(case.model, signals, case.rate, design=WeakDesign(case.rate, 1.0, 12, 6))
    times = np.arange(len(next(iter(signals.values())))) / case.rate
    return advice_on(Analysis(case.model, found, {}, Recording(times, dict(signals), case.rate)))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("extra", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.night) for seed in (1, 2))])
def test_right_columns_have_no_advice(name: str, extra: float, seed: int) -> None:
    """Whether the model is right or lacks a term: a cubic spring, a second spring, a drag."""
    assert advice_of(CASES[name], run_of(name, extra, seed)) == ()


def _counts(lsb: float) -> Callable[[Float], Float]:
    return lambda x: np.rint(x / lsb)


@pytest.mark.parametrize(
    ("name", "signal", "changed", "sentence"),
    [
        ("spring", "F", lambda x: -x, "F seems to have the opposite sign: --columns F=F:-1 (or x: --columns x=x:-1)"),
        ("spring", "x", lambda x: 1e3 * x, "x seems to be in mm, not m: --columns x=x:mm"),
        ("spring", "x", lambda x: 1e2 * x, "x seems to be in cm, not m: --columns x=x:cm"),
        ("spring", "F", lambda x: 1e3 * x, "F seems to be in mN, not N: --columns F=F:mN"),
        ("spring", "x", _counts(1e-5), "x seems to be in counts, not m: --columns x=x:1e-05"),
        ("pendulum", "u", lambda x: -x, "u seems to have the opposite sign: --columns u=u:-1 (or q: --columns q=q:-1)"),
        ("pendulum", "q", np.degrees, "q seems to be in deg, not rad: --columns q=q:deg"),
        ("pendulum", "q", lambda x: x / (2 * np.pi), "q seems to be in rev, not rad: --columns q=q:rev"),
        ("pendulum", "q", _counts(2 * np.pi / 4096), "q seems to be in counts, not rad: --columns q=q:0.00153398079"),
        ("vehicle", "F", lambda x: -x, "F seems to have the opposite sign: --columns F=F:-1 (or v: --columns v=v:-1)"),
    ],
)
def test_wrong_column_is_named(name: str, signal: str, changed: Callable[[Float], Float], sentence: str) -> None:
    """Where the model lacks a term, whose residuals are far above the sensors' noise in the right unit too; the tests
    below have whole models."""
    run = run_of(name, 0.3)
    assert advice_of(CASES[name], run | {signal: changed(run[signal])}) == (sentence,)


def test_input_that_never_changes_is_named() -> None:
    run = run_of("spring")
    assert advice_of(CASES["spring"], run | {"F": np.full(len(run["F"]), 1.5)}) == (
        "F is 1.5 N in every sample: is it the column of the drive?",
    )


@pytest.mark.parametrize(
    ("name", "signals", "factor", "unit"),
    [
        ("rigid_body", ["w0", "w1", "w2"], 30 / np.pi, "rpm"),
        ("two_link_arm", ["q1", "q2"], 180 / np.pi, "deg"),
        ("two_link_arm", ["t1", "t2"], 1e3, "mN*m"),
        ("rigid_body", ["m0", "m1", "m2"], 1e3, "mN*m"),  # as would t in ms, at 1 MHz
    ],
)
def test_columns_that_are_all_in_another_unit_are_named_together(
    name: str, signals: list[str], factor: float, unit: str
) -> None:
    """None of them explains the run by itself; nor do the terms that seem to lack, which are not proposed beside it."""
    model, simulation = compiled_of(name), simulation_of(name)
    run = {key: values[:6000] for key, values in simulation.run(3).items()}
    run |= {one: factor * run[one] for one in signals}
    rate = simulation.rig.sample_rate
    found = identify(model, run, rate, design=WeakDesign(rate, 1.0, 12, 6))
    answer = advised(Analysis(model, found, {}, Recording(np.arange(6000) / rate, run, rate)))
    si = model.signal(signals[0]).unit
    typed = ",".join(f"{one}={one}:{unit}" for one in signals)
    assert answer.advice == (f"{listed(signals)} seem to be in {unit}, not {si}: --columns {typed}",)


@pytest.mark.parametrize(
    ("name", "unit", "scale", "what"),
    [
        ("dc_motor", "ms", 1e3, "ms"),
        ("rigid_body", "d", 1 / 86_400, "d"),
        ("free_pendulum", "1/32768", 32_768.0, "ticks of 32768 Hz"),
        ("cooling", "d", 1 / 86_400, "d"),
    ],
)
def test_unit_of_the_time_is_named(name: str, unit: str, scale: float, what: str) -> None:
    model, simulation = compiled_of(name), simulation_of(name)
    run = {key: values[:6000] for key, values in simulation.run(3).items()}
    t = scale * run.pop("t")
    found = analysed(Recording(t, run, simulation.rig.sample_rate / scale), model)
    assert advice_on(found) == (f"t seems to be in {what}, not s: --columns t=t:{unit}",)


@pytest.mark.parametrize(
    ("delay", "wander", "noise", "seed"), [(0.0, 0.3, 0.05, 0), (0.02, 0.3, 0.05, 1), (0.05, 0.05, 0.1, 0)]
)
def test_parameter_that_a_ramp_leaves_open_is_no_suspicion_of_units(
    delay: float, wander: float, noise: float, seed: int
) -> None:
    """A motor turns as its voltage rises: its time constant is nowhere seen, any unit of time or speed may be right."""
    model = Model("motor on a ramp")
    u, w = model.input("u", "V", hold="zoh", reach=12), model.sensor("w", "rad/s", resolution=0.1, reach=100)
    ks, kv, ka = (model.unknown(*of) for of in (("ks", "V", 0.2), ("kv", "V*s", 0.12), ("ka", "V*s^2", 0.02)))
    model.equation(ka * w.d() + kv * w + ks * sgn(w) - u)
    rate, random = 200.0, np.random.default_rng(seed)
    t = np.arange(4200) / rate
    steady = np.maximum((0.25 * (t - delay) - 0.7) / 0.111, 0.0)
    load = np.cumsum(random.normal(0.0, 1.0, len(t)))
    load -= np.linspace(load[0], load[-1], len(t))
    speed = steady + (steady > 0) * (load * wander / np.std(load) + random.normal(0.0, noise, len(t)))
    run = {"u": 0.25 * t, "w": np.rint(speed / 0.1) * 0.1}
    assert advice_on(analysed(Recording(t, run, rate), model.compiled("ramp"))) == ()


@pytest.mark.parametrize(
    ("name", "sensor", "offset", "shift"),
    [
        ("ring_down", "x", "x0", 0.011),
        ("ring_down", "x", "x0", 0.5),
        ("mass_on_spring", "x", "x0", -2.0),
        ("rc_step", "v", "v0", 9.0),
        ("dc_motor", "i", "i0", 20.0),
    ],
)
def test_where_a_sensor_reads_0_is_no_suspicion_of_units(name: str, sensor: str, offset: str, shift: float) -> None:
    """Of offsets beyond the range of the guess the answer is that of the sensor without a shift."""
    model, simulation = compiled_of(name), simulation_of(name)
    run = {key: values[:8000] for key, values in simulation.run(3).items()}
    t = run.pop("t")
    usual, found = (
        analysed(Recording(t, {**run, sensor: run[sensor] + by}, simulation.rig.sample_rate), model)
        for by in (0.0, shift)
    )
    assert found.identified and advice_on(found) == ()
    assert "range" not in {one.name for one in found.found.verdict.reasons}
    for one, before in usual.values.items():
        after, by = found.values[one].value, shift if one == offset else 0.0
        assert after is not None and before.value is not None and before.se is not None
        assert abs(after - before.value - by) <= 2 * before.se + 0.01 * abs(by)


STEP = 2 * np.pi / 2**14


@pytest.mark.parametrize(
    ("column", "spoilt", "typed"),
    [
        ("phi", np.degrees, "phi=phi:deg"),
        ("phi", lambda x: np.rint(x / STEP), f"phi=phi:{STEP:.9g}"),
        ("y", lambda x: 1e3 * x, "y=y:mm"),
        ("y", np.negative, "y=y:-1"),
        ("phi", np.negative, None),  # the equations are linear in it
        ("phi", lambda x: x + np.pi, None),  # an encoder's offset is an unknown
        ("y", lambda x: x + 0.9, None),
    ],
)
def test_wrong_column_of_a_driven_linearised_mechanism_is_named(
    column: str, spoilt: Callable[[Float], Float], typed: str | None
) -> None:
    run = simulate(duration=20.0, seed=0).run
    signals = {"phi": run.phi, "y": run.y}
    recording = Recording(run.t, {**signals, column: spoilt(signals[column])}, run.sample_rate)
    model = MechanismRig("kapitza", known={"l1": 0.3}).applied(compiled_of("kapitza"))
    answer = analysed(*with_resolutions(recording, model))
    told = advice_on(answer)
    if typed is None:
        assert told == () and answer.identified
    else:
        assert len(told) == 1 and f"--columns {typed}" in told[0]
        assert "seems to" in told[0] and f"{column} seems to" in told[0]
