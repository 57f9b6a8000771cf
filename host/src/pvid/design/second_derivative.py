"""Second derivative of a sampled signal in a pass band: a decimated FIR that is exact there and passes little noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

_A_PERIOD = 16  # decimated samples in a period of the edge of the pass band
_REACH = 0.8  # periods of the edge on each side
_SHORTEST, _LONGEST = 6, 80  # decimated samples on each side
_PASS, _NOISE = 1e6, 1e-4  # weights of the relative error in the pass band and of the noise


@dataclass(frozen=True, eq=False)
class SecondDerivative:
    """A filter.

    Attributes
    ----------
    mean : samples in an average, which is the decimated signal
    taps : of the averages [2 half + 1]; the result has the unit of the signal per decimated sample squared
    worst : largest error in the pass band, relative to the edge's gain
    """

    mean: int
    taps: Float
    worst: float

    @property
    def half(self) -> int:
        """Decimated samples on each side."""
        return len(self.taps) // 2

    def apply(self, x: Float, rate: float) -> tuple[Float, Float]:
        """Times [s] since the first sample, and x'' there."""
        k = self.mean
        averages = x[: len(x) // k * k].reshape(-1, k).mean(1)
        found = np.convolve(averages - averages.mean(), self.taps[::-1], "valid") * (rate / k) ** 2
        times = ((np.arange(len(found)) + self.half) * k + (k - 1) / 2) / rate
        return np.asarray(times, np.float64), np.asarray(found, np.float64)


def second_derivative(rate: float, edge_hz: float) -> SecondDerivative:
    """A filter for samples at `rate` that is exact up to `edge_hz`."""
    k = max(1, int(rate / (_A_PERIOD * edge_hz)))
    edge = min(edge_hz * k / rate, 0.4)  # cycles a decimated sample
    half = int(np.clip(round(_REACH / edge), _SHORTEST, _LONGEST))
    f = np.linspace(0.0, edge, 20 * half)
    droop = np.ones_like(f)
    if k > 1:
        droop[1:] = np.sin(np.pi * f[1:]) / (k * np.sin(np.pi * f[1:] / k))
    want = -((2 * np.pi * f) ** 2) / droop
    scale = (2 * np.pi * edge) ** 2
    n = np.arange(half + 1)
    cosines = 2 * np.cos(2 * np.pi * np.outer(f, n))
    cosines[:, 0] = 1.0
    # without a gain at f = 0: the centre is minus the sum of the others
    moving = cosines[:, 1:] - 2.0
    relative = np.maximum(np.abs(want), 0.02 * scale)
    weight = np.sqrt(_PASS / len(f)) / relative
    spread = np.sqrt(2.0 * _NOISE) / scale * np.eye(half)
    centre = np.sqrt(_NOISE) / scale * -2.0 * np.ones((1, half))
    rows = np.concatenate([moving * weight[:, None], spread, centre])
    right = np.concatenate([want * weight, np.zeros(half + 1)])
    side = np.linalg.lstsq(rows, right, rcond=1e-13)[0]
    taps = np.concatenate([side[::-1], [-2 * side.sum()], side])
    worst = float(np.abs(moving @ side - want).max() / scale)
    return SecondDerivative(k, taps, worst)
