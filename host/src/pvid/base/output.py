"""Standard output and standard error of a command, which may be full, closed or without a reader.

Output that cannot be written is a `PvidError`, so one sentence and exit code 2; a file that the shell opened for it
(`> FILE`) is emptied again, because half a table is worse than none. When the reader of a pipe has ended, as `head`
does, the command ends silently. Messages that cannot be written are dropped.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import io
import os
import stat
import sys
from typing import TYPE_CHECKING, Any, TextIO

from pvid.base.errors import PvidError

fcntl: Any = None  # not on Windows
with contextlib.suppress(ImportError):
    fcntl = importlib.import_module("fcntl")

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

READER_GONE = 141  # what a shell reports of a program that SIGPIPE ended


class _Watched(io.FileIO):
    """A descriptor to write to; after the first failure all is dropped, so that nothing is flushed into it again."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self.failed = False

    def write(self, data: ReadableBuffer, /) -> int:
        """See io.RawIOBase."""
        size = memoryview(data).nbytes
        if self.failed:
            return size
        try:
            return super().write(data)
        except OSError as error:
            self.failed = True
            self._fail(error)
            return size

    def _fail(self, error: OSError) -> None:
        """Drops messages."""


class _Output(_Watched):
    """Standard output."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor)
        self._begin = _begin_of_file(descriptor)

    def _fail(self, error: OSError) -> None:
        if isinstance(error, BrokenPipeError):
            raise SystemExit(READER_GONE) from error
        if self._begin is not None:
            with contextlib.suppress(OSError):
                os.ftruncate(self.fileno(), self._begin)
        why = "standard output is closed" if error.errno == errno.EBADF else error.strerror
        raise PvidError(f"the output cannot be written: {why}") from error


def _begin_of_file(descriptor: int) -> int | None:
    """Where in a regular file the output begins; None where it is none, or others may append to it, too."""
    if fcntl is None:
        return None
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode) or fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_APPEND:
            return None
        return os.lseek(descriptor, 0, os.SEEK_CUR)
    except OSError:
        return None


def watch() -> None:
    """Puts watched streams in place of the process's own; streams that a caller has replaced stay."""
    if sys.stdout is sys.__stdout__:
        # A closed stream becomes a read-only descriptor, so that writing fails, as with the GNU tools.
        descriptor = os.open(os.devnull, os.O_RDONLY) if sys.stdout is None else sys.stdout.fileno()
        sys.stdout = _text(_Output(descriptor), sys.stdout)
    if sys.stderr is sys.__stderr__:
        descriptor = os.open(os.devnull, os.O_WRONLY) if sys.stderr is None else sys.stderr.fileno()
        sys.stderr = _text(_Watched(descriptor), sys.stderr)


def _text(raw: _Watched, like: TextIO | None) -> io.TextIOWrapper:
    encoding = getattr(like, "encoding", None) or "utf-8"
    errors = getattr(like, "errors", None) or "strict"
    if errors == "strict":  # a file's name may be no text: its bytes are written as they are, or in words
        errors = "surrogateescape" if encoding.lower().replace("-", "") == "utf8" else "backslashreplace"
    by_line = bool(getattr(like, "line_buffering", True))
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding=encoding, errors=errors, line_buffering=by_line)
