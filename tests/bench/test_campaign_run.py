"""A whole campaign: through the command line, interrupted, resumed, and on a scheduler that is or is not there."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow.parquet
import pytest
from processes import heed_interrupts
from program import pvid

from bench.campaign.judge import COLUMNS, Record, identify_rig
from bench.campaign.population import parse
from bench.campaign.run import Campaign, run
from bench.campaign.store import Store
from bench.campaign.truth import simulate_rig
from pvid.base.cluster import _distributed
from pvid.base.errors import PvidError
from pvid.core.native import Native

SMALL = """
[base]
duration = [5.0, 8.0]
sample_rate = [250, 500]
l1 = [0.2, 0.4]

[conditions.clean]

[conditions.skew]
skew = [2e-4, 3e-3]
"""


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "pvid", "campaign", *map(str, arguments)]


def called(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return pvid(Path.cwd(), "campaign", *arguments)


@pytest.fixture
def population(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


@contextmanager
def worker_that_must_not_start(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def refuse(*_: object) -> None:
        raise AssertionError("something was computed")

    with monkeypatch.context() as patched:
        patched.setattr("bench.campaign.run.client", refuse)
        yield


def test_four_rigs_through_the_command_line(population: Path, native: Native, tmp_path: Path) -> None:
    out = tmp_path / "results.parquet"
    done = called(population, "--rigs", "4", "--seed", "3", "--workers", "2", "--by", "sample_rate", "-o", out)
    assert done.returncode == 0, done.stderr
    assert "| clean " in done.stdout and "| skew " in done.stdout and "| sample_rate " in done.stdout
    assert done.stdout.splitlines()[-1].startswith("answered ")
    rows = pyarrow.parquet.read_table(out).to_pylist()
    assert [row["rig"] for row in rows] == [0, 1, 2, 3] and {row["condition"] for row in rows} == {"clean", "skew"}
    # what a worker found is what this process finds
    expected, _ = identify_rig(simulate_rig(native, parse(SMALL), 3, 2))
    found = {name: rows[2][name] for name in COLUMNS}
    assert {**found, "seconds": 0} == {**expected, "seconds": 0}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results.parquet", "small.toml"]


def test_an_interrupted_campaign_keeps_its_records_and_goes_on(population: Path, tmp_path: Path) -> None:
    out, partial = tmp_path / "results.parquet", tmp_path / "results.partial.jsonl"
    arguments = (population, "--rigs", "300", "--workers", "2", "-o", out)
    with subprocess.Popen(
        command(*arguments), stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=heed_interrupts
    ) as process:
        deadline = time.monotonic() + 180
        while time.monotonic() < deadline and not (partial.exists() and partial.read_bytes().count(b"\n") >= 1):
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=180)
    assert process.returncode == 130
    assert "the same command goes on" in " ".join(told.split())
    assert not out.exists()
    kept = partial.read_text().splitlines()
    assert 1 <= len(kept) < 300
    again = called(population, "--rigs", "4", "--workers", "1", "-o", out)
    assert again.returncode == 0 and "of 4 rigs are done already" in again.stderr
    times = {row["rig"]: row["seconds"] for row in pyarrow.parquet.read_table(out).to_pylist()}
    before = {record["rig"]: record["seconds"] for record in map(json.loads, kept)}
    resumed = set(times) & set(before)
    assert resumed and all(times[rig] == before[rig] for rig in resumed)


def record(rig: int) -> Record:
    made: Record = {name: kind() for name, kind in COLUMNS.items()}
    made.update(rig=rig)
    return made


def test_records_that_are_there_are_not_computed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign = Campaign(parse(SMALL), 3)
    store = Store(tmp_path / "r.parquet", campaign.key)
    for rig in range(3):
        store.add(record(rig))
    with worker_that_must_not_start(monkeypatch):
        again = Store(tmp_path / "r.parquet", campaign.key)
        assert run(campaign, again, lambda done: None) == [record(rig) for rig in range(3)]
        assert not again.partial.exists()
        # from the finished file, too
        assert len(run(campaign, Store(tmp_path / "r.parquet", campaign.key), lambda done: None)) == 3


def test_records_of_other_settings_are_left_out(tmp_path: Path) -> None:
    population = parse(SMALL)
    first = Campaign(population, 3)
    others = [
        Campaign(population, 3, seed=2),
        Campaign(population, 3, core="q31"),
        Campaign(population, 3, refine=False),
        Campaign(parse(SMALL + "share = 2\n"), 3),
    ]
    keys = {campaign.key for campaign in (first, *others)}
    assert len(keys) == 5
    assert Campaign(population, 7, cache=tmp_path).key == first.key
    store = Store(tmp_path / "r.parquet", first.key)
    store.add(record(0))
    other = Store(tmp_path / "r.parquet", others[0].key)
    assert not other.records and other.foreign == 1


def test_a_line_that_was_cut_off_is_no_record(tmp_path: Path) -> None:
    store = Store(tmp_path / "r.parquet", "key")
    store.add(record(0))
    with store.partial.open("ab") as file:
        file.write(b'{"key": "key", "rig": 1, "se')
    again = Store(tmp_path / "r.parquet", "key")
    assert set(again.records) == {0}
    again.add(record(2))
    assert set(Store(tmp_path / "r.parquet", "key").records) == {0, 2}


def test_other_files_are_not_overwritten(tmp_path: Path) -> None:
    other = tmp_path / "other.parquet"
    other.write_bytes(b"not parquet")
    with pytest.raises(PvidError, match="is not a Parquet file"):
        Store(other, "key")
    pyarrow.parquet.write_table(pyarrow.table({"phi": [1.0]}), other)
    with pytest.raises(PvidError, match="not a campaign's result"):
        Store(other, "key")
    with pytest.raises(PvidError, match=r"name the file with \.parquet"):
        Store(tmp_path / "results.csv", "key")
    with pytest.raises(PvidError, match="there is no folder"):
        Store(tmp_path / "nowhere" / "results.parquet", "key")


def test_a_scheduler_that_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pvid.base.cluster._CONNECT_S", 0.5)
    for address in ("tcp://127.0.0.1:1", "nonsense://x", "127.0.0.1:notaport"):
        store = Store(tmp_path / "r.parquet", "key")
        with pytest.raises(PvidError, match="no scheduler of dask.distributed can be reached at"):
            run(Campaign(parse(SMALL), 1), store, lambda done: None, scheduler=address)


def test_a_running_scheduler_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with _distributed().LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        host="127.0.0.1",
        dashboard_address=None,
        protocol="tcp",
        local_directory=tmp_path / "dask",
    ) as cluster:
        campaign = Campaign(parse(SMALL), 2)
        store = Store(tmp_path / "r.parquet", campaign.key)
        done = run(campaign, store, lambda _: None, scheduler=cluster.scheduler_address)
        assert [one["rig"] for one in done] == [0, 1]
        # it runs on, and refuses nobody: but a worker of another version is told apart
        monkeypatch.setattr("bench.campaign.run.code_version", iter(["x" * 16, *["y" * 16] * 9]).__next__)
        with pytest.raises(PvidError, match="another version of pvid"):
            run(campaign, Store(tmp_path / "other.parquet", "key"), lambda _: None, scheduler=cluster.scheduler_address)


def test_scheduler_without_workers_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pvid.base.cluster._WORKERS_S", 0.3)
    with _distributed().LocalCluster(
        n_workers=0, processes=False, host="127.0.0.1", dashboard_address=None, protocol="tcp"
    ) as cluster:
        with pytest.raises(PvidError, match="has no worker"):
            store = Store(tmp_path / "r.parquet", "key")
            run(Campaign(parse(SMALL), 1), store, lambda _: None, scheduler=cluster.scheduler_address)


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (("--by", "colour", "-o", "r.parquet"), "--by colour: not a property; there are sample_rate"),
        (("nowhere.toml", "-o", "r.parquet"), "nowhere.toml: cannot be read"),
        (("-o", "results.csv"), "name the file with .parquet"),
        (("--rigs", "0", "-o", "r.parquet"), "--rigs"),
    ],
)
def test_bad_input_is_one_sentence(arguments: tuple[str, ...], wanted: str) -> None:
    done = called(*arguments)
    assert done.returncode == 2 and wanted in done.stderr and "Traceback" not in done.stderr
