"""Settings of the estimator and of what judges it, in float32 and fixed point.

Arrays have one entry a free parameter. Printed by tools/print_headers.py: do not edit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.enums import Law


@dataclass(frozen=True)
class EstimatorConfig:
    """As in estimator.h."""

    start: npt.NDArray[np.float32]
    start_sd: npt.NDArray[np.float32]
    lower: npt.NDArray[np.float32]
    upper: npt.NDArray[np.float32]
    row_sd: float
    forgetting_s: float = 0.0
    feedback_hz: float = 0.0
    correlation: float = 1.0
    row_weight: float = 1.0
    step_limit: float = 0.3
    kappa_min: float = 1e-05
    noise_margin: float = 16.0
    dead_zone: float = 0.0
    law: Law = Law(0)
    divider: int = 1


@dataclass(frozen=True)
class TrustConfig:
    """As in trust.h."""

    kappa_min: float = 3e-05
    se_max: float = 0.05
    misfit_max: float = 4.0
    groups_min: int = 3
    revert_after: int = 16
    age_max: int = 1000
    renewal: float = 0.2
    shared: npt.NDArray[np.float32] | None = None


@dataclass(frozen=True)
class GateConfig:
    """As in gate.h."""

    sigmas: float = 0.0
    patience_s: float = 0.0


@dataclass(frozen=True)
class EstimatorConfigQ31:
    """As in estimator_q31.h."""

    start: tuple[int, ...]
    start_sd: tuple[int, ...]
    lower: tuple[int, ...]
    upper: tuple[int, ...]
    p_bits: tuple[int, ...]
    n_bits: tuple[int, ...]
    y_bits: int
    row_sd: int
    forgetting_groups: int = 0
    gain: int = 1073741824
    correlation: int = 65536
    row_weight: int = 65536
    step_limit: int = 19661
    kappa_min: int = 10737
    noise_margin: int = 0
    dead_zone: int = 0
    divider: int = 1


@dataclass(frozen=True)
class TrustConfigQ31:
    """As in trust_q31.h."""

    kappa_min: int = 32212
    se_max: int = 838861
    misfit_max: int = 262144
    groups_min: int = 3
    revert_after: int = 16
    age_max: int = 1000
    renewal: int = 13107
    shared: tuple[int, ...] | None = None


@dataclass(frozen=True)
class GateConfigQ31:
    """As in gate_q31.h."""

    sigmas: int = 0
    patience_groups: int = 0
