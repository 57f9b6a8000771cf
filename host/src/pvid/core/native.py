"""The shipped C core, called through a shared library built from the same sources with the same flags.

The structs of the public headers are mirrored here; every size and offset is checked when the library is
loaded, so a mismatch is a sentence and never a wrong number.
"""

from __future__ import annotations

import ctypes
import math
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.fir import Folded

Float32 = npt.NDArray[np.float32]

# Bounds that host/native builds the core with.
MAX_P = 6
MAX_THETA = 11
MAX_MOMENTS = 55
MAX_SUMS = MAX_MOMENTS + MAX_THETA + 2
MAX_WINDOW = 321
# Compiler options of the library and of whatever links with it (host/native/CMakeLists.txt).
SIZES = (
    "-DPVID_PLAIN_NAMES",
    "-DPVID_MAX_P=6",
    "-DPVID_MAX_MOMENTS=55",
    "-DPVID_MAX_TAPS=401",
    "-DPVID_MAX_DECIMATION=64",
)


class Reason(IntEnum):
    """What became of a tick (pvid_reason)."""

    UPDATED = 0
    WARMING_UP = 1
    ACCUMULATED = 2
    HELD_NOT_EXCITED = 3
    HELD_PIVOT = 4
    REJECTED_NOT_FINITE = 5
    REJECTED_OUTLIER = 6
    REJECTED_SATURATED = 7
    HELD_UNCERTAIN = 8
    HELD_OUT_OF_RANGE = 9
    MISFIT = 10
    HELD_FROZEN = 11
    NOT_READY = 12

    @property
    def text(self) -> str:
        """The reason in words."""
        return self.name.lower().replace("_", " ")


class Status(IntEnum):
    """Answer of an init (pvid_status)."""

    OK = 0
    BAD_MODEL = 1
    BAD_SAMPLE_RATE = 2
    BAD_BANK = 3
    BAD_LENGTH = 4
    BAD_START = 5
    BAD_START_SD = 6
    BAD_BOUNDS = 7
    BAD_ROW_SD = 8
    BAD_UPDATE_RATE = 9
    BAD_FORGETTING = 10
    BAD_FEEDBACK = 11
    BAD_LAW = 12
    BAD_DIVIDER = 13
    BAD_STEP_LIMIT = 14
    BAD_KAPPA_MIN = 15
    BAD_CORRELATION = 16
    BAD_DRIVE_MIN = 17
    BAD_ROW_WEIGHT = 18
    BAD_DESIGN = 19
    BAD_ITERATIONS = 20
    BAD_NOISE_MARGIN = 21
    BAD_PUBLISH_KAPPA = 22
    BAD_SE_MAX = 23
    BAD_MISFIT_MAX = 24
    BAD_PIVOT_NOISE = 25
    BAD_ANGLE_LIMIT = 26
    BAD_ANGLE = 27
    BAD_GATE_SIGMAS = 28
    BAD_GATE_PATIENCE = 29
    BAD_DEAD_ZONE = 30
    BAD_HALF = 31
    BAD_STRIDE = 32
    BAD_CENTRE = 33
    BAD_TAPS = 34
    BAD_DECIMATION = 35
    BAD_WINDOW = 36
    BAD_FUNCTIONS = 37
    BAD_LAG = 38
    BAD_OVERLAP = 39
    BAD_FULL_SCALE = 40
    BAD_SHIFT = 41
    BAD_U_MULTIPLIER = 42
    BAD_DRIVE_TICKS = 43
    BAD_FORMAT = 44
    BAD_RENEWAL = 45
    BAD_POINTER = 46


class Law(IntEnum):
    """pvid_law."""

    STATIONARY = 0
    PSEUDOVELOCITY = 1


class FirBankStruct(ctypes.Structure):
    """pvid_fir_bank_f32."""

    _fields_ = [
        ("half", ctypes.c_uint16),
        ("stride", ctypes.c_uint16),
        ("weights", ctypes.POINTER(ctypes.c_float)),
    ]


