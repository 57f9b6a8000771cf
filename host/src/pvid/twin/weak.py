"""The schedule of weak_f32.c: stages of a window, and harmonics and stages of a free tick."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pvid.settings.weak import WeakConfig
from pvid.twin.f32.estimator import RelativeEstimator
from pvid.twin.f32.weak_finish import Finish

_F = np.float32
_BLOCK = 8
_TWO_TICKS = 4  # least decimation whose jets and channels have a tick each


@dataclass(frozen=True)
class WeakSchedule:
    """Twin of weak/ticks_f32.h: harmonics and stages of a free tick.

    free_ticks: those of a block of steps
    """

    free_ticks: int
    hop: int
    harmonics: int

    @property
    def items_per_tick(self) -> int:
        """Harmonics that a tick adds or joins."""
        return -(-2 * self.harmonics // self.free_ticks)

    def room_for(self, stages: int, stages_per_tick: int) -> bool:
        """Whether so many stages of a window end before the next half's first block is added to the sums."""
        joining = -(-2 * self.harmonics // self.items_per_tick)
        return stages <= stages_per_tick * (self.free_ticks - joining)

    def stages_per_tick(self, stages: int) -> int:
        """Fewest stages per tick that finish a window before the next one is joined."""
        adding = -(-self.harmonics // self.items_per_tick)
        ticks = (self.hop // _BLOCK - 1) * (self.free_ticks - adding)
        return -(-stages // ticks)


def shares_place(config: WeakConfig) -> bool:
    """Whether a window's sums may take the place of the older half's."""
    design = config.design
    model = design.model
    functions = _F(design.functions) * _F(model.kinds)
    weight = (functions - _F(sum(one.nuisances for one in model.kind))) / functions
    own = replace(config.estimator, row_weight=float(weight), correlation=design.overlap)
    pattern: Any = model.model
    rate = _F(config.sample_rate) / (_F(design.decimation) * _F(design.hop))
    estimator = RelativeEstimator([own], float(rate), pattern)
    finish = Finish(config, estimator)
    used = 2 if design.decimation >= _TWO_TICKS else 1
    schedule = WeakSchedule(_BLOCK * max(design.decimation - used, 1), design.hop, design.highest + 1)
    return schedule.room_for(finish.stages_of_columns, schedule.stages_per_tick(finish.stages))
