"""The log: what a board sent is in it, whatever becomes of the line, the board and the logger."""

import errno
import io
import itertools
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path

import field_board
import numpy as np
import numpy.typing as npt
import pytest
import serial
from click.testing import CliRunner
from logs import log_of
from processes import PATIENCE_S, until
from shaky import field_log, throughput

from pvid.base import file_lock
from pvid.base.errors import PvidError
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.target import HOST_TARGET, open_target
from pvid.cli.main import commands
from pvid.link import frames as link
from pvid.link.port import loss_cause
from pvid.log.file import LOG_SCHEMA, LOG_SCHEMA_TEXT, Close, LogWriter, Mark, Segment
from pvid.log.reader import Account, Gap, LogReader, LogStream, Record, Restart
from pvid.log.recorder import _LEAST_SAMPLE, _NEAR, Logger, PortSource
from pvid.log.rig import refuse_to_append
from pvid.log.status import StatusLine
from pvid.log.words import link_words

TICKS = 4000


@pytest.fixture(scope="module")
def sent() -> list[bytes]:
    """The frames of a run of TICKS."""
    return list(field_board.frames(field_board.messages(field_board.Field(TICKS))))


def written(path: Path, *segments: list[bytes], cut: int = 0) -> Path:
    """A log of these segments, `cut` bytes short of the last one's end."""
    *before, last = (b"".join(frames) for frames in segments)
    return log_of(path, *before, last[: len(last) - cut])


def read(path: Path) -> tuple[list[Record], Account]:
    reader = LogReader(path)
    return list(reader), reader.account


def samples_of(records: list[Record]) -> npt.NDArray[np.float32]:
    return np.concatenate([record.item.values for record in records if isinstance(record.item, link.Raw)])


def board_frames(data: bytes) -> bytes:
    """What is left of a log without the logger's frames."""
    decoder = link.Decoder(schemas={LOG_SCHEMA: {}})
    kept = []
    for piece in data.split(b"\0")[:-1]:
        decoder.counters = link.Counters()
        decoder.feed(piece + b"\0")
        if not decoder.counters.layout:
            kept.append(piece + b"\0")
    return b"".join(kept)


def test_a_log_holds_what_was_sent_and_describes_itself(tmp_path: Path, sent: list[bytes]) -> None:
    path = written(tmp_path / "a.pvlog", sent)
    data = path.read_bytes()
    assert board_frames(data) == b"".join(sent)
    records, account = read(path)
    run = field_board.Field(TICKS).run
    expected = np.stack([run.y, run.phi], axis=1)[:TICKS].astype(np.float32)
    assert np.array_equal(samples_of(records), expected)
    assert (account.frames, account.samples, account.lost_share) == (len(sent), TICKS, 0)
    kinds = {type(record.item).__name__ for record in records}
    assert kinds >= {"Segment", "Close", "LinkSchema", "Hello", "Configure", "Status", "Raw", "Estimate", "Hash"}
    told = next(record.item for record in records if isinstance(record.item, Segment)).description
    assert told["port"] == "a port"
    assert LOG_SCHEMA_TEXT.encode() in data and link.SCHEMA_TEXT.encode()[:200] in data


def test_every_byte_more_gives_the_same_records_or_more(tmp_path: Path, sent: list[bytes]) -> None:
    """A logger may be killed at any byte: what opens is a beginning of what would have been there."""
    data = written(tmp_path / "a.pvlog", sent[:40]).read_bytes()
    whole = [(record.tick, record.item) for record in LogStream().feed(data)]
    before = 0
    for end in range(0, len(data), 7):
        stream = LogStream()
        got = [(record.tick, record.item) for record in stream.feed(data[:end])]
        assert got == whole[: len(got)] and len(got) >= before
        before = len(got)
        rest = list(stream.end())
        assert stream.account.damaged == stream.account.missing == 0
        assert len(rest) <= 1 and all(isinstance(one.item, link.Loss) and one.item.why == "cut" for one in rest)


def test_a_log_read_in_pieces_is_the_same(tmp_path: Path, sent: list[bytes]) -> None:
    data = written(tmp_path / "a.pvlog", sent[:30], sent[30:50]).read_bytes()
    whole, pieces = LogStream(), LogStream()
    expected = [*whole.feed(data), *whole.end()]
    got = list(itertools.chain.from_iterable(pieces.feed(data[i : i + 3]) for i in range(0, len(data), 3)))
    assert [*got, *pieces.end()] == expected
    assert pieces.account.text == whole.account.text


