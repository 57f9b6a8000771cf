"""Tables and formats that a design computes and an identifier is configured with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]


class Folded:
    """What folded tables [5, half], whose taps are `stride` points of `block` samples apart, span."""

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
        return self.memory * self.every

    @property
    def memory(self) -> int:
        """Points from the first to the last, both included: places of PVID_MAX_WINDOW."""
        return 2 * self.half * self.stride + 1

    @property
    def every(self) -> int:
        """Samples from a result to the next."""
        return max(self.block, 1)

    @property
    def delay(self) -> int:
        """Samples from the newest one back to the instant the derivatives refer to."""
        return (self.window - 1) // 2


@dataclass(frozen=True, eq=False)
class FirBankQ31(Folded):
    """pvid_fir_bank_q31 and its formats.

    Attributes
    ----------
    weights : int32 [5, half], folded
    stride : points from tap to tap
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
