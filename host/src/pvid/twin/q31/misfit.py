"""Twin of misfit_q31.c: the misfit alarm of the strong form, in several lanes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.twin.q31.integer import Int, clamp, integers, round_shift
from pvid.twin.q31.scaled import Scaled, pick, scaled

Mask = npt.NDArray[np.bool_]

_BLOCK_S, _ROWS_MAX, _FEW = 4, 65535, 64
_SENSITIVITY_SHIFT, _SENSITIVITY_LIMIT = 3, 2**28
_MOST, _LEAST = Scaled(integers(549755814), integers(-37)), Scaled(integers(703687442), integers(-45))
_TIMES = scaled(3, 0)
_UNKNOWN = scaled(1, 120)
_GROWTH_MAX = scaled(1, 1)


class MisfitQ31:
    """pvid_misfit_q31 of every lane, and `alarm` [lanes]: whether the last block of rows was a misfit.

    forgetting_groups: of each lane [lanes].
    """

    def __init__(self, drive_ticks: int, forgetting_groups: npt.ArrayLike) -> None:
        groups = integers(forgetting_groups)
        self._nothing = scaled(np.zeros_like(groups), 0)
        never = scaled(np.ones_like(groups), 0)
        part = scaled(np.full_like(groups, drive_ticks), 0).over(scaled(np.maximum(groups, 1), 0))
        growth = never.plus(part)
        growth = pick(growth.exceeds(_GROWTH_MAX), _GROWTH_MAX, growth)
        self.growth = pick(groups > 0, growth, never)
        self.few_rss = np.zeros_like(groups)
        self.few_signal = np.zeros_like(groups)
        self.rss = self._nothing
        self.signal = self._nothing
        self.least_rss = self._nothing.plus(_UNKNOWN)
        self.least_part = self._nothing.plus(_UNKNOWN)
        self.block = min(_BLOCK_S * drive_ticks, _ROWS_MAX)
        self.left = self.block
        self.alarm = np.zeros(groups.shape, np.bool_)

    def take(self, square: Int, sensitivity: Int) -> None:
        """A row of every lane: the square of its residual and p[0] times its gradient in p[0], [lanes]."""
        held = clamp(round_shift(sensitivity, _SENSITIVITY_SHIFT), _SENSITIVITY_LIMIT)
        self.few_rss = self.few_rss + square
        self.few_signal = self.few_signal + held * held
        self.left -= 1
        if self.left % _FEW == 0:
            self.rss = self.rss.plus(scaled(self.few_rss, 0))
            self.signal = self.signal.plus(scaled(self.few_signal, 2 * _SENSITIVITY_SHIFT))
            self.few_rss = np.zeros_like(self.few_rss)
            self.few_signal = np.zeros_like(self.few_signal)
        if self.left == 0:
            self._judge()

    def _judge(self) -> None:
        moves = self.signal.m > 0
        part = self.rss.over(Scaled(np.where(moves, self.signal.m, 1), self.signal.e))
        has_reference = _UNKNOWN.exceeds(self.least_part)
        larger = self.rss.exceeds(_TIMES.times(self.least_rss)) & part.exceeds(_TIMES.times(self.least_part))
        self.alarm = moves & has_reference & ((larger & part.exceeds(_LEAST)) | part.exceeds(_MOST))
        self.least_rss = pick(moves, self._least(self.least_rss, self.rss), self.least_rss)
        self.least_part = pick(moves, self._least(self.least_part, part), self.least_part)
        self.rss = self._nothing
        self.signal = self._nothing
        self.left = self.block

    def _least(self, least: Scaled, now: Scaled) -> Scaled:
        grown = least.times(self.growth)
        risen = pick(grown.exceeds(_UNKNOWN), _UNKNOWN, grown)
        return pick(risen.exceeds(now), now, risen)
