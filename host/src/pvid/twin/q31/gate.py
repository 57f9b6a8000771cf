"""Twin of gate_q31.c: which residuals are accepted, in several lanes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.settings.q31 import GateConfigQ31
from pvid.twin.q31.integer import integers
from pvid.twin.q31.scaled import Scaled, pick, scaled

Mask = npt.NDArray[np.bool_]

_GROWTH, _GROWTH_BITS = 150902, 14
_SCALE_MAX = scaled(1, 100)


class GateQ31:
    """The gate of every lane; all share the configuration, `floor` [lanes] is their own."""

    def __init__(self, config: GateConfigQ31, memory: int, floor: Scaled) -> None:
        self.is_on = config.sigmas > 0
        self.limit = scaled(config.sigmas * config.sigmas, -32)
        self.floor = floor
        self.widening = scaled(1, 0)
        if config.patience_groups > 0:
            growth = scaled(_GROWTH, -_GROWTH_BITS).over(scaled(config.patience_groups, 0))
            self.widening = self.widening.plus(growth)
        self.scale = self.usual = floor
        self.memory = max(memory, 1)
        self.judged = np.zeros(np.shape(floor.m), np.int64)

    def begin_anew(self, lanes: Mask) -> None:
        """Forgets the usual size in these lanes: the next residuals are accepted, as the first ones were."""
        self.judged = np.where(lanes, 0, self.judged)

    def passes(self, square: Scaled, asked: Mask | None = None) -> Mask:
        """Lanes that accept a residual of this square [lanes]; those outside `asked` do."""
        if not self.is_on:
            return np.ones(self.judged.shape, np.bool_)
        asking = np.ones(self.judged.shape, np.bool_) if asked is None else asked
        warming_up = self.judged < self.memory
        passes = warming_up | ~square.exceeds(self.limit.times(self.scale))
        judged = np.where(passes & warming_up, self.judged + 1, self.judged)
        part = scaled(np.ones_like(judged), 0).over(scaled(np.maximum(judged, 1), 0))
        change = square.minus(self.scale).times(part)
        scale = pick(passes, self.scale.plus(change), self.scale.times(self.widening))
        self.judged = np.where(asking, judged, self.judged)
        scale = pick((scale.e < self.floor.e - 1) | self.floor.exceeds(scale), self.floor, scale)
        scale = pick((scale.e > _SCALE_MAX.e + 1) | scale.exceeds(_SCALE_MAX), _SCALE_MAX, scale)
        self.scale = pick(asking, Scaled(integers(scale.m), integers(scale.e)), self.scale)
        return passes | ~asking

    def judge(self, square: Scaled, asked: Mask) -> tuple[Mask, Mask]:
        """Lanes that accept a residual of this square, and those of them that did not before [lanes]."""
        widened = self.scale.exceeds(self.usual)
        passes = self.passes(square, asked)
        if not self.is_on:
            return passes, np.zeros_like(passes)
        known = passes & asked
        opens = known & widened & square.exceeds(self.limit.times(self.usual))
        self.usual = pick(known, self.scale, self.usual)
        return passes, opens
