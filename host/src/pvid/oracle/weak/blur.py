"""How much a filter blurs the derivatives of a measured drive.

No equation contains the motion of a drive, so no residual shows that its derivative is too small: the parameters take
the error. Measured on pendulums with a driven pivot at 200 Hz: an error of 1 % of the acceleration is 0.8 % of w.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from pvid.model.signals import Jet
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.front import segments_of, weights_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import Compiled

# A frequency belongs to the drive if its power is so many times the median, the noise: noise reaches 40 times at one of
# 2^40 frequencies. (Ten times are reached at one of a thousand, and a second derivative makes those the largest.)
_ABOVE_NOISE = 40.0


def rates_of_drives(model: Compiled) -> list[Jet]:
    """Derivatives of measured drives among the jets that a model needs."""
    driven = {one.name for one in model.bare.signals if one.kind == "sensor" and one.driven}
    return sorted((jet for jet in model.channels.needed if jet.order and jet.of in driven), key=lambda one: one.order)


def blur_of(model: Compiled, run: Mapping[str, npt.ArrayLike], design: WeakDesign) -> float:
    """Largest rms error of such a derivative over its own rms, on this run; 0 where there is none."""
    return max(
        (_blur(_longest(np.asarray(run[jet.of], np.float64)), design, jet.order) for jet in rates_of_drives(model)),
        default=0.0,
    )


def _longest(x: Float) -> Float:
    """Its longest segment."""
    return max((x[part] for part in segments_of({"": x})), key=len, default=x[:0])


def _blur(x: Float, design: WeakDesign, order: int) -> float:
    window = np.hanning(len(x))
    power = np.abs(np.fft.rfft((x - x.mean()) * window)) ** 2
    power = np.where(power > _ABOVE_NOISE * np.median(power), power, 0.0)
    used = np.flatnonzero(power)
    omega = 2 * np.pi * np.fft.rfftfreq(len(x), 1 / design.sample_rate)[used]
    exact = (1j * omega) ** order
    weights = weights_of(design, order)
    places = np.arange(len(weights)) - len(weights) // 2
    got = np.exp(1j * np.outer(omega / design.sample_rate, places)) @ weights
    size = float(power[used] @ np.abs(exact) ** 2)
    return float(np.sqrt(power[used] @ np.abs(got - exact) ** 2 / size)) if size > 0 else 0.0
