"""How much a filter blurs the derivatives of signals, and what the parameters are off by for it.

No equation contains the motion of a drive, so no residual shows that its derivative is too small: the parameters take
the error. Measured on links with a driven pivot at 200 Hz: an error of 1 % of the acceleration is 0.8 % of w. The
rate in a term of its own, as |v| v, is blurred without a trace, too: the term's parameter takes it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from pvid.base.recent import Recent
from pvid.model.signals import Jet
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.front import segments_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.rows import Compiled, record_of
from pvid.oracle.weak.scores import Scores
from pvid.oracle.weak.solve import Fit

# A frequency belongs to the drive if its power is so many times the median, the noise: noise reaches 40 times at one of
# 2^40 frequencies. (Ten times are reached at one of a thousand, and a second derivative makes those the largest.)
_ABOVE_NOISE = 40.0

_EXACT = 1e-3  # a rate that is blurred by less counts as exact


def rates_of_drives(model: Compiled) -> list[Jet]:
    """Derivatives of measured drives among the jets that a model needs."""
    driven = {one.name for one in model.bare.signals if one.kind == "sensor" and one.driven}
    return sorted((jet for jet in model.channels.needed if jet.order and jet.of in driven), key=lambda one: one.order)


def blur_of(model: Compiled, run: Mapping[str, npt.ArrayLike], design: WeakDesign) -> float:
    """Largest rms error of such a derivative over its own rms, on this run; 0 where there is none."""
    return max(
        (_blur(_spectrum(np.array(run[jet.of], np.float64)), design, jet.order) for jet in rates_of_drives(model)),
        default=0.0,
    )


def shift_of(fit: Fit, run: Mapping[str, npt.ArrayLike], design: WeakDesign) -> Float:
    """What p is off by, about, because the rates in terms are too small at the frequencies of the motion [n_p]."""
    model = fit.rows.compiled
    rates = model.channels.rates - set(rates_of_drives(model))
    gains = {jet: _gain(_spectrum(np.array(run[jet.of], np.float64)), design, jet.order) for jet in rates}
    if all(abs(gain - 1) < _EXACT for gain in gains.values()):
        return np.zeros(len(fit.p))
    true = record_of(model, run, design, {jet: 2 - gain for jet, gain in gains.items()})
    scores = Scores(fit)
    return scores.shift_by(scores.change_to(true, -1.0)(scores.theta))


class _Spectrum:
    """Power of a signal [n] at the frequencies at which it stands above its noise."""

    def __init__(self, x: Float) -> None:
        longest = _longest(x)
        power = np.abs(np.fft.rfft((longest - longest.mean()) * np.hanning(len(longest)))) ** 2
        power = np.where(power > _ABOVE_NOISE * np.median(power), power, 0.0)
        self._used, self._size = np.flatnonzero(power), len(longest)
        self.power = np.asarray(power[self._used], np.float64)
        self._responses: dict[tuple[float, bytes], tuple[Float, npt.NDArray[np.complex128]]] = {}

    def response(self, design: WeakDesign, order: int) -> tuple[Float, npt.NDArray[np.complex128]]:
        """These frequencies [rad/s], and what the filter of a derivative makes of them; of each filter once."""
        weights = design.weights(order)
        key = design.sample_rate, weights.tobytes()
        if key not in self._responses:
            omega = 2 * np.pi * np.fft.rfftfreq(self._size, 1 / design.sample_rate)[self._used]
            places = np.arange(len(weights)) - len(weights) // 2
            got = np.asarray(np.exp(1j * np.outer(omega / design.sample_rate, places)) @ weights, np.complex128)
            self._responses[key] = np.asarray(omega, np.float64), got
        return self._responses[key]


_spectrum = Recent(_Spectrum, equal=np.array_equal)  # designs of one run are many


def _gain(spectrum: _Spectrum, design: WeakDesign, order: int) -> float:
    """Mean factor of a derivative, over the frequencies that a signal shows above its noise; 1: none is off."""
    (omega, got), power = spectrum.response(design, order), spectrum.power
    exact = (1j * omega) ** order
    size = float(power @ np.abs(exact) ** 2)
    return float(power @ np.real(got * np.conj(exact))) / size if size > 0 else 1.0


def _longest(x: Float) -> Float:
    """Its longest segment."""
    return max((x[part] for part in segments_of({"": x})), key=len, default=x[:0])


def _blur(spectrum: _Spectrum, design: WeakDesign, order: int) -> float:
    (omega, got), power = spectrum.response(design, order), spectrum.power
    exact = (1j * omega) ** order
    size = float(power @ np.abs(exact) ** 2)
    return float(np.sqrt(power @ np.abs(got - exact) ** 2 / size)) if size > 0 else 0.0
