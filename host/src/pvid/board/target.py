"""The identifier on a board: an emulator or a real port, a run played through it, an exact account of the link.

`open_target` starts an emulator (a name of `boards.BOARDS`), the host's own build ("stream-host") or opens a port
(/dev/tty..., a pseudo-terminal, socket://host:port); `play` does the rest. Time is bounded: without progress for
`patience_s` the play ends, and the account contains the progress.
"""

from __future__ import annotations

import re
import select
import socket
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base import subprocesses as child
from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS, Board
from pvid.board.stream_image import Streamed, build_image, settings_number
from pvid.core.native import Native
from pvid.link.frames import Code, Counters, Credit, Decoder, Estimate, EstimateQ31, Frame, Hash, Hello, Message, encode
from pvid.link.frames import Status as BoardStatus
from pvid.link.port import Port, open_port
from pvid.settings.enums import Status

NUMBERS_A_FRAME = 128  # samples of all sensors: what a board receives at once
HOST_TARGET = "stream-host"
EMULATORS = tuple(name for name, board in BOARDS.items() if board.toolchain != "avr")
_COMING_UP_S = 20.0  # longest wait for an emulator's first word: it always has one, however busy the machine


class PlayedBoard(Streamed, Protocol):
    """A board for which a run can be played."""

    def readings(self, *signals: npt.ArrayLike) -> npt.NDArray[Any]:
        """The signals [ticks] as the identifier takes them [ticks, samples]."""

    def frame(self, readings: npt.NDArray[Any]) -> Message:
        """The frame of consecutive ticks [ticks, samples]."""

    def hashes(self, native: Native, *signals: npt.ArrayLike) -> npt.NDArray[np.uint32]:
        """Running hash after every tick in the core on this machine [ticks]."""


class PortGoneError(Exception):
    """The port has vanished: emulator ended, cable pulled."""


@dataclass
class Target:
    """A port and, for an emulator, the process behind it.

    What is sent to an emulator before its first word may be lost: it is waited for up to `coming_up_s`.
    """

    name: str
    core: str
    port: Port
    process: subprocess.Popen[bytes] | None = None
    coming_up_s: float = 0.0

    def __enter__(self) -> Target:
        """`with`: closed at the end. A board in field mode would compute for ever."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the port and ends the emulator."""
        self.port.close()
        if self.process is not None:
            self.process.kill()
            self.process.wait()


def open_target(name: str, rig: Streamed, wrap: Callable[[Port], Port] = lambda port: port) -> Target:
    """Starts the emulator of that name with the image for `rig`, or opens a port.

    Raises PvidError when there is no such target, or something that it needs is missing.

    Parameters
    ----------
    wrap : what stands between the port and the player: a fault injector in the tests
    """
    if name == HOST_TARGET:
        return _start_host(str(build_image(rig, None)), wrap)
    if name in EMULATORS:
        board = BOARDS[name]
        if board.missing:
            raise PvidError(f"{name} needs {' and '.join(board.missing)}: ./tools/test installs them")
        return _start_emulator(board, str(build_image(rig, board)), wrap)
    if "/" not in name and not name.upper().startswith("COM"):
        raise PvidError(f"there is no target {name}; there are {', '.join((HOST_TARGET, *EMULATORS))} and ports")
    return Target(name, "unknown", wrap(open_port(name)))


def _start_emulator(board: Board, image: str, wrap: Callable[[Port], Port]) -> Target:
    """QEMU with the board's UART at a socket, the processor held back until we have connected.

    Not at a pseudo-terminal: QEMU drops a board's output to one before it has noticed, by polling once a second, that
    somebody has opened it.

    mux: 32 bytes wait for the board in QEMU. Without them its two threads change places for every byte, which took
    most of the time of a run. An escape character of more than 8 bits never occurs.
    """
    with socket.create_server(("127.0.0.1", 0)) as listener:
        command = [board.emulator, "-machine", board.machine, "-display", "none", "-monitor", "none", "-nodefaults"]
        command += ["-nic", "none", "-kernel", image, "-serial", "chardev:uart"]
        command += ["-chardev", f"socket,id=uart,fd={listener.fileno()},server=on,wait=on,mux=on", "-echr", "0x100"]
        if board.toolchain == "riscv":
            command += ["-bios", "none"]
        else:
            command += ["-semihosting-config", "enable=on,target=native"]
        process = child.start(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=[listener.fileno()],
        )
        place = f"socket://127.0.0.1:{listener.getsockname()[1]}"
        return Target(board.name, board.core, wrap(_open_or_kill(place, process)), process, _COMING_UP_S)


