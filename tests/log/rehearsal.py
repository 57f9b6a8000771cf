"""The lying board against all that reads it, in this process: `pvid log`, its views, commands that take a log."""

from __future__ import annotations

import io
import json
import re
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import serial
from lies import Behaviour
from lying_board import TICKS, Flood, HangUp, LyingBoard, Pause, Step, honest_samples, mechanism
from lying_board import board as honest_board
from rich.console import Console

from pvid.base.errors import PvidError
from pvid.board.target import Target
from pvid.link.frames import Raw
from pvid.log.live_stream import live_stream
from pvid.log.reader import LogReader, Observer
from pvid.log.recorder import Logger
from pvid.log.status import StatusLine
from pvid.show.page_state import LiveState
from pvid.show.view import LiveView

_ALLOWED_LOSS = 0.001
_SHORT_FLOOD = 100_000  # bytes
_ESCAPES = re.compile("\x1b\\]|\x07|\x1b\\[31m\x1b?X|\x1b\\[31mbye")


class _Line:
    """A port that plays steps, with short pauses."""

    def __init__(self, steps: Iterator[Step], source: RehearsedSource) -> None:
        self._steps = steps
        self._source = source

    def read(self, size: int = 1, /) -> bytes:
        """The next step."""
        step = next(self._steps, None)
        match step:
            case bytes():
                return step
            case Flood(data):
                return data * (_SHORT_FLOOD // len(data))
            case HangUp():
                raise serial.SerialException("disconnected")
            case Pause(seconds):
                time.sleep(min(seconds, 0.1))
            case None:
                self._source.logger.duration_s = 0.0  # the recording has lasted long enough
                time.sleep(0.001)
        return b""

    def write(self, data: bytes, /) -> int | None:
        """Nobody listens."""
        return len(data)

    def close(self) -> None:
        """Nothing to do."""


@dataclass
class RehearsedSource:
    """A source (pvid.log.recorder) of a behaviour."""

    behaviour: Behaviour
    name: str = "liar"
    usb: None = None
    logger: Logger = field(init=False)
    _steps: Iterator[Step] | None = None

    def open(self) -> Target:
        """See pvid.log.recorder.Source."""
        if self._steps is None:
            self._steps = self.behaviour.steps(LyingBoard())
        return Target(self.name, "unknown", _Line(self._steps, self))


def rehearse(behaviour: Behaviour, folder: Path, commands: Sequence[str]) -> list[str]:
    """Records a behaviour with all views; the live page's state and these commands (`export csv` ...) read the log."""
    from pvid.cli.log import print_account

    log = folder / "liar.pvlog"
    log.unlink(missing_ok=True)
    screen, line, said = io.StringIO(), io.StringIO(), io.StringIO()
    source = RehearsedSource(behaviour)
    console = Console(file=screen, force_terminal=True, width=100)
    views: list[Observer] = [
        LiveView(console, "title", mechanism()),
        StatusLine(line),
        live_stream("udp://127.0.0.1:9"),
        live_stream("teleplot://[::1]:9"),
    ]
    source.logger = Logger(source=source, out=log, observers=views, rig=honest_board().text())
    faults: list[str] = []
    with warnings.catch_warnings(), redirect_stdout(said), redirect_stderr(said):
        warnings.simplefilter("error")
        try:
            account = source.logger.run()
            code = print_account(account, _ALLOWED_LOSS, source.logger.failures)
            state = LiveState(log, "title")
            state.take(log.read_bytes())
            shown = json.loads(state.as_json())
            assert "cannot be shown" not in shown["lost"], shown["lost"]
        except Exception:
            return [f"log: {traceback.format_exc()}"]
        faults += [f"log: {one}" for one in source.logger.failures]
        if code not in behaviour.log:
            faults.append(f"log: exit code {code} in place of {behaviour.log[-1]}: {account.text}")
        for command in commands:
            faults += _invoked(command, log, folder)
    faults += [f"{len(account.segments)} segments"] if account.begun > 9 else []
    faults += _unreadable(behaviour, log)
    for text in (screen, line, said):
        faults += [f"escapes: {found!r}" for found in _ESCAPES.findall(text.getvalue())[:1]]
    return faults


def _invoked(command: str, log: Path, folder: Path) -> list[str]:
    """What goes wrong with a command in this process; a warning is an error here."""
    from pvid.cli.main import commands as program

    said = io.StringIO()
    with warnings.catch_warnings(), redirect_stdout(said), redirect_stderr(said):
        warnings.simplefilter("error")
        try:
            code = program.main(_arguments(command, log, folder), prog_name="pvid", standalone_mode=False)
        except PvidError as error:
            code = 2
            said.write(str(error))
        except Exception:
            return [f"{command}: {traceback.format_exc()}"]
    # A log always exports; the rest may be refused.
    allowed = (0,) if command.startswith("export") else (0, 1, 2, 3)
    faults = [] if code in allowed else [f"{command}: exit code {code}"]
    if unprintable := [line for line in said.getvalue().split("\n") if not line.isprintable()]:
        faults.append(f"{command}: {unprintable[0]!r}")
    return faults


def _arguments(command: str, log: Path, folder: Path) -> list[str]:
    name, *form = command.split()
    options = {"export": ["--to", *form, "-o", str(folder / "liar")], "plot": ["-o", str(folder / "liar.png")]}
    return [name, str(log), *options.get(name, [])]


def _unreadable(behaviour: Behaviour, log: Path) -> list[str]:
    """What was honest must be in the log, and be read back."""
    if not behaviour.honest_first:
        return []
    found = np.zeros((0, 2), np.float32)
    for record in LogReader(log):
        if isinstance(record.item, Raw):
            found = np.concatenate([found, record.item.values])
            if len(found) >= TICKS:
                break
    return [] if np.array_equal(found[:TICKS], honest_samples()) else [f"{len(found)} honest samples are read back"]