def test_missing_samples_are_reported_once_and_exactly(tmp_path: Path, sent: list[bytes]) -> None:
    raw = [i for i, frame in enumerate(link.Decoder().feed(b"".join(sent))) if isinstance(frame.message, link.Raw)]  # type: ignore[union-attr]
    lost, spoilt = raw[5], raw[20]
    broken = bytearray(sent[spoilt])
    broken[30] ^= 0x41 if broken[30] != 0x41 else 0x42
    line = [bytes(broken) if i == spoilt else frame for i, frame in enumerate(sent) if i != lost]
    records, account = read(written(tmp_path / "a.pvlog", line))
    told = [record.item for record in records if isinstance(record.item, link.Loss | Gap)]
    n = field_board.SAMPLES_A_FRAME
    assert [one for one in told if isinstance(one, Gap)] == [Gap(5 * n, n), Gap(20 * n, n)]
    assert [one.why for one in told if isinstance(one, link.Loss)] == ["sequence", "crc", "sequence"]
    assert (account.missing, account.damaged, account.missing_samples) == (2, 1, 2 * n)
    assert account.samples + account.missing_samples == TICKS
    assert account.lost_share == pytest.approx(2 * n / TICKS)


def test_joining_and_leaving_amidst_a_frame_is_no_loss(tmp_path: Path, sent: list[bytes]) -> None:
    path = written(tmp_path / "a.pvlog", [sent[7][9:], *sent[8:60]], cut=11)
    records, account = read(path)
    cuts = [record.item for record in records if isinstance(record.item, link.Loss)]
    assert [one.why for one in cuts] == ["cut", "cut"]
    assert (account.cut, account.damaged, account.missing, account.lost_share) == (2, 0, 0, 0)


def test_garbage_alone_is_no_log_and_a_loss_beside_frames(tmp_path: Path, sent: list[bytes]) -> None:
    noise = tmp_path / "noise"
    noise.write_bytes(np.random.default_rng(1).bytes(100_000))
    with pytest.raises(PvidError, match="is not a log of pvid: not one frame in 100000 bytes"):
        list(LogReader(noise))
    with pytest.raises(PvidError, match="cannot read"):
        list(LogReader(tmp_path / "nothing"))
    bare = tmp_path / "bare"
    bare.write_bytes(b"".join(sent[:20]) + noise.read_bytes() + b"\0" + b"".join(sent[20:]))
    _, account = read(bare)
    assert account.frames == len(sent)
    assert account.damaged > 100 and account.missing == 0


def test_restarted_board_is_no_loss(tmp_path: Path, sent: list[bytes]) -> None:
    records, account = read(written(tmp_path / "a.pvlog", [*sent[:200], *sent]))
    assert (account.restarts, account.missing, account.missing_samples) == (1, 0, 0)
    assert sum(isinstance(record.item, Restart) for record in records) == 1
    without_hello = [*sent[:200], *sent[4:]]
    _, account = read(written(tmp_path / "b.pvlog", without_hello))
    assert (account.restarts, account.missing_samples) == (1, 0)


def test_a_log_has_one_recorder_at_a_time_and_any_number_of_readers(tmp_path: Path, sent: list[bytes]) -> None:
    path = tmp_path / "a.pvlog"
    first = LogWriter(path)
    first.begin("a port", None)
    first.take(b"".join(sent[:50]))
    before = path.read_bytes()
    with pytest.raises(PvidError, match=r"a\.pvlog is being recorded by another `pvid log`"):
        LogWriter(path, append=True)
    assert path.read_bytes() == before and read(path)[1].frames == 50
    first.end("the end")
    first.close()
    LogWriter(path, append=True).close()


@pytest.mark.parametrize("cause", ["no such locks", "no fcntl"])
def test_a_log_is_written_where_files_have_no_locks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cause: str
) -> None:
    class Without:
        LOCK_EX, LOCK_NB = 2, 4

        @staticmethod
        def flock(*_: object) -> None:
            raise OSError(errno.ENOTSUP, "not supported")

    monkeypatch.setattr(file_lock, "fcntl", Without if cause == "no such locks" else None)
    writers = [LogWriter(tmp_path / "a.pvlog", append=True) for _ in range(2)]
    for one in writers:
        one.close()