class EstimatorConfigStruct(ctypes.Structure):
    """pvid_estimator_config_f32."""

    _fields_ = [
        ("model", ctypes.c_void_p),
        ("start", ctypes.c_float * MAX_P),
        ("start_sd", ctypes.c_float * MAX_P),
        ("lower", ctypes.c_float * MAX_P),
        ("upper", ctypes.c_float * MAX_P),
        ("row_sd", ctypes.c_float),
        ("update_rate_hz", ctypes.c_float),
        ("forgetting_s", ctypes.c_float),
        ("feedback_hz", ctypes.c_float),
        ("correlation", ctypes.c_float),
        ("row_weight", ctypes.c_float),
        ("step_limit", ctypes.c_float),
        ("kappa_min", ctypes.c_float),
        ("noise_margin", ctypes.c_float),
        ("dead_zone", ctypes.c_float),
        ("law", ctypes.c_int),
        ("divider", ctypes.c_uint16),
    ]


class TrustConfigStruct(ctypes.Structure):
    """pvid_trust_config_f32."""

    _fields_ = [
        ("kappa_min", ctypes.c_float),
        ("se_max", ctypes.c_float),
        ("misfit_max", ctypes.c_float),
        ("groups_min", ctypes.c_uint16),
        ("revert_after", ctypes.c_uint16),
        ("renewal", ctypes.c_float),
    ]


class GateConfigStruct(ctypes.Structure):
    """pvid_gate_config_f32."""

    _fields_ = [("sigmas", ctypes.c_float), ("patience_s", ctypes.c_float)]


class StrongConfigStruct(ctypes.Structure):
    """pvid_strong_config_f32."""

    _fields_ = [
        ("sample_rate_hz", ctypes.c_float),
        ("l1", ctypes.c_float),
        ("drive_min", ctypes.c_float),
        ("bank", FirBankStruct),
        ("gate", GateConfigStruct),
        ("estimator", EstimatorConfigStruct),
    ]


class WeakDesignStruct(ctypes.Structure):
    """pvid_weak_design_f32."""

    _fields_ = [
        ("taps", ctypes.c_uint16),
        ("decimation", ctypes.c_uint16),
        ("window", ctypes.c_uint16),
        ("functions", ctypes.c_uint8),
        ("smooth", ctypes.POINTER(ctypes.c_float)),
        ("second", ctypes.POINTER(ctypes.c_float)),
        ("chi", ctypes.POINTER(ctypes.c_float)),
        ("gram", ctypes.POINTER(ctypes.c_float)),
        ("overlap", ctypes.c_float),
        ("lag", ctypes.c_uint8),
    ]


class WeakConfigStruct(ctypes.Structure):
    """pvid_weak_config_f32."""

    _fields_ = [
        ("sample_rate_hz", ctypes.c_float),
        ("l1", ctypes.c_float),
        ("drive_min", ctypes.c_float),
        ("pivot_noise", ctypes.c_float),
        ("angle_limit", ctypes.c_float),
        ("design", ctypes.POINTER(WeakDesignStruct)),
        ("angle", ctypes.c_void_p),
        ("full_angle", ctypes.c_bool),
        ("friction", ctypes.c_bool),
        ("passes", ctypes.c_uint8),
        ("zero_unknown", ctypes.c_bool),
        ("iterations", ctypes.c_uint8),
        ("estimator", EstimatorConfigStruct),
        ("trust", TrustConfigStruct),
        ("gate", GateConfigStruct),
    ]


class CountersStruct(ctypes.Structure):
    """pvid_counters."""

    _fields_ = [
        (name, ctypes.c_uint32)
        for name in (
            "rows",
            "updates",
            "limited",
            "bounded",
            "held_not_excited",
            "held_pivot",
            "rejected_not_finite",
            "rejected_saturated",
            "held_uncertain",
            "held_out_of_range",
            "misfits",
            "rejected_outlier",
            "at_rest",
        )
    ]


class EstimateStruct(ctypes.Structure):
    """pvid_estimate_f32."""

    _fields_ = [
        ("p", ctypes.c_float * MAX_P),
        ("se", ctypes.c_float * MAX_P),
        ("covariance", (ctypes.c_float * MAX_P) * MAX_P),
        ("kappa", ctypes.c_float),
        ("least_pivot", ctypes.c_float),
        ("residual_sd", ctypes.c_float),
        ("weight", ctypes.c_float),
        ("misfit", ctypes.c_float),
    ]


class RecordStruct(ctypes.Structure):
    """pvid_record_f32."""

    _fields_ = [
        ("p", ctypes.c_void_p),
        ("published", ctypes.c_void_p),
        ("published_se", ctypes.c_void_p),
        ("sums", ctypes.c_void_p),
        ("reason", ctypes.c_void_p),
        ("hash", ctypes.c_void_p),
        ("running_hash", ctypes.c_void_p),
        ("estimate", ctypes.c_void_p),
        ("estimate_every", ctypes.c_uint32),
    ]


