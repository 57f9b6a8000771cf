"""`pvid compare`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.table import Table

from pvid.base.console import DIFFERENT, DONE, progress_bar
from pvid.cli.input import form_options, read_input, with_overrides
from pvid.core.native import Native
from pvid.log.mechanism_settings import mechanism_rig
from pvid.log.rig_settings import rig_for
from pvid.rig.described import described as of_rig_file
from pvid.rig.file import RigFile
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.sensor_steps import resolved

if TYPE_CHECKING:
    from pvid.board.compare_on import Outcome


@click.command(name="compare")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@click.option("--model", help="A mechanism of `pvid models` or a model file.  [default: that of the rig file, kapitza]")
@form_options
@click.option(
    "--core", type=click.Choice(["f32", "q31", "all"]), help="Arithmetic: f32, q31 or both.  [default: the rig file's]"
)
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

    Start and tables are those of identify. With --on the run is also streamed to targets, and their running hashes are
    compared with the host's.

    With --model, or a rig file with [model], the run is one of another mechanism (host/docs/models.md), and the C core
    is compiled for it.
    """
    from pvid.board.compare_on import compare_here, compare_there
    from pvid.board.target import targets_of

    described: MechanismRig | RigFile | None = mechanism_rig(run_path, rig_path, settings, model)
    if described is None:
        rig = with_overrides(rig_for(run_path, rig_path, settings), form=form)
        if rig.identifier.form_traits.publishes:
            described, core = rig, core or rig.identifier.core_traits.in_c
            law = None if law == "stationary" else law
    if described is not None:
        from pvid.cli.mechanism import compare_recording  # loads SymPy

        given = {"core": core, "form": form, "law": law}
        own = of_rig_file(described) if isinstance(described, RigFile) else described
        return _shown(compare_recording(run_path, own, columns, targets_of(targets), **given))
    run = read_input(run_path, rig, columns)
    rig = resolved(rig, run)
    native = Native()
    outcomes: list[Outcome] = []
    for arithmetic in ["f32", "q31"] if core == "all" else [core or rig.identifier.core_traits.in_c]:
        for one in [law] if law else ["stationary", "pseudovelocity"]:
            chosen = replace(rig, identifier=replace(rig.identifier, law=one, core=arithmetic))  # type: ignore[arg-type]
            with progress_bar(f"{one} law, {arithmetic}", len(run.t)) as advance:
                outcomes.append(compare_here(chosen, run, native, advance))
            for target in targets_of(targets):
                with progress_bar(f"{one} law, {arithmetic} on {target}", len(run.t)) as advance:
                    outcomes.append(compare_there(target, chosen, run, native, advance))
    return _shown(outcomes)


def _shown(outcomes: Sequence[Outcome]) -> int:
    """Prints the table; the exit code."""
    table = Table("target", "core", "form", "law", "ticks", "hash", "verdict")
    for outcome in outcomes:
        table.add_row(*outcome.cells)
    Console(width=None if sys.stdout.isatty() else 140).print(table)
    return DONE if all(outcome.equal for outcome in outcomes) else DIFFERENT
