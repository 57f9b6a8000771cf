"""Records what a board prints as a table: every byte to disk first, then the rows among them."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pvid.base.atomic_write import appearing
from pvid.base.errors import PvidError
from pvid.base.file_lock import lock
from pvid.board.target import Target
from pvid.link.port import loss_cause
from pvid.log.recorder import Source, asked_to_end
from pvid.log.text_table import TextTable

_CHUNK = 1 << 14
_RETRY_S = 0.25
_TOLD_S = 10.0
_FRAMES = 2  # that are no accident


@dataclass
class TextRecorder:
    """Writes the rows to `out` as they come, and all bytes to `out`.raw, which stays if a line was left out.

    Attributes
    ----------
    duration_s, samples : ends after this time, and after so many rows; None: at SIGINT or SIGTERM
    tell : is given a line on how it goes, every ten seconds
    why : in words, what ended it
    received : bytes
    """

    source: Source
    out: Path
    duration_s: float | None = None
    samples: int | None = None
    tell: Callable[[str], None] = lambda _: None
    stop: threading.Event = field(default_factory=threading.Event)
    why: str = "ended"
    table: TextTable = field(default_factory=TextTable)
    received: int = 0

    @property
    def raw(self) -> Path:
        """All bytes."""
        return self.out.with_name(self.out.name + ".raw")

    @property
    def is_whole(self) -> bool:
        """Whether the table has every line."""
        return bool(self.table.rows) and not (self.table.damaged or self.table.words)

    def run(self) -> TextTable:
        """Until SIGINT, SIGTERM, the duration or the samples; in the main thread.

        Raises PvidError when the port is not there at the start, a file of the name exists or cannot be written, or the
        port sends frames: there is no file then.
        """
        with contextlib.ExitStack() as files:
            rows, raw = (self._made(path, files) for path in (self.out, self.raw))
            try:
                lock(raw, self.raw)
                target = self.source.open()
                with asked_to_end(self):
                    self._record(target, rows, raw)
            except PvidError:
                if not self.table.rows:
                    self.out.unlink()
                    self.raw.unlink()
                raise
            self._written(rows, self.table.end())
        if self.is_whole or not self.received:
            self.raw.unlink()
        if not self.table.rows:
            self.out.unlink()
        elif self.table.restarts:
            self._with_header()
        return self.table

    def _made(self, path: Path, files: contextlib.ExitStack) -> int:
        try:
            made = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            if path == self.raw:
                self.out.unlink()
            raise PvidError(f"{path} exists: a recording replaces nothing; name another file") from error
        except OSError as error:
            raise PvidError(f"cannot write {path}: {error.strerror}") from error
        files.callback(os.close, made)
        return made

    def _record(self, target: Target, rows: int, raw: int) -> None:
        began = told = time.monotonic()
        while not self.stop.is_set():
            try:
                data = target.port.read(_CHUNK)
            except OSError as error:
                target = self._reopened(target, error, began)
                self.table.cut()
                continue
            self.received += len(data)
            _write(raw, data, self.raw)
            self._written(rows, self.table.feed(data))
            if self.table.frames >= _FRAMES and not self.table.rows:
                raise PvidError(
                    f"{self.source.name} sends frames, not text: `pvid log {self.source.name} "
                    f"{self.out.with_suffix('.pvlog')}` records them"
                )
            if time.monotonic() - told >= _TOLD_S:
                told = time.monotonic()
                self.tell(f"{self.table.rows} rows, damaged {self.table.damaged}")
            self._end_when_due(began)
        with contextlib.suppress(OSError):
            target.close()

    def _end_when_due(self, began: float) -> None:
        if self.samples is not None and self.table.rows >= self.samples:
            self.why = f"the {self.samples} samples that were asked for have come"
            self.stop.set()
        elif self.duration_s is not None and time.monotonic() - began >= self.duration_s:
            self.why = f"{self.duration_s:g} s are over"
            self.stop.set()

    def _reopened(self, target: Target, error: Exception, began: float) -> Target:
        """The port when it is back; the old one where the end comes first."""
        self.tell(f"the port is gone: {loss_cause(error)}; waiting for it")
        with contextlib.suppress(OSError):
            target.close()
        while not self.stop.wait(_RETRY_S):
            with contextlib.suppress(PvidError):
                return self.source.open()
            self._end_when_due(began)
        return target

    def _written(self, rows: int, lines: str) -> None:
        if lines and not os.fstat(rows).st_size:
            lines = self.table.header + lines
        _write(rows, lines.encode(), self.out)

    def _with_header(self) -> None:
        """Puts the header that came late in the place of a made one."""
        with self.out.open("rb") as old:
            if old.readline() != self.table.header.encode():
                with appearing(self.out, freely=True) as fresh, fresh.open("wb") as file:
                    file.write(self.table.header.encode())
                    while piece := old.read(1 << 20):
                        file.write(piece)


def _write(file: int, data: bytes, path: Path) -> None:
    view = memoryview(data)
    try:
        while view:
            view = view[os.write(file, view) :]
    except OSError as error:
        raise PvidError(f"cannot write {path}: {error.strerror}") from error
