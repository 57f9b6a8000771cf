"""Exports of a log, read back with the libraries that others read them with; the tee; identify on a log."""

import contextlib
import csv
import json
import socket
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import field_board
import numpy as np
import numpy.typing as npt
import pandas
import pyarrow.parquet
import pytest
from logs import log_of
from mcap.reader import make_reader
from pendulum_run import read_run
from program import pvid

from pvid.base.errors import PvidError
from pvid.link import frames as link
from pvid.log.export import FORMATS, export_log
from pvid.log.live_stream import live_stream
from pvid.log.mechanism import UNNAMED
from pvid.log.reader import LogReader, LogStream
from pvid.log.rig import recording_of_log
from pvid.log.values import Values, tables_of
from pvid.settings.enums import Reason

TICKS = 4000


@pytest.fixture(scope="module")
def sent() -> list[tuple[int, link.Message]]:
    """(tick, message) of a run of TICKS."""
    return list(field_board.messages(field_board.Field(TICKS)))


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory, sent: list[tuple[int, link.Message]]) -> Path:
    """A log of two segments; the second lacks a frame of samples, and the board has begun anew."""
    path = tmp_path_factory.mktemp("log") / "field.pvlog"
    frames = list(field_board.frames(sent))
    return log_of(path, b"".join(frames), b"".join([*frames[:60], *frames[61:100]]), rig=field_board.text())


def expected_samples() -> npt.NDArray[np.float64]:
    run = field_board.Field(TICKS).run
    return np.stack([run.phi, run.y], axis=1)[:TICKS].astype(np.float32).astype(np.float64)


def last_estimate(sent: list[tuple[int, link.Message]]) -> tuple[int, link.Estimate]:
    return [(tick, message) for tick, message in sent if isinstance(message, link.Estimate)][-1]


def test_csv_reads_back_with_pandas(tmp_path: Path, log: Path, sent: list[tuple[int, link.Message]]) -> None:
    paths = export_log(log, "csv", tmp_path / "out", field_board.mechanism())
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)
    samples = pandas.read_csv(tmp_path / "out-samples.csv")
    first = samples[samples.segment == 0]
    assert np.array_equal(first[["phi", "y"]].to_numpy(), expected_samples())
    assert np.array_equal(first.t.to_numpy(), np.arange(TICKS) / 1000)
    assert (samples.segment == 1).sum() == samples[samples.segment == 1].tick.nunique() > 0
    estimates = pandas.read_csv(tmp_path / "out-estimates.csv")
    tick, message = last_estimate(sent)
    row = estimates[(estimates.segment == 0) & (estimates.tick == tick)].iloc[-1]
    assert [row.w, row.d1, row.d2, row.c] == list(message.p[:4])
    assert row.w_se == pytest.approx(np.sqrt(message.covariance[0]))
    assert row.g == pytest.approx(0.3 * message.p[0])
    assert row.reason == Reason(message.reason).text
    events = pandas.read_csv(tmp_path / "out-events.csv")
    assert events.event.tolist() == ["segment", "close", "segment", "sequence", "gap", "close"]
    described = json.loads((tmp_path / "out-metadata.json").read_text())
    units = {one["name"]: one["unit"] for one in described["tables"][0]["tableSchema"]["columns"]}
    assert (units["t"], units["phi"], units["y"]) == ("s", "rad", "m")
    for one in described["tables"]:
        with (tmp_path / one["url"]).open(newline="") as file:
            assert next(csv.reader(file)) == [column["name"] for column in one["tableSchema"]["columns"]]


def test_parquet_reads_back_with_pyarrow(tmp_path: Path, log: Path) -> None:
    export_log(log, "parquet", tmp_path / "out", field_board.mechanism())
    samples = pyarrow.parquet.read_table(tmp_path / "out-samples.parquet")
    first = samples.filter(pyarrow.compute.equal(samples["segment"], 0))
    got = np.stack([first["phi"].to_numpy(), first["y"].to_numpy()], axis=1)
    assert np.array_equal(got, expected_samples())
    for table, columns in tables_of(field_board.mechanism()).items():
        schema = pyarrow.parquet.read_schema(tmp_path / f"out-{table}.parquet")
        assert {field.name: field.metadata[b"unit"].decode() for field in schema} == {
            name: column.unit for name, column in columns.items()
        }


