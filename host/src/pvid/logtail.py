"""A log that grows, followed at a bounded distance from its end."""

from __future__ import annotations

import os
from typing import BinaryIO

from pvid.logreader import LogStream

MOST_BEHIND = 16 << 20  # bytes
_CHUNK = 1 << 16


class LogTail:
    """Reads a log behind its writer.

    What comes while it is followed is left out (LogStream.skip) where it lies more than `most_behind` bytes ahead; what
    is there before is read to its end.
    """

    def __init__(self, file: BinaryIO, stream: LogStream, most_behind: int = MOST_BEHIND) -> None:
        self._file = file
        self._stream = stream
        self._most_behind = most_behind
        self._there = os.fstat(file.fileno()).st_size

    def read(self, hurried: bool = False) -> bytes:
        """The next bytes for the stream, b"" when there are none yet; hurried: of what is left, the last only."""
        at, size = self._file.tell(), os.fstat(self._file.fileno()).st_size
        behind = size - at
        if behind > _CHUNK and (hurried or (at >= self._there and behind > self._most_behind)):
            self._stream.skip(behind - _CHUNK)
            self._file.seek(size - _CHUNK)
        return self._file.read(_CHUNK)
