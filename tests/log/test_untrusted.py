"""What a board sends is never trusted: the mechanisms that the recording rests on, one by one."""

from __future__ import annotations

import asyncio
import contextlib
import io
import itertools
import json
import socket
import subprocess
import sys
import threading
import time
import urllib.request
import warnings
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import serial
import uvicorn
from click.testing import CliRunner
from lies import Behaviour
from logs import log_of
from lying_board import TICKS, Flood, LyingBoard, Pause, Step, message
from processes import PATIENCE_S, until
from rehearsal import RehearsedSource

from pvid.base.errors import PvidError
from pvid.board.target import Target
from pvid.cli.log import print_account
from pvid.cli.main import commands
from pvid.link import frames as link
from pvid.link.port import open_port
from pvid.log import file as logfile
from pvid.log.file import LOG_MESSAGES, LOG_SCHEMA, LogWriter
from pvid.log.history import History
from pvid.log.reader import OTHER_KINDS, Account, LogReader, LogStream, Record
from pvid.log.recorder import Logger, Recorder
from pvid.log.rig import document_of_log, recording_of_log
from pvid.log.tail import LogTail
from pvid.log.values import Values
from pvid.show import patience
from pvid.show.page import page


def account_of(path: Path) -> Account:
    reader = LogReader(path)
    for _ in reader:
        pass
    return reader.account


# ---- schemas


@pytest.mark.parametrize(
    "line",
    [
        "6 e p:u8[0] q:u8",
        "6 e p:char[0]",
        "6 e p:f32[513]",
        "6 e p:u8[2048] q:u8",
        "6 e p:f32[99999999999999999999]",
        "6 e p:f32[] q:u8",
        "6 e p:u8 p:u8",
        "256 e p:u8",
        "6 e\x1b[31m p:u8",
        "6 " + "e" * 33 + " p:u8",
        "6 e " + " ".join(f"f{i}:u8" for i in range(65)),
        "6 e p:u8\n6 f p:u8",
    ],
)
def test_a_schema_that_no_frame_can_have_is_refused(line: str) -> None:
    with pytest.raises(PvidError) as refused:
        link.parse_schema(f"pvid 1\n{line}")
    assert str(refused.value).isprintable() and len(str(refused.value)) < 200
    assert link.parse_schema("pvid 1\n6 e p:f32[512]")[6].size == link.MAX_PAYLOAD


def test_decoder_keeps_the_last_schemas() -> None:
    board, decoder = LyingBoard(), link.Decoder(learns=True)
    texts = [b"pvid 1\n9 k%d a:u8" % i for i in range(100)]
    frames = [item for text in texts for item in decoder.feed(board.schema(text, (9, b"\1")))]
    assert [type(item).__name__ for item in frames[1::2]] == ["Frame"] * 100
    assert len(decoder.schemas) == 2 + link.MAX_LEARNT
    learnt = {zlib.crc32(text) for text in texts[-link.MAX_LEARNT :]}
    assert set(decoder.schemas) == {link.SCHEMA, link.WIDE_SCHEMA} | learnt
    assert len(decoder._expected) <= link.MAX_LEARNT + 2


def test_unreadable_bytes_are_damage() -> None:
    def stumbles(_: bytes) -> link.Message:
        raise IndexError("tuple index out of range")

    decoder = link.Decoder(schemas={5: {9: stumbles}})
    assert [item.why for item in decoder.feed(link.encode_raw(9, 0, 0, b"\1", 5)) if isinstance(item, link.Loss)] == [
        "layout"
    ]


def test_kinds_of_frames_are_counted_in_bounded_memory(tmp_path: Path) -> None:
    board = LyingBoard()
    sent = b"".join(board.schema(b"pvid 1\n9 kind_%d a:u8" % i, (9, b"\1")) for i in range(300))
    account = account_of(log_of(tmp_path / "a.pvlog", sent))
    assert account.frames == sum(account.by_kind.values()) == 300
    assert len(account.by_kind) == 65 and account.by_kind[OTHER_KINDS] > 200


