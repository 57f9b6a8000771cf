"""What equations may lack and what signals may do otherwise than recorded: a table of candidate terms.

A new candidate is one entry of one table. Each is one more column of the rows (`pvid.oracle.weak.library`), and is
scored by what it explains (`pvid.oracle.weak.scores`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from pvid.model.compiled import Signal
from pvid.oracle.weak.filters import polynomial_weights
from pvid.oracle.weak.front import filtered, in_segments
from pvid.oracle.weak.functions import Float
from pvid.sim.imperfections import with_play

_SMOOTHED = (21, 2)  # samples and degree, for the direction of a motion that has a play
_RATE_TAPS = (3, 5, 9, 17, 33)  # samples of a rate
_NOISE_ALONE = 1.5  # times their noise, by which two ways to take back a delay differ
_FORGOTTEN = 1e-18  # part of a sample behind a lag
_NEWTON, _STEEPEST = 12, 0.1  # steps; least slope of a sensor that is not linear
_TURNS = 2.0  # an angle that turns by less shows nothing that repeats with the turn [rad]


@dataclass(frozen=True)
class Law:
    """A law of one signal in an equation.

    Attributes
    ----------
    text : as typed in a model file; {x} is the signal, {w} a number [unit of its rate]
    of : values at the steps from the signal and its rate [n], and w; the law is their derivative of this order
    order : see `of`; the test functions take the derivative
    width : w over the root mean square of the rate; 0: the law has none
    part : w over the largest magnitude of the signal; 0: the law has none
    angle : of angles that turn alone
    signs : of signals that change their sign alone
    inertia : of signals that have a second derivative in the equations alone; else the rate is that of a time constant
    """

    text: str
    of: Callable[[Float, Float, float], Float]
    order: int = 0
    width: float = 0.0
    part: float = 0.0
    angle: bool = False
    signs: bool = False
    inertia: bool = False


def _sign(x: Float) -> Float:
    """sgn(x) [n]: around each sample the mean over straight lines to its neighbours, which change their signs between
    samples."""
    step = np.diff(x)
    flat = np.abs(step) < 1e-12 * np.max(np.abs(x), initial=1e-300)
    between = np.where(flat, np.sign(x[1:]), np.diff(np.abs(x)) / np.where(flat, 1.0, step))
    return np.asarray((np.append(between[:1], between) + np.append(between, between[-1:])) / 2)


def _stribeck(x: Float, v: Float, w: float) -> Float:
    return np.asarray(np.sign(v) / (1 + (v / w) ** 2))


_STRIBECK = "sgn({x}.d())/(1 + ({x}.d()/{w})**2)"

_STOP = "({x} + (abs({x} - {w}) - abs({x} + {w}))/2)"

CONSTANT = Law("1", lambda x, v, w: np.ones(x.shape))
COSINE = Law("cos({x})", lambda x, v, w: np.cos(x), angle=True)
LAWS = (
    Law("{x}", lambda x, v, w: x),
    Law("abs({x})*{x}", lambda x, v, w: np.abs(x) * x),
    Law("{x}**2", lambda x, v, w: x**2),
    Law("{x}**3", lambda x, v, w: x**3),
    Law("sgn({x})", lambda x, v, w: _sign(x)),
    Law("abs({x})", lambda x, v, w: np.abs(x), signs=True),
    Law("{x}**2*{x}.d()", lambda x, v, w: x**3 / 3, order=1),
    Law("{x}.d()", lambda x, v, w: x, order=1),
    Law("abs({x}.d())*{x}.d()", lambda x, v, w: np.abs(v) * v, inertia=True),
    Law("{x}.d()**3", lambda x, v, w: v**3, inertia=True),
    Law("sgn({x}.d())", lambda x, v, w: _sign(v), inertia=True),
    Law("abs({x}.d())", lambda x, v, w: np.abs(v), inertia=True),
    *(Law(_STRIBECK, _stribeck, width=width, inertia=True) for width in (0.03, 0.1, 0.3)),
    *(Law(_STOP, lambda x, v, w: x - np.clip(x, -w, w), part=part) for part in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)),
    Law("{x}.d(2)", lambda x, v, w: x, order=2, inertia=True),
    Law("sin({x})", lambda x, v, w: np.sin(x), angle=True),
    COSINE,
    Law("sin(2*{x})", lambda x, v, w: np.sin(2 * x), angle=True),
    Law("cos(2*{x})", lambda x, v, w: np.cos(2 * x), angle=True),
)


@dataclass(frozen=True)
class Recorded:
    """A signal as recorded: what an act starts from.

    Attributes
    ----------
    signal : as described
    values : samples [n]; NaN between segments
    rate : of the samples [Hz]
    window_s : of the design
    top : largest magnitude
    """

    signal: Signal
    values: Float
    rate: float
    window_s: float
    top: float

    def under(self, act: Act, level: float) -> Float:
        """What an act gives [n], in each segment by itself."""
        return in_segments(self.values, lambda x: act.of(replace(self, values=x), level))


# What the number of a sentence is measured in.
Measure = Literal["signal", "time", "part", "percent"]


@dataclass(frozen=True)
class Act:
    """What a signal really did in place of what was recorded.

    Attributes
    ----------
    text : in a sentence, after the signal's name; {size} is the number with its unit, {word} that of its sign, {u} the
        signal, {top} its largest magnitude
    of : true samples [n] at a level; without levels what is added to the recorded ones for size 1
    measure : of the level, or of the size
    words : of a size above and below 0
    levels : from what was recorded those that are tried; the size of each is 1. None: the size is free
    most : from what was recorded the largest believable size
    applies : to what was recorded
    exact : of a size that is not small: the same, as levels; `of` is its first order
    positive : a size below 0 means nothing
    typed : the true signal from the recorded one {u}, with the unknown {a}, as typed in a model; "": it cannot be
    """

    text: str
    of: Callable[[Recorded, float], Float]
    measure: Measure
    words: tuple[str, str] = ("", "")
    levels: Callable[[Recorded], tuple[float, ...]] | None = None
    most: Callable[[Recorded], float] = lambda _: np.inf
    applies: Callable[[Recorded], bool] = lambda _: True
    exact: Act | None = None
    positive: bool = False
    typed: str = ""

    def tried(self, recorded: Recorded) -> tuple[float, ...]:
        """Levels."""
        return (0.0,) if self.levels is None else self.levels(recorded)


def _lagged(of: Recorded, tau: float) -> Float:
    """Behind a first-order lag with this time constant [s]."""
    decay = float(np.exp(-1 / (tau * of.rate)))
    y = (1 - decay) * of.values
    y[:1] = of.values[:1]
    shift = 1
    while shift < len(y) and decay > _FORGOTTEN:  # y holds the last `shift` samples of the sum: each turn doubles them
        y[shift:] = y[shift:] + decay * y[:-shift]
        shift, decay = 2 * shift, decay**2
    return y


def _shifted(of: Recorded, delay: float) -> Float:
    """Without a delay of either sign [s]: on straight lines between samples, or by the nearest sample and its rate.

    The mean of two samples has half their noise, which would explain residuals that noise makes. So the second way is
    taken where both differ by noise alone.
    """
    place, samples = np.arange(len(of.values)), delay * of.rate
    lines = np.asarray(np.interp(place + samples, place, of.values))
    part = samples - round(samples)
    if not of.signal.sd or not part:
        return lines
    near = np.clip(place + round(samples), 0, len(place) - 1)
    shifted = np.asarray((of.values + part / of.rate * _best_rate(of))[near])
    noise = of.signal.sd * abs(part) * 2**0.5
    return lines if float(np.std(lines - shifted)) > _NOISE_ALONE * noise else shifted


def _early(of: Recorded, _: float) -> Float:
    """What is added to a signal that is recorded late by a second, to first order: 1 s of its rate."""
    return _rate(of, _RATE_TAPS[0])


def _ahead(of: Recorded, tau: float) -> Float:
    """Without a first-order lag of this time constant [s]."""
    return np.asarray(of.values + tau * _best_rate(of))


def _early_of_slow(of: Recorded, _: float) -> Float:
    """`_early` of a motion that is slow beside its noise."""
    return _rate(of, _SMOOTHED[0])


def _rate(of: Recorded, samples: int) -> Float:
    """From so many samples each; 0 within half of them of the ends."""
    half, out = samples // 2, np.zeros(len(of.values))
    if len(out) >= samples:
        out[half:-half] = filtered(of.values, polynomial_weights(samples, 2, 1))[half:-half] * of.rate
    return out


def _best_rate(of: Recorded) -> Float:
    """From as many samples as make noise and blur together least."""
    least = polynomial_weights(_RATE_TAPS[0], 2, 1)
    sharp = best = _rate(of, len(least))
    noise = (of.signal.sd * of.rate) ** 2
    error = noise * float(np.sum(least**2))
    for samples in _RATE_TAPS[1:]:
        if samples > len(sharp):
            break
        weights, half = polynomial_weights(samples, 2, 1), samples // 2
        apart, other = weights.copy(), _rate(of, samples)
        apart[half - 1 : half + 2] -= least
        blur = float(np.mean((other - sharp)[half:-half] ** 2)) - noise * float(np.sum(apart**2))
        own = noise * float(np.sum(weights**2)) + max(blur, 0.0)
        if own < error:
            best, error = other, own
    return best


def _dead(of: Recorded, level: float) -> Float:
    return np.asarray(np.sign(of.values) * np.maximum(np.abs(of.values) - level, 0))


def _play(of: Recorded, _: float) -> Float:
    """Less of the play of a sensor, for a width of one unit: half of it, by the direction of the motion."""
    weights = polynomial_weights(*_SMOOTHED, 0)
    smooth = filtered(of.values, weights) if len(of.values) >= len(weights) else of.values
    width = 3.0 * of.signal.resolution
    return np.asarray((smooth - with_play(smooth, width)) / width)


def _without_cubic(of: Recorded, level: float) -> Float:
    """True values, of which those recorded are x (1 - level (x/top)^2)."""
    relative = of.values / of.top
    x, edge = relative.copy(), 1 / np.sqrt(max(3 * level, 1e-300))  # beyond it no sensor shows more
    for _ in range(_NEWTON):
        cubic = level * x * x
        x = np.clip(x - (x - cubic * x - relative) / np.maximum(1 - 3 * cubic, _STEEPEST), -edge, edge)
    return np.asarray(of.top * x)


def _parts(*parts: float) -> Callable[[Recorded], tuple[float, ...]]:
    """Of the largest magnitude."""
    return lambda of: tuple(one * of.top for one in parts)


def _samples(*samples: float) -> Callable[[Recorded], tuple[float, ...]]:
    return lambda of: tuple(one / of.rate for one in samples if abs(one) < _quarter(of) * of.rate)


def _quarter(of: Recorded) -> float:
    """Of a window: the longest time that is believed [s]."""
    return 0.25 * of.window_s


def is_measured(of: Recorded) -> bool:
    """A sensor of what the mechanism does."""
    return of.signal.kind == "sensor" and not of.signal.driven


def _is_sensor(of: Recorded) -> bool:
    return of.signal.kind == "sensor"


def _is_input(of: Recorded) -> bool:
    return of.signal.kind == "input"


def _acts(of: Recorded) -> bool:
    """Whether it drives the mechanism: an input, or what is measured of one."""
    return of.signal.driven


def _is_stepped(of: Recorded) -> bool:
    return is_measured(of) and of.signal.resolution > 0


def _is_turning(of: Recorded) -> bool:
    return _is_stepped(of) and of.signal.unit == "rad" and float(np.nanmax(of.values) - np.nanmin(of.values)) > _TURNS


def _resolutions(of: Recorded) -> float:
    return 100 * of.signal.resolution


def _one_sided(of: Recorded, level: float) -> Float:
    """Up to a level, or down to one below 0."""
    return np.asarray(np.minimum(of.values, level) if level > 0 else np.maximum(of.values, level))


def _both(levels: Callable[[Recorded], tuple[float, ...]]) -> Callable[[Recorded], tuple[float, ...]]:
    """On either side of 0, where the signal has both signs."""

    def of_both(of: Recorded) -> tuple[float, ...]:
        low, high = float(np.nanmin(of.values)), float(np.nanmax(of.values))
        return tuple(sign * one for one in levels(of) for sign in (1, -1) if low < sign * one < high)

    return of_both


GAIN = Act(
    "is {size} {word} than recorded",
    lambda of, _: of.values,
    "percent",
    ("larger", "smaller"),
    most=lambda _: 0.2,
    applies=lambda of: of.signal.driven or of.signal.gain_sd > 0,
    typed="{u}*(1 + {a})",
)

OFFSET = Act(
    "has an offset of {word}{size}",
    lambda of, _: np.full(len(of.values), -1.0),
    "signal",
    ("", "-"),
    most=lambda of: of.top,
)

_DELAY = Act(
    "is {word} by {size}",
    _shifted,
    "time",
    ("delayed", "advanced"),
    levels=lambda _: (),
    applies=_is_sensor,
    typed="{u} + {a}*{u}.d()",
)
DELAY = replace(_DELAY, of=_early, levels=None, most=_quarter, exact=_DELAY)
_SLOW = replace(_DELAY, text="follows behind a lag of {size}", of=_ahead, applies=is_measured, positive=True)
_LAG = replace(_SLOW, of=_early, levels=None, most=_quarter, exact=_SLOW)
_LATE = Act(
    "acts {word} by {size}",
    _shifted,
    "time",
    ("early", "late"),
    levels=_samples(-1, -2, -4, -8, -16),
    applies=_is_input,
)
_SHOWS = Act(
    "shows {u}*(1 {word} {size}*({u}/{top})**2)",
    _without_cubic,
    "part",
    ("-", "+"),
    levels=lambda _: (),
    most=lambda _: 0.9,
    applies=is_measured,
    typed="{u} + {a}*{u}**3",
)
UNUSUAL, UNUSUAL_KINDS = ("advanced", "early"), (COSINE, _SLOW)

# Levels lie so close that the column of one fits its neighbours' with a size within 0.4 to 2.5.
ACTS = (
    Act(
        "saturates at {size}",
        lambda of, level: np.clip(of.values, -level, level),
        "signal",
        levels=_parts(0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.93),
        applies=_acts,
    ),
    Act(
        "saturates at {word}{size} on that side alone",
        _one_sided,
        "signal",
        ("", "-"),
        levels=_both(_parts(0.45, 0.6, 0.75, 0.9)),
        applies=_acts,
    ),
    Act(
        "has a dead band of {size}",
        _dead,
        "signal",
        levels=_parts(0.006, 0.012, 0.025, 0.05, 0.1, 0.2),
        applies=_acts,
    ),
    Act("acts behind a lag of {size}", _lagged, "time", levels=_samples(0.5, 1, 2, 4, 8, 16), applies=_acts),
    _LATE,
    *(replace(one, of=of) for of in (_early, _early_of_slow) for one in (DELAY, _LAG)),
    replace(_LATE, of=_early, levels=None, most=_quarter, exact=_LATE),
    Act(
        "acts as {u}*(1 {word} {size}*abs({u})/{top})",
        lambda of, _: of.values * np.abs(of.values) / of.top,
        "part",
        ("+", "-"),
        most=lambda _: 0.6,
        applies=_acts,
        typed="{u} + {a}*abs({u})*{u}",
    ),
    Act(
        "acts as {u}*(1 {word} {size}*({u}/{top})**2)",
        lambda of, _: of.values**3 / of.top**2,
        "part",
        ("+", "-"),
        most=lambda _: 0.6,
        applies=_acts,
        typed="{u} + {a}*{u}**3",
    ),
    Act(
        "acts with {size}*sgn({u}) {word} than recorded",
        lambda of, _: np.sign(of.values),
        "signal",
        ("more", "less"),
        most=lambda of: 0.4 * of.top,
        applies=_acts,
        typed="{u} + {a}*sgn({u})",
    ),
    Act(
        "is {size} {word} than recorded where it is negative",
        lambda of, _: np.minimum(of.values, 0),
        "percent",
        ("larger", "smaller"),
        most=lambda _: 0.6,
        applies=_acts,
        typed="{u} + {a}*({u} - abs({u}))/2",
    ),
    GAIN,
    OFFSET,
    Act("has a backlash of {size}", _play, "signal", most=_resolutions, applies=_is_stepped, positive=True),
    *(
        Act(
            "has an eccentric encoder of amplitude {size}",
            lambda of, _, turn=turn: np.sin(of.values + turn),  # type: ignore[misc]
            "signal",
            most=_resolutions,
            applies=_is_turning,
        )
        for turn in (0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4)
    ),
    replace(_SHOWS, of=lambda of, _: of.values**3 / of.top**2, levels=None, exact=_SHOWS),
)


@dataclass(frozen=True)
class Course:
    """What changes during a run.

    Attributes
    ----------
    text : in a sentence; {name} of a parameter, a signal or an equation, {size} the change with its unit
    measure : of the size
    """

    text: str
    measure: Literal["parameter", "signal", "percent", "equation"]


OF_PARAMETER = Course("{name} changes by {size}", "parameter")
OF_GAIN = Course("the gain of {name} changes by {size}", "percent")
OF_OFFSET = Course("the offset of {name} changes by {size}", "signal")
OF_LOAD = Course("the load of {name} changes by {size}", "equation")
# Gradually: steadily, or ever more slowly; of the part of the run that is over. Else at once, at these parts of it.
GRADUAL: tuple[Callable[[Float], Float], ...] = (
    lambda part: part,
    lambda part: np.asarray((1 - np.exp(-4 * part)) / (1 - np.exp(-4.0))),
)
JUMPS = tuple(0.05 * k for k in range(2, 19))


# What a sign that switches at once is in place of: tanh(v/level), of the argument's root mean square.
SOFT = Law("the friction is soft: sgn({x}) changes over a width of about {w}", lambda x, v, w: v)
SOFT_WIDTHS = (0.03, 0.055, 0.1, 0.18, 0.3, 0.55, 1.0)


# From theta of each row kind the change of the raw residuals of each kind [windows, K] for size 1.
Change = Callable[[Sequence[Float]], list[Float]]


@dataclass(frozen=True)
class Candidate:
    """A term, with its score.

    Attributes
    ----------
    where : name of the row of a law; otherwise of the signal
    signal : name of the signal; "" of a constant
    kind : the law, act or course
    level : of an act that has levels; of a law its width [unit of the rate]; of a course when it jumps [s], 0: it does
        not
    change : see Change; of a course as if it was there all the time
    top : of an act, largest magnitude of the signal as recorded; of a course, the change for size 1
    most : largest believable size
    weights : of a course, how far it is there in each window [windows]; None: all the time
    rows : of a law, names of the rows that contain it, and its sign in each
    size : estimate
    certainty : |size| over its standard error, from the scatter of the windows
    by_noise : the same over that of residuals that are as large as their weights say
    own : part of the column's square that no change of p explains
    share : part of the residuals' energy on unseen windows that the term removes
    folds : parts of the run in which it does
    shift : what p moves by when the term is added [n_p]
    """

    where: str
    signal: str
    kind: Law | Act | Course
    level: float
    change: Change
    top: float = 0.0
    most: float = np.inf
    weights: Float | None = None
    rows: tuple[tuple[str, float], ...] = ()
    size: float = 0.0
    certainty: float = 0.0
    by_noise: float = 0.0
    own: float = 0.0
    share: float = 0.0
    folds: int = 0
    shift: Float = field(default_factory=lambda: np.zeros(0))

    def changed(self, theta: Sequence[Float]) -> list[Float]:
        """The change of the raw residuals of each kind [windows, K] for size 1."""
        out = self.change(theta)
        return out if self.weights is None else [own * self.weights[:, np.newaxis] for own in out]

    @property
    def family(self) -> tuple[str, str, str]:
        """The same for all levels."""
        return self.where, self.signal, self.kind.text

    @property
    def number(self) -> float:
        """What is estimated: the level, or the size."""
        return self.level if self.leveled else self.size

    @property
    def leveled(self) -> bool:
        """Whether its level is what is estimated, and its size is 1."""
        return isinstance(self.kind, Act) and self.kind.levels is not None