def test_npz_is_a_run_and_more(tmp_path: Path, log: Path) -> None:
    (path,) = export_log(log, "npz", tmp_path / "out", field_board.mechanism())
    archive = np.load(path)
    units = json.loads(str(archive["units"]))
    assert set(units) == set(archive.files) - {"units"}
    assert (units["phi"], units["estimates.g"], units["estimates.w_se"]) == ("rad", "m/s^2", "1/s^2")
    first = archive["segment"] == 0
    assert np.array_equal(np.stack([archive["phi"], archive["y"]], axis=1)[first], expected_samples())


def test_mcap_reads_back_with_its_library(tmp_path: Path, log: Path, sent: list[tuple[int, link.Message]]) -> None:
    (path,) = export_log(log, "mcap", tmp_path / "out", field_board.mechanism())
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert {channel.topic for channel in summary.channels.values()} == {
            f"/{table}" for table in tables_of(field_board.mechanism())
        }
        assert all(schema.encoding == "jsonschema" for schema in summary.schemas.values())
        described = {schema.name: json.loads(schema.data) for schema in summary.schemas.values()}
        assert described["pvid.samples"]["properties"]["phi"]["unit"] == "rad"
        messages = [(channel.topic, message) for _, channel, message in reader.iter_messages(log_time_order=False)]
    samples = [json.loads(message.data) for topic, message in messages if topic == "/samples"]
    first = np.array([[one["phi"], one["y"]] for one in samples if one["segment"] == 0])
    assert np.array_equal(first, expected_samples())
    times = [message.log_time for topic, message in messages if topic == "/samples"][:TICKS]
    assert {b - a for a, b in pairwise(times)} == {1_000_000}  # 1 kHz
    everything = [message.log_time for _, message in messages]
    assert everything == sorted(everything)
    began = next(record.unix_ns for record in LogReader(log) if record.segment == 0)
    assert times[0] == began
    tick, message = last_estimate(sent)
    estimates = [json.loads(one.data) for topic, one in messages if topic == "/estimates"]
    assert next(one for one in estimates if one["tick"] == tick)["w"] == message.p[0]


_JSON_KINDS = {"number": (int, float), "integer": (int,), "string": (str,)}


def test_mcap_contains_the_fields_required_by_foxglove_and_plotjuggler(tmp_path: Path, log: Path) -> None:
    """By Foxglove's page on custom schema encodings: schema "jsonschema" of an object, messages "json", UTF-8, each an
    object; a plot's axis is the log time. Both programs read the summary first, and the chunks by their index."""
    (path,) = export_log(log, "mcap", tmp_path / "out", field_board.mechanism())
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None and summary.statistics is not None
        statistics = summary.statistics
        schemas = {number: json.loads(one.data) for number, one in summary.schemas.items()}
        assert all(one["type"] == "object" and one["properties"] for one in schemas.values())
        assert all(one.message_encoding == "json" for one in summary.channels.values())
        assert (statistics.channel_count, statistics.schema_count) == (
            len(tables_of(field_board.mechanism())),
            len(tables_of(field_board.mechanism())),
        )
        assert statistics.chunk_count == len(summary.chunk_indexes) > 0
        messages = [(channel, one) for _, channel, one in make_reader(file).iter_messages()]
    assert len(messages) == statistics.message_count == sum(statistics.channel_message_counts.values())
    times = [one.log_time for _, one in messages]
    assert (statistics.message_start_time, statistics.message_end_time) == (min(times), max(times))
    assert all(index.message_start_time <= index.message_end_time for index in summary.chunk_indexes)
    assert 1e18 < min(times) < 4e18  # nanoseconds since 1970, from 2001 to 2096
    for channel, one in messages:
        properties = schemas[channel.schema_id]["properties"]
        for name, value in json.loads(one.data).items():
            assert isinstance(value, _JSON_KINDS[properties[name]["type"]]), (channel.topic, name)


def test_an_export_that_fails_leaves_nothing(tmp_path: Path, log: Path) -> None:
    (tmp_path / "noise").write_bytes(b"noise")
    for form in FORMATS:
        with pytest.raises(PvidError, match="is not a log of pvid"):
            export_log(tmp_path / "noise", form, tmp_path / "out", UNNAMED)
        with pytest.raises(PvidError, match="cannot write .*nowhere"):
            export_log(log, form, tmp_path / "nowhere" / "out", UNNAMED)
    assert [path.name for path in tmp_path.iterdir()] == ["noise"]


