"""Random models with several kinds of rows, the same in C (functions of Python behind cffi) and in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.core.native import Native
from pvid.settings.parts import EstimatorConfig
from pvid.settings.q31 import EstimatorConfigQ31

Int = npt.NDArray[np.int64]
Float = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class BlockModel:
    """theta_i = factor_i p_a or factor_i p_a p_b; each parameter occurs in every kind that has room for it.

    kind_end: one past the last theta of each kind. factors of theta: (a, b), b = -1 without a second one.
    """

    kind_end: tuple[int, ...]
    n_p: int
    factor: Float32
    factors: tuple[tuple[int, int], ...]

    @classmethod
    def random(cls, random: np.random.Generator, kind_end: tuple[int, ...], n_p: int) -> BlockModel:
        """Theta that are linear in one parameter each, in turn, and products of two."""
        first = random.permutation(np.arange(kind_end[-1]) % n_p)
        second = np.where(random.random(kind_end[-1]) < 0.4, random.integers(0, n_p, kind_end[-1]), -1)
        factor = random.choice([-1, 1], kind_end[-1]) * random.uniform(0.5, 2, kind_end[-1])
        pairs = tuple((int(a), int(b)) for a, b in zip(first, second, strict=True))
        return cls(kind_end, n_p, factor.astype(np.float32), pairs)

    @property
    def n_theta(self) -> int:
        """Of all kinds."""
        return self.kind_end[-1]

    @property
    def kinds(self) -> tuple[slice, ...]:
        """The theta of each kind."""
        return tuple(slice(a, b) for a, b in zip((0, *self.kind_end), self.kind_end, strict=False))

    @property
    def non_zeros(self) -> tuple[tuple[int, int], ...]:
        """(column, row) of the non-zeros of C in their order."""
        return tuple(sorted({(a, i) for i, pair in enumerate(self.factors) for a in pair if a >= 0}))

    def theta(self, p: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """theta [n_theta, ...] in the type of p [n_p, ...]."""
        one = p.dtype.type(1)
        return np.stack(
            [
                p.dtype.type(factor) * (p[a] * (p[b] if b >= 0 else one))
                for factor, (a, b) in zip(self.factor, self.factors, strict=True)
            ]
        )

    def jacobian(self, p: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Non-zeros of d theta / d p [n_c, ...] in the type of p."""
        out = []
        for column, row in self.non_zeros:
            a, b = self.factors[row]
            other = p[b] if column == a else p[a]
            slope = np.ones_like(p[0]) if b < 0 else (p[a] + p[a] if a == b else other)
            out.append(p.dtype.type(self.factor[row]) * slope)
        return np.stack(out)

    def dense(self, p: Float) -> Float:
        """d theta / d p [n_theta, n_p]."""
        c = np.zeros((self.n_theta, self.n_p))
        for value, (column, row) in zip(self.jacobian(p), self.non_zeros, strict=True):
            c[row, column] = value
        return c

    def whole(self) -> BlockModel:
        """The same theta in rows of one kind."""
        return BlockModel((self.n_theta,), self.n_p, self.factor, self.factors)


@dataclass(frozen=True)
class BlockModelQ31:
    """The same without factors in fixed point: theta_i = +-p_a in format p_bits + 15, or +-p_a p_b 2^-16."""

    real: BlockModel

    @classmethod
    def random(cls, random: np.random.Generator, kind_end: tuple[int, ...], n_p: int) -> BlockModelQ31:
        """As BlockModel.random."""
        real = BlockModel.random(random, kind_end, n_p)
        return cls(replace(real, factor=np.sign(real.factor)))

    def _signs(self) -> Int:
        return self.real.factor.astype(np.int64)

    def theta(self, p: Int) -> Int:
        """theta int64 [n_theta, ...] of p int64 [n_p, ...]."""
        return np.stack(
            [
                sign * (p[a] << 15 if b < 0 else (p[a] * p[b] + (1 << 15)) >> 16)
                for sign, (a, b) in zip(self._signs(), self.real.factors, strict=True)
            ]
        )

    def jacobian(self, p: Int) -> Int:
        """Non-zeros of C int64 [n_c, ...]."""
        out = []
        for column, row in self.real.non_zeros:
            a, b = self.real.factors[row]
            other = (p[b] if column == a else p[a]) << 15
            slope = np.full_like(p[0], 1 << 45) if b < 0 else (2 * other if a == b else other)
            out.append(self._signs()[row] * slope)
        return np.stack(out)

    def formats(self, bits: Sequence[int]) -> tuple[list[int], list[int]]:
        """Formats of theta and of the non-zeros of C."""
        theta = [bits[a] + (15 if b < 0 else bits[b] - 16) for a, b in self.real.factors]
        c = []
        for column, row in self.real.non_zeros:
            a, b = self.real.factors[row]
            c.append(45 if b < 0 else (bits[b] if column == a else bits[a]) + 15)
        return theta, c