def test_segments_follow_each_other_in_one_file(tmp_path: Path, sent: list[bytes]) -> None:
    path = written(tmp_path / "a.pvlog", sent[:50], sent[80:])
    with pytest.raises(PvidError, match="exists; --append adds to it"):
        LogWriter(path)
    with path.open("ab") as file:
        file.write(sent[3][:20])  # as if the logger had been killed
    log_of(path, b"".join(sent), port="another port", why="again")
    records, account = read(path)
    assert [(one.port, one.why) for one in account.segments] == [
        ("a port", "the end"),
        ("a port", "the end"),
        ("another port", "again"),
    ]
    assert (account.cut, account.damaged, account.missing, account.restarts) == (1, 0, 0, 0)
    assert account.frames == 50 + len(sent[80:]) + len(sent)
    assert sorted({record.segment for record in records}) == [-1, 0, 1, 2]


def test_marks_stand_between_frames_and_count(
    tmp_path: Path, sent: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = itertools.count(10**18, 400_000_000)
    monkeypatch.setattr(time, "time_ns", lambda: next(clock))
    writer = LogWriter(tmp_path / "a.pvlog")
    writer.begin("a port", None)
    data = b"".join(sent)
    for at in range(0, len(data), 1000):
        writer.take(data[at : at + 1000])
    writer.end("the end")
    writer.close()
    content = (tmp_path / "a.pvlog").read_bytes()
    assert board_frames(content) == data
    records, account = read(tmp_path / "a.pvlog")
    marks = [record.item for record in records if isinstance(record.item, Mark)]
    assert len(marks) > len(data) / 1000 / 4
    assert [one.unix_ns for one in marks] == sorted(one.unix_ns for one in marks)
    assert all(data[: one.received].endswith(b"\0") for one in marks)
    assert (account.frames, account.lost_share) == (len(sent), 0)
    assert next(record.item for record in records if isinstance(record.item, Close)).received == len(data)


def test_the_rig_file_is_in_the_log(tmp_path: Path, sent: list[bytes]) -> None:
    text = "# " + "x" * 2500 + "\nl1 = 0.3\n"
    log_of(tmp_path / "a.pvlog", sent[0], rig=text, why=None)
    reader = LogReader(tmp_path / "a.pvlog")
    list(reader)
    assert reader.rig == text


def test_a_log_of_another_version_opens(tmp_path: Path) -> None:
    text = link.SCHEMA_TEXT.replace(link.Hash.layout().text, "8 hash session:u32 hash:u64")
    number = zlib.crc32(text.encode())
    frames = [
        link.encode_raw(link.Schema.TYPE, 0, 0, text.encode(), number),
        link.encode_raw(link.Hash.TYPE, 1, 5, bytes(range(12)), number),
        link.encode(link.Raw.of_values([1.0], [2.0]), 2, 0, number),
    ]
    records, account = read(written(tmp_path / "a.pvlog", frames))
    assert account.by_kind == {"schema": 1, "hash": 1, "raw": 1}
    assert [record.item.values for record in records if isinstance(record.item, link.Described)] == [
        {"session": 0x03020100, "hash": 0x0B0A090807060504}
    ]
    assert samples_of(records).tolist() == [[1, 2]]


# ---- the program


Boards = Callable[..., field_board.Board]
Loggers = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def boards(tmp_path: Path) -> Iterator[Boards]:
    """Starts boards behind tmp_path/board."""
    started = []

    def start(ticks: int, **settings: int) -> field_board.Board:
        started.append(field_board.Board(tmp_path / "board", ticks, **settings))
        return started[-1]

    yield start
    for one in started:
        one.kill()


@pytest.fixture
def pvid(tmp_path: Path) -> Iterator[Loggers]:
    """Starts `pvid log board out.pvlog ...` in tmp_path."""
    started = []

    def start(*arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "pvid", "log", "board", "out.pvlog", *arguments]
        started.append(
            subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        )
        return started[-1]

    yield start
    for one in started:
        one.kill()
        one.communicate()


def wait_for(path: Path, condition: Callable[[Account], bool]) -> None:
    """Until the account of a log that grows is so."""
    stream, fed = LogStream(), 0

    def grown() -> bool:
        nonlocal fed
        if path.exists():
            with path.open("rb") as file:
                file.seek(fed)
                more = file.read()
            fed += len(more)
            list(stream.feed(more))
        return condition(stream.account)

    until(grown)


def test_log_records_all_and_ends_with_a_summary(tmp_path: Path, boards: Boards, pvid: Loggers) -> None:
    listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("127.0.0.1", 0))
    boards(ticks=TICKS)
    process = pvid("--live", f"udp://127.0.0.1:{listener.getsockname()[1]}")
    wait_for(tmp_path / "out.pvlog", lambda account: account.samples == TICKS)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    listener.settimeout(PATIENCE_S)
    assert set(json.loads(listener.recv(4096))) == {"timestamp", "tick", "samples"}
    listener.close()
    assert f"{TICKS} samples in 1 segment; lost 0 frames, 0 samples, 0 while the link was down; 0 damaged" in out
    assert "ended by SIGINT" in out
    records, account = read(tmp_path / "out.pvlog")
    assert isinstance(records[-1].item, Close)
    assert account.cut == 0


