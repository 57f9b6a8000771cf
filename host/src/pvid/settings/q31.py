"""Settings of the strong form in fixed point, as in strong_q31.h, with those of its parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pvid.settings.enums import Core, Form
from pvid.settings.parts import EstimatorConfigQ31 as EstimatorConfigQ31
from pvid.settings.parts import GateConfigQ31 as GateConfigQ31
from pvid.settings.parts import TrustConfigQ31 as TrustConfigQ31
from pvid.settings.tables import FirBankQ31, RowFormatQ31, StrongDesignQ31


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
