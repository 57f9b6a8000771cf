"""Twin of refine_front_f32.c: from samples to the signals of the refinement."""

from __future__ import annotations

from enum import Enum

import numpy as np

from pvid.settings.refine import RefineConfig
from pvid.settings.weak import Source
from pvid.twin.f32.refine_model import Float32, RefineShape
from pvid.twin.f32.refine_pass import PartSignals, Signals

_F = np.float32
_FULL_SCALE = _F(32767)
_MISSING = -32768
_LATE = 3  # PVID_REFINE_LATE
_PERIOD = 64
_PART = _F(0.58)
_LARGEST = _F(3.4e38)
_MOST_COUNTS = _F(2e9)


class Entry(Enum):
    """pvid_refine_entry."""

    NOTHING = 0
    ENTERED = 1
    BROKEN = 2


def _weights_of_samples(t: np.float32) -> tuple[np.float32, ...]:
    """Of four entries at `t` between the second and the third one."""
    before, behind, last = t + _F(1), t - _F(1), t - _F(2)
    return (
        ((t * behind) * last) * _F(-1 / 6),
        ((before * behind) * last) * _F(0.5),
        ((before * t) * last) * _F(-0.5),
        ((before * t) * behind) * _F(1 / 6),
    )


def _weights_of_means(t: np.float32, flat: bool) -> tuple[np.float32, ...]:
    """The same for means of the steps behind the entries."""
    place = _F(0) if flat else t - _F(0.5)
    bend = _F(0) if flat else _F(0.5) * ((place * place) - _F(1 / 12))
    return bend - _F(0.5) * place, _F(1) - _F(2) * bend, bend + _F(0.5) * place, _F(0)


