"""`pvid plot`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.console import DONE
from pvid.base.replacing import refuse_foreign
from pvid.cli.input import FigurePath, columns_option, force_option, print_notes, rig_options
from pvid.log.mechanism_settings import mechanism_rig
from pvid.log.rig import LOG_SUFFIX, described_document_of_log, mechanism_of_log
from pvid.log.rig_settings import rig_for
from pvid.models.registry import MODELS
from pvid.rig.columns import parsed
from pvid.rig.run import is_run


@click.command(name="plot")
@click.argument("log", metavar="LOG|RUN", type=click.Path(path_type=Path))
@click.option("--model", help="A mechanism of `pvid models` or a model file.  [default: that of the rig file, kapitza]")
@rig_options
@columns_option
@click.option(
    "--refine", is_flag=True, help="Of another mechanism than the pendulum: draw the answer of `identify --refine`."
)
@click.option("-o", "--out", type=FigurePath(), help="Figure file: png, svg or pdf.  [default: LOG with .png]")
@force_option
def command(
    log: Path,
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: str | None,
    refine: bool,
    out: Path | None,
) -> int:
    """Draws the answer that `identify` prints for a RUN, or the estimates in a LOG: how they converge, with standard
    errors, and measured against simulated signals.

    A run (.csv, .npz, .parquet, ...), or a log without estimates, is identified on this machine first. Of the log of a
    described mechanism the estimates are drawn under the names that the board gave. The pendulum's page also shows
    residuals with their autocorrelation, spectra and the phase plot.
    """
    place = out or (log.with_suffix(".png") if log.name else log)  # a folder is refused as a recording
    refuse_foreign(place)
    if rig_path is None and model is None and not is_run(log) and log.suffix == LOG_SUFFIX:
        mechanism = mechanism_of_log(log)
        if mechanism.model.name not in MODELS or described_document_of_log(log) is not None:
            from pvid.show.log_figure import write_log_figure

            write_log_figure(log, mechanism, place)
            click.echo(place)
            return DONE
    described = mechanism_rig(log, rig_path, settings, model)
    if described is not None:
        from pvid.cli.mechanism import plot_run  # loads SymPy

        plot_run(log, described, columns, place, refine=refine)
        click.echo(place)
        return DONE
    from pvid.show.report import recording_of, write_report  # matplotlib and scipy, which other commands do not need

    recording = recording_of(log, rig_for(log, rig_path, settings), parsed(columns))
    print_notes(recording.run.notes)
    write_report(recording, place)
    click.echo(place)
    return DONE
