"""`pvid batch` and `pvid watch`: the recordings of a fleet, once and as they come."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pvid.base.atomic_write import write_whole
from pvid.base.console import CHANGED, DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.base.replacing import refuse_foreign
from pvid.cli.input import NewFile, columns_option, force_option, listed_names, model_option, rig_options

if TYPE_CHECKING:
    from pvid.fleet.page import Fleet
    from pvid.fleet.row import Question

_SHOWN = 20  # failures, boards

_OPTIONS = (
    click.option("-o", "--out", required=True, type=click.Path(path_type=Path), help="Parquet file, a row a file."),
    model_option,
    click.option("--core", type=click.Choice(["f32", "q31", "f64"]), help="Arithmetic.  [default: f64]"),
    columns_option,
    rig_options,
    click.option("--together", is_flag=True, help="Identify the FILEs of one folder together: a row a folder."),
    click.option("--own", metavar="NAME,...", multiple=True, help="With --together: as of identify."),
    click.option("--shared", metavar="NAME,...", multiple=True, help="With --together: as of identify."),
    click.option("--no-verify", is_flag=True, help="Do not compute logs again with the twin."),
    click.option(
        "--alarm",
        metavar="PERCENT",
        type=click.FloatRange(0),
        default=1.0,
        show_default=True,
        help="Change of a parameter from which on it is an alarm.",
    ),
    click.option("--page", type=NewFile(), help="Page of the fleet.  [default: OUT with .html]"),
    click.option(
        "--report",
        "reports",
        metavar="FOLDER",
        type=click.Path(path_type=Path),
        help="Also write a report of each FILE.",
    ),
    click.option("--scheduler", metavar="ADDRESS", help="A running scheduler of dask.distributed (tcp://HOST:PORT)."),
    click.option("--workers", type=click.IntRange(1), help="Processes on this machine.  [default: one a processor]"),
    force_option,
)


def _options(command: Callable[..., int]) -> Callable[..., int]:
    for one in reversed(_OPTIONS):
        command = one(command)
    return command


@click.command(name="batch")
@click.argument("patterns", metavar="FILE...", nargs=-1, required=True)
@_options
def command(patterns: tuple[str, ...], **given: Any) -> int:
    """Identifies many runs and logs in parallel, verifies the logs, and writes one row for each FILE.

    pvid batch 'fleet/*/*.csv' --model dc_motor -o fleet.parquet

    FILE may be a pattern in quotes, 'runs/*.csv' or 'fleet/**/*.pvlog', or a folder: all recordings in it. A second
    call with the same -o computes only what is new or has changed, also after an interruption. The page shows what
    changed in the parameters of each board: a board is the USB serial number of a log; of a run its folder, or, of
    runs in one folder, what their names share without date and number: board3_2026-09-01.csv. With --report it has
    links to the reports of `identify`. With --together the FILEs of a folder are recordings of one mechanism, which
    are identified together.

    Exit code 1: a log is not equal to its twin. 4: a parameter changed by --alarm or more. 3: nothing was identified.
    """
    job = _Job.of(given, f"pvid batch {' '.join(patterns)}")
    paths = _files(patterns, job)
    fleet = job.done(paths)
    for name, count in fleet.counts.items():
        click.echo(f"{name}: {count} of {len(fleet.rows)}")
    boards = Counter(row.board for row in fleet.rows)
    more = f" and {len(boards) - _SHOWN} more" if len(boards) > _SHOWN else ""
    click.echo(f"boards: {', '.join(f'{one} ({count})' for one, count in [*boards.items()][:_SHOWN])}{more}")
    failures = [row for row in fleet.rows if row.failure is not None]
    for row in failures[:_SHOWN]:
        assert row.failure is not None
        write_stderr(f"pvid: {row.failure if row.path in row.failure else f'{row.path}: {row.failure}'}")
    if len(failures) > _SHOWN:
        write_stderr(f"pvid: {len(failures) - _SHOWN} more failures are in {job.page}")
    for line in _named(fleet):
        click.echo(line)
    click.echo(f"rows: {job.out}; page: {job.page}")
    return _code(fleet)


@click.command(name="watch")
@click.argument("folder", type=click.Path(path_type=Path))
@_options
@click.option(
    "--every", metavar="SECONDS", type=click.IntRange(1), default=10, show_default=True, help="To look again."
)
def watch(folder: Path, every: int, **given: Any) -> int:
    """Identifies the recordings of FOLDER as they come, and says what changed; until Ctrl-C.

    pvid watch motors --model dc_motor -o motors.parquet

    All else is as of `batch`. A file is read when it has not changed for --every seconds. The page loads itself again.

    Exit code, at the end: as of `batch`.
    """
    if not folder.is_dir():
        raise PvidError(f"{folder}: there is no such folder to watch")
    job = _Job.of(given, f"pvid watch {folder}", refresh=every)
    fleet: Fleet | None = None
    seen: dict[str, tuple[int, int]] = {}
    told: set[str] = set()
    try:
        for files in _settled(folder, job, every):
            if files == seen and fleet is not None:
                continue
            fleet = job.done(sorted(files)) if files else None
            new = [row for row in fleet.rows if files.get(row.path) != seen.get(row.path)] if fleet else []
            seen = files
            for row in new:
                click.echo(f"{row.path}: {row.failure or row.verdict}")
            lines = _named(fleet) if fleet else []
            for line in lines:
                if line not in told:
                    click.echo(line)
            told.update(lines)
    except KeyboardInterrupt:
        click.echo(f"rows: {job.out}; page: {job.page}" if fleet else f"{folder}: no recording came")
    return NOTHING_IDENTIFIED if fleet is None else _code(fleet)


@dataclass(frozen=True)
class _Job:
    """What is asked of recordings, and where it goes."""

    out: Path
    page: Path
    question: Question
    alarm: float
    words: str
    refresh: int
    run: Mapping[str, Any]

    @classmethod
    def of(cls, given: Mapping[str, Any], words: str, refresh: int = 0) -> _Job:
        """From the options.

        Raises PvidError where they do not go together, or a file of somebody else would be replaced.
        """
        from pvid.fleet.row import Question

        settings, out, rig, reports = given["settings"], given["out"], given["rig_path"], given["reports"]
        if wrong := [one for one in settings if "=" not in one]:
            raise PvidError(f"--set {wrong[0]}: write KEY=VALUE, as in --set l1=0.25")
        if (given["own"] or given["shared"]) and not given["together"]:
            raise PvidError("--own and --shared are of recordings that are identified --together")
        if not out.name:
            raise PvidError(f"{out}: -o is a Parquet file to write")
        page = given["page"] or out.with_suffix(".html")
        refuse_foreign(page)
        if reports is not None:
            reports.mkdir(parents=True, exist_ok=True)
        question = Question(
            model=given["model"],
            rig=None if rig is None else str(rig),
            columns=given["columns"],
            core=given["core"],
            settings=dict(one.split("=", 1) for one in settings),
            verify=not given["no_verify"],
            own=tuple(listed_names(given["own"])),
            shared=tuple(listed_names(given["shared"])),
            reports=None if reports is None else str(reports),
        )
        run = {name: given[name] for name in ("scheduler", "workers", "together")}
        return cls(out, page, question, given["alarm"] / 100, words, refresh, run)

    def done(self, paths: Sequence[str]) -> Fleet:
        """Identifies what is new, and writes rows and page."""
        from pvid.fleet.page import Fleet, page
        from pvid.fleet.run import run
        from pvid.fleet.store import Store

        with progress_bar("identifying", len(paths)) as advance:
            fleet = Fleet.of(run(paths, self.question, Store(self.out), advance, **self.run), self.alarm)
        write_whole(self.page, page(fleet, self.words, self.page.parent, refresh=self.refresh))
        return fleet


def _named(fleet: Fleet) -> list[str]:
    """A sentence on each alarm, and on each board that differs from all others."""
    from pvid.fleet.page import sentence

    changed = [f"changed: {sentence(*one)}" for one in fleet.changes(alarms=True)]
    return changed + [f"apart: {words}" for _, words in fleet.odd]


def _code(fleet: Fleet) -> int:
    """The exit code."""
    from pvid.fleet.row import EQUAL

    if any(row.verified not in (None, EQUAL) for row in fleet.rows):
        return DIFFERENT
    if fleet.changes(alarms=True):
        return CHANGED
    return DONE if any(row.identified for row in fleet.rows) else NOTHING_IDENTIFIED


def _settled(folder: Path, job: _Job, every: int) -> Iterator[dict[str, tuple[int, int]]]:
    """Recordings of a folder with their sizes and times, every so often, without those that are being written."""
    before: dict[str, tuple[int, int]] = {}
    while True:
        now: dict[str, tuple[int, int]] = {}
        for path in _recordings(folder, job):
            at = path.stat()
            now[str(path)] = (at.st_size, at.st_mtime_ns)
        old = time.time_ns() - every * 10**9
        yield {path: at for path, at in now.items() if before.get(path) == at or at[1] < old}
        before = now
        time.sleep(every)


def _recordings(folder: Path, job: _Job) -> Iterator[Path]:
    """Files of a folder that can be recordings, but for those that a batch writes."""
    from pvid.fleet.store import are_rows
    from pvid.log.rig import LOG_SUFFIX
    from pvid.rig.run import SUFFIXES

    own = {Path(one).resolve() for one in (job.out, job.question.reports) if one is not None}
    for path in folder.rglob("*"):
        whole = path.resolve()
        if path.name.lower().endswith((LOG_SUFFIX, *SUFFIXES)) and path.is_file():
            if own.isdisjoint([whole, *whole.parents]) and not are_rows(path):
                yield path


def _files(patterns: tuple[str, ...], job: _Job) -> list[str]:
    found: list[str] = []
    for pattern in patterns:
        here = sorted(one for one in glob(pattern, recursive=True) if Path(one).is_file()) if has_magic(pattern) else []
        if has_magic(pattern) and not here:
            raise PvidError(f"{pattern}: no file has such a name")
        if Path(pattern).is_dir():
            here = sorted(map(str, _recordings(Path(pattern), job)))
            if not here:
                raise PvidError(f"{pattern}: no file in this folder can be a recording")
        found += here or [pattern]
    return found
