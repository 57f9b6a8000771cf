"""Configurations of every identifier, and what each of their fields may hold: both ends of a range are accepted, and
what lies beyond is refused with the status that names the field.

tests/core/test_bad_config.py asserts it; tools/mutate.py and tools/coverage.py play `digest`.
"""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from block_models import BlockModel, EstimatorInC
from weak_rig import weak_rig

from pvid.codegen.weak_library import weak_native_q31
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.core.headers import Headers, Scalar, default_library
from pvid.core.native import Native, Stepper
from pvid.core.weak_native_q31 import WeakNativeQ31
from pvid.models.mechanisms import compiled_of
from pvid.settings.enums import Status
from pvid.settings.parts import EstimatorConfig

HEADERS = Headers.of(default_library())
HUGE = float(np.finfo(np.float32).max)
SMALLEST = float(np.nextafter(np.float32(0), np.float32(1)))
OWN_RATE = 1024.0  # Hz, of the estimator without a form: four ticks are 2^-8 s exactly
ROOM = 20_000  # entries of a table of zeros, which is longer than any size asks for


# ---- what a field may hold ----


@dataclass(frozen=True)
class Range:
    """What a field may hold; outside of it init answers `status`, inside it may contradict others: `also`."""

    low: float
    high: float
    status: Status
    also: tuple[Status, ...] = ()
    besides: tuple[float, ...] = ()  # allowed values outside low..high
    odd: bool = False  # no even values

    def holds(self, value: float) -> bool:
        """Whether it may be `value`, as C compares them."""
        if not isinstance(value, int):
            single = np.float32(value)
            return value in self.besides or bool(np.float32(self.low) <= single <= np.float32(self.high))
        return value in self.besides or (self.low <= value <= self.high and not (self.odd and value % 2 == 0))

    def answers(self, value: float) -> tuple[Status, ...]:
        """What init may answer to it."""
        return (Status.OK, *self.also) if self.holds(value) else (self.status,)

    def edges(self, field: Scalar) -> list[Any]:
        """Its ends, what lies beyond, the extremes of the field's type, and for a float what is no number."""
        if isinstance(field.value, float):
            ends = [np.float32(end) for end in (self.low, self.high)]
            with np.errstate(over="ignore"):
                beyond = [np.nextafter(end, np.float32(way)) for end in ends for way in (-np.inf, np.inf)]
            numbers = [float(x) for x in (*ends, *beyond, -HUGE, HUGE, 0.0, SMALLEST, -SMALLEST)]
            return [*numbers, *self.besides, math.nan, math.inf, -math.inf]
        limits = np.iinfo(HEADERS.dtype(field.kind))
        near = [int(end) + step for end in (self.low, self.high) for step in (-2, -1, 0, 1, 2)]
        values = (int(limits.min), int(limits.max), 0, *map(int, self.besides), *near)
        return [value for value in values if limits.min <= value <= limits.max]


