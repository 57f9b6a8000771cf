"""`pvid layout`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.atomic_write import write_whole
from pvid.base.console import DONE
from pvid.cli.input import NewFile, force_option, log_argument, log_rig
from pvid.log.rig import mechanism_of_log


@click.command(name="layout")
@log_argument
@log_rig
@click.option("--for", "program", type=click.Choice(["plotjuggler", "foxglove"]), required=True, help="Program.")
@click.option("-o", "--out", type=NewFile(), help="File.  [default: standard output]")
@force_option
def command(log: Path, rig_path: Path | None, program: str, out: Path | None) -> int:
    """Writes a layout file with the plots of a LOG's samples, estimates, standard errors and quality.

    For a file of `pvid export --to mcap` in PlotJuggler or Foxglove, and for `pvid log --live`:
    udp://.. in PlotJuggler, foxglove://.. in Foxglove.
    A log of a few seconds is enough: the layout has the names of the board's mechanism.
    """
    from pvid.log.layout import LAYOUTS

    mechanism = mechanism_of_log(log, rig_path)
    text = LAYOUTS[program](mechanism)
    if out is None:
        click.echo(text, nl=False)
    else:
        write_whole(out, text)
        click.echo(out)
    return DONE
