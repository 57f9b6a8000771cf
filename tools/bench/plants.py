"""Plants that are integrated here and not by pvid, each with a model that is right: for benches of what a model lacks.

Runge-Kutta of fourth order, the input held over a sample; sensors with white noise and a resolution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from math import cos, pi, sin, tanh

import numpy as np
import numpy.typing as npt

from pvid.model import Model
from pvid.model import cos as cosine_of
from pvid.model import sgn as sign_of
from pvid.model import sin as sine_of
from pvid.model.compiled import CompiledModel

Float = npt.NDArray[np.float64]
States = Sequence[float]
Values = Mapping[str, float]  # of parameters and constants

SAMPLES, SUBSTEPS = 4000, 6
NOTHING = (0.0, 0.0)  # more on the left side of any equation


@dataclass(frozen=True)
class Axis:
    """Where an effect may act: an equation and the motion that it belongs to.

    Attributes
    ----------
    sensor : its name; what it measures is the state `x`
    row : of the equation, in the order of the slope's `more`
    force : typical size of the equation's left side [its unit]
    x, v : states: of the sensor, and its rate; None: the rate is no state
    angle : of a turning motion
    coulomb, viscous, stiffness, gravity : parameters that the equation has in sgn(rate), in the rate, in the place and
        in its sine; "": none
    """

    sensor: str
    row: int
    force: float
    x: int
    v: int | None = None
    angle: bool = False
    coulomb: str = ""
    viscous: str = ""
    stiffness: str = ""
    gravity: str = ""


@dataclass(frozen=True)
class Plant:
    """A mechanism whose model is right.

    Attributes
    ----------
    model : to identify
    truth : of its unknowns, in order
    rate : of the samples [Hz]
    amplitude : of the drive; 0: there is none
    slope : rates of the states [n] at states, input, what the left side of each equation has more, and parameters
    states : how many
    sensors : name -> state and resolution
    scale : rates of the drive's sines and steps over those of the cart
    axes : see Axis
    constants : what the model takes as known
    bias : mean of the drive
    start : states at the begin
    shown : sensors that measure no state: name -> value from states, input, `more` and parameters
    """

    name: str
    model: Callable[[], CompiledModel]
    truth: Values
    rate: float
    amplitude: float
    slope: Callable[[States, float, States, Values], States]
    states: int
    sensors: Mapping[str, tuple[int, float]]
    scale: float = 1.0
    axes: tuple[Axis, ...] = ()
    constants: Values = field(default_factory=dict)
    bias: float = 0.0
    start: States = ()
    shown: Mapping[str, tuple[Callable[[States, float, States, Values], float], float]] = field(default_factory=dict)

    @property
    def drive(self) -> str:
        """The input's name; "": there is none."""
        return next((one.name for one in self.model().signals if one.kind == "input"), "")

    @property
    def offset(self) -> str:
        """A parameter that is a load, or an offset of a sensor; "": there is none."""
        return next((one.name for one in self.model().unknowns if not one.positive), "")

    @property
    def values(self) -> dict[str, float]:
        """Parameters and constants."""
        return {**self.truth, **self.constants}

    def driven(self, random: np.random.Generator) -> Float:
        """Samples [SAMPLES] of the drive: two sines and random steps."""
        t = np.arange(SAMPLES) / self.rate
        hold = round(0.3 / self.scale * self.rate)
        steps = random.uniform(-1, 1, SAMPLES // hold + 1).repeat(hold)[:SAMPLES]
        phase = random.uniform(0, 2 * np.pi, 2)
        slow, fast = (np.sin(w * self.scale * t + p) for w, p in zip((5.6, 14.5), phase, strict=True))
        return np.asarray(self.bias + self.amplitude * (0.35 * slow + 0.25 * fast + 0.4 * steps))

    @cached_property
    def unspoilt(self) -> tuple[Float, Float]:
        """Drive [SAMPLES] and states [SAMPLES, n] of a run without an effect."""
        u = self.driven(np.random.default_rng(0))
        return u, self.motion(u)

    @cached_property
    def sizes(self) -> Float:
        """Root mean square of each state over that run [n]."""
        return np.asarray(np.sqrt(np.mean(self.unspoilt[1] ** 2, axis=0)))

    def resolution(self, sensor: str) -> float:
        """Of a sensor."""
        return (self.sensors.get(sensor) or self.shown[sensor])[1]

    def measured(
        self,
        u: Float,
        states: Float,
        lacking: Callable[[States, float], States],
        values: Callable[[States, float], Values],
    ) -> dict[str, Float]:
        """What each sensor measures without its own errors [SAMPLES]; `lacking` and `values` as in `motion`.

        A sensor of no state jumps with a held input: a sample of it is the mean of before and after.
        """
        out = {name: states[:, state] for name, (state, _) in self.sensors.items()}
        mean = (u + np.concatenate([u[:1], u[:-1]])) / 2
        for name, (of, _) in self.shown.items():
            at = [(s, k / self.rate) for k, s in enumerate(states.tolist())]
            shown = [of(s, now, lacking(s, t), values(s, t)) for (s, t), now in zip(at, mean.tolist(), strict=True)]
            out[name] = np.array(shown)
        return out

    def motion(
        self,
        u: Float,
        lacking: Callable[[States, float], States] | None = None,
        values: Callable[[States, float], Values] | None = None,
        memory: Callable[[States, float], float] | None = None,
    ) -> Float:
        """States [SAMPLES, n] under an input.

        Parameters
        ----------
        lacking : what the left sides have more, of states and time
        values : of parameters and constants, of states and time; None: the truth
        memory : rate of one more state, that begins at 0 and is the last
        """
        h, truth = 1 / self.rate / SUBSTEPS, self.values
        own = list(self.start or (0.0,) * self.states)
        s = own + ([0.0] if memory else [])
        out = np.empty((SAMPLES, len(s)))

        def slope(at: States, t: float) -> list[float]:
            more = NOTHING if lacking is None else lacking(at, t)
            rates = list(self.slope(at, held, more, truth if values is None else values(at, t)))
            return rates if memory is None else [*rates, memory(at, t)]

        for place, held in enumerate(u.tolist()):  # noqa: B007 (read by slope)
            out[place] = s
            for part in range(SUBSTEPS):
                t = place / self.rate + part * h
                a = slope(s, t)
                b = slope([x + h / 2 * k for x, k in zip(s, a, strict=True)], t + h / 2)
                c = slope([x + h / 2 * k for x, k in zip(s, b, strict=True)], t + h / 2)
                d = slope([x + h * k for x, k in zip(s, c, strict=True)], t + h)
                s = [x + h / 6 * (e + 2 * f + 2 * g + k) for x, e, f, g, k in zip(s, a, b, c, d, strict=True)]
        return out


@cache
def _cart_model() -> CompiledModel:
    model = Model("cart")
    F, x = (
        model.input("F", "N", hold="zoh", reach=12, gain_sd=0),
        model.sensor("x", "m", resolution=1e-5, reach=0.5, gain_sd=0),
    )
    m, c, k = (model.unknown("m", "kg", 1), model.unknown("c", "N*s/m", 1), model.unknown("k", "N/m", 60))
    x0 = model.unknown("x0", "m", 0, positive=False, sd=0.05)
    model.equation(m * x.d(2) + c * x.d() + k * (x - x0) - F)
    return model.compiled("cart")


def _cart(s: States, F: float, more: States, p: Values) -> States:
    return s[1], (F - p["c"] * s[1] - p["k"] * (s[0] - p["x0"]) - more[0]) / p["m"]


@cache
def _stage_model() -> CompiledModel:
    model = Model("stage")
    F, x = (
        model.input("F", "N", hold="zoh", reach=40, gain_sd=0.01),
        model.sensor("x", "m", resolution=2e-6, reach=2, gain_sd=0),
    )
    m, c = model.unknown("m", "kg", 1), model.unknown("c", "N*s/m", 3)
    Fc, o = (model.unknown("Fc", "N", 1), model.unknown("o", "N", 0, positive=False, sd=1))
    model.equation(m * x.d(2) + c * x.d() + Fc * sign_of(x.d()) + o - F)
    return model.compiled("stage")


def _stage(s: States, F: float, more: States, p: Values) -> States:
    friction = p["Fc"] * tanh(s[1] / 1e-3)
    return s[1], (F - p["c"] * s[1] - friction - p["o"] - more[0]) / p["m"]


@cache
def _motor_model() -> CompiledModel:
    model = Model("motor")
    V = model.input("V", "V", hold="zoh", reach=15, gain_sd=0)
    i = model.sensor("i", "A", resolution=2e-3, reach=15, gain_sd=0)
    w = model.sensor("w", "rad/s", resolution=0.02, reach=500, gain_sd=0)
    R, L, k = (model.unknown("R", "ohm", 1), model.unknown("L", "H", 5e-3), model.unknown("k", "N*m/A", 0.03))
    J, b = model.unknown("J", "kg*m^2", 2e-4), model.unknown("b", "N*m*s/rad", 2e-4)
    model.equation(L * i.d() + R * i + k * w - V)
    model.equation(J * w.d() + b * w - k * i)
    return model.compiled("motor")


def _motor(s: States, V: float, more: States, p: Values) -> States:
    current = (V - p["R"] * s[0] - p["k"] * s[1] - more[0]) / p["L"]
    return current, (p["k"] * s[0] - p["b"] * s[1] - more[1]) / p["J"]


@cache
def _servo_model() -> CompiledModel:
    model = Model("servo")
    V = model.input("V", "V", hold="zoh", reach=30, gain_sd=0)
    i = model.sensor("i", "A", resolution=4e-3, reach=20, gain_sd=0)
    q = model.sensor("q", "rad", resolution=2 * pi / 2**14, reach=1000)
    R, k = model.unknown("R", "ohm", 2), model.unknown("k", "N*m/A", 0.1)
    J, b, Tc = (model.unknown("J", "kg*m^2", 1e-3), model.unknown("b", "N*m*s", 2e-3), model.unknown("Tc", "N*m", 0.02))
    model.equation(R * i + k * q.d() - V)
    model.equation(J * q.d(2) + b * q.d() + Tc * sign_of(q.d()) - k * i)
    return model.compiled("servo")


def _servo_current(s: States, V: float, more: States, p: Values) -> float:
    return (V - p["k"] * s[1] - more[0]) / p["R"]


def _servo(s: States, V: float, more: States, p: Values) -> States:
    torque = p["k"] * _servo_current(s, V, more, p) - p["b"] * s[1] - p["Tc"] * tanh(s[1] / 0.02) - more[1]
    return s[1], torque / p["J"]


@cache
def _pendulum_model() -> CompiledModel:
    model = Model("pendulum")
    M = model.input("M", "N*m", hold="zoh", reach=3, gain_sd=0)
    q = model.sensor("q", "rad", resolution=2e-4, reach=3)
    J, b, G = (model.unknown("J", "kg*m^2", 0.05), model.unknown("b", "N*m*s", 0.02), model.unknown("G", "N*m", 1))
    model.equation(J * q.d(2) + b * q.d() + G * sine_of(q) - M)
    return model.compiled("pendulum")


def _pendulum(s: States, M: float, more: States, p: Values) -> States:
    return s[1], (M - p["b"] * s[1] - p["G"] * sin(s[0]) - more[0]) / p["J"]


@cache
def _bob_model() -> CompiledModel:
    """A point mass on a rod: its mass is known, and its length is in two terms."""
    model = Model("bob")
    M = model.input("M", "N*m", hold="zoh", reach=3, gain_sd=0)
    q = model.sensor("q", "rad", resolution=2 * pi / 2**13, reach=10)
    m, g = model.known("m", "kg", 0.4), model.known("g", "m/s^2", 9.81)
    length, b = model.unknown("l", "m", 0.4), model.unknown("b", "N*m*s", 0.03)
    Tc = model.unknown("Tc", "N*m", 0.03)
    model.equation(m * length**2 * q.d(2) + b * q.d() + Tc * sign_of(q.d()) + m * g * length * sine_of(q) - M)
    return model.compiled("bob")


def _bob(s: States, M: float, more: States, p: Values) -> States:
    torque = M - p["b"] * s[1] - p["Tc"] * tanh(s[1] / 5e-3) - p["m"] * p["g"] * p["l"] * sin(s[0]) - more[0]
    return s[1], torque / (p["m"] * p["l"] ** 2)


@cache
def _swing_model() -> CompiledModel:
    model = Model("swing")
    q = model.sensor("q", "rad", resolution=2 * pi / 2**13, reach=3)
    c, w = model.unknown("c", "1/s", 0.1), model.unknown("w2", "1/s^2", 20)
    model.equation(q.d(2) + c * q.d() + w * sine_of(q))
    return model.compiled("swing")


def _swing(s: States, _: float, more: States, p: Values) -> States:
    return s[1], -p["c"] * s[1] - p["w2"] * sin(s[0]) - more[0]


@cache
def _lag_model() -> CompiledModel:
    model = Model("lag")
    u = model.input("u", "V", hold="zoh", reach=4, gain_sd=0)
    y = model.sensor("y", "V", resolution=1e-3, reach=6, gain_sd=0)
    T, K = model.unknown("T", "s", 0.2), model.unknown("K", "", 1)
    o = model.unknown("o", "V", 0, positive=False, sd=0.5)
    model.equation(T * y.d() + y - K * u - o)
    return model.compiled("lag")


def _lag(s: States, u: float, more: States, p: Values) -> States:
    return ((p["K"] * u + p["o"] - s[0] - more[0]) / p["T"],)


@cache
def _tank_model() -> CompiledModel:
    """A tank that runs out by Torricelli's law; the sensor is in the outlet and measures the flow's speed."""
    model = Model("tank")
    u = model.input("u", "m^3/s", hold="zoh", reach=2e-3, gain_sd=0)
    w = model.sensor("w", "m/s", resolution=1e-3, reach=10, gain_sd=0)
    g = model.known("g", "m/s^2", 9.81)
    A, a = model.unknown("A", "m^2", 0.02), model.unknown("a", "m^2", 2e-4)
    model.equation(A * w * w.d() / g + a * w - u)
    return model.compiled("tank")


def _tank(s: States, u: float, more: States, p: Values) -> States:
    return ((u - p["a"] * s[0] - more[0]) * p["g"] / (p["A"] * max(s[0], 0.1)),)


@cache
def _plates_model() -> CompiledModel:
    model = Model("plates")
    P = model.input("P", "W", hold="zoh", reach=100, gain_sd=0)
    a, b = (model.sensor(name, "K", resolution=0.02, reach=100, gain_sd=0) for name in ("Ta", "Tb"))
    Ca, Cb = model.unknown("Ca", "J/K", 40), model.unknown("Cb", "J/K", 100)
    G, H = model.unknown("G", "W/K", 1), model.unknown("H", "W/K", 1)
    model.equation(Ca * a.d() + G * (a - b) - P)
    model.equation(Cb * b.d() + H * b - G * (a - b))
    return model.compiled("plates")


def _plates(s: States, P: float, more: States, p: Values) -> States:
    through = p["G"] * (s[0] - s[1])
    return (P - through - more[0]) / p["Ca"], (through - p["H"] * s[1] - more[1]) / p["Cb"]


@cache
def _shaft_model() -> CompiledModel:
    model = Model("shaft")
    M = model.input("M", "N*m", hold="zoh", reach=3, gain_sd=0)
    q, r = (model.sensor(name, "rad", resolution=2 * pi / 2**16, reach=1000) for name in ("q", "r"))
    J1, J2 = model.unknown("J1", "kg*m^2", 2e-3), model.unknown("J2", "kg*m^2", 5e-3)
    k, d = model.unknown("k", "N*m/rad", 5), model.unknown("d", "N*m*s", 5e-3)
    b1, b2 = model.unknown("b1", "N*m*s", 0.01), model.unknown("b2", "N*m*s", 0.01)
    shaft = k * (q - r) + d * (q.d() - r.d())
    model.equation(J1 * q.d(2) + b1 * q.d() + shaft - M)
    model.equation(J2 * r.d(2) + b2 * r.d() - shaft)
    return model.compiled("shaft")


def _shaft(s: States, M: float, more: States, p: Values) -> States:
    q, r, dq, dr = s[:4]
    shaft = p["k"] * (q - r) + p["d"] * (dq - dr)
    return (dq, dr, (M - p["b1"] * dq - shaft - more[0]) / p["J1"], (shaft - p["b2"] * dr - more[1]) / p["J2"])


@cache
def _rotor_model() -> CompiledModel:
    """An unbalance shakes a bench on springs, whose equation has no force that is known."""
    model = Model("rotor")
    M = model.input("M", "N*m", hold="zoh", reach=5, gain_sd=0)
    q = model.sensor("q", "rad", resolution=2 * pi / 2**13, reach=5000)
    y = model.sensor("y", "m", resolution=2e-6, reach=0.05, gain_sd=0)
    J, b, Tc = model.unknown("J", "kg*m^2", 0.01), model.unknown("b", "N*m*s", 0.01), model.unknown("Tc", "N*m", 0.05)
    u, m = model.unknown("u", "kg*m", 0.02), model.unknown("m", "kg", 5)
    c, k = model.unknown("c", "N*s/m", 20), model.unknown("k", "N/m", 5000)
    model.equation(J * q.d(2) + b * q.d() + Tc * sign_of(q.d()) + u * y.d(2) * cosine_of(q) - M)
    model.equation(m * y.d(2) + c * y.d() + k * y + u * (q.d(2) * cosine_of(q) - q.d() ** 2 * sine_of(q)))
    return model.compiled("rotor")


def _rotor(s: States, M: float, more: States, p: Values) -> States:
    q, y, dq, dy = s[:4]
    torque = M - p["b"] * dq - p["Tc"] * tanh(dq / 0.15) - more[0]
    force = p["u"] * dq**2 * sin(q) - p["c"] * dy - p["k"] * y - more[1]
    coupling = p["u"] * cos(q)
    whole = p["J"] * p["m"] - coupling**2
    return (dq, dy, (p["m"] * torque - coupling * force) / whole, (p["J"] * force - coupling * torque) / whole)


@cache
def _cell_model() -> CompiledModel:
    """Its overvoltage is not measured."""
    model = Model("cell")
    i = model.input("i", "A", hold="zoh", reach=12, gain_sd=0)
    v, h = model.sensor("v", "V", resolution=5e-4, reach=5, gain_sd=0), model.unmeasured("h", "V")
    R0, R1 = model.unknown("R0", "ohm", 0.02), model.unknown("R1", "ohm", 0.02)
    T, E = model.unknown("T1", "s", 30), model.unknown("E", "V", 3.7, sd=1.0)
    model.equation(v - E + R0 * i + h)
    model.equation(T * h.d() + h - R1 * i)
    return model.compiled("cell")


def _cell(s: States, i: float, more: States, p: Values) -> States:
    return ((p["R1"] * i - s[0] - more[0]) / p["T1"],)


def _cell_voltage(s: States, i: float, more: States, p: Values) -> float:
    return p["E"] - p["R0"] * i - s[0] - more[1]


_ROTOR = {"J": 0.0143, "b": 0.005, "Tc": 0.05, "u": 0.03, "m": 4.0, "c": 25.0, "k": 7000.0}
_MOTOR = {"R": 1.45, "L": 8e-3, "k": 0.043, "J": 2.6e-4, "b": 4e-4}
_SERVO = {"R": 1.6, "k": 0.12, "J": 1.4e-3, "b": 1.5e-3, "Tc": 0.03}
_SHAFT = {"J1": 1.5e-3, "J2": 4e-3, "k": 6.0, "d": 8e-3, "b1": 8e-3, "b2": 0.012}

PLANTS = {
    one.name: one
    for one in (
        Plant(
            "cart",
            _cart_model,
            {"m": 1.3, "c": 1.7, "k": 82.0, "x0": 0.004},
            500.0,
            8.0,
            _cart,
            2,
            {"x": (0, 1e-5)},
            axes=(Axis("x", 0, 4.0, 0, 1, viscous="c", stiffness="k"),),
        ),
        Plant(
            "motor",
            _motor_model,
            _MOTOR,
            500.0,
            12.0,
            _motor,
            2,
            {"i": (0, 2e-3), "w": (1, 0.02)},
            axes=(Axis("i", 0, 5.0, 0, viscous="R"), Axis("w", 1, 0.1, 1, viscous="b")),
        ),
        Plant(
            "pendulum",
            _pendulum_model,
            {"J": 0.06, "b": 0.05, "G": 1.9},
            250.0,
            1.6,
            _pendulum,
            2,
            {"q": (0, 2e-4)},
            0.6,
            (Axis("q", 0, 0.8, 0, 1, angle=True, viscous="b", gravity="G"),),
        ),
        Plant(
            "lag",
            _lag_model,
            {"T": 0.35, "K": 2.0, "o": 0.1},
            200.0,
            3.0,
            _lag,
            1,
            {"y": (0, 1e-3)},
            0.4,
            (Axis("y", 0, 3.0, 0),),
        ),
        Plant(
            "stage",
            _stage_model,
            {"m": 1.8, "c": 4.0, "Fc": 1.5, "o": 0.2},
            1000.0,
            25.0,
            _stage,
            2,
            {"x": (0, 2e-6)},
            2.0,
            (Axis("x", 0, 12.0, 0, 1, coulomb="Fc", viscous="c"),),
        ),
        Plant(
            "servo",
            _servo_model,
            _SERVO,
            1000.0,
            20.0,
            _servo,
            2,
            {"q": (0, 2 * pi / 2**14)},
            2.0,
            (Axis("q", 1, 0.6, 0, 1, angle=True, coulomb="Tc", viscous="b"),),
            shown={"i": (_servo_current, 4e-3)},
        ),
        Plant(
            "bob",
            _bob_model,
            {"l": 0.35, "b": 0.02, "Tc": 0.02},
            400.0,
            1.6,
            _bob,
            2,
            {"q": (0, 2 * pi / 2**13)},
            0.6,
            (Axis("q", 0, 0.8, 0, 1, angle=True, coulomb="Tc", viscous="b"),),
            {"m": 0.4, "g": 9.81},
        ),
        Plant(
            "swing",
            _swing_model,
            {"c": 0.15, "w2": 28.0},
            200.0,
            0.0,
            _swing,
            2,
            {"q": (0, 2 * pi / 2**13)},
            axes=(Axis("q", 0, 15.0, 0, 1, angle=True, viscous="c", gravity="w2"),),
            start=(2.2, 0.0),
        ),
        Plant(
            "tank",
            _tank_model,
            {"A": 0.016, "a": 2.9e-4},
            20.0,
            8e-4,
            _tank,
            1,
            {"w": (0, 1e-3)},
            0.06,
            (Axis("w", 0, 5e-4, 0, viscous="a"),),
            {"g": 9.81},
            9e-4,
            start=(3.1,),
        ),
        Plant(
            "plates",
            _plates_model,
            {"Ca": 55.0, "Cb": 140.0, "G": 1.4, "H": 0.8},
            2.0,
            40.0,
            _plates,
            2,
            {"Ta": (0, 0.02), "Tb": (1, 0.02)},
            0.004,
            (Axis("Ta", 0, 20.0, 0), Axis("Tb", 1, 20.0, 1)),
            bias=25.0,
        ),
        Plant(
            "shaft",
            _shaft_model,
            _SHAFT,
            1000.0,
            2.0,
            _shaft,
            4,
            {"q": (0, 2 * pi / 2**16), "r": (1, 2 * pi / 2**16)},
            2.0,
            (Axis("q", 0, 1.0, 0, 2, angle=True, viscous="b1"), Axis("r", 1, 0.5, 1, 3, angle=True, viscous="b2")),
        ),
        Plant(
            "rotor",
            _rotor_model,
            _ROTOR,
            1000.0,
            0.5,
            _rotor,
            4,
            {"q": (0, 2 * pi / 2**13), "y": (1, 2e-6)},
            0.3,
            (Axis("q", 0, 0.3, 0, 2, angle=True, coulomb="Tc", viscous="b"), Axis("y", 1, 20.0, 1, 3, viscous="c")),
            bias=0.15,
        ),
        Plant(
            "cell",
            _cell_model,
            {"R0": 0.025, "R1": 0.018, "T1": 22.0, "E": 3.65},
            2.0,
            8.0,
            _cell,
            1,
            {},
            0.01,
            shown={"v": (_cell_voltage, 5e-4)},
        ),
    )
}
