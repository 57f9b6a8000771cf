"""Tables and formats that a design computes and an identifier is configured with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Int16 = npt.NDArray[np.int16]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]


class Folded:
    """What folded tables [5, half], whose points are `stride` samples apart, span."""

    weights: npt.NDArray[Any]
    stride: int
    block: int = 1  # samples of a point

    @property
    def half(self) -> int:
        """Points on each side of the centre."""
        return int(self.weights.shape[1])

    @property
    def window(self) -> int:
        """Samples from the first to the last, both included."""
        return 2 * self.half * self.stride + self.block

    @property
    def memory(self) -> int:
        """Places of PVID_MAX_WINDOW that they need."""
        points = 2 * self.half * self.stride + 1
        return points + self.block + 2 if self.block > 1 else points

    @property
    def delay(self) -> int:
        """Samples from the newest one back to the instant the derivatives refer to."""
        return self.half * self.stride + (self.block - 1) // 2


class WeakSizes(Protocol):
    """Sizes of a weak-form design, or of its tables in either arithmetic."""

    @property
    def taps(self) -> int:
        """Length of the front end's filters [samples]."""

    @property
    def decimation(self) -> int:
        """Samples per decimated sample."""

    @property
    def window(self) -> int:
        """Length of a window [decimated samples]."""

    @property
    def functions(self) -> int:
        """Test functions per window."""


@dataclass(frozen=True, eq=False)
class FirBankQ31(Folded):
    """pvid_fir_bank_q31 and its formats.

    Attributes
    ----------
    weights : int32 [5, half], folded
    stride : samples from point to point
    block : samples whose sum is a point
    centre : weight of the centre point in order 0
    phi_max, y_max : full scale of the counts
    phi_shift, y_shift : of orders 0..4 of phi and 2..4 of y
    denominator : angles and heights come out in 1/denominator counts
    phi_bits, y_bits : formats of the derivatives, all orders alike
    tau_bits : time unit tau = 2^tau_bits points
    margins : bits that the largest derivative of each order leaves below its limit, of phi and y
    """

    weights: Int32
    stride: int
    centre: int
    phi_max: int
    y_max: int
    phi_shift: tuple[int, ...]
    y_shift: tuple[int, ...]
    denominator: int
    phi_bits: int
    y_bits: int
    tau_bits: int
    margins: dict[str, float]
    block: int = 1

    @property
    def memory(self) -> int:
        """Places of PVID_MAX_WINDOW that it needs: sums of integers are exact, so one sum of a block is enough."""
        points = 2 * self.half * self.stride + 1
        return points + self.block + 1 if self.block > 1 else points


RATE_BITS = 24  # after the point of u, u', u'' and w_r in fixed point; w has one more


@dataclass(frozen=True)
class RowFormatQ31:
    """pvid_strong_row_q31.

    Attributes
    ----------
    phi_shift : left shifts of the derivatives 0..4 of phi to their units; negative: right
    finer : bits that -G^k phi'' and -G^k phi have more than the other entries
    phi3 : factor on phi''', Q30
    reference : w_r, in 2^-24 / T^2
    """

    phi_shift: tuple[int, ...]
    finer: tuple[int, int]
    phi3: int
    reference: int


@dataclass(frozen=True, eq=False)
class StrongDesignQ31:
    """What pvid_strong_config_q31 needs beside the estimator's settings. A value is its integer times 2^-bits.

    Attributes
    ----------
    bank : the integer bank of both channels
    row : formats of a row
    u_multiplier, u_shift : from the derivatives of y to u, u', u'' in 2^-24 per T
    angle_unit : one unit of the derivatives of phi [rad]
    tau : time unit of the derivatives of phi [s]
    row_angle : one unit of N_1, N_2 and Y [rad]
    dt : time unit T of a row [s]
    """

    bank: FirBankQ31
    row: RowFormatQ31
    u_multiplier: tuple[int, ...]
    u_shift: tuple[int, ...]
    angle_unit: float
    tau: float
    row_angle: float
    dt: float

    @property
    def p_units(self) -> Float:
        """What w, d1, d2 are counted in, in SI."""
        return np.array([1 / self.dt**2, 1.0, 1.0])

    @property
    def margins(self) -> dict[str, float]:
        """For each derivative the bits that its largest value leaves free."""
        return self.bank.margins

    def integers(self, phi: Float, u: Float) -> tuple[Int64, Int64]:
        """What the core takes for derivatives that are known otherwise: phi [n, 5] and u, u', u'' [n, 3], in SI."""
        own_phi = np.rint(phi * self.tau ** np.arange(5) / self.angle_unit)
        own_u = np.rint(u * self.dt ** np.arange(2, 5) * 2.0**RATE_BITS)
        return own_phi.astype(np.int64), own_u.astype(np.int64)


@dataclass(frozen=True, eq=False)
class WeakTablesQ31:
    """pvid_weak_design_q31: tables, shifts and formats. A value is its integer times 2^-bits.

    Attributes
    ----------
    taps, decimation, window, functions, lag : as in the float design
    phi_max, y_max : full scale of the counts, about their offsets
    smooth, second : int32 [(taps - 1) / 2]
    smooth_bits : format of smooth
    phi_shift, u_shift : from the FIR sums to F and U
    uf_shift : from U F to its 20 bits
    integral_shift : int [3], of the integrals of UF, F, U in dt^2/12
    high_shift : int [2], of UIUF_HIGH, UIF_HIGH
    product_shift : int [5], of what these leave of UIUF, UIF, UIU, UI1, UT
    sum_shift : of every product chi * term before it is added
    chi : int16 [window, 3, functions]
    multiplier : int32 [15], shift : int [15], from a term's sum to its share of a column
    gram : int32 [6, functions (functions + 1) / 2]; gram_bits : int [6]
    column_bits : int [11], formats of N1..N8, Y, a, b
    u_bits : format of U [1/dt^2]
    f_unit : one unit of F [rad]; dt [s]
    overlap : as in the float design
    margins : for each quantity the bits that its largest value leaves free
    """

    taps: int
    decimation: int
    window: int
    functions: int
    lag: int
    phi_max: int
    y_max: int
    u_max: int
    smooth: Int32
    second: Int32
    smooth_bits: int
    phi_shift: int
    u_shift: int
    uf_shift: int
    integral_shift: tuple[int, ...]
    high_shift: tuple[int, ...]
    product_shift: tuple[int, ...]
    sum_shift: int
    chi: Int16
    multiplier: Int32
    shift: tuple[int, ...]
    gram: Int32
    gram_bits: tuple[int, ...]
    column_bits: tuple[int, ...]
    u_bits: int
    f_unit: float
    dt: float
    overlap: float
    margins: dict[str, float]

    @property
    def p_units(self) -> Float:
        """What w, d1, d2 and c are counted in, in SI."""
        return np.array([1 / self.dt**2, 1.0, 1.0, self.f_unit])

    @property
    def encoder_count(self) -> float:
        """One count of the encoder [rad]."""
        return float(self.f_unit * 2.0 ** (self.smooth_bits - self.phi_shift))
