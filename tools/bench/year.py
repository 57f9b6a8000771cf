"""A year in the field: a board whose tick counter passes 2^32 again and again is recorded, verified, exported, drawn.

Nobody waits for a year: each session's counter is started shortly before it passes (Configure.first_tick), so that the
firmware itself, the link and all that reads the log see every passage of a year at 1 kHz.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.case import Advance, Report, counts
from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.board.mechanism_board import board_of_guess
from pvid.board.stream_image import settings_number
from pvid.board.target import HOST_TARGET, open_target
from pvid.link.frames import Configuration, Raw, RawCount, Source
from pvid.log.export import FORMATS, export_log
from pvid.log.file import Segment
from pvid.log.mechanism import LogMechanism
from pvid.log.reader import Account, LogReader
from pvid.log.recorder import EmulatorSource, Logger
from pvid.log.rig import mechanism_in
from pvid.log.values import Rows, Values
from pvid.log.verify import Verdict, Verifier
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.enums import Core
from pvid.show.log_figure import write_log_figure
from pvid.show.page_state import LiveState

TURN = 1 << 32
_SOON_NS = 600 * 10**9  # from the link's coming up to the first sample
YEAR_S = 365.25 * 86_400


@dataclass(frozen=True)
class Year:
    """What became of the recording. `faults` are sentences, none where all is well."""

    account: Account
    verdict: Verdict
    passages: int
    faults: tuple[str, ...]


def passages_of_a_year(sample_rate: float) -> int:
    """How often the low 32 bits of the tick pass 2^32 in a year."""
    return int(YEAR_S * sample_rate / TURN)


def emulated_year(
    name: str,
    passages: tuple[int, ...],
    samples: int,
    log: Path,
    rig: MechanismRig,
    core: Core,
    progress: Callable[[int], None] | None = None,
) -> Year:
    """Records, verifies, exports and draws passages of 2^32 ticks.

    Parameters
    ----------
    name
        Of the emulator, or stream-host.
    passages
        Which of them, from 1: the tick passes that many times 2^32.
    rig, core
        The board's.
    samples
        At least so many at each passage; the counter starts half of them before it.
    log
        Where; what it is exported to comes beside it.
    progress
        Called with the ticks verified so far.

    Raises
    ------
    PvidError
        When the recording fails.
    """
    if rig.sample_rate is None:
        raise PvidError("the rig file has no sample_rate")
    board = board_of_guess(rig, core)
    mechanism = mechanism_in(toml_document(board.text()))
    assert mechanism is not None
    settings = settings_number(board)
    every = max(1, round(rig.sample_rate / 10))
    source = Source.SENSOR if name == HOST_TARGET else Source.SENSOR_PACED  # this machine sends a hundred times as many

    def configure(passage: int) -> Configuration:
        return board.configure(settings, every, every, source, passage * TURN - samples // 2)

    for passage in passages:
        Logger(
            source=EmulatorSource(name, lambda: open_target(name, board)),
            out=log,
            rig=board.text(),
            append=True,
            samples=samples,
            begin=lambda passage=passage: configure(passage),  # type: ignore[misc]
            restart=True,
        ).run()
    verdict = Verdict()
    reader = LogReader(log)
    for stretch in Verifier(board, progress).stretches(reader):
        verdict.add(stretch)
    crossed = [*_crossed(log)]
    faults = [] if crossed == [*passages] else [f"passages {crossed} of {[*passages]} are in the log"]
    if verdict.different or verdict.left:
        faults.append(verdict.text)
    if reader.account.missing_samples or reader.account.restarts:
        faults.append(reader.account.text)
    faults += _faults_of_board(log)
    faults += _faults_of_times(log, mechanism, rig.sample_rate)
    faults += _faults_of_exports(log, mechanism)
    faults += _faults_of_page(log)
    write_log_figure(log, mechanism, log.with_suffix(".png"))
    return Year(reader.account, verdict, len(crossed), tuple(faults))


def _crossed(log: Path) -> Iterator[int]:
    """Every passage with samples on both sides, in one row."""
    before: tuple[int, int] | None = None  # segment and tick behind the last sample
    for record in LogReader(log):
        if isinstance(record.item, Raw | RawCount):
            first = record.tick if before != (record.segment, record.tick) else record.tick - 1
            before = record.segment, record.tick + record.item.count
            if (before[1] - 1) // TURN > first // TURN:
                yield (before[1] - 1) // TURN


def _samples(log: Path, mechanism: LogMechanism) -> Iterator[Rows]:
    values = Values(mechanism)
    for record in LogReader(log):
        for rows in values.rows(record):
            if rows.table == "samples":
                yield rows


def _faults_of_board(log: Path) -> Iterator[str]:
    """Of the firmware: the upper bits of the tick in every frame, also of samples on both sides of a passage."""
    for record in LogReader(log):
        high = getattr(record.item, "tick_high", None)
        if high is not None and high != record.tick // TURN:
            yield f"a frame of tick {record.tick} has the upper bits {high}"


def _began(log: Path, number: int) -> int:
    """Unix time of a segment [ns]."""
    found = (record for record in LogReader(log) if isinstance(record.item, Segment))
    return next(record.unix_ns for record in found if record.segment == number)


def _faults_of_times(log: Path, mechanism: LogMechanism, rate: float) -> Iterator[str]:
    """Of the columns that exports, views and tee share: a step of a tick in t and in log_time, within a segment."""
    latest: dict[str, int | float] = {}
    for rows in _samples(log, mechanism):
        columns = rows.columns
        if not np.array_equal(columns["t"], columns["tick"] / rate):
            yield f"t is no multiple of a tick at tick {columns['tick'][0]}"
        same = latest.get("segment") == columns["segment"][0]
        for name, step in (("tick", 1), ("t", 1 / rate), ("log_time", 1e9 / rate)):
            column = columns[name] if not same else np.concatenate([[latest[name]], columns[name]])
            if np.any(np.abs(np.diff(column) - step) > 0.01 * step):
                yield f"{name} does not go on by a tick at tick {columns['tick'][0]}"
            latest[name] = columns[name][-1]
        if not same and abs(int(columns["log_time"][0]) - _began(log, int(columns["segment"][0]))) > _SOON_NS:
            yield f"log_time of segment {columns['segment'][0]} begins at {columns['log_time'][0]}"
        latest["segment"] = columns["segment"][-1]


def _faults_of_exports(log: Path, mechanism: LogMechanism) -> Iterator[str]:
    """Of every format: the ticks of the samples that stand in it."""
    expected = np.concatenate([rows.columns["tick"] for rows in _samples(log, mechanism)])
    for form, read in {"csv": _ticks_of_csv, "npz": _ticks_of_npz, "parquet": _ticks_of_parquet, "mcap": _mcap}.items():
        files = export_log(log, form, log.with_suffix(""), mechanism)
        if not np.array_equal(read(files), expected):
            yield f"{form} has other ticks than the log"
    if set(FORMATS) != {"csv", "npz", "parquet", "mcap"}:
        yield f"formats that nobody looked at: {sorted(FORMATS)}"


def _of_samples(files: list[Path]) -> Path:
    return next(one for one in files if "samples" in one.name)


def _ticks_of_csv(files: list[Path]) -> Any:
    with _of_samples(files).open(newline="") as file:
        return np.array([int(row["tick"]) for row in csv.DictReader(file)])


def _ticks_of_npz(files: list[Path]) -> Any:
    with np.load(files[0]) as arrays:
        return arrays["tick"]


def _ticks_of_parquet(files: list[Path]) -> Any:
    from pyarrow import parquet

    return parquet.read_table(_of_samples(files), columns=["tick"])["tick"].to_numpy()


def _mcap(files: list[Path]) -> Any:
    from mcap.reader import make_reader

    with files[0].open("rb") as file:
        found = make_reader(file).iter_messages(topics=["/samples"], log_time_order=False)
        return np.array([json.loads(message.data)["tick"] for _, _, message in found])


def _faults_of_page(log: Path) -> Iterator[str]:
    """Of the live page: a time axis that goes on through the last passage."""
    state = LiveState(log, "a year")
    state.take(log.read_bytes())
    for curve in json.loads(state.as_json())["motion"]:
        t = curve["t"]
        if not t or np.any(np.diff(t) < 0) or t[-1] == t[0]:
            yield f"the page's time axis of {curve['label']} does not go on"


def report(on: str, core: Core, samples: int, out: Path, advance: Advance) -> Report:
    """See bench.case."""
    if out.exists():
        raise PvidError(f"{out} exists")
    rig = MechanismRig("kapitza", 1000.0, known={"l1": 0.3})
    passages = tuple(range(1, 1 + passages_of_a_year(1000.0)))
    year = emulated_year(on, passages, samples, out, rig, core, lambda _: advance())
    numbers = (
        ("passages of 2^32 ticks", year.passages),
        ("samples verified", year.verdict.verified),
        ("faults", len(year.faults)),
    )
    faults = [*year.faults, *([] if year.verdict.verified else ["no sample is verified"])]
    return Report([counts(f"year-{core}", numbers)], faults, [year.verdict.text, year.account.text])
