"""Records from a log (pvid.logfile), in constant memory: from a file, or from its bytes as they come.

    reader = LogReader(path)                      stream = LogStream()
    for record in reader:                         for record in stream.feed(data): ...
        match record.item:                        for record in stream.end(): ...
            case Raw() as samples: ...
            case Estimate() | Status() | Configure() | Hello(): ...
            case Segment() | Mark() | Close(): ...        (of the logger)
            case Loss() | Gap() | Restart(): ...          (what is missing)
    reader.account                                stream.account

The account is up to date with the record that was handed out last. An `Observer` is whoever wants each record as it
comes: the status line, the tee, a live view.
"""

from __future__ import annotations

import contextlib
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from pvid.errors import PvidError
from pvid.link import (
    MESSAGES,
    SCHEMA,
    Configure,
    ConfigureQ31,
    Decoder,
    Described,
    Frame,
    Hello,
    Loss,
    Message,
    Raw,
    RawCount,
    described_readers,
    readers,
)
from pvid.logfile import LOG_MESSAGES, LOG_SCHEMA, Close, LinkSchema, Mark, Rig, Segment
from pvid.tick_count import TickCount

_CHUNK = 1 << 16


@dataclass(frozen=True)
class Gap:
    """Samples that the board took and the log has not: `samples` of them from tick `first` on.

    `down`: they were taken while the link was down, between two segments.
    """

    first: int
    samples: int
    down: bool = False


@dataclass(frozen=True)
class Restart:
    """The board began anew, by itself or by a new configuration: another session, whose ticks are counted anew."""


Item = Message | Loss | Gap | Restart


@dataclass(frozen=True)
class Record:
    """One thing in a log.

    segment : the last one that began, from 0; -1 before the first;  unix_ns : by the PC's clock when it had come, to
    about a second, 0 where no clock has been seen;  tick : in 64 bits (of the sample after it for losses)
    """

    segment: int
    unix_ns: int
    tick: int
    item: Item


@dataclass
class SegmentAccount:
    """From one link coming up to its end. `why` is None while it lasts, or when the logger was killed."""

    number: int
    port: str
    began_ns: int
    ended_ns: int = 0
    why: str | None = None
    frames: int = 0
    samples: int = 0
    missing_samples: int = 0


@dataclass
class Account:
    """What a log holds and what it lacks.

    frames : of the board, that came through;  by_kind : of which kind
    missing : frames that the sequence numbers say were sent;  damaged : pieces that were no frame;  foreign : frames
    of a schema that nobody described;  cut : pieces where the link came up or went down amidst a frame
    samples : that came;  missing_samples : between them;  unheard : that the board took while the link was down, as
    far as the segments before and after it tell
    lasting : the last message of each kind;  obstacle : why the link, being down, is not taken up again, while a logger
    tries to
    """

    frames: int = 0
    by_kind: dict[str, int] = field(default_factory=dict)
    missing: int = 0
    damaged: int = 0
    foreign: int = 0
    cut: int = 0
    samples: int = 0
    missing_samples: int = 0
    unheard: int = 0
    restarts: int = 0
    bytes: int = 0
    unix_ns: int = 0
    segments: list[SegmentAccount] = field(default_factory=list)
    lasting: dict[type[Message], Message] = field(default_factory=dict)
    obstacle: str = ""
    damaged_since: int = 0  # the last good frame: no sequence number tells of them

    @property
    def lost_share(self) -> float:
        """The larger of the shares of frames and of samples that were lost, 0 to 1."""
        frames = self.missing + self.damaged_since
        of_frames = frames / max(1, self.frames + frames)
        return max(of_frames, self.missing_samples / max(1, self.samples + self.missing_samples))

    @property
    def text(self) -> str:
        """In one sentence."""
        many = len(self.segments)
        return (
            f"{self.frames} frames, {self.samples} samples in {many} segment{'' if many == 1 else 's'}; "
            f"lost {self.missing} frames, {self.missing_samples} samples, {self.unheard} while the link was down; "
            f"{self.damaged} damaged, {self.foreign} foreign, {self.cut} cut off, {self.restarts} restarts"
        )


