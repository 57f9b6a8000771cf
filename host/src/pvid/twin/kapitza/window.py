"""Twin of strong_derivatives_f32.c: the derivatives of both channels of the strong form."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.f32 import StrongConfig
from pvid.twin.f32.differentiator import Ticks, filtered, points, ticks_of

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

_F = np.float32
_FIVE_POINTS = np.array([[0, 0], [8 / 12, -1 / 12], [16 / 12, -1 / 12], [-1, 0.5], [-4, 1]]).astype(np.float32)


def _five_points(x: Float32, stride: int) -> tuple[Float32, Float32]:
    """The middle points of all full windows of a stretch [n] and the filters' sums of orders 0, 2, 3, 4 [4, n]."""
    count = len(x) - 4 * stride
    x0, x1, x2, x3, x4 = (x[i * stride : i * stride + count] for i in range(5))
    even1 = (x3 - x2) + (x1 - x2)
    even2 = (x4 - x2) + (x0 - x2)
    odd1, odd2 = x3 - x1, x4 - x0
    second = (_F(16) * even1) - even2
    return x2, np.stack([np.zeros_like(x2), second, odd2 - (_F(2) * odd1), even2 - (_F(4) * even1)])


def derivatives(config: StrongConfig, phi: Float32, y: Float32, usable: Mask) -> tuple[Float32, Float32, Ticks]:
    """phi, phi', .. phi'''' [ticks, 5] (its order 1 is zero) and u, u', u'' [ticks, 3] after every tick, and the
    ticks that have them; samples that are not usable empty the window."""
    weights = config.weights.astype(np.float32)
    block = max(config.block, 1)
    five = block == 1 and np.array_equal(weights, _FIVE_POINTS)
    ticks = ticks_of(usable, config.window, block)
    rate = _F(config.sample_rate) / _F(config.stride * block)
    rate2 = rate * rate
    share = _F(1) / _F(block)
    scale = np.array(
        [
            share,
            rate2 / _F(12) if five else rate2 * share,
            (rate2 * rate) * (_F(0.5) if five else share),
            (rate2 * rate2) * share,
        ],
        np.float32,
    )
    u_scale = scale[1:] * (_F(1) / _F(config.l1))
    d_phi, u = np.zeros((len(phi), 5), np.float32), np.zeros((len(phi), 3), np.float32)

    def sums_of(x: Float32) -> tuple[Float32, Float32]:
        if five:
            return _five_points(x, config.stride)
        middle, sums = filtered(points(x, block), weights, config.stride)
        return middle, sums[[0, 2, 3, 4]]

    with np.errstate(all="ignore"):
        for first, last, now in ticks.rows:
            middle, sums = sums_of(phi[first:last])
            d_phi[now, 0] = middle if five else (middle + sums[0]) * scale[0]
            d_phi[now, 2:] = (sums[1:] * scale[1:, None]).T
            _, sums = sums_of(y[first:last])
            u[now] = (sums[1:] * u_scale[:, None]).T
    return d_phi, u, ticks
