"""`pvid export`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.console import DONE
from pvid.cli.input import force_option, log_argument, log_rig
from pvid.log.rig import mechanism_of_log


@click.command(name="export")
@log_argument
@log_rig
@click.option("--to", "form", type=click.Choice(["csv", "parquet", "mcap", "npz"]), required=True, help="Format.")
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Output without extension.  [default: beside LOG]")
@force_option
def command(log: Path, rig_path: Path | None, form: str, out: Path | None) -> int:
    """Writes samples, estimates, status and events of a LOG in SI units, for other programs.

    csv and parquet write one file for each table; units are in LOG-metadata.json (CSV on the Web) or in the columns'
    metadata. npz is one file; its arrays t, phi and y are a run for `pvid identify` if no sample is missing; the units
    are in its array "units". mcap is one file of JSON messages for PlotJuggler and Foxglove.
    """
    from pvid.log.export import export_log

    mechanism = mechanism_of_log(log, rig_path)
    for path in export_log(log, form, out or log.with_suffix(""), mechanism):
        click.echo(path)
    return DONE