def test_fixed_point_is_exported_in_si() -> None:
    hello = link.Hello(1, 1, 4, 0, 0, 7, 1000.0, 2**-12, 2**-16, (2**-10, 2**-20, 2**-20, 2**-24, *[0.0] * 4), "x")
    correlation = [0] * 36
    for place in (0, 8, 15, 21):  # the diagonal
        correlation[place] = 2**30
    estimate = link.EstimateQ31(
        7,
        9,
        (32440, 9305000, 5898000, 64, 0, 0, 0, 0),
        (11, 22, 33, 44, 0, 0, 0, 0),
        tuple(correlation),
        2**23,
        512,
        5,
        0,
    )
    configure = link.ConfigureQ31(
        7, 0, 1, 1, 1, 1, 1, (0,) * 8, (0,) * 8, (0,) * 8, (0,) * 8, 256, 0, 0, phi_offset=3, y_offset=0
    )
    raw = link.RawCount.of_values([4096, -2048], [1, 2])
    sent = [(0, hello), (0, configure), (0, raw), (2, estimate)]
    values, stream = Values(field_board.mechanism()), LogStream()
    rows = [one for r in stream.feed(b"".join(field_board.frames(sent))) for one in values.rows(r)]
    samples, estimates = rows
    assert samples.columns["phi"].tolist() == [1.0, -0.5]
    assert samples.columns["y"].tolist() == [2**-16, 2**-15]
    columns = {name: column[0] for name, column in estimates.columns.items()}
    assert columns["w"] == 32440 * 2**-10
    assert columns["w_se"] == 11 * 2**-10
    assert columns["c"] == 64 * 2**-24 + 3 * 2**-12
    assert columns["c_se"] == pytest.approx(44 * 2**-24)
    assert columns["kappa"] == 2**-7
    assert columns["residual"] == 2
    assert columns["g"] == pytest.approx(0.3 * 32440 * 2**-10)


def test_a_log_is_a_run(tmp_path: Path, log: Path) -> None:
    run = recording_of_log(log, ["phi", "y"])
    assert (len(run), run.sample_rate) == (TICKS, 1000)
    assert np.array_equal(np.stack([run.signals["phi"], run.signals["y"]], axis=1), expected_samples())
    log_of(tmp_path / "empty.pvlog", b"")
    with pytest.raises(PvidError, match="contains no description of the board"):
        recording_of_log(tmp_path / "empty.pvlog", ["phi", "y"])


def test_identify_and_export_take_a_log(tmp_path: Path, log: Path) -> None:
    """The same answer from the log as from the exported run with the rig file."""
    field_board.rig().write(tmp_path / "rig.toml")
    run = field_board.Field(TICKS).run
    (tmp_path / "a.pvlog").write_bytes(log.read_bytes())
    from_log = pvid(tmp_path, "identify", "a.pvlog", "--json")
    found = json.loads(from_log.stdout)
    assert found["samples"] == TICKS
    frame = pandas.DataFrame({"t": np.arange(TICKS) / 1000, "phi": run.phi[:TICKS], "y": run.y[:TICKS]})
    frame.to_csv(tmp_path / "run.csv", index=False)
    from_run = json.loads(pvid(tmp_path, "identify", "run.csv", "--rig", "rig.toml", "--json").stdout)
    for name, one in from_run["parameters"].items():  # a log keeps the encoder's step in float32
        assert abs(found["parameters"][name]["value"] - one["value"]) < 0.05 * one["se"]
    assert pvid(tmp_path, "compare", "a.pvlog").returncode == 0
    exported = pvid(tmp_path, "export", "a.pvlog", "--to", "npz", "-o", "b")
    assert (exported.returncode, exported.stdout) == (0, "b.npz\n")
    missing = pvid(tmp_path, "identify", "run.csv")
    assert (missing.returncode, missing.stderr.count("\n")) == (2, 1)
    assert "l1 [m] of the rig is missing" in missing.stderr


def test_an_exported_segment_without_gaps_is_a_run(tmp_path: Path, log: Path) -> None:
    whole = tmp_path / "one.pvlog"
    data = log.read_bytes()
    cut = data.index(b"the end")
    whole.write_bytes(data[: data.index(b"\0", cut) + 1])
    (path,) = export_log(whole, "npz", tmp_path / "one", field_board.mechanism())
    assert len(read_run(path, 1000.0)) == TICKS
    export_log(whole, "csv", tmp_path / "one", field_board.mechanism())
    assert len(read_run(tmp_path / "one-samples.csv", 1000.0)) == TICKS


