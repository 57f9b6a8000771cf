"""Models that lack something: recordings of plants with one more effect, and what `identify` makes of them.

The plants are integrated here (Runge-Kutta, the input held over a sample), not by pvid. Each effect comes in three
strengths; the model is that of the plant without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.model import Model, sin
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.identify import Identified, identify
from pvid.oracle.weak.naming import Term, terms_of

Float = npt.NDArray[np.float64]
Law = Callable[[Float], float]  # of the states

HEADER = (
    "plant",
    "effect",
    "runs",
    "error %",
    "in s.e. without the model's part",
    "in s.e.",
    "wrong without a warning",
    "warnings",
    "named rightly",
    "named wrongly",
    "error with the named terms %",
)

SAMPLES, SUBSTEPS = 4000, 6
WRONG_SE, WRONG = 4.0, 0.02  # an answer is wrong beyond so many standard errors and this part of the value


@dataclass(frozen=True)
class Plant:
    """A mechanism whose model is right but for one effect.

    Attributes
    ----------
    model : to identify
    truth : of its unknowns, in order
    rate : of the samples [Hz]
    amplitude : of the drive
    slope : rates of the states [n] at states and input, with one more force (or voltage) on the left side of the
        equation that `places` gives for an effect
    states : how many
    sensors : name -> state and resolution
    scale : rates of the drive's sines and steps over those of the cart
    """

    name: str
    model: Callable[[], CompiledModel]
    truth: Mapping[str, float]
    rate: float
    amplitude: float
    slope: Callable[[Float, float, Float], Float]
    states: int
    sensors: Mapping[str, tuple[int, float]]
    scale: float = 1.0

    @property
    def drive(self) -> str:
        """The input's name."""
        return next(one.name for one in self.model().signals if one.kind == "input")


@dataclass(frozen=True)
class Effect:
    """What a plant has and its model lacks.

    Attributes
    ----------
    named : laws, or parts of the clauses on a signal, that name it rightly
    sizes : three strengths
    law : of the states, what the left side of equation `row` has more for size 1
    acts : true input from the recorded one and the strength
    shows : recorded sensor values from true ones, the rate and the strength
    """

    plant: str
    name: str
    named: tuple[str, ...]
    sizes: tuple[float, ...]
    law: Law | None = None
    row: int = 0
    acts: Callable[[Float, float], Float] | None = None
    shows: Callable[[Float, float, float], Float] | None = None


def _cart_model() -> CompiledModel:
    model = Model("cart")
    F, x = model.input("F", "N", hold="zoh", reach=12, gain_sd=0), model.sensor("x", "m", resolution=1e-5, reach=0.5)
    m, c, k = model.unknown("m", "kg", 1), model.unknown("c", "N*s/m", 1), model.unknown("k", "N/m", 60)
    x0 = model.unknown("x0", "m", 0, positive=False, sd=0.05)
    model.equation(m * x.d(2) + c * x.d() + k * (x - x0) - F)
    return model.compiled("cart")


def _cart(s: Float, F: float, more: Float) -> Float:
    return np.array([s[1], (F - 1.7 * s[1] - 82.0 * (s[0] - 0.004) - more[0]) / 1.3])


def _motor_model() -> CompiledModel:
    model = Model("motor")
    V = model.input("V", "V", hold="zoh", reach=15, gain_sd=0)
    i = model.sensor("i", "A", resolution=2e-3, reach=15)
    w = model.sensor("w", "rad/s", resolution=0.02, reach=500)
    R, L, k = model.unknown("R", "ohm", 1), model.unknown("L", "H", 5e-3), model.unknown("k", "N*m/A", 0.03)
    J, b = model.unknown("J", "kg*m^2", 2e-4), model.unknown("b", "N*m*s/rad", 2e-4)
    model.equation(L * i.d() + R * i + k * w - V)
    model.equation(J * w.d() + b * w - k * i)
    return model.compiled("motor")


def _motor(s: Float, V: float, more: Float) -> Float:
    i = (V - 1.45 * s[0] - 0.043 * s[1] - more[0]) / 8e-3
    return np.array([i, (0.043 * s[0] - 4e-4 * s[1] - more[1]) / 2.6e-4])


def _pendulum_model() -> CompiledModel:
    model = Model("pendulum")
    M = model.input("M", "N*m", hold="zoh", reach=3, gain_sd=0)
    q = model.sensor("q", "rad", resolution=2e-4, reach=3)
    J, b, G = model.unknown("J", "kg*m^2", 0.05), model.unknown("b", "N*m*s", 0.02), model.unknown("G", "N*m", 1)
    model.equation(J * q.d(2) + b * q.d() + G * sin(q) - M)
    return model.compiled("pendulum")


def _pendulum(s: Float, M: float, more: Float) -> Float:
    return np.array([s[1], (M - 0.05 * s[1] - 1.9 * np.sin(s[0]) - more[0]) / 0.06])