BOUNDS = Range(-HUGE, HUGE, Status.BAD_BOUNDS, (Status.BAD_BOUNDS, Status.BAD_START))
ESTIMATOR = {
    "estimator.start": Range(-HUGE, HUGE, Status.BAD_START, (Status.BAD_START,)),
    "estimator.start_sd": Range(1e-12, 1e12, Status.BAD_START_SD),
    "estimator.lower": BOUNDS,
    "estimator.upper": BOUNDS,
    "estimator.row_sd": Range(1e-12, 1e12, Status.BAD_ROW_SD),
    "estimator.forgetting_s": Range(0.0, 1e12, Status.BAD_FORGETTING, (Status.BAD_FORGETTING,)),
    "estimator.feedback_hz": Range(0.0, 1e12, Status.BAD_FEEDBACK),
    "estimator.step_limit": Range(1e-6, 0.9, Status.BAD_STEP_LIMIT),
    "estimator.kappa_min": Range(0.0, 0.999, Status.BAD_KAPPA_MIN),
    "estimator.noise_margin": Range(0.0, 1e6, Status.BAD_NOISE_MARGIN),
    "estimator.dead_zone": Range(0.0, 100.0, Status.BAD_DEAD_ZONE),
    "estimator.law": Range(0, 1, Status.BAD_LAW),
    "estimator.divider": Range(1, 65535, Status.BAD_DIVIDER),
}
RIG_FIELDS = {
    "sample_rate_hz": Range(1e-3, 1e6, Status.BAD_SAMPLE_RATE, (Status.BAD_FORGETTING, Status.BAD_UPDATE_RATE)),
    "gate.sigmas": Range(2.0, 1e3, Status.BAD_GATE_SIGMAS, besides=(0.0,)),
    "gate.patience_s": Range(0.0, 1e12, Status.BAD_GATE_PATIENCE),
}
LEAST = -(2**31)
FORMAT = Range(-64, 64, Status.BAD_FORMAT)
ESTIMATOR_Q31 = {
    "estimator.start": Range(LEAST, 2**31 - 1, Status.BAD_START, (Status.BAD_START,)),
    "estimator.start_sd": Range(1, 2**31 - 1, Status.BAD_START_SD),
    "estimator.lower": Range(LEAST + 1, 2**31 - 1, Status.BAD_BOUNDS, (Status.BAD_BOUNDS, Status.BAD_START)),
    "estimator.upper": Range(LEAST + 1, 2**31 - 1, Status.BAD_BOUNDS, (Status.BAD_BOUNDS, Status.BAD_START)),
    "estimator.p_bits": FORMAT,
    "estimator.n_bits": FORMAT,
    "estimator.y_bits": FORMAT,
    "estimator.row_sd": Range(1, 2**31 - 1, Status.BAD_ROW_SD),
    "estimator.forgetting_groups": Range(4, 2**24, Status.BAD_FORGETTING, besides=(0,)),
    "estimator.gain": Range(0, 2**30, Status.BAD_FEEDBACK),
    "estimator.correlation": Range(2**16, 2**31, Status.BAD_CORRELATION),
    "estimator.row_weight": Range(1, 2**16, Status.BAD_ROW_WEIGHT),
    "estimator.step_limit": Range(1, 58982, Status.BAD_STEP_LIMIT),
    "estimator.kappa_min": Range(0, 2**30 - 2**30 // 1000, Status.BAD_KAPPA_MIN),
    "estimator.noise_margin": Range(0, 2**30, Status.BAD_NOISE_MARGIN),
    "estimator.dead_zone": Range(0, 100 << 16, Status.BAD_DEAD_ZONE),
    "gate.sigmas": Range(2 << 16, 1000 << 16, Status.BAD_GATE_SIGMAS, besides=(0,)),
    "gate.patience_groups": Range(0, 2**30, Status.BAD_GATE_PATIENCE),
    "estimator.divider": Range(1, 65535, Status.BAD_DIVIDER),
}
TRUST = {
    "trust.kappa_min": Range(0.0, 0.999, Status.BAD_PUBLISH_KAPPA),
    "trust.se_max": Range(1e-9, 1e9, Status.BAD_SE_MAX),
    "trust.misfit_max": Range(1.0, 1e6, Status.BAD_MISFIT_MAX, besides=(0.0,)),
    "trust.renewal": Range(0.01, 1e3, Status.BAD_RENEWAL, besides=(0.0,)),
    "trust.groups_min": Range(0, 65535, Status.OK),
    "trust.revert_after": Range(0, 65535, Status.OK),
    "trust.age_max": Range(0, 65535, Status.OK),
}
FORM = {"iterations": Range(1, 10, Status.BAD_ITERATIONS, (Status.BAD_ITERATIONS,))}
WEAK = {**RIG_FIELDS, **ESTIMATOR, **TRUST, **FORM}
WEAK_Q31 = {
    **ESTIMATOR_Q31,
    **TRUST,
    **FORM,
    "trust.kappa_min": Range(0, 2**30 - 2**30 // 1000, Status.BAD_PUBLISH_KAPPA),
    "trust.se_max": Range(1, 2**31 - 1, Status.BAD_SE_MAX),
    "trust.misfit_max": Range(2**16, 2**32 - 1, Status.BAD_MISFIT_MAX, besides=(0,)),
    "trust.renewal": Range(655, 1000 << 16, Status.BAD_RENEWAL, besides=(0,)),
}
OWN = {
    **ESTIMATOR,
    "estimator.forgetting_s": Range(4.0 / OWN_RATE, 1e12, Status.BAD_FORGETTING, besides=(0.0,)),
    "estimator.update_rate_hz": Range(1e-6, 1e6, Status.BAD_UPDATE_RATE),
    "estimator.correlation": Range(1.0, 1e6, Status.BAD_CORRELATION),
    "estimator.row_weight": Range(1e-6, 1.0, Status.BAD_ROW_WEIGHT),
}
RANGES = {"weak": WEAK, "weak q31": WEAK_Q31, "estimator": OWN}
IDENTIFIERS = tuple(name for name in RANGES if name != "estimator")
WITHOUT = {"weights": Status.BAD_BANK, "model": Status.BAD_MODEL}
SET_BY_INIT = {"estimator.model", "estimator.update_rate_hz"}  # what a form's init fills in
# Of the identifier: tests/unit/test_weak_valid_q31.c, test_weak.c.
ELSEWHERE = {"design", "refine", "range", "drive_min", "offset", "trust.shared"}
UNUSED = {
    "weak": SET_BY_INIT | {"estimator.correlation", "estimator.row_weight", "compensation"} | ELSEWHERE,
    "weak q31": SET_BY_INIT | {"estimator.row_weight", "compensation"} | ELSEWHERE,
    "estimator": set(),
}


# ---- the configurations ----


def is_table(field: Scalar) -> bool:
    """Whether it points to numbers."""
    return bool(field.kind.kind == "pointer" and field.kind.item.kind == "primitive")


@dataclass(repr=False)
class Subject:
    """An identifier, or an estimator by itself, whose configuration may be spoilt and comes back as it was."""

    name: str
    identifier: Stepper

    def __post_init__(self) -> None:
        headers, config = self.identifier.native.headers, self.identifier.config_struct
        prefix = "estimator." if self.name == "estimator" else ""
        sizes = {name: table.size for name, table in self.identifier.tables.items()}
        self.tables: dict[str, Any] = {}
        all_of_them = {field.name: field for field in headers.scalars(config, prefix)}
        self.fields = {name: field for name, field in all_of_them.items() if not name.startswith("design.")}
        self.n_theta = int(self.identifier.estimator.model.n_theta)
        self.entries = {
            name: sizes[name.rpartition(".")[2]]
            for name, field in self.fields.items()
            if is_table(field) and name not in ELSEWHERE
        }
        self._memory = headers.ffi.buffer(headers.ffi.addressof(config))
        self.keep()

    def keep(self) -> None:
        """The configuration as it stands is the good one."""
        self._good = bytes(self._memory)

    def restore(self) -> None:
        """The good configuration again."""
        self._memory[:] = self._good

    def status_with(self, values: dict[str, Any]) -> Status:
        """The status of init for the good configuration with other values."""
        self.restore()
        for name, value in values.items():
            self.fields[name].set(value)
        return self.identifier.initialise()

    def empty_tables(self) -> dict[str, Any]:
        """Gives it tables of zeros that are longer than any size asks for, by name."""
        for field in self.fields.values():
            if field.name in self.entries:
                self.tables[field.name] = HEADERS.ffi.new(f"{field.kind.item.cname.removeprefix('const ')}[]", ROOM)
                field.set(self.tables[field.name])
        self.keep()
        return self.tables

    def is_used(self, field: Scalar) -> bool:
        """Whether init reads it, and the model has such an entry."""
        name = field.group.removeprefix("estimator.")
        if name in ("start", "start_sd", "lower", "upper", "p_bits"):
            return field.place < self.identifier.n_p
        return field.group not in UNUSED[self.name] and (name != "n_bits" or field.place < self.n_theta)

    def ranged(self) -> Iterator[tuple[Scalar, Range]]:
        """Every field that is used, with what it may hold."""
        for field in self.fields.values():
            known = RANGES[self.name].get(field.group)
            if known is not None and self.is_used(field):
                yield field, known

    def pointers(self) -> Iterator[tuple[Scalar, Status]]:
        """Every pointer, and what init answers to NULL."""
        for field in self.fields.values():
            if field.kind.kind == "pointer" and self.is_used(field):
                yield field, WITHOUT[field.name.rpartition(".")[2]]

    def edges(self) -> Iterator[tuple[str, Any, tuple[Status, ...]]]:
        """Field, value and what init may answer, for all edges of all fields."""
        for field, known in self.ranged():
            yield from ((field.name, value, known.answers(value)) for value in known.edges(field))
        for field, status in self.pointers():
            yield field.name, HEADERS.ffi.NULL, (status,)


def estimator_of_rows(native: Native) -> Stepper:
    """An estimator by itself: eight theta of four parameters, three of which are positive."""
    start = np.array([31.0, 8.0, 5.0, 0.0], np.float32)
    bounds = np.array([620.0, 160.0, 100.0, 1.0], np.float32)
    lower = np.array([1.5, 0.4, 0.25, -1.0], np.float32)
    config = EstimatorConfig(start, np.full(4, 2.0, np.float32), lower, bounds, row_sd=1e-3)
    ones = np.ones(4, np.float32)
    accepted = replace(config, start=ones, lower=ones * np.float32(0.5), upper=ones * np.float32(2))
    owner = EstimatorInC(native, BlockModel.random(np.random.default_rng(1), (8,), 4), accepted, OWN_RATE)
    owner.model.positive = 7
    stepper = Stepper(native, "estimator", "f32", config, replay="rows", model=owner.model, update_rate_hz=OWN_RATE)
    stepper.owner = owner  # type: ignore[attr-defined]
    return stepper


@cache
def _fixed() -> WeakNativeQ31:
    weak = weak_q31_for_simulated_rig(compiled_of("kapitza"))
    return weak_native_q31(weak.made, weak.parameters, weak.config)


def fixed_identifier() -> Stepper:
    """The pendulum's weak form in fixed point."""
    return _fixed().identifier()


def subjects(native: Native) -> dict[str, Subject]:
    """The weak form in both cores, and an estimator by itself."""
    made: dict[str, Stepper] = {
        "weak": weak_rig("kapitza").native.identifier_of(weak_rig("kapitza").config),
        "weak q31": fixed_identifier(),
        "estimator": estimator_of_rows(native),
    }
    return {name: Subject(name, stepper) for name, stepper in made.items()}


# Fields that contradict each other: for the identifiers that have them.
TOGETHER: tuple[dict[str, Any], ...] = (
    {"gate.sigmas": 4.0, "gate.patience_s": 2.0},
    {"estimator.feedback_hz": 0.01},
    {"estimator.gain": 2**29},
)


def digest(native: Native) -> str:
    """What init answers to all edges of all fields and tables."""
    told = hashlib.sha256()

    def tell(subject: Subject, what: object, status: Status) -> None:
        told.update(f"{what} {status}\n".encode())

    for subject in subjects(native).values():
        subject.empty_tables()
        for name, value, _ in subject.edges():
            tell(subject, (name, value), subject.status_with({name: value}))
        for values in TOGETHER:
            if values.keys() <= subject.fields.keys():
                tell(subject, values, subject.status_with(values))
        subject.restore()
        for name, table in subject.tables.items():
            kind = HEADERS.dtype(subject.fields[name].kind.item)
            extremes = [math.nan] if kind.kind == "f" else [np.iinfo(kind).min, np.iinfo(kind).max]
            for place in (0, subject.entries[name] - 1, subject.entries[name]):
                for value in extremes:
                    table[place] = value
                    tell(subject, (name, place, value), subject.identifier.initialise())
                table[place] = 0
    return told.hexdigest()[:16]
