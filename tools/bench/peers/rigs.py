"""Mechanisms and their recordings, by SciPy's DOP853 and MuJoCo: for pvid and its peers alike, without any of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Values = Mapping[str, Any]
Run = dict[str, Float]  # the time t [n] and each signal [n]
Fit = tuple[Mapping[str, float], Mapping[str, float], str]
GRAVITY = 9.81
NONE = float("nan")
CLEAN, LACKING = "as modelled", "one effect more"
OFF = (0.2, 0.5)  # of the starts, by turns


@dataclass(frozen=True)
class Rig:
    """A mechanism.

    Attributes
    ----------
    truth : of the unknowns
    rates : of the states, from states, input, parameters, the module that has sin and tanh, and the force of an effect
    outputs : what the sensors measure, from states, input and parameters
    sensors : their resolutions [rad, m, A, V]; the first ones measure the first states, but for the cell's
    effect : what the model lacks: its name, and its force from the states
    plant : rates in place of `rates` where the effect is a hidden state; its last state is that
    drive : values of the input from a generator and the number of samples; it is held, or linear between samples
    absolute : parameters whose start is off by a part of this [their unit] and not of themselves
    possible : whether there can be such a mechanism
    """

    name: str
    truth: Mapping[str, float]
    rates: Callable[..., Sequence[Any]]
    outputs: Callable[[Any, Any, Values], Sequence[Any]]
    sensors: Mapping[str, float]
    start: tuple[float, ...]
    rate: float
    samples: int
    effect: tuple[str, Callable[[Any], float]]
    drive: Callable[[np.random.Generator, int], Float] | None = None
    input: str = ""
    held: bool = True
    plant: Callable[..., Sequence[Any]] | None = None
    absolute: Mapping[str, float] = field(default_factory=dict)
    possible: Callable[[Values], bool] = lambda p: True

    def guess(self, seed: int) -> dict[str, float]:
        """A start: every parameter off by OFF, up or down."""
        random, off = np.random.default_rng(1000 + seed), OFF[seed % 2]
        while True:
            signs = random.choice([-1, 1], len(self.truth))
            start = {
                name: value + sign * off * self.absolute.get(name, value)
                for (name, value), sign in zip(self.truth.items(), signs, strict=True)
            }
            if self.possible(start):
                return start

    def size(self, name: str) -> float:
        """What errors of a parameter are divided by."""
        return abs(self.truth[name])

    def recording(self, seed: int, case: str) -> Run:
        """What is recorded: sensors with white noise of half a step, rounded to steps."""
        random = np.random.default_rng(seed)
        t = np.arange(self.samples) / self.rate
        u = np.zeros(self.samples) if self.drive is None else self.drive(random, self.samples)
        states = self._motion(t, u, case)
        shown = self.outputs(states, u, self.truth)
        run = {"t": t} | ({self.input: u} if self.input else {})
        for (name, step), exact in zip(self.sensors.items(), shown, strict=True):
            if name != self.input:
                run[name] = step * np.round(exact / step + random.normal(0, 0.5, self.samples))
        return run

    def _motion(self, t: Float, u: Float, case: str) -> Float:
        from scipy.integrate import solve_ivp

        rates, force = (self.plant or self.rates, self.effect[1] if case == LACKING else lambda x: 0.0)
        states = [np.append(self.start, [0.0] * (self.plant is not None))]
        ends = [*(np.flatnonzero(np.diff(u)) + self.held), len(t) - 1]
        ends = sorted({*ends, *(k + 1 for k in ends if not self.held and k < len(t) - 1)})
        begin = 0
        for end in ends:
            if end > begin:
                slope = 0.0 if self.held else (u[end] - u[begin]) / (t[end] - t[begin])

                def rate(now: float, x: Float, at: int = begin, slope: float = slope) -> Any:
                    return rates(x, u[at] + slope * (now - t[at]), self.truth, np, force(x))

                span = (t[begin], t[end])
                part = solve_ivp(rate, span, states[-1], "DOP853", t[begin + 1 : end + 1], rtol=1e-8, atol=1e-10)
                states += list(part.y.T)
                begin = end
        return np.array(states).T


def derivatives(run: Run, name: str, taps: int, orders: int = 2) -> list[Float]:
    """A signal and its derivatives by the filter of Savitzky and Golay, of fourth degree."""
    from scipy.signal import savgol_filter

    step = run["t"][1] - run["t"][0]
    return [savgol_filter(run[name], taps, 4, deriv=k, delta=step) for k in range(orders + 1)]


def runge_kutta(f: Callable[[Any, Any], Any], x: Any, now: Any, then: Any, h: float) -> Any:
    """States a step later, the input being linear between its ends."""
    k1 = f(x, now)
    k2 = f(x + h / 2 * k1, (now + then) / 2)
    k3 = f(x + h / 2 * k2, (now + then) / 2)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(x + h * k3, then))


def centred(u: Float) -> Float:
    """A held input at the samples: the mean of before and after, else it comes half a sample early."""
    return (u + np.append(u[:1], u[:-1])) / 2


def _staircase(sizes: Sequence[float], rates: Sequence[float], jump: float, hold: int, hz: float) -> Any:
    """Sines and random jumps, held over samples."""

    def drive(random: np.random.Generator, samples: int) -> Float:
        t = np.arange(0, samples, hold) / hz
        phases = random.uniform(0, 2 * np.pi, len(sizes))
        sines = sum(s * np.sin(2 * np.pi * f * t + p) for s, f, p in zip(sizes, rates, phases, strict=True))
        return np.asarray(sines + jump * random.uniform(-1, 1, len(t)).repeat(3)[: len(t)]).repeat(hold)[:samples]

    return drive


def _motor(x: Any, u: Any, p: Values, m: ModuleType, more: Any = 0.0) -> Sequence[Any]:
    i, _, w = x[0], x[1], x[2]
    return ((u - p["R"] * i - p["k"] * w) / p["L"], w, (p["k"] * i - p["b"] * w - more) / p["J"])


def _pendulum(x: Any, u: Any, p: Values, m: ModuleType, more: Any = 0.0) -> Sequence[Any]:
    return x[1], -p["w2"] * m.sin(x[0]) - p["k"] * x[1] - more


def _cart(x: Any, F: Any, p: Values, m: ModuleType, more: Any = 0.0) -> Sequence[Any]:
    a, v, w = x[1], x[2], x[3]
    c = p["ml"] * m.cos(a)
    f = F - p["b"] * v - more + p["ml"] * m.sin(a) * w * w
    g = -p["bp"] * w - p["ml"] * GRAVITY * m.sin(a)
    det = p["mt"] * p["J"] - c * c
    return v, w, (p["J"] * f - c * g) / det, (p["mt"] * g - c * f) / det


def _cell(x: Any, i: Any, p: Values, m: ModuleType, more: Any = 0.0) -> Sequence[Any]:
    return ((p["R1"] * i - x[0]) / p["T1"],)


def _cell_plant(x: Any, i: Any, p: Values, m: ModuleType, more: Any = 0.0) -> Sequence[Any]:
    return (p["R1"] * i - x[0]) / p["T1"], (more * i - x[1]) / 400.0


def _voltage(x: Any, i: Any, p: Values) -> Sequence[Any]:
    return (p["E"] - p["R0"] * i - x[0] - (x[1] if len(x) == 2 else 0.0),)


COUNT = 2 * np.pi / 2**12
RIGS = {
    one.name: one
    for one in (
        Rig(
            "dc_motor", dict(R=1.2, L=3e-3, k=0.05, J=2e-4, b=1e-4), _motor, lambda x, u, p: x[:2],
            {"i": 10 / 2**12, "phi": COUNT}, (0.0, 0.0, 0.0), 1000.0, 5000,
            ("dry friction", lambda x: 0.012 * np.tanh(x[2] / 1.0)),
            _staircase((4.4, 2.8), (0.7, 2.3), 1.5, 20, 1000.0), "V",
        ),
        Rig(
            "free_pendulum", dict(w2=31.0, k=0.04), _pendulum, lambda x, u, p: x[:1], {"q": COUNT}, (1.75, 0.0), 500.0,
            6000, ("dry friction", lambda x: 0.15 * np.tanh(x[1] / 0.05)),
        ),
        Rig(
            "cart_pendulum", dict(mt=0.8, ml=0.04, J=0.0107, b=1.0, bp=2e-3), _cart, lambda x, u, p: x[:2],
            {"x": 2e-5, "a": COUNT}, (0.0, 0.15, 0.0, 0.0), 500.0, 5000,
            ("dry friction", lambda x: 0.3 * np.tanh(x[2] / 0.02)),
            _staircase((2.2, 2.5, 2.0), (0.6, 1.3, 2.1), 1.0, 10, 500.0), "F",
            possible=lambda p: bool(p["ml"] ** 2 < 0.6 * p["mt"] * p["J"]),
        ),
        Rig(
            "cell", dict(R0=0.02, R1=0.015, T1=30.0, E=3.7), _cell, _voltage, {"v": 1e-3}, (0.0,), 1.0, 3600,
            ("a second relaxation", lambda x: 0.01),
            lambda random, n: np.asarray(
                random.normal(0, 2, n // 15 + 1).repeat(15)[:n] + random.normal(0, 2, n // 240 + 1).repeat(240)[:n]
            ),
            "i", held=False, plant=_cell_plant, absolute={"E": 0.2},
        ),
    )
}  # fmt: skip
