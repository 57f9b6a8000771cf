"""Which rigs a campaign draws: ranges of a TOML file, and rig i of seed s, which is always the same."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from bench.campaign.pivot import KINDS, PivotMotion, draw_motion
from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.rig.file import parsed_file
from pvid.sim.pendulum import Pendulum

# Ranges [low, high], and how a number is drawn: log-uniform or uniform; of either sign where "sign" stands beside it.
_RANGES: dict[str, tuple[str, ...]] = {
    "l1": ("log",),
    "l2_over_l1": ("log",),
    "rho2_over_l2": ("log",),
    "tilt": ("uniform",),
    "bits": ("integer",),
    "zero": ("uniform", "sign"),
    "y_lsb": ("log",),
    "duration": ("log",),
    "angle": ("log",),
    "drive_rms": ("log",),
    "guess": ("log",),
    "viscous": ("log",),
    "dry": ("log",),
    "skew": ("log", "sign"),
    "jitter": ("log",),
    "gain": ("log", "sign"),
    "backlash": ("log",),
    "hysteresis": ("log",),
    "eccentricity": ("log",),
    "slant": ("log", "sign"),
}
# Nothing without them; the others may be [0, 0].
_POSITIVE = ("l1", "l2_over_l1", "rho2_over_l2", "bits", "y_lsb", "duration", "angle", "drive_rms")
_NUMBERS = ("tilted", "phi_noise", "y_noise", "travel")
_LISTS = ("sample_rate", "drive")
_KEYS = (*_RANGES, *_NUMBERS, *_LISTS)
# Samples per period of the fast mode, at least: a user who records fewer sees it in the trace.
_SAMPLES_A_PERIOD = 20.0

_GRAVITY = 9.8


@dataclass(frozen=True)
class Condition:
    """What is special in some of the rigs: their share, the ranges they replace, or the conditions they combine."""

    share: int
    ranges: Mapping[str, Any] = field(default_factory=dict)
    of: tuple[str, ...] = ()
    count: tuple[int, int] = (1, 1)


@dataclass(frozen=True, eq=False)
class RandomRig:
    """One rig drawn from a population, before its release is scaled to the angle it is to have.

    Attributes
    ----------
    condition : its condition; `combined` the conditions it combines (itself alone but for a mixture)
    pendulum : with viscous damping
    dry : dry friction at pivot and joint [m^2/s^2]
    release : direction of the release, phi1 and phi1 + phi, length 1
    angle : largest angle wanted [rad], within `angle_range`
    guess_l2, guess_rho2 : of the rig file [m]
    attempt : those before it could not be driven, sampled or scaled
    eccentric_at : where on the turn the encoder's eccentricity stands [rad]

    The others are as in the population file, in its units; signed.
    """

    seed: int
    index: int
    attempt: int
    condition: str
    combined: tuple[str, ...]
    pendulum: Pendulum
    motion: PivotMotion
    drive: str
    sample_rate: float
    duration: float
    bits: int
    phi_noise: float
    zero: float
    y_lsb: float
    y_noise: float
    angle: float
    angle_range: tuple[float, float]
    release: tuple[float, float]
    guess_l2: float
    guess_rho2: float
    dry: tuple[float, float]
    skew: float
    jitter: float
    gain: float
    backlash: float
    hysteresis: float
    eccentricity: float
    eccentric_at: float
    slant: float

    @property
    def phi_lsb(self) -> float:
        """Resolution of the encoder [rad]."""
        return 2 * math.pi / float(2**self.bits)

    @property
    def modes_hz(self) -> tuple[float, float]:
        """Slow and fast mode [Hz]."""
        return modes_hz(self.pendulum)


def modes_hz(pendulum: Pendulum) -> tuple[float, float]:
    """Slow and fast mode of the pendulum without a drive [Hz]."""
    w, d1, d2 = pendulum.linear
    root = math.sqrt(d1 * d1 - 4 * d2)
    slow, fast = (math.sqrt(w * (d1 + sign * root) / 2) / (2 * math.pi) for sign in (-1, 1))
    return slow, fast


@dataclass(frozen=True)
class Population:
    """Ranges of all rigs and the conditions, with their shares."""

    base: Mapping[str, Any]
    conditions: Mapping[str, Condition]

    @property
    def hash(self) -> str:
        """Sixteen digits that change with any number of the population."""
        parts = {name: vars(condition) for name, condition in self.conditions.items()}
        text = json.dumps([self.base, parts], sort_keys=True, default=dict)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def condition_of(self, seed: int, index: int) -> str:
        """Condition of a rig: the shares are exact in every cycle of as many rigs as they add up to."""
        cycle = [name for name, condition in self.conditions.items() for _ in range(condition.share)]
        order = np.random.default_rng([seed, 0, index // len(cycle)]).permutation(len(cycle))
        return cycle[int(order[index % len(cycle)])]

    def draw(self, seed: int, index: int, attempt: int) -> RandomRig | None:
        """Rig `index` of a seed at its given attempt; None when no pivot or sample rate fits it."""
        name = self.condition_of(seed, index)
        random = np.random.default_rng([seed, 1, index, attempt])
        condition = self.conditions[name]
        combined: tuple[str, ...] = (name,)
        if condition.of:
            count = int(random.integers(condition.count[0], condition.count[1] + 1))
            combined = tuple(sorted(str(one) for one in random.choice(condition.of, count, replace=False)))
        ranges = dict(self.base)
        for one in combined:
            ranges.update(self.conditions[one].ranges)
        return _draw(ranges, name, combined, (seed, index, attempt), random)


def _draw(
    ranges: dict[str, Any],
    condition: str,
    combined: tuple[str, ...],
    place: tuple[int, int, int],
    random: np.random.Generator,
) -> RandomRig | None:
    def number(key: str) -> float:
        return _number(key, ranges[key], random)

    l1 = number("l1")
    l2 = l1 * number("l2_over_l1")
    rho2 = l2 * number("rho2_over_l2")
    tilt = number("tilt")
    g = _GRAVITY * (math.cos(tilt) if random.random() < ranges["tilted"] else 1.0)
    inertia = l2 * l2 + rho2 * rho2
    damping1 = 2 * number("viscous") * math.sqrt(g / l1) * l1 * l1
    damping2 = 2 * number("viscous") * math.sqrt(g * l2 * inertia)
    pendulum = Pendulum(l1=l1, l2=l2, rho2=rho2, g=g, damping1=damping1, damping2=damping2)
    modes = modes_hz(pendulum)
    fast_enough = [rate for rate in ranges["sample_rate"] if rate >= _SAMPLES_A_PERIOD * modes[1]]
    if not fast_enough:
        return None
    # of the rig, not of the attempt: else the drives that are refused more often would be rarer
    drive = str(np.random.default_rng([place[0], 3, place[1]]).choice(ranges["drive"]))
    rms, least = number("drive_rms") * g, ranges["drive_rms"][0] * g
    motion = draw_motion(drive, modes, random, ranges["travel"], rms, least)
    if motion is None:
        return None
    turn = random.uniform(0, 2 * math.pi)

    def wrong(value: float) -> float:
        return float(value * number("guess") ** random.choice([-1, 1]))

    return RandomRig(
        seed=place[0],
        index=place[1],
        attempt=place[2],
        condition=condition,
        combined=combined,
        pendulum=pendulum,
        motion=motion,
        drive=drive,
        sample_rate=float(random.choice(fast_enough)),
        duration=number("duration"),
        bits=int(number("bits")),
        phi_noise=ranges["phi_noise"],
        zero=number("zero"),
        y_lsb=number("y_lsb"),
        y_noise=ranges["y_noise"],
        angle=number("angle"),
        angle_range=tuple(ranges["angle"]),
        release=(math.cos(turn), math.sin(turn)),
        guess_l2=wrong(l2),
        guess_rho2=wrong(rho2),
        dry=(number("dry") * g * l2, number("dry") * g * l2),
        skew=number("skew"),
        jitter=number("jitter"),
        gain=number("gain"),
        backlash=number("backlash"),
        hysteresis=number("hysteresis"),
        eccentricity=number("eccentricity"),
        eccentric_at=random.uniform(0, 2 * math.pi),
        slant=number("slant"),
    )


def _number(key: str, bounds: list[float], random: np.random.Generator) -> float:
    """A number from a range; the random stream moves on alike whatever the range."""
    low, high = bounds
    share = random.random()
    sign = random.choice([-1.0, 1.0])
    kind = _RANGES[key]
    if "integer" in kind:
        return float(low + math.floor(share * (high - low + 1)))
    if "log" in kind and low > 0:
        value = float(np.clip(math.exp(math.log(low) + share * math.log(high / low)), low, high))
    else:
        value = low + share * (high - low)
    return value * float(sign) if "sign" in kind else value


# ---- the file


def shipped() -> Population:
    """The population that comes with pvid: ranges and conditions of population.toml."""
    return parse(resources.files("bench.campaign").joinpath("population.toml").read_text(encoding="utf-8"))


def load(path: str | Path) -> Population:
    """Reads a population; PvidError names the file and the key."""
    return parsed_file(path, parse)


def parse(text: str) -> Population:
    """From TOML text: tables [base] and [conditions.NAME]. Base keys that are missing are those of `shipped`."""
    document = toml_document(text)
    for key in document:
        if key not in ("base", "conditions"):
            raise PvidError(f"{key!a} is not a key of a population; known keys: [base] and [conditions.NAME]")
    tables = document.get("conditions", {})
    if not isinstance(tables, dict) or not tables:
        raise PvidError("[conditions.NAME] is missing: a population needs at least one condition, with its share")
    base = _ranges(document.get("base", {}), "[base]")
    if len(base) < len(_KEYS):
        base = {**shipped().base, **base}
    conditions = {name: _condition(name, table) for name, table in tables.items()}
    for name, condition in conditions.items():
        for one in condition.of:
            if one not in conditions or conditions[one].of:
                raise PvidError(f"[conditions.{name}] of: {one!a} is not the name of a condition without `of`")
    if sum(condition.share for condition in conditions.values()) == 0:
        raise PvidError("[conditions.NAME] share: at least one condition must have a share above 0")
    return Population(base=base, conditions=conditions)


def _condition(name: str, table: Any) -> Condition:
    place = f"[conditions.{name}]"
    if not isinstance(table, dict):
        raise PvidError(f"{place} must be a table")
    table = dict(table)
    share, of, count = table.pop("share", 1), table.pop("of", []), table.pop("count", [1, 1])
    if type(share) is not int or share < 0:
        raise PvidError(f"{place} share must be a whole number from 0, not {share!a}")
    if not (isinstance(of, list) and all(isinstance(one, str) for one in of)):
        raise PvidError(f"{place} of must be a list of names of conditions")
    if of and not (
        isinstance(count, list)
        and len(count) == 2
        and all(type(one) is int for one in count)
        and 1 <= count[0] <= count[1] <= len(of)
    ):
        raise PvidError(f"{place} count must be [low, high], from 1 to {len(of)}, the number of conditions in `of`")
    return Condition(share, _ranges(table, place), tuple(of), (count[0], count[1]))


def _ranges(table: Any, place: str) -> dict[str, Any]:
    if not isinstance(table, dict):
        raise PvidError(f"{place} must be a table")
    for key, value in table.items():
        if key not in _KEYS:
            raise PvidError(f"{place} {key!a} is not a key of a population; known keys: {', '.join(_KEYS)}")
        if key in _RANGES:
            _check_range(key, value, place)
        elif key in _NUMBERS and not (_is_number(value) and value >= 0):
            raise PvidError(f"{place} {key} must be a number from 0, not {value!a}")
        elif key == "sample_rate" and not (
            isinstance(value, list) and value and all(_is_number(rate) and rate > 0 for rate in value)
        ):
            raise PvidError(f"{place} sample_rate must be a list of positive numbers [Hz]")
        elif key == "drive" and not (isinstance(value, list) and value and all(kind in KINDS for kind in value)):
            raise PvidError(f"{place} drive must be a list of some of {', '.join(KINDS)}")
    return dict(table)


def _check_range(key: str, value: Any, place: str) -> None:
    if not (isinstance(value, list) and len(value) == 2 and all(_is_number(bound) for bound in value)):
        raise PvidError(f"{place} {key} must be a range [low, high], not {value!a}")
    low, high = value
    if key == "guess" and low < 1:
        raise PvidError(f"{place} guess must be a range of factors from 1 on, not {value!a}")
    if key in _POSITIVE and not low > 0:
        raise PvidError(f"{place} {key} must be a range [low, high] above 0, not {value!a}")
    if not 0 <= low <= high or (low == 0 < high and "log" in _RANGES[key]):
        above = "above 0 (or [0, 0] for none)" if "log" in _RANGES[key] else "from 0 on"
        raise PvidError(f"{place} {key} must be a range [low, high] {above}, low <= high, not {value!a}")


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and math.isfinite(value)