class Front:
    """pvid_refine_front_f32."""

    def __init__(self, config: RefineConfig, shape: RefineShape) -> None:
        self.config, self.inputs = config, shape.inputs
        self.size, self.runge_kutta = shape.ring, shape.runge_kutta
        signals = config.signal
        ratio = _F(config.ratio)
        self.share = _F(1) / ratio
        self.to_counts = np.array([_F(one.scale) * (_FULL_SCALE / _F(one.range)) for one in signals], _F)
        self.from_counts = np.array([_F(one.range) / _FULL_SCALE for one in signals], _F)
        self.is_held = [one.source is Source.HELD for one in signals]
        steps = _F(1) / (ratio * ratio)
        self.turning = [*[False] * shape.inputs, *(shape.turning or [False] * shape.outputs)]
        self.turn = np.where(self.turning, _F(65536) * self.from_counts, _F(0)).astype(_F)[shape.inputs :]
        self.held_between = [shape.runge_kutta and one for one in self.is_held]
        self.middle, self.between = config.ratio - (config.ratio - 1) // 2, config.ratio % 2 == 0
        self.droop = np.where(self.is_held, _F(1) + steps, _F(1) - steps) / _F(24)
        self.derived = [one.order == 2 for one in signals]
        self.sample = [one.sample for one in signals]
        self.second = None if config.second is None else np.asarray(config.second, _F)
        self.half = 0 if self.second is None else len(self.second) - 1
        half = _F(0.5) / _F(config.sample_rate)
        self.half_tick = np.array([half if one.order == -1 else 0 for one in signals], _F)
        self.integral = np.zeros(len(signals), _F)
        self.behind = _LATE + (self.half if any(self.derived) else 0)
        self.gate = _F(config.outlier_gate)
        self.gated = [config.outlier_gate > 0 and (one.order == 2 or i >= self.inputs) for i, one in enumerate(signals)]
        self.ring = np.zeros((self.size, len(signals)), np.int16)
        self.reset()

    def reset(self) -> None:
        """pvid_refine_front_reset_f32."""
        self.wait, self.means, self.next, self.referred = self.config.ratio, 0, 0, False
        self.sum = np.zeros(len(self.sample), _F)
        self.rest = np.zeros(len(self.sample), _F)
        self.held = np.zeros(len(self.sample), _F)
        self.line: list[list[np.float32]] = [[] for _ in self.sample]
        self.difference = np.zeros((4, len(self.sample)), _F)  # the last mean and its differences of orders 1 to 3
        self.fourth = np.zeros((2, len(self.sample)), _F)  # the last two fourth differences, latest first
        self.peak = np.full(len(self.sample), _LARGEST, _F)
        self.usual = self.peak.copy()
        self.postponed = False

    @property
    def end(self) -> int:
        """Entries that are complete."""
        return max(self.next - self.behind, 0)

    @property
    def first(self) -> int:
        """First entry that a block may begin at."""
        return self.behind - _LATE + self.runge_kutta

    @property
    def room(self) -> int:
        """Older entries are overwritten."""
        return self.size - self.behind

    def _second_derivative(self, line: list[np.float32]) -> np.float32:
        assert self.second is not None
        total = self.second[0] * line[self.half]
        for i in range(1, self.half + 1):
            total = total + self.second[i] * (line[self.half - i] + line[self.half + i])
        return _F(total)

    def _leave_out(self, signal: int, off: np.float32) -> None:
        """Takes a wild mean out: that of the last entry but one."""
        beside = -(self.droop[signal] * off)
        for back, part in enumerate((beside, off - _F(2) * beside, beside), start=1):
            if self.derived[signal]:
                self.line[signal][-back] = self.line[signal][-back] - part
            else:
                self.ring[(self.next - back) % self.size, signal] = _MISSING

    def _judge(self, signal: int, newest: np.float32) -> np.float32:
        """By how much the mean is off to which the last fourth difference belongs."""
        middle, before = self.fourth[:, signal]
        limit, size = self.gate * self.usual[signal], np.abs(middle)
        if np.abs(newest) <= limit:
            self.peak[signal] = np.abs(newest)
        if not size > limit:
            return _F(0)
        opposite = [-one if middle > 0 else one for one in (newest, before)]
        if all(_PART * size < one < size for one in opposite):
            off = middle * _F(1 / 6)
            self._leave_out(signal, off)
            return _F(off)
        if size > np.abs(newest) and size > np.abs(before) and size > self.peak[signal]:
            self.peak[signal] = size
        return _F(0)

    def _end_period(self) -> None:
        with np.errstate(over="ignore"):  # before the first period has ended
            stands_out = np.any(np.abs(self.fourth[0]) > self.gate * self.usual)
        if not self.postponed and stands_out:
            self.postponed = True
            return
        self.postponed = False
        for signal in np.flatnonzero(self.gated):
            self.usual[signal], self.peak[signal] = self.peak[signal], 0

    def _counts(self, signal: int, x: np.float32) -> int:
        """x in counts and what rounding left of the entry before, rounded to the nearest one; _MISSING if it is not
        finite or beyond full scale."""
        whole = x * self.to_counts[signal] + self.rest[signal]
        if self.turning[signal]:
            return self._counts_of_turning(signal, whole)
        if not -_FULL_SCALE < whole < _FULL_SCALE:
            self.rest[signal] = 0
            return _MISSING
        rounded = int(whole - _F(0.5) if whole < 0 else whole + _F(0.5))
        self.rest[signal] = whole - _F(rounded)
        return rounded

    def _counts_of_turning(self, signal: int, whole: np.float32) -> int:
        """The same without whole turns."""
        if not -_MOST_COUNTS < whole < _MOST_COUNTS:
            self.rest[signal] = 0
            return _MISSING
        rounded = int(whole + (_F(-0.5) if whole < 0 else _F(0.5)))
        self.rest[signal] = whole - _F(rounded)
        return max((rounded + 0x8000) % 0x10000 - 0x8000, _MISSING + 1)

    def _enter(self, signal: int, x: np.float32) -> int:
        """What is entered, which of a second derivative is an earlier entry."""
        entry = self.next
        if self.derived[signal]:
            line = self.line[signal]
            line.append(x)
            if len(line) > 2 * self.half + 1 + _LATE:
                del line[: len(line) - 2 * self.half - 1 - _LATE]
            if len(line) < 2 * self.half + 1 + _LATE:
                return 0
            entry -= self.half + _LATE
            x = self._second_derivative(line)
        count = self._counts(signal, x)
        self.ring[entry % self.size, signal] = count
        return count

    def _end_block(self, last: Float32) -> Entry:
        if not self.runge_kutta:
            self.sum = np.where(self.is_held, self.sum + _F(0.5) * (self.held - last), self.sum)
            self.held = last
        if not np.all(np.isfinite(self.sum[: self.inputs])):
            return Entry.BROKEN
        known = self.means >= 2
        x = self.sum * self.share
        middle = self.difference[0].copy()
        first = x - middle
        second = first - self.difference[1]
        third = second - self.difference[2]
        fourth = third - self.difference[3]
        for signal in range(len(x)):
            if np.abs(fourth[signal]) > self.peak[signal]:
                off = self._judge(signal, fourth[signal])
                third[signal] += off
                fourth[signal] += _F(4) * off
            entry = middle[signal] - self.droop[signal] * second[signal]
            if self.held_between[signal]:
                entry = (self.held[signal] + self.ahead[signal]) * self.share
                self.held[signal] = self.sum[signal] - self.ahead[signal]
            if known:
                if self._enter(signal, entry) == _MISSING and signal < self.inputs:
                    return Entry.BROKEN  # beyond its range
        self.difference = np.stack([x, first, second, third])
        self.fourth = np.stack([fourth, self.fourth[0]])
        self.sum = np.zeros_like(self.sum)
        self.wait = self.config.ratio
        if not known:
            self.means += 1
            return Entry.NOTHING
        self.next += 1
        if self.next % _PERIOD == 0:
            self._end_period()
        return Entry.ENTERED

    def step(self, sample: Float32) -> Entry:
        """A tick."""
        given = sample[self.sample]
        if not self.referred:
            self.reference = np.where(self.derived, given, _F(0))
            self.held = given - self.reference
            self.before = -given  # the first trapezoid is empty
            self.referred = True
        x = self._integrated(given, given - self.reference)
        if self.runge_kutta and self.wait == self.middle:
            self.ahead = self.sum + _F(0.5) * x if self.between else self.sum
        self.sum = self.sum + x
        self.wait -= 1
        return Entry.NOTHING if self.wait > 0 else self._end_block(given - self.reference)

    def _integrated(self, given: Float32, x: Float32) -> Float32:
        """With integrals by trapezoids where they are wanted."""
        if not np.any(self.half_tick):
            return x
        share = self.half_tick * (given + self.before)
        self.before = given
        self.integral = self.integral + np.where(np.isfinite(share), share, _F(0))
        return np.where(self.half_tick > 0, np.where(np.isfinite(share), self.integral, share), x)

    def read(self, entry: int) -> Signals:
        """Signals of an entry."""
        value = self.ring[entry % self.size]
        found = value.astype(_F) * self.from_counts
        outputs = np.where(value[self.inputs :] == _MISSING, _F(np.nan), found[self.inputs :])
        return found[: self.inputs], outputs

    def read_part(self, entry: int, since: np.float32, to: np.float32) -> PartSignals:
        """Signals of a part of the step from an entry to the next one."""
        counts = np.array([self.ring[(entry + k) % self.size, : self.inputs] for k in (-1, 0, 1, 2)], _F)
        share, held = self.from_counts[: self.inputs], self.held_between[: self.inputs]
        found: list[Float32] = []
        for t in (since, _F(0.5) * (since + to), to):
            total = np.zeros(self.inputs, _F)
            weights = zip(_weights_of_samples(t), _weights_of_means(t, self.config.ratio == 1), strict=True)
            for (of_sample, of_mean), one in zip(weights, counts, strict=True):
                total = total + np.where(held, of_mean, of_sample) * one
            found.append(total * share)
        u, middle, end = found
        return PartSignals(u, middle, end, self.read(entry + 1)[1])
