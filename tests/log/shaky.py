"""Recordings put to the test: many frames through `pvid log`, and hours of a board that dies and a line that breaks."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import serial

from pvid.base.errors import PvidError
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.stream_image import Streamed, settings_number
from pvid.board.target import Target, open_target
from pvid.link.frames import Raw, Source, Status, encode_raw
from pvid.link.port import Port, open_port
from pvid.log.file import Segment
from pvid.log.reader import Account, LogReader, Record
from pvid.log.recorder import Logger
from pvid.log.verify import Stretch, Verifier
from pvid.rig.mechanism_file import MechanismRig

_SAMPLES_A_FRAME = 16


# ---- how many frames, at what price


@dataclass(frozen=True)
class Throughput:
    """Of one recording: frames that came and that are missing, processor time of the logger [s], its resident memory
    [kB] after a quarter of the frames and at the end."""

    frames: int
    lost: int
    cpu_s: float
    early_kb: int
    late_kb: int


def send_frames(line: int, count: int) -> None:
    """Writes `count` frames of samples to a file descriptor, once something has come from it."""
    payload = Raw.of_values(np.zeros(_SAMPLES_A_FRAME), np.zeros(_SAMPLES_A_FRAME)).payload
    os.read(line, 4096)
    for sequence in range(count):
        data = encode_raw(Raw.TYPE, sequence, _SAMPLES_A_FRAME * sequence, payload)
        while data:
            data = data[os.write(line, data) :]
    os.read(line, 1)  # until the other side has gone: what was not yet read is lost with this process


def throughput(count: int) -> Throughput:
    """Records `count` frames, sent as fast as they are taken, in a process of its own; see Throughput.

    Raises PvidError when the recording fails.
    """
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    code = f"from shaky import send_frames; send_frames({ours}, {count})"
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "a.pvlog"
        arguments = ["log", os.ttyname(theirs), str(log), "--samples", str(_SAMPLES_A_FRAME * count)]
        sender = subprocess.Popen([sys.executable, "-c", code], pass_fds=[ours], cwd=Path(__file__).parent)
        logger = subprocess.Popen(
            [sys.executable, "-m", "pvid", *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        try:
            quarter = count * len(encode_raw(Raw.TYPE, 0, 0, bytes(8 * _SAMPLES_A_FRAME))) // 4
            ended = os.WEXITED | os.WNOHANG | os.WNOWAIT  # how it ended is asked below, with what it used
            while os.waitid(os.P_PID, logger.pid, ended) is None and (not log.exists() or log.stat().st_size < quarter):
                time.sleep(0.01)
            early = late = _resident_kb(logger.pid)
            while True:
                pid, status, usage = os.wait4(logger.pid, os.WNOHANG)
                if pid:
                    break
                late = _resident_kb(logger.pid) or late
                time.sleep(0.01)
            assert logger.stderr is not None
            if os.waitstatus_to_exitcode(status) not in (0, 1):
                raise PvidError(f"the recording failed: {logger.stderr.read().decode()[-300:]}")
        finally:
            for process in (sender, logger):
                process.kill()
                process.wait()
            os.close(ours)
            os.close(theirs)
        reader = LogReader(log)
        for _ in reader:
            pass
    account = reader.account
    return Throughput(account.frames, account.missing + account.damaged, usage.ru_utime + usage.ru_stime, early, late)


def _resident_kb(pid: int) -> int:
    """0 when the process has ended."""
    try:
        found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    except OSError:
        return 0
    return int(found.group(1)) if found else 0


# ---- a long recording with accidents


@dataclass
class _Shaky:
    """A port at which an accident happens as soon as one is put into `due`, read by another thread."""

    port: Port
    due: list[Callable[[], None]]

    def read(self, size: int = 1, /) -> bytes:
        """Of the port; the accident first."""
        if self.due:
            self.due.pop()()
        return self.port.read(size)

    def write(self, data: bytes, /) -> int | None:
        """Of the port."""
        return self.port.write(data)

    def close(self) -> None:
        """Of the port."""
        self.port.close()


class _Kept(Target):
    """A target whose emulator goes on when its port is closed."""

    def close(self) -> None:
        """The port alone."""
        self.port.close()


@dataclass
class ShakyEmulator:
    """A source (pvid.log.recorder): an emulator that can be killed, and its line closed, while it is read."""

    name: str
    rig: Streamed
    usb: None = None
    _target: Target | None = None
    _place: str = ""
    _due: list[Callable[[], None]] = field(default_factory=list)

    def kill(self) -> None:
        """At the next read."""
        self._due.append(self._kill)

    def close_line(self) -> None:
        """At the next read."""
        self._due.append(self._close)

    def _kill(self) -> None:
        assert self._target is not None and self._target.process is not None
        self._target.process.kill()
        self._target.process.wait()

    def _close(self) -> None:
        assert self._target is not None
        self._target.port.close()
        raise serial.SerialException("the line was closed")

    def _wrapped(self, port: Port) -> Port:
        return _Shaky(port, self._due)

    def open(self) -> Target:
        """See pvid.log.recorder.Source."""
        running = self._target
        if running is not None and running.process is not None and running.process.poll() is None:
            running.port, running.coming_up_s = self._wrapped(open_port(self._place)), 0.0
            return running
        if running is not None:
            Target.close(running)
        started = open_target(self.name, self.rig)
        self._place = str(getattr(started.port, "port", ""))
        port = self._wrapped(started.port)
        self._target = _Kept(started.name, started.core, port, started.process, started.coming_up_s)
        return self._target

    def end(self) -> None:
        """Ends the emulator."""
        if self._target is not None:
            Target.close(self._target)


class _Accidents:
    """An observer that lets the next accident happen when so many samples of a new session have come, and then ends."""

    def __init__(self, logger: Logger, accidents: list[Callable[[], None]], samples: int) -> None:
        self._logger = logger
        self._accidents = accidents
        self._samples = samples
        self._sessions: set[int] = set()
        self._left: int | None = None  # of the session; None: it has not begun in this segment

    def take(self, record: Record, account: Account) -> None:
        """See logreader.Observer."""
        match record.item:
            case Segment():
                self._left = None
            case Status() as status if status.session not in self._sessions:
                self._sessions.add(status.session)
                self._left = self._samples
            case Raw() as raw if self._left is not None:
                self._left -= len(raw.values)
                if self._left <= 0:
                    self._left = None
                    self._end_segment(account)
            case _:
                pass

    def _end_segment(self, account: Account) -> None:
        if self._accidents:
            self._accidents.pop(0)()
        else:
            self._logger.samples = account.samples

    def idle(self, account: Account) -> None:
        """See logreader.Observer."""

    def close(self, account: Account) -> None:
        """See logreader.Observer."""


def field_log(name: str, samples: int, log: Path) -> tuple[Account, list[Stretch]]:
    """Records a board that samples as fast as the line goes, with three accidents, and verifies the log.

    The board starts over whenever the link comes up, so that every segment can be verified; a quarter of `samples`, at
    least, is recorded before and after each accident: it is killed, its line is closed, it is killed again.
    """
    board = replace(MechanismBoard.of_guess(MechanismRig("kapitza", 1000.0, known={"l1": 0.3})), repeats=True)
    settings = settings_number(board)
    every = round(board.sample_rate)
    source = ShakyEmulator(name, board)
    logger = Logger(
        source=source,
        out=log,
        rig=board.text(),
        begin=lambda: board.configure(settings, every, every, Source.SENSOR_PACED),
        restart=True,
    )
    logger.observers = [_Accidents(logger, [source.kill, source.close_line, source.kill], samples // 4)]
    try:
        logger.run()
    finally:
        source.end()
    reader = LogReader(log)
    stretches = list(Verifier(board).stretches(reader))
    return reader.account, stretches
