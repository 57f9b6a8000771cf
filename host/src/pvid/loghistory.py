"""What a view of a recording remembers, in bounded memory however long it lasts.

Of the estimates the whole history, thinned evenly; of the samples the last seconds. Times are seconds since the
first record, by the PC's clock when a segment began and the board's from there on.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.link import Hello, Message
from pvid.logreader import Account, Record
from pvid.logvalues import TABLES, Values

Float = npt.NDArray[np.float64]

NUMBERS = tuple(name for name, column in TABLES["estimates"].items() if column.kind == "f8" and name != "t")
_MOST_SAMPLES = 200_000


class Rates:
    """Samples and bytes a second, over the last seconds."""

    def __init__(self, over_s: float = 2.0) -> None:
        self._over_s = over_s
        self._counts: deque[tuple[float, int, int]] = deque()  # when, samples, bytes

    def now(self, account: Account, when: float) -> tuple[float, float]:
        """At the time `when` (of time.monotonic), which may be asked often."""
        counts = self._counts
        counts.append((when, account.samples, account.bytes))
        while len(counts) > 2 and when - counts[1][0] > self._over_s:
            counts.popleft()
        passed = max(when - counts[0][0], 1e-9)
        return (account.samples - counts[0][1]) / passed, (account.bytes - counts[0][2]) / passed


class Thinned:
    """Rows of numbers of which at most 2 `points` are kept, evenly spaced but for the newest, which always is."""

    def __init__(self, points: int) -> None:
        self.points = points
        self.rows: list[tuple[float, ...]] = []
        self._stride = 1
        self._seen = 0

    def append(self, row: tuple[float, ...]) -> None:
        """The next row."""
        if self._seen > 0 and (self._seen - 1) % self._stride != 0:
            self.rows.pop()
        self._seen += 1
        self.rows.append(row)
        if len(self.rows) >= 2 * self.points and (self._seen - 1) % self._stride == 0:
            newest = self.rows[-1]
            self.rows = self.rows[::2]
            self._stride *= 2
            if (self._seen - 1) % self._stride != 0:
                self.rows.append(newest)


class History:
    """Feeds on every record of a log, in order.

    Parameters
    ----------
    l1
        Length of rod 1 [m]; None: g, l2 and rho2 stay unknown.
    points
        Half of the most estimates that are kept.
    window_s
        How much of the samples is kept [s].
    """

    def __init__(self, l1: float | None = None, points: int = 400, window_s: float = 10.0) -> None:
        self.window_s = window_s
        self.hello: Hello | None = None
        self.reason = ""
        self.newest: dict[str, float] = {}
        self._values = Values(l1)
        self._estimates = Thinned(points)
        self._samples: deque[Float] = deque()  # t, phi, y: [3, n] each
        self._count = 0
        self._began: int | None = None

    def know(self, l1: float) -> None:
        """The length of rod 1 [m], once it is known."""
        self._values.l1 = l1

    @property
    def has_physical(self) -> bool:
        """Whether g, l2 and rho2 can be computed."""
        return self._values.l1 is not None

    @property
    def is_physical(self) -> bool:
        """Whether the newest estimate lies in the physical region; so it is called where that cannot be known."""
        return not self.has_physical or math.isfinite(self.newest.get("l2", 0.0))

    def take(self, record: Record) -> None:
        """The next record."""
        if isinstance(record.item, Hello):
            self.hello = record.item
        for rows in self._values.rows(record):
            if isinstance(record.item, Message) and self._began is None and rows.table != "events":
                self._began = int(rows.columns["log_time"][0])
            if rows.table == "samples":
                self._take_samples(rows.columns)
            elif rows.table == "estimates":
                self._take_estimate(rows.columns)

    def estimates(self, name: str) -> Float:
        """A column of the estimates' history: "t" [s] or one of NUMBERS, [n]."""
        at = 0 if name == "t" else 1 + NUMBERS.index(name)
        return np.array([row[at] for row in self._estimates.rows], np.float64)

    def samples(self) -> Float:
        """The last `window_s` of t [s], phi [rad], y [m]: [3, n]."""
        if not self._samples:
            return np.zeros((3, 0))
        joined = np.concatenate(self._samples, axis=1)
        return np.asarray(joined[:, joined[0] > joined[0, -1] - self.window_s])

    def _since_began(self, log_time: npt.NDArray[Any]) -> Float:
        return np.asarray((log_time - (self._began or 0)) / 1e9)

    def _take_samples(self, columns: dict[str, npt.NDArray[Any]]) -> None:
        part = np.stack([self._since_began(columns["log_time"]), columns["phi"], columns["y"]])
        self._samples.append(part)
        self._count += part.shape[1]
        oldest = part[0, -1] - self.window_s
        while self._samples[0][0, -1] < oldest or self._count > _MOST_SAMPLES:
            self._count -= self._samples.popleft().shape[1]

    def _take_estimate(self, columns: dict[str, npt.NDArray[Any]]) -> None:
        t = float(self._since_began(columns["log_time"])[0])
        self.newest = {name: float(columns[name][0]) for name in NUMBERS}
        self.reason = str(columns["reason"][0])
        self._estimates.append((t, *self.newest.values()))


def envelope(t: Float, x: Float, bins: int) -> tuple[Float, Float]:
    """At most 2 `bins` points of x over t, both [n]: where n is more, each bin's least and largest, where they are."""
    width = len(x) // bins
    if width <= 2:
        return t, x
    first = len(x) - width * bins
    cut = x[first:].reshape(bins, width)
    at = np.sort(np.stack([cut.argmin(axis=1), cut.argmax(axis=1)], axis=1), axis=1)
    chosen = (first + width * np.arange(bins)[:, np.newaxis] + at).ravel()
    return t[chosen], x[chosen]
