"""Twin of weak/weak_front_f32.c. It feeds forward: a whole stretch of finite samples is computed at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.weak import Source, WeakDesign32, WeakModel
from pvid.twin.weak_ticks import FrontTicks

Float32 = npt.NDArray[np.float32]
Places = npt.NDArray[np.int64]

_F = np.float32
_HELD_SCALE = _F(1) / _F(24)
_TWO_TICKS = 4  # least D whose jets and channels have a tick each


def front_ticks(design: WeakDesign32) -> FrontTicks:
    """Those of a design: from some D on, jets and channels have a tick each."""
    return FrontTicks.of(design, design.half_steps, int(design.decimation >= _TWO_TICKS))


def signals(samples: Float32, model: WeakModel, sample_rate: float) -> Float32:
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
                case Source.LAST:
                    out[:, place] = before
                case _:
                    out[:, place] = x
    return out


def block_means(of_ticks: Float32, decimation: int) -> Float32:
    """Outputs of whole blocks [blocks, signals] of signals [ticks, signals]."""
    blocks, d = len(of_ticks) // decimation, _F(decimation)
    x = np.zeros((blocks, decimation + 1, of_ticks.shape[1]), np.float32)
    x[:, 1:] = of_ticks[: blocks * decimation].reshape(blocks, decimation, -1)
    with np.errstate(all="ignore"):
        once = np.add.accumulate(x, axis=1, dtype=np.float32)
        twice = np.add.accumulate(once, axis=1, dtype=np.float32)[:, -1]
        carry = np.zeros_like(twice)
        carry[1:] = (d * once[:, -1] - twice)[:-1]
        return np.asarray((_F(1) / (d * d)) * (twice + carry))


def filtered(x: Float32, weights: Float32, order: int, centres: Places) -> Float32:
    """A signal [steps], or a derivative of it, at the centres."""
    middle = x[centres]
    total = np.zeros(len(centres), np.float32)
    for i, weight in enumerate(weights, 1):
        newer, older = x[centres + i], x[centres - i]
        total = total + weight * (newer - older if order % 2 else (newer - middle) + (older - middle))
    return middle + total if order == 0 else total


def _outputs(samples: Float32, design: WeakDesign32, sample_rate: float) -> Float32:
    of_ticks = signals(samples, design.model, sample_rate)
    return block_means(of_ticks[: len(samples) - front_ticks(design).held], design.decimation)


def early_jets(samples: Float32, design: WeakDesign32, sample_rate: float) -> Float32:
    """Jets [jets, outputs] of the outputs before the first step of a stretch: signals unfiltered, 0 of derivatives."""
    ticks, model = front_ticks(design), design.model
    outputs = _outputs(samples, design, sample_rate)[: ticks.lost + ticks.half]
    d = _F(design.decimation)
    outputs[:1] = ((_F(2) * d) / (d + _F(1))) * outputs[:1]
    out = np.zeros((model.jets, len(outputs)), np.float32)
    for place, jet in enumerate(model.jet):
        if jet.order == 0:
            out[place] = outputs[:, jet.signal]
    return out


def jets(samples: Float32, design: WeakDesign32, sample_rate: float) -> Float32:
    """Jets [jets, steps] of one stretch of finite samples [ticks, samples]."""
    ticks, model = front_ticks(design), design.model
    centres = ticks.lost + ticks.half + np.arange(ticks.steps(len(samples)))
    outputs = _outputs(samples, design, sample_rate)
    out = np.empty((model.jets, len(centres)), np.float32)
    with np.errstate(all="ignore"):
        for place, (jet, one) in enumerate(zip(model.jet, design.compensator, strict=True)):
            out[place] = filtered(outputs[:, jet.signal], one.weights, jet.order, centres)
    return out
