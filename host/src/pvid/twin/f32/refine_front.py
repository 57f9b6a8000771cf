"""Twin of refine_front_f32.c: from samples to the signals of the refinement."""

from __future__ import annotations

from enum import Enum

import numpy as np

from pvid.settings.refine import RefineConfig
from pvid.settings.weak import Source
from pvid.twin.f32.refine_model import Float32, RefineShape
from pvid.twin.f32.refine_pass import Signals

_F = np.float32
_FULL_SCALE = _F(32767)
_MISSING = -32768
RING = 512


class Entry(Enum):
    """pvid_refine_entry."""

    NOTHING = 0
    ENTERED = 1
    BROKEN = 2


class Front:
    """pvid_refine_front_f32."""

    def __init__(self, config: RefineConfig, shape: RefineShape) -> None:
        self.config, self.inputs = config, shape.inputs
        signals = config.signal
        ratio = _F(config.ratio)
        self.share = _F(1) / ratio
        self.to_counts = np.array([_F(one.scale) * (_FULL_SCALE / _F(one.range)) for one in signals], _F)
        self.from_counts = np.array([_F(one.range) / _FULL_SCALE for one in signals], _F)
        self.is_held = [one.source is Source.HELD for one in signals]
        steps = _F(1) / (ratio * ratio)
        self.droop = np.where(self.is_held, _F(1) + steps, _F(1) - steps) / _F(24)
        self.derived = [one.order == 2 for one in signals]
        self.sample = [one.sample for one in signals]
        self.second = None if config.second is None else np.asarray(config.second, _F)
        self.half = 0 if self.second is None else len(self.second) - 1
        self.behind = self.half if any(self.derived) else 0
        self.ring = np.zeros((RING, len(signals)), np.int16)
        self.mean = np.zeros((2, len(signals)), _F)
        self.reset()

    def reset(self) -> None:
        """pvid_refine_front_reset_f32."""
        self.wait, self.means, self.next, self.referred = self.config.ratio, 0, 0, False
        self.sum = np.zeros(len(self.sample), _F)
        self.rest = np.zeros(len(self.sample), _F)
        self.held = np.zeros(len(self.sample), _F)
        self.line: list[list[np.float32]] = [[] for _ in self.sample]

    @property
    def end(self) -> int:
        """Entries that are complete."""
        return max(self.next - self.behind, 0)

    @property
    def first(self) -> int:
        """First entry that a block may begin at."""
        return self.behind

    @property
    def room(self) -> int:
        """Older entries are overwritten."""
        return RING - self.behind

    def _second_derivative(self, line: list[np.float32]) -> np.float32:
        assert self.second is not None
        total = self.second[0] * line[self.half]
        for i in range(1, self.half + 1):
            total = total + self.second[i] * (line[self.half - i] + line[self.half + i])
        return _F(total)

    def _counts(self, signal: int, x: np.float32) -> int:
        """x in counts and what rounding left of the entry before, rounded to the nearest one; _MISSING if it is not
        finite or beyond full scale."""
        whole = x * self.to_counts[signal] + self.rest[signal]
        if not -_FULL_SCALE < whole < _FULL_SCALE:
            self.rest[signal] = 0
            return _MISSING
        rounded = int(whole - _F(0.5) if whole < 0 else whole + _F(0.5))
        self.rest[signal] = whole - _F(rounded)
        return rounded

    def _enter(self, signal: int, x: np.float32) -> None:
        if self.derived[signal]:
            line = self.line[signal]
            line.append(x)
            if len(line) > 2 * self.half:
                del line[: len(line) - 2 * self.half - 1]
                place = (self.next - self.half) % RING
                self.ring[place, signal] = self._counts(signal, self._second_derivative(line))
        else:
            self.ring[self.next % RING, signal] = self._counts(signal, x)

    def _end_block(self, last: Float32) -> Entry:
        self.sum = np.where(self.is_held, self.sum + _F(0.5) * (self.held - last), self.sum)
        self.held = last
        if not np.all(np.isfinite(self.sum[: self.inputs])):
            return Entry.BROKEN
        known = self.means >= 2
        x = self.sum * self.share
        middle = self.mean[0].copy()
        if known:
            undone = middle - self.droop * ((self.mean[1] - _F(2) * middle) + x)
            for signal, value in enumerate(undone):
                self._enter(signal, value)
        self.mean[1], self.mean[0] = middle, x
        self.sum = np.zeros_like(self.sum)
        self.wait = self.config.ratio
        if not known:
            self.means += 1
            return Entry.NOTHING
        self.next += 1
        return Entry.ENTERED

    def step(self, sample: Float32) -> Entry:
        """A tick."""
        given = sample[self.sample]
        if not self.referred:
            self.reference = np.where(self.derived, given, _F(0))
            self.held = given - self.reference
            self.referred = True
        self.sum = self.sum + (given - self.reference)
        self.wait -= 1
        return Entry.NOTHING if self.wait > 0 else self._end_block(given - self.reference)

    def read(self, entry: int) -> Signals:
        """Signals of an entry."""
        value = self.ring[entry % RING]
        found = value.astype(_F) * self.from_counts
        outputs = np.where(value[self.inputs :] == _MISSING, _F(np.nan), found[self.inputs :])
        return found[: self.inputs], outputs
