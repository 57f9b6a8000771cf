"""History of a recording for a view, in bounded memory for any length.

Of the estimates the whole history, thinned evenly; of the samples the last seconds. Times are seconds since the
first record, by the PC's clock when a segment began and the board's from there on.

Arriving records are only stored. Their values are computed when the view is drawn, and only for the visible part: ten
thousand frames per second cost the view no more than ten.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from pvid.link.frames import Configuration, Estimate, EstimateQ31, Hello, Names, Raw, RawCount, RefinedEstimate
from pvid.link.names import Quantity
from pvid.log.file import Segment
from pvid.log.mechanism import UNNAMED, LogMechanism
from pvid.log.reader import Account, Record, Restart
from pvid.log.values import Rows, Values, extras_of
from pvid.settings.enums import Stage

Float = npt.NDArray[np.float64]

_MOST_SAMPLES = 200_000
_MOST_ASIDE = 5_000  # records stored while the view is not drawn
_MOST_PARTS = 1_000  # in which the samples are kept

T = TypeVar("T")


class Rates:
    """Samples and bytes a second, over the last seconds."""

    def __init__(self, over_s: float = 2.0) -> None:
        self._over_s = over_s
        self._counts: deque[tuple[float, int, int]] = deque()  # when, samples, bytes

    def now(self, account: Account, when: float) -> tuple[float, float]:
        """At the time `when` (of time.monotonic); cheap to call often."""
        counts = self._counts
        counts.append((when, account.samples, account.bytes))
        while len(counts) > 2 and when - counts[1][0] > self._over_s:
            counts.popleft()
        passed = max(when - counts[0][0], 1e-9)
        return (account.samples - counts[0][1]) / passed, (account.bytes - counts[0][2]) / passed


class Thinned(Generic[T]):
    """Rows of which at most 2 `points` are kept, evenly spaced but for the newest, which always is."""

    def __init__(self, points: int) -> None:
        self.points = points
        self.rows: list[T] = []
        self._stride = 1
        self._seen = 0

    def append(self, row: T) -> None:
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


@dataclass(eq=False)
class _Point:
    """An estimate; `row` are its time [s] and numbers once they have been computed, `reason` is its Reason.text."""

    record: Record
    row: tuple[float, ...] = ()
    reason: str = ""

    @property
    def table(self) -> str:
        """Its table."""
        return "refined" if isinstance(self.record.item, RefinedEstimate) else "estimates"


class History:
    """Feeds on every record of a log, in order.

    Parameters
    ----------
    mechanism : of the rig; without its constants the outputs stay unknown
    points : half of the most estimates that are kept
    window_s : how much of the samples is kept [s], as far as they are no more than 200 000
    """

    def __init__(self, mechanism: LogMechanism = UNNAMED, points: int = 400, window_s: float = 10.0) -> None:
        self.window_s = window_s
        self.hello: Hello | None = None
        self._values = Values(mechanism, follows=mechanism is UNNAMED)
        self._aside: list[Record | _Point] = []
        self._aside_samples = 0
        self._points: dict[str, Thinned[_Point]] = {"estimates": Thinned(points), "refined": Thinned(points)}
        self._newest: dict[str, dict[str, float]] = {"estimates": {}, "refined": {}}
        self._reason = {"estimates": "", "refined": ""}
        self._stage = self._standing = ""
        self._samples: deque[Float] = deque()  # t and the channels: [1 + channels, n] each
        self._count = 0
        self._began: int | None = None

    def know(self, mechanism: LogMechanism) -> None:
        """That of the rig, once it is known."""
        self._work_off()
        self._values.follows, self._values.mechanism = False, mechanism
        self._forget()

    @property
    def mechanism(self) -> LogMechanism:
        """That of the rig, or the one that the board named last."""
        self._work_off()
        return self._values.mechanism

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of the estimates' columns that hold numbers, but for the time."""
        self._work_off()
        return self._numbers("estimates")

    def _numbers(self, table: str) -> tuple[str, ...]:
        columns = self._values.tables.get(table, {}).items()
        return tuple(name for name, column in columns if column.kind == "f8" and name != "t")

    @property
    def is_physical(self) -> bool:
        """Whether the newest estimate lies in the physical region; so it is called where that cannot be known."""
        return all(math.isfinite(self.published.get(one.name, 0.0)) for one in self.mechanism.outputs)

    @property
    def newest(self) -> dict[str, float]:
        """The newest estimate of the weak form, or of the strong one: its numbers by name; empty before the first."""
        self._work_off()
        return self._newest["estimates"]

    @property
    def published(self) -> dict[str, float]:
        """The newest estimate of the stage that is published."""
        self._work_off()
        refined = self._newest["refined"] if self._stage == Stage.REFINED.text else {}
        return {**self._newest["estimates"], **{name: x for name, x in refined.items() if math.isfinite(x)}}

    @property
    def stage(self) -> str:
        """Whose estimate is published (Stage.text); empty without a second stage."""
        self._work_off()
        return self._stage

    @property
    def refined_reason(self) -> str:
        """Of the refinement's last block; empty without a second stage."""
        self._work_off()
        return self._reason["refined"]

    @property
    def extras(self) -> tuple[Quantity, ...]:
        """Refined parameters that the weak form does not have."""
        self._work_off()
        return extras_of(self.mechanism, self._values.refined)

    @property
    def reason(self) -> str:
        """That of the newest estimate (Reason.text); empty before the first."""
        self._work_off()
        return self._reason["estimates"]

    @property
    def standing(self) -> str:
        """That of the published estimate of the weak form, in words; empty where there is none."""
        self._work_off()
        return self._standing

    def take(self, record: Record) -> None:
        """The next record; it costs the same whatever it holds."""
        match record.item:
            case Estimate() | EstimateQ31() | RefinedEstimate():
                point = _Point(record)
                self._points[point.table].append(point)
                self._aside.append(point)
            case Raw() | RawCount() as raw:
                self._aside.append(record)
                self._aside_samples += raw.count
            case Hello() as hello:
                self.hello = hello
                self._aside.append(record)
            case Configuration() | Names() | Segment() | Restart():
                self._aside.append(record)
            case _:
                return
        if len(self._aside) > _MOST_ASIDE or self._aside_samples > _MOST_SAMPLES:
            self._work_off()

    def estimates(self, name: str) -> Float:
        """A column of the estimates' history: "t" [s] or one of `numbers`, [n]."""
        self._work_off()
        return self._column("estimates", name)

    def refined(self, name: str) -> Float:
        """The same of the refined estimates: "t", or what `estimates` has, and `extras`; NaN while none stands."""
        self._work_off()
        return self._column("refined", name)

    def _column(self, table: str, name: str) -> Float:
        at = 0 if name == "t" else 1 + self._numbers(table).index(name)
        return np.array([point.row[at] for point in self._points[table].rows if point.row], np.float64)

    def withheld(self) -> list[tuple[float, str]]:
        """Time [s] and reason (Reason.text) of each window in the history that was held or rejected."""
        self._work_off()
        return [
            (point.row[0], point.reason)
            for point in self._points["estimates"].rows
            if point.row and point.reason.startswith(("held", "rejected"))
        ]

    def samples(self) -> Float:
        """The last `window_s` of t [s] and the channels: [1 + channels, n]."""
        self._work_off()
        if not self._samples:
            return np.zeros((1 + len(self.mechanism.samples), 0))
        joined = np.concatenate(self._samples, axis=1)
        return np.asarray(joined[:, joined[0] > joined[0, -1] - self.window_s])

    def _work_off(self) -> None:
        """Computes what was put aside: the estimates that are kept, the samples in as few pieces as can be."""
        if not self._aside:
            return
        aside, self._aside, self._aside_samples = self._aside, [], 0
        kept = {point for points in self._points.values() for point in points.rows}
        wanted = (one for one in aside if not isinstance(one, _Point) or one in kept)
        for one in _joined(wanted):
            record = one.record if isinstance(one, _Point) else one
            mechanism = self._values.mechanism
            for rows in self._values.rows(record):
                if rows.table == "samples":
                    self._take_samples(rows)
                elif isinstance(one, _Point):
                    self._take_estimate(one, rows)
            if self._values.mechanism is not mechanism:
                self._forget()

    def _forget(self) -> None:
        """What was computed of another mechanism."""
        self._samples.clear()
        self._count = 0
        self._stage = self._standing = ""
        for table, points in self._points.items():
            self._newest[table], self._reason[table] = {}, ""
            for point in points.rows:
                point.row = ()

    def _since_began(self, log_time: npt.NDArray[Any]) -> Float:
        if self._began is None:
            self._began = int(log_time[0])
        return np.asarray((log_time - self._began) / 1e9)

    def _take_samples(self, rows: Rows) -> None:
        names = ("log_time", *(one.name for one in self.mechanism.samples))
        log_time, *channels = (rows.columns[name][-_MOST_SAMPLES:] for name in names)
        if not len(log_time):
            return
        part = np.stack([self._since_began(log_time), *channels])
        self._samples.append(part)
        self._count += part.shape[1]
        oldest = part[0, -1] - self.window_s
        while self._samples[0][0, -1] < oldest or self._count > _MOST_SAMPLES:
            self._count -= self._samples.popleft().shape[1]
        if len(self._samples) > _MOST_PARTS:
            self._samples = deque([np.concatenate(self._samples, axis=1)])

    def _take_estimate(self, point: _Point, rows: Rows) -> None:
        t = float(self._since_began(rows.columns["log_time"])[0])
        table = point.table
        newest = {name: float(rows.columns[name][0]) for name in self._numbers(table)}
        point.row, point.reason = (t, *newest.values()), str(rows.columns["reason"][0])
        self._newest[table], self._reason[table] = newest, point.reason
        if table == "refined":
            self._stage = str(rows.columns["stage"][0])
        else:
            self._standing = str(rows.columns["standing"][0])


def _joined(aside: Iterator[Record | _Point]) -> Iterator[Record | _Point]:
    """The same, with consecutive frames of samples made one."""
    first: Record | None = None
    parts: list[bytes] = []
    following = 0
    for one in aside:
        raw = None if isinstance(one, _Point) else one.item
        if not isinstance(one, _Point) and isinstance(raw, Raw | RawCount):
            this = type(raw), raw.samples, one.segment, one.tick
            if first is not None and (*_kind(first), first.segment, following) != this:
                yield _of_parts(first, parts)
                first = None
            if first is None:
                first, parts = one, []
            parts.append(raw.values.tobytes())
            following = one.tick + raw.count
            continue
        if first is not None:
            yield _of_parts(first, parts)
            first = None
        yield one
    if first is not None:
        yield _of_parts(first, parts)


def _kind(record: Record) -> tuple[type[Any], int]:
    assert isinstance(record.item, Raw | RawCount)
    return type(record.item), record.item.samples


def _of_parts(first: Record, parts: list[bytes]) -> Record:
    assert isinstance(first.item, Raw | RawCount)
    return replace(first, item=replace(first.item, data=b"".join(parts)))


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