# ---- the tee


@pytest.fixture
def listener() -> socket.socket:
    """A UDP socket on this machine."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind(("127.0.0.1", 0))
    one.settimeout(5)
    return one


def teed(scheme: str, listener: socket.socket, sent: list[tuple[int, link.Message]]) -> list[bytes]:
    tee = live_stream(f"{scheme}://127.0.0.1:{listener.getsockname()[1]}", field_board.mechanism())
    stream = LogStream()
    listener.settimeout(0)
    got = []
    for record in stream.feed(b"".join(field_board.frames(sent))):
        tee.take(record, stream.account)
        tee.idle(stream.account)
        with contextlib.suppress(BlockingIOError):
            while True:
                got.append(listener.recv(1 << 16))
    tee.close(stream.account)
    assert max(map(len, got)) <= 1432  # what Teleplot's page gives for a local network; PlotJuggler takes 2048
    return got


def test_the_tee_sends_json(listener: socket.socket, sent: list[tuple[int, link.Message]]) -> None:
    got = [json.loads(one) for one in teed("udp", listener, sent[:40])]
    samples = [one for one in got if "samples" in one]
    n = len(samples)
    assert n > 100
    assert [one["tick"] for one in samples] == list(range(n))
    assert [[one["samples"]["phi"], one["samples"]["y"]] for one in samples] == expected_samples()[:n].tolist()
    assert all(b["timestamp"] > a["timestamp"] for a, b in pairwise(samples))
    estimate = next(one["estimates"] for one in got if "estimates" in one)
    assert {"w", "w_se", "g", "kappa"} <= set(estimate) and "reason" not in estimate


def as_teleplot_reads(datagram: bytes) -> Iterator[tuple[str, float, float, str]]:
    """Name, time [s], value, unit, by the rules of its parser (teleplot-js, parseVariablesData)."""
    for line in datagram.decode().split("\n"):
        name, colon, rest = line.partition(":")
        assert colon and not set(name) & set(":|,") and not line.startswith((">", "|", "3D|"))
        values, _, unit = rest.partition("§")
        assert not set(unit) & set(",;:|.")
        for one in values.split(";"):
            when, value = one.split(":")
            yield name, float(when) / 1000, float(value), unit


def test_the_tee_speaks_teleplot(listener: socket.socket, sent: list[tuple[int, link.Message]]) -> None:
    got = [one for datagram in teed("teleplot", listener, sent[:40]) for one in as_teleplot_reads(datagram)]
    angles = [one for one in got if one[0] == "samples.phi"]
    expected = expected_samples()[: len(angles), 0]
    assert len(angles) > 100 and [one[2] for one in angles] == expected.tolist()
    assert {one[3] for one in angles} == {"rad"}
    assert np.diff([one[1] for one in angles]) == pytest.approx(np.full(len(angles) - 1, 1e-3), abs=1e-6)
    units = {name: unit for name, _, _, unit in got}
    assert (units["samples.y"], units["estimates.w"], units["estimates.kappa"]) == ("m", "1/s^2", "")
    assert {"estimates.g", "estimates.g_se", "samples.t"} <= set(units)


def test_teleplots_times_have_all_digits_at_any_rate(listener: socket.socket) -> None:
    hello = link.Hello(1, 0, 4, 0, 0, 7, 16_000.0, 1e-4, 1e-6, (1.0,) * 8, "fast")
    raw = link.Raw.of_values(np.arange(40), np.arange(40))
    got = [one for data in teed("teleplot", listener, [(0, hello), (0, raw)]) for one in as_teleplot_reads(data)]
    times = [when for name, when, _, _ in got if name == "samples.phi"]
    assert len(times) == 40 and np.diff(times) == pytest.approx(np.full(39, 62.5e-6), abs=1e-6)


def test_missing_listener_is_ignored_and_bad_address_reported(sent: list[tuple[int, link.Message]]) -> None:
    free = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
    free.close()
    tee, stream = live_stream(f"udp://127.0.0.1:{port}"), LogStream()
    for record in stream.feed(b"".join(field_board.frames(sent[:40]))):
        tee.take(record, stream.account)
    tee.close(stream.account)
    for bad in ("udp://host", "tcp://127.0.0.1:1", "nonsense", "udp://:5", "udp://127.0.0.1:99999"):
        with pytest.raises(PvidError, match="is no address to send to"):
            live_stream(bad)
