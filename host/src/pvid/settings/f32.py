"""Settings of the estimator and what judges it, and of the strong form, in float32: as in estimator.h, strong.h."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Core, Form, Law
from pvid.settings.tables import Folded

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class EstimatorConfig:
    """Settings of the estimator, as in estimator.h; arrays have one entry a free parameter."""

    start: Float32
    start_sd: Float32
    lower: Float32
    upper: Float32
    row_sd: float
    forgetting_s: float = 0.0
    feedback_hz: float = 0.0
    correlation: float = 1.0
    row_weight: float = 1.0
    step_limit: float = 0.3
    kappa_min: float = 1e-5
    noise_margin: float = 16.0
    dead_zone: float = 0.0
    law: Law = Law.STATIONARY
    divider: int = 1


@dataclass(frozen=True)
class GateConfig:
    """Settings of the outlier gate, as in gate.h; sigmas 0: no gate."""

    sigmas: float = 0.0
    patience_s: float = 0.0


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


@dataclass(frozen=True)
class TrustConfig:
    """Conditions of publication, as in trust.h."""

    kappa_min: float = 3e-5
    se_max: float = 0.05
    misfit_max: float = 4.0
    groups_min: int = 3
    revert_after: int = 16
    renewal: float = 0.2
    neglected: float = 0.0
