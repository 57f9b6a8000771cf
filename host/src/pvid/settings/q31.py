"""Settings of the estimator and what judges it, and of the strong form, in fixed point: as in estimator_q31.h,
strong_q31.h."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pvid.settings.enums import Core, Form
from pvid.settings.tables import FirBankQ31, RowFormatQ31, StrongDesignQ31


@dataclass(frozen=True)
class EstimatorConfigQ31:
    """Settings of the fixed-point estimator, as in estimator_q31.h.

    p in the formats p_bits, Y and N in y_bits and n_bits; row_sd in 2^-8 of Y's unit; correlation, row_weight and
    step_limit, noise_margin and dead_zone in Q16, gain and kappa_min in Q30.
    """

    start: tuple[int, ...]
    start_sd: tuple[int, ...]
    lower: tuple[int, ...]
    upper: tuple[int, ...]
    p_bits: tuple[int, ...]
    n_bits: tuple[int, ...]
    y_bits: int
    row_sd: int
    forgetting_groups: int = 0
    gain: int = 2**30
    correlation: int = 2**16
    row_weight: int = 2**16
    step_limit: int = 19661
    kappa_min: int = 10737
    noise_margin: int = 0
    dead_zone: int = 0
    divider: int = 1


@dataclass(frozen=True)
class TrustConfigQ31:
    """Which estimates are published, as in trust_q31.h: kappa_min and neglected in Q30, se_max in Q24, misfit_max and
    renewal in Q16."""

    kappa_min: int = 32212
    se_max: int = 838861
    misfit_max: int = 262144
    groups_min: int = 3
    revert_after: int = 16
    renewal: int = 13107
    neglected: int = 0


@dataclass(frozen=True)
class GateConfigQ31:
    """Which rows or windows are kept out, as in gate_q31.h: sigmas in Q16, 0: none."""

    sigmas: int = 0
    patience_groups: int = 0


@dataclass(frozen=True)
class StrongConfigQ31:
    """Settings of the fixed-point strong-form identifier, as in strong_q31.h: counts, and drive_min in u's unit."""

    design: StrongDesignQ31
    estimator: EstimatorConfigQ31
    drive_ticks: int
    phi_offset: int = 0
    y_offset: int = 0
    drive_min: int = 0
    gate: GateConfigQ31 = GateConfigQ31()

    form: ClassVar[Form] = "strong"
    core: ClassVar[Core] = "q31"

    @property
    def full_scale(self) -> tuple[int, int]:
        """Of phi and y [counts]."""
        return self.bank.phi_max, self.bank.y_max

    @property
    def bank(self) -> FirBankQ31:
        """The design's."""
        return self.design.bank

    @property
    def row(self) -> RowFormatQ31:
        """The design's."""
        return self.design.row

    @property
    def u_multiplier(self) -> tuple[int, ...]:
        """The design's."""
        return self.design.u_multiplier

    @property
    def u_shift(self) -> tuple[int, ...]:
        """The design's."""
        return self.design.u_shift


@dataclass(frozen=True)
class ScaleQ31:
    """What turns an estimate into metres, as in kapitza_q31.h."""

    l1: int
    g_multiplier: int
    g_shift: int
    d1_bits: int
    d2_bits: int
