"""Records of a log (pvid.log.reader) as rows of numbers in SI, for files, screens and the wire.

    values = Values(rig.mechanism)
    for record in reader:
        for rows in values.rows(record):
            rows.table, rows.columns["t"], ...

Each of `values.tables` has the columns written there, with their units; a number that a record does not have is NaN.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.link.frames import (
    Code,
    Configure,
    ConfigureQ31,
    Estimate,
    EstimateQ31,
    Form,
    Hello,
    Loss,
    Message,
    Names,
    Raw,
    RawCount,
    RefinedEstimate,
    Status,
)
from pvid.link.names import BoardNames, Quantity
from pvid.log.file import Close, Segment
from pvid.log.mechanism import TAKEN, UNNAMED, LogMechanism, mechanism_named
from pvid.log.reader import Gap, Record, Restart
from pvid.settings.enums import Reason, Stage
from pvid.settings.record import standing_text

_SLOWEST, _FASTEST = 1e-3, 1e9  # [Hz]
_LONGEST_S = 3e9  # between the PC's clock and a tick: a century, which a time in ns has room for
_MOST = (1 << 63) - 1

Tables = Mapping[str, Mapping[str, "Column"]]


@dataclass(frozen=True)
class Column:
    """Unit (1 for a pure number, none for text), numpy's kind, and what it is."""

    unit: str
    kind: str
    what: str


_WHERE = {
    "t": Column("s", "f8", "time on the board since its tick 0"),
    "tick": Column("1", "i8", "tick on the board"),
    "segment": Column("1", "i8", "segment of the log"),
    "run": Column("1", "i8", "how often the board had begun to count ticks anew"),
    "log_time": Column("ns", "i8", "the PC's clock at the beginning, then the board's; never backwards"),
}

_STATUS = {
    **_WHERE,
    "state": Column("", "U24", "what the board does"),
    "updates": Column("1", "i8", "solves so far"),
    "rejected": Column("1", "i8", "samples that were not finite or absurd"),
}

_EVENTS = {
    **_WHERE,
    "event": Column("", "U16", "what happened to the log"),
    "count": Column("1", "i8", "frames or samples lost, bytes spoilt"),
    "text": Column("", "U200", "more of it"),
}


def _number(of: Quantity, what: str) -> Column:
    return Column(of.unit or "1", "f8", what)


def extras_of(mechanism: LogMechanism, refined: Sequence[Quantity]) -> tuple[Quantity, ...]:
    """Refined parameters that the weak form does not have, as friction; none with the name of another column."""
    taken = {*TAKEN, *_OF_REFINED, *(f"{one.name}{end}" for one in mechanism.answers for end in ("", "_se"))}
    return tuple(one for one in refined if not taken & {one.name, f"{one.name}_se"})


_OF_REFINED = ("stage", "number", "level", "clash")


@lru_cache(maxsize=64)
def tables_of(mechanism: LogMechanism, refined: tuple[Quantity, ...] = ()) -> Tables:
    """The tables of a mechanism's logs; with the refined parameters of a board that has a second stage."""
    estimated = (*mechanism.parameters, *mechanism.outputs)
    tables = {
        "samples": {**_WHERE, **{one.name: _number(one, "measured") for one in mechanism.samples}},
        "estimates": {
            **_WHERE,
            "updates": Column("1", "i8", "solves so far"),
            **{one.name: _number(one, "estimate") for one in estimated},
            **{f"{one.name}_se": _number(one, f"standard error of {one.name}") for one in estimated},
            "kappa": Column("1", "f8", "identifiability of p[0]: 1 - R^2, 0 to 1"),
            "residual": Column("1", "f8", "standard deviation of a row's residual over the one it was configured with"),
            "reason": Column("", "U24", "reason of the last group of rows"),
            "standing": Column("", "U80", "whether the published estimate still holds"),
        },
        "status": _STATUS,
        "events": _EVENTS,
    }
    if refined:
        of_r = (*estimated, *extras_of(mechanism, refined))
        tables["refined"] = {
            **_WHERE,
            "stage": Column("", "U8", "whose estimate is published: that of the table estimates (weak), or this one"),
            "number": Column("1", "i8", "number of the refined estimate; 0: there is none"),
            **{one.name: _number(one, "refined estimate") for one in of_r},
            **{f"{one.name}_se": _number(one, f"standard error of refined {one.name}") for one in of_r},
            "level": Column("1", "f8", "variance of the residuals over that of the sensors' noise"),
            "clash": Column("1", "f8", "square by which blocks differ from their past, over its expectation"),
            "reason": Column("", "U24", "reason of the last block"),
        }
    return tables