def test_board_name_is_printable() -> None:
    name = b"\x1b]0;PWN\x07\xff\xc2\x9b\n\0\0\0\0"
    payload = LyingBoard().hello(board="N" * 16).payload.replace(b"N" * 16, name)
    hello = link.Hello.of(payload)
    assert hello.board == "?]0;PWN?????" and link.Hello.of(hello.payload) == hello


# ---- frames of the logger's own kind


def forged(key: int) -> bytes:
    board = LyingBoard()
    frames = (
        logfile.Segment(7, 5, b'{"port": "elsewhere"}'),
        logfile.Rig(0, 8, b"l1 = 9.9"),
        logfile.Mark(2**64 - 1, 2**64 - 1),
        logfile.Close(2**64 - 1, 1, b"forged"),
        logfile.LinkSchema(b"pvid 1\n9 e p:u8"),
    )
    return b"".join(board.say(frame, key, LOG_SCHEMA) for frame in frames)


def test_frames_of_the_logger_s_kind_from_the_line_are_not_the_logger_s(tmp_path: Path) -> None:
    sent = LyingBoard().honest()
    path = log_of(tmp_path / "a.pvlog", sent + forged(0) + forged(1), sent, rig="l1 = 0.3\n")
    assert b"elsewhere" in path.read_bytes()  # what came is in the log all the same
    account = account_of(path)
    assert [(one.number, one.port, one.why) for one in account.segments] == [
        (0, "a port", "the end"),
        (1, "a port", "the end"),
    ]
    assert (account.foreign, account.damaged, account.missing, account.samples) == (10, 0, 0, 2 * TICKS)
    assert account.unix_ns < 2**62
    assert document_of_log(path) == {"l1": 0.3}


def test_a_log_that_is_appended_to_keeps_its_key_and_one_without_a_key_opens(tmp_path: Path) -> None:
    path = log_of(tmp_path / "a.pvlog", LyingBoard().honest())
    log_of(path, LyingBoard().honest())
    assert account_of(path).begun == 2
    keyless = tmp_path / "old.pvlog"  # as logs were
    frames = (message(logfile.Segment, about=b"{}"), message(logfile.Close, why=b"the end"))
    head, tail = (link.encode(frame, i, 0, LOG_SCHEMA) for i, frame in enumerate(frames))
    keyless.write_bytes(head + LyingBoard().honest() + tail)
    log_of(keyless, LyingBoard().honest())
    assert (account_of(keyless).begun, account_of(keyless).foreign) == (2, 0)


def test_keys_differ_from_log_to_log(tmp_path: Path) -> None:
    decoder = link.Decoder(schemas={LOG_SCHEMA: link.readers(LOG_MESSAGES)})
    first = [decoder.feed(log_of(tmp_path / f"{i}.pvlog").read_bytes())[0] for i in range(4)]
    assert len({frame.tick for frame in first if isinstance(frame, link.Frame)}) == 4


@pytest.mark.parametrize("about", [b"[" * 1900, b'{"port": "\\ud800\\u001b[31m"}', b"\xff", b'{"port": {"a": 1}}'])
def test_port_name_from_a_log_is_escaped(about: bytes) -> None:
    port = message(logfile.Segment, about=about).port
    assert port.isprintable() and len(port.encode()) < 40


@pytest.mark.parametrize("when", [0, 2**62, 2**64 - 1])
def test_log_with_any_time_stamp_is_read(when: int, tmp_path: Path) -> None:
    frames = (logfile.Segment(0, when, b"{}"), logfile.Mark(when, 2**64 - 1), logfile.Close(when, 2**64 - 1, b""))
    begin, mark, end = (link.encode(frame, i, 5, LOG_SCHEMA) for i, frame in enumerate(frames))
    path = tmp_path / "a.pvlog"
    path.write_bytes(begin + LyingBoard().honest() + mark + LyingBoard().honest(board_at_the_slowest()) + end)
    values = Values()
    rows = [one for record in LogReader(path) for one in values.rows(record)]
    times = np.concatenate([one.columns["log_time"] for one in rows])
    assert len(times) > 2 * TICKS and (np.diff(times) >= 0).all() and times[0] >= 0


