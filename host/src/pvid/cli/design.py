"""`pvid design`."""

from __future__ import annotations

from pathlib import Path

import click

from pvid.base.errors import PvidError
from pvid.cli.input import columns_option, rig_options
from pvid.cli.simulate import tone
from pvid.log.mechanism_settings import mechanism_rig
from pvid.log.rig_settings import rig_for
from pvid.rig.described import described as of_pendulum
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_RELEASE
from pvid.sim.rig_run import simulated_run


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
@click.option("--duration", type=float, help="Length of the predicted run [s].  [default: 40]")
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
    """Predicts the standard errors of the weak form for a rig, and shows its design.

    The drive comes from a recorded run, or from tones for the pendulum of the rig file, not from the rig file. C tables
    of the design are printed by model build, what it costs on a board by sizes.

    With --model, or a rig file with [model], the design is that for this mechanism: for a recorded run, or for its
    simulated rig.
    """
    from pvid.cli.mechanism import recording_of  # loads SymPy
    from pvid.cli.mechanism_design import print_design
    from pvid.run.mechanism import model_of

    described = mechanism_rig(run_path, rig_path, settings, model)
    if run_path is None and columns is not None:
        raise PvidError("--columns needs --run")
    if run_path is not None and (tones or release or duration is not None):
        raise PvidError("--run contains the drive: omit --tone, --release and --duration")
    if described is not None:
        if tones or release or duration is not None:
            raise PvidError("--tone, --release and --duration are for the pendulum: give a recorded run, --run RUN")
        if run_path is None:
            return print_design(model_of(described), None, as_json=as_json)
        recording, compiled = recording_of(run_path, described, columns)
        return print_design(compiled, recording, as_json=as_json)
    rig = rig_for(run_path, rig_path, settings)
    if run_path is not None:
        recording, compiled = recording_of(run_path, rig, columns)
        return print_design(compiled, recording, as_json=as_json)
    if duration is not None and not 0 < duration < float("inf"):
        raise PvidError(f"the duration must be a positive number of seconds, not {duration:g}")
    drive = tuple(tone(text) for text in tones) or STANDARD_DRIVE
    simulated = simulated_run(rig, drive, release or STANDARD_RELEASE, duration or 40.0)
    return print_design(model_of(of_pendulum(rig)), simulated.recording, as_json=as_json)
