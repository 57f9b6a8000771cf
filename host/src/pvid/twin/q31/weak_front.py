"""Twin of weak/weak_front_q31.c: from counts to the jets of the steps of one stretch without missing samples."""

from __future__ import annotations

import numpy as np

from pvid.settings.weak import Source
from pvid.settings.weak_q31 import Rescale, WeakDesignQ31, WeakFilterQ31
from pvid.twin.q31.integer import Int, clamp, round_shift
from pvid.twin.weak_ticks import FrontTicks

_MOST = 2**31 - 1


def rescaled(total: Int, by: Rescale) -> Int:
    """From an exact sum to an int32 in another format."""
    first = clamp(round_shift(total, by.down), _MOST)
    return clamp(round_shift(first * by.multiplier, by.shift), _MOST)


def is_held(design: WeakDesignQ31) -> bool:
    """Whether a signal needs the next sample."""
    return any(one.source == Source.HELD for one in design.model.signal)


def signals(counts: Int, design: WeakDesignQ31) -> Int:
    """Exact integers [signals, n] of counts [samples, ticks]; one tick less where a signal needs the next sample."""
    model = design.model
    ends = int(is_held(design))
    whole = np.concatenate([counts[:, :1], counts[:, :1], counts], axis=1)  # all before the first are equal to it
    n = counts.shape[1] - ends
    found = []
    for one in model.signal:
        x = whole[one.sample]
        before, last, now = x[:n], x[1 : n + 1], x[2 : n + 2]
        if one.source == Source.HELD:
            found.append(13 * (last + now) - (before + x[3 : n + 3]))
        else:
            found.append({Source.JUMP: now - last, Source.LAST: last}.get(one.source, now))
    return np.stack(found)


def front_ticks(design: WeakDesignQ31) -> FrontTicks:
    """Those of a design."""
    return FrontTicks.of(design, design.half)


def block_sums(x: Int, design: WeakDesignQ31) -> Int:
    """Outputs of whole blocks [signals, blocks] of signals [signals, ticks]."""
    d = design.decimation
    blocks = x.shape[1] // d
    once = np.add.accumulate(x[:, : blocks * d].reshape(len(x), blocks, d), axis=-1)
    twice = np.add.reduce(once, axis=-1)
    out: Int = twice.copy()
    out[:, 1:] += (d * once[:, :, -1] - twice)[:, :-1]
    return np.asarray(out >> np.array(design.down)[:, np.newaxis])


def _jet(x: Int, one: WeakFilterQ31, order: int, centres: Int) -> Int:
    middle = x[centres]
    first, *weights = one.weights.tolist()
    total = middle * first
    for i, weight in enumerate(weights, start=1):
        after, before = x[centres + i], x[centres - i]
        total = total + weight * (after - before if order % 2 else (after + before) - 2 * middle)
    return clamp(round_shift(total, one.down), _MOST)


def early_jets(counts: Int, design: WeakDesignQ31) -> Int:
    """Those of the outputs before the first step [jets, outputs]: signals unfiltered, 0 of derivatives."""
    ticks, d = front_ticks(design), design.decimation
    x = block_sums(signals(counts, design), design)[:, : ticks.lost + ticks.half]
    x[:, :1] = np.sign(x[:, :1]) * (np.abs(x[:, :1]) * 2 * d // (d + 1))
    found = np.zeros((len(design.model.jet), x.shape[1]), np.int64)
    for k, (jet, one) in enumerate(zip(design.model.jet, design.filter, strict=True)):
        if jet.order == 0:
            found[k] = clamp(round_shift(int(one.weights[0]) * x[jet.signal], one.down), _MOST)
    return found


def jets(counts: Int, design: WeakDesignQ31) -> Int:
    """Of counts [samples, ticks] within full scale: [jets, steps]."""
    ticks = front_ticks(design)
    steps = ticks.steps(counts.shape[1])
    if not steps:
        return np.zeros((len(design.model.jet), 0), np.int64)
    x = block_sums(signals(counts, design), design)
    centres = ticks.lost + ticks.half + np.arange(steps)
    return np.stack(
        [_jet(x[jet.signal], one, jet.order, centres) for jet, one in zip(design.model.jet, design.filter, strict=True)]
    )
