"""Twin of fourier/fourier_front_f32.c. It feeds forward: a whole stretch of finite samples is computed at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.settings.fourier import FourierDesign32, FourierModel, Source

Float32 = npt.NDArray[np.float32]
Places = npt.NDArray[np.int64]

_F = np.float32
_HELD_SCALE = _F(1) / _F(24)
_LEAST_BEFORE = 2  # ticks before the first step
_LONG_STEP, _PAIRS = 8, 16


@dataclass(frozen=True)
class FrontTicks:
    """Twin of fourier/fourier_schedule.h, as far as it depends on the front end: the work of the ticks of a stretch.

    Ticks count from its first sample.

    Attributes
    ----------
    half : of the longest filter
    pairs : of all filters
    decimation : D
    held : a signal needs the next sample
    """

    half: int
    pairs: int
    decimation: int
    held: bool

    @classmethod
    def of(cls, design: FourierDesign32) -> FrontTicks:
        """Those of a design."""
        held = any(one.source == Source.HELD for one in design.model.signal)
        return cls(design.half, sum(one.half for one in design.filter), design.decimation, held)

    @property
    def first(self) -> int:
        """Sample to whose instant the first step refers."""
        return max(self.half, _LEAST_BEFORE)

    @property
    def _job_ticks(self) -> int:
        few = min(-(-self.pairs // _PAIRS), self.decimation // 2)
        return 1 if self.decimation < _LONG_STEP else max(few, 1)

    @property
    def _step_place(self) -> int:
        """Place in a step of the tick that forms the channels."""
        return self.decimation - 1 if self.decimation < _LONG_STEP else self._job_ticks

    @property
    def _work_place(self) -> int:
        """Place of the first tick that adds to the sums or runs stages."""
        return 0 if self.decimation < _LONG_STEP else self._job_ticks + 1

    @property
    def free_ticks(self) -> int:
        """Ticks of a block of four steps that add harmonics or run stages."""
        return 4 * (self.decimation - self._work_place - (1 < self.decimation < _LONG_STEP))

    @property
    def _begin(self) -> int:
        """Tick at which the first job begins."""
        return self.first + self.half + self.held

    def tick_of(self, step: int) -> int:
        """Tick that takes the jets of a step."""
        return self._begin + self.decimation * step + self._step_place

    def steps(self, ticks: int) -> int:
        """Steps whose jets have been taken after a stretch of so many ticks."""
        return max(0, (ticks - 1 - self.tick_of(0)) // self.decimation + 1)

    def free(self, ticks: int) -> npt.NDArray[np.bool_]:
        """Which ticks add harmonics or run stages [ticks]."""
        since = np.arange(ticks) - self._begin
        place = since % self.decimation
        works = (place >= self._work_place) & (place != self._step_place)
        return np.asarray((since < 0) | works | (self.decimation == 1))


def signals(samples: Float32, model: FourierModel, sample_rate: float) -> Float32:
    """Signals [ticks, signals] of samples [ticks, samples]; a held one is wrong at the last tick."""
    out = np.empty((len(samples), model.signals), np.float32)
    jump_scale = _F(1) / (_F(12) * _F(sample_rate))
    with np.errstate(all="ignore"):
        for place, one in enumerate(model.signal):
            x = samples[:, one.sample]
            before = np.concatenate([x[:1], x[:-1]])
            match one.source:
                case Source.HELD:
                    earlier = np.concatenate([x[:1], before[:-1]])
                    behind = np.concatenate([x[1:], x[-1:]])
                    out[:, place] = (((-earlier + _F(13) * before) + _F(13) * x) - behind) * _HELD_SCALE
                case Source.JUMP:
                    out[:, place] = jump_scale * (x - before)
                case _:
                    out[:, place] = x
    return out


def filtered(x: Float32, weights: Float32, order: int, centres: Places) -> Float32:
    """A signal [ticks], or a derivative of it, at the centres."""
    middle = x[centres]
    if not len(weights):
        return middle
    total = np.zeros(len(centres), np.float32)
    for i, weight in enumerate(weights, 1):
        newer, older = x[centres + i], x[centres - i]
        total = total + weight * (newer - older if order % 2 else (newer - middle) + (older - middle))
    return middle + total if order == 0 else total


def jets(samples: Float32, design: FourierDesign32, sample_rate: float) -> Float32:
    """Jets [jets, steps] of one stretch of finite samples [ticks, samples]."""
    ticks, model = FrontTicks.of(design), design.model
    centres = ticks.first + ticks.decimation * np.arange(ticks.steps(len(samples)))
    of_ticks = signals(samples, model, sample_rate)
    out = np.empty((model.jets, len(centres)), np.float32)
    with np.errstate(all="ignore"):
        for place, (jet, one) in enumerate(zip(model.jet, design.filter, strict=True)):
            out[place] = filtered(of_ticks[:, jet.signal], one.weights, jet.order, centres)
    return out