def board_at_the_slowest() -> link.Hello:
    """Of which 2^48 ticks take longest."""
    return LyingBoard().hello(sample_rate=1e-3)


# ---- the recorder


class _Failing:
    """An observer that fails at its third record."""

    def __init__(self) -> None:
        self.taken = 0
        self.closed = False

    def take(self, record: Record, account: Account) -> None:
        self.taken += 1
        if self.taken == 3:
            raise IndexError("no such\x1b thing")

    def idle(self, account: Account) -> None: ...

    def close(self, account: Account) -> None:
        self.closed = True
        raise ValueError


def recorded(path: Path, *steps: Step, **settings: object) -> Logger:
    """After a recording of a board that sends this."""
    source = RehearsedSource(Behaviour("", (0,), False, lambda _: iter(steps)))
    source.logger = Logger(source=source, out=path, **settings)  # type: ignore[arg-type]
    source.logger.run()
    return source.logger


def test_an_observer_that_fails_is_left_out_and_named(tmp_path: Path) -> None:
    failing, counting = _Failing(), _Counting()
    logger = recorded(tmp_path / "a.pvlog", LyingBoard().honest(), observers=[failing, counting])
    assert logger.failures == ["_Failing failed with IndexError: no such\\x1b thing; the recording went on"]
    assert failing.taken == 3 and failing.closed
    assert logger.stream.account.samples == TICKS and counting.taken > 40 and counting.closed


class _Counting(_Failing):
    """An observer that does not."""

    def take(self, record: Record, account: Account) -> None:
        self.taken += 1

    def close(self, account: Account) -> None:
        self.closed = True


def test_a_stream_that_fails_does_not_end_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    board, count = LyingBoard(), LogStream._of_board

    def stumbles(self: LogStream, frame: link.Frame, began: bool) -> Iterator[Record]:
        if isinstance(frame.message, link.Credit):
            raise RecursionError("deep")
        return count(self, frame, began)

    monkeypatch.setattr(LogStream, "_of_board", stumbles)
    logger = recorded(tmp_path / "a.pvlog", board.honest(), board.say(message(link.Credit)), Pause(0.2), board.honest())
    assert logger.failures == ["LogStream failed with RecursionError: deep; the recording went on"]
    assert logger.stream.account.samples == 2 * TICKS
    monkeypatch.undo()
    assert account_of(tmp_path / "a.pvlog").by_kind["credit"] == 1


def test_recording_continues_after_a_late_refusal(tmp_path: Path) -> None:
    board = LyingBoard()
    steps = [board.say(board.hello(session=0)), board.say(board.status()), board.say(board.hello(session=0))]
    steps += [board.say(board.status(code=3)), board.honest()]
    logger = recorded(tmp_path / "a.pvlog", *steps, begin=board.configure)
    assert logger.failures == [] and logger.stream.account.samples == TICKS
    with pytest.raises(PvidError, match="the board refused"):
        recorded(tmp_path / "b.pvlog", *steps[2:], begin=board.configure)
    assert account_of(tmp_path / "b.pvlog").begun == 1


def test_a_flood_is_recorded_and_what_is_not_decoded_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("pvid.log.recorder._CATCH_UP_S", 0.0)
    flood = b"".join(LyingBoard().honest() for _ in range(10))
    logger = recorded(tmp_path / "a.pvlog", *[Flood(flood)] * 20)
    account, size = logger.stream.account, (tmp_path / "a.pvlog").stat().st_size
    assert size > 1_500_000 and account.bytes == size
    assert account.segments[-1].why == "0 s are over"
    whole = account_of(tmp_path / "a.pvlog")
    assert whole.unread == 0  # nothing is missing in the log
    assert (account.unread > 0) == (account.frames < whole.frames)  # how many depends on the machine's load
    assert print_account(account, 0.5) == (1 if account.unread else 0)
    assert ("bytes arrived too fast to be decoded" in capsys.readouterr().err) == (account.unread > 0)


