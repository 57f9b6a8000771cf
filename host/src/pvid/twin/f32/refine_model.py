"""What the twin of the refinement needs of a mechanism: refine_shape.h and refine_model_f32.h."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class RefineShape:
    """Numbers of refine_shape.h."""

    order: int
    coordinates: int
    inputs: int
    outputs: int
    moving: int
    parameters: int
    skew: bool  # the entry of r behind the moving ones
    rates: bool  # an output depends on v
    logarithmic: tuple[bool, ...]
    place_of_p: tuple[int, ...]
    hidden: int = 0  # coordinates that no sensor measures
    runge_kutta: bool = False  # each step
    signs: int = 0  # in the equations
    widths: int = 0  # of signs, the first entries of r
    ring: int = 512  # PVID_REFINE_RING
    measured: tuple[int, ...] = ()  # of the states: 1 + 2 output: that output, 2 + 2 output: its rate, 0: neither
    observer: bool = False  # the noise of a measured input moves the model
    turning: tuple[bool, ...] = ()  # of the outputs: they are kept without whole turns

    @property
    def states(self) -> int:
        """q, and v of order 2."""
        return self.order * self.coordinates

    @property
    def columns(self) -> int:
        """That are integrated."""
        return self.states + self.moving

    @property
    def unknowns(self) -> int:
        """Of a block."""
        return self.states + self.parameters

    @property
    def width(self) -> int:
        """Of a row: unknowns and the residual."""
        return self.unknowns + 1

    @property
    def rows(self) -> int:
        """That are added to the sums together."""
        return max(2, self.outputs)


@dataclass(frozen=True)
class Derivatives:
    """Accelerations (order 1: rates) a [q], their derivatives K, D [q, q], B [moving, q]."""

    a: Float32
    K: Float32
    D: Float32
    B: Float32


class RefineModel(Protocol):
    """The functions of refine_model_f32.h in numpy float32, the same operations in the same order."""

    @property
    def shape(self) -> RefineShape: ...
    def region(self, r: Float32) -> bool: ...
    def constants(self, r: Float32) -> Float32: ...
    def motion(self, m: Float32, q: Float32, v: Float32, u: Float32) -> Float32: ...
    def jacobian(self, m: Float32, q: Float32, v: Float32, u: Float32) -> Derivatives: ...
    def signs(self, m: Float32, q: Float32, v: Float32, u: Float32) -> Float32: ...
    def output(self, m: Float32, q: Float32, v: Float32, u: Float32, r: Float32) -> Float32: ...
    def output_jacobian(
        self, m: Float32, q: Float32, v: Float32, u: Float32, r: Float32
    ) -> tuple[Float32, Float32, Float32]: ...
    def chart(self, r: Float32, row: Float32) -> Float32: ...
    def from_p(self, p: Float32) -> Float32: ...
