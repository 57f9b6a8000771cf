"""`pvid log`: writes the bytes of a port to disk first, then passes their records to the observers.

One thread only reads the port and appends to the log (pvid.log.file). The caller's thread follows the file like any
other reader, so that a slow screen or a slow consumer loses no byte; its memory is one chunk and the account. If a
board sends faster than frames can be decoded, the caller's thread skips bytes: they are on the disk, and counted
(Account.unread). An observer that fails is removed; the recording continues.
"""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from pvid.base.errors import PvidError
from pvid.base.wording import printable, reason
from pvid.board.target import Target, refusal
from pvid.link.frames import Code, Configuration, Credit, Hello, Message, Status, encode
from pvid.link.port import Port, loss_cause, open_port
from pvid.log.file import LogWriter, Segment
from pvid.log.reader import Account, LogStream, Observer, Record
from pvid.log.tail import LogTail
from pvid.log.text_table import TextTable

_CHUNK = 1 << 14
_NEAR = 1 << 10  # bytes: some frames
_LEAST_SAMPLE = 4  # bytes that a sample of one sensor takes in a frame
_RETRY_S = 0.25  # twice as long after every segment that lasts less than _SHORT_S, up to _LONGEST_RETRY_S
_SHORT_S = 1.0
_LONGEST_RETRY_S = 8.0
_DRAIN_S = 1.0
_MOST_FAILURES = 8  # that are named
_CATCH_UP_S = 3.0  # for what is not decoded yet when the recording ends
_LOOK_S = 0.05
_FOLLOWED_S = 0.005
_RESEND_S = 1.0


class Source(Protocol):
    """Where the bytes come from."""

    @property
    def name(self) -> str:
        """As it is shown and written into the log."""

    def open(self) -> Target:
        """Opens it, for the first time or again. Raises PvidError when it is not there."""

    @property
    def usb(self) -> dict[str, Any] | None:
        """The identity by which it is found again; None: by its name."""


@dataclass
class PortSource:
    """A serial port, a pseudo-terminal or a URL of pyserial.

    A USB device is found again by vendor, product, serial number and interface, whichever port it then has. One without
    a serial number, or of which another with the same one was plugged in, is found again in the socket that it was in.
    Anything else, a symbolic link of udev's among it, is found again by its name.
    """

    name: str
    usb: dict[str, Any] | None = None
    keeps_input: bool = False  # what had come before it was opened

    def open(self) -> Target:
        """See Source."""
        from serial.tools import list_ports  # of the extra `serial`

        place = self.name
        devices = {one.device: found for one in list_ports.comports() if (found := _identity(one)) is not None}
        if self.usb is None:
            self.usb = _lasting(devices.get(place), list(devices.values()))
        else:
            place = _find(self.usb, devices, self.name)
        port = open_port(place, keeps_input=True) if self.keeps_input else open_port(place)
        return Target(self.name, "unknown", port)


def _identity(info: Any) -> dict[str, Any] | None:
    """Of a port as pyserial lists it; None when it is no USB device.

    pyserial's location is the socket ("1-1.2"), and of a device with several interfaces also which one ("1-1.2:1.0").
    The ports of one adapter have its serial number in common and differ in that.
    """
    if info.vid is None:
        return None
    location = info.location or ""
    return {
        "vid": info.vid,
        "pid": info.pid,
        "serial": info.serial_number or "",
        "interface": location.partition(":")[2],
        "location": location,
    }


