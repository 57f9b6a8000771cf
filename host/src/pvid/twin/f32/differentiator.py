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


def block_sums(samples: Float32, block: int) -> Float32:
    """pvid_block_sum_f32 after every sample of a stretch [n]: a sum of the last `block`, begun anew every `block`."""
    if block <= 1:
        return samples
    count = -(-len(samples) // block)
    x = np.zeros((count, block), np.float32)
    x.reshape(-1)[: len(samples)] = samples
    anew = np.add.accumulate(x, axis=1)
    change = x.copy()
    change[1:] = x[1:] - x[:-1]
    change[0] = x[0] - np.float32(0)
    out = np.empty_like(x)
    running = np.concatenate([np.zeros(1, np.float32), anew[:-1, -1]])
    for at in range(block):
        running = running + change[:, at]
        out[:, at] = running
    out[:, -1] = anew[:, -1]
    return out.reshape(-1)[: len(samples)]


def filtered(samples: Float32, weights: Float32, stride: int, block: int) -> tuple[Float32, Float32]:
    """The middle points of all full windows of a stretch [n] and the sums of the five filters [5, n]."""
    half = weights.shape[1]
    reach = half * stride
    x = block_sums(samples, block)[max(block, 1) - 1 :]
    count = len(x) - 2 * reach
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
    return middle, sums


def derivatives(
    samples: Float32, usable: npt.NDArray[np.bool_], weights: Float32, stride: int, sample_rate: float, block: int = 1
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
    stride, sample_rate, block
        As in the configuration [samples], [Hz], [samples].

    Returns
    -------
    float32 [ticks, 5], zero until the window is full, and bool [ticks]: whether it was.
    """
    window = 2 * weights.shape[1] * stride + max(block, 1)
    rate = np.float32(sample_rate) / np.float32(stride)
    scale = np.empty(ORDERS, np.float32)
    scale[0] = np.float32(1) / np.float32(max(block, 1))
    for k in range(1, ORDERS):
        scale[k] = scale[k - 1] * rate
    out = np.zeros((len(samples), ORDERS), np.float32)
    ready = np.zeros(len(samples), np.bool_)
    with np.errstate(all="ignore"):
        for first, last in segments(usable):
            if last - first < window:
                continue
            middle, sums = filtered(samples[first:last], weights, stride, block)
            sums[0] = middle + sums[0]
            now = slice(first + window - 1, last)
            out[now] = (sums * scale[:, None]).T
            ready[now] = True
    return out, ready
