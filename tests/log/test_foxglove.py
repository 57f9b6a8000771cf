"""Foxglove's live server, by a client of the protocol that its SDK documents (github.com/foxglove/ws-protocol)."""

import json
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import field_board
import numpy as np
import pytest
from processes import PATIENCE_S, until
from program import PVID
from websocket import WebSocket, create_connection

from pvid.base.errors import PvidError
from pvid.link import frames as link
from pvid.log.layout import LAYOUTS
from pvid.log.live_stream import live_stream
from pvid.log.mechanism import UNNAMED
from pvid.log.reader import LogStream, Observer
from pvid.log.values import tables_of

PENDULUM = field_board.mechanism()
MOTOR = b"motor\nsample V V\nsample i A\nsample phi rad\np R ohm\np L H\np k N*m/A\np J kg*m^2\np i0"
SUBPROTOCOL = "foxglove.sdk.v1"  # of foxglove-sdk; it refuses the older foxglove.websocket.v1
BEGUN = 12  # messages of a run, the first samples among them
UNKNOWN = "Unknown channel ID: "
MESSAGE = 1  # opcode of a binary frame: opcode u8, subscription u32, time in ns u64, payload


class Client:
    """Subscribes to every topic; `topics` has what the server advertises."""

    def __init__(self, port: int) -> None:
        self.socket: WebSocket = create_connection(
            f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], timeout=PATIENCE_S
        )
        self.info = self.text("serverInfo")
        self.topics: dict[str, dict[str, Any]] = {}
        self.refused: list[int] = []  # channels: the SDK advertises one before it can be subscribed to

    def text(self, op: str) -> dict[str, Any]:
        """The next text message of that kind."""
        while True:
            data = self.socket.recv()
            if not isinstance(data, str):
                continue
            message = json.loads(data)
            if message["op"] == "status" and message["message"].startswith(UNKNOWN):
                self.refused.append(int(message["message"].removeprefix(UNKNOWN)))
            if message["op"] == op:
                return dict(message)

    def advertised(self, count: int) -> None:
        """Waits for `count` topics, and subscribes to each by the channel's number until all are in force."""
        while len(self.topics) < count:
            self.topics.update({one["topic"]: one for one in self.text("advertise")["channels"]})
        wanted = [one["id"] for one in self.topics.values()]
        while wanted:
            subscriptions = [{"id": number, "channelId": number} for number in wanted]
            self.socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
            self.parameters([])
            wanted, self.refused = self.refused, []

    def parameters(self, names: list[str]) -> dict[str, float]:
        """Of the server, by name; all without names. An answer comes in order: what was sent before was taken."""
        self.socket.send(json.dumps({"op": "getParameters", "parameterNames": names, "id": "x"}))
        return {one["name"]: one["value"] for one in self.text("parameterValues")["parameters"]}

    def messages(self) -> Iterator[tuple[str, int, dict[str, Any]]]:
        """(topic, time [ns], message), until none comes for a second."""
        topics = {one["id"]: topic for topic, one in self.topics.items()}
        self.socket.settimeout(1)
        try:
            while True:
                data = self.socket.recv()
                if isinstance(data, bytes) and data[0] == MESSAGE:
                    number, when = struct.unpack_from("<IQ", data, 1)
                    yield topics[number], when, json.loads(data[13:])
        except TimeoutError:
            return
        except Exception as error:
            assert type(error).__name__ == "WebSocketTimeoutException", error


