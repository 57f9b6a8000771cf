"""Settings of the strong form of any model, as in NAME_strong.h."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pvid.settings.parts import EstimatorConfig, EstimatorConfigQ31, GateConfig, GateConfigQ31
from pvid.settings.tables import Folded
from pvid.settings.weak_q31 import Rescale


@dataclass(frozen=True)
class StrongModelConfig(Folded):
    """Settings of the strong form in float32.

    Attributes
    ----------
    sample_rate : [Hz]
    weights, stride, block : the folded bank of all derivatives, float32 [5, half]; see pvid.design.fir
    row_sd : expected standard deviation of Y - N^T theta of each kind of row [unit of its Y]
    estimator : its row_sd is ignored
    gate : on the weighted innovations of an instant
    shared : errors that no row shows, as of trust.h [n_p (n_p + 1) / 2]
    exact_every : rows from one exact projection to the next, with divider 1; 0: 8, with the paper's law 1
    """

    sample_rate: float
    weights: npt.NDArray[np.float32]
    stride: int
    row_sd: tuple[float, ...]
    estimator: EstimatorConfig
    gate: GateConfig = field(default_factory=GateConfig)
    shared: npt.NDArray[np.float32] | None = None
    exact_every: int = 0
    block: int = 1

    @property
    def bank(self) -> StrongModelConfig:
        """The bank, whose fields are among these."""
        return self


@dataclass(frozen=True, eq=False)
class StrongModelConfigQ31(Folded):
    """Settings of the strong form in fixed point, as in NAME_strong_q31.h.

    Attributes
    ----------
    sample_rate : [Hz]
    weights, stride, centre : the folded bank in integers, int32 [5, half]; see pvid.design.bank_q31
    full_scale, offset : of the readings of each signal [counts]
    input : from the sum of its filter to each input of the rows
    entry : from the value of each entry of the rows, N then Y of each kind, to the format of the estimator
    rows_per_second : for the memories of gate and alarm
    estimator : rows are in standard deviations, row_sd 2^(8 + y_bits)
    gate : on the innovations of an instant
    shared : errors that no row shows, as of trust_q31.h
    raw : place of an input that is a signal -> the signal, and from its count to the input; for integrals
    integral_down : shift of each integral to a count
    """

    sample_rate: float
    weights: npt.NDArray[np.int32]
    stride: int
    centre: int
    full_scale: tuple[int, ...]
    offset: tuple[int, ...]
    input: tuple[Rescale, ...]
    entry: tuple[Rescale, ...]
    rows_per_second: int
    estimator: EstimatorConfigQ31
    gate: GateConfigQ31 = GateConfigQ31()
    shared: tuple[int, ...] | None = None
    raw: Mapping[int, tuple[int, Rescale]] = field(default_factory=dict)
    integral_down: tuple[int, ...] = ()