def _start_host(image: str, wrap: Callable[[Port], Port]) -> Target:
    """The host's build, which prints the name of its pseudo-terminal."""
    process = child.start([image], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, bufsize=0)
    assert process.stdout is not None
    output = b""
    if select.select([process.stdout], [], [], 60.0)[0]:
        output = process.stdout.read(4096)
    process.stdout.close()
    found = re.search(rb"/dev/\S+", output)
    if found is None:
        process.kill()
        process.wait()
        raise PvidError(f"{HOST_TARGET} did not start")
    return Target(HOST_TARGET, "this machine", wrap(_open_or_kill(found.group().decode(), process)), process)


def _open_or_kill(place: str, process: subprocess.Popen[bytes]) -> Port:
    try:
        return open_port(place)
    except PvidError:
        process.kill()
        process.wait()
        raise


@dataclass
class Playback:
    """What came of a run on a target: the exact account of the link.

    `done` samples of `ticks` were processed, each exactly once, in the present session; `hash` is the running hash
    after them. `hashes` are the checkpoints that arrived, by ticks done; `missing_hashes` those that did not.
    `sent` counts samples put on the wire, `repeated` those of them sent before, `restarts` new beginnings after the
    board had forgotten its session. `received` is what the PC's decoder saw, `board` the target's last status.
    """

    ticks: int
    done: int = 0
    hash: int | None = None
    hashes: dict[int, int] = field(default_factory=dict)
    hash_every: int = 0
    sent: int = 0
    repeated: int = 0
    restarts: int = 0
    received: Counters = field(default_factory=Counters)
    board: BoardStatus | None = None
    hello: Hello | None = None
    estimates: dict[int, Estimate | EstimateQ31] = field(default_factory=dict)
    ended: str = ""

    @property
    def complete(self) -> bool:
        """Whether the target processed every sample and said so."""
        return self.done == self.ticks and self.hash is not None

    @property
    def missing_hashes(self) -> list[int]:
        """Checkpoints that should have come."""
        if not self.hash_every:
            return []
        return [at for at in range(self.hash_every, self.done + 1, self.hash_every) if at not in self.hashes]

    @property
    def account(self) -> str:
        """In one sentence."""
        lost = self.received.missing + (self.board.missing if self.board else 0)
        damaged = self.received.damaged + (self.board.malformed + self.board.bad_crc if self.board else 0)
        text = (
            f"{self.done} of {self.ticks} samples processed, {self.repeated} sent again; {lost} frames lost, "
            f"{damaged} damaged, {len(self.missing_hashes)} checkpoints missing, {self.restarts} restarts"
        )
        return text if self.complete else f"{text}; {self.ended}"


