"""The shipped fixed-point core, called through the same shared library as native.py; settings of its identifiers.

The structs of the public headers are mirrored here; sizes and offsets are checked when an identifier is made.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.errors import PvidError
from pvid.native import MAX_P, CountersStruct, Native, Status
from pvid.weak_design_q31 import TERMS, WeakTablesQ31

Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]

MAX_THETA = 11
GRAMS = 6


@dataclass(frozen=True)
class EstimatorConfigQ31:
    """Settings of the fixed-point estimator, as in estimator_q31.h.

    p in the formats p_bits, Y and N in y_bits and n_bits; row_sd in 2^-8 of Y's unit; correlation, row_weight and
    step_limit in Q16, gain and kappa_min in Q30.
    """

    start: tuple[int, ...]
    start_sd: tuple[int, ...]
    lower: tuple[int, ...]
    upper: tuple[int, ...]
    p_bits: tuple[int, ...]
    n_bits: tuple[int, ...]
    y_bits: int
    row_sd: int
    forgetting_groups: int = 0
    gain: int = 2**30
    correlation: int = 2**16
    row_weight: int = 2**16
    step_limit: int = 19661
    kappa_min: int = 10737
    divider: int = 1


@dataclass(frozen=True)
class WeakConfigQ31:
    """Settings of the fixed-point weak-form identifier, as in weak_q31.h; offsets in counts, drive_min in U's unit."""

    design: WeakTablesQ31
    estimator: EstimatorConfigQ31
    phi_offset: int = 0
    y_offset: int = 0
    drive_min: int = 0
    zero_unknown: bool = True
    iterations: int = 3

    @property
    def hop(self) -> int:
        """Decimated samples from the start of a window to the start of the next."""
        return (self.design.window - 1) // 2


class EstimatorConfigStruct(ctypes.Structure):
    """pvid_estimator_config_q31."""

    _fields_ = [
        ("model", ctypes.c_void_p),
        ("start", ctypes.c_int32 * MAX_P),
        ("start_sd", ctypes.c_int32 * MAX_P),
        ("lower", ctypes.c_int32 * MAX_P),
        ("upper", ctypes.c_int32 * MAX_P),
        ("p_bits", ctypes.c_int8 * MAX_P),
        ("n_bits", ctypes.c_int8 * MAX_THETA),
        ("y_bits", ctypes.c_int8),
        ("row_sd", ctypes.c_int32),
        ("forgetting_groups", ctypes.c_uint32),
        ("gain", ctypes.c_int32),
        ("correlation", ctypes.c_uint32),
        ("row_weight", ctypes.c_uint32),
        ("step_limit", ctypes.c_uint32),
        ("kappa_min", ctypes.c_int32),
        ("divider", ctypes.c_uint16),
    ]


class WeakDesignStruct(ctypes.Structure):
    """pvid_weak_design_q31."""

    _fields_ = [
        ("taps", ctypes.c_uint16),
        ("decimation", ctypes.c_uint16),
        ("window", ctypes.c_uint16),
        ("functions", ctypes.c_uint8),
        ("smooth_bits", ctypes.c_uint8),
        ("phi_shift", ctypes.c_uint8),
        ("u_shift", ctypes.c_uint8),
        ("uf_shift", ctypes.c_uint8),
        ("integral_shift", ctypes.c_uint8 * 3),
        ("high_shift", ctypes.c_uint8 * 2),
        ("product_shift", ctypes.c_uint8 * 5),
        ("sum_shift", ctypes.c_uint8),
        ("shift", ctypes.c_uint8 * TERMS),
        ("gram_bits", ctypes.c_int8 * GRAMS),
        ("phi_max", ctypes.c_int32),
        ("y_max", ctypes.c_int32),
        ("u_max", ctypes.c_int32),
        ("smooth", ctypes.c_void_p),
        ("second", ctypes.c_void_p),
        ("chi", ctypes.c_void_p),
        ("multiplier", ctypes.c_void_p),
        ("gram", ctypes.c_void_p),
    ]


class WeakConfigStruct(ctypes.Structure):
    """pvid_weak_config_q31."""

    _fields_ = [
        ("design", ctypes.POINTER(WeakDesignStruct)),
        ("phi_offset", ctypes.c_int32),
        ("y_offset", ctypes.c_int32),
        ("drive_min", ctypes.c_int32),
        ("zero_unknown", ctypes.c_bool),
        ("iterations", ctypes.c_uint8),
        ("estimator", EstimatorConfigStruct),
    ]


class RecordStruct(ctypes.Structure):
    """pvid_record_q31 of host/native/replay_q31.h."""

    _fields_ = [
        (name, ctypes.c_void_p) for name in ("p", "sums", "exponent", "reason", "hash", "running_hash", "estimate")
    ] + [("estimate_every", ctypes.c_uint32)]


class ScaleStruct(ctypes.Structure):
    """pvid_kapitza_scale_q31."""

    _fields_ = [
        ("l1", ctypes.c_int32),
        ("g_multiplier", ctypes.c_int32),
        ("g_shift", ctypes.c_int8),
        ("d1_bits", ctypes.c_int8),
        ("d2_bits", ctypes.c_int8),
    ]