def test_a_killed_logger_leaves_a_file_that_opens_and_is_appended_to(
    tmp_path: Path, boards: Boards, pvid: Loggers
) -> None:
    boards(ticks=20 * TICKS, per_second=2 * TICKS)  # in 10 s: the first logger is killed long before
    process = pvid()
    wait_for(tmp_path / "out.pvlog", lambda account: account.samples > TICKS)
    process.kill()
    process.communicate()
    _, account = read(tmp_path / "out.pvlog")
    assert account.segments[0].why is None
    assert (account.missing, account.damaged, account.missing_samples) == (0, 0, 0)
    before = account.samples
    again = pvid("--append")
    wait_for(tmp_path / "out.pvlog", lambda account: len(account.segments) == 2 and account.samples > before + TICKS)
    again.send_signal(signal.SIGTERM)
    out, err = again.communicate(timeout=PATIENCE_S)
    assert again.returncode == 0, err
    assert "ended by SIGTERM" in out
    _, account = read(tmp_path / "out.pvlog")
    assert [one.why for one in account.segments] == [None, "ended by SIGTERM"]
    assert (account.missing, account.damaged) == (0, 0)


def test_a_link_that_breaks_is_taken_up_in_a_new_segment(tmp_path: Path, boards: Boards, pvid: Loggers) -> None:
    first = boards(ticks=TICKS)
    process = pvid()
    wait_for(tmp_path / "out.pvlog", lambda account: account.samples == TICKS)
    first.kill()
    wait_for(tmp_path / "out.pvlog", lambda account: account.segments[0].why is not None)
    boards(ticks=2 * TICKS, seed=2)
    wait_for(tmp_path / "out.pvlog", lambda account: account.samples == 3 * TICKS)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    _, account = read(tmp_path / "out.pvlog")
    assert [one.samples for one in account.segments] == [TICKS, 2 * TICKS]
    assert account.segments[0].why is not None and "the port is gone" in account.segments[0].why
    assert account.lost_share == 0


def test_a_port_that_is_not_there_and_a_log_that_is(tmp_path: Path, pvid: Loggers) -> None:
    process = pvid()
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2
    lists = "`pvid ports` lists the ports and the emulated boards"
    assert err.splitlines()[-1] == f"pvid: there is no port board: is the board plugged in? {lists}"
    assert not (tmp_path / "out.pvlog").exists()
    (tmp_path / "out.pvlog").write_bytes(b"")
    again = pvid()
    assert "exists; --append adds to it" in again.communicate(timeout=PATIENCE_S)[1]
    assert again.returncode == 2


def test_too_much_loss_is_exit_code_1(tmp_path: Path, pvid: Loggers) -> None:
    frames = list(field_board.cheap_frames(20))
    samples = str(19 * field_board.SAMPLES_A_FRAME)
    line = field_board.PtyLine(tmp_path / "board")
    process = pvid("--samples", samples)
    line.await_word()
    line.write(b"".join(frames[:9] + frames[10:]))
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "5 % lost, allowed are 0.1 %" in err
    (tmp_path / "out.pvlog").unlink()
    lenient = pvid("--samples", samples, "--allow-loss", "0.05")
    line.await_word()
    line.write(b"".join(frames[:9] + frames[10:]))
    assert lenient.wait(timeout=PATIENCE_S) == 0


