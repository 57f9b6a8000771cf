"""Twin of weak/sums_f32.c: sums of all half windows of a stretch, and their join to windows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import NONE, WeakDesign32, WeakModel
from pvid.twin.f32.weak_step import Values

Float32 = npt.NDArray[np.float32]

_F = np.float32
_BLOCK = 8  # steps that are added together


def half_sums(channels: Float32, circle: Float32, hop: int, harmonics: int) -> Float32:
    """A_h of every whole half window: channels [steps, channels], time counts from each half's start.

    Returns float32 [halves, channels, 2, harmonics]: real and imaginary parts.
    """
    halves, centre = len(channels) // hop, _BLOCK // 2
    x = channels[: halves * hop].reshape(halves, hop // _BLOCK, _BLOCK, channels.shape[1], 1)
    turn, h = 2 * hop, np.arange(harmonics)

    def factors(steps: int) -> tuple[Float32, Float32]:
        at = (h * steps) % turn
        return circle[at + hop // 2], circle[at]

    total = np.zeros((halves, channels.shape[1], 2, harmonics), np.float32)
    with np.errstate(all="ignore"):
        even, odd = x[:, :, centre], np.zeros((), np.float32)
        for j in range(1, centre):
            cosine, sine = factors(j)
            even = even + cosine * (x[:, :, centre + j] + x[:, :, centre - j])
            part = sine * (x[:, :, centre + j] - x[:, :, centre - j])
            odd = part if j == 1 else odd + part
        cosine, sine = factors(centre)
        even, odd = even + cosine * x[:, :, 0], odd - sine * x[:, :, 0]
        for block in range(hop // _BLOCK):
            cosine, sine = factors(block * _BLOCK + centre)
            p, q = even[:, block], odd[:, block]
            plain = total[:, :, 0, 0] + p[:, :, 0]  # of h = 0, whose cosine is 1
            total[:, :, 0] = (total[:, :, 0] + cosine * p) - sine * q
            total[:, :, 1] = (total[:, :, 1] + sine * p) + cosine * q
            total[:, :, 0, 0], total[:, :, 1, 0] = plain, 0.0
    return total


def joined(halves: Float32, edges: Float32, model: WeakModel, dt: np.float32, hop: int) -> Float32:
    """S_h = A_h + (-1)^h B_h of every two neighbouring halves [windows, channels, 2, harmonics]."""
    a, b = halves[:-1], halves[1:]
    second = b.copy()
    half_time = dt * _F(hop)
    with np.errstate(all="ignore"):
        for place, one in enumerate(one for one in model.channel if one.gain != NONE):
            if not one.fold:
                continue
            if one.integrand == NONE:
                once, twice = half_time, _F(0.5) * (half_time * half_time)
            else:
                once, twice = edges[: len(a), :, one.integrand].T[:, :, None, None]
            if one.fold == 1:
                second[:, place] = b[:, place] + once * b[:, one.plain]
            else:
                second[:, place] = (b[:, place] + twice * b[:, one.plain]) + once * b[:, one.ramp]
        odd = np.arange(halves.shape[-1]) % 2 == 1
        return np.where(odd, a - second, a + second)


def windows(values: Values, design: WeakDesign32, dt: np.float32) -> Float32:
    """S_h of every whole window of a stretch [windows, channels, 2, harmonics]; window m begins with half m."""
    circle = np.asarray(design.circle, np.float32)
    halves = half_sums(values.channels, circle, design.hop, design.highest + 1)
    return joined(halves, values.edges, design.model, dt, design.hop)
