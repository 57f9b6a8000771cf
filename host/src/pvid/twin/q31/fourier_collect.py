"""Twin of fourier/collect_q31.c: the sums of windows, and what each tick does."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from pvid.settings.fourier_q31 import FourierDesignQ31
from pvid.twin.q31.fourier_front import first_step, is_held, jets
from pvid.twin.q31.fourier_sums import windows
from pvid.twin.q31.fourier_values import LATER, steps
from pvid.twin.q31.integer import Int

_BLOCK = 4
_LEAST_PAIRS = 16  # of a filter, a tick
_SHARING = 4  # the least D whose ticks share the work


class Tick(IntEnum):
    """pvid_fourier_tick."""

    BUSY = 0
    FREE = 1
    WINDOW = 2
    REJECTED = 3


@dataclass(frozen=True)
class Schedule:
    """Which tick of a stretch does what; tick 0 is its first.

    Attributes
    ----------
    decimation, hop : of the design
    first : tick in which the job of the first step begins
    job : ticks of a job
    at_once : each tick does all that is due
    slices : harmonics that a tick adds to
    adding : ticks that add a block
    """

    decimation: int
    hop: int
    first: int
    job: int
    at_once: bool
    slices: int
    adding: int

    @classmethod
    def of(cls, design: FourierDesignQ31) -> Schedule:
        """Of a design."""
        ticks = design.decimation
        share = ticks // 2 if ticks > 1 else 1
        pairs = sum(one.half for one in design.filter)
        each = max(-(-pairs // share), _LEAST_PAIRS)
        at_once = ticks < _SHARING
        job = max(-(-pairs // each), 1)
        others = ticks if at_once else ticks - job - 1
        slots = max(_BLOCK * others // 2, 1)
        harmonics = design.highest + 1
        slices = -(-harmonics // slots)
        return cls(
            decimation=ticks,
            hop=design.hop,
            first=first_step(design) + design.half + int(is_held(design)),
            job=job,
            at_once=at_once,
            slices=slices,
            adding=-(-harmonics // slices),
        )

    @property
    def free_ticks(self) -> int:
        """Before the next window is joined, at least."""
        ticks = self.decimation
        if self.at_once:
            return (self.hop - _BLOCK) * ticks
        return (self.hop // _BLOCK - 1) * (_BLOCK * (ticks - self.job - 1) - self.adding)

    def tick_of_jets(self, step: int) -> int:
        """In which the channels are made from the jets of a step."""
        return self.first + step * self.decimation + self.job - 1 + (0 if self.at_once else 1)

    def play(self, ticks: int, count: int) -> Int:
        """What each tick of a stretch does that has `count` steps of channels [ticks]."""
        out = np.full(ticks, Tick.FREE, np.int64)
        if not self.at_once:
            for begin in range(self.first, ticks, self.decimation):
                out[begin : begin + self.job + 1] = Tick.BUSY
        for block in range(count // _BLOCK):
            made = self.tick_of_jets(_BLOCK * (block + 1) - 1 + LATER)
            at = made if self.at_once else made + 1
            left = self.adding
            while left and at < ticks:
                if self.at_once or out[at] == Tick.FREE:
                    left -= 1
                    out[at] = Tick.FREE if self.at_once else Tick.BUSY
                    steps_done = _BLOCK * (block + 1)
                    if not left and steps_done % self.hop == 0 and steps_done > self.hop:
                        out[at] = Tick.WINDOW
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


def collect(counts: Int, design: FourierDesignQ31) -> Collected:
    """Of counts about their offsets [samples, ticks]."""
    plan = Schedule.of(design)
    total = counts.shape[1]
    within = np.all(np.abs(counts) <= np.array(design.full_scale)[:, np.newaxis], axis=0)
    runs = np.zeros(design.model.runs, np.int64)
    found, played = [np.zeros((0, len(design.model.channel), design.highest + 1, 2), np.int64)], []
    spreads = [np.zeros((0, len(counts)), np.int64)]
    lead = first_step(design)
    first = 0
    while first < total:
        beyond = np.flatnonzero(~within[first:])
        last = first + int(beyond[0]) if len(beyond) else total
        of_steps = jets(counts[:, first:last], design)
        whole = sum(1 for step in range(of_steps.shape[1]) if plan.tick_of_jets(step) < last - first)
        made = steps(of_steps[:, :whole], design, runs, lead)
        if whole and made.beyond != 0:
            lead = 0
        if made.beyond is not None:
            last = first + plan.tick_of_jets(made.beyond)
        ticks = plan.play(last - first, made.channels.shape[1])
        played.append(ticks)
        count = int(np.sum(ticks == Tick.WINDOW))
        found.append(windows(made, design)[:count])
        when = first + plan.tick_of_jets(0) + (LATER + np.arange(made.channels.shape[1])) * design.decimation
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
