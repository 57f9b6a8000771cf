"""The shipped fixed-point core, called through the same shared library as native.py; settings of its identifiers.

The structs of the public headers are mirrored here; sizes and offsets are checked when an identifier is made.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.native import MAX_P, Freezable, Native, Status, Stepper
from pvid.design.fir_q31 import FirBankQ31
from pvid.design.strong_q31 import RowShiftsQ31, StrongDesignQ31
from pvid.design.weak_q31 import TERMS, WeakTablesQ31

Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]

MAX_THETA = 11
GRAMS = 6

# Models of the core by the lengths of p and theta.
_MODELS = {(4, 8): "pvid_kapitza_weak_q31", (3, 5): "pvid_kapitza_weak_zeroed_q31", (3, 11): "pvid_kapitza_strong_q31"}


@dataclass(frozen=True)
class EstimatorConfigQ31:
    """Settings of the fixed-point estimator, as in estimator_q31.h.

    p in the formats p_bits, Y and N in y_bits and n_bits; row_sd in 2^-8 of Y's unit; correlation, row_weight and
    step_limit, noise_margin and dead_zone in Q16, gain and kappa_min in Q30.
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
    noise_margin: int = 0
    dead_zone: int = 0
    divider: int = 1


@dataclass(frozen=True)
class TrustConfigQ31:
    """Which estimates are published, as in trust_q31.h: kappa_min in Q30, se_max in Q24, misfit_max and renewal in
    Q16."""

    kappa_min: int = 32212
    se_max: int = 838861
    misfit_max: int = 262144
    groups_min: int = 3
    revert_after: int = 16
    renewal: int = 13107


@dataclass(frozen=True)
class GateConfigQ31:
    """Which rows or windows are kept out, as in gate_q31.h: sigmas in Q16, 0: none."""

    sigmas: int = 0
    patience_groups: int = 0


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
    pivot_noise: tuple[int, int] = (0, 0)
    trust: TrustConfigQ31 = TrustConfigQ31()
    gate: GateConfigQ31 = GateConfigQ31()

    @property
    def hop(self) -> int:
        """Decimated samples from the start of a window to the start of the next."""
        return (self.design.window - 1) // 2


@dataclass(frozen=True)
class StrongConfigQ31:
    """Settings of the fixed-point strong-form identifier, as in strong_q31.h: counts, and drive_min in u's unit."""

    design: StrongDesignQ31
    estimator: EstimatorConfigQ31
    drive_ticks: int
    phi_offset: int = 0
    y_offset: int = 0
    drive_min: int = 0
    gate: GateConfigQ31 = GateConfigQ31()


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
        ("noise_margin", ctypes.c_uint32),
        ("dead_zone", ctypes.c_uint32),
        ("divider", ctypes.c_uint16),
    ]


class ScaledStruct(ctypes.Structure):
    """pvid_scaled_q31."""

    _fields_ = [("m", ctypes.c_int32), ("e", ctypes.c_int32)]


class TrustConfigStruct(ctypes.Structure):
    """pvid_trust_config_q31."""

    _fields_ = [
        ("kappa_min", ctypes.c_int32),
        ("se_max", ctypes.c_int32),
        ("misfit_max", ctypes.c_uint32),
        ("groups_min", ctypes.c_uint16),
        ("revert_after", ctypes.c_uint16),
        ("renewal", ctypes.c_uint32),
    ]


class GateConfigStruct(ctypes.Structure):
    """pvid_gate_config_q31."""

    _fields_ = [("sigmas", ctypes.c_uint32), ("patience_groups", ctypes.c_uint32)]


class WeakDesignStruct(ctypes.Structure):
    """pvid_weak_design_q31."""

    _fields_ = [
        ("taps", ctypes.c_uint16),
        ("decimation", ctypes.c_uint16),
        ("window", ctypes.c_uint16),
        ("functions", ctypes.c_uint8),
        ("lag", ctypes.c_uint8),
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
        ("pivot_noise", ScaledStruct),
        ("estimator", EstimatorConfigStruct),
        ("trust", TrustConfigStruct),
        ("gate", GateConfigStruct),
    ]


class FirBankStruct(ctypes.Structure):
    """pvid_fir_bank_q31."""

    _fields_ = [
        ("half", ctypes.c_uint16),
        ("stride", ctypes.c_uint16),
        ("phi_max", ctypes.c_int32),
        ("y_max", ctypes.c_int32),
        ("centre", ctypes.c_int32),
        ("phi_shift", ctypes.c_uint8 * 5),
        ("y_shift", ctypes.c_uint8 * 3),
        ("weights", ctypes.c_void_p),
    ]