ESTIMATE_DTYPE = np.dtype(
    [
        ("p", np.float32, (MAX_P,)),
        ("se", np.float32, (MAX_P,)),
        ("covariance", np.float32, (MAX_P, MAX_P)),
        ("kappa", np.float32),
        ("least_pivot", np.float32),
        ("residual_sd", np.float32),
        ("weight", np.float32),
        ("misfit", np.float32),
    ]
)


@dataclass(frozen=True)
class EstimatorConfig:
    """Settings of the estimator, as in estimator.h; arrays have one entry a free parameter."""

    start: Float32
    start_sd: Float32
    lower: Float32
    upper: Float32
    row_sd: float
    forgetting_s: float = 0.0
    feedback_hz: float = 0.0
    correlation: float = 1.0
    row_weight: float = 1.0
    step_limit: float = 0.3
    kappa_min: float = 1e-5
    noise_margin: float = 16.0
    dead_zone: float = 0.0
    law: Law = Law.STATIONARY
    divider: int = 1


@dataclass(frozen=True)
class GateConfig:
    """Which rows or windows are kept out, as in gate.h; sigmas 0: none."""

    sigmas: float = 0.0
    patience_s: float = 0.0


@dataclass(frozen=True)
class StrongConfig(Folded):
    """Settings of the strong-form identifier, as in strong.h.

    `weights` is the folded bank, float32 [5, half]; see pvid.design.fir.
    """

    sample_rate: float
    l1: float
    weights: Float32
    stride: int
    estimator: EstimatorConfig
    drive_min: float = 0.0
    gate: GateConfig = field(default_factory=GateConfig)


class WeakTables(Protocol):
    """Tables of a weak-form design, as in weak.h; pvid.design.weak makes them.

    smooth, second float32 [(taps - 1) / 2]; chi float32 [window, 3, functions] (orders 0, 2, 4);
    gram float32 [6, functions (functions + 1) / 2].
    """

    @property
    def taps(self) -> int: ...
    @property
    def decimation(self) -> int: ...
    @property
    def window(self) -> int: ...
    @property
    def functions(self) -> int: ...
    @property
    def smooth(self) -> Float32: ...
    @property
    def second(self) -> Float32: ...
    @property
    def chi(self) -> Float32: ...
    @property
    def gram(self) -> Float32: ...
    @property
    def overlap(self) -> float: ...
    @property
    def lag(self) -> int: ...


@dataclass(frozen=True)
class TrustConfig:
    """Which estimates are published, as in trust.h."""

    kappa_min: float = 3e-5
    se_max: float = 0.05
    misfit_max: float = 4.0
    groups_min: int = 3
    revert_after: int = 16
    renewal: float = 0.2


@dataclass(frozen=True)
class WeakConfig:
    """Settings of the weak-form identifier, as in weak.h.

    The estimator's start, start_sd and bounds have four entries when the encoder's zero is unknown, else three, and two
    more with friction;
    its row_weight and correlation come from the design.
    """

    sample_rate: float
    l1: float
    design: WeakTables
    estimator: EstimatorConfig
    zero_unknown: bool = True
    iterations: int = 3
    full_angle: bool = False
    friction: bool = False
    passes: int = 3
    drive_min: float = 0.0
    pivot_noise: float = 0.0
    angle_limit: float = 0.0
    trust: TrustConfig = field(default_factory=TrustConfig)
    gate: GateConfig = field(default_factory=GateConfig)

    @property
    def hop(self) -> int:
        """Decimated samples from the start of a window to the start of the next."""
        return (self.design.window - 1) // 2

    @property
    def delay(self) -> int:
        """Ticks between a sample and the smoothed value that refers to its instant."""
        return (self.design.taps - 1) // 2


@dataclass
class Record:
    """What a replay left, one entry a tick.

    p float32 [ticks, n_p], the estimator's; published and its standard errors likewise, of the weak form (else empty);
    sums float32 [ticks, n_moments + n_theta + 2] (M, B, yy, weight);
    reason uint8 [ticks]; hash uint32 [ticks]; estimate: structured [ticks / estimate_every].
    """

    p: Float32
    published: Float32
    published_se: Float32
    sums: Float32
    reason: npt.NDArray[np.uint8]
    hash: npt.NDArray[np.uint32]
    estimate: npt.NDArray[np.void]
    estimate_every: int


