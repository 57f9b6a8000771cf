"""Identification of any mechanism with a compiled model, in float64 (pvid.oracle.fourier)."""

from __future__ import annotations

import re

from pvid.model.compiled import CompiledModel
from pvid.models.model import Channel


def channels_of(model: CompiledModel) -> tuple[Channel, ...]:
    """The signals of a model as channels of a recording; a column's name may carry a unit behind the signal's."""
    return tuple(
        Channel(one.name, one.unit, one.name, usual_names=rf"^{re.escape(one.name)}([\s_(\[].*)?$")
        for one in model.signals
    )
