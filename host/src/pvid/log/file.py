"""The log of `pvid log`: all bytes from the board, and the logger's own frames between them.

A log opens with the codec of the link (link.frames) and describes itself. It is a row of frames, each ended by 0x00:

    schema of the logger's frames (type 2, under their own schema number), then for every connection of the link
        Segment     when, from which port, by which pvid
        Rig ...     the rig file, in pieces, if the logger has one; `verify` and `identify` need it
        LinkSchema  the schema of the link in this pvid (a board with another one sends its own)
        the bytes from the board, unchanged; between two of its frames, about once a second, a Mark: the time
        Close       when and why the segment ended; missing when the logger was killed
    then the next segment, in the same file.

A frame of the logger always follows a 0x00, which is added if the board's last frame is incomplete, and has its own
schema number: without these frames the file contains the bytes from the board. The file is only ever appended to. A
logger that is killed leaves a file whose frames are whole but for the last.

The logger's frames are numbered through the file. Their tick is the file's key, a number drawn when the file is made,
which is never sent to a board: a frame of the logger's schema with another tick came over the line, not from the
logger. The first frame, before all bytes from the board, contains the key.
"""

from __future__ import annotations

import json
import os
import secrets
import time
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.file_lock import lock
from pvid.base.version import __version__
from pvid.base.wording import printable
from pvid.link import frames as link
from pvid.link.frames import Decoder, Frame, Message, Schema, readers, wire

MARK_NS = 1_000_000_000
SYNC_NS = 5_000_000_000
_SYNC_BYTES = 1 << 25  # or after so many: what is not on the disk yet at the end has to be waited for
MAX_RIG = 1 << 20  # bytes of a rig file in a log
_RIG_PIECE = 1000  # of it in a frame
_HEAD = 1 << 16  # bytes of a log among which its first frame is

LOG_MESSAGES: dict[int, type[Message]] = {Schema.TYPE: Schema}


@dataclass(frozen=True)
class Segment(Message, messages=LOG_MESSAGES):
    """The link came up; `about` is a JSON object: pvid (its version), port, usb (identity or null)."""

    TYPE = 240
    number: int = wire("u32")  # 0, 1, ... in the file
    unix_ns: int = wire("u64")
    about: bytes = wire("char", None)

    @property
    def description(self) -> dict[str, Any]:
        """`about` as an object; empty when it is none."""
        try:
            found = json.loads(self.about)
        except (ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}

    @property
    def port(self) -> str:
        """The port's name; empty if unknown."""
        return printable(str(self.description.get("port", "")))


@dataclass(frozen=True)
class Mark(Message, messages=LOG_MESSAGES):
    """What stands before it had come by this time: `received` bytes from the board in this segment."""

    TYPE = 241
    unix_ns: int = wire("u64")
    received: int = wire("u64")


@dataclass(frozen=True)
class Close(Message, messages=LOG_MESSAGES):
    """The segment has ended; `why` in words."""

    TYPE = 242
    unix_ns: int = wire("u64")
    received: int = wire("u64")
    why: bytes = wire("char", None)

    @property
    def words(self) -> str:
        """`why` as text."""
        return printable(self.why.decode("utf-8", "replace"))


@dataclass(frozen=True)
class Rig(Message, messages=LOG_MESSAGES):
    """Bytes of the rig file from `offset` on, which has `size` of them."""

    TYPE = 243
    offset: int = wire("u32")
    size: int = wire("u32")
    text: bytes = wire("char", None)


@dataclass(frozen=True)
class LinkSchema(Message, messages=LOG_MESSAGES):
    """What the board's frames of that schema mean."""

    TYPE = 244
    text: bytes = wire("char", None)


LOG_SCHEMA_TEXT = link.schema_text(LOG_MESSAGES)
LOG_SCHEMA = zlib.crc32(LOG_SCHEMA_TEXT.encode())


