"""Twin of differentiator_f32.c. It feeds forward, so all ticks are computed at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

ORDERS = 5


def segments(usable: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches [first, last) of usable samples: the window is emptied in between."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], usable, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def points(samples: Float32, block: int) -> Float32:
    """The sums of blocks of a stretch [n], each from its first sample on [n // block]."""
    whole = len(samples) // block * block
    return np.asarray(np.add.accumulate(samples[:whole].reshape(-1, block), axis=1)[:, -1])


@dataclass(frozen=True)
class Ticks:
    """At which ticks a bank has results, in the stretches of usable samples."""

    rows: list[tuple[int, int, slice]]  # of each stretch: its samples [first, last), the ticks of its results
    ready: npt.NDArray[np.bool_]  # [ticks] there is one
    full: npt.NDArray[np.bool_]  # [ticks] the window is full


def ticks_of(usable: npt.NDArray[np.bool_], window: int, block: int) -> Ticks:
    """Ticks with results of a window of so many samples, in blocks."""
    rows, ready, full = [], np.zeros(len(usable), np.bool_), np.zeros(len(usable), np.bool_)
    for first, last in segments(usable):
        if last - first < window:
            continue
        now = slice(first + window - 1, last, block)
        rows.append((first, last, now))
        ready[now] = True
        full[first + window - 1 : last] = True
    return Ticks(rows, ready, full)


def filtered(x: Float32, weights: Float32, stride: int) -> tuple[Float32, Float32]:
    """The middle points of all full windows of a stretch of points [n] and the sums of the five filters [5, n]."""
    half = weights.shape[1]
    reach = half * stride
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
        As in the configuration [points], [Hz], [samples].

    Returns
    -------
    float32 [ticks, 5], zero where there is no result, and bool [ticks]: where there is one.
    """
    every = max(block, 1)
    ticks = ticks_of(usable, (2 * weights.shape[1] * stride + 1) * every, every)
    rate = np.float32(sample_rate) / np.float32(stride * every)
    scale = np.empty(ORDERS, np.float32)
    scale[0] = np.float32(1) / np.float32(every)
    for k in range(1, ORDERS):
        scale[k] = scale[k - 1] * rate
    out = np.zeros((len(samples), ORDERS), np.float32)
    with np.errstate(all="ignore"):
        for first, last, now in ticks.rows:
            middle, sums = filtered(points(samples[first:last], every), weights, stride)
            sums[0] = middle + sums[0]
            out[now] = (sums * scale[:, None]).T
    return out, ticks.ready