class Plugged:
    """USB serial devices as Linux shows them, read by pyserial's own list_ports; which ports are opened."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self._sys = folder / "sys"
        self._ports: dict[str, Path] = {}
        self.opened: list[str] = []
        exists, realpath = os.path.exists, os.path.realpath
        monkeypatch.setattr("os.path.exists", lambda path: exists(self._place(path)))
        monkeypatch.setattr("os.path.realpath", lambda path: realpath(self._place(path)))
        monkeypatch.setattr("serial.tools.list_ports_linux.glob.glob", self._glob)
        monkeypatch.setattr("pvid.log.recorder.open_port", self.opened.append)

    def _glob(self, pattern: str) -> list[str]:
        return [f"/dev/{name}" for name in self._ports if fnmatch(f"/dev/{name}", pattern)]

    def _place(self, path: str) -> str:
        found = re.fullmatch(r"/sys/class/tty/(\w+)/device", str(path))
        return str(self._ports.get(found[1], path)) if found else path

    def plug(self, socket: str, *ports: str, serial: str | None, product: str = "5740") -> None:
        """A device in a USB socket, each of its ports an interface of its own."""
        device = self._sys / "devices" / socket
        device.mkdir(parents=True)
        told = {"idVendor": "0483", "idProduct": product, "bNumInterfaces": f"{len(ports):2d}", "serial": serial}
        for name, text in told.items():
            if text is not None:
                (device / name).write_text(f"{text}\n")
        (self._sys / "bus" / "usb").mkdir(parents=True, exist_ok=True)
        for number, port in enumerate(ports):
            interface = device / f"{socket}:1.{number}"
            interface.mkdir()
            (interface / "subsystem").symlink_to(self._sys / "bus" / "usb")
            self._ports[port] = interface

    def pull(self, socket: str) -> None:
        """Whatever is in that socket."""
        self._ports = {port: place for port, place in self._ports.items() if place.parent.name != socket}
        shutil.rmtree(self._sys / "devices" / socket)

    def again(self, source: PortSource) -> str:
        """The port at which a source is opened now."""
        source.open()
        return self.opened[-1]


@pytest.fixture
def plugged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Plugged:
    """No USB device yet."""
    return Plugged(tmp_path, monkeypatch)


def test_a_usb_device_is_found_again_by_its_serial_number(plugged: Plugged) -> None:
    plugged.plug("1-1", "ttyACM0", serial="A1")
    plugged.plug("1-2", "ttyACM1", serial="B2")
    source = PortSource("/dev/ttyACM1")
    assert plugged.again(source) == "/dev/ttyACM1"
    assert source.usb == {"vid": 0x0483, "pid": 0x5740, "serial": "B2", "interface": ""}
    plugged.pull("1-1")
    plugged.pull("1-2")
    with pytest.raises(PvidError, match="the device of /dev/ttyACM1 is not plugged in"):
        source.open()
    plugged.plug("1-2", "ttyACM1", serial="A1")  # the other board has its port, and it has another socket
    plugged.plug("2-4.1", "ttyACM7", serial="B2")
    assert plugged.again(source) == "/dev/ttyACM7"


def test_a_usb_device_without_a_serial_number_is_found_again_in_its_socket(plugged: Plugged) -> None:
    plugged.plug("1-1", "ttyUSB0", serial=None)
    plugged.plug("1-2", "ttyUSB1", serial=None)
    source = PortSource("/dev/ttyUSB1")
    assert plugged.again(source) == "/dev/ttyUSB1"
    assert source.usb is not None and source.usb["location"] == "1-2"
    plugged.pull("1-1")
    plugged.pull("1-2")
    plugged.plug("1-2", "ttyUSB0", serial=None)
    assert plugged.again(source) == "/dev/ttyUSB0"
    plugged.pull("1-2")
    plugged.plug("1-1", "ttyUSB1", serial=None)  # has its port, but not its socket
    with pytest.raises(PvidError, match="is not plugged in"):
        source.open()
    plugged.plug("1-2", "ttyUSB2", serial=None, product="6001")  # has its socket, but is another make
    with pytest.raises(PvidError, match="is not plugged in"):
        source.open()


def test_two_boards_with_the_same_serial_number_are_told_apart_by_their_sockets(plugged: Plugged) -> None:
    plugged.plug("1-1", "ttyACM0", serial="0001")
    plugged.plug("1-2", "ttyACM1", serial="0001")
    source = PortSource("/dev/ttyACM1")
    source.open()
    plugged.pull("1-2")
    with pytest.raises(PvidError, match="is not plugged in"):
        source.open()  # the other one is not taken for it
    plugged.plug("1-2", "ttyACM4", serial="0001")
    assert plugged.again(source) == "/dev/ttyACM4"


def test_second_board_with_the_same_serial_number_is_reported(plugged: Plugged) -> None:
    plugged.plug("1-1", "ttyACM0", serial="0001")
    source = PortSource("/dev/ttyACM0")
    source.open()
    plugged.plug("1-2", "ttyACM1", serial="0001")
    with pytest.raises(PvidError, match="/dev/ttyACM0 and /dev/ttyACM1 are alike, and either may be the device of"):
        source.open()


def test_the_ports_of_one_adapter_are_told_apart(plugged: Plugged) -> None:
    plugged.plug("1-1", "ttyACM0", "ttyACM1", "ttyACM2", serial="FT4")
    source = PortSource("/dev/ttyACM1")
    source.open()
    assert source.usb == {"vid": 0x0483, "pid": 0x5740, "serial": "FT4", "interface": "1.1"}
    plugged.pull("1-1")
    plugged.plug("3-2", "ttyACM5", "ttyACM6", "ttyACM7", serial="FT4")
    assert plugged.again(source) == "/dev/ttyACM6"


def test_a_port_that_is_no_usb_device_is_found_again_by_its_name(plugged: Plugged) -> None:
    plugged.plug("1-1", "ttyACM0", serial="A1")
    source = PortSource("/dev/serial/by-id/usb-A1")
    assert [plugged.again(source), plugged.again(source)] == 2 * ["/dev/serial/by-id/usb-A1"]
    assert source.usb is None


def test_refusal_of_the_board_is_reported(tmp_path: Path) -> None:
    """Its image was made for another rig than the logger's."""
    target = open_target(HOST_TARGET, field_board.board())
    assert target.process is not None
    try:
        (tmp_path / "board").symlink_to(str(getattr(target.port, "port", "")))
        target.port.close()
        field_board.rig(0.31).write(tmp_path / "rig.toml")
        command = [sys.executable, "-m", "pvid", "log", "board", "out.pvlog", "--rig", "rig.toml", "--duration", "20"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    finally:
        target.process.kill()
        target.process.wait()
    assert done.returncode == 2
    assert "the board refused: its image was made for other settings" in done.stderr
    _, account = read(tmp_path / "out.pvlog")
    assert account.segments[0].why is not None and account.frames > 0


def test_a_log_that_cannot_be_written_ends_with_its_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk: the recorder's error reaches the caller, observers are closed, what was written opens."""
    line = field_board.PtyLine(tmp_path / "board")
    real, written_bytes = os.write, 0

    def full(file: int, data: bytes) -> int:
        nonlocal written_bytes
        if file == line.ours:
            return real(file, data)
        if written_bytes > 2500:
            raise OSError(28, "No space left on device")
        written_bytes += len(data)
        return real(file, data)

    class Watching:
        closed = False

        def take(self, record: Record, account: Account) -> None:
            if isinstance(record.item, Segment):
                line.write(b"".join(field_board.cheap_frames(20)))

        def idle(self, account: Account) -> None: ...

        def close(self, account: Account) -> None:
            self.closed = True

    watching = Watching()
    monkeypatch.setattr(os, "write", full)
    with pytest.raises(PvidError, match="cannot write .*out.pvlog: No space left on device"):
        Logger(PortSource(str(tmp_path / "board")), tmp_path / "out.pvlog", [watching], duration_s=20).run()
    assert watching.closed
    _, account = read(tmp_path / "out.pvlog")
    assert account.segments[0].why is None


def test_appended_log_has_the_same_rig_file(tmp_path: Path, sent: list[bytes]) -> None:
    rig = field_board.text()
    log_of(tmp_path / "a.pvlog", sent[0], rig=rig, why=None)
    refuse_to_append(tmp_path / "a.pvlog", rig)
    refuse_to_append(tmp_path / "a.pvlog", None)
    refuse_to_append(tmp_path / "none.pvlog", rig)
    (tmp_path / "empty.pvlog").write_bytes(b"")
    refuse_to_append(tmp_path / "empty.pvlog", rig)
    with pytest.raises(PvidError, match="a.pvlog was recorded with another rig file: record to a new log"):
        refuse_to_append(tmp_path / "a.pvlog", MechanismBoard.of_guess(field_board.rig(0.31)).text())
    (tmp_path / "run.csv").write_text("t,phi,y\n" + 100 * "0,0,0\n")
    with pytest.raises(PvidError, match="run.csv is not a log of pvid: nothing is appended"):
        refuse_to_append(tmp_path / "run.csv", rig)
    (tmp_path / "run.csv").rename(tmp_path / "run")
    arguments = ["log", "nowhere", str(tmp_path / "run"), "--append"]
    with pytest.raises(PvidError, match="is not a log of pvid"):
        CliRunner().invoke(commands, arguments, standalone_mode=False, catch_exceptions=False)


def test_cause_of_a_broken_link_is_reported(tmp_path: Path) -> None:
    """The port has gone, and then cannot be opened again: the views say why."""
    line = field_board.PtyLine(tmp_path / "board")
    place = str(tmp_path / "board")

    class Watching:
        def __init__(self) -> None:
            self.told: list[str] = []

        def take(self, record: Record, account: Account) -> None:
            if isinstance(record.item, link.Raw) and not self.told:
                (tmp_path / "board").unlink()
                os.close(line.ours)
                self.told.append("gone")

        def idle(self, account: Account) -> None:
            if account.obstacle and len(self.told) == 1:
                self.told += [link_words(account)[1], StatusLine(io.StringIO()).line(account, 0.0)]
                os.kill(os.getpid(), signal.SIGINT)

        def close(self, account: Account) -> None: ...

    def listening() -> None:
        line.await_word()
        line.write(b"".join(field_board.cheap_frames(20)))

    sender = threading.Thread(target=listening)
    sender.start()
    watching = Watching()
    account = Logger(PortSource(place), tmp_path / "out.pvlog", [watching], duration_s=60).run()
    sender.join()
    why = f"there is no port {place}: is the board plugged in? `pvid ports` lists the ports and the emulated boards"
    assert watching.told[1] == f"down: {why}" and f"; waiting for the link ({why})" in watching.told[2]
    assert account.obstacle == "" and account.samples == 20 * field_board.SAMPLES_A_FRAME


def test_the_status_line_shows_the_estimate_of_either_core(tmp_path: Path) -> None:
    p_unit = (2**-10, 2**-20, 2**-20, 2**-24, *[0.0] * 4)
    hello = link.Hello(1, 1, 4, 0, 0, 7, 1000.0, 2**-12, 2**-16, p_unit, "x")
    fixed = link.EstimateQ31(7, 9, (32440, 9305000, 5898000, 64, 0, 0, 0, 0), (1,) * 8, (0,) * 36, 2**23, 512, 5, 0)
    p = tuple(count * unit for count, unit in zip(fixed.p, p_unit, strict=True))
    floating = link.Estimate(7, 9, p, (0.0,) * 36, 0.01, 1.0, 5.0, 0)
    assert StatusLine(io.StringIO()).line(Account(), 0.0) == "the link is not up yet"
    for number, estimate in enumerate((fixed, floating)):
        frames = list(field_board.frames([(0, hello), (0, link.Raw.of_values([1.0], [2.0])), (160, estimate)]))
        status = StatusLine(io.StringIO())
        stream = LogStream()
        for record in stream.feed(written(tmp_path / f"{number}.pvlog", frames).read_bytes()):
            status.take(record, stream.account)
        told = status.line(stream.account, 1e9)
        assert told.startswith("1 samples, 0/s, lost 0, damaged 0; waiting for the link (the end); tick 160: ")
        assert told.endswith("w 31.68 1/s^2, d1 8.8739, d2 5.6248, c 3.8147e-06 rad, updated")


def test_full_disk_is_reported_with_the_content_of_the_log(tmp_path: Path, boards: Boards) -> None:
    """A limit of the shell's on the size of files stands for the disk."""
    boards(ticks=20 * TICKS)
    command = f"ulimit -f 100; exec {sys.executable} -m pvid log board out.pvlog"
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == "pvid: cannot write out.pvlog: File too large"
    assert (tmp_path / "out.pvlog").stat().st_size == 100 * 1024
    _, account = read(tmp_path / "out.pvlog")
    assert account.samples > 1000 and (account.missing, account.damaged) == (0, 0)
    assert f"{account.samples} samples in 1 segment; lost 0 frames" in done.stdout


def test_a_board_that_sends_faster_than_its_frames_are_decoded_ends_at_the_samples_asked_for(tmp_path: Path) -> None:
    out = tmp_path / "out.pvlog"
    arguments = ["log", HOST_TARGET, str(out), "--model", "kapitza", "--paced", "--samples", "3000", "-q"]
    CliRunner().invoke(commands, arguments, standalone_mode=False, catch_exceptions=False)
    _, account = read(out)
    under_way = 2 * _NEAR // _LEAST_SAMPLE  # not decoded when the last one came, and drained
    assert 3000 <= account.samples <= 3000 + under_way
    assert (account.missing, account.damaged, account.missing_samples) == (0, 0, 0)


def test_unwritable_folder_is_reported(tmp_path: Path, boards: Boards) -> None:
    boards(ticks=100)
    (tmp_path / "folder").mkdir()
    for out, why in (("nowhere/a.pvlog", "No such file or directory"), ("board/a.pvlog", "Not a directory")):
        command = [sys.executable, "-m", "pvid", "log", "board", out]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
        assert (done.returncode, done.stderr.splitlines()[-1]) == (2, f"pvid: cannot write {out}: {why}")


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (serial.SerialException("device reports readiness to read but returned no data (...)"), "its other end"),
        (serial.SerialException("socket disconnected"), "its other end was closed"),
        (OSError(5, "Input/output error"), "Input/output error"),
        (serial.SerialException("something else"), "something else"),
    ],
)
def test_lost_port_is_reported(error: Exception, told: str) -> None:
    assert loss_cause(error).startswith(told)


