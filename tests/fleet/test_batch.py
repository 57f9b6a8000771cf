"""`pvid batch`: a row for each recording, whatever it contains; resumed; a page that names what drifts."""

import os
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote

import numpy as np
import pyarrow.parquet
import pytest
from click.testing import CliRunner
from conftest import ROOT
from fleet_rows import row
from own_mechanisms import OWN, own_recording
from pendulum_plant import simulate, standard_sensors
from program import pvid

from pvid.base.cluster import _distributed
from pvid.base.console import CHANGED, DONE, NOTHING_IDENTIFIED
from pvid.base.errors import PvidError
from pvid.cli.batch import _files, command
from pvid.cli.main import commands
from pvid.fleet import run as fleet
from pvid.fleet.page import Fleet
from pvid.fleet.row import EQUAL, Question, Row, row_of
from pvid.fleet.store import Store, read_rows

LOG = ROOT / "tests" / "data" / "logs" / "two_samples.pvlog"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two folders, of one run each, and a table that is none."""
    top = tmp_path_factory.mktemp("fleet")
    for seed, name in ((1, "a"), (2, "b")):
        run = simulate(sensors=standard_sensors(14), truth="full", duration=8.0, seed=seed).run
        (top / name).mkdir()
        np.savez(top / name / "run.npz", t=run.t, phi=run.phi, y=run.y)
    (top / "b" / "broken.csv").write_text("t,phi,y\n0,one,two\n")
    return top


@contextmanager
def here(*_: object) -> Iterator[None]:
    """In place of the worker processes: this one."""
    yield None


@pytest.fixture
def inline(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The paths that are worked on, in this process."""
    done: list[str] = []

    def each(_: Any, work: Callable[..., Row], items: list[str], **fixed: Any) -> Iterator[Row]:
        for item in items:
            done.append(item)
            yield work(item, **fixed)

    monkeypatch.setattr(fleet, "client", here)
    monkeypatch.setattr(fleet, "each", each)
    return done


def asked(**keys: Any) -> Question:
    return Question(settings={"l1": "0.3"}, **keys)


def test_a_name_that_is_no_utf_8_is_written_escaped(tmp_path: Path) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b"/r\xffun.csv")
    Path(path).write_text("no run\n")
    words = [path, "-o", str(tmp_path / "rows.parquet"), "--workers", "1"]
    done = CliRunner().invoke(command, words, standalone_mode=False)
    assert done.return_value == 3, done.exception
    (row,) = read_rows(tmp_path / "rows.parquet")
    assert row.path.endswith("r\\udcffun.csv") and row.failure
    assert "r\\udcffun.csv" in (tmp_path / "rows.html").read_text(encoding="utf-8")


def test_three_files_through_the_command_line(runs: Path, tmp_path: Path) -> None:
    out = tmp_path / "fleet.parquet"
    (runs / "a" / "photo.png").write_text("of nobody")
    done = pvid(tmp_path, "batch", str(runs), "-o", str(out), "--set", "l1=0.3", "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert ": 2 of 3" in done.stdout and "failed: 1 of 3" in done.stdout
    assert "broken.csv, line 2, column y" in done.stderr
    table = pyarrow.parquet.read_table(out)
    rows = {f"{Path(row['board']).name}/{Path(row['path']).name}": row for row in table.to_pylist()}
    assert set(rows) == {"a/run.npz", "b/run.npz", "b/broken.csv"}
    good = rows["a/run.npz"]
    assert good["identified"] and good["samples"] == 8000
    assert abs(good["g"] - 9.5) < 5 * good["g_se"] and table.schema.field("g").metadata[b"unit"] == b"m/s^2"
    assert 0.9 < good["predicted"] <= 1 and rows["b/broken.csv"]["predicted"] is None
    assert rows["b/broken.csv"]["g"] is None and rows["b/broken.csv"]["identified"] is None
    assert "<svg" in (tmp_path / "fleet.html").read_text() and not (tmp_path / "fleet.partial.jsonl").exists()


def test_the_workers_of_a_running_scheduler_do_the_work(runs: Path, tmp_path: Path) -> None:
    broken = str(runs / "b" / "broken.csv")
    with _distributed().LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        host="127.0.0.1",
        dashboard_address=None,
        protocol="tcp",
        local_directory=tmp_path / "dask",
    ) as cluster:
        store = Store(tmp_path / "fleet.parquet")
        (row,) = fleet.run([broken], asked(), store, lambda _: None, scheduler=cluster.scheduler_address)
    assert "line 2, column y" in (row.failure or "")


