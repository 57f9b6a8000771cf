"""`pvid look`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.console import DONE
from pvid.base.errors import PvidError
from pvid.cli.input import FigurePath, force_option
from pvid.log.rig import LOG_SUFFIX


@click.command(name="look")
@click.argument("run_path", metavar="FILE", type=click.Path(path_type=Path))
@click.option("--figure", type=FigurePath(), help="Write a figure of the columns over time (png, svg, pdf).")
@force_option
def command(run_path: Path, figure: Path | None) -> int:
    """Says what is in a FILE, and what to type next.

    Its columns with their units, ranges and steps, what is set and what is measured, clipped, missing or constant; its
    clock; the mechanisms of the list that the columns can be of, each with its command; else lines for a model file.
    Names and units decide which mechanism it can be: which one it is, `identify` says.
    """
    if run_path.suffix == LOG_SUFFIX:
        raise PvidError(
            f"{run_path} is a log of a board, which states its columns: pvid plot, identify, verify or view it"
        )
    from pvid.cli.look_text import print_survey
    from pvid.identification.survey import surveyed

    survey = surveyed(run_path)
    if figure is not None:
        from pvid.show.columns_figure import write_columns_figure  # loads matplotlib

        write_columns_figure(survey, figure)
    print_survey(survey)
    return DONE