@pytest.fixture
def port() -> int:
    """A free one."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture(scope="module")
def sent() -> list[tuple[int, link.Message]]:
    """Of a run of 4 s, with estimates."""
    return list(field_board.messages(field_board.Field(4000)))


def feed(server: Observer, stream: LogStream, messages: list[tuple[int, link.Message]]) -> None:
    for record in stream.feed(b"".join(field_board.frames(messages))):
        server.take(record, stream.account)


def test_a_client_gets_the_tables_with_names_units_and_times(port: int, sent: list[tuple[int, link.Message]]) -> None:
    server, stream = live_stream(f"foxglove://127.0.0.1:{port}", PENDULUM), LogStream()
    client = Client(port)
    assert client.info["name"] == "pvid" and "parameters" in client.info["capabilities"]
    first = next(i for i, (_, message) in enumerate(sent) if isinstance(message, link.Estimate))
    feed(server, stream, sent[:BEGUN])
    tables = tables_of(PENDULUM)
    client.advertised(len(tables))
    assert set(client.topics) == {f"/{table}" for table in tables}
    for topic, one in client.topics.items():
        assert (one["encoding"], one["schemaEncoding"]) == ("json", "jsonschema")
        described = json.loads(one["schema"])
        assert (
            (described["title"], described["type"]) == (one["schemaName"], "object") == (f"pvid.{topic[1:]}", "object")
        )
        columns = {name: column for name, column in tables[topic[1:]].items() if name != "log_time"}
        assert {name: value["unit"] for name, value in described["properties"].items()} == {
            name: column.unit for name, column in columns.items()
        }
    assert client.parameters([]) == {}
    feed(server, stream, sent[BEGUN : first + 40])
    got = list(client.messages())
    samples = [(when, one) for topic, when, one in got if topic == "/samples"]
    run = field_board.Field(4000).run
    ticks = [one["tick"] for _, one in samples]
    assert len(ticks) > 100 and ticks == list(range(ticks[0], ticks[0] + len(ticks)))
    assert [one["phi"] for _, one in samples] == run.phi[ticks].astype(np.float32).astype(float).tolist()
    assert set(np.diff([when for when, _ in samples]).tolist()) == {1_000_000}  # 1 kHz
    tick, message = sent[first]
    assert isinstance(message, link.Estimate)
    estimate = next(one for topic, _, one in got if topic == "/estimates" and one["tick"] == tick)
    assert estimate["w"] == message.p[0] and estimate["g"] == pytest.approx(0.3 * message.p[0])
    assert isinstance(estimate["reason"], str)

    last = [one for topic, _, one in got if topic == "/estimates"][-1]
    names = [one.name for one in PENDULUM.answers]
    expected = {name: last[name] for one in names for name in (one, f"{one}_se") if name in last}
    client.socket.settimeout(20)
    assert client.parameters([]) == expected and {"g", "g_se"} <= set(expected)
    assert client.parameters(["w_se", "nothing"]) == {"w_se": expected["w_se"]}
    server.close(stream.account)


def test_what_the_layout_plots_is_served(port: int, sent: list[tuple[int, link.Message]]) -> None:
    """Names and units of the mechanism that the board names, and of the pendulum."""
    server, stream = live_stream(f"foxglove://localhost:{port}", PENDULUM), LogStream()
    feed(server, stream, sent[:BEGUN])
    client = Client(port)
    client.advertised(4)
    served = {
        f"{topic}.{name}" for topic, one in client.topics.items() for name in json.loads(one["schema"])["properties"]
    }
    panels = json.loads(LAYOUTS["foxglove"](PENDULUM))["configById"].values()
    plotted = {path["value"] for panel in panels for path in panel.get("paths", [])}
    assert plotted and plotted <= served
    server.close(stream.account)


def test_the_topics_follow_a_board_that_names_its_mechanism(port: int) -> None:
    hello = link.Hello(1, 1, 5, 0, 0, 7, 1000.0, 1e-3, 1e-3, (1.0,) * 8, "a motor")
    server, stream = live_stream(f"foxglove://127.0.0.1:{port}", UNNAMED), LogStream()
    feed(server, stream, [(0, hello), (0, link.Names(MOTOR)), (0, link.Status(*[0] * 11))])
    client = Client(port)
    client.advertised(4)
    estimates = json.loads(client.topics["/estimates"]["schema"])["properties"]
    assert {"R": "ohm", "R_se": "ohm", "i0": "1"}.items() <= {n: one["unit"] for n, one in estimates.items()}.items()
    assert client.topics["/samples"]["metadata"] == {"t": "s", "V": "V", "i": "A", "phi": "rad"}
    server.close(stream.account)


def client_of(process: subprocess.Popen[str], port: int) -> Client:
    """Of the server that a process is about to start."""

    def connected() -> Client | None:
        try:
            return Client(port)
        except ConnectionRefusedError:
            assert process.poll() is None, process.communicate()
            return None

    found = until(connected)
    assert found is not None
    return found


def test_the_command_serves_what_it_records(port: int, sent: list[tuple[int, link.Message]], tmp_path: Path) -> None:
    """A board behind a pseudo-terminal; the client subscribes between its first frames and the others."""
    first = next(i for i, (_, message) in enumerate(sent) if isinstance(message, link.Estimate))
    frames = list(field_board.frames(sent[: first + 40]))
    line = field_board.PtyLine(tmp_path / "board")
    command = [*PVID, "log", "board", "run.pvlog", "--live", f"foxglove://127.0.0.1:{port}", "--quiet"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            client = client_of(process, port)
            line.await_word()
            for frame in frames[:BEGUN]:
                line.write(frame)
            client.advertised(4)
            for frame in frames[BEGUN:]:
                line.write(frame)
            got = list(client.messages())
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
    early = "attempted to subscribe to unknown channel"  # see Client.refused
    assert (process.returncode, [line for line in err.splitlines() if early not in line]) == (0, [])

    stream = LogStream()
    records = list(stream.feed((tmp_path / "run.pvlog").read_bytes()))
    assert f"{stream.account.samples} samples in 1 segment; lost 0 frames" in out and records
    samples = [one for topic, _, one in got if topic == "/samples"]
    ticks = [one["tick"] for one in samples]
    assert len(ticks) > 100 and ticks == list(range(ticks[0], stream.account.samples))
    assert [one["phi"] for one in samples] == field_board.Field(4000).run.phi[ticks].astype(np.float32).tolist()
    recorded = {tick: message.p[0] for tick, message in sent[: first + 40] if isinstance(message, link.Estimate)}
    assert {one["tick"]: one["w"] for topic, _, one in got if topic == "/estimates"} == recorded


def test_each_mistake_has_one_sentence(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", port))
        taken.listen()
        with pytest.raises(PvidError, match=f"^cannot serve foxglove://127.0.0.1:{port}: .*in use"):
            live_stream(f"foxglove://127.0.0.1:{port}")
    with pytest.raises(PvidError, match=r"is no address to send to: udp://host:port, .* or foxglove://host:port"):
        live_stream("foxglove://127.0.0.1")
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(PvidError, match=r"^foxglove://h:1 needs foxglove-sdk: .* -m pip install foxglove-sdk$"):
        live_stream("foxglove://h:1", PENDULUM)
