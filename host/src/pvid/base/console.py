"""What every command shares: exit codes, where messages go, a bar for long work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from pvid.base.wording import printable

DONE, DIFFERENT, BAD_INPUT, NOTHING_IDENTIFIED, CHANGED = 0, 1, 2, 3, 4
OWN_ERROR = 70  # EX_SOFTWARE of sysexits.h
INTERRUPTED = 130

messages = Console(stderr=True)


def write_stderr(sentence: str) -> None:
    """A line on standard error; the names in it are taken as they are."""
    click.echo(printable(sentence), err=True)


@contextmanager
def progress_bar(what: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal, nothing elsewhere; yields the function to call with the work done so far.

    `total` None: not known.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=messages, transient=True, disable=not messages.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def working(what: str) -> Iterator[None]:
    """A moving bar and the time so far on a terminal, nothing elsewhere: for work whose length is not known."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=messages, transient=True, disable=not messages.is_terminal) as bar:
        bar.add_task(what, total=None)
        yield