@dataclass(frozen=True)
class Rows:
    """Rows of one table, all of its columns with an entry a row."""

    table: str
    columns: dict[str, npt.NDArray[Any]]


class Values:
    """Turns records into rows; it has to see every record, in order.

    Parameters
    ----------
    mechanism : of the rig; without its constants no outputs are computed
    hello : who the board is, where that is known before its records; without it times are NaN until it has said so
    follows : take the mechanism that the board names, from there on; the tables change with it
    refined : refined parameters of the log's boards; None: those that the board names, from there on
    """

    def __init__(
        self,
        mechanism: LogMechanism = UNNAMED,
        hello: Hello | None = None,
        *,
        follows: bool = False,
        refined: tuple[Quantity, ...] | None = None,
    ) -> None:
        self.mechanism = mechanism
        self.follows = follows
        self.refined = refined or ()
        self._names_refined: tuple[str, ...] = ()  # in the order of the frames
        self._refined_follows = refined is None
        self._hello = hello
        self._row_sd = math.nan
        self._offset = 0.0  # of the angle in fixed point [rad]
        self._named: tuple[str, ...] = ()  # the samples of a tick, if the board named them
        self._named_p: tuple[str, ...] = ()  # entries of p, likewise
        self._counts: tuple[float, ...] = ()  # value of a count of each, likewise
        self._anchor: tuple[int, int] | None = None  # tick and log time
        self._latest = 0
        self._runs = 0
        self._segment = -1
        self._session: int | None = None  # None: not named in this segment

    @property
    def tables(self) -> Tables:
        """The columns of each table."""
        return tables_of(self.mechanism, self.refined)

    @property
    def sample_rate(self) -> float:
        """[Hz], as reported by the board; NaN before, and for an invalid rate."""
        rate = math.nan if self._hello is None else self._hello.sample_rate
        return rate if is_rate(rate) else math.nan

    def rows(self, record: Record) -> Iterator[Rows]:
        """Those of one record: none or one table's."""
        item = record.item
        if record.segment != self._segment or isinstance(item, Restart):
            self._segment, self._session, self._anchor = record.segment, None, None
        if isinstance(item, Hello | Status) and item.session != self._session:
            if self._session is not None:  # it was configured: its ticks count from elsewhere
                self._anchor = None
            self._session = item.session
        match item:
            case Hello():
                self._hello = item
            case Names():
                with suppress(PvidError):  # a board that names nothing that there can be
                    names = BoardNames.parse(item.text)
                    self._named, self._counts = tuple(name for name, _ in names.samples), names.counts
                    self._named_p, self._names_refined = (
                        tuple(name for name, _ in some) for some in (names.parameters, names.refined)
                    )
                    if self._refined_follows:
                        self.refined = names.refined
                    self.mechanism = mechanism_named(item.text) if self.follows else self.mechanism
            case Configure() | ConfigureQ31():
                self._row_sd = item.row_sd if 0 < item.row_sd < math.inf else math.nan
                self._offset = getattr(item, "phi_offset", 0) * (self._hello.phi_lsb if self._hello else 0.0)
            case Raw() | RawCount():
                yield self._samples(record, item)
            case Estimate() | EstimateQ31():
                yield self._estimate(record, item)
            case RefinedEstimate() if self.refined:
                yield self._refined(record, item)
            case Status():
                state = Code(item.code).name if item.code in list(Code) else str(item.code)
                yield self._one(
                    "status",
                    record,
                    state=state.lower().replace("_", " "),
                    updates=item.updates,
                    rejected=item.rejected,
                )
            case Restart():
                self._runs += 1
                yield self._one("events", record, event="restart", count=0, text="the board began anew")
            case Gap():
                text = f"samples of ticks {item.first} to {item.first + item.samples - 1} are missing"
                yield self._one("events", record, event="gap", count=item.samples, text=text)
            case Loss():
                text = f"{item.pieces} pieces" if item.pieces > 1 else ""
                yield self._one("events", record, event=item.why, count=item.frames or item.bytes, text=text)
            case Segment():
                yield self._one("events", record, event="segment", count=item.number, text=item.port)
            case Close():
                yield self._one("events", record, event="close", count=min(item.received, _MOST), text=item.words)
            case _:
                pass

    def _where(self, record: Record, ticks: npt.NDArray[np.int64]) -> dict[str, npt.NDArray[Any]]:
        rate = self.sample_rate
        log_time = self._log_time(record, ticks)
        return {
            "t": ticks / rate,
            "tick": ticks,
            "segment": np.full(len(ticks), record.segment),
            "run": np.full(len(ticks), self._runs),
            "log_time": log_time,
        }

    def _log_time(self, record: Record, ticks: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """By the board's clock, which starts at the PC's when the segment or the board's run begins."""
        if not isinstance(record.item, Message) or isinstance(record.item, Segment | Close) or not len(ticks):
            return np.full(len(ticks), max(self._latest, record.unix_ns))
        if self._anchor is None:
            self._anchor = (int(ticks[0]), max(record.unix_ns, self._latest))
        first, began = self._anchor
        rate = self.sample_rate
        passed = np.zeros(len(ticks)) if math.isnan(rate) else np.clip((ticks - first) / rate, -_LONGEST_S, _LONGEST_S)
        log_time = np.maximum(began + np.rint(1e9 * passed).astype(np.int64), self._latest)
        self._latest = int(log_time[-1])
        return log_time

    def _one(self, table: str, record: Record, **values: float | int | str) -> Rows:
        columns = self._where(record, np.array([record.tick], np.int64))
        for name, column in self.tables[table].items():
            if name not in columns:
                columns[name] = np.array([values[name]], column.kind)
        return Rows(table, columns)

    @np.errstate(all="ignore")  # a board may send any number
    def _samples(self, record: Record, item: Raw | RawCount) -> Rows:
        hello = self._hello
        of_two = [np.nan, np.nan] if hello is None else [hello.phi_lsb, hello.y_lsb]
        measured = item.in_si(np.array(self._counts or of_two))
        columns = self._where(record, record.tick + np.arange(len(measured), dtype=np.int64))
        channels = [one.name for one in self.mechanism.samples]
        if measured.shape[1] != len(channels):  # samples of something else
            measured = np.full((len(measured), len(channels)), np.nan)
        orders = self._named, [one.name for one in UNNAMED.samples]
        order = next((one for one in orders if sorted(one) == sorted(channels)), channels)
        if not self._named and hello is not None and hello.form == Form.WEAK:  # not named yet
            measured = np.full(measured.shape, np.nan)
        return Rows("samples", {**columns, **dict(zip(order, measured.T, strict=True))})

    @np.errstate(all="ignore")
    def _estimate(self, record: Record, item: Estimate | EstimateQ31) -> Rows:
        numbers: dict[str, Any] = dict.fromkeys(self.tables["estimates"], np.nan)
        numbers |= self._answers(*in_si(item, self._hello, self._offset))
        numbers["kappa"] = item.kappa / item.FULL_KAPPA
        numbers["residual"] = item.residual_sd / self._row_sd
        reason = Reason(item.reason).text if item.reason in list(Reason) else str(item.reason)
        words = {"updates": item.updates, "reason": reason, "standing": standing_text(item.standing)}
        return self._one("estimates", record, **{**numbers, **words})

    @np.errstate(all="ignore")
    def _refined(self, record: Record, item: RefinedEstimate) -> Rows:
        numbers: dict[str, Any] = dict.fromkeys(self.tables["refined"], np.nan)
        if item.stage == Stage.REFINED:
            numbers |= self._answers(*item.of_p)
            extras = {one.name for one in extras_of(self.mechanism, self.refined)}
            for name, r, se in zip(self._names_refined, item.r, item.se, strict=False):
                if name in extras:
                    numbers[name], numbers[f"{name}_se"] = r, se
            numbers |= {"level": item.level, "clash": item.clash}
        stage = Stage(item.stage).text if item.stage in list(Stage) else str(item.stage)
        reason = Reason(item.reason).text if item.reason in list(Reason) else str(item.reason)
        return self._one("refined", record, **{**numbers, "stage": stage, "number": item.number, "reason": reason})

    def _answers(self, p: npt.NDArray[np.float64], covariance: npt.NDArray[np.float64]) -> dict[str, float]:
        """Parameters and outputs with their standard errors, from p [places] and its covariance."""
        own = [one.name for one in self.mechanism.parameters]
        names = (self._named_p or own)[: len(p) if self._hello is None else self._hello.n_p]
        values = dict(zip(names, p.tolist(), strict=False))
        errors = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=False))
        found = {name: (x, errors[name]) for name, x in values.items() if name in own}
        found |= self.mechanism.outputs_at(values, covariance)
        return {**{name: x for name, (x, _) in found.items()}, **{f"{name}_se": se for name, (_, se) in found.items()}}


def is_rate(sample_rate: float) -> bool:
    """Whether a board can have this sample rate [Hz]."""
    return _SLOWEST <= sample_rate <= _FASTEST


def in_si(
    item: Estimate | EstimateQ31, hello: Hello | None, phi_offset: float = 0.0
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """p [places] and its covariance [places, places] in SI; zero where the model has no parameter.

    Of the fixed-point core: NaN before the board has reported its units; `phi_offset` [rad] is added to its c.
    """
    return item.in_si(np.array([] if hello is None else hello.p_unit), phi_offset)
