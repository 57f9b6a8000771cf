"""What changed in the parameters of a fleet: steps and trends of a board over its recordings that are beyond chance.

The recordings of one board share errors of scale, and mostly those of the model: both are the same before and after and
say nothing about a change. So a change is compared with the noise of the recordings and with their own scatter, and
with what the errors of a recording exceed the usual ones of its board by, which the others do not share.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from pvid.fleet.row import Row

Float = npt.NDArray[np.float64]

FALSE_ALARMS = 0.01  # probability that anything is named in a fleet in which nothing changes
_FEWEST = 4  # recordings whose own scatter is compared with
_OF_FEW = 4.0  # standard errors, of fewer
_PARTS = 3  # kinds of change, which share the probability: trend, step, from one date to another


@dataclass(frozen=True)
class Change:
    """Of a parameter of a board.

    Attributes
    ----------
    kind : a step between two recordings, or a trend over all of them
    start, end : seconds since 1970, of the last recording before it and the first behind
    before, after : value [unit of the parameter]
    """

    kind: Literal["step", "trend"]
    start: float
    end: float
    before: float
    after: float

    @property
    def part(self) -> float:
        """Of the value before."""
        return (self.after - self.before) / abs(self.before) if self.before else np.inf * (self.after - self.before)


@dataclass(frozen=True, eq=False)
class Series:
    """A parameter of a board over its recordings, in the order of time; at least one.

    Attributes
    ----------
    t : seconds since 1970
    value : [unit]
    noise : standard error of what its recordings do not share [unit]
    apart : standard error without scale [unit]
    chance : probability that a change is found where there is none
    """

    board: str
    name: str
    unit: str
    t: Float
    value: Float
    noise: Float
    apart: Float
    chance: float

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """In the order of time."""
        n = self.t.size
        if n < _FEWEST:
            apart = np.hypot(self.apart[:-1], self.apart[1:])
            steps = np.flatnonzero(np.abs(np.diff(self.value)) > _OF_FEW * apart) + 1
            return tuple(self._steps([0, *steps.tolist(), n]))
        marks, trends = {0, n}, []
        todo = [(0, n)]
        while todo:
            start, end = todo.pop()
            found = self._best(start, end)
            if found is None:
                continue
            if isinstance(found, Change):
                trends.append(found)
                continue
            inner = [start, *(one for one in found if start < one < end), end]
            marks |= set(inner)
            todo += pairwise(inner)
        return tuple(sorted([*self._steps(sorted(marks)), *trends], key=lambda one: one.start))

    def _best(self, start: int, end: int) -> tuple[int, int] | Change | None:
        """What explains most of recordings `start` to `end` - 1: from which to which one the value differs, or a trend;
        None: chance does."""
        n = end - start
        if n < _FEWEST:
            return None
        t, v, w = self.t[start:end], self.value[start:end], self.noise[start:end] ** -2.0
        v = v - w @ v / w.sum()
        whole = float(w @ v**2)
        centre = t - w @ t / w.sum()
        gains = np.zeros((n, n + 1))  # of the sum of squares, if recordings a to b - 1 differ
        weight, moment = (np.concatenate([[0.0], np.cumsum(one)]) for one in (w, w * v))
        inside = weight - weight[:n, None]
        spread = inside - inside**2 / w.sum()
        a, b = np.arange(n)[:, None], np.arange(n + 1)
        proper = (b > a) & (b - a < n) & ((a > 0) | (b < n))
        np.divide((moment - moment[:n, None]) ** 2, spread, out=gains, where=proper & (spread > 0))
        ends = np.where((a == 0) | (b == n), gains, 0.0)
        chance = self.chance / _PARTS
        drift = float(w @ (centre * v)) / float(w @ centre**2) if np.ptp(t) > 0 else 0.0
        candidates = [
            (drift**2 * float(w @ centre**2), chance, None),
            (float(ends.max()), chance / (n - 1), np.unravel_index(ends.argmax(), ends.shape)),
            (float(gains.max()), chance / (n * (n - 1) / 2), np.unravel_index(gains.argmax(), gains.shape)),
        ]
        gain, _, place = max(
            (one for one in candidates if self._beyond(one[0], whole, n, one[1])),
            key=lambda one: one[0],
            default=(0.0, 0.0, ()),
        )
        if place is None:
            value = self.value[start:end]
            line = w @ value / w.sum() + drift * centre
            return Change("trend", float(t[0]), float(t[-1]), float(line[0]), float(line[-1]))
        return (start + int(place[0]), start + int(place[1])) if gain else None

    @staticmethod
    def _beyond(gain: float, whole: float, n: int, chance: float) -> bool:
        """Whether a change that takes `gain` from a sum of squares is beyond chance: Student's t of n - 2 degrees of
        freedom, with the scatter about it, or the noise where that is larger."""
        variance = max(1.0, (whole - gain) / (n - 2))
        return bool((gain / variance) ** 0.5 > -stdtrit(n - 2, chance / 2))

    def _steps(self, marks: Sequence[int]) -> Iterator[Change]:
        """Between the stretches that begin at `marks`."""
        means = [float(np.average(self.value[a:b], weights=self.noise[a:b] ** -2.0)) for a, b in pairwise(marks)]
        for mark, (before, after) in zip(marks[1:-1], pairwise(means), strict=True):
            yield Change("step", float(self.t[mark - 1]), float(self.t[mark]), before, after)

    @property
    def latest(self) -> tuple[float, float]:
        """The mean over the recordings since the last step, or the end of their trend, and its standard error without
        scale: of the noise and the scatter, and not below the part that they may share [unit]."""
        steps = [one.end for one in self.changes if one.kind == "step"]
        since = self.t >= (steps[-1] if steps else self.t[0])
        v, w = self.value[since], self.noise[since] ** -2.0
        trend = any(one.kind == "trend" and one.end == self.t[-1] for one in self.changes)
        columns = np.stack([np.ones(v.size), *([self.t[since] - self.t[-1]] if trend else [])], axis=1)
        inverse = np.linalg.inv(columns.T @ (w[:, None] * columns))
        line = inverse @ (columns.T @ (w * v))
        scatter = float(w @ (v - columns @ line) ** 2) / max(1, v.size - line.size)
        shared = float(np.sqrt(np.maximum(0.0, self.apart[since] ** 2 - 1 / w)).min())
        return float(line[0]), float(np.hypot((max(1.0, scatter) * inverse[0, 0]) ** 0.5, shared))


def series_of(rows: Sequence[Row]) -> list[Series]:
    """Of every board and parameter, recordings with a warning too."""
    points: dict[tuple[str, str, str], list[tuple[float, float, float, float]]] = {}
    for row in sorted(rows, key=lambda row: row.began):
        for name, (value, se, unit) in row.parameters.items():
            apart = row.se_apart.get(name, se)
            noise = row.se_noise.get(name, apart)
            if min(apart, noise) > 0 and np.isfinite([value, apart, noise]).all():
                points.setdefault((row.board, name, unit), []).append((row.began, value, noise, apart))
    out = []
    for (board, name, unit), own in points.items():
        t, value, noise, apart = np.array(own).T
        noise = np.sqrt(noise**2 + np.maximum(0.0, apart**2 - np.median(apart) ** 2))
        out.append(Series(board, name, unit, t, value, noise, apart, FALSE_ALARMS / len(points)))
    return out