class EstimatorInC:
    """pvid_estimator_f32 on a block model."""

    def __init__(self, native: Native, model: BlockModel, config: EstimatorConfig, rate: float) -> None:
        ffi = native.headers.ffi
        self.native, self.ffi, self.library = native, ffi, native.library
        self.n_p, self.n_theta = model.n_p, model.n_theta

        def filled(function: Any) -> Any:
            def call(p: Any, out: Any) -> None:
                values = function(np.array([p[a] for a in range(model.n_p)], np.float32))
                for i, value in enumerate(values):
                    out[i] = float(value)

            return ffi.callback("void(*)(const float *, float *)", call)

        columns, rows = zip(*model.non_zeros, strict=True)
        several = len(model.kind_end) > 1
        self._owned = [
            ffi.new("uint8_t[]", list(rows)),
            ffi.new("uint8_t[]", list(columns)),
            ffi.new("uint8_t[]", list(model.kind_end)),
            filled(model.theta),
            filled(model.jacobian),
        ]
        self.n_moments = sum((k.stop - k.start) * (k.stop - k.start + 1) // 2 for k in model.kinds)
        self.model = ffi.new("pvid_model_f32 *")
        self.model.n_theta, self.model.n_p, self.model.n_c = model.n_theta, model.n_p, len(rows)
        self.model.n_moments, self.model.positive = self.n_moments, 2**model.n_p - 1
        self.model.n_kinds = len(model.kind_end) if several else 0
        self.model.c_row, self.model.c_column, kind_end, self.model.theta, self.model.jacobian = self._owned
        self.model.kind_end = kind_end if several else ffi.NULL
        self._filled = native.headers.filled("pvid_estimator_config_f32", config)
        self._filled.struct.model = self.model
        self._filled.struct.update_rate_hz = rate
        self.state = ffi.new("pvid_estimator_f32 *")
        assert (
            self.library.pvid_estimator_init_layout_f32(
                self.state, ffi.addressof(self._filled.struct), self.library.pvid_layout()
            )
            == 0
        )

    def add(self, kind: int, n: Float32, y: float) -> int:
        """Adds a row of a kind; returns the reason."""
        row = self.ffi.new("float[]", [float(x) for x in n])
        return int(self.library.pvid_estimator_add_kind_f32(self.state, kind, row, float(y)))

    def add_to_b(self, g: Float32) -> int:
        """Adds g [n_theta] to b; returns the reason."""
        return int(self.library.pvid_estimator_add_to_b_f32(self.state, self.ffi.new("float[]", [float(x) for x in g])))

    def update(self) -> int:
        """Ends a group; returns the reason."""
        return int(self.library.pvid_estimator_update_f32(self.state))

    def iterate(self) -> int:
        """A further step; returns the reason."""
        return int(self.library.pvid_estimator_iterate_f32(self.state))

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimate_f32, shape ()."""
        out = np.empty((), self.native.headers.dtype("pvid_estimate_f32"))
        self.library.pvid_estimator_assess_f32(self.state, self.native.headers.pointer(out))
        return out

    @property
    def p(self) -> Float32:
        """[n_p]"""
        return np.array(list(self.state.p)[: self.n_p], np.float32)

    @property
    def levels(self) -> Float32:
        """Both levels of the sums [2, n_sums]."""
        n = self.n_moments + self.n_theta + 2
        information = self.state.information
        return np.array([list(information.high)[:n], list(information.low)[:n]], np.float32)

    @property
    def counters(self) -> dict[str, int]:
        """By name."""
        counters = self.state.counters
        return {name: int(getattr(counters, name)) for name, _ in self.ffi.typeof(counters).fields}


class Q31InC:
    """pvid_estimator_q31 on the model that a pointer points to."""

    def __init__(self, native: Native, model: Any, config: EstimatorConfigQ31) -> None:
        ffi = native.headers.ffi
        self.native, self.ffi, self.library = native, ffi, native.library
        self.n_p = int(model.n_p)
        self._filled = native.headers.filled("pvid_estimator_config_q31", config)
        self._filled.struct.model = model
        self.state = ffi.new("pvid_estimator_q31 *")
        assert (
            self.library.pvid_estimator_init_layout_q31(
                self.state, ffi.addressof(self._filled.struct), self.library.pvid_layout()
            )
            == 0
        )

    def add(self, kind: int, n: Int, y: int) -> int:
        """Adds a row of a kind; returns the reason."""
        row = self.ffi.new("int32_t[]", [int(x) for x in n])
        return int(self.library.pvid_estimator_add_kind_q31(self.state, kind, row, int(y)))

    def add_to_b(self, m: Int, e: Int) -> int:
        """Adds m 2^e [n_theta] to b; returns the reason."""
        g = self.ffi.new("pvid_scaled_q31[]", [{"m": int(a), "e": int(b)} for a, b in zip(m, e, strict=True)])
        return int(self.library.pvid_estimator_add_to_b_q31(self.state, g))

    def update(self) -> int:
        """Ends a group; returns the reason."""
        return int(self.library.pvid_estimator_update_q31(self.state))

    def iterate(self) -> int:
        """A further step; returns the reason."""
        return int(self.library.pvid_estimator_iterate_q31(self.state))

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimate_q31, shape ()."""
        out = np.empty((), self.native.headers.dtype("pvid_estimate_q31"))
        self.library.pvid_estimator_assess_q31(self.state, self.native.headers.pointer(out))
        return out

    @property
    def p(self) -> Int:
        """[n_p]"""
        return np.array(list(self.state.p)[: self.n_p], np.int64)

    @property
    def sums(self) -> Int:
        """[n_sums]"""
        information = self.state.information
        return np.array(list(information.sums)[: information.n_sums], np.int64)

    @property
    def counters(self) -> dict[str, int]:
        """By name."""
        counters = self.state.counters
        return {name: int(getattr(counters, name)) for name, _ in self.ffi.typeof(counters).fields}


class EstimatorQ31InC(Q31InC):
    """pvid_estimator_q31 on a block model."""

    def __init__(self, native: Native, model: BlockModelQ31, config: EstimatorConfigQ31) -> None:
        ffi = native.headers.ffi
        real = model.real

        def filled(function: Any) -> Any:
            def call(p: Any, out: Any) -> None:
                for i, value in enumerate(function(np.array([p[a] for a in range(real.n_p)], np.int64))):
                    out[i] = int(value)

            return ffi.callback("void(*)(const int32_t *, int64_t *)", call)

        def formats(p_bits: Any, theta_bits: Any, c_bits: Any) -> None:
            theta, c = model.formats([p_bits[a] for a in range(real.n_p)])
            for i, bits in enumerate(theta):
                theta_bits[i] = bits
            for k, bits in enumerate(c):
                c_bits[k] = bits

        columns, rows = zip(*real.non_zeros, strict=True)
        several = len(real.kind_end) > 1
        self._owned = [
            ffi.new("uint8_t[]", list(rows)),
            ffi.new("uint8_t[]", list(columns)),
            ffi.new("uint8_t[]", list(real.kind_end)),
            filled(model.theta),
            filled(model.jacobian),
            ffi.callback("void(*)(const int8_t *, int16_t *, int16_t *)", formats),
        ]
        self.model = ffi.new("pvid_model_q31 *")
        self.model.n_theta, self.model.n_p, self.model.n_c = real.n_theta, real.n_p, len(rows)
        self.model.positive = 2**real.n_p - 1
        self.model.n_kinds = len(real.kind_end) if several else 0
        row, column, kind_end, self.model.theta, self.model.jacobian, self.model.formats = self._owned
        self.model.c_row, self.model.c_column = row, column
        self.model.kind_end = kind_end if several else ffi.NULL
        super().__init__(native, self.model, config)