def _struct_layout() -> list[int]:
    """The same list as pvid_native_layout in host/native/replay.c."""

    def at(struct: type[ctypes.Structure], name: str) -> int:
        return int(getattr(struct, name).offset)

    return [
        ctypes.sizeof(FirBankStruct),
        at(FirBankStruct, "weights"),
        ctypes.sizeof(EstimatorConfigStruct),
        at(EstimatorConfigStruct, "start"),
        at(EstimatorConfigStruct, "row_sd"),
        at(EstimatorConfigStruct, "noise_margin"),
        at(EstimatorConfigStruct, "dead_zone"),
        at(EstimatorConfigStruct, "law"),
        at(EstimatorConfigStruct, "divider"),
        ctypes.sizeof(StrongConfigStruct),
        at(StrongConfigStruct, "drive_min"),
        at(StrongConfigStruct, "bank"),
        at(StrongConfigStruct, "gate"),
        at(StrongConfigStruct, "estimator"),
        ctypes.sizeof(WeakDesignStruct),
        at(WeakDesignStruct, "smooth"),
        at(WeakDesignStruct, "overlap"),
        at(WeakDesignStruct, "lag"),
        ctypes.sizeof(WeakConfigStruct),
        at(WeakConfigStruct, "drive_min"),
        at(WeakConfigStruct, "pivot_noise"),
        at(WeakConfigStruct, "design"),
        at(WeakConfigStruct, "angle"),
        at(WeakConfigStruct, "passes"),
        at(WeakConfigStruct, "zero_unknown"),
        at(WeakConfigStruct, "iterations"),
        at(WeakConfigStruct, "estimator"),
        at(WeakConfigStruct, "trust"),
        at(WeakConfigStruct, "gate"),
        ctypes.sizeof(TrustConfigStruct),
        at(TrustConfigStruct, "groups_min"),
        at(TrustConfigStruct, "renewal"),
        ctypes.sizeof(CountersStruct),
        ctypes.sizeof(EstimateStruct),
        at(EstimateStruct, "kappa"),
    ]


def default_library() -> Path:
    """Where the build leaves the shared library; PVID_NATIVE_LIBRARY overrides it."""
    named = os.environ.get("PVID_NATIVE_LIBRARY")
    if named:
        return Path(named)
    return Path(__file__).resolve().parents[4] / "build" / "host" / "host" / "native" / "libpvid_native.so"


