"""The lying board against everything that reads it: `pvid log` and its views, and every command that takes a log.

`rehearse` plays a behaviour within this process, in a fraction of a second; `perform` plays it over a socket to the
program, with its floods. Both then run commands on the log, within this process, and return what went wrong, a sentence
each.
"""

from __future__ import annotations

import io
import json
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np
import serial
from rich.console import Console

from bench.case import Advance, Report, counts
from bench.liar_board import TICKS, Flood, HangUp, LyingBoard, Pause, Step, honest_samples, mechanism, rig
from bench.liar_board import board as honest_board
from bench.lies import BEHAVIOURS, Behaviour
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
EXPORTS = ("csv", "parquet", "mcap", "npz")


# ---- within this process


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
            faults += _invoked(command, log, folder)[1]
    faults += [f"{len(account.segments)} segments"] if account.begun > 9 else []
    faults += _unreadable(behaviour, log)
    for text in (screen, line, said):
        faults += [f"escapes: {found!r}" for found in _ESCAPES.findall(text.getvalue())[:1]]
    return faults


def _invoked(command: str, log: Path, folder: Path) -> tuple[int | None, list[str]]:
    """A command of the program in this process: its exit code, and what went wrong; a warning is an error here."""
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
            return None, [f"{command}: {traceback.format_exc()}"]
    faults = [] if code in _codes(command) else [f"{command}: exit code {code}"]
    if unprintable := [line for line in said.getvalue().split("\n") if not line.isprintable()]:
        faults.append(f"{command}: {unprintable[0]!r}")
    return code, faults


def _arguments(command: str, log: Path, folder: Path) -> list[str]:
    name, *form = command.split()
    options = {"export": ["--to", *form, "-o", str(folder / "liar")], "plot": ["-o", str(folder / "liar.png")]}
    return [name, str(log), *options.get(name, [])]


def _codes(command: str) -> tuple[int, ...]:
    """Exit codes that a command may have on the log of a liar: a log always exports, the rest may be refused."""
    return (0,) if command.startswith("export") else (0, 1, 2, 3)


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


# ---- the program, over a socket


@dataclass
class Performance:
    """What a behaviour did to the program: exit codes by command, peak of the logger's resident memory [kB], how long
    it lasted beyond its duration [s], and what went wrong."""

    behaviour: Behaviour
    codes: dict[str, int | None] = field(default_factory=dict)
    peak_kb: int = 0
    late_s: float = 0.0
    faults: list[str] = field(default_factory=list)


DURATION_S = 3.0
MOST_KB = 150 * 1024
LATEST_S = 8.0
_READ_WHOLE = 12_000_000  # bytes of a log that the other commands read in reasonable time
COMMANDS = ("verify", *(f"export {form}" for form in EXPORTS), "identify", "plot")


def perform(behaviour: Behaviour, folder: Path) -> Performance:
    """Plays a behaviour to `pvid log` over a socket, then runs every command on the log."""
    done = Performance(behaviour)
    log = folder / "liar.pvlog"
    log.unlink(missing_ok=True)
    rig().write(folder / "rig.toml")
    server = socket.create_server(("127.0.0.1", 0))
    server.settimeout(DURATION_S + 60)
    up: list[float] = []
    later = iter(behaviour.steps(LyingBoard()))
    # The first takes a second to make, and the system accepts a connection before that; b"": there is none.
    steps = chain([next(later, b"")], later)
    threading.Thread(target=_serve, args=(server, steps, up), daemon=True).start()
    port = f"socket://127.0.0.1:{server.getsockname()[1]}"
    command = [
        "log",
        port,
        str(log),
        "--rig",
        str(folder / "rig.toml"),
        "--duration",
        str(DURATION_S),
        "--web",
        "127.0.0.1:0",
    ]
    began = time.monotonic()
    waited = before = 0.0  # for a processor; before the connection
    with (folder / "out").open("w+b") as out:
        process = subprocess.Popen([*_PROGRAM, *command], stdout=out, stderr=subprocess.STDOUT, cwd=folder)
        while process.poll() is None and time.monotonic() < began + DURATION_S + 60:
            done.peak_kb = max(done.peak_kb, _peak_kb(process.pid))
            waited = max(waited, _waited_s(process.pid))
            if not up:
                before = waited
            time.sleep(0.05)
        if process.poll() is None:
            done.faults.append("log does not end")
            process.kill()
            process.wait()
        done.late_s = max(0.0, time.monotonic() - (up or [began])[0] - DURATION_S - (waited - before))
        out.seek(0)
        _note(done, "log", process.returncode, out.read())
    server.close()
    if done.codes["log"] not in behaviour.log:
        done.faults.append(f"log: exit code {done.codes['log']} in place of {behaviour.log[-1]}")
    if done.peak_kb > MOST_KB:
        done.faults.append(f"log: {done.peak_kb} kB of memory")
    if done.late_s > LATEST_S:
        done.faults.append(f"log: ends {done.late_s:.0f} s late")
    if not log.exists() or log.stat().st_size <= _READ_WHOLE:
        for one in COMMANDS:
            done.codes[one], faults = _invoked(one, log, folder)
            done.faults += faults
    done.faults += _unreadable(behaviour, log)
    return done


