"""Twin of fourier/fourier_front_q31.c: from counts to the jets of the steps of one stretch without missing samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.fourier import Source
from pvid.settings.fourier_q31 import FourierDesignQ31, FourierFilterQ31, Rescale
from pvid.twin.q31.integer import Int, clamp, round_shift

_MOST = 2**31 - 1


def rescaled(total: Int, by: Rescale) -> Int:
    """From an exact sum to an int32 in another format."""
    first = clamp(round_shift(total, by.down), _MOST)
    return clamp(round_shift(first * by.multiplier, by.shift), _MOST)


def is_held(design: FourierDesignQ31) -> bool:
    """Whether a signal needs the next sample."""
    return any(one.source == Source.HELD for one in design.model.signal)


def signals(counts: Int, design: FourierDesignQ31) -> Int:
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
            found.append(now - last if one.source == Source.JUMP else now)
    return np.stack(found)


@dataclass(frozen=True)
class FrontTicks:
    """Counters of the front end. Ticks count from the first sample of a stretch.

    Attributes
    ----------
    half : of the longest compensator [steps]
    decimation : D
    held : a signal needs the next sample
    lost : outputs before those of the first step
    """

    half: int
    decimation: int
    held: bool
    lost: int

    @classmethod
    def of(cls, design: FourierDesignQ31) -> FrontTicks:
        """Those of a design."""
        sources = {one.source for one in design.model.signal}
        lost = 1 if design.decimation > 1 else max(2 - design.half, 0) if sources != {Source.SAMPLED} else 0
        return cls(design.half, design.decimation, Source.HELD in sources, lost)

    @property
    def lead(self) -> int:
        """Ticks from the first sample to the instant of the first step."""
        return self.decimation * (self.lost + self.half)

    def tick_of(self, step: int) -> int:
        """Tick that takes the jets of a step."""
        return self.decimation * (self.lost + 2 * self.half + 1 + step) - 1 + self.held

    def steps(self, ticks: int) -> int:
        """Whose jets have been taken after so many ticks."""
        return max(0, (ticks - 1 - self.tick_of(0)) // self.decimation + 1)

    def ends(self, ticks: int) -> npt.NDArray[np.bool_]:
        """Which ticks end a step [ticks]."""
        place = np.arange(1, ticks + 1) - self.held
        return np.asarray((place > 0) & (place % self.decimation == 0))


def block_sums(x: Int, design: FourierDesignQ31) -> Int:
    """Outputs of whole blocks [signals, blocks] of signals [signals, ticks]."""
    d = design.decimation
    blocks = x.shape[1] // d
    once = np.add.accumulate(x[:, : blocks * d].reshape(len(x), blocks, d), axis=-1)
    twice = np.add.reduce(once, axis=-1)
    out: Int = twice.copy()
    out[:, 1:] += (d * once[:, :, -1] - twice)[:, :-1]
    return np.asarray(out >> np.array(design.down)[:, np.newaxis])


def _sum(x: Int, one: FourierFilterQ31, order: int, centres: Int) -> Int:
    middle = x[centres]
    total = middle << one.bits if order == 0 else np.zeros_like(middle)
    for i, weight in enumerate(one.weights, start=1):
        after, before = x[centres + i], x[centres - i]
        total = total + int(weight) * (after - before if order % 2 else (after + before) - 2 * middle)
    return total


def jets(counts: Int, design: FourierDesignQ31) -> Int:
    """Of counts [samples, ticks] within full scale: [jets, steps]."""
    ticks = FrontTicks.of(design)
    steps = ticks.steps(counts.shape[1])
    if not steps:
        return np.zeros((len(design.model.jet), 0), np.int64)
    x = block_sums(signals(counts, design), design)
    centres = ticks.lost + ticks.half + np.arange(steps)
    return np.stack(
        [
            rescaled(_sum(x[jet.signal], one, jet.order, centres), one.rescale)
            for jet, one in zip(design.model.jet, design.filter, strict=True)
        ]
    )
