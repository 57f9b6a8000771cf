"""What depends on the form of the model alone, or on the core alone; pvid.cases has what depends on both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pvid.settings.enums import Form

AnyCore = Literal["f32", "q31", "f64"]  # f64: the oracle on this machine


@dataclass(frozen=True)
class FormTraits:
    """Of a form.

    gate
        What its outlier gate keeps out by default [times the usual]: windows are alike, rows follow the motion.
    patience
        Until the gate believes in a change [time constants of forgetting]: windows of a changed mechanism pass no
        sooner; of its rows enough do wherever their residuals cross zero.
    uses_windows
        Whether window_s is the length of windows of rows that are solved together, and not of a differentiator.
    publishes
        Whether it publishes the estimates that it trusts, and says nothing else.
    estimates_zero
        Whether it can estimate the encoder's zero, and friction; else angles are measured from 0.
    """

    gate: float
    patience: float
    uses_windows: bool
    publishes: bool
    estimates_zero: bool


@dataclass(frozen=True)
class CoreTraits:
    """Of a core.

    in_c
        The core in C that stands for it.
    corrects_angles
        Whether its weak form can correct its rows for large angles.
    takes_gaps
        Whether it takes runs with missing samples.
    """

    in_c: Literal["f32", "q31"]
    corrects_angles: bool
    takes_gaps: bool


FORMS: dict[Form, FormTraits] = {
    "weak": FormTraits(gate=4.0, patience=3.0, uses_windows=True, publishes=True, estimates_zero=True),
    "strong": FormTraits(gate=6.0, patience=6.0, uses_windows=False, publishes=False, estimates_zero=False),
}
CORES: dict[AnyCore, CoreTraits] = {
    "f32": CoreTraits(in_c="f32", corrects_angles=True, takes_gaps=True),
    "q31": CoreTraits(in_c="q31", corrects_angles=False, takes_gaps=True),
    "f64": CoreTraits(in_c="f32", corrects_angles=True, takes_gaps=False),
}