class RowShiftsStruct(ctypes.Structure):
    """pvid_strong_row_q31."""

    _fields_ = [
        ("n_a", ctypes.c_uint8),
        ("n_e", ctypes.c_uint8),
        ("n_phi2", ctypes.c_uint8 * 4),
        ("n_phi0", ctypes.c_uint8 * 5),
        ("part", ctypes.c_uint8),
        ("y", ctypes.c_uint8),
    ]


class StrongConfigStruct(ctypes.Structure):
    """pvid_strong_config_q31."""

    _fields_ = [
        ("bank", FirBankStruct),
        ("row", RowShiftsStruct),
        ("u_multiplier", ctypes.c_int32),
        ("u_shift", ctypes.c_uint8),
        ("phi_offset", ctypes.c_int32),
        ("y_offset", ctypes.c_int32),
        ("drive_min", ctypes.c_int32),
        ("drive_ticks", ctypes.c_uint32),
        ("gate", GateConfigStruct),
        ("estimator", EstimatorConfigStruct),
    ]


class RecordStruct(ctypes.Structure):
    """pvid_record_q31 of host/native/replay_q31.h."""

    _fields_ = [
        (name, ctypes.c_void_p)
        for name in (
            *("p", "sums", "exponent", "reason", "hash", "running_hash"),
            *("published", "published_se", "estimate"),
        )
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
        ("least_pivot", np.int32),
        ("residual_sd", np.int32),
        ("weight", np.uint32),
        ("misfit", np.int32),
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
    reason, hash; published and published_se: p as published and its standard errors, like p, of the weak form (else
    empty); estimate: structured
    [ticks / estimate_every], the published one in the weak form."""

    p: Int32
    sums: Int64
    exponent: npt.NDArray[np.uint8]
    reason: npt.NDArray[np.uint8]
    hash: npt.NDArray[np.uint32]
    published: Int32
    published_se: Int32
    estimate: npt.NDArray[np.void]


class _Layout(NamedTuple):
    """Sizes and offsets that only C knows."""

    estimator_size: int
    counters_at: int  # in the estimator
    weak_size: int
    weak_estimator_at: int
    weak_trust_at: int
    weak_is_published_at: int
    weak_published_at: int
    differentiator_size: int
    strong_size: int
    strong_estimator_at: int


def _checked_layout(native: Native) -> _Layout:
    """What the C core says of its structs, after comparing it with those mirrored here."""
    length = ctypes.c_uint32.in_dll(native.library, "pvid_native_layout_q31_length").value
    layout = list((ctypes.c_uint32 * length).in_dll(native.library, "pvid_native_layout_q31"))
    mirrored = [
        ctypes.sizeof(EstimatorConfigStruct),
        EstimatorConfigStruct.p_bits.offset,
        EstimatorConfigStruct.row_sd.offset,
        EstimatorConfigStruct.dead_zone.offset,
        EstimatorConfigStruct.divider.offset,
        ctypes.sizeof(WeakDesignStruct),
        WeakDesignStruct.shift.offset,
        WeakDesignStruct.phi_max.offset,
        WeakDesignStruct.gram.offset,
        ctypes.sizeof(WeakConfigStruct),
        WeakConfigStruct.zero_unknown.offset,
        WeakConfigStruct.estimator.offset,
        WeakConfigStruct.trust.offset,
        WeakConfigStruct.gate.offset,
        ctypes.sizeof(FirBankStruct),
        FirBankStruct.phi_shift.offset,
        FirBankStruct.weights.offset,
        ctypes.sizeof(StrongConfigStruct),
        StrongConfigStruct.u_multiplier.offset,
        StrongConfigStruct.drive_ticks.offset,
        StrongConfigStruct.gate.offset,
        StrongConfigStruct.estimator.offset,
        ESTIMATE_DTYPE.itemsize,
        int(ESTIMATE_DTYPE.fields["kappa"][1]) if ESTIMATE_DTYPE.fields else 0,
    ]
    if layout[: len(mirrored)] != mirrored or layout[-2:] != [MAX_P, MAX_THETA]:
        raise PvidError(f"the fixed-point core was built with other struct sizes than this package: {layout}")
    return _Layout(*layout[len(mirrored) : -2])


def estimator_struct(config: EstimatorConfigQ31) -> EstimatorConfigStruct:
    """The C struct of a configuration, without its model."""
    struct = EstimatorConfigStruct()
    for name in ("start", "start_sd", "lower", "upper", "p_bits", "n_bits"):
        values = getattr(config, name)
        getattr(struct, name)[: len(values)] = values
    for name in ("y_bits", "row_sd", "forgetting_groups", "gain", "correlation", "row_weight", "step_limit"):
        setattr(struct, name, getattr(config, name))
    struct.kappa_min = config.kappa_min
    struct.noise_margin = config.noise_margin
    struct.dead_zone = config.dead_zone
    struct.divider = config.divider
    return struct


class _IntegerStepper(Stepper[RecordQ31]):
    """With records of integers; samples are counts."""

    SAMPLE = np.int32
    ASSESS = "pvid_estimator_assess_q31"
    ESTIMATE = ESTIMATE_DTYPE
    publishes = False
    n_p: int
    n_theta: int

    def _recording(self, ticks: int, sums: bool, hashes: bool, estimate_every: int) -> tuple[RecordQ31, RecordStruct]:
        n_sums = self.n_theta * (self.n_theta + 1) // 2 + self.n_theta + 2
        estimates = -(-ticks // estimate_every) if estimate_every else 0
        record = RecordQ31(
            p=np.empty((ticks, self.n_p), np.int32),
            sums=np.empty((ticks if sums else 0, n_sums), np.int64),
            exponent=np.empty(ticks, np.uint8),
            reason=np.empty(ticks, np.uint8),
            hash=np.empty(ticks if hashes else 0, np.uint32),
            published=np.empty((ticks if self.publishes else 0, self.n_p), np.int32),
            published_se=np.empty((ticks if self.publishes else 0, self.n_p), np.int32),
            estimate=np.empty(estimates, ESTIMATE_DTYPE),
        )
        struct = RecordStruct(
            p=record.p.ctypes.data,
            sums=record.sums.ctypes.data if sums else None,
            exponent=record.exponent.ctypes.data,
            reason=record.reason.ctypes.data,
            hash=record.hash.ctypes.data if hashes else None,
            running_hash=self._hash.ctypes.data,
            published=record.published.ctypes.data if self.publishes else None,
            published_se=record.published_se.ctypes.data if self.publishes else None,
            estimate=record.estimate.ctypes.data if estimates else None,
            estimate_every=estimate_every,
        )
        return record, struct


def _fill(struct: ctypes.Structure, values: object, pointers: Mapping[str, object]) -> None:
    """Copies the attributes of the fields' names into a struct; `pointers` are set already."""
    for name, *_ in struct._fields_:
        if name in pointers:
            continue
        value = getattr(values, name)
        if isinstance(value, tuple):
            getattr(struct, name)[:] = value
        else:
            setattr(struct, name, value)


def _gate_struct(config: GateConfigQ31) -> GateConfigStruct:
    return GateConfigStruct(config.sigmas, config.patience_groups)


class WeakIdentifierQ31(_IntegerStepper, Freezable[RecordQ31]):
    """pvid_weak_q31: phi, y in counts."""

    REPLAY = "pvid_replay_weak_q31"
    FREEZE = "pvid_weak_freeze_q31"
    publishes = True

    def __init__(self, native: Native, config: WeakConfigQ31) -> None:
        self.n_p, self.n_theta = (4, 8) if config.zero_unknown else (3, 5)
        layout = _checked_layout(native)
        kinds = {"smooth": np.int32, "second": np.int32, "chi": np.int16, "multiplier": np.int32, "gram": np.int32}
        self._tables = {name: np.ascontiguousarray(getattr(config.design, name), kind) for name, kind in kinds.items()}
        self._design = WeakDesignStruct(**{name: table.ctypes.data for name, table in self._tables.items()})
        _fill(self._design, config.design, self._tables)
        struct = WeakConfigStruct(
            design=ctypes.pointer(self._design),
            phi_offset=config.phi_offset,
            y_offset=config.y_offset,
            drive_min=config.drive_min,
            zero_unknown=config.zero_unknown,
            iterations=config.iterations,
            pivot_noise=ScaledStruct(*config.pivot_noise),
            estimator=estimator_struct(config.estimator),
            gate=_gate_struct(config.gate),
        )
        _fill(struct.trust, config.trust, {})
        self._layout = layout
        size, at = layout.weak_size, layout.weak_estimator_at
        super().__init__(native, "pvid_weak_init_q31", struct, size, at, layout.counters_at)

    @property
    def estimate(self) -> npt.NDArray[np.void]:
        """The published estimate, the start until there is one; dtype ESTIMATE_DTYPE, shape ()."""
        place = self._layout.weak_published_at
        return np.array(np.frombuffer(self._state, ESTIMATE_DTYPE, 1, place)[0])

    @property
    def is_published(self) -> bool:
        """Whether an estimate has been trusted yet."""
        return bool(self._state[self._layout.weak_is_published_at] != b"\x00")

    @property
    def misfit(self) -> float:
        """Variance of the residuals behind the estimate over what the sensors' noise explains; NaN: not judged."""
        return int(self.estimate["misfit"]) / 2.0**16 or math.nan

    def gap(self) -> None:
        """pvid_weak_gap_q31: samples are missing before the next call of `run`."""
        self.native.library.pvid_weak_gap_q31(self._state)


def _bank_struct(bank: FirBankQ31) -> tuple[FirBankStruct, Int32]:
    """The C struct of a bank and the weights it points to."""
    weights = np.ascontiguousarray(bank.weights, np.int32)
    struct = FirBankStruct(weights=weights.ctypes.data)
    _fill(struct, bank, {"weights": weights})
    return struct, weights


def _row_struct(shifts: RowShiftsQ31) -> RowShiftsStruct:
    struct = RowShiftsStruct()
    _fill(struct, shifts, {})
    return struct


class StrongIdentifierQ31(_IntegerStepper, Freezable[RecordQ31]):
    """pvid_strong_q31: phi, y in counts."""

    REPLAY = "pvid_replay_strong_q31"
    FREEZE = "pvid_strong_freeze_q31"
    n_p, n_theta = 3, 11

    def __init__(self, native: Native, config: StrongConfigQ31) -> None:
        layout = _checked_layout(native)
        bank, weights = _bank_struct(config.design.bank)
        self._tables = {"weights": weights}
        struct = StrongConfigStruct(
            bank=bank,
            row=_row_struct(config.design.row),
            u_multiplier=config.design.u_multiplier,
            u_shift=config.design.u_shift,
            phi_offset=config.phi_offset,
            y_offset=config.y_offset,
            drive_min=config.drive_min,
            drive_ticks=config.drive_ticks,
            gate=_gate_struct(config.gate),
            estimator=estimator_struct(config.estimator),
        )
        size, at = layout.strong_size, layout.strong_estimator_at
        super().__init__(native, "pvid_strong_init_q31", struct, size, at, layout.counters_at)

    def gap(self) -> None:
        """pvid_strong_gap_q31: samples are missing before the next call of `run`."""
        self.native.library.pvid_strong_gap_q31(self._state)


class RowEstimatorQ31(_IntegerStepper):
    """pvid_estimator_q31 on one of the core's models, fed rows, a group each."""

    REPLAY = "pvid_replay_rows_q31"

    def __init__(self, native: Native, config: EstimatorConfigQ31) -> None:
        layout = _checked_layout(native)
        self.n_p, self.n_theta = len(config.p_bits), len(config.n_bits)
        struct = estimator_struct(config)
        struct.model = ctypes.addressof(ctypes.c_char.in_dll(native.library, _MODELS[self.n_p, self.n_theta]))
        super().__init__(native, "pvid_estimator_init_q31", struct, layout.estimator_size, 0, layout.counters_at)


def derivatives_q31(
    native: Native, bank: FirBankQ31, phi: npt.ArrayLike, y: npt.ArrayLike
) -> tuple[Int32, Int32, npt.NDArray[np.bool_]]:
    """pvid_differentiator_q31 on counts within full scale: derivatives [ticks, 5] of phi and [ticks, 3] of y after
    every tick, and whether there were any."""
    layout = _checked_layout(native)
    struct, _weights = _bank_struct(bank)
    state = ctypes.create_string_buffer(layout.differentiator_size)
    status = Status(native.library.pvid_differentiator_init_q31(state, ctypes.byref(struct)))
    if status is not Status.OK:
        raise PvidError(f"the core refused the bank: {status.name.lower().replace('_', ' ')}")
    counts = [np.ascontiguousarray(x, np.int32) for x in (phi, y)]
    ticks = len(counts[0])
    out = np.zeros((ticks, 5), np.int32), np.zeros((ticks, 3), np.int32), np.zeros(ticks, np.uint8)
    addresses = [array.ctypes.data for array in counts] + [array.ctypes.data for array in out]
    places = [ctypes.c_void_p(place) for place in addresses]
    native.library.pvid_replay_derivatives_q31(state, ctypes.c_uint32(ticks), *places)
    return out[0], out[1], out[2].astype(np.bool_)


def strong_rows_q31(
    native: Native, shifts: RowShiftsQ31, phi: npt.ArrayLike, u: npt.ArrayLike
) -> tuple[Int32, Int32, npt.NDArray[np.bool_]]:
    """pvid_kapitza_strong_row_q31: N [ticks, 11], Y [ticks] from phi [ticks, 5], u [ticks, 3], and whether they fit."""
    struct = _row_struct(shifts)
    given = [np.ascontiguousarray(x, np.int32) for x in (phi, u)]
    ticks = len(given[0])
    out = np.zeros((ticks, 11), np.int32), np.zeros(ticks, np.int32), np.zeros(ticks, np.uint8)
    addresses = [array.ctypes.data for array in given] + [array.ctypes.data for array in out]
    places = [ctypes.c_void_p(place) for place in addresses]
    native.library.pvid_replay_strong_rows_q31(ctypes.byref(struct), ctypes.c_uint32(ticks), *places)
    return out[0], out[1], out[2].astype(np.bool_)