def test_an_interrupted_batch_goes_on_and_a_changed_file_is_done_again(tmp_path: Path, inline: list[str]) -> None:
    """Of a model file of one's own."""
    recording, question = own_recording("heated_plate"), Question(model=str(OWN["heated_plate"].path))
    paths = [str(tmp_path / "a.npz"), str(tmp_path / "b.npz")]
    for path, first in zip(paths, (0, 100), strict=True):
        np.savez(path, t=recording.t[first:], P=recording.signals["P"][first:], T=recording.signals["T"][first:])
    out = tmp_path / "fleet.parquet"
    store = Store(out)
    store.add(row_of(paths[0], question))
    with store.partial.open("ab") as file:
        file.write(b'\n{"key": "cut o')
    job: Any = SimpleNamespace(out=out, question=question)
    assert _files((str(tmp_path),), job) == paths  # the rows so far are no recording
    found = fleet.run(paths, question, Store(out), lambda _: None)
    assert inline == paths[1:] and [row.path for row in found] == paths and found == read_rows(out)
    shutil.copy(out, tmp_path / "of another day.parquet")
    assert _files((str(tmp_path),), job) == paths
    assert all(row.failure is None for row in found)
    shutil.copy(paths[1], paths[0])
    fleet.run(paths, question, Store(out), lambda _: None)
    assert inline == [paths[1], paths[0]]
    fleet.run(paths, replace(question, core="q31"), Store(out), lambda _: None)
    assert inline[2:] == paths


def test_a_lacking_writer_is_no_news_for_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ModuleNotFoundError, match="pyarrow"):
        Store(tmp_path / "fleet.parquet")


def test_a_log_is_identified_and_verified_or_says_why_not() -> None:
    row = row_of(str(LOG), asked())
    assert row.failure is not None or row.verified is not None
    assert row.board.endswith(str(LOG.parent)) and row.began > 0


def test_what_is_not_there_has_a_row_too(tmp_path: Path) -> None:
    row = row_of(str(tmp_path / "nowhere.csv"), asked())
    assert row.failure is not None and "No such file" in row.failure and row.identified is None


def test_a_report_of_each_recording_is_linked_and_written_again_where_it_is_gone(
    tmp_path: Path, inline: list[str]
) -> None:
    recording, model = own_recording("heated_plate"), str(OWN["heated_plate"].path)
    name = "a <b> & c.npz"
    np.savez(tmp_path / name, t=recording.t, P=recording.signals["P"], T=recording.signals["T"])
    (tmp_path / "broken.csv").write_text("t,P,T\n0,one,two\n")
    words = ["batch", str(tmp_path / name), str(tmp_path / "broken.csv"), "-o", str(tmp_path / "fleet.parquet")]
    words += ["--model", model, "--report", str(tmp_path / "reports"), "--workers", "1"]
    for _ in range(3):
        done = CliRunner().invoke(commands, words, standalone_mode=False, catch_exceptions=False)
        assert done.return_value == DONE
        text = (tmp_path / "fleet.html").read_text()
        (link,) = re.findall(r'<a href="([^"]*)">([^<]*a &lt;b&gt; &amp; c.npz)</a>', text)
        report = tmp_path / unquote(link[0])
        assert report.parent == tmp_path / "reports" and "Heated plate" in report.read_text()
        if len(inline) == 3:
            report.unlink()
    done_of_it = [one for one in inline if one.endswith(name)]
    assert len(done_of_it) == 2  # the second call found its report, the third did not


def test_outcomes_are_counted() -> None:
    good = row("a", 1, 9.5)
    rows = [
        good,
        replace(good, verdict="usable", warning="w"),
        replace(good, verdict="not_identified", identified=False),
        replace(good, failure="f", verdict=None, identified=None),
    ]
    rows += [replace(good, verified=EQUAL), replace(good, verified="DIFFERENT at p")]
    assert Fleet.of(rows).counts == {
        "good": 3,
        "usable": 1,
        "not_identified": 1,
        "failed": 1,
        "logs that are not equal": 1,
    }


@pytest.mark.parametrize("name", ["rows.csv", "nowhere/rows.parquet"])
def test_an_output_that_cannot_be_is_refused_before_any_work(tmp_path: Path, name: str) -> None:
    with pytest.raises(PvidError):
        Store(tmp_path / name)


def test_a_foreign_file_is_not_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "rows.parquet"
    out.write_bytes(b"mine")
    with pytest.raises(PvidError, match="is not a Parquet file"):
        Store(out)
    pyarrow.parquet.write_table(pyarrow.table({"x": [1]}), out)
    with pytest.raises(PvidError, match="was not written by pvid batch"):
        Store(out)


def test_wrong_usage_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments, words in (
        (["none/*.csv"], "no file has such a name"),
        (["."], "no file in this folder can be a recording"),
        (["a.csv", "--set", "l1"], "write KEY=VALUE"),
    ):
        with pytest.raises(PvidError, match=words):
            command.main([*arguments, "-o", "x.parquet"], standalone_mode=False)
    assert os.listdir(tmp_path) == []