ESTIMATE_DTYPE = np.dtype(
    [
        ("p", np.int32, (MAX_P,)),
        ("se", np.int32, (MAX_P,)),
        ("correlation", np.int32, (MAX_P, MAX_P)),
        ("kappa", np.int32),
        ("residual_sd", np.int32),
        ("weight", np.uint32),
    ]
)


@dataclass(frozen=True)
class ScaleQ31:
    """What turns an estimate into metres, as in kapitza_q31.h."""

    l1: int
    g_multiplier: int
    g_shift: int
    d1_bits: int
    d2_bits: int


def physical_q31(native: Native, estimate: npt.NDArray[np.void], scale: ScaleQ31) -> tuple[Int32, Int32] | None:
    """pvid_kapitza_physical_q31: (g, l2, rho2) and standard errors in 2^-24, None outside the physical region."""
    one = np.ascontiguousarray(estimate, ESTIMATE_DTYPE)
    value, se = np.empty(3, np.int32), np.empty(3, np.int32)
    struct = ScaleStruct(scale.l1, scale.g_multiplier, scale.g_shift, scale.d1_bits, scale.d2_bits)
    function = native.library.pvid_kapitza_physical_q31
    function.restype = ctypes.c_bool
    places = [ctypes.c_void_p(array.ctypes.data) for array in (value, se)]
    return (value, se) if function(ctypes.c_void_p(one.ctypes.data), ctypes.byref(struct), *places) else None


@dataclass
class RecordQ31:
    """What a replay left, one entry a tick: p int32 [ticks, n_p], sums int64 [ticks, n_sums] and their exponent,
    reason, hash; estimate: structured [ticks / estimate_every]."""

    p: Int32
    sums: Int64
    exponent: npt.NDArray[np.uint8]
    reason: npt.NDArray[np.uint8]
    hash: npt.NDArray[np.uint32]
    estimate: npt.NDArray[np.void]


def _checked_layout(native: Native) -> list[int]:
    """Sizes and offsets that only C knows: of the estimator, its counters, the weak form, its estimator."""
    length = ctypes.c_uint32.in_dll(native.library, "pvid_native_layout_q31_length").value
    layout = list((ctypes.c_uint32 * length).in_dll(native.library, "pvid_native_layout_q31"))
    mirrored = [
        ctypes.sizeof(EstimatorConfigStruct),
        EstimatorConfigStruct.p_bits.offset,
        EstimatorConfigStruct.row_sd.offset,
        EstimatorConfigStruct.divider.offset,
        ctypes.sizeof(WeakDesignStruct),
        WeakDesignStruct.shift.offset,
        WeakDesignStruct.phi_max.offset,
        WeakDesignStruct.gram.offset,
        ctypes.sizeof(WeakConfigStruct),
        WeakConfigStruct.zero_unknown.offset,
        WeakConfigStruct.estimator.offset,
        ESTIMATE_DTYPE.itemsize,
        int(ESTIMATE_DTYPE.fields["kappa"][1]) if ESTIMATE_DTYPE.fields else 0,
    ]
    if layout[: len(mirrored)] != mirrored or layout[-2:] != [MAX_P, MAX_THETA]:
        raise PvidError(f"the fixed-point core was built with other struct sizes than this package: {layout}")
    return layout[len(mirrored) : -2]


def estimator_struct(config: EstimatorConfigQ31) -> EstimatorConfigStruct:
    """The C struct of a configuration, without its model."""
    struct = EstimatorConfigStruct()
    for name in ("start", "start_sd", "lower", "upper", "p_bits", "n_bits"):
        values = getattr(config, name)
        getattr(struct, name)[: len(values)] = values
    for name in ("y_bits", "row_sd", "forgetting_groups", "gain", "correlation", "row_weight", "step_limit"):
        setattr(struct, name, getattr(config, name))
    struct.kappa_min = config.kappa_min
    struct.divider = config.divider
    return struct


