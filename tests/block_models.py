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
    """pvid_estimator_<core> on a block model, which chooses the core.

    rate: of the groups [Hz], in float32.
    """

    def __init__(
        self,
        native: Native,
        model: BlockModel | BlockModelQ31,
        config: EstimatorConfig | EstimatorConfigQ31,
        rate: float | None = None,
    ) -> None:
        ffi = native.headers.ffi
        real = model.real if isinstance(model, BlockModelQ31) else model
        self._fixed = isinstance(model, BlockModelQ31)
        self.core = "q31" if self._fixed else "f32"
        self.native, self.ffi, self.library = native, ffi, native.library
        self.n_p, self.n_theta = real.n_p, real.n_theta
        self.n_moments = sum((k.stop - k.start) * (k.stop - k.start + 1) // 2 for k in real.kinds)
        self.model = ffi.new(f"pvid_model_{self.core} *")
        self._config = native.headers.filled(f"pvid_estimator_config_{self.core}", config)
        self._config.struct.model = self.model
        self.state = ffi.new(f"pvid_estimator_{self.core} *")
        self._fill(model, real)
        if rate is not None:
            self._config.struct.update_rate_hz = rate
        given = ffi.addressof(self._config.struct)
        assert self._called("init_layout", given, self.library.pvid_layout()) == 0

    def _fill(self, model: BlockModel | BlockModelQ31, real: BlockModel) -> None:
        ffi = self.ffi
        types = "const int32_t *, int64_t *" if self._fixed else "const float *, float *"

        def filled(function: Any) -> Any:
            def call(p: Any, out: Any) -> None:
                values = function(np.array([p[a] for a in range(real.n_p)], np.int64 if self._fixed else np.float32))
                for i, value in enumerate(values):
                    out[i] = value.item()

            return ffi.callback(f"void(*)({types})", call)

        columns, rows = zip(*real.non_zeros, strict=True)
        several = len(real.kind_end) > 1
        self._owned = [ffi.new("uint8_t[]", list(one)) for one in (rows, columns, real.kind_end)]
        self._owned += [filled(model.theta), filled(model.jacobian)]
        self.model.n_theta, self.model.n_p, self.model.n_c = real.n_theta, real.n_p, len(rows)
        self.model.positive = 2**real.n_p - 1
        self.model.n_kinds = len(real.kind_end) if several else 0
        self.model.c_row, self.model.c_column, kind_end, self.model.theta, self.model.jacobian = self._owned
        self.model.kind_end = kind_end if several else ffi.NULL
        if isinstance(model, BlockModelQ31):

            def formats(p_bits: Any, theta_bits: Any, c_bits: Any) -> None:
                for out, values in zip(
                    (theta_bits, c_bits), model.formats([p_bits[a] for a in range(real.n_p)]), strict=True
                ):
                    for i, bits in enumerate(values):
                        out[i] = bits

            self._owned.append(ffi.callback("void(*)(const int8_t *, int16_t *, int16_t *)", formats))
            self.model.formats = self._owned[-1]
        else:
            self.model.n_moments = self.n_moments

    def _called(self, verb: str, *given: Any) -> int:
        return int(getattr(self.library, f"pvid_estimator_{verb}_{self.core}")(self.state, *given))

    def _numbers(self, values: npt.NDArray[Any]) -> Any:
        return self.ffi.new("int32_t[]" if self._fixed else "float[]", np.asarray(values).tolist())

    def add(self, kind: int, n: npt.NDArray[Any], y: float) -> int:
        """Adds a row of a kind; returns the reason."""
        return self._called("add_kind", kind, self._numbers(n), int(y) if self._fixed else float(y))

    def add_to_b(self, g: npt.NDArray[Any], e: Int | None = None) -> int:
        """Adds g [n_theta], in fixed point g 2^e, to b; returns the reason."""
        if e is None:
            return self._called("add_to_b", self._numbers(g))
        scaled = [{"m": int(a), "e": int(b)} for a, b in zip(g, e, strict=True)]
        return self._called("add_to_b", self.ffi.new("pvid_scaled_q31[]", scaled))

    def update(self) -> int:
        """Ends a group; returns the reason."""
        return self._called("update")

    def iterate(self) -> int:
        """A further step; returns the reason."""
        return self._called("iterate")

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimate_<core>, shape ()."""
        out = np.empty((), self.native.headers.dtype(f"pvid_estimate_{self.core}"))
        getattr(self.library, f"pvid_estimator_assess_{self.core}")(self.state, self.native.headers.pointer(out))
        return out

    @property
    def p(self) -> npt.NDArray[Any]:
        """[n_p]"""
        return np.array(list(self.state.p)[: self.n_p], np.int64 if self._fixed else np.float32)

    @property
    def levels(self) -> Float32:
        """In float32 both levels of the sums [2, n_sums]."""
        n = self.n_moments + self.n_theta + 2
        information = self.state.information
        return np.array([list(information.high)[:n], list(information.low)[:n]], np.float32)

    @property
    def sums(self) -> Int:
        """In fixed point [n_sums]."""
        information = self.state.information
        return np.array(list(information.sums)[: information.n_sums], np.int64)

    @property
    def counters(self) -> dict[str, int]:
        """By name."""
        counters = self.state.counters
        return {name: int(getattr(counters, name)) for name, _ in self.ffi.typeof(counters).fields}
