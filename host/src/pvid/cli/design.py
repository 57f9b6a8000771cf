"""`pvid design`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pvid.base.errors import PvidError
from pvid.cli.input import columns_option, rig_options
from pvid.cli.simulate import tone
from pvid.log.mechanism_settings import mechanism_rig
from pvid.log.rig_settings import rig_for
from pvid.rig.described import described as of_pendulum
from pvid.rig.file import RigFile
from pvid.settings.engine_cores import ENGINE_CORES, FLOAT
from pvid.settings.enums import Core
from pvid.sim.pendulum import STANDARD_DRIVE, STANDARD_RELEASE
from pvid.sim.rig_run import simulated_run

if TYPE_CHECKING:
    from pvid.board.design_cost import Asked


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
@click.option("--on", "target", metavar="BOARD", help="Measure the cost on this emulated board too: those of `sizes`.")
@click.option(
    "--core", type=click.Choice(list(ENGINE_CORES)), help="Arithmetic of --on.  [default: the rig file's, f32]"
)
@click.option("--refine", is_flag=True, help="With --on: the cost of both stages too.")
@click.option(
    "--clock",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="MHZ",
    help="With --on: the ticks as parts of the time between samples at this clock.",
)
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
    target: str | None,
    core: Core | None,
    refine: bool,
    clock: float | None,
    as_json: bool,
) -> int:
    """Predicts the standard errors of the weak form for a rig, and shows its design.

    The drive comes from a recorded run, or from tones for the pendulum of the rig file, not from the rig file. C tables
    of the design are printed by model build.

    With --model, or a rig file with [model], the design is that for this mechanism: for a recorded run, or for its
    simulated rig.

    With --on the design is also built for an emulated board, which replays the run: instructions of a tick, mean and
    longest, and bytes of RAM and flash; with --refine also of both stages. A cost is printed only if the board's hashes
    are those of this computer.
    """
    from pvid.cli.mechanism import recording_of  # loads SymPy
    from pvid.cli.mechanism_design import print_design
    from pvid.run.mechanism import model_of

    described = mechanism_rig(run_path, rig_path, settings, model)
    if run_path is None and columns is not None:
        raise PvidError("--columns needs --run")
    if run_path is not None and (tones or release or duration is not None):
        raise PvidError("--run contains the drive: omit --tone, --release and --duration")
    rig = rig_for(run_path, rig_path, settings) if described is None else None
    asked = _asked(target, core, rig, refine=refine, clock=clock)
    if described is not None:
        if tones or release or duration is not None:
            raise PvidError("--tone, --release and --duration are for the pendulum: give a recorded run, --run RUN")
        if run_path is None:
            return print_design(model_of(described), None, asked, as_json=as_json)
        recording, compiled = recording_of(run_path, described, columns)
        return print_design(compiled, recording, asked, as_json=as_json)
    assert rig is not None
    if run_path is not None:
        recording, compiled = recording_of(run_path, of_pendulum(rig), columns)
        return print_design(compiled, recording, asked, as_json=as_json)
    if duration is not None and not 0 < duration < float("inf"):
        raise PvidError(f"the duration must be a positive number of seconds, not {duration:g}")
    drive = tuple(tone(text) for text in tones) or STANDARD_DRIVE
    given = (rig, drive, release or STANDARD_RELEASE, duration or 40.0)
    recording = simulated_run(*given).recording
    motion = simulated_run(*given, truth="full").recording.signals if refine else None
    return print_design(model_of(of_pendulum(rig)), recording, asked, motion, as_json=as_json)


def _asked(
    target: str | None, core: Core | None, rig: RigFile | None, *, refine: bool, clock: float | None
) -> Asked | None:
    """The costs to measure; None: none."""
    if target is None:
        if core is not None or refine or clock is not None:
            raise PvidError("--core, --refine and --clock are for the cost on a board: --on BOARD")
        return None
    from pvid.board.design_cost import Asked

    own = None if rig is None else ENGINE_CORES.get(rig.identifier.core)
    return Asked.of(target, core or (own or FLOAT).name, refined=refine, clock_mhz=clock)
