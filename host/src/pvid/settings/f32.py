"""Settings of the float identifiers, as in weak.h and strong.h."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Core, Form, Law
from pvid.settings.tables import Folded, WeakSizes

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
    corrects_angles: ClassVar[bool] = False

    @property
    def ticks_needed(self) -> int:
        """Samples up to the first estimate."""
        return self.window

    @property
    def bank(self) -> StrongConfig:
        """The bank, whose fields are among these."""
        return self


class WeakTables(WeakSizes, Protocol):
    """Tables of a weak-form design, as in weak.h; pvid.design.weak makes them.

    smooth, second float32 [(taps - 1) / 2]; chi float32 [window, 3, functions] (orders 0, 2, 4);
    gram float32 [6, functions (functions + 1) / 2].
    """

    @property
    def smooth(self) -> Float32: ...
    @property
    def second(self) -> Float32: ...
    @property
    def chi(self) -> Float32: ...
    @property
    def gram(self) -> Float32: ...
    @property
    def overlap(self) -> float: ...
    @property
    def lag(self) -> int: ...


@dataclass(frozen=True)
class TrustConfig:
    """Conditions of publication, as in trust.h."""

    kappa_min: float = 3e-5
    se_max: float = 0.05
    misfit_max: float = 4.0
    groups_min: int = 3
    revert_after: int = 16
    renewal: float = 0.2


@dataclass(frozen=True)
class WeakConfig:
    """Settings of the weak-form identifier, as in weak.h.

    The estimator's start, start_sd and bounds have four entries if the encoder's offset is unknown, else three, and two
    more with friction. Its row_weight and correlation follow from the design.
    """

    sample_rate: float
    l1: float
    design: WeakTables
    estimator: EstimatorConfig
    zero_unknown: bool = True
    iterations: int = 3
    full_angle: bool = False
    friction: bool = False
    passes: int = 3
    drive_min: float = 0.0
    pivot_noise: float = 0.0
    angle_limit: float = 0.0
    trust: TrustConfig = field(default_factory=TrustConfig)
    gate: GateConfig = field(default_factory=GateConfig)

    form: ClassVar[Form] = "weak"
    core: ClassVar[Core] = "f32"

    @property
    def corrects_angles(self) -> bool:
        """Whether it corrects its rows for large angles or friction."""
        return self.full_angle or self.friction

    @property
    def hop(self) -> int:
        """Decimated samples from the start of a window to the start of the next."""
        return (self.design.window - 1) // 2

    @property
    def delay(self) -> int:
        """Ticks from a sample to the end of the smoothing filter that is centred on it."""
        return (self.design.taps - 1) // 2

    @property
    def ticks_needed(self) -> int:
        """Samples up to the first estimate: one window, and the hop in which it is processed."""
        return self.design.taps + self.design.decimation * (self.design.window + self.hop)
