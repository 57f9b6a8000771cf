"""`pvid design`."""

from __future__ import annotations

import json
from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pvid.base.console import DONE
from pvid.base.errors import PvidError
from pvid.base.rounding import with_error
from pvid.cli.input import columns_option, read_input, rig_options
from pvid.cli.simulate import tone
from pvid.log.mechanism_settings import mechanism_rig
from pvid.log.rig_settings import rig_for
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_RELEASE


@click.command(name="design")
@click.option("--model", help="A mechanism of `pvid models` or a model file: the weak engine's design for it.")
@rig_options
@click.option("--run", "run_path", type=click.Path(path_type=Path), help="Predict for the drive of this recorded run.")
@columns_option
@click.option(
    "--tone",
    "tones",
    multiple=True,
    metavar="A,F,PHASE",
    help="Predict for this drive [m,Hz,rad]; repeatable.  [default: the standard rig's]",
)
@click.option("--release", nargs=2, type=float, help="Initial phi1, phi1+phi of a predicted run [rad], at rest.")
@click.option("--duration", type=float, help="Length of the predicted run [s].  [default: the run's, else 40]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    run_path: Path | None,
    columns: str | None,
    tones: tuple[str, ...],
    release: tuple[float, float] | None,
    duration: float | None,
    as_json: bool,
) -> int:
    """Predicts standard errors, kappa, delay, memory and instructions of the weak form for a rig.

    The drive comes from a recorded run or from tones, not from the rig file. The tables themselves are printed by
    tables.

    With --model, or a rig file with [model], the design is that of the weak engine for that mechanism: for a recorded
    run, or for its simulated rig.
    """
    described = mechanism_rig(run_path, rig_path, settings, model)
    if described is not None:
        from pvid.cli.mechanism import recording_of  # loads SymPy
        from pvid.cli.mechanism_design import print_design
        from pvid.run.mechanism import model_of

        if tones or release or duration is not None:
            raise PvidError("--tone, --release and --duration are for the pendulum: give a recorded run, --run RUN")
        recording, compiled = (
            (None, model_of(described)) if run_path is None else recording_of(run_path, described, columns)
        )
        return print_design(compiled, recording, as_json=as_json)
    from pvid.run.design_report import report_for_run, report_for_tones

    rig = rig_for(run_path, rig_path, settings)
    if duration is not None and not 0 < duration < float("inf"):
        raise PvidError(f"the duration must be a positive number of seconds, not {duration:g}")
    if run_path is None:
        if columns is not None:
            raise PvidError("--columns needs --run")
        drive = tuple(tone(text) for text in tones) or STANDARD_DRIVE
        report = report_for_tones(rig, drive, release or STANDARD_RELEASE, duration or 40.0)
    elif tones or release:
        raise PvidError("--run contains the drive: omit --tone and --release")
    else:
        report = report_for_run(rig, read_input(run_path, rig, columns, whole=True), duration)
    if as_json:
        click.echo(json.dumps(report.as_json()))
        return DONE
    table = Table("parameter", "predicted at", "standard error", "%", title=f"a run of {report.duration:g} s")
    own = rig.mechanism.model
    for name, value in report.value.items():
        share = f"{100 * report.se[name] / abs(value):.2g}" if name != own.offset_name else ""
        label = escape(own.answer(name).name_and_unit)
        table.add_row(label, *with_error(value, report.se[name]), share)
    Console().print(table)
    click.echo(f"kappa {report.kappa:.2g}; noise of a row {report.row_sd:.2g} rad")
    for name, text in report.cost_rows():
        click.echo(f"{name}: {text}")
    return DONE