_PROGRAM = (sys.executable, "-P", "-m", "pvid")


def _note(done: Performance, command: str, code: int, said: bytes) -> None:
    done.codes[command] = code
    for sign in (b"Traceback", b"Warning", b"\x1b"):
        if sign in said:
            line = next(one for one in reversed(said.splitlines()) if one.strip())
            done.faults.append(f"{command}: {sign!r}: {line.decode('utf-8', 'backslashreplace')[:200]}")


def _peak_kb(pid: int) -> int:
    with suppress(OSError):
        found = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
        return int(found[1]) if found else 0
    return 0


def _waited_s(pid: int) -> float:
    """How long a process stood in line for a processor that others had; 0 where the system does not tell."""
    with suppress(OSError):
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) * 1e-9
    return 0.0


def _serve(server: socket.socket, steps: Iterator[Step], up: list[float]) -> None:
    """Plays the steps, to one connection after the other, until the logger has gone; `up` are the times [s] of each."""
    with suppress(OSError):
        while True:
            connection, _ = server.accept()
            up.append(time.monotonic())
            with connection:
                threading.Thread(target=_drain, args=(connection,), daemon=True).start()
                _play(connection, steps)


def _play(connection: socket.socket, steps: Iterator[Step]) -> None:
    with suppress(OSError):
        for step in steps:
            match step:
                case bytes():
                    connection.sendall(step)
                case Pause(seconds):
                    time.sleep(seconds)
                case HangUp():
                    time.sleep(_READ_S)
                    return
                case Flood(data):
                    while True:
                        connection.sendall(data)
        while connection.fileno() >= 0:  # until the logger hangs up
            time.sleep(0.05)
            connection.sendall(b"")
            if connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] != _ESTABLISHED:
                return


_READ_S = 0.5  # what the logger has not read by the time that a socket is closed may be lost in the system
_ESTABLISHED = 1  # of Linux's tcp_info.tcpi_state


def _drain(connection: socket.socket) -> None:
    with suppress(OSError):
        while connection.recv(1 << 16):
            pass


def report(mutants: int, only: Sequence[str], advance: Advance) -> Report:
    """See bench.case; only: names of behaviours, else all."""
    from bench.liar_mutants import mutate

    if unknown := [name for name in only if name not in BEHAVIOURS]:
        raise PvidError(f"there is no behaviour {', '.join(unknown)}")
    performances = []
    with tempfile.TemporaryDirectory() as folder:
        for name in only or BEHAVIOURS:
            performances.append(perform(BEHAVIOURS[name], Path(folder)))
            advance()
        tally = mutate(mutants, Path(folder), progress=lambda _: advance())
    faults = [f"{one.behaviour.name}: {fault}" for one in performances for fault in one.faults] + tally.faults
    numbers = (
        ("behaviours", len(performances)),
        ("runs of a command", sum(len(one.codes) for one in performances)),
        ("mutants of frames", tally.mutants),
        ("defects", len(faults)),
        ("largest memory of the logger, kB", max(one.peak_kb for one in performances)),
        ("latest end of the logger, ms", round(1000 * max(one.late_s for one in performances))),
    )
    return Report([counts("liar", numbers)], faults)
