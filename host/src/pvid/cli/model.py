"""`pvid model`: check, predict, simulate and build a mechanism that is described in a model file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.table import Table

from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.cli.input import NewFile, columns_option, force_option, listed_names
from pvid.cli.rig_design import analysis_of, model_of_rig, recorded
from pvid.cli.simulate import ABOVE_0, numbers, of_model, start_option

if TYPE_CHECKING:  # SymPy takes a third of a second to load
    from pvid.codegen.files_robot import RobotFiles
    from pvid.codegen.generated import GeneratedModel
    from pvid.codegen.strong_q31 import StrongQ31
    from pvid.codegen.weak_q31 import WeakQ31
    from pvid.model.compiled import CompiledModel
    from pvid.oracle.weak.identify import Identified
    from pvid.rig.run import Recording
    from pvid.settings.refine import RefineConfig
    from pvid.settings.strong import StrongModelConfig
    from pvid.settings.weak import WeakConfig

_MODEL = click.argument("model", metavar="MODEL")


@click.group(name="model")
def command() -> None:
    """Describes, judges, simulates and prints mechanisms.

    MODEL is one of the list of `pvid models`, or the path of a model file: a Python file of some ten lines that leaves
    a variable `model` (host/docs/models.md).
    """


command.add_command(of_model)


@command.command(name="from")
@click.argument("path", metavar="FILE", type=click.Path(path_type=Path, dir_okay=False))
@click.option("-o", "--out", required=True, type=NewFile(), help="Model file to write.")
@click.option(
    "--joints",
    metavar="NAME,...",
    multiple=True,
    help="Joints that move and are recorded, from the base outwards; others are held at their zero.  [default: all]",
)
@click.option("--free-base", is_flag=True, help="The first link of URDF is fixed to nothing: a drone, a satellite.")
@force_option
def from_file(path: Path, out: Path, joints: tuple[str, ...], free_base: bool) -> int:
    """Writes a model file of the robot in FILE, a URDF or MJCF file.

    `pvid identify LOG --model` then gives its base parameters from a log with the columns q1, tau1, q2, tau2, .. in
    the order of the joints (host/docs/robots.md).
    """
    from pvid.base.atomic_write import write_whole
    from pvid.models.mechanisms import compiled_of
    from pvid.models.robot_file import placed, text_of

    if out.suffix != ".py":
        raise PvidError(f"{out}: the name of a model file ends with .py")
    robot = placed(path, listed_names(joints), free_base=free_base)
    for note in robot.notes:
        write_stderr(f"pvid: note: {note}")
    write_whole(out, text_of(robot, path, out.parent))
    compiled = compiled_of(out)
    assert compiled.chain is not None
    click.echo(f"{out}: {compiled.chain.extent}, {len(compiled.unknowns)} base parameters")
    return DONE


@command.command()
@_MODEL
def check(model: str) -> int:
    """Prints the rows that MODEL becomes, its theta, and which parameters are identifiable.

    Exit code 3: a parameter is not identifiable; the report names the combination that is.
    """
    from pvid.codegen.weak_sizes import too_many_unknowns
    from pvid.model.report import check_report, identifiable, robot_report
    from pvid.models.mechanisms import compiled_of
    from pvid.models.registry import asked_for
    from pvid.oracle.weak.parameters import Parameters

    compiled = compiled_of(asked_for(model))
    if compiled.chain is not None:
        from pvid.codegen.files_robot import board_report

        click.echo(f"{robot_report(compiled)}\n\n{board_report(compiled)}")
        return DONE
    Parameters(compiled).checked(None)  # raises where the constraints contradict each other
    if (refusal := too_many_unknowns(compiled.name, len(compiled.unknowns))) is not None:
        write_stderr(f"pvid: note: {refusal}")
    click.echo(check_report(compiled))
    return DONE if identifiable(compiled).identifiable else NOTHING_IDENTIFIED


@command.command()
@_MODEL
@click.option("--drive", "only", help="Only this drive.  [default: each of the list]")
@click.option("--band", nargs=2, type=float, help="Of the drives [Hz].  [default: 10/duration to rate/50]")
@click.option("--share", default=0.5, show_default=True, help="Largest value of a drive over the reach of its signal.")
@click.option("--duration", type=ABOVE_0, help="Of a run [s].  [default: the rig's, 20]")
@click.option("--rate", type=ABOVE_0, help="Sample rate [Hz].  [default: the rig's, 1000]")
@start_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def predict(
    model: str,
    only: str | None,
    band: tuple[float, float] | None,
    share: float,
    duration: float | None,
    rate: float | None,
    starts: tuple[str, ...],
    as_json: bool,
) -> int:
    """Predicts the standard errors of MODEL's parameters for several drives, and names the best one.

    Each drive is simulated with its sensors at the model's guesses, and identified; a mechanism without an input is
    released by --start. The first column is the shipped mechanism's own rig. The last rows name the parameter that is
    known worst, and the one whose change looks alike.
    """
    from pvid.configuration.drives import advice, predicted
    from pvid.models.mechanisms import compiled_of
    from pvid.models.mechanisms import names as names_of_shipped
    from pvid.models.registry import asked_for
    from pvid.models.simulated_rig import simulated_rig
    from pvid.sim.drives import DRIVES, drive_named
    from pvid.sim.simulated_run import RigSimulation, rig_of_guess

    compiled = compiled_of(asked_for(model))
    own = simulated_rig(compiled.name) if model in names_of_shipped() else None
    length = duration or (own.duration if own else 20.0)
    hz = rate or (own.sample_rate if own else 1000.0)
    low, high = band or (10 / length, hz / 50)
    start = numbers(starts, "--start", "--start q=0.5")
    names = [only] if only else list(DRIVES)
    drive_named(names[0], 1.0, low, high)  # a wrong name or band is refused before anything is simulated
    driven = any(one.driven or one.kind == "input" for one in compiled.signals)
    cases = [] if own is None or only else [("its own rig", RigSimulation.of(compiled, own))]
    cases += [
        (
            name if driven else "a release",
            RigSimulation.of(
                compiled, rig_of_guess(compiled, name, low, high, rate=hz, duration=length, share=share, start=start)
            ),
        )
        for name in (names if driven else names[:1])
    ]
    with progress_bar("drives", len(cases)) as advance:
        found = []
        for name, simulation in cases:
            found.append(predicted(name, simulation))
            advance(len(found))
    if as_json:
        listing = {
            one.drive: one.failure or dict(zip(compiled.p_names, one.relative.tolist(), strict=True)) for one in found
        }
        click.echo(json.dumps({"relative_se": listing, "advice": advice(found)}))
        return DONE
    table = Table("", *(one.drive for one in found), title=f"{compiled.title}: standard errors [%]")
    for k, name in enumerate(compiled.p_names):
        table.add_row(name, *("-" if one.failure else f"{100 * one.relative[k]:.2g}" for one in found))
    table.add_row("worst", *(one.worst or "-" for one in found))
    table.add_row("looks like", *(one.partner or "-" for one in found))
    Console().print(table)
    for one in found:
        if one.failure:
            write_stderr(f"pvid: {one.drive}: {one.failure}")
    click.echo(advice(found))
    return DONE if not all(one.failure for one in found) else NOTHING_IDENTIFIED


@command.command()
@_MODEL
@click.option("-o", "--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder to write.")
@click.option("--check", "only_check", is_flag=True, help="Compare the folder's files with the output instead.")
@click.option("--strong", is_flag=True, help="The strong form as well: an identifier from derivatives of the signals.")
@click.option("--soft-sign", "soft_signs", multiple=True, metavar="V=WIDTH", help="V/(|V| + WIDTH) in place of sgn(V).")
@click.option("--reach", "reaches", multiple=True, metavar="INPUT=VALUE", help="Fixed point: largest |INPUT|.")
@click.option(
    "--bandwidth",
    type=ABOVE_0,
    default=10.0,
    show_default=True,
    help="Fixed point: of the signals [Hz], for derivatives.",
)
@click.option(
    "--window", type=ABOVE_0, default=2.0, show_default=True, help="Fixed point: of integrals since its start [s]."
)
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="Rig file, whose values are the model's.")
@click.option("--run", "run_path", type=click.Path(path_type=Path), help="A recording of the rig, for its design.")
@columns_option
@click.option("--functions", type=click.IntRange(4, 64), help="Test functions of the design.  [default: chosen]")
@force_option
def build(
    model: str,
    out: Path,
    only_check: bool,
    strong: bool,
    soft_signs: tuple[str, ...],
    reaches: tuple[str, ...],
    bandwidth: float,
    window: float,
    rig_path: Path | None,
    run_path: Path | None,
    columns: str | None,
    functions: int | None,
) -> int:
    """Writes the C of MODEL, its numpy twin, a header with every name and unit, a CMake target and a test.

    In the CMakeLists.txt of your firmware: add_subdirectory(OUT) and target_link_libraries(my_firmware PRIVATE NAME).

    NAME_design_f32.h has the tables and settings of the weak form for the rig of --run, or for the shipped rig of a
    shipped mechanism; NAME_weak_q31.h and NAME_design_q31.h have them in fixed point. NAME_refine_design_f32.h has the
    settings of the second stage, which fits the full equations (host/docs/firmware.md). With --strong,
    NAME_strong_design_f32.h has the differentiators and settings of the strong form, NAME_strong_q31.h and
    NAME_strong_design_q31.h have it in fixed point. Of a robot there is NAME_robot.h for pvid/robot.h in float32, and
    with --run NAME_design_f32.h (host/docs/robots.md).
    """
    from pvid.codegen.fixed_model import Reaches
    from pvid.codegen.generated import GeneratedModel, Options
    from pvid.codegen.weak_sizes import refuse_too_many_unknowns
    from pvid.oracle.weak.edges import with_edges

    compiled, rig = model_of_rig(model, rig_path, run_path)
    if compiled.chain is None:
        refuse_too_many_unknowns(compiled)
    if columns is not None and run_path is None:
        raise PvidError("--columns needs --run")
    recording = None if run_path is None else recorded(compiled, rig, run_path, columns)
    if compiled.chain is not None:
        asked = {"--strong": strong, "--soft-sign": soft_signs, "--reach": reaches, "--functions": functions}
        if given := [name for name, one in asked.items() if one]:
            raise PvidError(f"{given[0]} is not for a robot, whose C has one form alone")
        named = [("--rig", rig_path), ("--run", run_path)]
        return _build_robot(compiled, recording, out, only_check, [f" {o} {p.name}" for o, p in named if p is not None])
    found: Identified | None = None
    if recording is not None:
        compiled = with_edges(compiled, recording.signals, recording.sample_rate)
        found = analysis_of(compiled, recording).found
    design = _design_of(compiled, model, recording, functions, found)
    limits = Reaches(bandwidth, window, of=numbers(reaches, "--reach"))
    soft = numbers(soft_signs, "--soft-sign")
    given = [*(["--strong"] if strong else []), *(f"--soft-sign {one}" for one in soft_signs)]
    given += [f"--reach {one}" for one in reaches]
    usual = Reaches()
    given += [f"--bandwidth {bandwidth:g}"] if bandwidth != usual.bandwidth_hz else []
    given += [f"--window {window:g}"] if window != usual.window_s else []
    given += [f"--rig {rig_path.name}"] if rig_path is not None else []
    given += [f"--run {run_path.name}"] if run_path is not None else []
    given += [f"--functions {functions}"] if functions is not None else []
    title = " ".join(["pvid model build", compiled.name, *given])
    options = Options(limits, soft, strong)
    whole = GeneratedModel(compiled, title, options)
    no_fixed_weak = no_fixed_strong = None
    if design is not None:
        weak, no_fixed_weak = _weak_q31(compiled, recording, functions, soft, found)
        options = replace(options, design=design, weak_q31_for_run=weak)
    if strong:
        strong_design, strong_q31, no_fixed_strong = _strong_design_of(compiled, model, recording, found)
        options = replace(options, strong_design=strong_design, strong_q31=strong_q31)
    no_refinement = whole.refinement.refusal
    if design is not None and no_refinement is None:
        refine_design, no_refinement = _refine_design_of(compiled, recording, design, soft)
        options = replace(options, refine_design=refine_design)
    whole = replace(whole, options=options)
    refusals = {
        "fixed point": whole.fixed.refusal,
        "weak form in C": whole.weak.refusal,
        "weak form in fixed point": no_fixed_weak,
        "strong form in fixed point": no_fixed_strong,
        "refinement in C": no_refinement,
    }
    if whole.weak.refusal is None and design is None:
        refusals["design of a rig"] = _NO_RUN
    return _written(whole, out, only_check, refusals)


_NO_RUN = "give a recording of it with --run"


def _build_robot(
    compiled: CompiledModel, recording: Recording | None, out: Path, only_check: bool, given: Sequence[str]
) -> int:
    """Writes or checks the files of a robot."""
    from pvid.codegen.files_robot import RobotFiles, refuse_in_c
    from pvid.configuration.robot_core import robot_core_design

    refuse_in_c(compiled)
    design = None if recording is None else robot_core_design(compiled, recording)
    files = RobotFiles(compiled, "".join(["pvid model build ", compiled.name, *given]), design)
    refusals = {"fixed point": "a robot is identified in float32 alone"}
    return _written(files, out, only_check, refusals | ({} if design else {"design of a rig": _NO_RUN}))


def _written(
    whole: GeneratedModel | RobotFiles, out: Path, only_check: bool, refusals: Mapping[str, str | None]
) -> int:
    """Writes the files and says what is not among them, or compares them with what is there."""
    from pvid.codegen import build as generated

    if not only_check:
        for path in generated.build(whole, out):
            click.echo(path)
        for what, reason in refusals.items():
            if reason is not None:
                write_stderr(f"pvid: no {what}: {reason}")
        return DONE
    try:
        generated.check(whole, out)
    except PvidError as error:
        write_stderr(f"pvid: {error}")
        return DIFFERENT
    click.echo(f"{out}: as generated")
    return DONE


def _strong_design_of(
    compiled: CompiledModel, model: str, recording: Recording | None, found: Identified | None
) -> tuple[StrongModelConfig | None, StrongQ31 | None, str | None]:
    """Of the strong form for the rig of a recording, or for the shipped rig of a shipped mechanism; the same in fixed
    point, or why there is none."""
    from pvid.configuration.strong import reference_of, strong_design
    from pvid.configuration.strong_q31 import fixed_design
    from pvid.models.mechanisms import names as names_of_shipped
    from pvid.rig.run import Recording
    from pvid.sim.simulated_run import simulation_of

    reference = reference_of(found)
    if recording is None:
        if model not in names_of_shipped():
            return None, None, None
        simulation = simulation_of(model)
        run = simulation.run()
        signals = {one.name: run[one.name] for one in compiled.signals}
        recording = Recording(run["t"], signals, simulation.rig.sample_rate)
        reference = simulation.truth
    design = strong_design(compiled, recording, reference=reference)
    try:
        return design.config, fixed_design(compiled, recording, design).strong_q31, None
    except PvidError as error:
        return design.config, None, str(error)


def _refine_design_of(
    compiled: CompiledModel, recording: Recording | None, design: WeakConfig, soft_signs: dict[str, float]
) -> tuple[RefineConfig | None, str | None]:
    """Of the refinement behind the weak form, or why there is none."""
    from pvid.configuration.refine import refine_design, refine_for_simulated_rig

    try:
        if recording is not None:
            return refine_design(compiled, design, recording.signals, soft_signs=soft_signs), None
        return refine_for_simulated_rig(compiled, design, soft_signs), None
    except PvidError as error:
        return None, str(error)


def _design_of(
    compiled: CompiledModel, model: str, recording: Recording | None, functions: int | None, found: Identified | None
) -> WeakConfig | None:
    from pvid.codegen.generated import GeneratedModel
    from pvid.configuration.weak import config_for_recording, config_for_rig_like_the_shipped
    from pvid.models.mechanisms import names as names_of_shipped

    if GeneratedModel(compiled, "").weak.made is None:
        return None
    if recording is not None:
        return config_for_recording(compiled, recording, functions, found=found)
    if model in names_of_shipped():
        return config_for_rig_like_the_shipped(compiled, functions)
    if functions is not None:
        raise PvidError("--functions needs --run: there is no rig to make a design for")
    return None


def _weak_q31(
    compiled: CompiledModel,
    recording: Recording | None,
    functions: int | None,
    soft_signs: dict[str, float],
    found: Identified | None,
) -> tuple[WeakQ31 | None, str | None]:
    """The fixed-point weak form for the rig, or why there is none."""
    from pvid.configuration.weak_q31 import weak_q31_for_recording, weak_q31_for_rig_like_the_shipped

    try:
        if recording is None:
            return weak_q31_for_rig_like_the_shipped(compiled, functions, soft_signs), None
        return weak_q31_for_recording(compiled, recording, functions, soft_signs, found=found), None
    except PvidError as error:
        return None, str(error)
