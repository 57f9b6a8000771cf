"""Gains that scale p: no residual shows them, and they belong to the standard errors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pvid.base.wording import with_unit
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.verdict import Reason

_A_GAIN = 0.01  # that a note on scale supposes


def of_scale(model: CompiledModel, by_gain: Mapping[str, Float], p: Float, se: Float) -> list[Reason]:
    """Gains that scale p and of which the description gives no error."""
    scales = []
    for signal in model.signals:
        moved = np.abs(by_gain.get(signal.name, np.zeros(len(p)))) * _A_GAIN
        if signal.gain_sd == 0 and np.any(moved > 2 * se):
            k = int(np.argmax(moved / np.maximum(np.abs(p), 1e-300) * (moved > 2 * se)))
            name, unit = model.p_names[k], model.unknowns[k].unit
            size = f"{100 * moved[k] / abs(p[k]):.2g} % of {name}"
            size = size if moved[k] < abs(p[k]) else f"{name} by {with_unit(float(moved[k]), unit, 2)}"
            scales.append(f"{signal.name} ({size})")
    if not scales:
        return []
    text = "The standard errors include no gain error (gain_sd = 0). A gain error of 1 % changes the estimate: "
    text += ", ".join(scales) + "."
    return [Reason("scale", text, alarm=False)]
