"""What one build of the core shows of the weak form, in float32 with its second stage and in fixed point, with the
generated C of shipped mechanisms, as one number a variant.

tools/mutate.py plays it: a change of the core shows, or not. The bits of the core as it is are compared with the numpy
twin by test_weak_f32, test_weak_bits_q31, test_second_stage and test_refine_mechanisms.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.board.refined_image import RefinedRun, refined_run
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.codegen.weak_q31 import WeakQ31
from pvid.codegen.weak_sizes import sizes_of_design, sizes_of_q31
from pvid.configuration.weak import simulated_run_of
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.core import snapshot
from pvid.core.model_library import core_of
from pvid.core.native import Publisher
from pvid.core.sizes import options_of, roomy
from pvid.core.weak_native import RefinedIdentifier, WeakNative
from pvid.core.weak_native_q31 import WeakIdentifierQ31, WeakNativeQ31
from pvid.models.mechanisms import compiled_of
from pvid.settings.cores import FIXED, FLOAT
from pvid.settings.enums import Law
from pvid.settings.parts import GateConfig, TrustConfig

# Steps of Runge-Kutta but for those of the pendulum and the rigid body, which are Adams's.
BOTH_STAGES = (
    "kapitza",  # of order 2, an integral of second order, nuisances, a skew
    "rigid_body",  # of order 1, inputs that are held
    "battery_2rc",  # hidden coordinates, the integral of an input, an output by an algebraic equation
    "two_mass_drive",  # a hidden coordinate, an angle that turns, a sign of friction
    "two_link_arm",  # two signs
)
IN_FIXED_POINT = (
    "two_link_arm",  # two kinds
    "dc_motor",  # signs
    "battery_2rc",  # a running integral
    "kapitza",  # decimation
)
TICKS = 14_000  # of each run: the refinement ends several blocks
PIECES = 5  # of a run: between two of them everything is looked at


class Subject(Protocol):
    """A mechanism's identifier in one core."""

    @property
    def name(self) -> str: ...

    @property
    def library(self) -> Path:
        """As the core is; the generated C is in its folder."""

    @property
    def definitions(self) -> tuple[str, ...]:
        """Options of the compiler."""

    @property
    def sources(self) -> list[Path]:
        """Of the core."""

    def digests(self, library: Path) -> Iterator[tuple[str, str]]:
        """What a build shows, by variant."""

    def hashes(self, library: Path) -> Iterator[tuple[str, str]]:
        """Of each variant the CRC-32 of its samples and the running hash behind them (pvid/fnv.h)."""


def defined(sizes: Mapping[str, int]) -> tuple[str, ...]:
    """As options of the compiler, with those of every library of a mechanism."""
    return tuple(options_of(sizes))


def played(core: Publisher, kind: str, size: int, run: Callable[[Any], Any], samples: npt.NDArray[Any]) -> str:
    """What a build records, estimates and keeps in snapshots: a gap before the fourth piece, the third is frozen.

    Parameters
    ----------
    kind, size : of the snapshots
    run : steps through samples
    """
    told = hashlib.sha256()
    for place, piece in enumerate(np.array_split(samples, PIECES)):
        core.freeze(place == 2)
        if place == 3:
            core.gap()
        record = run(piece)
        for one in fields(record):
            told.update(np.ascontiguousarray(getattr(record, one.name)).tobytes())
        best = core.best if isinstance(core, RefinedIdentifier) else ()
        told.update(repr((sorted(core.counters.items()), core.misfit, best[:1])).encode())
        for estimate in (core.assess(), core.estimate, *best[1:]):
            told.update(estimate.tobytes())
        image = snapshot.save_as(kind, core, size)
        told.update(image)
        told.update(repr((len(image), snapshot.restore_as(kind, core, image))).encode())
    return told.hexdigest()[:16]


def hash_behind(samples: npt.NDArray[Any], record: Any) -> str:
    """CRC-32 of samples and the running hash at their end."""
    return f"{zlib.crc32(samples.tobytes()):08x} {int(record.hash[-1]):08x}"


