"""Twin of pvid_model_q31: theta and its Jacobian as int64 of fixed formats, or as numbers of any size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from pvid.twin.blocks import Blocks
from pvid.twin.q31.integer import Int
from pvid.twin.q31.scaled import Scaled


@dataclass(frozen=True)
class ScaledModelQ31:
    """pvid_scaled_model_q31: theta [n_theta, ...] and the non-zeros of C [n_c, ...] of p [n_p, ...], of any size."""

    theta: Callable[[Scaled], Scaled]
    jacobian: Callable[[Scaled], Scaled]


@dataclass(frozen=True)
class ModelQ31:
    """pvid_model_q31: theta and the non-zeros of C as int64 within +-2^60, and their formats."""

    n_theta: int
    n_p: int
    positive: tuple[bool, ...]
    c_row: tuple[int, ...]
    c_column: tuple[int, ...]
    theta: Callable[[Int], Int]
    jacobian: Callable[[Int], Int]
    formats: Callable[[Sequence[int]], tuple[list[int], list[int]]]
    kind_end: tuple[int, ...] = ()  # one past the last theta of each kind of rows; empty: one kind
    scaled: ScaledModelQ31 | None = None  # in place of theta, jacobian and formats

    @cached_property
    def blocks(self) -> Blocks:
        """The kinds in theta and among the moments."""
        return Blocks(self.kind_end or (self.n_theta,))

    @property
    def moments(self) -> int:
        """Entries of M on and above the diagonals of its blocks."""
        return self.blocks.moments

    @property
    def n_sums(self) -> int:
        """M, B, yy, weight."""
        return self.blocks.n_sums
