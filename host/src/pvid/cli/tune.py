"""`pvid tune`."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from rich.console import Console

from pvid.base.console import DONE, progress_bar
from pvid.base.errors import PvidError
from pvid.cli.input import columns_option, read_input, rig_options
from pvid.cli.result import print_warning
from pvid.core.native import Native
from pvid.log.mechanism_settings import mechanism_rig
from pvid.log.rig_settings import rig_for
from pvid.rig.file import rig_path_of
from pvid.rig.sensor_steps import resolved
from pvid.run import answer
from pvid.run.advised import identified


@click.command(name="tune")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@click.option("--model", help="A mechanism of `pvid models` or a model file: designs of the weak engine for it.")
@rig_options
@columns_option
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Rig file to write.  [default: RUN-tuned.toml]")
def command(
    run_path: Path,
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: str | None,
    out: Path | None,
) -> int:
    """Chooses the weak form's settings for a recorded RUN: equations (full angles, friction), window, test functions,
    pass band, decimation, forgetting.

    Candidates are judged on held-out blocks of the run. The rig file's settings are kept unless others predict these
    blocks significantly better, or equally well with clearly smaller standard errors. A result of `identify` is never
    lost. Writes a rig file with all settings; `identify` with it gives the printed result.

    With --model, or a rig file with [model]: the designs of the weak form that were tried for that mechanism, the best
    first. `identify` chooses the best by itself, so no file is written.
    """
    described = mechanism_rig(run_path, rig_path, settings, model)
    if described is not None:
        from pvid.cli.mechanism import recording_of  # loads SymPy
        from pvid.cli.mechanism_design import print_tuning

        if out is not None:
            raise PvidError(
                "-o: nothing is written for a described mechanism, whose design is chosen on each run; omit it"
            )
        recording, compiled = recording_of(run_path, described, columns)
        return print_tuning(compiled, recording)
    from pvid.run.tune import STEPS, tune
    from pvid.run.tune_table import candidates_table

    rig = rig_for(run_path, rig_path, settings)
    run = read_input(run_path, rig, columns)
    native = Native()
    try:
        with progress_bar("tuning", STEPS) as advance:
            tuned = tune(run, rig, native, advance)
    except PvidError as error:
        from pvid.run.advice import behind

        raise behind(identified(run, resolved(rig, run), native).advice, error) from error
    out = out or run_path.with_name(rig_path_of(run_path).stem + "-tuned.toml")
    tuned.rig.write(out)
    Console(width=None if sys.stdout.isatty() else 160).print(candidates_table(tuned))
    for note in tuned.notes:
        click.echo(note)
    drift = ", ".join(f"{one.forgetting_s:g} s {one.energy:.4g}" for one in tuned.forgetting if one.forgetting_s > 0)
    if drift:
        click.echo(f"residual of the next window with forgetting, over that without: {drift}")
    click.echo(f"chosen: {tuned.reason}")
    click.echo(f"with it the C core identifies {answer.one_line(tuned.answer)}")
    print_warning(tuned.answer)
    click.echo(f"rig file: {out}")
    return DONE
