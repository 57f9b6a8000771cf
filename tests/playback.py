"""All that one build of the core shows of a few seconds of data, under every setting, as one number a variant; and what
its inits answer to every edge of every setting, as one number.

tools/mutate.py plays it before the CMocka programs: a change of the core shows, or not. The bits of the core as it is
are compared with the numpy twin under these settings by test_bits, test_weak_bits, test_gate, test_freeze and their
fixed-point counterparts; the answers are those of test_bad_config. tools/coverage.py counts the branches of both.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import configurations
import numpy as np
import numpy.typing as npt
from linear_rig import LINEAR_RIG

from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.enums import Law
from pvid.settings.f32 import StrongConfig, TrustConfig, WeakConfig
from pvid.settings.q31 import StrongConfigQ31, TrustConfigQ31, WeakConfigQ31
from pvid.setup.f32 import strong_config, weak_config
from pvid.setup.q31 import counts_of, scale_of, strong_config_q31, weak_config_q31
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors

Config = WeakConfig | StrongConfig | WeakConfigQ31 | StrongConfigQ31
Samples = tuple[npt.NDArray[Any], npt.NDArray[Any]]

UNIT = Path(__file__).resolve().parent / "unit"
RATE = 1000.0
RIG = LINEAR_RIG
FINE = replace(RIG, sensor=replace(RIG.sensor, phi_lsb=standard_sensors(20).phi_lsb))
WEAK_TICKS = 22_000
STRONG_TICKS = 2600
PIECE = 650  # ticks between two looks at everything


@dataclass(frozen=True)
class Variant:
    """An identifier under some settings, and its samples."""

    name: str
    config: Config
    samples: Samples


def with_settings(rig: RigFile = RIG, **settings: Any) -> RigFile:
    """A rig with other settings of its identifier."""
    return replace(rig, identifier=replace(rig.identifier, **settings))


# ---- samples ----


@cache
def clean(bits: int, truth: str, ticks: int) -> Samples:
    """The standard rig; with friction where its truth is the full one."""
    damped = replace(STANDARD_PENDULUM, damping1=1e-4, damping2=1e-4)
    pendulum = damped if truth == "full" else STANDARD_PENDULUM
    sensors = standard_sensors(bits)
    run = simulate(pendulum, sensors=sensors, truth=truth, duration=ticks / RATE, seed=1).run  # type: ignore[arg-type]
    return run.phi, run.y


def weak_samples(truth: str = "linear") -> Samples:
    """A run, then a jolt, an encoder that sticks, samples that nobody should send, a pivot that stands."""
    phi, y = (x.copy() for x in clean(14, truth, WEAK_TICKS))
    phi[9000:9600] += 0.02 * np.sin(np.pi * np.arange(600) / 600) ** 2
    phi[12_800:13_100] = phi[12_800]
    phi[16_000], y[16_001], phi[16_002], y[16_003] = np.nan, np.inf, 3e30, -1e9
    y[18_000:] = y[18_000]
    return phi, y


def hostile_samples() -> Samples:
    """Angles that overflow what is made of them, a pivot that leaps, zeros."""
    phi, y = (x.copy() for x in clean(14, "linear", WEAK_TICKS))
    random = np.random.default_rng(7)
    phi[5500:5600] = 1e30 * random.standard_normal(100)
    y[8500:8510] = 3e38
    phi[12_000:] = 0.0
    y[16_500:] = 0.0
    return phi, y


def strong_samples() -> Samples:
    """A run with an outlier, samples that nobody should send, absurd ones, a pivot that stands."""
    phi, y = (x.copy() for x in clean(20, "linear", STRONG_TICKS))
    phi[900] += 0.01
    phi[1300], y[1301], phi[1302] = np.nan, -np.inf, 3e37
    phi[1800:1850] *= 1e12
    y[2100:] = 0.0
    return phi, y


def counted(rig: RigFile, samples: Samples) -> Samples:
    """The same as counts, within full scale but for what was no number or absurd."""
    limited = [np.where(np.abs(x) < 100.0, np.clip(x, -0.45, 0.45), x) for x in samples]
    times = np.arange(len(limited[0])) / RATE
    return counts_of(rig, Run(t=times, phi=limited[0], y=limited[1], sample_rate=RATE))


def full_scale_counts(config: WeakConfigQ31) -> Samples:
    """Square waves as far as the sensors reach."""
    t = np.arange(WEAK_TICKS)
    phi = config.design.phi_max * np.where(t // 125 % 2, 1, -1)
    y = np.rint(0.3 * config.design.y_max * np.sin(0.05 * t)).astype(np.int64)
    return phi, np.where(t < 9000, y, config.design.y_max * np.where(t // 70 % 2, 1, -1))


# ---- settings ----


def weak_variants() -> list[Variant]:
    """Of both cores."""
    found: list[Variant] = []

    def add(
        name: str,
        samples: Samples,
        rig: RigFile = RIG,
        estimator: dict[str, Any] | None = None,
        estimator_q31: dict[str, Any] | None = None,
        others: dict[str, Any] | None = None,
        others_q31: dict[str, Any] | None = None,
    ) -> None:
        one, other = weak_config(rig, RATE), weak_config_q31(rig, RATE)
        one = replace(one, estimator=replace(one.estimator, **(estimator or {})), **(others or {}))
        other = replace(other, estimator=replace(other.estimator, **(estimator_q31 or {})), **(others_q31 or {}))
        found.append(Variant(f"weak, {name}", one, samples))
        found.append(Variant(f"weak q31, {name}", other, counted(rig, samples)))

    samples = weak_samples()
    add("as it comes", samples)
    sizes: dict[str, dict[str, Any]] = {
        "forgetting": {"forgetting_s": 5.0},
        "zeroed": {"zero": False},
        "two ticks a sample": {"decimation": 2, "window_s": 0.4, "test_functions": 4, "smoothing_s": 0.031},
        "a tick a sample": {"decimation": 1, "window_s": 0.25, "test_functions": 4, "smoothing_s": 0.031},
        "sixteen functions": {"decimation": 5, "window_s": 0.75, "test_functions": 16},
        "32 ticks a sample": {"decimation": 32, "window_s": 2.0, "test_functions": 5},
    }
    for name, settings in sizes.items():
        add(name, samples, with_settings(**settings))
    add("the paper's law", samples, estimator={"law": Law.PSEUDOVELOCITY}, estimator_q31={"gain": 0})
    add("feedback", samples, estimator={"feedback_hz": 0.5}, estimator_q31={"gain": 2**28})
    add("divider", samples, estimator={"divider": 3}, estimator_q31={"divider": 3})
    ungated: dict[str, Any] = {"kappa_min": 0, "noise_margin": 0}
    add("no gates", samples, estimator=ungated, estimator_q31=ungated)
    add("short steps", samples, estimator={"step_limit": 0.02}, estimator_q31={"step_limit": 1311})
    hasty: dict[str, Any] = {"groups_min": 0, "revert_after": 1, "misfit_max": 0}
    open_door = {"trust": TrustConfig(**hasty), "drive_min": 0.0}, {"trust": TrustConfigQ31(**hasty), "drive_min": 0}
    add("hostile", hostile_samples(), others=open_door[0], others_q31=open_door[1])
    add("shut at once", samples, others=open_door[0], others_q31=open_door[1])
    add(
        "never shut",
        samples,
        with_settings(forgetting_s=1e5),
        others={"trust": TrustConfig(revert_after=0)},
        others_q31={"trust": TrustConfigQ31(revert_after=0)},
    )
    add("gate", samples, with_settings(outlier_gate=4.0, outlier_patience_s=3.0))
    add("dead zone", samples, with_settings(dead_zone=1.0))
    found.append(Variant("weak, small angles", replace(weak_config(RIG, RATE), angle_limit=0.1), samples))
    for full_angle, damping in ((True, False), (True, True), (False, True)):
        config = weak_config(with_settings(full_angle=full_angle, damping=damping), RATE)
        found.append(Variant(f"weak, sines {full_angle}, friction {damping}", config, weak_samples("full")))
    sines = weak_config(with_settings(full_angle=True), RATE)
    found.append(Variant("weak, sines, still pivot", replace(sines, drive_min=0.0), weak_samples("full")))
    for decimation, window_s in ((2, 0.4), (5, 0.75)):
        quick = with_settings(full_angle=True, decimation=decimation, window_s=window_s, test_functions=4)
        config = weak_config(with_settings(quick, smoothing_s=0.031), RATE)
        found.append(Variant(f"weak, sines, {decimation} ticks a sample", config, weak_samples("full")))
    config_q31 = replace(weak_config_q31(RIG, RATE), drive_min=0)
    found.append(Variant("weak q31, full scale", config_q31, full_scale_counts(config_q31)))
    return found


def strong_variants() -> list[Variant]:
    """Of both cores; every row is taken in unless said otherwise."""
    found: list[Variant] = []
    samples = strong_samples()
    counts = counted(FINE, samples)

    def add(name: str, rig: RigFile, estimator: dict[str, Any] | None = None, **others: Any) -> None:
        config = strong_config(rig, RATE)
        estimator_config = replace(config.estimator, **(estimator or {}))
        found.append(
            Variant(
                f"strong, {name}",
                replace(config, estimator=estimator_config, **{"drive_min": 0.0, **others}),
                samples,
            )
        )

    def add_q31(name: str, rig: RigFile, estimator: dict[str, Any] | None = None, drive_min: int = 0) -> None:
        config = strong_config_q31(rig, RATE)
        changed = replace(config.estimator, **(estimator or {}))
        found.append(Variant(f"strong q31, {name}", replace(config, estimator=changed, drive_min=drive_min), counts))

    five: dict[str, Any] = {"form": "strong", "differentiator": "finite-difference", "stride": 20}
    smooth: dict[str, Any] = {"form": "strong", "differentiator": "savitzky-golay"}
    five_points = with_settings(FINE, **five)
    for name, rig in {
        "five points": five_points,
        "five points, forgetting": with_settings(five_points, forgetting_s=0.5),
        "five points, the paper's law": with_settings(five_points, law="pseudovelocity"),
        "five points, divider": with_settings(five_points, divider=3),
        "smooth": with_settings(FINE, **smooth),
        "smooth, feedback, forgetting": with_settings(FINE, **smooth, forgetting_s=2.0, feedback_hz=30.0),
    }.items():
        add(name, rig)
        add_q31(name, rig)
    gated = with_settings(five_points, outlier_gate=6.0, outlier_patience_s=0.5)
    add("gate", gated)
    add_q31("gate", gated)
    resting = with_settings(five_points, dead_zone=3.0)
    add("dead zone", resting)
    add("dead zone, noisy rows expected", resting, {"row_sd": 1e6})
    add_q31("dead zone", resting)
    add("Gauss-Newton", five_points, {"feedback_hz": 0.0, "kappa_min": 0.0})
    add("still pivot", five_points, drive_min=3.0)
    add_q31("Gauss-Newton", five_points, {"gain": 2**30, "kappa_min": 0})
    add_q31("still pivot", five_points, drive_min=1 << 26)
    return found


@cache
def variants() -> tuple[Variant, ...]:
    """All of them."""
    return (*weak_variants(), *strong_variants())


def unit_tests() -> list[Path]:
    """The CMocka programs of the core and the link: those that CMake gives no other sources."""
    listed = (UNIT / "CMakeLists.txt").read_text(encoding="utf-8")
    return [path for path in sorted(UNIT.glob("test_*.c")) if f"target_sources({path.stem} " not in listed]


def started(native: Native, config: Config) -> Identifier:
    """The identifier of a configuration."""
    if isinstance(config, WeakConfig):
        return native.identifier(config)
    return native.identifier(config)


# ---- what they show ----


def look(core: Identifier, native: Native, config: Config, into: Any) -> None:
    """Everything that can be asked of an identifier between two ticks."""
    estimate = core.assess()
    into.update(estimate.tobytes())
    into.update(repr(sorted(core.counters.items())).encode())
    if core.publishes:
        into.update(core.estimate.tobytes())
        into.update(repr(core.misfit).encode())
    if isinstance(config, WeakConfigQ31 | StrongConfigQ31):
        in_counts = native.physical_q31(estimate, scale_of(config, RIG.l1))
        into.update(b"" if in_counts is None else b"".join(x.tobytes() for x in in_counts))
    else:
        physical = native.physical(estimate, RIG.l1)
        into.update(b"" if physical is None else b"".join(x.tobytes() for x in physical))


def digest(native: Native, variant: Variant) -> str:
    """What the variant records, estimates and counts."""
    told = hashlib.sha256()
    core = started(native, variant.config)
    phi, y = variant.samples
    frozen = PIECE * (len(phi) // (4 * PIECE))
    for first in range(0, len(phi), PIECE):
        piece = slice(first, first + PIECE)
        core.freeze(first == frozen)
        record = core.run(phi[piece], y[piece], estimate_every=97)
        for name in ("p", "sums", "exponent", "reason", "published", "hash", "estimate"):
            if hasattr(record, name):
                told.update(np.ascontiguousarray(getattr(record, name)).tobytes())
        look(core, native, variant.config, told)
    return told.hexdigest()[:16]


def digests(native: Native) -> Iterator[tuple[str, str]]:
    """Every variant and what it shows, at last what init answers to every edge of every setting."""
    for variant in variants():
        yield variant.name, digest(native, variant)
    yield "configurations", configurations.digest(native)