def test_failed_read_is_reported_with_its_cause() -> None:
    try:
        try:
            raise OSError(6, "No such device or address")
        except OSError as error:
            raise serial.SerialException(f"read failed: {error}")  # noqa: B904 - as pyserial does
    except serial.SerialException as error:
        assert loss_cause(error) == "No such device or address"


def test_samples_during_a_broken_link_are_counted(tmp_path: Path, sent: list[bytes]) -> None:
    decoded = [item for item in link.Decoder().feed(b"".join(sent)) if isinstance(item, link.Frame)]
    first, second = 100, 160
    ticks = [item.tick for item in decoded[second:] if isinstance(item.message, link.Raw)]
    last = [item for item in decoded[:first] if isinstance(item.message, link.Raw)][-1]
    expected = ticks[0] - last.tick - field_board.SAMPLES_A_FRAME
    records, account = read(written(tmp_path / "a.pvlog", sent[:first], sent[second:]))
    assert account.unheard == expected > 0
    gaps = [record.item for record in records if isinstance(record.item, Gap)]
    assert gaps == [Gap(last.tick + field_board.SAMPLES_A_FRAME, expected, down=True)]
    assert account.samples + account.unheard == TICKS and account.lost_share == 0


def test_a_hundred_thousand_frames_a_minute_take_less_than_a_core() -> None:
    """Processor time, not the clock's: 100 000 frames in a minute of one core, and no loss.

    22 500 frames of 148 bytes are 3.3 MB; a logger that kept them would have grown by more.
    """
    frames = 30_000
    seen = throughput(frames)
    assert (seen.frames, seen.lost) == (frames, 0)
    assert seen.cpu_s < 60 * frames / 100_000
    assert seen.late_kb - seen.early_kb < 2000 and seen.late_kb < 150 * 1024


