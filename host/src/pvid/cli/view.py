"""`pvid view`."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from types import FrameType

import click

from pvid.base.console import DONE, write_stderr
from pvid.log.file import Segment
from pvid.log.reader import LogReader
from pvid.show.page import DEFAULT, is_local, page


@click.command(name="view")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--web", "at", metavar="HOST:PORT", default=DEFAULT, show_default=True, help="Where the page is served.")
def command(log: Path, at: str) -> int:
    """Shows LOG on the live page, until Ctrl-C: parameters over time, motion, residuals, withheld windows.

    The log may be finished or still growing.
    """
    any(isinstance(record.item, Segment) for record in LogReader(log))  # refuses what is no log
    ended = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        ended.set()

    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, end)
    with page(at, log, log.name) as address:
        if not is_local(address):
            write_stderr(f"every computer with access to this machine can open {address}")
        click.echo(f"{address} shows {log}; Ctrl-C ends it")
        ended.wait()
    return DONE
