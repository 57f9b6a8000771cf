"""Models that lack something: recordings of plants with one more effect, and what `identify` makes of them.

The plants (`bench.plants`) are integrated there, not by pvid; the model is that of the plant without the effect. A
table of effects in three strengths each is one part; the other is a campaign: a random sample of all effects that a
plant may have, in five strengths, alone and in pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from math import exp, tanh

import numpy as np
import numpy.typing as npt

from bench.case import Advance, Report, columns, counts
from bench.plants import NOTHING, PLANTS, SAMPLES, Axis, Plant, States, Values
from pvid.base.errors import PvidError
from pvid.identification.road import identified
from pvid.oracle.weak.identify import Identified
from pvid.oracle.weak.naming import Term, terms_of
from pvid.rig.run import Recording

Float = npt.NDArray[np.float64]
Law = Callable[[States, float], float]  # of states and time [s]

HEADER = columns(
    "plant | effect | runs | error % | in s.e. without the model's part | in s.e. | wrong without a warning | "
    "warnings | named rightly | named wrongly | error with the named terms %"
)

WRONG_SE, WRONG = (4.0, 0.02)  # an answer is wrong beyond so many standard errors and this part of the value


@dataclass(frozen=True)
class Effect:
    """What a plant has and its model lacks.

    Attributes
    ----------
    named : laws, or parts of the clauses on a signal, that name it rightly; () if no name is right
    sizes : strengths
    law : of states and time, what the left side of equation `row` has more for size 1
    acts : true input from the recorded one and the strength
    shows : recorded sensor values from true ones, the rate and the strength
    sensor : whose values; "": all
    value : a parameter or constant that is not constant, or not what the model has
    course : its relative change for size 1, of states and time
    memory : rate of one more state, the last one
    adds : what it adds to a parameter of the model for size 1, from and to: each value between counts as right
    """

    plant: str
    name: str
    named: tuple[str, ...]
    sizes: tuple[float, ...]
    law: Law | None = None
    row: int = 0
    acts: Callable[[Float, float], Float] | None = None
    shows: Callable[[Float, float, float], Float] | None = None
    sensor: str = ""
    value: str = ""
    course: Law = lambda s, t: 1.0
    memory: Law | None = None
    adds: tuple[tuple[str, float, float], ...] = ()


def _clip(u: Float, level: float) -> Float:
    return np.clip(u, -level, level)


def _dead(u: Float, level: float) -> Float:
    return np.asarray(np.sign(u) * np.maximum(np.abs(u) - level, 0))


def _sag(u: Float, part: float) -> Float:
    return u * (1 - part * np.abs(u))


def _behind(x: Float, samples: float) -> Float:
    """Behind a first-order lag."""
    decay, out = float(np.exp(-1 / samples)), np.empty_like(x)
    now = x[0]
    for place, value in enumerate(x):
        now = decay * now + (1 - decay) * value
        out[place] = now
    return out


def _late(x: Float, rate: float, seconds: float) -> Float:
    place = np.arange(len(x), dtype=np.float64)
    return np.interp(place - seconds * rate, place, x)


def _play(x: Float, _: float, width: float) -> Float:
    out, now = np.empty_like(x), x[0]
    for place, value in enumerate(x):
        now = min(max(now, value - width / 2), value + width / 2)
        out[place] = now
    return out


EFFECTS = (
    Effect("cart", "drag", ("abs(x.d())*x.d()",), (0.2, 0.8, 3.0), lambda s, t: abs(s[1]) * s[1]),
    Effect("cart", "cubic spring", ("x**3",), (250, 1000, 4000), lambda s, t: s[0] ** 3),
    Effect("cart", "dry friction", ("sgn(x.d())",), (0.03, 0.15, 0.5), lambda s, t: tanh(s[1] / 1e-3)),
    Effect("cart", "saturation [N]", ("saturates",), (5.5, 4.0, 2.8), acts=_clip),
    Effect("cart", "dead band [N]", ("dead band", "sgn(F)"), (0.1, 0.4, 1.2), acts=_dead),
    Effect("cart", "sag with load", ("abs(F)/", "(F/"), (0.005, 0.012, 0.03), acts=_sag),
    Effect("cart", "lag of the force [samples]", ("lag", "late", "delayed"), (3, 8, 20), acts=_behind),
    Effect("cart", "delay of the sensor [s]", ("delayed", "late"), (0.003, 0.008, 0.02), shows=_late),
    Effect("motor", "brush drop [V]", ("sgn(i)",), (0.1, 0.3, 0.9), lambda s, t: tanh(s[0] / 2e-3)),
    Effect("motor", "fan torque", ("abs(w)*w",), (5e-7, 2e-6, 8e-6), lambda s, t: abs(s[1]) * s[1], row=1),
    Effect("motor", "dry friction", ("sgn(w)",), (0.003, 0.01, 0.03), lambda s, t: tanh(s[1] / 0.05), row=1),
    Effect("motor", "load torque", ("1",), (0.005, 0.02, 0.05), lambda s, t: 1.0, row=1),
    Effect("motor", "saturation [V]", ("saturates",), (8.0, 6.0, 4.5), acts=_clip),
    Effect("motor", "dead band [V]", ("dead band", "sgn(V)"), (0.15, 0.5, 1.5), acts=_dead),
    Effect("motor", "sag with load", ("abs(V)/", "(V/"), (0.003, 0.01, 0.02), acts=_sag),
    Effect("motor", "delay of the sensors [s]", ("delayed", "late"), (0.0008, 0.002, 0.004), shows=_late),
    Effect("pendulum", "drag", ("abs(q.d())*q.d()",), (0.002, 0.01, 0.04), lambda s, t: abs(s[1]) * s[1]),
    Effect("pendulum", "dry friction", ("sgn(q.d())",), (0.01, 0.04, 0.12), lambda s, t: tanh(s[1] / 5e-3)),
    Effect("pendulum", "spring", ("q",), (0.05, 0.2, 0.8), lambda s, t: s[0]),
    Effect("pendulum", "saturation [N m]", ("saturates",), (1.1, 0.85, 0.6), acts=_clip),
    Effect("pendulum", "dead band [N m]", ("dead band", "sgn(M)"), (0.02, 0.08, 0.2), acts=_dead),
    Effect("pendulum", "delay of the sensor [s]", ("delayed", "late", "lag"), (0.004, 0.012, 0.03), shows=_late),
    Effect("pendulum", "backlash [rad]", ("backlash",), (0.01, 0.03, 0.08), shows=_play),
    Effect("lag", "cubic", ("y**3",), (0.003, 0.01, 0.03), lambda s, t: s[0] ** 3),
    Effect("lag", "square", ("abs(y)*y",), (0.01, 0.03, 0.1), lambda s, t: abs(s[0]) * s[0]),
    Effect("lag", "saturation [V]", ("saturates",), (2.0, 1.6, 1.1), acts=_clip),
    Effect("lag", "dead band [V]", ("dead band", "sgn(u)"), (0.04, 0.12, 0.4), acts=_dead),
    Effect("lag", "sag with load", ("abs(u)/", "(u/"), (0.01, 0.03, 0.1), acts=_sag),
    Effect("lag", "lag of the input [samples]", ("lag", "late", "delayed", "y.d(2)"), (2, 6, 15), acts=_behind),
    Effect("lag", "delay of the sensor [s]", ("delayed", "late", "y.d(2)"), (0.005, 0.015, 0.04), shows=_late),
)


OF_TABLE = tuple(dict.fromkeys(one.plant for one in EFFECTS))  # plants

# ---- what any plant may have ----

FORCES = (0.003, 0.01, 0.03, 0.1, 0.3)  # of the equation's left side
_SWITCH = 0.003  # of the rms rate, over which a friction changes its sign

Shape = Callable[[float, float, float], float]  # of place and rate, over their rms, and part of the run


def _sgn(v: float) -> float:
    return tanh(v / _SWITCH)


# Name, terms that name it rightly ({x}: the sensor, {m}: its rate, or itself where it measures a rate, {o}: a parameter
# that is a load or an offset, {c}: that of dry friction; "": there is none), the shape.
_MOTIONS: tuple[tuple[str, tuple[str, ...], Shape], ...] = (
    ("dry friction", ("sgn({m})",), lambda x, v, t: _sgn(v)),
    ("friction in one direction", ("sgn({m})", "1"), lambda x, v, t: max(_sgn(v), 0.0)),
    ("friction of two sizes", ("sgn({m})",), lambda x, v, t: _sgn(v) * (1 if v > 0 else 0.4)),
    ("friction at low speed", ("sgn({m})", "sgn({m})/(1 +"), lambda x, v, t: _sgn(v) / (1 + (v / 0.15) ** 2)),
    ("Stribeck friction", ("sgn({m})", "sgn({m})/(1 +"), lambda x, v, t: _sgn(v) * (0.5 + 0.5 / (1 + (v / 0.15) ** 2))),
    ("soft friction", ("sgn({m})", "the friction is soft"), lambda x, v, t: tanh(v / 0.2)),
    ("friction of a place", ("sgn({m})",), lambda x, v, t: _sgn(v) * (1 + 0.5 * x)),
    ("friction that runs in", ("sgn({m})", "{c} changes"), lambda x, v, t: _sgn(v) * exp(-3 * t)),
    ("square drag", ("abs({m})*{m}",), lambda x, v, t: abs(v) * v),
    ("cubic drag", ("{m}**3",), lambda x, v, t: v**3),
    ("damping of one direction", ("abs({m})",), lambda x, v, t: max(v, 0.0)),
    ("damping of a place", ("{x}**2*{x}.d()",), lambda x, v, t: x * x * v),
    ("constant load", ("1",), lambda x, v, t: 1.0),
    ("step of the load", ("the load of {row} ", "{o} changes"), lambda x, v, t: float(t > 0.5)),
    ("drift of the load", ("the load of {row} ", "{o} changes"), lambda x, v, t: t - 0.5),
    ("load of another frequency", (), lambda x, v, t: float(np.sin(180 * t))),
    ("pushes", (), lambda x, v, t: float(t * 17 % 1 < 0.06)),
    ("cubic spring", ("{x}**3",), lambda x, v, t: x**3),
    ("square spring", ("abs({x})*{x}",), lambda x, v, t: abs(x) * x),
    ("even spring", ("{x}**2",), lambda x, v, t: x * x),
    ("preload of a spring", ("sgn({x})",), lambda x, v, t: tanh(x / 0.01)),
    ("stop", ("({x} +",), lambda x, v, t: 5 * (max(x - 1.2, 0.0) + min(x + 1.2, 0.0))),
)
# The part of sgn({m}), and of {m}, that a law is of: from and to.
_OF_SIGN = {
    "dry friction": (1.0, 1.0),
    "friction in one direction": (0.0, 1.0),
    "friction of two sizes": (0.4, 1.0),
    "friction at low speed": (0.0, 1.0),
    "Stribeck friction": (0.5, 1.0),
    "soft friction": (0.0, 1.0),
    "friction of a place": (0.0, 2.0),
    "friction that runs in": (0.0, 1.0),
    "bristles (hysteresis)": (0.0, 1.0),
}
_OF_RATE = {
    "damping of one direction": (0.0, 1.0),
    "damping of a place": (0.0, 4.0),
    "spring behind a damper": (0.0, 1.0),  # a damper to slow motion and a spring to fast one
}
_OF_PLACE = {"spring behind a damper": (0.0, 1.0)}
_OF_ANGLES: tuple[tuple[str, tuple[str, ...], Shape], ...] = (
    ("unbalance", ("cos({x})",), lambda x, v, t: float(np.cos(x))),
    ("gravity", ("sin({x})",), lambda x, v, t: float(np.sin(x))),
    ("cogging, 6 a turn", ("sin(6*{x})",), lambda x, v, t: float(np.sin(6 * x))),
    ("cogging, 24 a turn", ("sin(24*{x})",), lambda x, v, t: float(np.sin(24 * x))),
)


def _laws_of(plant: Plant, axis: Axis) -> Iterator[Effect]:
    span, x_rms = SAMPLES / plant.rate, float(plant.sizes[axis.x])
    place_of_rate = axis.x if axis.v is None else axis.v
    v_rms = float(plant.sizes[place_of_rate])
    motion = axis.sensor if axis.v is None else f"{axis.sensor}.d()"

    def law(shape: Shape, scale: float) -> Law:
        return lambda s, t: axis.force * shape(s[axis.x] / scale, s[place_of_rate] / v_rms, t / span)

    def effect(name: str, named: tuple[str, ...], law: Law, memory: Law | None = None) -> Effect:
        own = {"m": motion, "x": axis.sensor, "o": plant.offset, "c": axis.coulomb, "row": f"equation {axis.row + 1}"}
        terms = tuple(text for one in named if not (text := one.format(**own)).startswith(" "))
        parts = (
            (axis.coulomb, _OF_SIGN, axis.force),
            (axis.viscous, _OF_RATE, axis.force / v_rms),
            (axis.stiffness, _OF_PLACE, axis.force / x_rms),
            (axis.gravity, {"gravity": (1.0, 1.0)}, axis.force),
        )
        adds = tuple((own, unit * of[name][0], unit * of[name][1]) for own, of, unit in parts if own and name in of)
        return Effect(plant.name, f"{name} ({axis.sensor})", terms, FORCES, law, axis.row, memory=memory, adds=adds)

    for name, named, shape in _MOTIONS:
        if axis.v is not None or "{x}" not in "".join(named) or name in ("even spring", "stop"):  # others: of a place
            yield effect(name, named, law(shape, x_rms))
    for name, named, shape in _OF_ANGLES if axis.angle else ():
        yield effect(name, named, law(shape, 1.0))
    if axis.v is not None:
        slow, short = v_rms / x_rms, 0.1 * x_rms

        def bristle(s: States, t: float) -> float:
            v = s[place_of_rate]
            return (v - abs(v) * s[-1]) / short

        yield effect("bristles (hysteresis)", ("sgn({m})",), lambda s, t: axis.force * s[-1], bristle)
        yield effect(
            "spring behind a damper",
            (),
            lambda s, t: axis.force * s[-1] / x_rms,
            lambda s, t: s[place_of_rate] - slow * s[-1],
        )


_LATE_NAMES = ("lag", "late", "delayed", "early", "advanced", "{x}.d(2)")

# Name, right names ({u}: the input), strengths, true input from the recorded one over its largest magnitude.
_INPUTS: tuple[tuple[str, tuple[str, ...], tuple[float, ...], Callable[[Float, float], Float]], ...] = (
    ("saturation", ("saturates",), (0.9, 0.75, 0.6, 0.5, 0.4), _clip),
    ("saturation of one side", ("saturates",), (0.9, 0.75, 0.6, 0.5, 0.4), lambda u, level: np.minimum(u, level)),
    ("dead band", ("dead band", "sgn({u})"), (0.005, 0.015, 0.04, 0.1, 0.2), _dead),
    ("sag with load", ("abs({u})/", "({u}/"), (0.01, 0.03, 0.1, 0.2, 0.4), _sag),
    ("cubic sag", ("abs({u})/", "({u}/"), (0.01, 0.03, 0.1, 0.2, 0.4), lambda u, part: u * (1 - part * u**2)),
    ("drop", ("sgn({u})", "dead band"), (0.005, 0.015, 0.04, 0.1, 0.2), lambda u, part: u - part * np.sign(u)),
    ("lag", _LATE_NAMES, (1, 3, 8, 20, 40), _behind),
    ("dead time", _LATE_NAMES, (1, 2, 5, 10, 20), lambda u, late: _late(u, 1.0, late)),
    ("offset", ("1",), (0.005, 0.015, 0.04, 0.1, 0.2), lambda u, part: u + part),
    ("play", (), (0.01, 0.03, 0.08, 0.2, 0.4), lambda u, width: _play(u, 0.0, width)),
    ("coarse steps", (), (0.01, 0.03, 0.08, 0.2, 0.4), lambda u, step: step * np.round(u / step)),
    ("limited rate", _LATE_NAMES, (0.5, 0.2, 0.1, 0.05, 0.02), lambda u, step: _limited(u, step)),
    (
        "drift of the gain",
        ("the gain of {u} changes",),
        (0.01, 0.03, 0.1, 0.2, 0.4),
        lambda u, part: u * (1 - part * np.linspace(0, 1, len(u))),
    ),
    (
        "another gain to one side",
        ("where it is negative",),
        (0.01, 0.03, 0.1, 0.2, 0.4),
        lambda u, part: np.where(u > 0, u, (1 - part) * u),
    ),
    ("ripple", (), (0.01, 0.03, 0.1, 0.2, 0.4), lambda u, part: u + part * np.sin(0.9 * np.arange(len(u)))),
)


def _limited(u: Float, step: float) -> Float:
    """By so much a sample at most."""
    out, now = np.empty_like(u), u[0]
    for place, value in enumerate(u):
        now += min(max(value - now, -step), step)
        out[place] = now
    return out


def _inputs_of(plant: Plant) -> Iterator[Effect]:
    if not plant.drive:
        return
    top = plant.amplitude + abs(plant.bias)
    sensors = (*plant.sensors, *plant.shown)
    for name, named, sizes, acts in _INPUTS:
        terms = tuple(dict.fromkeys(one.format(u=plant.drive, x=sensor) for one in named for sensor in sensors))

        def true(u: Float, size: float, acts: Callable[[Float, float], Float] = acts) -> Float:
            return np.asarray(top * acts(u / top, size))

        yield Effect(plant.name, f"{name} ({plant.drive})", terms, sizes, acts=true)


def _held(x: Float, every: int) -> Float:
    return x[np.arange(len(x)) // every * every]


def _noisy(x: Float, _: float, sd: float) -> Float:
    return x + np.random.default_rng(len(x)).normal(0, sd, len(x))


def _spiked(x: Float, size: float) -> Float:
    random = np.random.default_rng(7)
    return x + size * random.choice([-1.0, 0.0, 1.0], len(x), p=[0.001, 0.998, 0.001])


# Name, right names, strengths, sensor values from the true ones (over their rms) and the strength.
_SENSORS: tuple[tuple[str, tuple[str, ...], tuple[float, ...], Callable[[Float, float], Float]], ...] = (
    ("delay", _LATE_NAMES, (0.5, 1.5, 4, 8, 16), lambda x, late: _late(x, 1.0, late)),
    ("lag", _LATE_NAMES, (0.5, 1.5, 4, 8, 16), _behind),
    ("offset", ("1", "has an offset"), (0.003, 0.01, 0.03, 0.1, 0.3), lambda x, part: x + part),
    ("cubic error", ("shows",), (0.003, 0.01, 0.03, 0.1, 0.2), lambda x, part: x * (1 + part * x**2)),
    ("play", ("backlash",), (0.001, 0.004, 0.015, 0.05, 0.15), lambda x, width: _play(x, 0.0, width)),
    ("clipping", (), (1.9, 1.6, 1.3, 1.1, 0.9), _clip),
    ("coarse steps", (), (0.003, 0.01, 0.03, 0.1, 0.3), lambda x, step: step * np.round(x / step)),
    ("noise", (), (0.001, 0.003, 0.01, 0.03, 0.1), lambda x, sd: _noisy(x, 0.0, sd)),
    ("spikes", (), (0.03, 0.1, 0.3, 1, 3), _spiked),
    ("held samples", _LATE_NAMES, (2, 3, 5, 8, 12), lambda x, every: _held(x, round(every))),
    (
        "drift of the offset",
        ("the offset of {x} changes",),
        (0.003, 0.01, 0.03, 0.1, 0.3),
        lambda x, part: x + part * np.linspace(0, 1, len(x)),
    ),
    (
        "mean of samples",
        _LATE_NAMES,
        (2, 4, 8, 16, 24),
        lambda x, n: np.convolve(
            np.concatenate([np.full(round(n) - 1, x[0]), x]), np.ones(round(n)) / round(n), "valid"
        ),
    ),
)


def _sensors_of(plant: Plant) -> Iterator[Effect]:
    clean = plant.measured(*plant.unspoilt, lambda s, t: NOTHING, lambda s, t: plant.values)
    for sensor, x in clean.items():
        size_of = float(np.std(x))

        for name, named, sizes, of in _SENSORS:
            terms = tuple(one.format(x=sensor) for one in named)

            def shown(
                x: Float, _: float, size: float, of: Callable[[Float, float], Float] = of, unit: float = size_of
            ) -> Float:
                return np.asarray(unit * of(x / unit, size))

            yield Effect(plant.name, f"{name} ({sensor})", terms, sizes, shows=shown, sensor=sensor)
        if plant.model().signal(sensor).unit == "rad":
            yield Effect(
                plant.name,
                f"eccentric encoder ({sensor})",
                ("eccentric",),
                (0.001, 0.003, 0.01, 0.03, 0.1),
                shows=lambda x, _, size: x + size * np.sin(x + 0.6),
                sensor=sensor,
            )


# A parameter that falls with a signal is a law of that signal, times that of the parameter.
_OF_FALL = (
    *("abs({x})*{x}", "{x}**3", "{x}**2*{x}.d()", "abs({x}.d())*{x}.d()", "{x}.d()**3"),
    *("abs({x})", "abs({x}.d())", "shows {x}*"),
)
_CHANGES = (0.01, 0.03, 0.1, 0.2, 0.4)


def _values_of(plant: Plant) -> Iterator[Effect]:
    span = SAMPLES / plant.rate
    for name, value in plant.truth.items():
        if not value or plant.model().unknowns[list(plant.truth).index(name)].positive is False:
            continue
        courses: tuple[tuple[str, Law], ...] = (
            ("warms up", lambda s, t: 1 - exp(-4 * t / span)),
            ("steps", lambda s, t: float(t > 0.6 * span)),
        )
        for word, course in courses:
            yield Effect(plant.name, f"{name} {word}", (f"{name} changes",), _CHANGES, value=name, course=course)
        for axis in plant.axes:

            def saturating(s: States, t: float, axis: Axis = axis, rms: float = float(plant.sizes[axis.x])) -> float:
                return -1 / (1 + (rms / s[axis.x]) ** 2) if s[axis.x] else 0.0

            laws = tuple(one.format(x=axis.sensor) for one in _OF_FALL)
            yield Effect(plant.name, f"{name} falls with {axis.sensor}", laws, _CHANGES, value=name, course=saturating)
    for name in plant.constants:
        yield Effect(
            plant.name,
            f"wrong constant {name}",
            ("sin(", ".d(2)", "larger than recorded", "smaller than recorded"),
            (0.01, 0.03, 0.1, 0.2, 0.4),
            value=name,
        )


@cache
def effects_of(plant: str) -> tuple[Effect, ...]:
    """All that it may have."""
    of = PLANTS[plant]
    laws = (one for axis in of.axes for one in _laws_of(of, axis))
    return (*laws, *_inputs_of(of), *_sensors_of(of), *_values_of(of))


@dataclass(frozen=True)
class Case:
    """A recording of the campaign: effects with strengths, none of a control."""

    number: int
    plant: str
    acting: tuple[tuple[Effect, float], ...]

    @property
    def words(self) -> str:
        """The effects."""
        return " + ".join(f"{effect.name} {size:.3g}" for effect, size in self.acting) or "none"


def campaign(count: int, seed: int) -> list[Case]:
    """A random sample of plants, effects and strengths: one in six is a pair of effects, one in six has none."""
    random = np.random.default_rng(seed)
    kinds = {name: sorted({one.name.partition(" (")[0] for one in effects_of(name)}) for name in PLANTS}

    def drawn(plant: str) -> tuple[Effect, float]:
        kind = random.choice(kinds[plant])
        own = [one for one in effects_of(plant) if one.name.partition(" (")[0] == kind]
        effect = own[random.integers(len(own))]
        return effect, float(random.choice(effect.sizes) * random.uniform(0.8, 1.25))

    cases = []
    for number in range(count):
        plant = str(random.choice(list(PLANTS)))
        many = random.choice([0, 1, 1, 1, 1, 2])
        acting = tuple(drawn(plant) for _ in range(many))
        if sum(one.memory is not None for one, _ in acting) > 1:
            acting = acting[:1]
        cases.append(Case(number, plant, acting))
    return cases


def recording(plant: Plant, seed: int, *acting: tuple[Effect, float]) -> dict[str, Float]:
    """Samples [SAMPLES] of a plant under effects, each of a strength.

    The columns are those of its model.
    """
    random = np.random.default_rng(seed)
    recorded = plant.driven(random)
    u = recorded
    for effect, size in acting:
        u = effect.acts(u, size) if effect.acts else u
    laws = [(effect.row, effect.law, size) for effect, size in acting if effect.law]
    values = [(effect.value, effect.course, size) for effect, size in acting if effect.value]
    memory = next((effect.memory for effect, _ in acting if effect.memory), None)

    def lacking(s: States, t: float) -> list[float]:
        more = list(NOTHING)
        for row, law, size in laws:
            more[row] += size * law(s, t)
        return more

    def moved(s: States, t: float) -> Values:
        now = plant.values
        for name, course, size in values:
            now[name] *= 1 + size * course(s, t)
        return now

    states = plant.motion(u, lacking if laws else None, moved if values else None, memory)
    out = {plant.drive: recorded} if plant.drive else {}
    for name, x in plant.measured(u, states, lacking, moved).items():
        for effect, size in acting:
            if effect.shows and effect.sensor in ("", name):
                x = effect.shows(x, plant.rate, size)
        step = plant.resolution(name)
        out[name] = np.round((x + random.normal(0, step / 2, SAMPLES)) / step) * step
    return out


@dataclass(frozen=True)
class Outcome:
    """What a recording gave.

    Attributes
    ----------
    off : errors [n_p]; 0 of a parameter that is not published
    with_terms : errors with the terms that were named; None: there are none, or the cause is unknown
    named : the terms
    """

    found: Identified
    off: Float
    with_terms: Float | None
    named: tuple[Term, ...]

    @property
    def wrong(self) -> bool:
        """Some parameter is off by more than 4 standard errors and 2 %."""
        return bool(np.any((self.off > WRONG_SE * self.found.se) & (self.off > WRONG * np.abs(self.found.p))))


def _truth_of(plant: Plant, acting: Sequence[tuple[Effect, float]]) -> tuple[Float, Float]:
    """Parameters, from and to [n_p].

    What an effect adds to them or changes of them counts as any value between.
    """
    low, high = dict(plant.truth), dict(plant.truth)
    for effect, size in acting:
        for name, least, most in effect.adds:
            low[name] += size * min(least, most)
            high[name] += size * max(least, most)
        if effect.value in plant.truth:
            ends = [plant.truth[effect.value] * (1 + part * size) for part in (-1.0, 1.0)]
            low[effect.value], high[effect.value] = min(ends), max(ends)
    return np.array(list(low.values())), np.array(list(high.values()))


def outcome(plant: Plant, seed: int, *acting: tuple[Effect, float]) -> Outcome:
    """Identifies a recording with the plant's own model, as a user would.

    Raises PvidError when the recording is refused.
    """
    model = plant.model()
    run = Recording(np.arange(SAMPLES) / plant.rate, recording(plant, seed, *acting), plant.rate)
    found = identified(run, model, refine=False).found
    low, high = _truth_of(plant, acting)
    published = np.array([one.status == "identified" for one in found.judged])
    if acting:  # an offset takes up what is constant of an effect
        published &= [one.positive for one in model.unknowns]
    named = found.named if found.named is not None and found.named.complete else None

    def off(p: Float) -> Float:
        return np.where(published, np.maximum(np.maximum(low - p, p - high), 0.0), 0.0)

    return Outcome(
        found,
        off(found.p),
        None if named is None else off(named.fit.p),
        () if named is None else terms_of(found.fit, named),
    )


def _is_named(term: Term, parts: Sequence[str]) -> bool:
    """Of a law with a width the part before it is the name."""
    if term.law is None:
        return any(part in term.text for part in parts if part != "1")
    return any(term.law == part or (part.endswith("+") and term.law.startswith(part)) for part in parts)


@dataclass(frozen=True)
class Row:
    """What the recordings of a plant with an effect gave; None: as it is."""

    plant: str
    effect: Effect | None
    done: tuple[Outcome, ...]

    @property
    def wrong(self) -> int:
        """Wrong answers without a warning."""
        return sum(one.wrong and one.found.verdict.status == "good" for one in self.done)

    @property
    def warnings(self) -> int:
        """Answers with one."""
        return sum(one.found.verdict.status != "good" for one in self.done)

    @property
    def right(self) -> list[bool]:
        """Whether the first named term is the effect."""
        parts = () if self.effect is None else self.effect.named
        return [bool(one.named) and _is_named(one.named[0], parts) for one in self.done]

    @property
    def named_wrongly(self) -> int:
        """Recordings whose first named term is another."""
        return sum(bool(one.named) and not ok for one, ok in zip(self.done, self.right, strict=True))

    def cells(self) -> tuple[str, ...]:
        """Of the table."""
        of_worst = [self._worst(one.off) for one in self.done]
        in_se = [float(np.max(one.off / np.maximum(one.found.se, 1e-300))) for one in self.done]
        alone = [np.sqrt(np.maximum(one.found.se**2 - one.found.by_model**2, 1e-300)) for one in self.done]
        before = [float(np.max(one.off / se)) for one, se in zip(self.done, alone, strict=True)]
        after = [self._worst(one.with_terms) for one in self.done if one.with_terms is not None]
        return (
            self.plant,
            "none" if self.effect is None else self.effect.name,
            str(len(self.done)),
            *(self._shown(values) for values in (of_worst, before, in_se)),
            *(str(count) for count in (self.wrong, self.warnings, sum(self.right), self.named_wrongly)),
            ", ".join(f"{one:.2g}" for one in after) or "-",
        )

    def _worst(self, off: Float) -> float:
        return 100 * float(np.max(off / np.abs(list(PLANTS[self.plant].truth.values()))))

    def _shown(self, values: list[float]) -> str:
        return f"{max(values):.2g}" if self.effect is None else ", ".join(f"{one:.2g}" for one in values)


def outcomes(clean: int) -> Iterator[Row]:
    """By plant and effect; every recording has a seed of its own.

    Parameters
    ----------
    clean : runs of each plant as it is
    """
    for name in OF_TABLE:
        plant = PLANTS[name]
        yield Row(name, None, tuple(outcome(plant, 1000 + seed) for seed in range(clean)))
        for number, effect in enumerate(one for one in EFFECTS if one.plant == name):
            sizes = enumerate(effect.sizes, 10 * number)
            yield Row(name, effect, tuple(outcome(plant, seed, (effect, size)) for seed, size in sizes))


def summary(rows: Sequence[Row]) -> tuple[tuple[str, int], ...]:
    """Counts over all rows, by name."""
    clean = [row for row in rows if row.effect is None]
    spoilt = [row for row in rows if row.effect is not None]
    every = [one for row in spoilt for one in row.done]
    visible = [bool(np.max(one.off / np.abs(one.found.p)) > WRONG) for one in every]
    right = [ok for row in spoilt for ok in row.right]
    covered = np.concatenate([one.off <= 2 * one.found.se for row in rows for one in row.done])
    without = sum(
        bool(np.any((one.off > WRONG_SE * se) & (one.off > WRONG * np.abs(one.found.p))))
        for one in every
        for se in [np.sqrt(np.maximum(one.found.se**2 - one.found.by_model**2, 0.0))]
    )
    silent, seen, named = (sum(row.wrong for row in spoilt), sum(visible), list(zip(right, visible, strict=True)))
    return (
        ("recordings with an effect", len(every)),
        ("wrong without a warning: more than 4 s.e. and 2 % off", silent),
        ("as far off without the model's part of the errors", without),
        ("with a parameter more than 2 % off", seen),
        ("of these the first named term is right", sum(ok and large for ok, large in named)),
        ("wrongly named, of all", sum(row.named_wrongly for row in spoilt)),
        ("recordings without an effect", sum(len(row.done) for row in clean)),
        ("of these with a warning", sum(row.warnings for row in clean)),
        ("parameters within two s.e., %", round(100 * float(np.mean(covered)))),
    )


CAMPAIGN = columns(
    "plant | recordings with effects | wrong without a warning | with a parameter more than 2 % off | of these "
    "have a name | named rightly | named wrongly | recordings without an effect | of these with a warning | "
    "covered by 2 s.e. %"
)


@dataclass(frozen=True)
class Told:
    """A case of the campaign and what `identify` made of it."""

    case: Case
    found: Outcome

    @property
    def silent(self) -> bool:
        """Wrong without a warning."""
        return self.found.wrong and self.found.found.verdict.status == "good"

    @property
    def visible(self) -> bool:
        """A parameter is more than 2 % off."""
        return bool(np.any(self.found.off > WRONG * np.abs(self.found.found.p)))

    @property
    def has_name(self) -> bool:
        """Some effect of it is one that a name exists for."""
        return any(effect.named for effect, _ in self.case.acting)

    @property
    def right(self) -> bool:
        """The first term that was named is one of its effects."""
        return bool(self.found.named) and self._is_effect(self.found.named[0])

    @property
    def named_wrongly(self) -> bool:
        """The first named term is none of its effects, nor is a term that explains the run equally well."""
        named = self.found.named
        return bool(named) and not self.right and not any(self._among(text) for text in named[0].instead)

    def _is_effect(self, term: Term) -> bool:
        return any(_is_named(term, effect.named) for effect, _ in self.case.acting)

    def _among(self, text: str) -> bool:
        names = ["a constant of" if name == "1" else name for effect, _ in self.case.acting for name in effect.named]
        return any(name in text for name in names)


def told(case: Case, seed: int) -> Told | None:
    """A case; None: its motion leaves all bounds, or the recording is refused."""
    try:
        return Told(case, outcome(PLANTS[case.plant], seed * 100_003 + case.number, *case.acting))
    except (PvidError, ArithmeticError, ValueError):
        return None


def campaign_cells(found: Sequence[Told]) -> list[tuple[str, ...]]:
    """A row for each plant, then all."""
    plants = sorted({one.case.plant for one in found}, key=list(PLANTS).index)
    return [_counts(name, [one for one in found if one.case.plant == name]) for name in plants] + [
        _counts("all", found)
    ]


def _counts(name: str, found: Sequence[Told]) -> tuple[str, ...]:
    spoilt = [one for one in found if one.case.acting]
    clean = [one for one in found if not one.case.acting]
    seen = [one for one in spoilt if one.visible]
    covered = np.concatenate([one.found.off <= 2 * one.found.found.se for one in found])
    counts = (
        len(spoilt),
        sum(one.silent for one in spoilt),
        len(seen),
        sum(one.has_name for one in seen),
        sum(one.right for one in seen),
        sum(one.named_wrongly for one in seen),
        len(clean),
        sum(one.found.found.verdict.status != "good" for one in clean),
    )
    return (name, *map(str, counts), f"{100 * float(np.mean(covered)):.0f}")


def report(clean: int, count: int, seed: int, advance: Advance) -> Report:
    """See bench.case: the table of effects, or a campaign of so many recordings."""
    if count:
        found = []
        for case in campaign(count, seed):
            found += [one for one in [told(case, seed)] if one is not None]
            advance()
        return Report([(f"missing-campaign-{seed}", CAMPAIGN, campaign_cells(found))])
    rows = []
    for row in outcomes(clean):
        rows.append(row)
        advance()
    return Report([("missing", HEADER, [row.cells() for row in rows]), counts("missing-sum", summary(rows))])
