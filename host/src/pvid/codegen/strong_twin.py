"""Twin of NAME_strong_f32.c: samples of a run in, the state after every tick out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pvid.codegen import numpy_f32
from pvid.codegen.strong import StrongFunctions
from pvid.codegen.twin_file import loaded, namespace
from pvid.settings.enums import Reason
from pvid.settings.f32 import EstimatorConfig
from pvid.settings.record import Record
from pvid.settings.tables import Folded
from pvid.twin.f32.differentiator import derivatives, segments
from pvid.twin.f32.estimator import RelativeEstimator

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class StrongModelConfig(Folded):
    """Settings of the strong form of any model, as in NAME_strong.h.

    Attributes
    ----------
    sample_rate : [Hz]
    weights, stride, block : the folded bank of all differentiators, float32 [5, half]; see pvid.design.fir
    row_sd : expected standard deviation of Y - N^T theta of each kind of row [unit of its Y]
    estimator : its row_sd is ignored
    """

    sample_rate: float
    weights: Float32
    stride: int
    row_sd: tuple[float, ...]
    estimator: EstimatorConfig
    block: int = 1

    @property
    def bank(self) -> StrongModelConfig:
        """The bank, whose fields are among these."""
        return self


class StrongModelTwin:
    """The strong form of a model in one lane.

    estimator : RelativeEstimator; p float32 [n_p, 1]
    """

    def __init__(self, strong: StrongFunctions, config: StrongModelConfig) -> None:
        self._strong, self._config = strong, config
        self._twin = loaded(strong.functions)
        self._row = row_of(strong)
        self._inverse_sd = [np.float32(1) / np.float32(one) for one in config.row_sd]
        estimator = replace(config.estimator, row_sd=1.0)
        self.estimator = RelativeEstimator([estimator], config.sample_rate, self._twin.pattern)

    def run(self, samples: npt.ArrayLike, progress: Callable[[int], None] | None = None) -> Record:
        """Steps through a run [ticks, signals] from its first sample: p, sums and reason after every tick."""
        given = np.asarray(samples, np.float32)
        finite = _finite(given)
        columns, ready = self.columns(given)
        estimator, ticks = self.estimator, len(given)
        p, sums = (np.empty((ticks, len(one)), np.float32) for one in (estimator.p, estimator.sums))
        reasons = np.full(ticks, Reason.WARMING_UP, np.uint8)
        for tick in range(ticks):
            if not finite[tick]:
                reasons[tick] = Reason.REJECTED_NOT_FINITE
                estimator.counters["rejected_not_finite"] += 1
            elif ready[tick]:
                reasons[tick] = self._take(columns[:, tick])
            p[tick], sums[tick] = estimator.p[:, 0], estimator.sums[:, 0]
            if progress is not None:
                progress(1)
        return Record(p=p, sums=sums, reason=reasons)

    def _take(self, columns: Float32) -> int:
        """The rows of an instant [columns]; the reason of the solve."""
        functions = self._strong.functions
        for number, (kind, weight) in enumerate(zip(functions.kinds, self._inverse_sd, strict=True)):
            with np.errstate(all="ignore"):
                n = columns[kind.columns.start : kind.known, None] * weight
                y = columns[kind.known : kind.known + 1] * weight
            self.estimator.add(n, y, number)
        *_, reason = self.estimator.solve(True)
        assert reason is not None
        return int(reason[0])

    def columns(self, samples: Float32) -> tuple[Float32, Mask]:
        """Regressors and Y of all kinds after every tick [columns, ticks], and whether there are any."""
        finite = _finite(samples)
        channels = [*samples.T, *self._integrals(samples, finite)]
        usable = finite
        if any(self._strong.held):
            held = [*self._strong.held, *(False for _ in self._strong.integrals)]
            channels = [_centred(one, finite, is_held) for one, is_held in zip(channels, held, strict=True)]
            usable = _from_the_fourth(finite)
        config = self._config
        found = [
            derivatives(one, usable, config.weights, config.stride, config.sample_rate, config.block)
            for one in channels
        ]
        inputs = np.stack([found[one.channel][0][:, one.order] for one in self._strong.sources])
        return self._row(inputs), found[0][1]

    def _integrals(self, samples: Float32, finite: Mask) -> Sequence[Float32]:
        """By the trapezoid rule since the first finite sample [ticks]; a missing sample repeats the one before."""
        strong = self._strong
        if not strong.integrals or self._twin.integrands is None:
            return []
        inputs = np.zeros((len(strong.functions.inputs), len(samples)), np.float32)
        for k, one in enumerate(strong.functions.inputs):
            place = strong.raw_places(one)
            if place is not None:
                inputs[k] = samples[:, place]
        half_period = np.float32(0.5) / np.float32(self._config.sample_rate)
        last = np.maximum.accumulate(np.where(finite, np.arange(len(samples)), -1))  # the newest finite sample
        found = []
        for rate in self._twin.integrands(inputs):
            now = np.where(last >= 0, rate[np.maximum(last, 0)], np.float32(0))
            added = np.zeros(len(now), np.float32)
            added[1:] = np.where(last[:-1] >= 0, half_period * (now[:-1] + now[1:]), np.float32(0))
            found.append(np.add.accumulate(added))
        return found


_HEAD = """
import numpy as np
import numpy.typing as npt

from pvid.twin.f32 import elementary

Float32 = npt.NDArray[np.float32]
_F = np.float32
"""


def row_of(strong: StrongFunctions) -> Callable[[Float32], Float32]:
    """The row's columns [columns, ...] from the inputs [inputs, ...]."""
    source = numpy_f32.function("row", strong.row.program, "Columns from the inputs.")
    found: Callable[[Float32], Float32] = namespace(f"{_HEAD}{source}\n", strong.functions.name)["row"]
    return found


def _finite(samples: Float32) -> Mask:
    """Whether every signal is a number [ticks]."""
    return np.asarray(np.isfinite(samples).all(axis=1))


def _from_the_fourth(finite: Mask) -> Mask:
    """Where three samples precede, all finite."""
    usable = np.zeros_like(finite)
    for first, last in segments(finite):
        usable[first + 3 : last] = True
    return usable


def _centred(x: Float32, finite: Mask, is_held: bool) -> Float32:
    """The value at the instant of the sample before the last [ticks]; of a held input its mean around it."""
    out = np.zeros_like(x)
    with np.errstate(all="ignore"):
        for first, last in segments(finite):
            if last - first < 4:
                continue
            a, b, c, d = x[first : last - 3], x[first + 1 : last - 2], x[first + 2 : last - 1], x[first + 3 : last]
            mean = ((np.float32(13) * (b + c)) - (a + d)) / np.float32(24)
            out[first + 3 : last] = mean if is_held else c
    return out