def test_a_tail_reads_what_was_there_and_skips_what_comes_too_fast(tmp_path: Path) -> None:
    path, sent = tmp_path / "log", LyingBoard().honest()
    writer, stream = LogWriter(path), LogStream()
    writer.begin("a port", None)
    writer.take(sent * 20)
    there = path.stat().st_size
    with path.open("rb") as file:
        tail = LogTail(file, stream, most_behind=100_000)
        read = 0
        while data := tail.read():
            read += len(data)
            list(stream.feed(data))
        assert (read, stream.account.unread) == (there, 0)
        writer.take(sent * 100)
        while data := tail.read():
            list(stream.feed(data))
    writer.close()
    account = stream.account
    assert len(sent) * 90 < account.unread < len(sent) * 100 and account.bytes == path.stat().st_size
    assert (account.damaged, account.missing, account.missing_samples) == (0, 0, 0)
    assert account.samples % 20 == 0 and account.samples > 20 * TICKS


def test_a_tail_does_not_skip_the_begin_of_a_recording(tmp_path: Path) -> None:
    """A board floods before the reader has seen more than the log's header: its segment has begun none the less, and
    with it the recording's duration."""
    path, sent = tmp_path / "log", LyingBoard().honest()
    writer, stream = LogWriter(path), LogStream()
    with path.open("rb") as file:
        tail = LogTail(file, stream, most_behind=100_000)
        list(stream.feed(tail.read()))
        writer.begin("a port", None)
        writer.take(sent * 100)
        while data := tail.read():
            list(stream.feed(data))
    writer.close()
    assert stream.account.begun == 1
    assert stream.account.unread > 100_000


