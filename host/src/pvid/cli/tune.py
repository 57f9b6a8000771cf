"""`pvid tune`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.errors import PvidError
from pvid.cli.input import FigurePath, columns_option, force_option, model_option, rig_options


@click.command(name="tune")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@model_option
@rig_options
@columns_option
@click.option(
    "--refine",
    is_flag=True,
    help="Fit the full equations to the whole run, and show the distance of each design's estimate from that answer.",
)
@click.option("--figure", type=FigurePath(), help="With --refine: measured and simulated signals (png, svg, pdf).")
@force_option
def command(
    run_path: Path,
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: str | None,
    refine: bool,
    figure: Path | None,
) -> int:
    """Shows the designs of the weak form that were tried for a recorded RUN, the best first: window, test functions,
    decimation, expected errors.

    `identify` chooses the best by itself on each run, so no file is written.
    """
    from pvid.cli.design_run import print_tuning
    from pvid.cli.identify_run import recording_of, refined_reference  # loads SymPy
    from pvid.log.rig_choice import rig_of

    if figure is not None and not refine:
        raise PvidError("--figure is of the refinement: add --refine")
    recording, compiled = recording_of(run_path, rig_of(run_path, rig_path, settings, model, columns), columns)
    reference = refined_reference(compiled, recording, figure) if refine else None
    return print_tuning(compiled, recording, reference)