def _lag_model() -> CompiledModel:
    model = Model("lag")
    u = model.input("u", "V", hold="zoh", reach=4, gain_sd=0)
    y = model.sensor("y", "V", resolution=1e-3, noise=1e-3, reach=6)
    T, K = model.unknown("T", "s", 0.2), model.unknown("K", "", 1)
    o = model.unknown("o", "V", 0, positive=False, sd=0.5)
    model.equation(T * y.d() + y - K * u - o)
    return model.compiled("lag")


def _lag(s: Float, u: float, more: Float) -> Float:
    return np.array([(2.0 * u + 0.1 - s[0] - more[0]) / 0.35])


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
        ),
        Plant(
            "motor",
            _motor_model,
            {"R": 1.45, "L": 8e-3, "k": 0.043, "J": 2.6e-4, "b": 4e-4},
            500.0,
            12.0,
            _motor,
            2,
            {"i": (0, 2e-3), "w": (1, 0.02)},
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
        ),
        Plant("lag", _lag_model, {"T": 0.35, "K": 2.0, "o": 0.1}, 200.0, 3.0, _lag, 1, {"y": (0, 1e-3)}, 0.4),
    )
}


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
    Effect("cart", "drag", ("abs(x.d())*x.d()",), (0.2, 0.8, 3.0), lambda s: abs(s[1]) * s[1]),
    Effect("cart", "cubic spring", ("x**3",), (250, 1000, 4000), lambda s: s[0] ** 3),
    Effect("cart", "dry friction", ("sgn(x.d())",), (0.03, 0.15, 0.5), lambda s: float(np.tanh(s[1] / 1e-3))),
    Effect("cart", "saturation [N]", ("saturates",), (5.5, 4.0, 2.8), acts=_clip),
    Effect("cart", "dead band [N]", ("dead band", "sgn(F)"), (0.1, 0.4, 1.2), acts=_dead),
    Effect("cart", "sag with load", ("abs(F)/", "(F/"), (0.005, 0.012, 0.03), acts=_sag),
    Effect("cart", "lag of the force [samples]", ("lag", "late", "delayed"), (3, 8, 20), acts=_behind),
    Effect("cart", "delay of the sensor [s]", ("delayed", "late"), (0.003, 0.008, 0.02), shows=_late),
    Effect("motor", "brush drop [V]", ("sgn(i)",), (0.1, 0.3, 0.9), lambda s: float(np.tanh(s[0] / 2e-3))),
    Effect("motor", "fan torque", ("abs(w)*w",), (5e-7, 2e-6, 8e-6), lambda s: abs(s[1]) * s[1], row=1),
    Effect("motor", "dry friction", ("sgn(w)",), (0.003, 0.01, 0.03), lambda s: float(np.tanh(s[1] / 0.05)), row=1),
    Effect("motor", "load torque", ("1",), (0.005, 0.02, 0.05), lambda s: 1.0, row=1),
    Effect("motor", "saturation [V]", ("saturates",), (8.0, 6.0, 4.5), acts=_clip),
    Effect("motor", "dead band [V]", ("dead band", "sgn(V)"), (0.15, 0.5, 1.5), acts=_dead),
    Effect("motor", "sag with load", ("abs(V)/", "(V/"), (0.003, 0.01, 0.02), acts=_sag),
    Effect("motor", "delay of the sensors [s]", ("delayed", "late"), (0.0008, 0.002, 0.004), shows=_late),
    Effect("pendulum", "drag", ("abs(q.d())*q.d()",), (0.002, 0.01, 0.04), lambda s: abs(s[1]) * s[1]),
    Effect("pendulum", "dry friction", ("sgn(q.d())",), (0.01, 0.04, 0.12), lambda s: float(np.tanh(s[1] / 5e-3))),
    Effect("pendulum", "spring", ("q",), (0.05, 0.2, 0.8), lambda s: s[0]),
    Effect("pendulum", "saturation [N m]", ("saturates",), (1.1, 0.85, 0.6), acts=_clip),
    Effect("pendulum", "dead band [N m]", ("dead band", "sgn(M)"), (0.02, 0.08, 0.2), acts=_dead),
    Effect("pendulum", "delay of the sensor [s]", ("delayed", "late", "lag"), (0.004, 0.012, 0.03), shows=_late),
    Effect("pendulum", "backlash [rad]", ("backlash",), (0.01, 0.03, 0.08), shows=_play),
    Effect("lag", "cubic", ("y**3",), (0.003, 0.01, 0.03), lambda s: s[0] ** 3),
    Effect("lag", "square", ("abs(y)*y",), (0.01, 0.03, 0.1), lambda s: abs(s[0]) * s[0]),
    Effect("lag", "saturation [V]", ("saturates",), (2.0, 1.6, 1.1), acts=_clip),
    Effect("lag", "dead band [V]", ("dead band", "sgn(u)"), (0.04, 0.12, 0.4), acts=_dead),
    Effect("lag", "sag with load", ("abs(u)/", "(u/"), (0.01, 0.03, 0.1), acts=_sag),
    Effect("lag", "lag of the input [samples]", ("lag", "late", "delayed", "y.d(2)"), (2, 6, 15), acts=_behind),
    Effect("lag", "delay of the sensor [s]", ("delayed", "late", "y.d(2)"), (0.005, 0.015, 0.04), shows=_late),
)


