"""`pvid batch`."""

from __future__ import annotations

from dataclasses import replace
from glob import glob, has_magic
from pathlib import Path
from typing import Any

import click

from pvid.base.atomic_write import write_whole
from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.base.replacing import refuse_foreign
from pvid.cli.input import NewFile, columns_option, force_option, listed_names, model_option, rig_options

_SHOWN = 20  # failures


@click.command(name="batch")
@click.argument("patterns", metavar="FILE...", nargs=-1, required=True)
@click.option(
    "-o", "--out", required=True, type=click.Path(path_type=Path), help="Parquet file to write, a row a file."
)
@model_option
@click.option("--core", type=click.Choice(["f32", "q31", "f64"]), help="Arithmetic.  [default: f64]")
@columns_option
@rig_options
@click.option("--together", is_flag=True, help="Identify the FILEs of one folder together: a row a folder.")
@click.option("--own", metavar="NAME,...", multiple=True, help="With --together: as of identify.")
@click.option("--shared", metavar="NAME,...", multiple=True, help="With --together: as of identify.")
@click.option("--no-verify", is_flag=True, help="Do not compute logs again with the twin.")
@click.option("--page", type=NewFile(), help="Summary page.  [default: OUT with .html]")
@click.option(
    "--report", "reports", metavar="FOLDER", type=click.Path(path_type=Path), help="Also write a report of each FILE."
)
@click.option("--scheduler", metavar="ADDRESS", help="A running scheduler of dask.distributed (tcp://HOST:PORT).")
@click.option("--workers", type=click.IntRange(1), help="Processes on this machine.  [default: one a processor]")
@force_option
def command(
    patterns: tuple[str, ...],
    out: Path,
    rig_path: Path | None,
    settings: tuple[str, ...],
    together: bool,
    own: tuple[str, ...],
    shared: tuple[str, ...],
    no_verify: bool,
    page: Path | None,
    reports: Path | None,
    scheduler: str | None,
    workers: int | None,
    **asked: Any,
) -> int:
    """Identifies many runs and logs in parallel, verifies the logs, and writes one row for each FILE.

    FILE may be a pattern in quotes: 'runs/*.csv', 'fleet/**/*.pvlog'. A second call with the same -o computes only what
    is new or has changed, also after an interruption. The page shows what failed and how the parameters of each board
    drift: a board is the USB serial number of a log, or the folder of a run. With --report it has links to the reports
    of `identify`. With --together the FILEs of a folder are
    recordings of one mechanism, which are identified together.

    Exit code 1: a log is not equal to its twin. 3: nothing was identified.
    """
    from pvid.fleet.row import EQUAL, Question
    from pvid.fleet.run import run
    from pvid.fleet.store import Store
    from pvid.fleet.summary import counts_of
    from pvid.fleet.summary import page as summary

    given = dict(one.split("=", 1) for one in settings if "=" in one)
    if wrong := [one for one in settings if "=" not in one]:
        raise PvidError(f"--set {wrong[0]}: write KEY=VALUE, as in --set l1=0.25")
    rig = None if rig_path is None else str(rig_path)
    if (own or shared) and not together:
        raise PvidError("--own and --shared are of recordings that are identified --together")
    each, all_ = (tuple(listed_names(one)) for one in (own, shared))
    question = Question(rig=rig, settings=given, verify=not no_verify, own=each, shared=all_, **asked)
    if reports is not None:
        reports.mkdir(parents=True, exist_ok=True)
        question = replace(question, reports=str(reports))
    paths = _files(patterns)
    if not out.name:
        raise PvidError(f"{out}: -o is a Parquet file to write")
    place = page or out.with_suffix(".html")
    refuse_foreign(place)
    with progress_bar("identifying", len(paths)) as advance:
        rows = run(paths, question, Store(out), advance, scheduler=scheduler, workers=workers, together=together)
    write_whole(place, summary(rows, f"pvid batch {' '.join(patterns)}", place.parent))
    for name, count in counts_of(rows).items():
        click.echo(f"{name}: {count} of {len(rows)}")
    failures = [row for row in rows if row.failure is not None]
    for row in failures[:_SHOWN]:
        assert row.failure is not None
        write_stderr(f"pvid: {row.failure if row.path in row.failure else f'{row.path}: {row.failure}'}")
    if len(failures) > _SHOWN:
        write_stderr(f"pvid: {len(failures) - _SHOWN} more failures are in {place}")
    click.echo(f"rows: {out}; page: {place}")
    if any(row.verified not in (None, EQUAL) for row in rows):
        return DIFFERENT
    return DONE if any(row.identified for row in rows) else NOTHING_IDENTIFIED


def _files(patterns: tuple[str, ...]) -> list[str]:
    found: list[str] = []
    for pattern in patterns:
        here = sorted(one for one in glob(pattern, recursive=True) if Path(one).is_file()) if has_magic(pattern) else []
        if has_magic(pattern) and not here:
            raise PvidError(f"{pattern}: no file has such a name")
        found += here or [pattern]
    return found