class Player:
    """One play of a run; see `play`."""

    def __init__(
        self,
        target: Target,
        rig: PlayedBoard,
        signals: tuple[npt.ArrayLike, ...],
        hash_every: int,
        estimate_every: int,
        reopen: Callable[[], Target] | None,
        progress: Callable[[int], None] | None,
    ) -> None:
        self.target = target
        self.rig = rig
        self.settings = settings_number(rig)
        self.readings = rig.readings(*signals)
        self.estimate_every = estimate_every
        self.reopen = reopen
        self.progress = progress
        self.account = Playback(ticks=len(self.readings), hash_every=hash_every)
        self.decoder = Decoder(self.account.received)
        self.sequence = 0
        self.furthest = 0  # first sample that has never been sent in this session
        self.next = 0
        self.room = 0
        self.skipped = 0
        self.running = False
        self.closing = False
        self._configure = rig.configure(self.settings, hash_every, estimate_every)

    # ---- out

    def _send(self, message: Message, tick: int = 0) -> None:
        try:
            self.target.port.write(encode(message, self.sequence, tick))
        except OSError as error:
            raise PortGoneError(str(error)) from error
        self.sequence = (self.sequence + 1) & 0xFFFF

    def _send_samples(self) -> None:
        limit = min(self.account.ticks, self.account.done + self.room)
        while self.running and self.next < limit:
            end = min(self.next + NUMBERS_A_FRAME // self.readings.shape[1], limit)
            self._send(self.rig.frame(self.readings[self.next : end]), self.next)
            self.account.sent += end - self.next
            self.account.repeated += max(0, min(self.furthest, end) - self.next)
            self.furthest = max(self.furthest, end)
            self.next = end

    def _start_session(self) -> None:
        self._configure = self.rig.configure(self.settings, self.account.hash_every, self.estimate_every)
        account = self.account
        account.done, account.hash, account.board = 0, None, None
        account.hashes.clear()
        account.estimates.clear()
        self.running, self.closing = False, False
        self.next = self.room = self.skipped = 0
        self._send(self._configure)

    def _repeat_request(self) -> None:
        """Nothing has come for a while: something was lost."""
        if self.running:
            self.next = self.account.done
            self._send(Credit(self._configure.session, 0, 0, 0))
        else:
            self._send(self._configure)

    # ---- in

    def _receive(self) -> bool:
        """Takes in what has come; returns whether that was progress."""
        try:
            data = self.target.port.read(4096)
        except OSError as error:
            raise PortGoneError(str(error)) from error
        before = (self.account.done, self.running, len(self.account.estimates), self._configure.session)
        for item in self.decoder.feed(data):
            if isinstance(item, Frame):
                self._take(item.tick, item.message)
        return before != (self.account.done, self.running, len(self.account.estimates), self._configure.session)

    def _take(self, tick: int, message: Message) -> None:
        if isinstance(message, Hello):
            self.account.hello = message
            if self.running and message.session != self._configure.session:
                self._restart()
        elif isinstance(message, BoardStatus):
            self._take_status(message)
        elif isinstance(message, Credit) and self._ours(message.session) and self.running:
            if self.account.done <= tick <= self.account.ticks:
                self.account.done, self.account.hash = tick, message.hash
                self.room = message.room
                self.next = max(self.next, tick)
        elif isinstance(message, Hash) and self._ours(message.session):
            self.account.hashes[tick] = message.hash
        elif isinstance(message, Estimate | EstimateQ31) and self._ours(message.session):
            self.account.estimates[tick] = message

    def _ours(self, session: int) -> bool:
        return session == self._configure.session

    def _restart(self) -> None:
        self.account.restarts += 1
        self._start_session()

    def _take_status(self, status: BoardStatus) -> None:
        if not self._ours(status.session):
            if self.running:
                self._restart()
            return
        self.account.board = status
        if status.code == Code.RUNNING:
            self.running = True
            if status.skipped > self.skipped:
                self.next = self.account.done
            self.skipped = status.skipped
        elif status.code != Code.WAITING:
            raise PvidError(f"{self.target.name} refused: {refusal(status)}")

    # ---- the whole

    def _reconnect(self, why: str) -> None:
        if self.reopen is None:
            raise PortGoneError(why)
        self.target.close()
        try:
            self.target = self.reopen()
        except PvidError as error:
            raise PortGoneError(f"{why}; {error}") from error
        self.decoder = Decoder(self.account.received)
        self.account.restarts += 1
        self._await_hello()
        self._start_session()

    def _await_hello(self) -> None:
        """Lets an emulator come up: what it is sent before its UART is ready is lost."""
        self.account.hello, self.running = None, False
        limit = time.monotonic() + self.target.coming_up_s
        while self.account.hello is None and time.monotonic() < limit:
            self._receive()

    @property
    def _finished(self) -> bool:
        return self.account.complete and self.account.ticks in self.account.estimates

    def run(self, patience_s: float, resend_s: float, reconnects: int) -> Playback:
        """See `play`."""
        heard_at = asked_at = time.monotonic()
        try:
            self._await_hello()
            self._start_session()
        except PortGoneError as gone:
            self.account.ended = f"the port is gone: {gone}"
            return self.account
        while not self._finished:
            try:
                self._send_samples()
                if self._receive():
                    heard_at = asked_at = time.monotonic()
                    if self.progress is not None:
                        self.progress(self.account.done)
                now = time.monotonic()
                if self.account.complete and not self.closing:
                    self.closing = True
                    self._send(Credit(self._configure.session, 0, 0, 0))
                if now - heard_at > patience_s:
                    self.account.ended = f"no answer for {patience_s:g} s"
                    break
                if now - asked_at > resend_s:
                    asked_at = now
                    self._repeat_request()
            except PortGoneError as gone:
                if reconnects <= 0:
                    self.account.ended = f"the port is gone: {gone}"
                    break
                reconnects -= 1
                try:
                    self._reconnect(str(gone))
                except PortGoneError as again:
                    self.account.ended = f"the port is gone: {again}"
                    break
                heard_at = asked_at = time.monotonic()
        return self.account


def refusal(status: BoardStatus) -> str:
    """Why a board does not run, in words."""
    if status.code == Code.REFUSED_BY_CORE:
        names = {one.value: one.name.lower().replace("_", " ") for one in Status}
        return f"the core refused the configuration: {names.get(status.core, status.core)}"
    words = {
        Code.REFUSED_SETTINGS: "its image was made for other settings or tables; build it for this rig file",
        Code.REFUSED_FORM: "its image holds the other form or the other core",
        Code.REFUSED_SOURCE: "the source of samples is unknown to it",
        Code.ARITHMETIC: "its float arithmetic is not bit-exact",
    }
    return words.get(Code(status.code), f"code {status.code}") if status.code in list(Code) else f"code {status.code}"


def play(
    target: Target,
    rig: PlayedBoard,
    *signals: npt.ArrayLike,
    hash_every: int = 500,
    estimate_every: int = 0,
    patience_s: float = 20.0,
    resend_s: float = 1.5,
    reopen: Callable[[], Target] | None = None,
    reconnects: int = 3,
    progress: Callable[[int], None] | None = None,
) -> Playback:
    """Plays a run through a target and returns the account; it ends in bounded time, complete or not.

    Raises PvidError when the target refuses the configuration.

    Parameters
    ----------
    signals : of every sensor [ticks], in its unit; in counts for the fixed-point core
    hash_every, estimate_every : ticks between checkpoints of the running hash and between estimates; 0: the last only
    patience_s : longest time without any progress [s]
    resend_s : time without an answer after which requests and samples are sent again [s]
    reopen : starts the target anew when it has gone; the run then starts over. None: the play ends.
    reconnects : how often at most
    """
    player = Player(target, rig, signals, hash_every, estimate_every, reopen, progress)
    try:
        return player.run(patience_s, resend_s, reconnects if reopen is not None else 0)
    finally:
        player.target.close()


@dataclass(frozen=True)
class Verdict:
    """The hashes of a target against those of the host: equal only where every sample was processed."""

    playback: Playback
    expected: int
    first: tuple[int, int] | None

    @property
    def equal(self) -> bool:
        """Complete, the running hash after the last tick equal, and no unequal checkpoint."""
        return self.playback.complete and self.playback.hash == self.expected and self.first is None

    @property
    def text(self) -> str:
        """In words; the first difference lies between the two ticks named."""
        if self.equal:
            return "equal"
        if self.first is not None:
            return f"DIFFERENT: between ticks {self.first[0]} and {self.first[1]}"
        if self.playback.complete:
            return "DIFFERENT at the end"
        return f"incomplete: {self.playback.account}"


def judge(playback: Playback, expected: npt.NDArray[np.uint32]) -> Verdict:
    """Compares with the running hashes after every tick, uint32 [ticks], of the host or the twin."""
    good = 0
    first = None
    for at in sorted(playback.hashes):
        if not 0 < at <= len(expected) or playback.hashes[at] != int(expected[at - 1]):
            first = (good, at)
            break
        good = at
    return Verdict(playback, int(expected[-1]), first)


def targets_of(names: tuple[str, ...]) -> list[str]:
    """The targets of `--on`; "all": this machine and every emulator that is installed with its compiler.

    Raises PvidError for "all", when no emulator is installed.
    """
    if "all" not in names:
        return list(names)
    present = [name for name in EMULATORS if not BOARDS[name].missing]
    if not present:
        raise PvidError("no emulator and cross compiler is installed: ./tools/test installs them")
    return [HOST_TARGET, *present]


def verify(
    name: str, rig: PlayedBoard, native: Native, *signals: npt.ArrayLike, progress: Callable[[int], None] | None = None
) -> Verdict:
    """Plays a run on a target, an emulator being started again should it die, and judges it by the host's core.

    Raises PvidError when the target cannot be started or refuses the configuration.
    """
    expected = rig.hashes(native, *signals)
    reopen = (lambda: open_target(name, rig)) if name in (HOST_TARGET, *EMULATORS) else None
    return judge(play(open_target(name, rig), rig, *signals, reopen=reopen, progress=progress), expected)
