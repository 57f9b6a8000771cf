"""`pvid compare`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.table import Table

from pvid.base.console import DIFFERENT, DONE
from pvid.cli.input import form_options, model_option
from pvid.log.rig_choice import rig_of

if TYPE_CHECKING:
    from pvid.board.compare_on import Outcome


@click.command(name="compare")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@model_option
@form_options
@click.option("--core", type=click.Choice(["f32", "q31", "all"]), help="Arithmetic: f32, q31 or both.  [default: f32]")
@click.option(
    "--on",
    "targets",
    metavar="TARGET",
    multiple=True,
    help="Also compare on TARGET (emulator, serial port or 'all'); repeatable.",
)
def command(
    run_path: Path,
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: str | None,
    law: str | None,
    form: str | None,
    core: str | None,
    targets: tuple[str, ...],
) -> int:
    """Compares the C core with its numpy twin on RUN: every bit of the state after every tick.

    The C core is compiled for the mechanism (host/docs/models.md); start and tables are those of identify. With --on
    the run is also streamed to targets, and their running hashes are compared with the host's.
    """
    from pvid.board.target import targets_of
    from pvid.cli.compare_run import compare_recording

    rig = rig_of(run_path, rig_path, settings, model, columns)
    law = None if law == "stationary" and form != "strong" else law
    given = {"core": core, "form": form, "law": law}
    return _shown(compare_recording(run_path, rig, columns, targets_of(targets), **given))


def _shown(outcomes: Sequence[Outcome]) -> int:
    """Prints the table; the exit code."""
    table = Table("target", "core", "form", "law", "ticks", "hash", "verdict")
    for outcome in outcomes:
        table.add_row(*outcome.cells)
    Console(width=None if sys.stdout.isatty() else 140).print(table)
    return DONE if all(outcome.equal for outcome in outcomes) else DIFFERENT
