"""Random rigs of every kind that people have: the model file that a user writes, and the same physics as C.

A kind draws parameters, sensors and a drive. Its equations go to the model file; its rates, which are worked out here
by hand, go to C (bench.random_motion), so that no line of pvid's model compiler has a part in the recording.

Own notation of both: x1, v1, a1 are a coordinate and its derivatives, whatever the model file calls them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

Shape = Literal["steps", "sines", "prbs", "chirp"]

IN_C = 8  # parameters that the C core has room for
_SHAPES: tuple[Shape, ...] = ("steps", "sines", "prbs", "chirp")
_SMOOTH: tuple[Shape, ...] = ("sines", "chirp")
_BITS = (9, 14)  # of a sensor's range
_WORD = re.compile(r"[A-Za-z_]\w*")
_LANGUAGE = ("sgn", "sin", "cos", "Integral")


@dataclass(frozen=True)
class Sensed:
    """A signal that is recorded.

    Attributes
    ----------
    code : its true value, in C
    resolution : 0 until the motion is known [unit]
    bits : of the range that it covers
    """

    name: str
    unit: str
    code: str
    bits: float
    driven: bool = False
    resolution: float = 0.0
    reach: float = 1.0


@dataclass(frozen=True)
class Driven:
    """A signal that the drive imposes.

    Attributes
    ----------
    amplitude : largest absolute value about `mean` [unit]
    held : the value set at a sample holds until the next one
    sensor : it is measured, with noise
    internal : it is neither recorded nor in the model: the command of a servo
    feedback : what is added to it at each sample, in C; "": open loop
    """

    name: str
    unit: str
    amplitude: float
    mean: float
    shape: Shape
    held: bool
    sensor: bool
    internal: bool = False
    feedback: str = ""


@dataclass(frozen=True, eq=False)
class RandomRig:
    """A mechanism, its true values and its sensors.

    Attributes
    ----------
    truth : of the unknowns
    small : unknowns that are superfluous: scale of what they could be, their truth is 0
    features : what the grammar chose, for the account of what was covered
    rates, outputs : C statements; `dx` are the rates of `x`, `u` the drives, `p` the parameters, `s` signs of speeds
    slid : states that are speeds with a dry friction, in the order of `s`
    values : of all parameters in C, unknowns first
    declared, equations : lines of the model file
    counted : states whose start is known: integrals
    pace, lasts : fastest rate [1/s] and duration [s], where the linearised equations do not show them
    """

    kind: str
    title: str
    features: frozenset[str]
    truth: Mapping[str, float]
    small: Mapping[str, float]
    sensed: Sequence[Sensed]
    driven: Sequence[Driven]
    start: Sequence[float]
    rates: Sequence[str]
    slid: Sequence[int]
    values: Sequence[float]
    declared: Sequence[str]
    equations: Sequence[str]
    counted: Sequence[int] = ()
    pace: float | None = None
    lasts: float | None = None

    def with_sensors(self, sensed: Sequence[Sensed]) -> RandomRig:
        """The rig with resolutions and reaches."""
        return replace(self, sensed=sensed)

    @property
    def text(self) -> str:
        """The model file."""
        signals = []
        for drive in self.driven:
            if not drive.sensor and not drive.internal:
                hold = "zoh" if drive.held else "sampled"
                reach = _digits(1.2 * (abs(drive.mean) + drive.amplitude))
                given = f'"{drive.name}", "{drive.unit}", hold="{hold}", reach={reach}, gain_sd=0'
                signals.append(f"{drive.name} = model.input({given})")
        for one in self.sensed:
            driven = ", driven=True" if one.driven else ""
            signals.append(
                f'{one.name} = model.sensor("{one.name}", "{one.unit}", resolution={one.resolution!r}, '
                f"reach={_digits(one.reach)}, gain_sd=0{driven})"
            )
        body = "\n".join([f'model = Model("{self.title}")', *signals, *self.declared, *self.equations])
        names = ", ".join(["Model", *(one for one in _LANGUAGE if re.search(rf"\b{one}\(", body))])
        return f'"""A random rig: {self.kind}."""\n\nfrom pvid.model import {names}\n\n{body}\n'


def _digits(value: float, digits: int = 3) -> str:
    return repr(float(f"{value:.{digits}g}"))


class Sketch:
    """A rig while it is drawn.

    Parameters
    ----------
    budget : how many parameters are unknown; further ones are known constants
    """

    def __init__(self, source: np.random.Generator, kind: str, budget: int) -> None:
        self.source = source
        self.kind = kind
        self.budget = budget
        self.features: set[str] = set()
        self.truth: dict[str, float] = {}
        self._small: dict[str, float] = {}
        self._known: dict[str, float] = {}
        self._sensed: list[Sensed] = []
        self._driven: list[Driven] = []
        self._start: list[float] = []
        self._rates: list[str] = []
        self._slid: list[str] = []
        self._counted: list[int] = []
        self._declared: list[str] = []
        self._equations: list[str] = []
        self._model: dict[str, str] = {}
        self._c: dict[str, str] = {}

    # ---- chance

    def chance(self, share: float, feature: str = "") -> bool:
        """Whether something is so; it then counts as a feature of the rig."""
        so = bool(self.source.random() < share)
        if so and feature:
            self.features.add(feature)
        return so

    def between(self, low: float, high: float) -> float:
        """Uniform."""
        return float(self.source.uniform(low, high))

    def decades(self, low: float, high: float) -> float:
        """Uniform in the logarithm; the ends are powers of 10."""
        return float(10 ** self.source.uniform(low, high))

    def count(self, low: int, high: int) -> int:
        """A whole number, both ends included."""
        return int(self.source.integers(low, high + 1))

    # ---- quantities

    def unknown(self, name: str, unit: str, value: float) -> str:
        """A positive parameter with a rough guess; a known constant where there are enough unknowns."""
        if len(self.truth) >= self.budget:
            return self.known(name, unit, value)
        guess = value * math.exp(self.between(-0.7, 0.7))
        return self._of_model(name, value, f'"{name}", "{unit}", {_digits(guess, 2)}')

    def superfluous(self, name: str, unit: str, scale: float) -> str:
        """A positive parameter whose truth is 0; the guess is a usual value."""
        if len(self.truth) >= self.budget:
            return self.known(name, unit, scale)
        self._small[name] = scale
        self.features.add("truth 0")
        return self._of_model(name, 0.0, f'"{name}", "{unit}", {_digits(scale, 2)}')

    def offset(self, name: str, unit: str, value: float, sd: float) -> str:
        """A parameter of either sign; a known constant where there are enough unknowns."""
        if len(self.truth) >= self.budget:
            return self.known(name, unit, value)
        self.features.add("offset")
        self._small[name] = sd
        return self._of_model(name, value, f'"{name}", "{unit}", 0.0, positive=False, sd={_digits(sd, 2)}')

    def known(self, name: str, unit: str, value: float) -> str:
        """A constant."""
        rounded = float(_digits(value))
        self._known[name] = rounded
        self._declared.append(f'{name} = model.known("{name}", "{unit}", {rounded!r})')
        self._model[name] = name
        return name

    def _of_model(self, name: str, value: float, arguments: str) -> str:
        self.truth[name] = value
        self._declared.append(f"{name} = model.unknown({arguments})")
        self._model[name] = name
        return name

    def state(self, name: str, rate: str, start: float = 0.0) -> None:
        """A state in C, and `name` with `_rate`, its rate; `rate` is in own notation."""
        place = len(self._start)
        self._c |= {name: f"x[{place}]", f"{name}_rate": f"dx[{place}]"}
        self._start.append(start)
        self._rates.append(rate)

    def written(self, name: str, text: str) -> None:
        """What the model file has for a quantity of the own notation."""
        self._model[name] = text

    def slides(self, speed: str) -> None:
        """Dry friction acts on a speed that is a state: it may stick."""
        self.features.add("dry friction")
        self._slid.append(speed)

    def sensor(self, name: str, unit: str, value: str, driven: bool = False) -> str:
        """A measured signal; `value` in own notation."""
        self._sensed.append(Sensed(name, unit, value, self.between(*_BITS), driven))
        self._model[name] = name
        return name

    def hidden(self, name: str, unit: str) -> str:
        """A coordinate that no sensor measures."""
        self.features.add("hidden coordinate")
        self._declared.append(f'{name} = model.unmeasured("{name}", "{unit}")')
        self._model[name] = name
        return name

    def integral(self, name: str, unit: str, of: str) -> str:
        """The running integral of a signal, with its state."""
        self.features.add("integral")
        self._counted.append(len(self._start))
        self.state(name, of)
        self._declared.append(f'{name} = model.define("{name}", "{unit}", Integral({of}, 1))')
        self._model[name] = name
        return name

    def drive(
        self,
        name: str,
        unit: str,
        amplitude: float,
        mean: float = 0.0,
        smooth: bool = False,
        measured: bool = False,
        internal: bool = False,
        feedback: str = "",
    ) -> str:
        """A signal that the drive imposes.

        Parameters
        ----------
        smooth : sines or a chirp; not held where it is an input
        measured : by a sensor with noise
        internal, feedback : see Driven; feedback of a held input alone
        """
        shape = _SMOOTH[self.count(0, 1)] if smooth else _SHAPES[self.count(0, 3)]
        held = not smooth and not measured
        known = "servo" if internal else "held input" if held else "sampled input"
        self.features |= {shape, "measured drive" if measured else known}
        feedback = feedback if held else ""
        if feedback:
            self.features.add("feedback")
        self._c[name] = f"u[{len(self._driven)}]"
        self._driven.append(Driven(name, unit, amplitude, mean, shape, held, measured, internal, feedback))
        self._model[name] = name
        if measured:
            self._sensed.append(Sensed(name, unit, name, self.between(*_BITS), True))
        return name

    def equation(self, text: str) -> None:
        """= 0, in own notation."""
        self._equations.append(f"model.equation({self._in_model(text)})")

    def line(self, text: str) -> None:
        """A line of the model file, in own notation."""
        self._equations.append(self._in_model(text))

    # ---- result

    def rig(self, title: str) -> RandomRig:
        """What has been drawn."""
        values = {**self.truth, **self._known}
        self._c |= {name: f"p[{place}]" for place, name in enumerate(values)}
        c = self._in_c
        return RandomRig(
            self.kind,
            title,
            frozenset(self.features),
            dict(self.truth),
            dict(self._small),
            [replace(one, code=c(one.code)) for one in self._sensed],
            [replace(one, feedback=c(one.feedback)) for one in self._driven],
            list(self._start),
            [c(one) for one in self._rates],
            [int(c(speed)[2:-1]) for speed in self._slid],
            list(values.values()),
            list(self._declared),
            list(self._equations),
            list(self._counted),
        )

    def _in_model(self, text: str) -> str:
        return _WORD.sub(lambda found: self._model.get(found[0], found[0]), " ".join(text.split()))

    def _in_c(self, text: str) -> str:
        def sign(found: re.Match[str]) -> str:
            return f"s[{self._slid.index(found[1])}]" if found[1] in self._slid else f"sign({found[1]})"

        text = re.sub(r"sgn\((\w+)\)", sign, text)
        text = re.sub(r"\babs\(", "fabs(", text)
        return _WORD.sub(lambda found: self._c.get(found[0], found[0]), text)


# ---- kinds

_TURNING = {"x": "rad", "m": "kg*m^2", "F": "N*m", "c": "N*m*s", "k": "N*m", "v": "1/s", "a": "1/s^2"}
_STRAIGHT = {"x": "m", "m": "kg", "F": "N", "c": "N*s/m", "k": "N/m", "v": "m/s", "a": "m/s^2"}


def chain(s: Sketch) -> RandomRig:
    """One to three masses or inertias on springs and dampers."""
    turning = s.chance(0.5)
    units = _TURNING if turning else _STRAIGHT
    n = 3 if s.budget > IN_C else s.count(1, 3)
    mass, w = s.decades(-5, -1) if turning else s.decades(-2, 1), 2 * math.pi * s.decades(-0.3, 1)
    stretch = s.between(0.1, 1.0) if turning else s.decades(-3, -1)
    force = mass * w**2 * stretch
    grounded = s.chance(0.6)
    how = "known" if s.chance(0.7) else ("base", "free", "measured")[s.count(0, 2)]
    if how in ("base", "free"):
        grounded = True
        s.features.add("base motion" if how == "base" else "no input")
    measured = ["position"] * n
    if n == 1 and not grounded and s.chance(0.6):
        measured = ["speed"]
    elif n > 1 and s.chance(0.6):
        measured[s.count(0, n - 1)] = "hidden" if s.chance(0.6) else "speed"
    first = mass * s.between(0.5, 2)
    m = [s.known("m1", units["m"], first) if how in ("base", "free") else s.unknown("m1", units["m"], first)]
    m += [s.unknown(f"m{j + 1}", units["m"], mass * s.between(0.5, 2)) for j in range(1, n)]
    forces: list[list[str]] = [[] for _ in range(n)]
    links = []

    def damping(low: float) -> float:
        return 2 * mass * w * s.decades(low, -0.6)

    base = "xb" if how == "base" else "0"
    if grounded:
        k, c = s.unknown("k1", units["k"], mass * w**2 * s.between(0.5, 2)), s.unknown("c1", units["c"], damping(-1.7))
        ends = ("(x1 - xb)", "(v1 - vb)") if base == "xb" else ("x1", "v1")
        links.append(f"{k}*{ends[0]} + {c}*{ends[1]}")
        forces[0] += [f"{k}*{ends[0]}", f"{c}*{ends[1]}"]
    else:
        forces[0].append(f"{s.unknown('c1', units['c'], damping(-0.9))}*v1")
    for j in range(1, n):
        k = s.unknown(f"k{j + 1}", units["k"], mass * w**2 * s.between(0.5, 2))
        c = s.unknown(f"c{j + 1}", units["c"], damping(-1.7))
        link = [f"{k}*(x{j} - x{j + 1})", f"{c}*(v{j} - v{j + 1})"]
        links.append(" + ".join(link))
        forces[j - 1] += link
        forces[j] += [f"{k}*(x{j + 1} - x{j})", f"{c}*(v{j + 1} - v{j})"]
    if grounded and measured[0] == "position" and base == "0" and s.chance(0.3, "cubic spring"):
        cubic = s.unknown("kc", "N*m" if turning else "N/m^3", 0.5 * mass * w**2 / stretch**2)
        forces[0].append(f"{cubic}*x1*x1*x1")
        links[0] += f" + {cubic}*x1*x1*x1"
    seen = [j for j in range(n) if measured[j] != "hidden"]
    if s.chance(0.35):
        j = seen[s.count(0, len(seen) - 1)]
        level = s.unknown("Fc", units["F"], force * s.between(0.03, 0.12))
        forces[j].append(f"{level}*sgn(v{j + 1})")
        s.slides(f"v{j + 1}")
        if measured[j] == "speed":
            s.features.add("friction of a measured speed")
    elif s.chance(0.3):
        j = seen[s.count(0, len(seen) - 1)]
        forces[j].append(f"{s.superfluous('Fc', units['F'], 0.05 * force)}*sgn(v{j + 1})")
        s.slides(f"v{j + 1}")
    if how != "free" and s.chance(0.25, "constant load"):
        forces[0].append(f"{s.offset('F0', units['F'], 0.2 * force, force)}")
    elif grounded and measured[0] == "position" and base == "0" and s.chance(0.4, "encoder offset"):
        zero = s.offset("x0", units["x"], 0.3 * stretch, stretch)
        shifted = f"(x1 - {zero})"
        forces = [[one.replace("x1", shifted) for one in some] for some in forces]
        links = [one.replace("x1", shifted) for one in links]
    # the drive
    pull = "0"
    if how == "known":
        loop = s.chance(0.15) and measured[0] == "position"
        pull = s.drive(
            "F", units["F"], force, smooth=s.chance(0.3), feedback=f"-{_digits(0.5 * mass * w**2)}*x1" if loop else ""
        )
    elif how == "measured":
        pull = s.drive("F", units["F"], force, smooth=True, measured=True)
    elif how == "base":
        s.drive("ub", units["x"], stretch, smooth=True, internal=True)
        s.state("xb", "vb")
        s.state("vb", f"{_digits(w**2)}*(ub - xb) - {_digits(2 * w)}*vb")
        s.sensor("xb", units["x"], "xb", driven=True)
        s.written("vb", "xb.d()")
    for j in range(n):
        x, v, a = f"x{j + 1}", f"v{j + 1}", f"v{j + 1}_rate"
        thrust = f"{pull} - " if j == 0 and pull != "0" else "-"
        s.state(x, v, stretch * s.between(0.5, 1) if how == "free" else 0.0)
        s.state(v, f"({thrust}({' + '.join(forces[j]) or '0'}))/{m[j]}")
        if measured[j] == "position":
            s.sensor(x, units["x"], x)
            s.written(v, f"{x}.d()")
            s.written(a, f"{x}.d(2)")
        elif measured[j] == "speed":
            s.features.add("measured speed")
            s.sensor(v, units["v"], v)
            s.written(a, f"{v}.d()")
            if any(re.search(rf"\b{x}\b", one) for some in forces for one in some):
                s.hidden(x, units["x"])
                s.line(f"model.equation({v} - {x}.d())")
        else:
            s.hidden(x, units["x"])
            s.written(v, f"{x}.d()")
            s.written(a, f"{x}.d(2)")
    for j in range(n):
        s.equation(
            f"{m[j]}*v{j + 1}_rate + {' + '.join(forces[j]) or '0'}" + (f" - {pull}" if j == 0 and pull != "0" else "")
        )
    if s.chance(0.3, "accelerometer"):
        j = seen[s.count(0, len(seen) - 1)]
        zero = s.offset("g0", units["a"], 0.05 * force / mass, force / mass) if s.chance(0.9) else "0"
        s.sensor("acc", units["a"], f"v{j + 1}_rate + {zero}")
        s.equation(f"acc - v{j + 1}_rate" + (f" - {zero}" if zero != "0" else ""))
    if links and s.chance(0.25, "force cell"):
        s.sensor("f", units["F"], links[-1])
        s.equation(f"f - ({links[-1]})")
    return s.rig(f"chain of {n}")


def motor(s: Sketch) -> RandomRig:
    """A DC motor: with or without inductance, voltage or duty times a measured supply, angle or speed."""
    R, volt, fast = s.decades(-1, 1), s.decades(0.5, 1.7), s.decades(1, 3)
    k = volt / fast * s.between(0.6, 0.95)
    lag = s.decades(-1.7, -0.3)
    J = lag * k**2 / R
    coil, bus = s.chance(0.5), s.chance(0.35, "measured supply")
    if not coil:
        s.features.add("no inductance")
    p_R, p_k, p_J = s.unknown("R", "ohm", R), s.unknown("k", "N*m/A", k), s.unknown("J", "kg*m^2", J)
    p_L = s.unknown("L", "H", R * lag * s.decades(-1.4, -0.6)) if coil else "0"
    torque = k * volt / R
    b_scale = k**2 / R * s.between(0.02, 0.1)
    b = s.superfluous("b", "N*m*s", b_scale) if s.chance(0.2) else s.unknown("b", "N*m*s", b_scale)
    rest = [f"{b}*w1"]
    if s.chance(0.7):
        rest.append(f"{s.unknown('Tc', 'N*m', torque * s.between(0.02, 0.1))}*sgn(w1)")
        s.slides("w1")
    elif s.chance(0.5):
        rest.append(f"{s.superfluous('Tc', 'N*m', 0.05 * torque)}*sgn(w1)")
        s.slides("w1")
    if s.chance(0.2, "constant load"):
        rest.append(s.offset("T0", "N*m", 0.1 * torque, torque))
    zero = s.offset("i0", "A", 0.05 * volt / R, volt / R) if s.chance(0.4) else "0"
    smooth = not coil and s.chance(0.7)
    if bus:
        duty = s.drive("d", "", 0.9, smooth=smooth)
        supply = s.drive("vb", "V", 0.05 * volt, volt, smooth=True, measured=True)
        drop = f"{duty}*{supply}"
    else:
        loop = not smooth and s.chance(0.2)
        drop = s.drive("V", "V", volt, smooth=smooth, feedback=f"-{_digits(0.4 * k)}*w1" if loop else "")
    turn = s.chance(0.5)
    w1_rate = f"({p_k}*i1 - ({' + '.join(rest)}))/{p_J}"
    if coil:
        s.state("i1", f"({drop} - {p_R}*i1 - {p_k}*w1)/{p_L}")
        current = "i1"
    else:
        current = f"(({drop} - {p_k}*w1)/{p_R})"
        w1_rate = w1_rate.replace("i1", current)
    s.state("phi1", "w1")
    s.state("w1", w1_rate)
    i = s.sensor("i", "A", f"{current} + {zero}")
    net = f"({i} - {zero})" if zero != "0" else i
    if turn:
        s.sensor("phi", "rad", "phi1")
        s.written("w1", "phi.d()")
        s.written("w1_rate", "phi.d(2)")
    else:
        s.features |= {"measured speed", *(["friction of a measured speed"] if s._slid else [])}
        s.sensor("w", "1/s", "w1")
        s.written("w1", "w")
        s.written("w1_rate", "w.d()")
    s.written("i_rate", "i.d()")
    s.equation((f"{p_L}*i_rate + " if coil else "") + f"{p_R}*{net} + {p_k}*w1 - {drop}")
    s.equation(f"{p_J}*w1_rate + {' + '.join(rest)} - {p_k}*{net}")
    return s.rig("motor")


def ladder(s: Sketch) -> RandomRig:
    """Resistors and capacitors behind a voltage; the current is an algebraic sensor."""
    n, R, lag = s.count(1, 3), s.decades(1, 4), s.decades(-3, 0)
    u = s.drive("u", "V", s.decades(0, 1.5), smooth=s.chance(0.6))
    r = [s.unknown(f"R{j + 1}", "ohm", R * s.between(0.5, 2)) for j in range(n)]
    c = [s.unknown(f"C{j + 1}", "F", lag / R * s.between(0.5, 2)) for j in range(n)]
    load = s.unknown("Rl", "ohm", R * n * s.between(1, 4)) if s.chance(0.5) else ""
    s.features.add("algebraic sensor")
    flows = [f"({u if j == 0 else f'v{j}'} - v{j + 1})/{r[j]}" for j in range(n)]
    for j in range(n):
        away = flows[j + 1] if j + 1 < n else f"v{j + 1}/{load}" if load else "0"
        s.state(f"v{j + 1}", f"({flows[j]} - {away})/{c[j]}")
        s.written(f"v{j + 1}_rate", f"v{j + 1}.d()")
    zero = s.offset("i0", "A", 0.02 / R, 1 / R) if s.chance(0.3) else "0"
    i = s.sensor("i", "A", f"{flows[0]} + {zero}")
    for j in range(n):
        if j == n - 1 or s.chance(0.5):
            s.sensor(f"v{j + 1}", "V", f"v{j + 1}")
        else:
            s.hidden(f"v{j + 1}", "V")
    s.equation(f"{i} - {flows[0]}" + (f" - {zero}" if zero != "0" else ""))
    for j in range(n):
        away = f" - {flows[j + 1]}" if j + 1 < n else f" - v{j + 1}/{load}" if load else ""
        s.equation(f"{c[j]}*v{j + 1}_rate - ({flows[j]})" + (away.replace(" - ", " + ", 1) if away else ""))
    return s.rig("RC ladder")


def converter(s: Sketch) -> RandomRig:
    """A coil and a capacitor, with its series resistance in some: duty times a measured supply, or a voltage."""
    volt, load, lag = s.decades(0.7, 1.7), s.decades(0, 1), s.decades(-4, -1)
    w = 1 / lag
    bus, series = s.chance(0.6, "measured supply"), s.chance(0.5, "series resistance")
    damping = s.between(0.2, 0.7)
    ohm = load * s.between(0.02, 0.1)
    L, C = load / w * damping, 1 / (load * w * damping)
    p_L, p_C, p_Ro = s.unknown("L", "H", L), s.unknown("C", "F", C), s.unknown("Ro", "ohm", load)
    p_RL = s.unknown("RL", "ohm", ohm)
    p_Rc = s.unknown("Rc", "ohm", load * s.between(0.02, 0.1)) if series else "0"
    if bus:
        source = "d*vin"
        s.drive("d", "", 0.4, 0.5, smooth=s.chance(0.3))
        s.drive("vin", "V", 0.05 * volt, volt, smooth=True, measured=True)
    else:
        source = s.drive("u", "V", volt, smooth=s.chance(0.3))
    across = f"((vc + {p_Rc}*i1)/(1 + {p_Rc}/{p_Ro}))" if series else "vc"
    s.state("i1", f"({source} - {p_RL}*i1 - {across})/{p_L}")
    s.state("vc", f"(i1 - {across}/{p_Ro})/{p_C}")
    s.sensor("i", "A", "i1")
    s.sensor("v", "V", across)
    s.written("i_rate", "i.d()")
    s.equation(f"{p_L}*i_rate + {p_RL}*i + v - {source}")
    if series:
        s.hidden("vc", "V")
        s.written("vc_rate", "vc.d()")
        s.equation(f"{p_C}*vc_rate - i + v/{p_Ro}")
        s.equation(f"v - vc - {p_Rc}*(i - v/{p_Ro})")
    else:
        s.written("v_rate", "v.d()")
        s.equation(f"{p_C}*v_rate - i + v/{p_Ro}")
    return s.rig("converter")


def stores(s: Sketch) -> RandomRig:
    """Heat capacities or tanks in a row, some not measured; heat flows to a measured ambience, water to nowhere."""
    thermal = s.chance(0.6)
    n, lag = s.count(1, 3), s.decades(0.5, 2.5)
    amount, resists = ("J/K", "K/W") if thermal else ("m^2", "s/m^2")
    store = s.decades(0, 3) if thermal else s.decades(-3, 0)
    level = s.decades(0.5, 1.5) if thermal else s.decades(-1.5, 0)
    resistance = lag / store
    inflow = s.drive(
        "P" if thermal else "q", "W" if thermal else "m^3/s", 0.5 * level / resistance, 0.5 * level / resistance
    )
    outside = "0"
    if thermal:
        outside = s.drive("Ta", "K", 0.1 * level, 293.0, smooth=True, measured=True)
    unit, letter = ("K", "T") if thermal else ("m", "h")
    c = [s.unknown(f"C{j + 1}", amount, store * s.between(0.5, 2)) for j in range(n)]
    r = [s.unknown(f"R{j + 1}", resists, resistance * s.between(0.5, 2)) for j in range(n)]
    quantities = [f"{letter}{j + 1}" for j in range(n)]
    ends = [*quantities[1:], outside]
    flows = [
        f"({one} - {other})/{r[j]}" if other != "0" else f"{one}/{r[j]}"
        for j, (one, other) in enumerate(zip(quantities, ends, strict=True))
    ]
    for j, one in enumerate(quantities):
        s.state(one, f"({inflow if j == 0 else flows[j - 1]} - {flows[j]})/{c[j]}", 293.0 if thermal else 0.0)
        s.written(f"{one}_rate", f"{one}.d()")
    for j, one in enumerate(quantities):
        if j == n - 1 or s.chance(0.5):
            s.sensor(one, unit, one)
        else:
            s.hidden(one, unit)
    for j, one in enumerate(quantities):
        s.equation(f"{c[j]}*{one}_rate + {flows[j]} - " + (inflow if j == 0 else f"{flows[j - 1]}"))
    return s.rig("heat" if thermal else "tanks")


def cell(s: Sketch) -> RandomRig:
    """A battery: running integral of the current, one or two RC pairs."""
    pairs, R, volt = s.count(1, 2), s.decades(-2.5, -1), s.between(2.5, 12)
    ampere = volt * s.between(0.01, 0.05) / R
    lag = s.decades(0.5, 1.5)
    smooth = s.chance(0.5)
    i = s.drive("i", "A", ampere, 0.3 * ampere, smooth=smooth, measured=smooth or s.chance(0.5))
    p_E, p_R0 = s.unknown("E", "V", volt), s.unknown("R0", "ohm", R)
    p_s = s.unknown("s", "V/(A*s)", 0.1 * volt / (ampere * 60 * lag))
    inner = []
    for j in range(pairs):
        T = lag * (1 if j == 0 else s.between(5, 9))
        p_R, p_T = s.unknown(f"R{j + 1}", "ohm", R * s.between(0.4, 1)), s.unknown(f"T{j + 1}", "s", T)
        s.state(f"h{j + 1}", f"({p_R}*{i} - h{j + 1})/{p_T}")
        s.written(f"h{j + 1}_rate", f"h{j + 1}.d()")
        inner.append((f"h{j + 1}", p_R, p_T))
    s.integral("z", "A*s", i)
    total = f"{p_R0}*{i} + {p_s}*z + " + " + ".join(one for one, _, _ in inner)
    s.sensor("v", "V", f"{p_E} - ({total})")
    s.equation(f"v - {p_E} + {total}")
    for one, p_R, p_T in inner:
        s.hidden(one, "V")
        s.equation(f"{p_T}*{one}_rate + {one} - {p_R}*{i}")
    return s.rig("cell")


def totaliser(s: Sketch) -> RandomRig:
    """The level of a tank from the integral of a measured flow: an algebraic equation, no derivative at all."""
    area, flow, lag = s.decades(-2, 1), s.decades(-5, -2), s.decades(0, 2)
    q = s.drive("q", "m^3/s", flow, 0.2 * flow, smooth=True, measured=True)
    p_A = s.unknown("A", "m^2", area)
    s.integral("z", "m^3", q)
    zero = s.offset("h0", "m", s.between(-1, 1) * flow * lag / area, flow * lag / area)
    s.sensor("h", "m", f"z/{p_A} + {zero}")
    s.equation(f"{p_A}*(h - {zero}) - z")
    return replace(s.rig("totaliser"), pace=1 / lag, lasts=lag * s.between(60, 200))


def pendulum(s: Sketch) -> RandomRig:
    """Swings about a pivot; free, or driven by a torque."""
    free, J, w = s.chance(0.5), s.decades(-4, -1), 2 * math.pi * s.decades(-0.2, 0.6)
    if free:
        s.features.add("no input")
    G = J * w**2
    p_J = s.known("J", "kg*m^2", J) if free else s.unknown("J", "kg*m^2", J)
    p_G = s.unknown("G", "N*m", G)
    scale = 2 * J * w * s.decades(-2.3, -1.3)
    b = s.superfluous("b", "N*m*s", scale) if s.chance(0.25) else s.unknown("b", "N*m*s", scale)
    rest = [f"{b}*v1"]
    if s.chance(0.4):
        rest.append(f"{s.unknown('Tc', 'N*m', G * s.between(0.002, 0.01))}*sgn(v1)")
        s.slides("v1")
    if s.chance(0.4, "air drag"):
        rest.append(f"{s.unknown('cw', 'kg*m^2', J * s.between(0.005, 0.03))}*abs(v1)*v1")
    zero = s.offset("a0", "rad", s.between(-0.3, 0.3), 0.5) if s.chance(0.7, "encoder offset") else "0"
    shift = f" - {zero}" if zero != "0" else ""
    pull = "" if free else s.drive("u", "N*m", 0.5 * G, smooth=s.chance(0.3))
    s.state("x1", "v1", s.between(0.6, 1.2) if free else 0.0)
    s.state("v1", f"({pull or '0'} - ({' + '.join(rest)}) - {p_G}*sin(x1{shift}))/{p_J}")
    s.sensor("a", "rad", "x1")
    for own, text in (("x1", "a"), ("v1", "a.d()"), ("v1_rate", "a.d(2)")):
        s.written(own, text)
    s.equation(f"{p_J}*v1_rate + {' + '.join(rest)} + {p_G}*sin(x1{shift})" + (f" - {pull}" if pull else ""))
    if s.chance(0.3, "gyro"):
        bias = s.offset("w0", "1/s", 0.05 * w, w) if s.chance(0.5) else "0"
        s.sensor("gyro", "1/s", f"v1 + {bias}")
        s.equation("gyro - v1" + (f" - {bias}" if bias != "0" else ""))
    return s.rig("pendulum")


def cart(s: Sketch) -> RandomRig:
    """A pendulum on a cart, by its Lagrangian."""
    whole, w = s.decades(-1, 1), 2 * math.pi * s.decades(-0.2, 0.5)
    length = 9.81 / w**2
    share = s.between(0.1, 0.4)
    ml = share * whole * length
    p_mt, p_ml = s.unknown("mt", "kg", whole), s.unknown("ml", "kg*m", ml)
    p_J = s.unknown("Jp", "kg*m^2", ml * length * s.between(1.0, 1.3))
    force = whole * 9.81 * s.between(0.1, 0.3)
    p_b = s.unknown("b", "N*s/m", whole * w * s.between(0.05, 0.3))
    p_bp = s.unknown("bp", "N*m*s", ml * length * w * s.decades(-2, -1))
    friction = ""
    if s.chance(0.5):
        friction = f" + {s.unknown('Fc', 'N', force * s.between(0.03, 0.1))}*sgn(v)"
        s.slides("v")
    zero = s.offset("c", "rad", s.between(-0.4, 0.4), 0.5) if s.chance(0.7, "encoder offset") else "0"
    p_g = s.known("g", "m/s^2", 9.81)
    F = s.drive("F", "N", force, smooth=s.chance(0.3))
    at = f"a - {zero}" if zero != "0" else "a"
    push = f"({F} - ({p_b}*v{friction}) + {p_ml}*sin({at})*w*w)"
    turn = f"(-{p_bp}*w - {p_ml}*{p_g}*sin({at}))"
    det = f"({p_mt}*{p_J} - {p_ml}*{p_ml}*cos({at})*cos({at}))"
    s.state("x", "v")
    s.state("v", f"({p_J}*{push} - {p_ml}*cos({at})*{turn})/{det}")
    s.state("a", "w", 0.3)
    s.state("w", f"({p_mt}*{turn} - {p_ml}*cos({at})*{push})/{det}")
    s.sensor("x", "m", "x")
    s.sensor("a", "rad", "a")
    s.written("v", "x.d()")
    s.written("w", "a.d()")
    s.features.add("Lagrangian")
    s.line(f"T = {p_mt}*v**2/2 + {p_ml}*cos({at})*v*w + {p_J}*w**2/2")
    forces = f"[{F} - {p_b}*v{friction.replace(' + ', ' - ')}, -{p_bp}*w]"
    s.line(f"model.lagrange(T + {p_ml}*{p_g}*cos({at}), [x, a], {forces})")
    return s.rig("cart with pendulum")


def vehicle(s: Sketch) -> RandomRig:
    """Rolls with the speed measured; pushed, or coasting down without an input."""
    free, mass, fast = s.chance(0.5), s.decades(1, 3.3), s.decades(0.5, 1.3)
    force = mass * s.between(0.3, 1.0)
    s.features |= {"measured speed", *(["no input"] if free else [])}
    p_m = s.known("m", "kg", mass) if free else s.unknown("m", "kg", mass)
    parts = [f"{s.unknown('Fr', 'N', force * s.between(0.05, 0.15))}*sgn(v)"]
    s.features.add("friction of a measured speed")
    s.slides("v")
    scale = force / fast * s.between(0.2, 0.5)
    b = s.superfluous("b", "N*s/m", scale) if s.chance(0.3) else s.unknown("b", "N*s/m", scale)
    parts.append(f"{b}*v")
    if s.chance(0.7, "air drag"):
        parts.append(f"{s.unknown('cw', 'kg/m', force / fast**2 * s.between(0.3, 0.8))}*v*abs(v)")
    if not free and s.chance(0.3, "constant load"):
        parts.append(s.offset("F0", "N", 0.05 * force, force))
    pull = "" if free else s.drive("F", "N", force, smooth=s.chance(0.3))
    s.state("v", f"({pull or '0'} - ({' + '.join(parts)}))/{p_m}", fast if free else 0.0)
    s.sensor("v", "m/s", "v")
    s.written("v_rate", "v.d()")
    s.equation(f"{p_m}*v_rate + {' + '.join(parts)}" + (f" - {pull}" if pull else ""))
    rig = s.rig("vehicle")
    stop = mass * fast / force
    return replace(rig, pace=4 / stop, lasts=stop * s.between(0.5, 1.5) if free else stop * s.between(30, 60))


def press(s: Sketch) -> RandomRig:
    """A servo moves a part, the force cell measures what that takes: an algebraic equation of recorded signals."""
    w, stretch, force = 2 * math.pi * s.decades(-0.5, 1), s.decades(-3, -1), s.decades(0, 3)
    s.features |= {"no mass", "force cell"}
    s.drive("command", "m", stretch, smooth=True, internal=True)
    s.state("x1", "v1")
    s.state("v1", f"{_digits(w**2)}*(command - x1) - {_digits(2 * w)}*v1")
    s.sensor("x", "m", "x1", driven=True)
    for own, text in (("x1", "x"), ("v1", "x.d()"), ("v1_rate", "x.d(2)")):
        s.written(own, text)
    parts = [f"{s.unknown('k', 'N/m', force / stretch)}*x1"]
    if s.chance(0.6):
        parts.append(f"{s.unknown('c', 'N*s/m', 0.3 * force / stretch / w)}*v1")
    if s.chance(0.4):
        parts.append(f"{s.unknown('m', 'kg', 0.3 * force / stretch / w**2)}*v1_rate")
    if s.chance(0.6, "dry friction"):
        parts.append(f"{s.unknown('Fc', 'N', 0.2 * force)}*sgn(v1)")
    if s.chance(0.3, "cubic spring"):
        parts.append(f"{s.unknown('k3', 'N/m^3', 0.5 * force / stretch**3)}*x1*x1*x1")
    if s.chance(0.5):
        parts.append(s.offset("f0", "N", 0.2 * force, force))
    s.sensor("f", "N", " + ".join(parts))
    s.equation(f"{' + '.join(parts)} - f")
    return s.rig("press")


def slider(s: Sketch) -> RandomRig:
    """A part without a mass on spring, damper and dry friction; in some a known force holds it at rest at times."""
    lag, stretch, force = s.decades(-1.5, 0.5), s.decades(-3, -1), s.decades(0, 3)
    s.features |= {"no mass", "dry friction"}
    k, c = s.unknown("k", "N/m", force / stretch), s.unknown("c", "N*s/m", lag * force / stretch)
    level = s.unknown("Fc", "N", force * s.between(0.05, 0.3))
    F = s.drive("F", "N", force, smooth=s.chance(0.7))
    s.state("x1", f"shrunk({F} - {k}*x1, {level})/{c}")
    s.sensor("x", "m", "x1")
    s.written("x1", "x")
    s.written("x1_rate", "x.d()")
    s.equation(f"{k}*x1 + {c}*x1_rate + {level}*sgn(x1_rate) - {F}")
    return s.rig("slider")


KINDS: Mapping[str, Callable[[Sketch], RandomRig]] = {
    one.__name__: one
    for one in (chain, motor, ladder, converter, stores, cell, totaliser, pendulum, cart, vehicle, press, slider)
}
_OFTEN = {"chain": 3, "motor": 3, "converter": 2, "pendulum": 2, "vehicle": 2}


def random_rig(seed: int, kind: str | None = None) -> RandomRig:
    """The rig of a seed: the same one on every computer. kind: of KINDS; None: drawn as well."""
    source = np.random.default_rng([46, seed])
    urn = [name for name in KINDS for _ in range(_OFTEN.get(name, 1))]
    drawn = urn[int(source.integers(len(urn)))]
    many = source.random() < 0.04
    budget = int(source.integers(9, 12)) if many else int(source.integers(4, IN_C + 1))
    sketch = Sketch(source, kind or ("chain" if many else drawn), budget)
    rig = KINDS[sketch.kind](sketch)
    if len(rig.truth) > IN_C:
        rig = replace(rig, features=rig.features | {"more than 8 unknowns"})
    return rig