def recording(plant: Plant, seed: int, effect: Effect | None = None, size: float = 0.0) -> dict[str, Float]:
    """Samples [SAMPLES] of a plant from rest under two sines and random steps."""
    random = np.random.default_rng(seed)
    t = np.arange(SAMPLES) / plant.rate
    hold = round(0.3 / plant.scale * plant.rate)
    steps = random.uniform(-1, 1, SAMPLES // hold + 1).repeat(hold)[:SAMPLES]
    phase = random.uniform(0, 2 * np.pi, 2)
    slow, fast = (np.sin(w * plant.scale * t + p) for w, p in zip((5.6, 14.5), phase, strict=True))
    recorded = plant.amplitude * (0.35 * slow + 0.25 * fast + 0.4 * steps)
    u = effect.acts(recorded, size) if effect and effect.acts else recorded
    more = np.zeros(2)
    h, s, states = 1 / plant.rate / SUBSTEPS, np.zeros(plant.states), np.empty((SAMPLES, plant.states))

    def slope(at: Float, held: float) -> Float:
        if effect and effect.law:
            more[effect.row] = size * effect.law(at)
        return plant.slope(at, held, more)

    for place, held in enumerate(u):
        states[place] = s
        for _ in range(SUBSTEPS):
            a = slope(s, held)
            b = slope(s + h / 2 * a, held)
            c = slope(s + h / 2 * b, held)
            s = s + h / 6 * (a + 2 * b + 2 * c + slope(s + h * c, held))
    out = {plant.drive: recorded}
    for name, (state, step) in plant.sensors.items():
        x = states[:, state]
        x = effect.shows(x, plant.rate, size) if effect and effect.shows else x
        out[name] = np.round((x + random.normal(0, step / 2, SAMPLES)) / step) * step
    return out


@dataclass(frozen=True)
class Outcome:
    """What a recording gave.

    Attributes
    ----------
    off : errors [n_p]
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


def outcome(plant: Plant, seed: int, effect: Effect | None = None, size: float = 0.0) -> Outcome:
    """Identifies a recording with the plant's own model."""
    found = identify(plant.model(), recording(plant, seed, effect, size), plant.rate)
    truth = np.array([plant.truth[name] for name in found.names])
    named = found.named if found.named is not None and found.named.complete else None
    return Outcome(
        found,
        np.abs(found.p - truth),
        None if named is None else np.abs(named.fit.p - truth),
        () if named is None else terms_of(found.fit, named),
    )


def _is_named(term: Term, parts: Sequence[str]) -> bool:
    return any(part in term.text for part in parts) if term.law is None else term.law in parts


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
    for name, plant in PLANTS.items():
        yield Row(name, None, tuple(outcome(plant, 1000 + seed) for seed in range(clean)))
        for number, effect in enumerate(one for one in EFFECTS if one.plant == name):
            sizes = enumerate(effect.sizes, 10 * number)
            yield Row(name, effect, tuple(outcome(plant, seed, effect, size) for seed, size in sizes))


def summary(rows: Sequence[Row]) -> str:
    """In sentences."""
    clean = [row for row in rows if row.effect is None]
    spoilt = [row for row in rows if row.effect is not None]
    every = [one for row in spoilt for one in row.done]
    visible = [np.max(one.off / np.abs(one.found.p)) > WRONG for one in every]
    right = [ok for row in spoilt for ok in row.right]
    covered = np.concatenate([one.off <= 2 * one.found.se for row in rows for one in row.done])
    without = sum(
        bool(np.any((one.off > WRONG_SE * se) & (one.off > WRONG * np.abs(one.found.p))))
        for one in every
        for se in [np.sqrt(np.maximum(one.found.se**2 - one.found.by_model**2, 0.0))]
    )
    silent, seen, named = sum(row.wrong for row in spoilt), sum(visible), list(zip(right, visible, strict=True))
    return (
        f"Of {len(every)} recordings with an effect {silent} are wrong without a warning: some parameter off by more "
        f"than 4 of its standard errors and 2 %. Without the model's part of the errors {without} would be that far "
        f"off. Of {seen} with a parameter more than 2 % off the first named term is right in "
        f"{sum(ok and large for ok, large in named)}; wrongly named are {sum(row.named_wrongly for row in spoilt)} of "
        f"all. Of {sum(len(row.done) for row in clean)} recordings without an effect "
        f"{sum(row.warnings for row in clean)} have a warning. Two standard errors cover "
        f"{100 * float(np.mean(covered)):.0f} % of all parameters."
    )
