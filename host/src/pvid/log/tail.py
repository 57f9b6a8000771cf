"""Follows a log that is being written, at a bounded distance from its end."""

from __future__ import annotations

import os
from typing import BinaryIO

from pvid.log.reader import LogStream

MOST_BEHIND = 16 << 20  # bytes
_CHUNK = 1 << 16


class LogTail:
    """Reads a log behind its writer.

    Bytes that are in the file at the start are all read, and those up to the first segment, without which a recording
    has not begun. After that, if the reader is more than `most_behind` bytes behind the writer, it skips bytes
    (LogStream.skip).
    """

    def __init__(self, file: BinaryIO, stream: LogStream, most_behind: int = MOST_BEHIND) -> None:
        self._file = file
        self._stream = stream
        self._most_behind = most_behind
        self._there = os.fstat(file.fileno()).st_size

    def read(self, hurried: bool = False) -> bytes:
        """The next bytes for the stream, b"" if there are none yet; hurried: skips to the last 64 kB of the file."""
        at, size = self._file.tell(), os.fstat(self._file.fileno()).st_size
        behind = size - at
        begun = at >= self._there and self._stream.account.begun > 0
        if behind > _CHUNK and (hurried or (begun and behind > self._most_behind)):
            self._stream.skip(behind - _CHUNK)
            self._file.seek(size - _CHUNK)
        return self._file.read(_CHUNK)