def test_segments_and_the_summary_are_of_bounded_length(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frame = LyingBoard().say(LyingBoard().samples())
    account = account_of(log_of(tmp_path / "a.pvlog", *[frame] * 500))
    assert (account.begun, account.samples, len(account.segments)) == (500, 10_000, 64)
    assert [one.number for one in account.segments][-1] == 499
    assert print_account(account, 0.0) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 66 and lines[0] == "436 segments before: 8720 samples"
    assert "10000 samples in 500 segments" in lines[-1]


def test_a_link_that_falls_at_once_is_taken_up_ever_more_slowly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Falling:
        name, usb = "falling", None

        def open(self) -> Target:
            return Target("falling", "unknown", self)  # type: ignore[arg-type]

        def read(self, size: int = 1, /) -> bytes:
            raise serial.SerialException("disconnected")

        def close(self) -> None: ...

    recorder = Recorder(Falling(), LogWriter(tmp_path / "a.pvlog"))
    waits: list[float] = []

    def wait(seconds: float) -> bool:
        waits.append(seconds)
        return len(waits) > 9

    monkeypatch.setattr(recorder.stop, "wait", wait)
    recorder.run()
    assert waits == [0.5, 1, 2, 4, 8, 8, 8, 8, 8, 8] and recorder.error is None


@pytest.mark.parametrize("garbage", [bytes(5000), b"\xff" * 5000, np.random.default_rng(1).bytes(5000), b"boot\r\n"])
def test_line_with_garbage_alone_is_reported(
    garbage: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert print_account(account_of(log_of(tmp_path / "a.pvlog", garbage)), 1.0) == 1
    told = "the received data contain not one frame: is it the right port, and is the board's baud rate 115200?"
    assert told in capsys.readouterr().err
    nothing = account_of(log_of(tmp_path / "b.pvlog", b""))
    assert print_account(nothing, 1.0) == 0


def test_segment_of_garbage_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    honest = LyingBoard().honest()
    assert print_account(account_of(log_of(tmp_path / "a.pvlog", honest, bytes(5000), honest)), 1.0) == 1
    assert "not one frame in 1 of the segments" in capsys.readouterr().err
    cut = account_of(log_of(tmp_path / "b.pvlog", honest, honest[20:70], honest))
    assert print_account(cut, 1.0) == 0  # a link that fell at once


def test_damage_in_a_row_is_one_record(tmp_path: Path) -> None:
    sent = LyingBoard().honest()
    path = log_of(tmp_path / "a.pvlog", sent + b"x\0" * 1000 + sent)
    reader = LogReader(path)
    losses = [record.item for record in reader if isinstance(record.item, link.Loss)]
    assert [(one.why, one.pieces, one.bytes) for one in losses] == [("malformed", 1000, 1000)]
    assert reader.account.damaged == 1000


def test_a_frame_longer_than_any_is_damage_even_at_the_end(tmp_path: Path) -> None:
    account = account_of(log_of(tmp_path / "a.pvlog", LyingBoard().honest() + b"\1" * 100_000))
    assert (account.damaged, account.cut) == (1, 0) and account.lost_share > 0.001


def test_a_socket_loses_nothing_that_was_sent_before_it_was_opened() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def send() -> None:
            connection, _ = server.accept()
            connection.sendall(b"first bytes")
            time.sleep(1)

        # the connection waits, full of bytes, before pyserial opens the port
        original = socket.create_connection
        threading.Thread(target=send, daemon=True).start()

        def slow(*arguments: object, **named: object) -> socket.socket:
            made = original(*arguments, **named)  # type: ignore[arg-type]
            time.sleep(0.2)
            return made

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("serial.urlhandler.protocol_socket.socket.create_connection", slow)
            port = open_port(f"socket://127.0.0.1:{server.getsockname()[1]}")
        assert port.read(11) == b"first bytes"
        port.close()


def test_a_logger_loads_no_package_that_it_does_not_need() -> None:
    """What a logger does not load is memory that it does not take, for as long as it runs."""
    names = "('scipy', 'matplotlib', 'pyarrow')"
    code = f"import sys, pvid.cli.main; print(*[name for name in {names} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


# ---- numbers


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf"), 1e-38, 3e38])
def test_invalid_sample_rate_leaves_times_unknown(rate: float) -> None:
    board = LyingBoard()
    values = Values()
    assert list(values.rows(Record(0, 10**18, 0, board.hello(sample_rate=rate)))) == []
    (rows,) = values.rows(Record(0, 10**18, 2**47, board.samples()))
    assert np.isnan(rows.columns["t"]).all() and (rows.columns["log_time"] >= 10**18).all()


def test_ticks_far_apart_at_the_slowest_rate_have_a_time() -> None:
    values = Values()
    assert list(values.rows(Record(0, 10**18, 0, board_at_the_slowest()))) == []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for tick in (2**48 - 1, 0, 2**48 - 1):
            (rows,) = values.rows(Record(0, 10**18, tick, LyingBoard().status()))
            assert (rows.columns["log_time"] >= 10**18).all()


def test_run_of_a_log_contains_samples_only(tmp_path: Path) -> None:
    board = LyingBoard()
    frames = [*board.introduction(), board.say(board.samples()), board.say(board.samples(float("inf"), 3e38), 20)]
    frames += [board.say(board.samples(), 40)]
    run = recording_of_log(log_of(tmp_path / "a.pvlog", b"".join(frames)), ["phi", "y"])
    phi = run.signals["phi"]
    assert np.isnan(phi[20:40]).all() and np.isfinite(phi[[19, 40]]).all() and len(run) == 60
    nothing = [*LyingBoard().introduction(), board.say(board.samples(float("nan"), 0.0))]
    with pytest.raises(PvidError, match="holds 0 samples in a row"):
        recording_of_log(log_of(tmp_path / "b.pvlog", b"".join(nothing)), ["phi", "y"])
    senseless = LyingBoard().honest(board.hello(sample_rate=0.0))
    with pytest.raises(PvidError, match="sample rate of 0 Hz"):
        recording_of_log(log_of(tmp_path / "c.pvlog", senseless), ["phi", "y"])


def test_samples_in_pieces_are_kept_in_bounded_memory() -> None:
    board, history = LyingBoard(), History()
    history.take(Record(0, 1, 0, board.hello()))
    for i in range(12_000):  # none behind the other, so that none can be joined
        history.take(Record(0, 1, 2 * i, replace(board.samples(count=1))))
    assert history.samples().shape[1] > 4_000
    assert len(history._samples) <= 1_001


def test_verify_names_a_hundred_stretches_and_counts_the_others(tmp_path: Path) -> None:
    board = LyingBoard()
    frames = [*board.introduction(), *(board.say(board.samples(), 100 * i) for i in range(300))]
    path = log_of(tmp_path / "a.pvlog", b"".join(frames))
    result = CliRunner().invoke(commands, ["verify", str(path)], standalone_mode=False)
    assert len(result.stdout.splitlines()) == 103
    assert "200 stretches more" in result.stdout and "6000 samples not verified" in result.stdout


# ---- the page


def get(address: str, host: str | None = None) -> tuple[bytes, dict[str, str]]:
    request = urllib.request.Request(address, headers={} if host is None else {"Host": host})
    with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
        return bytes(answer.read()), {name.lower(): value for name, value in answer.headers.items()}


def answered(address: str, host: str | None = None) -> tuple[bytes, dict[str, str]]:
    """When the page is up."""

    def there() -> tuple[bytes, dict[str, str]] | None:
        with contextlib.suppress(OSError):
            return get(address, host)
        return None

    found = until(there)
    assert found is not None
    return found


def test_the_page_answers_on_the_ipv6_loopback_and_stands_in_no_frame(tmp_path: Path) -> None:
    with page("[::1]:0", tmp_path / "none.pvlog", "title") as address:
        content, headers = answered(address + "state", "[::1]:8765")
        assert json.loads(content)["title"] == "title"
        assert "frame-ancestors 'none'" in headers["content-security-policy"]


def test_half_open_connections_do_not_hold_the_page(tmp_path: Path) -> None:
    with page("127.0.0.1:0", tmp_path / "none.pvlog", "title") as address:
        answered(address + "state")
        port = int(address.rstrip("/").rsplit(":", 1)[1])
        slow = [socket.create_connection(("127.0.0.1", port)) for _ in range(100)]
        for one in slow:
            one.sendall(b"GET /state HTTP/1.1\r\nHost: localhost\r\nX-a: ")
        time.sleep(0.5)
        assert json.loads(get(address + "state")[0])["title"] == "title"
        for one in slow:
            one.close()


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Callable[[], socket.socket], uvicorn.Server]]:
    """Connects to a server that thinks for longer than it waits for a request, and answers with 50 MB; the server."""
    monkeypatch.setattr(patience, "REQUEST_S", 0.7)
    monkeypatch.setattr(patience, "ANSWER_S", 2.0)

    async def application(scope: object, receive: object, send: Callable[..., object]) -> None:
        await asyncio.sleep(1.0)
        await send({"type": "http.response.start", "status": 200, "headers": []})  # type: ignore[misc]
        for left in range(49, -1, -1):
            await send({"type": "http.response.body", "body": bytes(1_000_000), "more_body": left > 0})  # type: ignore[misc]

    listening = socket.create_server(("127.0.0.1", 0))
    settings = uvicorn.Config(application, http=patience.Impatient, ws="none", lifespan="off", log_level="critical")
    server = uvicorn.Server(settings)
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    yield lambda: socket.create_connection(listening.getsockname(), timeout=PATIENCE_S), server
    server.should_exit = server.force_exit = True
    thread.join(10)


def test_a_client_that_is_slow_to_ask_or_to_read_is_ended(
    impatient: tuple[Callable[[], socket.socket], uvicorn.Server],
) -> None:
    connect, server = impatient
    request = b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
    asks, reads = connect(), connect()
    asks.sendall(request)  # and no empty line
    reads.sendall(request + b"\r\n")
    with contextlib.suppress(ConnectionResetError):
        assert asks.recv(1) == b""
    until(lambda: not server.server_state.connections)  # it has ended both
    got = 0
    with contextlib.suppress(ConnectionResetError):
        while data := reads.recv(1 << 20):
            got += len(data)
    assert got < 40_000_000
    quick = connect()
    quick.sendall(request + b"\r\n")
    whole = io.BytesIO()
    while data := quick.recv(1 << 20):
        whole.write(data)
    assert whole.getbuffer().nbytes > 50_000_000
    assert list(itertools.islice(patience.Impatient._waiting, 1)) == []
