"""Twin of differentiator_f32.c. It feeds forward, so all ticks are computed at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

ORDERS = 5


def segments(usable: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches [first, last) of usable samples: the window is emptied in between."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], usable, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def derivatives(
    samples: Float32, usable: npt.NDArray[np.bool_], weights: Float32, stride: int, sample_rate: float
) -> tuple[Float32, npt.NDArray[np.bool_]]:
    """Derivatives of one channel after every tick.

    Parameters
    ----------
    samples
        float32 [ticks].
    usable
        bool [ticks]; a sample that is not empties the window.
    weights
        The folded bank, float32 [5, half].
    stride, sample_rate
        As in the configuration [samples], [Hz].

    Returns
    -------
    float32 [ticks, 5], zero until the window is full, and bool [ticks]: whether it was.
    """
    half = weights.shape[1]
    reach = half * stride
    rate = np.float32(sample_rate) / np.float32(stride)
    power = np.ones(ORDERS, np.float32)
    for k in range(1, ORDERS):
        power[k] = power[k - 1] * rate
    out = np.zeros((len(samples), ORDERS), np.float32)
    ready = np.zeros(len(samples), np.bool_)
    with np.errstate(all="ignore"):
        for first, last in segments(usable):
            count = last - first - 2 * reach
            if count <= 0:
                continue
            x = samples[first:last]
            middle = x[reach : reach + count]
            sums = np.empty((ORDERS, count), np.float32)
            for i in range(half):
                away = (i + 1) * stride
                after = x[reach + away : reach + away + count]
                before = x[reach - away : reach - away + count]
                even = (after - middle) + (before - middle)
                odd = after - before
                for k in range(ORDERS):
                    term = weights[k, i] * (even if k % 2 == 0 else odd)
                    sums[k] = term if i == 0 else sums[k] + term
            now = slice(first + 2 * reach, last)
            out[now, 0] = middle + sums[0]
            for k in range(1, ORDERS):
                out[now, k] = sums[k] * power[k]
            ready[now] = True
    return out, ready
