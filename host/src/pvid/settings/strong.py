"""Settings of the strong form of any model, as in NAME_strong.h."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pvid.settings.parts import EstimatorConfig, GateConfig
from pvid.settings.tables import Folded


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
    exact_every : rows from one exact projection to the next, with divider 1; 0: 8, with the paper's law 1
    """

    sample_rate: float
    weights: npt.NDArray[np.float32]
    stride: int
    row_sd: tuple[float, ...]
    estimator: EstimatorConfig
    gate: GateConfig = field(default_factory=GateConfig)
    exact_every: int = 0
    block: int = 1

    @property
    def bank(self) -> StrongModelConfig:
        """The bank, whose fields are among these."""
        return self
