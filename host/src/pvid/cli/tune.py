"""`pvid tune`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.cli.input import columns_option, rig_options
from pvid.log.mechanism_settings import mechanism_rig
from pvid.log.rig_settings import rig_for


@click.command(name="tune")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@click.option("--model", help="A mechanism of `pvid models` or a model file.  [default: that of the rig file, kapitza]")
@rig_options
@columns_option
def command(
    run_path: Path, model: str | None, rig_path: Path | None, settings: tuple[str, ...], columns: str | None
) -> int:
    """Shows the designs of the weak form that were tried for a recorded RUN, the best first: window, test functions,
    decimation, expected errors.

    `identify` chooses the best by itself on each run, so no file is written.
    """
    from pvid.cli.mechanism import recording_of  # loads SymPy
    from pvid.cli.mechanism_design import print_tuning

    described = mechanism_rig(run_path, rig_path, settings, model) or rig_for(run_path, rig_path, settings)
    recording, compiled = recording_of(run_path, described, columns)
    return print_tuning(compiled, recording)
