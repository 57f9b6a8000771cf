"""Twin of misfit_f32.c: when the strong form leaves more unexplained than it should, in several lanes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

MOST, LEAST, TIMES, BLOCK_S = np.float32(4e-3), np.float32(2e-5), np.float32(3), np.float32(4)
_UNKNOWN = np.float32(1e35)
_ROWS_MAX, _GROWTH_MAX, _SLOWER = np.float32(65535), np.float32(2), np.float32(4)


class Misfit:
    """pvid_misfit_f32 of every lane, and `alarm` [lanes]: whether the last block of rows was a misfit."""

    def __init__(self, rate: np.float32, forgetting_s: Float32) -> None:
        lanes = len(forgetting_s)
        with np.errstate(all="ignore"):
            growth = np.float32(1) + BLOCK_S / (_SLOWER * forgetting_s)
        growth = np.where(forgetting_s > 0, growth, np.float32(1))
        self.growth = np.where(growth < _GROWTH_MAX, growth, _GROWTH_MAX)
        self.rss = np.zeros(lanes, np.float32)
        self.signal = np.zeros(lanes, np.float32)
        self.least_rss = np.full(lanes, _UNKNOWN)
        self.least_part = np.full(lanes, _UNKNOWN)
        self.block = int(np.clip(BLOCK_S * rate, np.float32(1), _ROWS_MAX))
        self.left = np.full(lanes, self.block)
        self.alarm = np.zeros(lanes, np.bool_)

    def add(self, e: Float32, sensitivity: Float32) -> None:
        """A row of every lane: its residual and p[0] times its gradient in p[0], [lanes]."""
        self.rss = self.rss + e * e
        self.signal = self.signal + sensitivity * sensitivity
        self.left -= 1

    def end_row(self, deferred: Mask) -> None:
        """Judges the blocks that end with this row; those deferred [lanes] take one row more."""
        ends = self.left == 0
        self.left[ends & deferred] = 1
        due = ends & ~deferred
        if due.any():
            self._judge(due)

    def _judge(self, due: Mask) -> None:
        part = self.rss / self.signal
        has_reference = self.least_part < _UNKNOWN
        larger = (self.rss > TIMES * self.least_rss) & (part > TIMES * self.least_part) & (part > LEAST)
        numbers = np.isfinite(self.rss + self.signal)
        moves = numbers & (self.signal > 0)
        alarm = ~numbers | (moves & has_reference & (larger | (part > MOST)))
        self.alarm = np.where(due, alarm, self.alarm)
        self.least_rss = np.where(due & moves, self._least(self.least_rss, self.rss), self.least_rss)
        self.least_part = np.where(due & moves, self._least(self.least_part, part), self.least_part)
        self.rss = np.where(due, np.float32(0), self.rss)
        self.signal = np.where(due, np.float32(0), self.signal)
        self.left = np.where(due, self.block, self.left)

    def _least(self, least: Float32, now: Float32) -> Float32:
        grown = least * self.growth
        risen = np.where(grown < _UNKNOWN, grown, _UNKNOWN)
        return np.where(now < risen, now, risen)
