"""Properties of a form alone, and of a core alone; pvid.cases has those that depend on both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pvid.settings.enums import Form

AnyCore = Literal["f32", "q31", "f64"]  # f64: the oracle on this machine


@dataclass(frozen=True)
class FormTraits:
    """Properties of a form.

    gate
        Default limit of the outlier gate [times the usual residual]. It is lower in the weak form, whose windows have
        similar residuals.
    patience
        Default time until the gate accepts a changed mechanism [time constants of forgetting].
    publishes
        Whether it publishes trusted estimates only (pvid/trust.h).
    estimates_zero
        Whether it estimates the encoder's offset; else the offset is 0.
    """

    gate: float
    patience: float
    publishes: bool
    estimates_zero: bool


@dataclass(frozen=True)
class CoreTraits:
    """Properties of a core.

    in_c
        The C core for it: the core itself; for f64, which is in Python only, f32.
    takes_gaps
        Whether it accepts runs with missing samples.
    """

    in_c: Literal["f32", "q31"]
    takes_gaps: bool


FORMS: dict[Form, FormTraits] = {
    "weak": FormTraits(gate=4.0, patience=0.5, publishes=True, estimates_zero=True),
    "strong": FormTraits(gate=6.0, patience=6.0, publishes=False, estimates_zero=False),
}
CORES: dict[AnyCore, CoreTraits] = {
    "f32": CoreTraits(in_c="f32", takes_gaps=True),
    "q31": CoreTraits(in_c="q31", takes_gaps=True),
    "f64": CoreTraits(in_c="f32", takes_gaps=False),
}