def _key_of(path: Path) -> int | None:
    """The key of a log that is there; None when no frame of a logger is in front."""
    decoder = Decoder(schemas={LOG_SCHEMA: readers(LOG_MESSAGES)})
    with path.open("rb") as file:
        for item in decoder.items(file.read(_HEAD)):
            if isinstance(item, Frame):
                return item.tick
    return None


class LogWriter:
    """Appends to a log; every call has reached the operating system when it returns.

    Raises PvidError when the file exists, another recorder writes it, or it cannot be made or written; so do the
    methods.

    Parameters
    ----------
    path : the log; it must not exist unless `append`
    rig : text of the rig file that goes in front of every segment
    """

    def __init__(self, path: Path, *, rig: str | None = None, append: bool = False) -> None:
        self.path = path
        self._rig = rig
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | (0 if append else os.O_EXCL), 0o644)
            self._lock()
            self.start = os.fstat(self._file).st_size
            key = _key_of(path) if self.start else None
        except FileExistsError as error:
            raise PvidError(f"{path} exists; --append adds to it") from error
        except OSError as error:
            raise PvidError(f"cannot write {path}: {error.strerror}") from error
        self._key = secrets.randbits(32) if key is None else key
        self._sequence = 0
        self._segments = 0
        self._received = 0
        self._unsynced = 0
        self.written = 0  # bytes, since it was opened
        self._between = self.start == 0  # whether the last byte was the end of a frame
        self._marked = self._synced = time.time_ns()
        self._write(b"" if self._between else b"\0")
        self._write(self._frame(Schema(LOG_SCHEMA_TEXT.encode())))

    def _lock(self) -> None:
        try:
            lock(self._file, self.path)
        except PvidError:
            self.close()
            raise

    def _write(self, data: bytes) -> None:
        self._unsynced += len(data)
        self.written += len(data)
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._file, view) :]
        except OSError as error:
            raise PvidError(f"cannot write {self.path}: {error.strerror}") from error

    def _frame(self, message: Message) -> bytes:
        self._sequence += 1
        return link.encode(message, self._sequence - 1, self._key, LOG_SCHEMA)

    def begin(self, port: str, usb: dict[str, Any] | None) -> None:
        """The link came up."""
        about = json.dumps({"pvid": __version__, "port": port, "usb": usb}).encode()
        frames = [self._frame(Segment(self._segments, time.time_ns(), about))]
        rig = (self._rig or "").encode()
        for offset in range(0, len(rig), _RIG_PIECE):
            frames.append(self._frame(Rig(offset, len(rig), rig[offset : offset + _RIG_PIECE])))
        frames.append(self._frame(LinkSchema(link.SCHEMA_TEXT.encode())))
        self._write(b"".join(frames))
        self._segments += 1
        self._received = 0
        self._between = True

    def take(self, data: bytes) -> None:
        """What came from the board, b"" when nothing did: call it at least every second."""
        now = time.time_ns()
        if now - self._marked >= MARK_NS:
            cut = data.rfind(b"\0") + 1
            if cut or self._between:
                self._marked = now
                mark = self._frame(Mark(now, self._received + cut))
                self._received += len(data)
                self._write(data[:cut] + mark + data[cut:])
                self._between = len(data) == cut
                self._sync(now)
                return
        self._received += len(data)
        self._write(data)
        self._between = data.endswith(b"\0") if data else self._between
        if self._unsynced >= _SYNC_BYTES:
            self._sync(now)

    def end(self, why: str) -> None:
        """The link is down."""
        gap = b"" if self._between else b"\0"
        self._write(gap + self._frame(Close(time.time_ns(), self._received, why.encode()[: link.MAX_PAYLOAD // 2])))
        self._between = True
        self._sync(None)

    def _sync(self, now: int | None) -> None:
        if now is None or now - self._synced >= SYNC_NS or self._unsynced >= _SYNC_BYTES:
            self._synced = time.time_ns() if now is None else now
            self._unsynced = 0
            try:
                os.fsync(self._file)
            except OSError as error:
                raise PvidError(f"cannot write {self.path}: {error.strerror}") from error

    def close(self) -> None:
        """Closes the file."""
        os.close(self._file)
