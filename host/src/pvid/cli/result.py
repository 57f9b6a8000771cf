"""What the commands that identify print: the table, the warning, the figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from pvid.base.console import write_stderr
from pvid.rig.file import RigFile
from pvid.run import answer
from pvid.run.identify import Identification

if TYPE_CHECKING:
    from pvid.run.refined_mechanism import RefinedMechanism
    from pvid.run.refined_pendulum import RefinedPendulum


def write_figure(result: Identification, path: Path, truths: dict[str, float] | None) -> None:
    from pvid.show.figures import convergence  # loads matplotlib, half a second

    convergence(result, path, truth=truths)
    click.echo(f"figure: {path}")


def write_refined_figure(outcome: RefinedPendulum | RefinedMechanism, path: Path) -> None:
    """Measured against simulated signals."""
    from pvid.show.mechanism_figure import write_comparison  # loads matplotlib

    write_comparison(outcome, path)
    click.echo(f"figure: {path}")


def print_result(result: Identification, rig: RigFile, truths: dict[str, float] | None = None) -> None:
    table = answer.table(result, truths)
    if table is not None:
        Console().print(table)
    for line in (answer.error_line(result, rig), answer.status_line(result), answer.refinement_line(result)):
        if line is not None:
            click.echo(line)


def print_warning(result: Identification) -> None:
    if result.warning is not None:
        write_stderr(f"pvid: warning: {result.warning}")
