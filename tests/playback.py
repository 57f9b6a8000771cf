"""All that one build of the core shows of a few seconds of data in the strong form, under every setting, as one number
a variant; and what its inits answer to every edge of every setting, as one number.

tools/mutate.py plays it before the CMocka programs: a change of the core shows, or not. The bits of the core as it is
are compared with the numpy twin under these settings by test_bits, test_gate, test_freeze and their fixed-point
counterparts; the answers are those of test_bad_config. tools/coverage.py counts the branches of both.
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
from pendulum_plant import simulate, standard_sensors

from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.f32 import StrongConfig
from pvid.settings.q31 import StrongConfigQ31
from pvid.setup.f32 import strong_config
from pvid.setup.q31 import counts_of, scale_of, strong_config_q31

Config = StrongConfig | StrongConfigQ31
Samples = tuple[npt.NDArray[Any], npt.NDArray[Any]]

UNIT = Path(__file__).resolve().parent / "unit"
RATE = 1000.0
RIG = RigFile.standard()
FINE = replace(RIG, sensor=replace(RIG.sensor, phi_lsb=standard_sensors(20).phi_lsb))
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
def clean(bits: int, ticks: int) -> Samples:
    """The standard rig's linear equations."""
    run = simulate(sensors=standard_sensors(bits), truth="linear", duration=ticks / RATE, seed=1).run
    return run.phi, run.y


def strong_samples() -> Samples:
    """A run with an outlier, samples that nobody should send, absurd ones, a pivot that stands."""
    phi, y = (x.copy() for x in clean(20, STRONG_TICKS))
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


# ---- settings ----


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
    blocks = with_settings(FINE, **smooth, block=5)
    five_points = with_settings(FINE, **five)
    for name, rig in {
        "five points": five_points,
        "five points, forgetting": with_settings(five_points, forgetting_s=0.5),
        "five points, the paper's law": with_settings(five_points, law="pseudovelocity"),
        "five points, divider": with_settings(five_points, divider=3),
        "five points, in stages": with_settings(five_points, divider=16),
        "five points, in stages, forgetting": with_settings(five_points, divider=24, forgetting_s=0.5),
        "five points, in stages, the paper's law": with_settings(five_points, divider=32, law="pseudovelocity"),
        "smooth, blocks": blocks,
        "five points, in stages, at most": with_settings(five_points, divider=64),
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
    return tuple(strong_variants())


def unit_tests() -> list[Path]:
    """The CMocka programs of the core and the link: those that CMake gives no other sources."""
    listed = (UNIT / "CMakeLists.txt").read_text(encoding="utf-8")
    return [path for path in sorted(UNIT.glob("test_*.c")) if f"target_sources({path.stem} " not in listed]


# ---- what they show ----


def look(core: Identifier, native: Native, config: Config, into: Any) -> None:
    """Everything that can be asked of an identifier between two ticks."""
    estimate = core.assess()
    into.update(estimate.tobytes())
    into.update(repr(sorted(core.counters.items())).encode())
    if core.publishes:
        into.update(core.estimate.tobytes())
        into.update(repr(core.misfit).encode())
    if isinstance(config, StrongConfigQ31):
        in_counts = native.physical_q31(estimate, scale_of(config, RIG.l1))
        into.update(b"" if in_counts is None else b"".join(x.tobytes() for x in in_counts))
    else:
        physical = native.physical(estimate, RIG.l1)
        into.update(b"" if physical is None else b"".join(x.tobytes() for x in physical))


def digest(native: Native, variant: Variant) -> str:
    """What the variant records, estimates and counts."""
    told = hashlib.sha256()
    core = native.identifier(variant.config)
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
