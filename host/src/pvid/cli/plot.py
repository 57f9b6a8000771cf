"""`pvid plot`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.console import DONE
from pvid.base.replacing import refuse_foreign
from pvid.cli.input import FigurePath, columns_option, force_option, model_option, rig_options
from pvid.log.rig import LOG_SUFFIX, mechanism_of_log
from pvid.rig.run import is_run


@click.command(name="plot")
@click.argument("log", metavar="LOG|RUN", type=click.Path(path_type=Path))
@model_option
@rig_options
@columns_option
@click.option("--refine/--no-refine", default=None, help="As of `identify`.")
@click.option("-o", "--out", type=FigurePath(), help="Figure file: png, svg or pdf.  [default: LOG with .png]")
@force_option
def command(
    log: Path,
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: str | None,
    refine: bool | None,
    out: Path | None,
) -> int:
    """Draws the answer that `identify` prints for a RUN, or the estimates in a LOG: how they converge, with standard
    errors, and measured against simulated signals.

    A log without estimates is identified on this machine first, as a run is. Estimates in a log are drawn under the
    names that the board gave.
    """
    place = out or (log.with_suffix(".png") if log.name else log)  # a folder is refused as a recording
    refuse_foreign(place)
    if rig_path is None and model is None and not is_run(log) and log.suffix == LOG_SUFFIX:
        from pvid.show.log_figure import write_log_figure  # loads matplotlib

        if write_log_figure(log, mechanism_of_log(log), place):
            click.echo(place)
            return DONE
    from pvid.cli.identify_run import plot_run  # loads SymPy
    from pvid.log.rig_choice import rig_of

    plot_run(log, rig_of(log, rig_path, settings, model, columns), columns, place, refine=refine)
    click.echo(place)
    return DONE
