"""Twin of weak/collect_q31.c: the sums of windows, and what each tick does."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from pvid.settings.weak_q31 import WeakDesignQ31
from pvid.twin.q31.integer import Int
from pvid.twin.q31.weak_front import early_jets, front_ticks, jets
from pvid.twin.q31.weak_sums import windows
from pvid.twin.q31.weak_values import LATER, steps
from pvid.twin.weak_ticks import FrontTicks

_BLOCK = 4


class Tick(IntEnum):
    """pvid_weak_tick."""

    BUSY = 0
    FREE = 1
    WINDOW = 2
    REJECTED = 3


@dataclass(frozen=True)
class Schedule:
    """Which tick of a stretch does what; tick 0 is its first.

    Attributes
    ----------
    front : its counters
    hop : of the design
    harmonics : H + 1
    """

    front: FrontTicks
    hop: int
    harmonics: int

    @classmethod
    def of(cls, design: WeakDesignQ31) -> Schedule:
        """Of a design."""
        return cls(front_ticks(design), design.hop, design.highest + 1)

    @property
    def _others(self) -> int:
        """Ticks of a block that add harmonics or run stages."""
        return _BLOCK * max(self.front.decimation - 1, 1)

    @property
    def items(self) -> int:
        """Harmonics that a tick adds or joins."""
        return -(-2 * self.harmonics // self._others)

    @property
    def free_ticks(self) -> int:
        """Before the next window is joined, at least."""
        return (self.hop // _BLOCK - 1) * (self._others - -(-self.harmonics // self.items))

    @property
    def ticks_behind_join(self) -> int:
        """Of those, before the next half's first block is added."""
        return max(self._others - -(-2 * self.harmonics // self.items), 0)

    def play(self, ticks: int, count: int) -> Int:
        """What each tick of a stretch does that has `count` steps of channels [ticks]."""
        at_once = self.front.decimation == 1
        out = np.full(ticks, Tick.FREE, np.int64)
        ends = self.front.ends(ticks)
        if not at_once:
            out[ends] = Tick.BUSY
        for block in range(count // _BLOCK):
            made = self.front.tick_of(_BLOCK * (block + 1) - 1 + LATER)
            at = made if at_once else made + 1
            steps = _BLOCK * (block + 1)
            joins = steps % self.hop == 0 and steps > self.hop
            left = (2 if joins else 1) * self.harmonics
            while left > 0 and at < ticks:
                if at_once or not ends[at]:
                    left -= self.items
                    out[at] = Tick.WINDOW if joins and left <= 0 else Tick.BUSY
                at += 1
        return out


@dataclass(frozen=True)
class Collected:
    """Of a run: S_h [windows, channels, H + 1, 2], and what each tick did [ticks].

    spreads : n times the variance of each sample over the n steps of a window [windows, samples]
    """

    windows: Int
    ticks: Int
    spreads: Int


def collect(counts: Int, design: WeakDesignQ31) -> Collected:
    """Of counts about their offsets [samples, ticks]."""
    plan = Schedule.of(design)
    total = counts.shape[1]
    within = np.all(np.abs(counts) <= np.array(design.full_scale)[:, np.newaxis], axis=0)
    runs = np.zeros(design.model.runs, np.int64)
    found, played = [np.zeros((0, len(design.model.channel), design.highest + 1, 2), np.int64)], []
    spreads = [np.zeros((0, len(counts)), np.int64)]
    ran = False
    first = 0
    while first < total:
        beyond = np.flatnonzero(~within[first:])
        last = first + int(beyond[0]) if len(beyond) else total
        of_steps = jets(counts[:, first:last], design)
        early = None if ran else early_jets(counts[:, first:last], design)
        made = steps(of_steps, design, runs, early, plan.front.first)
        ran = ran or bool(of_steps.shape[1] and made.beyond != 0)
        if made.beyond is not None:
            last = first + plan.front.tick_of(made.beyond)
        ticks = plan.play(last - first, made.channels.shape[1])
        played.append(ticks)
        count = int(np.sum(ticks == Tick.WINDOW))
        found.append(windows(made, design)[:count])
        when = first + plan.front.tick_of(0) + (LATER + np.arange(made.channels.shape[1])) * design.decimation
        spreads.append(_spreads(counts[:, when], design.hop)[:count])
        runs = made.runs
        if last < total:
            played.append(np.array([Tick.REJECTED]))
        first = last + 1
    return Collected(np.concatenate(found), np.concatenate(played), np.concatenate(spreads))


def _spreads(x: Int, hop: int) -> Int:
    """Of samples at steps [samples, n]: [windows, samples]."""
    halves = x[:, : x.shape[1] // hop * hop].reshape(len(x), -1, hop)
    total, square = np.add.reduce(halves, axis=-1), np.add.reduce(halves * halves, axis=-1)
    n = 2 * hop
    of_windows, squares = total[:, :-1] + total[:, 1:], square[:, :-1] + square[:, 1:]
    mean = np.sign(of_windows) * (np.abs(of_windows) // n)
    return np.asarray(squares - mean * (2 * of_windows - n * mean)).T