@pytest.mark.parametrize("name", [HOST_TARGET, pytest.param("mps2-an386", marks=pytest.mark.long)])
def test_a_recording_with_accidents_loses_nothing_that_was_recorded(name: str, tmp_path: Path) -> None:
    """The board killed twice, its line closed once (a pseudo-terminal, a socket)."""
    account, stretches = field_log(name, 20_000, tmp_path / "a.pvlog")
    assert len(account.segments) == 4
    assert [one.why is not None and "gone" in one.why for one in account.segments] == [True, True, True, False]
    assert (account.missing, account.damaged, account.missing_samples) == (0, 0, 0)
    good = [one for one in stretches if one.verified and one.difference is None]
    assert {one.segment for one in good} == {0, 1, 2, 3}
    assert all(one.checked > 5 for one in good)
    others = [one for one in stretches if one not in good]
    # what the board sent of its old session before it started over, its samples meanwhile having been lost
    assert [(one.segment, one.first > 0) for one in others] == [(2, True)]
    assert sum(one.ticks for one in stretches) == account.samples
    assert others[0].first == next(one.ticks for one in good if one.segment == 1) + account.unheard


def test_dtr_and_rts_are_set_before_the_port_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    """Opening must reset no board: pyserial raises both lines at opening unless they were set low before."""
    seen: list[tuple[bool, bool]] = []
    monkeypatch.setattr("serial.Serial.open", lambda port: seen.append((port.dtr, port.rts)))
    PortSource("/dev/ttyS0").open()
    assert seen == [(False, False)]
