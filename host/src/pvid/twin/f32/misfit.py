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
        self.left = self.block
        self.alarm = np.zeros(lanes, np.bool_)

    def take(self, e: Float32, sensitivity: Float32) -> None:
        """A row of every lane: its residual and p[0] times its gradient in p[0], [lanes]."""
        self.rss = self.rss + e * e
        self.signal = self.signal + sensitivity * sensitivity
        self.left -= 1
        if self.left == 0:
            self._judge()

    def _judge(self) -> None:
        part = self.rss / self.signal
        has_reference = self.least_part < _UNKNOWN
        larger = (self.rss > TIMES * self.least_rss) & (part > TIMES * self.least_part) & (part > LEAST)
        numbers = np.isfinite(self.rss) & np.isfinite(self.signal)
        moves = numbers & (self.signal > 0)
        self.alarm = ~numbers | (moves & has_reference & (larger | (part > MOST)))
        self.least_rss = np.where(moves, self._least(self.least_rss, self.rss), self.least_rss)
        self.least_part = np.where(moves, self._least(self.least_part, part), self.least_part)
        self.rss = np.zeros_like(self.rss)
        self.signal = np.zeros_like(self.signal)
        self.left = self.block

    def _least(self, least: Float32, now: Float32) -> Float32:
        grown = least * self.growth
        risen = np.where(grown < _UNKNOWN, grown, _UNKNOWN)
        return np.where(now < risen, now, risen)