SPRING = """
from pvid.model import Model
model = Model("mass on a spring")
F = model.input("F", "N", hold="zoh", reach=5)
x = model.sensor("x", "m", resolution=1e-5, reach=0.1)
m, b, k = model.unknown("m", "kg", 1.0), model.unknown("b", "N*s/m", 1.0), model.unknown("k", "N/m", 50.0)
model.equation(m * x.d(2) + b * x.d() + k * x - F)
"""


def test_recordings_of_a_folder_are_identified_together(tmp_path: Path) -> None:
    model = tmp_path / "spring.py"
    model.write_text(SPRING)
    for folder, seeds in {"a": (1, 2), "b": (3,)}.items():
        (tmp_path / folder).mkdir()
        for seed in seeds:
            given = ("--duration", "6", "--rate", "500", "--seed", str(seed))
            place = str(tmp_path / folder / f"s{seed}.csv")
            CliRunner().invoke(commands, ["model", "simulate", str(model), place, *given], catch_exceptions=False)
    asked_for = ("--model", str(model), "-o", str(tmp_path / "fleet.parquet"), "--workers", "1", "--together")
    batch = [str(tmp_path / "*" / "*.csv"), *asked_for, "--own", "m"]
    assert CliRunner().invoke(command, batch, standalone_mode=False).return_value == DONE
    rows = {Path(one.path).name: one for one in read_rows(tmp_path / "fleet.parquet")}
    assert set(rows) == {"a", "b"} and all(one.identified for one in rows.values())
    assert {"m[s1]", "m[s2]", "b", "k"} == set(rows["a"].parameters) and set(rows["b"].parameters) == {"m", "b", "k"}
    assert (rows["a"].samples or 0) > 2 * (rows["b"].samples or 1)


def test_a_folder_with_a_new_recording_is_identified_again(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.csv", "b.csv")]
    for path in paths:
        path.write_text("t,phi,y\n")
    keys = {asked().key(*paths[:count]) for count in (1, 2)}
    assert len(keys) == 2 and asked().key(*paths) in keys


def test_own_parameters_need_recordings_together(tmp_path: Path) -> None:
    refused = CliRunner().invoke(command, ["x.csv", "-o", str(tmp_path / "f.parquet"), "--own", "m"])
    assert isinstance(refused.exception, PvidError) and "--together" in str(refused.exception)


def test_a_folder_is_watched(tmp_path: Path, inline: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording is taken once it is whole, each once; one more jumps: said, and the exit code at the end."""
    folder, out = tmp_path / "runs", tmp_path / "runs" / "rows.parquet"
    folder.mkdir()

    def work(_: Any, work: object, items: list[str], question: Question) -> Iterator[Row]:
        for item in items:
            inline.append(Path(item).name)
            size, value = len(Path(item).read_text()), float(Path(item).stem)
            made = row("b", value, 9.5 if value < 6 else 10.5)
            yield replace(made, key=question.key(Path(item)), path=item, samples=size)

    def wait(_: float) -> None:
        for action in rounds.pop(0):
            action()

    def write(name: str, text: str) -> Callable[[], object]:
        return lambda: (folder / name).write_text(text)

    def end() -> None:
        raise KeyboardInterrupt

    rounds: list[list[Callable[[], object]]] = [[write(f"{k}.csv", "t") for k in range(6)], []]
    rounds += [[write("6.csv", "t")], [write("6.csv", "t,V")], [], [end]]
    monkeypatch.setattr(fleet, "each", work)
    monkeypatch.setattr("pvid.cli.batch.time.sleep", wait)
    done = CliRunner().invoke(commands, ["watch", str(folder), "-o", str(out)], standalone_mode=False)
    assert done.return_value == CHANGED, done.exception
    assert inline == [f"{k}.csv" for k in range(7)] and read_rows(out)[-1].samples == 3
    assert done.stdout.count(f"changed: {folder}: g rose by 11 % (9.50 to 10.50 m/s²) between 6 and 7 January") == 1
    assert 'http-equiv="refresh" content="10"' in out.with_suffix(".html").read_text()


def test_a_folder_without_recordings_is_watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def end(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pvid.cli.batch.time.sleep", end)
    words = ["watch", str(tmp_path), "-o", str(tmp_path / "rows.parquet")]
    done = CliRunner().invoke(commands, words, standalone_mode=False)
    assert done.return_value == NOTHING_IDENTIFIED and "no recording came" in done.stdout
    nowhere = CliRunner().invoke(commands, [*words[:1], str(tmp_path / "nowhere"), *words[2:]], standalone_mode=False)
    assert isinstance(nowhere.exception, PvidError) and "no such folder" in str(nowhere.exception)
