"""Records from a log (pvid.log.file), in constant memory: from a file, or from its bytes as they arrive.

    reader = LogReader(path)                      stream = LogStream()
    for record in reader:                         for record in stream.feed(data): ...
        match record.item:                        for record in stream.end(): ...
            case Raw() as samples: ...
            case Estimate() | Status() | Configure() | Hello(): ...
            case Segment() | Mark() | Close(): ...        (of the logger)
            case Loss() | Gap() | Restart(): ...          (what is missing)
    reader.account                                stream.account

The account includes the last record that was returned. An `Observer` receives each record as it arrives: the status
line, the tee, a live view.
"""

from __future__ import annotations

import os
import stat
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from pvid.base.errors import PvidError
from pvid.link.frames import (
    LONGEST_FRAME,
    MAX_PAYLOAD,
    Configure,
    ConfigureQ31,
    Credit,
    Decoder,
    Described,
    Frame,
    Hello,
    Loss,
    Message,
    Raw,
    RawCount,
    Status,
    of_boards,
    readers,
)
from pvid.link.tick_count import TickCount
from pvid.log.file import LOG_MESSAGES, LOG_SCHEMA, MAX_RIG, Close, LinkSchema, Mark, Rig, Segment

_CHUNK = 1 << 16
_LATEST_NS = 1 << 62  # a foreign log may contain any time, and sums of two go into 64 bits
_KEPT_SEGMENTS = 64
_MOST_KINDS = 64
OTHER_KINDS = "other"


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
    """From one link coming up to its end. `why` is None while it lasts, or when the logger was killed.

    `received` bytes came from the board up to the last mark or the end.
    """

    number: int
    port: str
    began_ns: int
    ended_ns: int = 0
    why: str | None = None
    received: int = 0
    frames: int = 0
    samples: int = 0
    missing_samples: int = 0


@dataclass
class Account:
    """What a log holds and what it lacks; of bounded size, whatever the log holds.

    frames : of the board, that came through;  by_kind : of which kind, OTHER_KINDS those beyond the first 64
    missing : frames missing in the sequence numbers;  damaged : pieces that were no frame;  foreign : frames
    of a schema without description, or of the logger's schema and not its own;  cut : pieces where the link came up
    or went down amidst a frame;  unread : bytes that came faster than they could be decoded, and were not
    samples : that came;  missing_samples : between them;  unheard : that the board took while the link was down, as
    far as the segments before and after it show
    begun : how many segments;  segments : the last 64 of them;  garbled : segments that brought bytes and not one frame
    lasting : the last message of each kind;  obstacle : why the link, being down, is not taken up again, while a logger
    tries to
    """

    frames: int = 0
    by_kind: dict[str, int] = field(default_factory=dict)
    missing: int = 0
    damaged: int = 0
    foreign: int = 0
    cut: int = 0
    unread: int = 0
    samples: int = 0
    missing_samples: int = 0
    unheard: int = 0
    restarts: int = 0
    bytes: int = 0
    unix_ns: int = 0
    begun: int = 0
    segments: deque[SegmentAccount] = field(default_factory=lambda: deque(maxlen=_KEPT_SEGMENTS))
    garbled: int = 0
    lasting: dict[type[Message], Message] = field(default_factory=dict)
    obstacle: str = ""
    damaged_since: int = 0  # the last good frame: without sequence numbers

    @property
    def lost_share(self) -> float:
        """The larger of the shares of frames and of samples that were lost, 0 to 1."""
        frames = self.missing + self.damaged_since
        of_frames = frames / max(1, self.frames + frames)
        return max(of_frames, self.missing_samples / max(1, self.samples + self.missing_samples))

    @property
    def text(self) -> str:
        """In one sentence."""
        many = self.begun
        unread = f"; {self.unread} bytes not decoded" if self.unread else ""
        return (
            f"{self.frames} frames, {self.samples} samples in {many} segment{'' if many == 1 else 's'}; "
            f"lost {self.missing} frames, {self.missing_samples} samples, {self.unheard} while the link was down; "
            f"{self.damaged} damaged, {self.foreign} foreign, {self.cut} cut off, {self.restarts} restarts{unread}"
        )


