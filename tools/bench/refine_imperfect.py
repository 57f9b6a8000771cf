"""The refinement in C on rigs that its equations do not describe: what it publishes, and whether it is honest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.campaign.motion import accelerations, integrate, relative_angle, step_of
from bench.campaign.pivot import PivotMotion
from bench.refine import engine_of, table_of
from bench.refine_cases import RATE_HZ, RELEASE, TRUTH
from pvid.core.native import Native
from pvid.models.kapitza.refinement import refine_rig, sample_sd
from pvid.sim.imperfections import eccentric, with_play
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_PENDULUM, STANDARD_RELEASE, standard_sensors, standard_start

Float = npt.NDArray[np.float64]

BITS = 14
HEADER = (
    "rad",
    "imperfection",
    "published",
    "of the time %",
    "error / s.e. at the end: RMS",
    "largest ever",
    "error at the end %: median",
    "largest ever",
    "clash",
    "confidently wrong",
)

_LSB = 2 * np.pi / 2**BITS
_SLIP = 1e-3  # rate below which the simulated friction is linear [rad/s]
_FAST_HZ = 3.0
_ECCENTRIC_AT = 0.7  # phase [rad]
_FAR, _MANY = 0.01, 5.0  # an estimate that is off by more than both, relative and in s.e., is confidently wrong


@dataclass(frozen=True)
class Fault:
    """A standard rig, full equations, with something that the refinement's equations do not contain.

    Attributes
    ----------
    angle : largest [rad], as in the first table
    dry : friction of pivot and joint over g l2, sharp
    backlash : of the encoder's gear [LSB]
    eccentricity : of its disc [rad]
    gain : relative error of y's scale, which is as large as the rig file expects
    wild : single samples of phi or y that are off, so many of 10^5, by so many LSB
    disturbed : outliers, missing and stuck samples of both sensors and jumps of the encoder's zero, a few a minute
    slant : of the pivot's slide [rad]
    options : of the refinement, whose equations then contain the friction or the slant
    """

    angle: float
    dry: float = 0.0
    backlash: float = 0.0
    eccentricity: float = 0.0
    gain: float = 0.0
    disturbed: bool = False
    wild: tuple[str, int, float] | None = None
    duration: float = 40.0
    slant: float = 0.0
    options: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What is added to the standard rig."""
        parts = (
            ("dry friction {:g} g l2", self.dry),
            ("slant {:g} rad", self.slant),
            ("backlash {:g} LSB", self.backlash),
            ("eccentric by {:g} rad", self.eccentricity),
            ("gain of y off by {:g}", self.gain),
        )
        said = [text.format(value) for text, value in parts if value]
        if self.wild:
            said.append("{1} of 10^5 samples of {0} off by {2:g} LSB".format(*self.wild))
        return ", ".join(said + ["disturbed"] * self.disturbed) or "none"


_KINDS: tuple[dict[str, Any], ...] = (
    {},
    *({"dry": dry} for dry in (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3)),
    *({"backlash": width} for width in (0.5, 2.0, 8.0)),
    *({"eccentricity": width} for width in (1e-4, 1e-3)),
    {"gain": 0.003},
    *({"wild": ("phi", *wild)} for wild in ((10, 50), (10, 5000), (100, 5), (100, 50), (100, 5000))),
    *({"wild": ("y", *wild)} for wild in ((10, 5000), (100, 50), (100, 5000))),
    {"disturbed": True, "duration": 120.0},
)
FAULTS = tuple(Fault(angle, **kind) for angle in (0.1, 0.3) for kind in _KINDS)


