"""`pvid log PORT RUN.csv`: a board that prints lines of numbers."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.console import DIFFERENT, DONE, write_stderr
from pvid.base.errors import PvidError
from pvid.base.wording import listed
from pvid.link.port import BAUD
from pvid.log.recorder import PortSource
from pvid.log.text_recorder import TextRecorder

_SUFFIX = ".csv"


def record_text(
    port: str, out: Path, duration: float | None, samples: int | None, allow_loss: float, *, quiet: bool
) -> int:
    """Records until the duration, the samples or Ctrl-C; prints the account and returns the exit code."""
    if out.suffix.lower() != _SUFFIX:
        raise PvidError(f"what a board prints is recorded as a table of CSV: name it {out.with_suffix(_SUFFIX)}")

    def tell(line: str) -> None:
        if not quiet:
            write_stderr(line)

    recorder = TextRecorder(PortSource(port, keeps_input=True), out, duration, samples, tell)
    tell(f"{port} -> {out}; Ctrl-C ends the recording")
    table = recorder.run()
    if not table.rows:
        kept = f"; they are in {recorder.raw}" if recorder.received else ""
        write_stderr(
            f"pvid: not one line of numbers in {recorder.received} bytes from {port}{kept}: is it the right port, and "
            f"is the board's baud rate {BAUD}?"
        )
        return DIFFERENT
    click.echo(f"{out}: {table.rows} rows of {listed(table.names)}; {recorder.why}")
    if table.restarts:
        click.echo(f"the board was started again during the recording: its header came again ({table.restarts})")
    if not recorder.is_whole:
        click.echo(
            f"left out: {table.damaged} damaged lines, {table.words} lines without numbers; all is in {recorder.raw}"
        )
    if not table.has_header:
        write_stderr(
            f"pvid: the board sent no line of names: give them with --columns, as in --columns t={table.names[0]}:ms, "
            "or record while you reset the board"
        )
    lost = table.damaged / (table.rows + table.damaged)
    if lost > allow_loss:
        write_stderr(f"pvid: {100 * lost:.3g} % of the lines are damaged, allowed are {100 * allow_loss:.3g} %")
        return DIFFERENT
    return DONE