class Observer(Protocol):
    """Receives each record as it arrives."""

    def take(self, record: Record, account: Account) -> None:
        """The next record."""

    def idle(self, account: Account) -> None:
        """Nothing more has come for now; called several times a second."""

    def close(self, account: Account) -> None:
        """No more will come."""


class LogStream:
    """Bytes of a log in, records out; never raises on garbage, holds no more than a frame and the account."""

    def __init__(self) -> None:
        schemas = of_boards() | {LOG_SCHEMA: readers(LOG_MESSAGES)}
        self.account = Account()
        self.rig: str | None = None
        self.is_log = False  # whether the logger has written into it
        self._decoder = Decoder(schemas=schemas, learns=True)
        self._held: Loss | None = None  # damage, until it is known whether the link went down there
        self._last_bytes = 0  # of its last piece
        self._fresh = True  # no frame of the board in this segment yet
        self._ticks = TickCount()
        self._next_tick: int | None = None
        self._session = 0  # the last that was named, 0: none was
        self._anew = False  # the board's restart was reported, and no samples have arrived since
        self._configured = (0, 0)  # the session of the last configuration, and its first tick
        self._left: tuple[int, int] | None = None  # session and next tick when the link went down
        self._joined: int | None = None  # first tick since then
        self._rig_pieces = bytearray()
        self._key: int | None = None  # of the log (pvid.log.file)

    def feed(self, data: bytes) -> Iterator[Record]:
        """What these bytes completed; to be exhausted before the next call."""
        self.account.bytes += len(data)
        ahead: Loss | None = None  # a gap in the sequence, until the frame behind it is seen
        for item in self._decoder.items(data):
            if isinstance(item, Loss):
                if item.why != "sequence":
                    yield from self._hold(item)
                elif item.schema != LOG_SCHEMA:
                    ahead = item
            elif item.schema == LOG_SCHEMA:
                if self._key is None:
                    self._key = item.tick
                if item.tick == self._key:
                    ahead = None
                    yield from self._of_logger(item.message)
                else:  # from the line
                    yield from self._hold(Loss("foreign", bytes=len(item.message.payload)))
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
            yield from self._hold(Loss("malformed", bytes=self._decoder.unfinished))
        yield from self._release(cut=True)

    def skip(self, count: int) -> None:
        """The next `count` bytes are not fed: what follows is read from its first whole frame on."""
        self.account.bytes += count
        self.account.unread += count
        self._decoder.lose_place()
        self._held = self._next_tick = self._joined = self._left = None

    def _record(self, tick: int, item: Item) -> Record:
        number = self.account.segments[-1].number if self.account.segments else -1
        return Record(number, self.account.unix_ns, tick, item)

    def _hold(self, loss: Loss) -> Iterator[Record]:
        """Damage, which is one with the damage of the same kind before it: a line of garbage is few records."""
        held = self._held
        if held is not None and held.why == loss.why:
            self._held = replace(held, bytes=held.bytes + loss.bytes, pieces=held.pieces + 1)
            self._last_bytes = loss.bytes
            return
        yield from self._release()
        self._held, self._last_bytes = loss, loss.bytes

    def _release(self, cut: bool = False) -> Iterator[Record]:
        """What is held; `cut`: the link came up or went down behind it, and may have cut off its last piece."""
        held, self._held = self._held, None
        if held is None:
            return
        account, tick = self.account, self._next_tick or 0
        if held.why == "foreign":
            account.foreign += held.pieces
            yield self._record(tick, held)
        elif self._fresh:
            account.cut += held.pieces
            yield self._record(tick, replace(held, why="cut"))
        else:
            last = int(cut and self._last_bytes <= LONGEST_FRAME)
            if held.pieces > last:
                account.damaged += held.pieces - last
                account.damaged_since += held.pieces - last
                rest = held.bytes - last * self._last_bytes
                yield self._record(tick, replace(held, bytes=rest, pieces=held.pieces - last))
            if last:
                account.cut += 1
                yield self._record(tick, Loss("cut", bytes=self._last_bytes))

    def _of_logger(self, message: Message) -> Iterator[Record]:
        yield from self._release(cut=not isinstance(message, Mark))
        account = self.account
        self.is_log = True
        if isinstance(message, Segment | Mark | Close):
            account.unix_ns = min(message.unix_ns, _LATEST_NS)
        if isinstance(message, Segment):
            account.segments.append(SegmentAccount(account.begun, message.port, account.unix_ns))
            account.begun += 1
            for schema in self._decoder.schemas:
                if schema != LOG_SCHEMA:
                    self._decoder.expect_anew(schema)
            if self._next_tick is not None and self._session != 0:
                self._left = (self._session, self._next_tick)
            self._fresh, self._next_tick, self._session, self._joined = True, None, 0, None
            self._anew = False
        elif isinstance(message, Mark) and account.segments:
            account.segments[-1].received = message.received
        elif isinstance(message, Close) and account.segments:
            last = account.segments[-1]
            last.ended_ns, last.why, last.received = account.unix_ns, message.words, message.received
            account.garbled += not last.frames and last.received > (MAX_PAYLOAD if account.frames else 0)
        elif isinstance(message, Rig):
            self._take_rig(message)
        elif isinstance(message, LinkSchema):
            self._decoder.learn(message.text)
        yield self._record(0, message)

    def _of_board(self, frame: Frame, began: bool) -> Iterator[Record]:
        account, message = self.account, frame.message
        self._fresh = False
        account.damaged_since = 0
        account.frames += 1
        kind = message.kind if isinstance(message, Described) else type(message).layout().name
        if kind not in account.by_kind and len(account.by_kind) >= _MOST_KINDS:
            kind = OTHER_KINDS
        account.by_kind[kind] = account.by_kind.get(kind, 0) + 1
        account.lasting[type(message)] = message
        if account.segments:
            account.segments[-1].frames += 1
        named = getattr(message, "session", 0)
        waits = named == 0 and isinstance(message, Hello | Status | Credit)  # for a configuration: it has just started
        if self._next_tick is not None and (waits or (named != 0 and self._session not in (0, named))):
            began = True
        if began or waits:
            self._ticks.begin()
            self._session = 0
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
        totals: list[Account | SegmentAccount] = [self.account]
        if self.account.segments:
            totals.append(self.account.segments[-1])
        for one in totals:
            one.samples += samples
            one.missing_samples += ahead
        if ahead:
            yield self._record(tick, Gap(tick - ahead, ahead))

    def _take_rig(self, message: Rig) -> None:
        if message.offset == 0:
            self._rig_pieces.clear()
        if message.offset == len(self._rig_pieces) and message.size <= MAX_RIG:
            self._rig_pieces += message.text
        if len(self._rig_pieces) == message.size:
            self.rig = self._rig_pieces.decode("utf-8", "replace")


class LogReader:
    """The records of a file, from its beginning at every iteration.

    Raises PvidError while iterating: when the file cannot be read or holds not one frame.
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
                if stat.S_ISCHR(os.fstat(file.fileno()).st_mode):  # some never end
                    raise PvidError(f"{self.path} is a device and no log")
                while data := file.read(_CHUNK):
                    yield from stream.feed(data)
        except OSError as error:
            raise PvidError(f"cannot read {self.path}: {error.strerror}") from error
        yield from stream.end()
        if stream.is_log and not stream.account.begun and not stream.account.frames:
            raise PvidError(f"{self.path} is empty: the recording ended before the link was up")
        if not stream.account.frames and not stream.account.begun:
            raise PvidError(f"{self.path} is not a log of pvid: not one frame in {stream.account.bytes} bytes")
