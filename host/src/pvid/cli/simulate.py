"""`pvid simulate`, and `pvid model simulate`: a run of a simulated rig, with its rig file."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pvid.base.console import DONE, write_stderr
from pvid.base.errors import PvidError
from pvid.cli.input import NewFile, force_option
from pvid.models.registry import asked_for
from pvid.models.registry import names as names_of_shipped
from pvid.rig.mechanism_file import MechanismRig, with_settings

if TYPE_CHECKING:  # SymPy takes a third of a second to load
    from pvid.model.compiled import CompiledModel
    from pvid.models.simulated_rig import SimulatedRig

ABOVE_0 = click.FloatRange(min=0.0, min_open=True)
start_option = click.option(
    "--start",
    "starts",
    multiple=True,
    metavar="STATE=VALUE",
    help="Coordinate or rate at the first sample, as in q=0.5 or q_1=2; repeatable.  [default: the rig's; 0]",
)
_OUT = click.argument("out", type=NewFile())
_LAW = click.option("--friction", type=click.Choice(["sharp", "soft"]), default="sharp", show_default=True)
_OPTIONS = (
    click.option("--seed", default=0, show_default=True, help="Of the sensors' noise.", type=click.IntRange(min=0)),
    click.option("--duration", type=ABOVE_0, help="Length [s].  [default: the rig's; of a model file 20]"),
    click.option("--rate", type=ABOVE_0, help="Sample rate [Hz].  [default: the rig's; of a model file 1000]"),
    click.option("--drive", help="A drive of `model predict`.  [default: the rig's; of a model file steps]"),
    click.option(
        "--truth",
        "truths",
        multiple=True,
        metavar="UNKNOWN=VALUE",
        help="Its true value; repeatable.  [default: the rig's; of a model file the guess; of a refined parameter 0]",
    ),
    start_option,
    click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="KEY=VALUE",
        help="A key of the rig file, as in sensor.phi.resolution=1e-3; repeatable.",
    ),
    click.option(
        "--rows",
        is_flag=True,
        help="Simulate the equations of the rows, where the second stage has equations of its own.",
    ),
    _LAW,
    click.option(
        "--stiction", default=1.0, show_default=True, help="Friction at rest over that of sliding; needs sharp."
    ),
    click.option(
        "--imperfect",
        "imperfect",
        multiple=True,
        metavar="KIND.SIGNAL=SIZE",
        help="backlash or eccentricity [LSB], skew [s], gain [true over recorded]; repeatable.",
    ),
    force_option,
)


def _with_options(function: Callable[..., Any]) -> Callable[..., Any]:
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


@click.command(name="simulate")
@_OUT
@click.option("--model", default="kapitza", show_default=True, help="A mechanism of `pvid models`, or a model file.")
@_with_options
def command(model: str, out: Path, **options: Any) -> int:
    """Simulates a rig with its sensors; writes the run OUT (.csv, .csv.gz, .npz, .parquet) and its rig file."""
    return _simulate(model, out, **options)


@click.command(name="simulate")
@click.argument("model", metavar="MODEL")
@_OUT
@_with_options
def of_model(model: str, out: Path, **options: Any) -> int:
    """Simulates a rig of MODEL with its sensors; writes the run OUT and its rig file.

    Of a shipped mechanism it is the shipped rig. Of a model file it is one at rest, whose inputs follow a drive within
    half their reach.
    """
    return _simulate(model, out, **options)


def _simulate(
    model: str,
    out: Path,
    seed: int,
    duration: float | None,
    rate: float | None,
    drive: str | None,
    truths: tuple[str, ...],
    starts: tuple[str, ...],
    settings: tuple[str, ...],
    rows: bool,
    friction: str,
    stiction: float,
    imperfect: tuple[str, ...],
) -> int:
    from pvid.sim.imperfections import Imperfections, sizes_of
    from pvid.sim.simulated_run import RigSimulation, write_simulated_run

    own = MechanismRig.of_document(with_settings({}, settings), asked_for(model))
    compiled = own.compiled()
    rig = _rig_to_simulate(compiled, model, duration, rate, drive)
    true = numbers(truths, "--truth", "--truth m=1.3")
    known = [*compiled.p_names, *(() if rows else (one.name for one in compiled.refinement.extras))]
    for name in true:
        if name not in known:
            raise PvidError(f"--truth {name}: the model has no such unknown; it has {', '.join(known)}")
    start = numbers(starts, "--start", "--start q=0.5")
    whole_start = {**rig.whole_start, **start}
    rig = replace(rig, truth={**rig.truth, **true}, start={**rig.start, **start}, whole_start=whole_start)
    law = Imperfections("sharp" if friction == "sharp" else "soft", stiction, **sizes_of(imperfect))
    simulation = RigSimulation.of(compiled, rig, whole=not rows)
    run = simulation.run(seed, law)
    written = write_simulated_run(out, run, simulation, _name_beside(out, model), own.sensor)
    write_stderr(f"{out}: {simulation.samples} samples of {', '.join(run)}; rig file {written}")
    return DONE


def _rig_to_simulate(
    compiled: CompiledModel, model: str, duration: float | None, rate: float | None, drive: str | None
) -> SimulatedRig:
    """The shipped rig, or one of the guesses at rest with a drive of the list."""
    from pvid.models.simulated_rig import simulated_rig
    from pvid.sim.simulated_run import rig_of_guess

    if model in names_of_shipped():
        rig = simulated_rig(compiled.name)
        rig = replace(rig, duration=duration or rig.duration, sample_rate=rate or rig.sample_rate)
        if drive is None:
            return rig
        length, hz = rig.duration, rig.sample_rate
        return replace(rig, drive=rig_of_guess(compiled, drive, 10 / length, hz / 50, rate=hz, duration=length).drive)
    length, hz = duration or 20.0, rate or 1000.0
    return rig_of_guess(compiled, drive or "steps", 10 / length, hz / 50, rate=hz, duration=length)


def _name_beside(out: Path, model: str) -> str:
    """A mechanism's name, or the path of a model file from the folder of the rig file."""
    return os.path.relpath(model, out.parent) if model.endswith(".py") else model


def numbers(given: tuple[str, ...], option: str, example: str = "--reach phi_1=40") -> dict[str, float]:
    """NAME=VALUE, several times. Raises PvidError where one is not of this kind."""
    found = {}
    for one in given:
        name, _, value = one.partition("=")
        try:
            found[name] = float(value)
        except ValueError as error:
            raise PvidError(f"{option} {one}: write NAME=VALUE, as in {example}") from error
    return found
