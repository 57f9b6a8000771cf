"""Twin of weak/watch_f32.c: whether the windows of a stretch are to be used, all of them at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Places = npt.NDArray[np.int64]

_F = np.float32


def halves_beyond(samples: Float32, ranges: Float32, ticks: Places, delay: int, hop: int) -> Mask:
    """Whether a whole half has a step that contains a sample beyond its range [halves].

    Parameters
    ----------
    samples : of a stretch [ticks, samples]
    ranges : largest absolute values [samples]
    ticks : of the steps [steps]
    delay : steps that a sample counts for
    """
    out: Mask = np.any((samples > ranges) | (samples < -ranges), axis=1)
    latest = np.maximum.accumulate(np.where(out, np.arange(len(out)), -1))[ticks]
    first = np.searchsorted(ticks, latest)
    steps = (latest >= 0) & (np.arange(len(ticks)) - first < delay)
    halves = len(ticks) // hop
    return np.asarray(steps[: halves * hop].reshape(halves, hop).any(axis=1))


def windows_still(samples: Float32, least: Float32, hop: int) -> Mask:
    """Whether a sample has too small a deviation in a window [windows].

    Parameters
    ----------
    samples : at the steps' ticks [steps, samples]
    least : standard deviations [samples]; 0: of any
    """
    halves = len(samples) // hop
    x = samples[: halves * hop].reshape(halves, hop, -1)
    n = _F(hop)
    with np.errstate(all="ignore"):
        reference = x[:, 0]
        apart = x - reference[:, None]
        total = np.add.accumulate(apart, axis=1)[:, -1]
        squares = np.add.accumulate(apart * apart, axis=1)[:, -1]
        d = reference[1:] - reference[:-1]
        both = (total[:-1] + total[1:]) + n * d
        square = (squares[:-1] + (squares[1:] + ((_F(2) * d) * total[1:]))) + ((n * d) * d)
        variance = (square - ((both * both) / (_F(2) * n))) / (_F(2) * n)
        return np.asarray(((variance < least * least) & (least > 0)).any(axis=1))
