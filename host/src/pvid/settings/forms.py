"""Properties of a form."""

from __future__ import annotations

from dataclasses import dataclass

from pvid.settings.enums import Form


@dataclass(frozen=True)
class FormTraits:
    """Properties of a form.

    patience
        Default time until the gate accepts a changed mechanism [time constants of forgetting].
    publishes
        Whether it publishes trusted estimates only (pvid/trust.h).
    """

    patience: float
    publishes: bool


FORMS: dict[Form, FormTraits] = {
    "weak": FormTraits(patience=0.5, publishes=True),
    "strong": FormTraits(patience=6.0, publishes=False),
}
