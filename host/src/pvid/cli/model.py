"""`pvid model`: check, predict, simulate and build a mechanism that is described in a model file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, write_stderr
from pvid.base.errors import PvidError

_MODEL = click.argument("model", metavar="MODEL")


@click.group(name="model")
def command() -> None:
    """Describes, judges, simulates and prints mechanisms.

    MODEL is one of the list of `pvid models`, or the path of a model file: a Python file of some ten lines that leaves
    a variable `model` (host/docs/models.md).
    """


@command.command()
@_MODEL
def check(model: str) -> int:
    """Prints the rows that MODEL becomes, its theta, and which parameters are identifiable.

    Exit code 3: a parameter is not identifiable; the report names the combination that is.
    """
    from pvid.model.report import check_report, identifiable
    from pvid.models.mechanisms import compiled_of

    compiled = compiled_of(model)
    click.echo(check_report(compiled))
    return DONE if identifiable(compiled).identifiable else NOTHING_IDENTIFIED


@command.command()
@_MODEL
@click.option("-o", "--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder to write.")
@click.option("--check", "only_check", is_flag=True, help="Compare the folder's files with the output instead.")
def build(model: str, out: Path, only_check: bool) -> int:
    """Writes the C of MODEL, its numpy twin, a header with every name and unit, a CMake target and a test.

    In the CMakeLists.txt of your firmware: add_subdirectory(OUT) and target_link_libraries(my_firmware PRIVATE NAME).
    """
    from pvid.codegen import build as generated
    from pvid.models.mechanisms import compiled_of

    compiled = compiled_of(model)
    if not only_check:
        for path in generated.build(compiled, out):
            click.echo(path)
        return DONE
    try:
        generated.check(compiled, out)
    except PvidError as error:
        write_stderr(f"pvid: {error}")
        return DIFFERENT
    click.echo(f"{out}: as generated")
    return DONE


@command.command()
@_MODEL
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--seed", default=0, show_default=True, help="Of the sensors' noise.")
@click.option("--duration", type=click.FloatRange(min=0.0, min_open=True), help="Length [s].  [default: the rig's]")
@click.option("--friction", type=click.Choice(["soft", "sharp"]), default="soft", show_default=True)
@click.option("--stiction", default=1.0, show_default=True, help="Friction at rest over that of sliding; needs sharp.")
def simulate(model: str, out: Path, seed: int, duration: float | None, friction: str, stiction: float) -> int:
    """Simulates the shipped rig of MODEL with its sensors; writes the run OUT and its rig file."""
    from pvid.log.rig_settings import rig_path_of
    from pvid.models.mechanisms import compiled_of
    from pvid.models.simulated_rig import simulated_rig
    from pvid.rig.mechanism_file import MechanismRig
    from pvid.rig.run import Recording, write_recording
    from pvid.run.mechanism import channels_of
    from pvid.sim.imperfections import Imperfections
    from pvid.sim.simulated_run import RigSimulation

    compiled = compiled_of(model)
    rig = simulated_rig(compiled.name)
    rig = rig if duration is None else replace(rig, duration=duration)
    law = Imperfections(friction="sharp" if friction == "sharp" else "soft", breakaway=stiction)
    run = RigSimulation.of(compiled, rig).run(seed, law)
    recording = Recording(run.pop("t"), run, rig.sample_rate)
    write_recording(out, recording, channels_of(compiled))
    settings = rig_path_of(out)
    MechanismRig(compiled.name, rig.sample_rate, known=rig.knowns).write(settings)
    write_stderr(f"{out}: {len(recording)} samples of {', '.join(run)}; rig file {settings}")
    return DONE
