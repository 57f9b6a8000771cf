"""`pvid design`."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pvid.base.errors import PvidError
from pvid.cli.input import NewFile, columns_option, force_option, rig_options
from pvid.log.rig_choice import rig_of
from pvid.models.registry import names
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.cores import CORES, FLOAT
from pvid.settings.enums import Core

if TYPE_CHECKING:
    from pvid.board.design_cost import Asked


@click.command(name="design")
@click.option("--model", help="A mechanism of `pvid models` or a model file.  [default: the rig file's]")
@rig_options
@click.option("--run", "run_path", type=click.Path(path_type=Path), help="Predict for the drive of this recorded run.")
@columns_option
@click.option(
    "--tone",
    "tones",
    multiple=True,
    metavar="A,F,PHASE",
    help="Predict for this drive, in the unit of its signal, Hz and rad; repeatable.  [default: the shipped rig's]",
)
@click.option("--duration", type=float, help="Length of the predicted run [s].  [default: the shipped rig's]")
@click.option("--on", "target", metavar="BOARD", help="Measure the cost on this emulated board too: those of `sizes`.")
@click.option("--core", type=click.Choice(list(CORES)), default=None, help="Arithmetic of --on.  [default: f32]")
@click.option("--refine", is_flag=True, help="With --on: the cost of both stages too.")
@click.option(
    "--clock",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="MHZ",
    help="With --on: the ticks as parts of the time between samples at this clock.",
)
@click.option("-o", "--out", type=NewFile(), help="Of a robot: the motion to write, a CSV file, with its C beside it.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@force_option
def command(
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    run_path: Path | None,
    columns: str | None,
    tones: tuple[str, ...],
    duration: float | None,
    target: str | None,
    core: Core | None,
    refine: bool,
    clock: float | None,
    out: Path | None,
    as_json: bool,
) -> int:
    """Predicts the standard errors of the weak form for a rig, and shows its design.

    For a robot it designs a motion of --duration within the limits of the model file (host/docs/robots.md), and writes
    it to --out.

    The drive is that of a recorded run, else that of the mechanism's simulated rig, scaled to the guess of the rig
    file. C tables of the design are printed by model build.

    With --on the design is also built for an emulated board, which replays the run: instructions of a tick, mean and
    longest, and bytes of RAM and flash; with --refine also of both stages. A cost is printed only if the board's hashes
    are those of this computer.
    """
    from pvid.cli.design_run import print_design, print_motion
    from pvid.cli.identify_run import recording_of  # loads SymPy
    from pvid.configuration.nominal_run import nominal_run
    from pvid.models.mechanisms import compiled_of

    if run_path is None and columns is not None:
        raise PvidError("--columns needs --run")
    if run_path is not None and (tones or duration is not None):
        raise PvidError("--run contains the drive: omit --tone and --duration")
    if duration is not None and not 0 < duration < float("inf"):
        raise PvidError(f"the duration must be a positive number of seconds, not {duration:g}")
    asked = _asked(target, core, refine=refine, clock=clock)
    drive = [_tone(text) for text in tones]
    if model in names() and not (rig_path or settings or run_path or drive or duration or out):
        return print_design(compiled_of(model), None, asked, as_json=as_json)
    rig = rig_of(run_path, rig_path, settings, model, columns)
    if out is not None or rig.compiled().chain is not None:
        return print_motion(rig, duration, out, other=bool(run_path or drive or asked), as_json=as_json)
    if run_path is not None:
        recording, compiled = recording_of(run_path, rig, columns)
        return print_design(compiled, recording, asked, as_json=as_json)
    if rig.sample_rate is None and rig.model in names():
        rig = replace(rig, sample_rate=simulated_rig(str(rig.model)).sample_rate)
    made = nominal_run(rig, drive, duration)
    return print_design(made.compiled, made.recording, asked, as_json=as_json)


def _tone(text: str) -> tuple[float, float, float]:
    """Amplitude, frequency and phase of a sine."""
    try:
        amplitude, frequency, phase = (float(part) for part in text.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{text!r} is not AMPLITUDE,FREQUENCY_HZ,PHASE_RAD") from error
    if not isfinite(amplitude + frequency + phase) or frequency < 0:
        raise click.BadParameter(f"{text!r} needs finite numbers and a frequency >= 0")
    return amplitude, frequency, phase


def _asked(target: str | None, core: Core | None, *, refine: bool, clock: float | None) -> Asked | None:
    """The costs to measure; None: none."""
    if target is None:
        if core is not None or refine or clock is not None:
            raise PvidError("--core, --refine and --clock are for the cost on a board: --on BOARD")
        return None
    from pvid.board.design_cost import Asked

    return Asked.of(target, core or FLOAT.name, refined=refine, clock_mhz=clock)