def _disturb(phi: Float, y: Float, random: np.random.Generator) -> None:
    """In place; the last fifth of the run is left alone."""
    ticks = len(phi)
    for kind, at in enumerate(random.integers(0, int(0.8 * ticks), max(8, ticks // 5000))):
        signal, some = (phi, slice(at, at + int(random.integers(1, 600))))
        match kind % 6:
            case 0:
                signal[random.integers(at, at + 5000, 12).clip(max=ticks - 1)] += 0.05
            case 1:
                signal[some] = np.nan
            case 2:
                signal[some] = signal[at]
            case 3:
                signal[at:] += 0.02
            case 4:
                y[some] = np.nan
            case _:
                y[at] += 1e-3


def _make_wild(phi: Float, y: Float, wild: tuple[str, int, float], random: np.random.Generator) -> None:
    """In place."""
    name, part, size = wild
    signal, lsb = (phi, _LSB) if name == "phi" else (y, standard_sensors(BITS).y_lsb)
    hit = random.random(len(signal)) < part / 1e5
    signal += hit * random.choice([-1.0, 1.0], len(signal)) * size * lsb


@lru_cache(2)
def truth_of(angle: float, dry: float, slant: float, duration: float) -> tuple[Float, Float]:
    """The exact angle and pivot."""
    motion = PivotMotion(np.array([[one.amplitude_m, one.frequency_hz, one.phase_rad] for one in STANDARD_DRIVE]))
    rig = STANDARD_PENDULUM
    friction = (dry * rig.g * rig.l2,) * 2
    steps, step_s = step_of(rig, _FAST_HZ, motion, friction, _SLIP, duration)
    start = [*(RELEASE[angle] * np.array(STANDARD_RELEASE)), 0.0, 0.0]
    drive = accelerations(motion, steps, step_s)
    state = integrate(Native(), rig, start, drive, step_s, dry=friction, slip=_SLIP, slant=slant)
    assert state is not None
    t = np.arange(round(duration * RATE_HZ)) / RATE_HZ
    return relative_angle(state, step_s, t), motion.position(t)


@dataclass(frozen=True)
class Published:
    """What a run published, one entry a publication; w, d1, d2.

    Attributes
    ----------
    error, se : relative [publications, 3]
    clash : of the last one
    available : part of the run's ticks at which a refined estimate stood
    first : time of the first one [s]; NaN: there is none
    extras : names of the refinement's options -> their last estimates
    """

    error: Float
    se: Float
    clash: float
    available: float
    first: float
    extras: Mapping[str, float]

    @property
    def confidently_wrong(self) -> bool:
        """Whether one of them was."""
        far = np.abs(self.error) > np.maximum(_FAR, _MANY * self.se)
        return bool(far.any())


def run_fault(fault: Fault, seed: int) -> Published:
    """One run through both stages."""
    exact, pivot = truth_of(fault.angle, fault.dry, fault.slant, fault.duration)
    if fault.eccentricity:
        exact = eccentric(exact, fault.eccentricity, _ECCENTRIC_AT)
    if fault.backlash:
        exact = with_play(exact, fault.backlash * _LSB)
    phi, y = standard_sensors(BITS).measure(exact, (1 + fault.gain) * pivot, seed)
    if fault.disturbed:
        _disturb(phi, y, np.random.default_rng([seed, 7]))
    if fault.wild:
        _make_wild(phi, y, fault.wild, np.random.default_rng([seed, 11]))
    engine, changes = engine_of(BITS, fault.options), {}
    if fault.gain:
        about = refine_rig(RATE_HZ, STANDARD_PENDULUM.l1, TRUTH, sample_sd(BITS), y_gain_sd=fault.gain)
        changes["gain_sd"] = np.asarray(about.gain_sd, np.float32)
    identifier = engine.identifier(standard_start(seed), **changes)
    found = identifier.run_both(np.stack([y, phi], axis=1))
    places = np.array(engine.equations.places_of_p[:3])
    names = [one.name for one in engine.equations.parameters]
    stands = found.r[:, places[0]] > 0
    new = np.flatnonzero(np.any(np.diff(found.r, axis=0, prepend=0.0) != 0, axis=1) & stands)
    last = dict(zip(names, map(float, found.r[new[-1]]), strict=True)) if len(new) else {}
    return Published(
        found.r[np.ix_(new, places)] / TRUTH - 1,
        found.se[np.ix_(new, places)] / TRUTH,
        float(identifier.refinement.estimate.clash),
        float(np.mean(stands)),
        float(new[0]) / RATE_HZ if len(new) else np.nan,
        {name: last[name] for name in ("f1", "f2", "slant") if name in last},
    )


def row_of(fault: Fault, runs: Sequence[Published]) -> tuple[str, ...]:
    """Cells as in HEADER."""
    done = [one for one in runs if len(one.error)]
    available = np.mean([one.available for one in runs])
    head = f"{fault.angle:g}", fault.label, f"{len(done)} of {len(runs)}", f"{100 * available:.0f}"
    if not done:
        return (*head, *("-",) * 5, "0")
    ends = np.array([one.error[-1] / one.se[-1] for one in done])
    return (
        *head,
        f"{np.sqrt(np.mean(ends**2)):.2f}",
        f"{max(np.abs(one.error / one.se).max() for one in done):.1f}",
        f"{100 * np.median([np.abs(one.error[-1]).max() for one in done]):.2g}",
        f"{100 * max(np.abs(one.error).max() for one in done):.2g}",
        f"{np.median([one.clash for one in done]):.2g}",
        str(sum(one.confidently_wrong for one in done)),
    )


def imperfect_table(
    seeds: int, progress: Callable[[], None], faults: Sequence[Fault] = FAULTS
) -> list[tuple[str, ...]]:
    """A row for each imperfection."""
    return table_of(faults, seeds, progress, run_fault, row_of)