class Observer(Protocol):
    """Whoever wants each record as it comes."""

    def take(self, record: Record, account: Account) -> None:
        """The next record."""

    def idle(self, account: Account) -> None:
        """Nothing more has come for now; called several times a second."""

    def close(self, account: Account) -> None:
        """No more will come."""


class LogStream:
    """Bytes of a log in, records out; never raises on garbage, holds no more than a frame and the account."""

    def __init__(self) -> None:
        schemas = {SCHEMA: readers(MESSAGES), LOG_SCHEMA: readers(LOG_MESSAGES)}
        self.account = Account()
        self.rig: str | None = None
        self.is_log = False  # whether the logger has written into it
        self._decoder = Decoder(schemas=schemas, learns=True)
        self._held: Loss | None = None  # damage, until it is known whether the link went down there
        self._fresh = True  # no frame of the board in this segment yet
        self._ticks = TickCount()
        self._next_tick: int | None = None
        self._session = 0  # the last that was named, 0: none was
        self._anew = False  # it has been told that the board began anew, and no samples have come since
        self._configured = (0, 0)  # the session of the last configuration, and its first tick
        self._left: tuple[int, int] | None = None  # session and next tick when the link went down
        self._joined: int | None = None  # first tick since then
        self._rig_pieces = bytearray()

    def feed(self, data: bytes) -> Iterator[Record]:
        """What these bytes completed; to be exhausted before the next call."""
        self.account.bytes += len(data)
        ahead: Loss | None = None  # a gap in the sequence, until the frame behind it is seen
        for item in self._decoder.items(data):
            if isinstance(item, Loss):
                if item.why == "sequence":
                    ahead = item
                else:
                    yield from self._release()
                    self._held = item
            elif item.schema == LOG_SCHEMA:
                ahead = None
                yield from self._of_logger(item.message)
            else:
                began = isinstance(item.message, Hello) and item.sequence == 0 and not self._fresh
                yield from self._release()
                if ahead is not None and not began:
                    self.account.missing += ahead.frames
                    yield self._record(item.tick, ahead)
                ahead = None
                yield from self._of_board(item, began)

    def end(self) -> Iterator[Record]:
        """What was held back; the bytes have ended."""
        if self._decoder.unfinished:
            yield from self._release()
            self._held = Loss("malformed", bytes=self._decoder.unfinished)
        yield from self._release(cut=True)

    def _record(self, tick: int, item: Item) -> Record:
        number = self.account.segments[-1].number if self.account.segments else -1
        return Record(number, self.account.unix_ns, tick, item)

    def _release(self, cut: bool = False) -> Iterator[Record]:
        held, self._held = self._held, None
        if held is None:
            return
        if cut or self._fresh:
            held = Loss("cut", bytes=held.bytes)
            self.account.cut += 1
        elif held.why == "foreign":
            self.account.foreign += 1
        else:
            self.account.damaged += 1
            self.account.damaged_since += 1
        yield self._record(self._next_tick or 0, held)

    def _of_logger(self, message: Message) -> Iterator[Record]:
        yield from self._release(cut=not isinstance(message, Mark))
        account = self.account
        self.is_log = True
        if isinstance(message, Segment):
            account.unix_ns = message.unix_ns
            port = str(message.told.get("port", ""))
            account.segments.append(SegmentAccount(len(account.segments), port, message.unix_ns))
            for schema in self._decoder.schemas:
                if schema != LOG_SCHEMA:
                    self._decoder.expect_anew(schema)
            if self._next_tick is not None and self._session != 0:
                self._left = (self._session, self._next_tick)
            self._fresh, self._next_tick, self._session, self._joined = True, None, 0, None
            self._anew = False
        elif isinstance(message, Mark):
            account.unix_ns = message.unix_ns
        elif isinstance(message, Close) and account.segments:
            account.unix_ns = account.segments[-1].ended_ns = message.unix_ns
            account.segments[-1].why = message.why.decode("utf-8", "replace")
        elif isinstance(message, Rig):
            self._take_rig(message)
        elif isinstance(message, LinkSchema):
            self._learn(message.text)
        yield self._record(0, message)

    def _of_board(self, frame: Frame, began: bool) -> Iterator[Record]:
        account, message = self.account, frame.message
        self._fresh = False
        account.damaged_since = 0
        account.frames += 1
        kind = message.kind if isinstance(message, Described) else type(message).layout().name
        account.by_kind[kind] = account.by_kind.get(kind, 0) + 1
        account.lasting[type(message)] = message
        if account.segments:
            account.segments[-1].frames += 1
        named = getattr(message, "session", 0)
        if began:
            self._ticks.begin()
            self._session = 0
        elif self._next_tick is not None and named != 0 and self._session not in (0, named):
            began = True
        tick = self._ticks.of(frame.tick, named)
        self._session = named or self._session
        if isinstance(message, Configure | ConfigureQ31):
            self._configured = message.session, message.first_tick
        if isinstance(message, Raw | RawCount) and self._joined is None:
            self._joined = tick
        if began:
            yield from self._restart(tick)
        if self._left is not None and self._session != 0 and self._joined is not None:
            yield from self._rejoin(tick)
        if isinstance(message, Raw | RawCount):
            yield from self._follow(tick, message.count)
        yield self._record(tick, message)

    def _rejoin(self, tick: int) -> Iterator[Record]:
        """Tells what the board took while the link was down, now that it is known whether it is the same session."""
        assert self._left is not None and self._joined is not None
        (session, expected), self._left = self._left, None
        unheard = self._joined - expected
        if session == self._session and unheard > 0:
            self.account.unheard += unheard
            yield self._record(tick, Gap(expected, unheard, down=True))

    def _restart(self, tick: int) -> Iterator[Record]:
        self._anew = True
        self._next_tick = None
        self.account.restarts += 1
        yield self._record(tick, Restart())

    def _follow(self, tick: int, samples: int) -> Iterator[Record]:
        """Holds the samples' ticks against those of the frame before."""
        expected = tick if self._next_tick is None else self._next_tick
        if tick < expected:
            yield from self._restart(tick)
        if self._anew:
            session, first = self._configured
            expected = first if session == self._session else 0
        self._next_tick, self._anew = tick + samples, False
        ahead = max(0, tick - expected)
        totals: list[Account | SegmentAccount] = [self.account, *self.account.segments[-1:]]
        for one in totals:
            one.samples += samples
            one.missing_samples += ahead
        if ahead:
            yield self._record(tick, Gap(tick - ahead, ahead))

    def _learn(self, text: bytes) -> None:
        schema = zlib.crc32(text)
        if schema not in self._decoder.schemas:
            with contextlib.suppress(PvidError, UnicodeDecodeError):
                self._decoder.schemas[schema] = described_readers(text.decode("ascii"))

    def _take_rig(self, message: Rig) -> None:
        if message.offset == 0:
            self._rig_pieces.clear()
        if message.offset == len(self._rig_pieces):
            self._rig_pieces += message.text
        if len(self._rig_pieces) == message.size:
            self.rig = self._rig_pieces.decode("utf-8", "replace")


class LogReader:
    """The records of a file, from its beginning at every iteration.

    Raises
    ------
    PvidError
        While iterating: when the file cannot be read or holds not one frame.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stream = LogStream()

    @property
    def account(self) -> Account:
        """Up to the last record that was handed out."""
        return self._stream.account

    @property
    def rig(self) -> str | None:
        """Text of the rig file that came last, None when there was none yet."""
        return self._stream.rig

    def __iter__(self) -> Iterator[Record]:
        stream = self._stream = LogStream()
        try:
            with self.path.open("rb") as file:
                while data := file.read(_CHUNK):
                    yield from stream.feed(data)
        except OSError as error:
            raise PvidError(f"cannot read {self.path}: {error.strerror}") from error
        yield from stream.end()
        if stream.is_log and not stream.account.segments and not stream.account.frames:
            raise PvidError(f"{self.path} is empty: the recording ended before the link had come up")
        if not stream.account.frames and not stream.account.segments:
            raise PvidError(f"{self.path} is no log of pvid: not one frame in {stream.account.bytes} bytes")
