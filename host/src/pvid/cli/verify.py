"""`pvid verify`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar
from pvid.cli.input import log_argument, log_rig
from pvid.link.frames import Core, Form
from pvid.log.reader import LogReader
from pvid.log.rig import hello_of_log, settings_text_of_log
from pvid.log.rig_choice import rig_of

if TYPE_CHECKING:
    from pvid.log.verify import ReplayableBoard

_MOST_STRETCHES = 100  # that are printed


def _board_of(log: Path, rig_path: Path | None, model: str | None) -> ReplayableBoard | None:
    """The board, whose settings are in the log or follow from the rig file; None: there is neither."""
    from pvid.board.mechanism_board import board_of, board_of_guess  # loads SymPy

    text = None if rig_path is not None else settings_text_of_log(log)
    if text is not None:
        return board_of(text, model)
    hello = hello_of_log(log)
    if rig_path is None or (hello is not None and hello.form == Form.STRONG):
        return None
    rig = rig_of(None, rig_path, (), model)
    rate = rig.sample_rate or (None if hello is None else hello.sample_rate)
    core = "q31" if hello is not None and hello.core == Core.Q31 else "f32"
    return board_of_guess(replace(rig, sample_rate=rate), core)


@click.command(name="verify")
@log_argument
@log_rig
@click.option("--model", help="The model file of a log of your own mechanism.  [default: the log's, if it is shipped]")
@click.option("--twin", is_flag=True, help="The printed twin alone computes the whole log; this takes minutes an hour.")
@click.option("--partial", is_flag=True, help="Exit code 0 even if only a part is verified.")
def command(log: Path, rig_path: Path | None, model: str | None, twin: bool, partial: bool) -> int:
    """Computes a whole LOG again and compares every estimate and hash, bit for bit.

    The core, compiled on this computer, computes the whole log, and the printed numpy twin parts of it: the begin of
    each session, samples of the rest, and every difference. Without a C compiler, or with --twin, the twin computes it
    all.

    Prints the first difference. A sample is verified if an equal hash covers it. Samples after a lost sample cannot
    be verified until the board begins another session; they are listed, and counted in the summary.

    Exit code 0: every sample is verified; those after the last hash may be unverified if no further hash was due.
    1: there is a difference, or, without --partial, other samples are not verified. 3: no sample is verified.
    """
    from pvid.log.verify import Verdict, Verifier  # the twins, which other commands do not need

    board = _board_of(log, rig_path, model)
    reader = LogReader(log)
    verdict = Verdict()
    with progress_bar("verifying", None) as advance:
        for stretch in Verifier(board, advance, twin_alone=twin).stretches(reader):
            if verdict.stretches < _MOST_STRETCHES or stretch.difference is not None:
                click.echo(stretch.text)
            verdict.add(stretch)
    if (more := verdict.stretches - _MOST_STRETCHES) > 0:
        click.echo(f"{more} stretches more, named here where they are DIFFERENT")
    click.echo(verdict.text)
    if verdict.by_twin:
        click.echo(verdict.computed)
    click.echo(reader.account.text)
    if verdict.different:
        return DIFFERENT
    if not verdict.verified:
        return NOTHING_IDENTIFIED
    return DONE if partial or not verdict.left else DIFFERENT