class Native:
    """One build of the C core.

    Parameters
    ----------
    path
        The shared library; by default the one tools/pvid builds.

    Raises
    ------
    PvidError
        When the library is missing or was built from other headers than this module mirrors.
    """

    def __init__(self, path: Path | None = None) -> None:
        path = path or default_library()
        try:
            self._lib = ctypes.CDLL(str(path))
        except OSError as error:
            raise PvidError(f"cannot load the C core {path}: {error}; build it with ./tools/pvid") from error
        self._lib.pvid_native_build.restype = ctypes.c_char_p
        length = ctypes.c_uint32.in_dll(self._lib, "pvid_native_layout_length").value
        layout = list((ctypes.c_uint32 * length).in_dll(self._lib, "pvid_native_layout"))
        mirrored = _struct_layout()
        sizes, bounds = layout[len(mirrored) : -4], layout[-4:]
        if layout[: len(mirrored)] != mirrored or bounds != [MAX_P, MAX_THETA, MAX_SUMS, MAX_WINDOW]:
            raise PvidError(f"the C core {path} was built with other struct sizes than this package: {layout}")
        self._estimator_size, self._counters_at = sizes[:2]
        self._strong_size, self._estimator_at = sizes[2:4]
        self._weak_size, self._weak_estimator_at, self._published_at, self._is_published_at = sizes[4:8]
        (self._angle_size,) = sizes[8:]

    @property
    def library(self) -> ctypes.CDLL:
        """The shared library, for modules that bind more of it."""
        return self._lib

    @property
    def build(self) -> str:
        """Compiler and flags of this build."""
        return str(self._lib.pvid_native_build().decode())

    def arithmetic_faults(self) -> int:
        """pvid_arithmetic_faults_f32: 0 when float32 behaves as the bits need."""
        return int(self._lib.pvid_arithmetic_faults_f32())

    def strong(self, config: StrongConfig) -> StrongIdentifier:
        """An initialised strong-form identifier."""
        return StrongIdentifier(self, config)

    def weak(self, config: WeakConfig) -> WeakIdentifier:
        """An initialised weak-form identifier."""
        return WeakIdentifier(self, config)

    def estimator(self, config: EstimatorConfig, update_rate: float) -> RowEstimator:
        """An initialised estimator of the strong form that is fed rows."""
        return RowEstimator(self, config, update_rate)

    def strong_rows(self, phi: npt.ArrayLike, u: npt.ArrayLike) -> tuple[Float32, Float32]:
        """Rows of the strong form: N [ticks, 11], Y [ticks] from phi [ticks, 5], u [ticks, 3]."""
        phi32 = np.ascontiguousarray(phi, np.float32)
        u32 = np.ascontiguousarray(u, np.float32)
        n = np.empty((len(phi32), MAX_THETA), np.float32)
        y = np.empty(len(phi32), np.float32)
        self._lib.pvid_replay_strong_rows_f32(
            ctypes.c_uint32(len(phi32)), _pointer(phi32), _pointer(u32), _pointer(n), _pointer(y)
        )
        return n, y

    def physical(self, estimate: npt.NDArray[np.void], l1: float) -> tuple[Float32, Float32] | None:
        """pvid_kapitza_physical_f32: (g, l2, rho2) and standard errors, None outside the physical region."""
        one = np.ascontiguousarray(estimate, ESTIMATE_DTYPE)
        value = np.empty(3, np.float32)
        se = np.empty(3, np.float32)
        function = self._lib.pvid_kapitza_physical_f32
        function.restype = ctypes.c_bool
        ok = function(_pointer(one), ctypes.c_float(l1), _pointer(value), _pointer(se))
        return (value, se) if ok else None