# ---- float32, both stages ----


def wrong(samples: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Two wild samples, missing ones, an absurd stretch, an input that is too large from then on, one that stands."""
    out, n = samples.copy(), len(samples)
    out[n // 5, -1] += 3 * samples[:, -1].std()
    out[n // 4, 0] += 3 * samples[:, 0].std()
    out[n // 3, 0], out[n // 2, -1] = np.nan, -np.inf
    out[6 * n // 10 : 6 * n // 10 + 9] *= np.float32(1e30)
    out[7 * n // 10 :, 0] *= 1.2
    out[9 * n // 10 :, 0] = out[9 * n // 10, 0]
    return out


@dataclass(frozen=True)
class BothStages:
    """Weak identifier and refinement in float32."""

    mechanism: str
    run: RefinedRun
    native: WeakNative

    @staticmethod
    def of(mechanism: str) -> BothStages:
        """The shipped rig; the estimates of the first windows are refined."""
        run = refined_run(mechanism, TICKS, distance=0.1, se_max=10.0)
        return BothStages(mechanism, run, weak_native(run.weak.compiled, run.weak.config.design, run.made))

    @property
    def name(self) -> str:
        return f"{self.mechanism}_f32"

    @property
    def library(self) -> Path:
        return self.native.path

    @property
    def definitions(self) -> tuple[str, ...]:
        return defined(roomy(sizes_of_design(self.run.weak.config.design)))

    @property
    def sources(self) -> list[Path]:
        return core_of(FLOAT, refined=True)

    def digests(self, library: Path) -> Iterator[tuple[str, str]]:
        native = WeakNative(self.run.weak.name, library, self.native.sources)
        for variant, (weak, refine, samples) in self.variants().items():
            core = native.refined_of(weak, refine)
            size = len(core.state_bytes) + native.headers.ffi.sizeof(core.refinement[0])
            yield f"{self.name}, {variant}", played(core, "refine_f32", size, core.run_both, samples)

    def hashes(self, library: Path) -> Iterator[tuple[str, str]]:
        native = WeakNative(self.run.weak.name, library, self.native.sources)
        for variant, (weak, refine, samples) in self.variants().items():
            yield variant, hash_behind(samples, native.refined_of(weak, refine).run_both(samples))

    def variants(self) -> dict[str, Any]:
        """Settings of both stages and samples."""
        own, samples = self.run.weak.config, self.run.weak.samples
        early = TrustConfig(se_max=10.0, groups_min=1, kappa_min=0.0, renewal=0.2)
        design = own.design
        errors = np.full(design.model.kinds, 1e-9, np.float32)
        estimator = own.estimator
        limited = replace(
            own,
            trust=early,
            gate=GateConfig(3.0, 20.0 / own.sample_rate * design.hop),
            design=replace(design, error_variance=errors, error_order=np.ones(design.model.kinds, np.uint8)),
            compensation=not own.compensation,
            estimator=replace(estimator, law=Law.PSEUDOVELOCITY, feedback_hz=0.0),
            range=(1.15 * np.abs(samples).max(axis=0) + 1e-6).astype(np.float32),
            drive_min=(0.02 * samples.std(axis=0)).astype(np.float32),
        )
        forgetting = 10 * design.hop * design.decimation / own.sample_rate
        lasting = replace(own, trust=early, estimator=replace(estimator, forgetting_s=forgetting))
        settings = self.run.settings
        return {
            "as it is": (replace(own, trust=early), settings, samples),
            "forgetting": (lasting, replace(settings, forgetting_s=forgetting, jobs=1, rests=255), samples),
            "limits": (limited, replace(settings, passes=1, most_passes=3), wrong(samples)),
            "no gate": (replace(own, trust=early), replace(settings, outlier_gate=0.0), wrong(samples)),
        }


# ---- fixed point ----


@dataclass(frozen=True)
class InFixedPoint:
    """Weak identifier in fixed point."""

    mechanism: str
    weak: WeakQ31
    native: WeakNativeQ31
    counts: npt.NDArray[np.int32]

    @staticmethod
    def of(mechanism: str) -> InFixedPoint:
        """The shipped rig; estimates are published from the first window on."""
        compiled = compiled_of(mechanism)
        weak = weak_q31_for_simulated_rig(compiled)
        trust = replace(weak.config.trust, groups_min=1, se_max=2**31 - 1)
        native = weak_native_q31(weak.made, weak.parameters, replace(weak.config, trust=trust))
        return InFixedPoint(mechanism, weak, native, weak.counts_of(simulated_run_of(compiled)[0])[:TICKS])

    @property
    def name(self) -> str:
        return f"{self.mechanism}_q31"

    @property
    def library(self) -> Path:
        return self.native.path

    @property
    def definitions(self) -> tuple[str, ...]:
        model = self.weak.parameters.model
        return defined(roomy(sizes_of_q31(self.weak.config.design, model.n_p, len(model.c_row))))

    @property
    def sources(self) -> list[Path]:
        return core_of(FIXED, refined=False)

    def digests(self, library: Path) -> Iterator[tuple[str, str]]:
        native = WeakNativeQ31(self.native.name, library, self.native.config, self.native.sources)
        for variant, (settings, counts) in self.variants().items():
            core = native.identifier()
            kept = [set_in(core, name, value) for name, value in settings.items()]
            if core.initialise():
                raise SystemExit(f"{self.name}, {variant}: refused")
            yield f"{self.name}, {variant}", played(core, "weak_q31", len(core.state_bytes), core.run_samples, counts)
            del kept

    def hashes(self, library: Path) -> Iterator[tuple[str, str]]:
        native = WeakNativeQ31(self.native.name, library, self.native.config, self.native.sources)
        for variant, (settings, counts) in self.variants().items():
            core = native.identifier()
            kept = [set_in(core, name, value) for name, value in settings.items()]
            core.initialise()
            yield variant, hash_behind(counts, core.run_samples(counts))
            del kept

    def variants(self) -> dict[str, tuple[dict[str, Any], npt.NDArray[np.int32]]]:
        """Settings and readings."""
        counts = self.counts
        sd = np.std(counts, axis=0)
        wild, n = counts.copy(), len(counts)
        wild[n // 4 : n : n // 7, 0] += round(6 * float(sd[0]))
        wild[n // 2, -1] = 2**31 - 1
        wild[6 * n // 10, 0] = -(2**31)
        wild[8 * n // 10 :, -1] = wild[8 * n // 10, -1]
        offset = list(range(-3, len(sd) - 3))
        limits: dict[str, Any] = {
            "gate.sigmas": 3 << 16,
            "gate.patience_groups": 5,
            "drive_min": [int(x) for x in 0.05 * sd],
            "offset": offset,
            "estimator.forgetting_groups": 4,
        }
        return {
            "as it is": ({}, counts),
            "limits": (limits, wild),
            "divider": ({"estimator.divider": 2, "estimator.gain": 2**29}, counts),
        }


def set_in(core: WeakIdentifierQ31, name: str, value: Any) -> Any:
    """Sets a field of the configuration; a table that it points to is returned, and has to be kept."""
    holder = core.config_struct
    *outer, field = name.split(".")
    for one in outer:
        holder = getattr(holder, one)
    table = core.native.headers.ffi.new("int32_t[]", value) if isinstance(value, list) else value
    setattr(holder, field, table)
    return table


@cache
def subjects() -> tuple[Subject, ...]:
    """All of them."""
    return (*map(BothStages.of, BOTH_STAGES), *map(InFixedPoint.of, IN_FIXED_POINT))


def unit_tests() -> list[Path]:
    """The CMocka programs of the core and the link: those that CMake gives no other sources."""
    folder = Path(__file__).resolve().parent / "unit"
    listed = (folder / "CMakeLists.txt").read_text(encoding="utf-8")
    return [path for path in sorted(folder.glob("test_*.c")) if f"target_sources({path.stem} " not in listed]