def _lasting(device: dict[str, Any] | None, all_devices: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The part of an identity that a device keeps when it is plugged in again; None: no such part."""
    if device is None:
        return None
    alike = [one for one in all_devices if {**one, "location": ""} == {**device, "location": ""}]
    if device["serial"] and len(alike) == 1:
        return {key: value for key, value in device.items() if key != "location"}
    return device if device["location"] else None


def _find(usb: dict[str, Any], devices: dict[str, dict[str, Any]], name: str) -> str:
    """The port of the device with that identity."""
    found = [place for place, device in devices.items() if usb.items() <= device.items()]
    if not found:
        raise PvidError(f"the device of {name} is not plugged in")
    if len(found) > 1:
        raise PvidError(f"{' and '.join(found)} are alike, and either may be the device of {name}")
    return found[0]


@dataclass
class EmulatorSource:
    """An emulator that is started, and started again when it has gone."""

    name: str
    start: Callable[[], Target]
    usb: None = None

    def open(self) -> Target:
        """See Source."""
        return self.start()


class Recorder(threading.Thread):
    """Reads a source into a log until `stop` is set; then it takes in what is still under way and ends.

    `error` is what ended it before that, if anything did; `obstacle` why the link cannot be taken up again, while it is
    tried. On every connection the board is asked for its description;
    an emulator only after its first word (Target.coming_up_s), for what it is sent before is lost.

    Parameters
    ----------
    room : how many bytes may be read before more of the log is decoded; None: all that come. It holds for an emulator,
        which may send faster than frames are decoded and waits; a board on a line does not, and is read at once.
    """

    def __init__(self, source: Source, writer: LogWriter, room: Callable[[], int] | None = None) -> None:
        super().__init__(name="recorder", daemon=True)
        self.source = source
        self.writer = writer
        self._room = room
        self.stop = threading.Event()
        self.why = "ended"
        self.connected = False
        self.error: Exception | None = None
        self.obstacle = ""
        self._target: Target | None = None
        self._sent = 0

    def run(self) -> None:
        """See the class."""
        try:
            target = self.source.open()  # not being there at all is an error
            pause = _RETRY_S
            while True:
                began = time.monotonic()
                self._segment(target)
                short = time.monotonic() - began < _SHORT_S
                pause = min(2 * pause, _LONGEST_RETRY_S) if short else _RETRY_S
                reopened = self._reopen(pause)
                if reopened is None:
                    return
                target = reopened
        except Exception as error:  # raised again in the thread that waits for this one
            self.error = error
        finally:
            self.connected = False
            with contextlib.suppress(OSError):
                self.writer.close()

    def send(self, message: Message) -> None:
        """To the board, if it is there; whether it arrived shows in what it answers."""
        target = self._target
        if target is not None:
            self._sent += 1
            # TypeError: pyserial's own, when the other thread closes the port meanwhile
            with contextlib.suppress(OSError, TypeError):
                target.port.write(encode(message, self._sent - 1))

    def _segment(self, target: Target) -> None:
        self.writer.begin(self.source.name, self.source.usb)
        self._target, self.connected = target, True
        try:
            why = self._read(target.port, target.coming_up_s, None if target.process is None else self._room)
        finally:
            self._target, self.connected = None, False
            with contextlib.suppress(OSError):
                target.close()
        self.writer.end(why)

    def _read(self, port: Port, silent_s: float, room: Callable[[], int] | None) -> str:
        """Until the port is gone or the end is requested; returns which."""
        ask_at: float | None = time.monotonic() + silent_s
        try:
            while not self.stop.is_set():
                most = _CHUNK if room is None else min(_CHUNK, room())
                data = port.read(most) if most > 0 else b""
                if most <= 0:
                    self.stop.wait(_FOLLOWED_S)
                self.writer.take(data)
                if ask_at is not None and (data or time.monotonic() >= ask_at):
                    ask_at = None
                    self.send(Credit(0, 0, 0, 0))
            limit, left = time.monotonic() + _DRAIN_S, _CHUNK if room is None else _NEAR
            while left > 0 and time.monotonic() < limit and (data := port.read(left)):
                left -= 0 if room is None else len(data)
                self.writer.take(data)
        except OSError as error:
            return f"the port is gone: {loss_cause(error)}"
        return self.why

    def _reopen(self, pause_s: float) -> Target | None:
        try:
            while not self.stop.wait(pause_s):
                try:
                    return self.source.open()
                except PvidError as error:
                    self.obstacle = printable(str(error))
                    pause_s = _RETRY_S
            return None
        finally:
            self.obstacle = ""


class RefusedError(PvidError):
    """The board does not take its configuration."""


class TextError(PvidError):
    """The board prints text."""


class Starter:
    """An observer that configures a board which is not, so that it samples by itself.

    A board that refuses at first ends the recording; one that refuses after it has run is recorded as it is.

    Parameters
    ----------
    send : to the board
    begin : makes a configuration, with a new session
    restart : also a board that is configured already, whenever the link has come up
    """

    def __init__(self, send: Callable[[Message], None], begin: Callable[[], Configuration], restart: bool) -> None:
        self._send = send
        self._begin = begin
        self._restart = restart
        self._fresh = False  # the link has just come up
        self._wanted: Configuration | None = None
        self._has_run = False
        self._sent = float("-inf")

    def take(self, record: Record, account: Account) -> None:
        """See logreader.Observer. Raises RefusedError when the board refuses."""
        match record.item:
            case Segment():
                self._wanted, self._fresh = None, True
            case Hello() as hello if self._wanted is None:
                if hello.session == 0 or (self._restart and self._fresh):
                    self._wanted, self._sent = self._begin(), float("-inf")
                self._fresh = False
            case Status() as status if self._wanted is not None and status.session == self._wanted.session:
                self._has_run = self._has_run or status.code == Code.RUNNING
                if not self._has_run:
                    raise RefusedError(f"the board refused: {refusal(status)}")
                self._wanted = None
            case _:
                pass

    def idle(self, account: Account) -> None:
        """See logreader.Observer."""
        now = time.monotonic()
        if self._wanted is not None and now - self._sent >= _RESEND_S:
            self._sent = now
            self._send(self._wanted)

    def close(self, account: Account) -> None:
        """See logreader.Observer."""


class Stoppable(Protocol):
    """A recording that can be ended."""

    stop: threading.Event
    why: str


@contextlib.contextmanager
def asked_to_end(recorder: Stoppable) -> Iterator[None]:
    """SIGINT and SIGTERM end the recording instead of the program; a second one ends the program."""

    def ask(number: int, _: object) -> None:
        recorder.why = f"ended by {signal.Signals(number).name}"
        recorder.stop.set()
        signal.signal(number, previous[signal.Signals(number)])

    previous = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in previous:
        signal.signal(number, ask)
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@dataclass
class Logger:
    """Records a source and hands every record to the observers.

    Parameters
    ----------
    rig : text of the rig file that is written into the log
    append : whether `out` may exist
    duration_s : duration after the first connection [s]; None: until the end is requested
    samples : ends by itself when so many have come, and of an emulator before some frames more have; None: likewise
    begin, restart : see Starter; without `begin` nothing is configured
    failures : of observers, and of the stream that reads the log for them, in a sentence each
    """

    source: Source
    out: Path
    observers: Sequence[Observer] = ()
    rig: str | None = None
    append: bool = False
    duration_s: float | None = None
    samples: int | None = None
    begin: Callable[[], Configuration] | None = None
    restart: bool = False
    stream: LogStream = field(default_factory=LogStream)
    failures: list[str] = field(default_factory=list)
    _observers: list[Observer] = field(default_factory=list)
    _decoded: int = 0  # bytes of this recording
    _text: TextTable = field(default_factory=TextTable)

    def run(self) -> Account:
        """Until SIGINT, SIGTERM or the duration; in the main thread.

        Raises PvidError when the source is not there at the start, the board refuses its configuration, or the log
        cannot be written; what came is in the log. Raises TextError when the port sends lines of numbers: there is no
        log then.
        """
        writer = LogWriter(self.out, rig=self.rig, append=self.append)
        recorder = Recorder(self.source, writer, None if self.samples is None else lambda: self._room(writer))
        starter = None if self.begin is None else Starter(recorder.send, self.begin, self.restart)
        self._observers = [*self.observers, *([] if starter is None else [starter])]
        with asked_to_end(recorder), self.out.open("rb") as file:
            file.seek(writer.start)
            recorder.start()
            try:
                self._follow(LogTail(file, self.stream), recorder)
                self._hand_out(self.stream.end)
            except TextError:
                self.out.unlink()
                raise
            finally:
                recorder.stop.set()
                recorder.join()
                self._each(lambda one: one.close(self.stream.account))
        if recorder.error is not None:
            if not self.stream.account.begun and writer.start == 0:
                self.out.unlink()
            raise recorder.error
        return self.stream.account

    def _follow(self, tail: LogTail, recorder: Recorder) -> None:
        """Reads behind the recorder until both have come to the end."""
        limit = patience = float("inf")
        while True:
            ended = not recorder.is_alive()
            if ended and patience == float("inf"):
                patience = time.monotonic() + _CATCH_UP_S
            if self.duration_s is not None and limit == float("inf") and self.stream.account.begun:
                limit = time.monotonic() + self.duration_s
            self.stream.account.obstacle = recorder.obstacle
            if not self._catch_up(tail.read(hurried=time.monotonic() > patience)):
                if ended:
                    return
                time.sleep(_LOOK_S)
            if recorder.stop.is_set():
                continue
            if time.monotonic() >= limit:
                recorder.why = f"{self.duration_s:g} s are over"
                recorder.stop.set()
            elif self.samples is not None and self.stream.account.samples >= self.samples:
                recorder.why = f"the {self.samples} samples that were asked for have come"
                recorder.stop.set()

    def _room(self, writer: LogWriter) -> int:
        """Bytes that cannot hold more samples than are still wanted, less those that are not decoded."""
        wanted = (self.samples or 0) - self.stream.account.samples
        return max(_NEAR, _LEAST_SAMPLE * wanted) - (writer.written - self._decoded)

    def _refuse_text(self, data: bytes) -> None:
        """PvidError where the port sends lines of a table, and no frame so far."""
        if not self.stream.account.frames and not self.append:
            self._text.feed(data)
            if self._text.is_text:
                table = self.out.with_suffix(".csv")
                raise TextError(
                    f'{self.source.name} sends text ("{printable(self._text.example)}"), not frames: record it as a '
                    f"table with `pvid log {self.source.name} {table}`"
                )

    def _catch_up(self, data: bytes) -> bool:
        self._hand_out(lambda: self.stream.feed(data))
        self._decoded = self.stream.account.bytes
        self._refuse_text(data)
        self._each(lambda one: one.idle(self.stream.account))
        return bool(data)

    def _hand_out(self, records: Callable[[], Iterable[Record]]) -> None:
        try:
            for record in records():
                self._each(lambda one: one.take(record, self.stream.account))  # noqa: B023 - called at once
        except RefusedError:
            raise
        except Exception as error:  # of the stream: what is behind this chunk is read all the same
            self.stream.skip(0)
            self._fail(self.stream, error)

    def _each(self, call: Callable[[Observer], None]) -> None:
        """Calls every observer; one that fails is no longer among them."""
        for one in list(self._observers):
            try:
                call(one)
            except RefusedError:
                raise
            except Exception as error:  # the board's bytes are recorded whatever a view makes of them
                self._observers.remove(one)
                with contextlib.suppress(Exception):
                    one.close(self.stream.account)
                self._fail(one, error)

    def _fail(self, what: object, error: Exception) -> None:
        failure = f"{type(what).__name__} failed with {type(error).__name__}: {printable(reason(error))}"
        if len(self.failures) < _MOST_FAILURES:
            self.failures.append(f"{failure}; the recording went on")