def _pointer(array: npt.NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _estimator_struct(config: EstimatorConfig) -> EstimatorConfigStruct:
    struct = EstimatorConfigStruct()
    for name in ("start", "start_sd", "lower", "upper"):
        values = np.asarray(getattr(config, name), np.float32)
        getattr(struct, name)[: len(values)] = [float(v) for v in values]
    scalars = ("row_sd", "forgetting_s", "feedback_hz", "correlation", "row_weight", "step_limit")
    for name in (*scalars, "kappa_min", "noise_margin", "dead_zone"):
        setattr(struct, name, float(getattr(config, name)))
    struct.law = int(config.law)
    struct.divider = config.divider
    return struct


Tables = dict[str, Float32]


def _table_pointers(tables: Tables) -> dict[str, Any]:
    return {name: table.ctypes.data_as(ctypes.POINTER(ctypes.c_float)) for name, table in tables.items()}


def strong_config_struct(config: StrongConfig) -> tuple[StrongConfigStruct, Tables]:
    """pvid_strong_config_f32 and the tables it points to, by field; they must live as long as the struct."""
    tables = {"weights": np.ascontiguousarray(config.weights, np.float32)}
    struct = StrongConfigStruct(
        sample_rate_hz=config.sample_rate,
        l1=config.l1,
        drive_min=config.drive_min,
        bank=FirBankStruct(half=config.half, stride=config.stride, **_table_pointers(tables)),
        gate=GateConfigStruct(**asdict(config.gate)),
        estimator=_estimator_struct(config.estimator),
    )
    return struct, tables


def weak_config_struct(config: WeakConfig) -> tuple[WeakConfigStruct, Tables]:
    """pvid_weak_config_f32 and the tables its design points to, by field; they must live as long as the struct."""
    design = config.design
    names = ("smooth", "second", "chi", "gram")
    tables = {name: np.ascontiguousarray(getattr(design, name), np.float32) for name in names}
    design_struct = WeakDesignStruct(
        taps=design.taps,
        decimation=design.decimation,
        window=design.window,
        functions=design.functions,
        overlap=float(design.overlap),
        lag=design.lag,
        **_table_pointers(tables),
    )
    struct = WeakConfigStruct(
        sample_rate_hz=config.sample_rate,
        l1=config.l1,
        drive_min=config.drive_min,
        pivot_noise=config.pivot_noise,
        angle_limit=config.angle_limit,
        design=ctypes.pointer(design_struct),
        full_angle=config.full_angle,
        friction=config.friction,
        passes=config.passes,
        zero_unknown=config.zero_unknown,
        iterations=config.iterations,
        estimator=_estimator_struct(config.estimator),
        trust=TrustConfigStruct(**asdict(config.trust)),
        gate=GateConfigStruct(**asdict(config.gate)),
    )
    return struct, tables


RecordT = TypeVar("RecordT")


class Stepper(ABC, Generic[RecordT]):
    """An initialised object of the core in C memory, stepped through runs.

    Its state persists between calls of `run`, so a run may come in pieces.

    A class of identifiers names the replay function that steps it, the type of its samples and that of its estimates.
    """

    REPLAY: ClassVar[str]
    SAMPLE: ClassVar[type[np.generic]]
    ASSESS: ClassVar[str]
    ESTIMATE: ClassVar[np.dtype[np.void]]

    def __init__(
        self, native: Native, init: str, config: ctypes.Structure, size: int, estimator_at: int, counters_at: int
    ) -> None:
        """Runs the C function `init` on `size` bytes; what `config` points to must outlive this object."""
        self.native = native
        self._config = config
        self._estimator_at = estimator_at
        self._counters_at = estimator_at + counters_at
        self._hash = np.array([0x811C9DC5], np.uint32)
        self._state: Any = ctypes.create_string_buffer(size)
        status = Status(getattr(native.library, init)(self._state, ctypes.byref(config)))
        if status is not Status.OK:
            raise PvidError(f"the core refused the configuration: {status.name.lower().replace('_', ' ')}")

    @abstractmethod
    def _recording(self, ticks: int, sums: bool, hashes: bool, estimate_every: int) -> tuple[RecordT, ctypes.Structure]:
        """An empty record and the C struct that points to it."""

    def run(
        self,
        first: npt.ArrayLike,
        second: npt.ArrayLike,
        *,
        sums: bool = True,
        hashes: bool = True,
        estimate_every: int = 0,
    ) -> RecordT:
        """Steps through phi and y, both [ticks], or rows N [ticks, n_theta] and Y [ticks].

        Floats are converted to float32 as a board would read them; the fixed-point core takes counts.
        """
        one = np.ascontiguousarray(first, self.SAMPLE)
        other = np.ascontiguousarray(second, self.SAMPLE)
        record, struct = self._recording(len(other), sums, hashes, estimate_every)
        replay = getattr(self.native.library, self.REPLAY)
        replay(self._state, ctypes.c_uint32(len(other)), _pointer(one), _pointer(other), ctypes.byref(struct))
        return record

    @property
    def state(self) -> Any:
        """The identifier's state block, for modules that bind more of the core."""
        return self._state

    @property
    def config_struct(self) -> Any:
        """The configuration it was initialised with, likewise."""
        return self._config

    @property
    def running_hash(self) -> int:
        """FNV-1a after the last recorded tick."""
        return int(self._hash[0])

    @property
    def counters(self) -> dict[str, int]:
        """pvid_counters by name."""
        struct = CountersStruct.from_buffer(self._state, self._counters_at)
        return {name: int(getattr(struct, name)) for name, *_ in CountersStruct._fields_}

    def assess(self) -> npt.NDArray[np.void]:
        """Standard errors and kappa at the present state, dtype ESTIMATE, shape ()."""
        out = np.empty((), self.ESTIMATE)
        estimator = ctypes.c_void_p(ctypes.addressof(self._state) + self._estimator_at)
        getattr(self.native.library, self.ASSESS)(estimator, _pointer(out))
        return out


class Freezable(Stepper[RecordT]):
    """With a function that freezes it."""

    FREEZE: ClassVar[str]

    def freeze(self, frozen: bool) -> None:
        """Takes nothing in, or goes on."""
        getattr(self.native.library, self.FREEZE)(self._state, ctypes.c_bool(frozen))


class _FloatStepper(Stepper[Record]):
    """With records of float32."""

    SAMPLE = np.float32
    ASSESS = "pvid_estimator_assess_f32"
    ESTIMATE = ESTIMATE_DTYPE
    n_p = 3
    n_sums = 45 + MAX_THETA + 2
    publishes = False

    def _recording(self, ticks: int, sums: bool, hashes: bool, estimate_every: int) -> tuple[Record, RecordStruct]:
        estimates = -(-ticks // estimate_every) if estimate_every else 0
        record = Record(
            p=np.empty((ticks, self.n_p), np.float32),
            published=np.empty((ticks if self.publishes else 0, self.n_p), np.float32),
            published_se=np.empty((ticks if self.publishes else 0, self.n_p), np.float32),
            sums=np.empty((ticks if sums else 0, self.n_sums), np.float32),
            reason=np.empty(ticks, np.uint8),
            hash=np.empty(ticks if hashes else 0, np.uint32),
            estimate=np.empty(estimates, ESTIMATE_DTYPE),
            estimate_every=estimate_every,
        )
        struct = RecordStruct(
            p=record.p.ctypes.data,
            published=record.published.ctypes.data if self.publishes else None,
            published_se=record.published_se.ctypes.data if self.publishes else None,
            sums=record.sums.ctypes.data if sums else None,
            reason=record.reason.ctypes.data,
            hash=record.hash.ctypes.data if hashes else None,
            running_hash=self._hash.ctypes.data,
            estimate=record.estimate.ctypes.data if estimates else None,
            estimate_every=estimate_every,
        )
        return record, struct


class StrongIdentifier(_FloatStepper, Freezable[Record]):
    """pvid_strong_f32: phi [rad], y [m]."""

    REPLAY = "pvid_replay_strong_f32"
    FREEZE = "pvid_strong_freeze_f32"

    def __init__(self, native: Native, config: StrongConfig) -> None:
        struct, self._tables = strong_config_struct(config)
        size, at = native._strong_size, native._estimator_at
        super().__init__(native, "pvid_strong_init_f32", struct, size, at, native._counters_at)


class WeakIdentifier(_FloatStepper, Freezable[Record]):
    """pvid_weak_f32: phi [rad], y [m]."""

    REPLAY = "pvid_replay_weak_f32"
    FREEZE = "pvid_weak_freeze_f32"
    publishes = True

    def __init__(self, native: Native, config: WeakConfig) -> None:
        self.n_p, n_theta = (4, 8) if config.zero_unknown else (3, 5)
        if config.friction:
            self.n_p, n_theta = 6, 10
        self.n_sums = n_theta * (n_theta + 1) // 2 + n_theta + 2
        struct, self._tables = weak_config_struct(config)
        self._angle = ctypes.create_string_buffer(native._angle_size)
        struct.angle = ctypes.addressof(self._angle)
        size, at = native._weak_size, native._weak_estimator_at
        super().__init__(native, "pvid_weak_init_f32", struct, size, at, native._counters_at)

    @property
    def published(self) -> npt.NDArray[np.void] | None:
        """pvid_weak_estimate_f32, dtype ESTIMATE_DTYPE, shape (); None until an estimate has been trusted."""
        if not self._state[self.native._is_published_at][0]:
            return None
        return self.estimate

    @property
    def estimate(self) -> npt.NDArray[np.void]:
        """pvid_weak_estimate_f32, dtype ESTIMATE_DTYPE, shape (): the start until an estimate has been trusted."""
        place = self.native._published_at
        raw = self._state[place : place + ESTIMATE_DTYPE.itemsize]
        return np.frombuffer(raw, ESTIMATE_DTYPE)[0].copy()  # type: ignore[no-any-return]

    @property
    def misfit(self) -> float:
        """Variance of the residuals behind the estimate over what the sensors' noise explains; NaN: not judged."""
        return float(self.estimate["misfit"]) or math.nan

    def gap(self) -> None:
        """pvid_weak_gap_f32: samples are missing before the next call of `run`."""
        self.native._lib.pvid_weak_gap_f32(self._state)


class RowEstimator(_FloatStepper):
    """pvid_estimator_f32 on the strong form's model, fed rows."""

    REPLAY = "pvid_replay_rows_f32"

    def __init__(self, native: Native, config: EstimatorConfig, update_rate: float) -> None:
        struct = _estimator_struct(config)
        struct.model = ctypes.addressof(ctypes.c_char.in_dll(native._lib, "pvid_kapitza_strong_f32"))
        struct.update_rate_hz = update_rate
        super().__init__(native, "pvid_estimator_init_f32", struct, native._estimator_size, 0, native._counters_at)


def chunks(ticks: int, size: int) -> Iterator[slice]:
    """Slices that cover range(ticks) in pieces of at most `size`."""
    for start in range(0, ticks, size):
        yield slice(start, min(start + size, ticks))
