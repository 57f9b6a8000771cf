"""Settings of the strong form in float32, as in strong.h, with those of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Core, Form
from pvid.settings.parts import EstimatorConfig as EstimatorConfig
from pvid.settings.parts import GateConfig as GateConfig
from pvid.settings.parts import TrustConfig as TrustConfig
from pvid.settings.tables import Folded

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class StrongConfig(Folded):
    """Settings of the strong-form identifier, as in strong.h.

    `weights` is the folded bank, float32 [5, half]; see pvid.design.fir.
    """

    sample_rate: float
    l1: float
    weights: Float32
    stride: int
    estimator: EstimatorConfig
    drive_min: float = 0.0
    gate: GateConfig = field(default_factory=GateConfig)
    block: int = 1
    exact_every: int = 0

    form: ClassVar[Form] = "strong"
    core: ClassVar[Core] = "f32"

    @property
    def ticks_needed(self) -> int:
        """Samples up to the first estimate."""
        return self.window

    @property
    def bank(self) -> StrongConfig:
        """The bank, whose fields are among these."""
        return self