@dataclass
class _Stepper:
    """A state block in C memory and the replay function that steps it."""

    native: Native
    n_p: int
    n_theta: int
    _hash: npt.NDArray[np.uint32] = field(default_factory=lambda: np.array([0x811C9DC5], np.uint32))
    _state: Any = None
    _estimator_at: int = 0
    _counters_at: int = 0

    def _initialised(self, size: int, init: str, struct: ctypes.Structure) -> None:
        self._state = ctypes.create_string_buffer(size)
        status = Status(getattr(self.native.library, init)(self._state, ctypes.byref(struct)))
        if status is not Status.OK:
            raise PvidError(f"the core refused the configuration: {status.name.lower().replace('_', ' ')}")

    def _replay(
        self, symbol: str, first: Int32, second: Int32, want_sums: bool, want_hash: bool, estimate_every: int
    ) -> RecordQ31:
        ticks = len(second)
        n_sums = self.n_theta * (self.n_theta + 1) // 2 + self.n_theta + 2
        estimates = -(-ticks // estimate_every) if estimate_every else 0
        record = RecordQ31(
            p=np.empty((ticks, self.n_p), np.int32),
            sums=np.empty((ticks if want_sums else 0, n_sums), np.int64),
            exponent=np.empty(ticks, np.uint8),
            reason=np.empty(ticks, np.uint8),
            hash=np.empty(ticks if want_hash else 0, np.uint32),
            estimate=np.empty(estimates, ESTIMATE_DTYPE),
        )
        struct = RecordStruct(
            p=record.p.ctypes.data,
            sums=record.sums.ctypes.data if want_sums else None,
            exponent=record.exponent.ctypes.data,
            reason=record.reason.ctypes.data,
            hash=record.hash.ctypes.data if want_hash else None,
            running_hash=self._hash.ctypes.data,
            estimate=record.estimate.ctypes.data if estimates else None,
            estimate_every=estimate_every,
        )
        getattr(self.native.library, symbol)(
            self._state,
            ctypes.c_uint32(ticks),
            ctypes.c_void_p(first.ctypes.data),
            ctypes.c_void_p(second.ctypes.data),
            ctypes.byref(struct),
        )
        return record

    @property
    def running_hash(self) -> int:
        """FNV-1a after the last recorded tick."""
        return int(self._hash[0])

    @property
    def counters(self) -> dict[str, int]:
        """pvid_counters by name."""
        struct = CountersStruct.from_buffer(self._state, self._estimator_at + self._counters_at)
        return {name: int(getattr(struct, name)) for name, *_ in CountersStruct._fields_}

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimator_assess_q31 at the present state, dtype ESTIMATE_DTYPE, shape ()."""
        out = np.empty((), ESTIMATE_DTYPE)
        estimator = ctypes.c_void_p(ctypes.addressof(self._state) + self._estimator_at)
        self.native.library.pvid_estimator_assess_q31(estimator, ctypes.c_void_p(out.ctypes.data))
        return out


class WeakIdentifierQ31(_Stepper):
    """pvid_weak_q31. State persists between calls of `run`, so a run may come in pieces."""

    def __init__(self, native: Native, config: WeakConfigQ31) -> None:
        super().__init__(native, *((4, 8) if config.zero_unknown else (3, 5)))
        _, self._counters_at, size, self._estimator_at = _checked_layout(native)
        design = config.design
        kinds = {"smooth": np.int32, "second": np.int32, "chi": np.int16, "multiplier": np.int32, "gram": np.int32}
        self._tables = {name: np.ascontiguousarray(getattr(design, name), kind) for name, kind in kinds.items()}
        self._design = WeakDesignStruct(**{name: table.ctypes.data for name, table in self._tables.items()})
        for name, *_ in WeakDesignStruct._fields_:
            if name in kinds:
                continue
            value = getattr(design, name)
            if isinstance(value, tuple):
                getattr(self._design, name)[:] = value
            else:
                setattr(self._design, name, value)
        struct = WeakConfigStruct(
            design=ctypes.pointer(self._design),
            phi_offset=config.phi_offset,
            y_offset=config.y_offset,
            drive_min=config.drive_min,
            zero_unknown=config.zero_unknown,
            iterations=config.iterations,
            estimator=estimator_struct(config.estimator),
        )
        self._initialised(size, "pvid_weak_init_q31", struct)

    def run(
        self,
        phi: npt.ArrayLike,
        y: npt.ArrayLike,
        *,
        sums: bool = True,
        hashes: bool = True,
        estimate_every: int = 0,
    ) -> RecordQ31:
        """Steps through counts phi and y, both [ticks]."""
        return self._replay(
            "pvid_replay_weak_q31",
            np.ascontiguousarray(phi, np.int32),
            np.ascontiguousarray(y, np.int32),
            sums,
            hashes,
            estimate_every,
        )

    def gap(self) -> None:
        """pvid_weak_gap_q31: samples are missing before the next call of `run`."""
        self.native.library.pvid_weak_gap_q31(self._state)


class RowEstimatorQ31(_Stepper):
    """pvid_estimator_q31 on the weak form's model with its zero unknown, fed rows, a group each."""

    def __init__(self, native: Native, config: EstimatorConfigQ31) -> None:
        super().__init__(native, 4, 8)
        size, self._counters_at, _, _ = _checked_layout(native)
        struct = estimator_struct(config)
        struct.model = ctypes.addressof(ctypes.c_char.in_dll(native.library, "pvid_kapitza_weak_q31"))
        self._initialised(size, "pvid_estimator_init_q31", struct)

    def run(
        self,
        n: npt.ArrayLike,
        y: npt.ArrayLike,
        *,
        sums: bool = True,
        hashes: bool = True,
        estimate_every: int = 0,
    ) -> RecordQ31:
        """Steps through rows N [ticks, 8] and Y [ticks]."""
        return self._replay(
            "pvid_replay_rows_q31",
            np.ascontiguousarray(n, np.int32),
            np.ascontiguousarray(y, np.int32),
            sums,
            hashes,
            estimate_every,
        )
