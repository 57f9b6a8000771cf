"""The command line: `./tools/pvid COMMAND`.

Exit codes: 0 done, 1 a comparison failed, 2 bad input or usage, or output that cannot be written (one sentence),
3 nothing identified, 130 interrupted, 141 the reader of the output has gone.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pvid import __version__
from pvid.base.console import BAD_INPUT, DIFFERENT, DONE, INTERRUPTED, NOTHING_IDENTIFIED, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.base.output import watch
from pvid.base.rounding import with_error
from pvid.base.wording import reason
from pvid.cli.input import FigurePath, columns_option, print_notes, read_input, rig_options
from pvid.cli.log import COMMANDS as LOG_COMMANDS
from pvid.cli.page_table import UPDATE, markdown, put_table
from pvid.core.native import Native
from pvid.design.c_tables import bank_header
from pvid.design.fir import finite_difference, savitzky_golay
from pvid.design.weak import to_c_header
from pvid.design.weak_sizing import SizesOfDesign, raised_bounds
from pvid.log.rig_settings import rig_for, rig_path_of
from pvid.rig.columns import Columns
from pvid.rig.file import RigFile, load
from pvid.rig.run import Run, write_run
from pvid.rig.sensor_steps import resolution_note, resolved
from pvid.run import answer
from pvid.run.compare import Comparison
from pvid.run.identify import Identification, identify
from pvid.run.survey import fitted
from pvid.settings.q31 import WeakConfigQ31
from pvid.setup.f32 import weak_design_of
from pvid.setup.q31 import config_for_run, strong_config_q31, weak_config_q31
from pvid.setup.strong_header_q31 import strong_header_q31
from pvid.setup.weak_header_q31 import to_c_header_q31
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Pendulum,
    Sensors,
    Tone,
    simulate,
    standard_sensors,
    standard_start,
)

IN_A_CLONE = {"bench": "bench.command", "campaign": "bench.campaign.command"}


def main() -> None:
    """Runs a command and turns every refusal into one sentence and its exit code."""
    watch()
    os.environ.pop("MPLBACKEND", None)  # figures are files here, and matplotlib stumbles over a backend it lacks
    try:
        code = commands.main(prog_name="pvid", standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.Abort:
        write_stderr("pvid: interrupted")
        code = INTERRUPTED
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        help_hint = f" (see {context.command_path} --help)" if context is not None else ""
        write_stderr(f"pvid: {error.format_message()}{help_hint}")
        code = BAD_INPUT
    except PvidError as error:
        write_stderr(f"pvid: {error}")
        code = BAD_INPUT
    except OSError as error:
        write_stderr(f"pvid: {'' if error.filename is None else f'{error.filename}: '}{reason(error)}")
        code = BAD_INPUT
    except MemoryError as error:
        detail = f" ({reason(error)})" if str(error) else ""
        write_stderr(f"pvid: there is not enough memory{detail}: is a length, a rate or a count too large?")
        code = BAD_INPUT
    sys.exit(code if isinstance(code, int) else DONE)


class Commands(click.Group):
    """The package's commands, and in a clone those of tools/bench besides."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted((*super().list_commands(ctx), *(IN_A_CLONE if find_spec("bench") else ())))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in IN_A_CLONE or find_spec("bench") is None:
            return super().get_command(ctx, cmd_name)
        command: click.Command = getattr(import_module(IN_A_CLONE[cmd_name]), cmd_name)
        return command


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="pvid", message="%(prog)s %(version)s")
def commands() -> None:
    """Identifies the parameters of a mechanism, and proves the C core bit for bit."""


for _command in LOG_COMMANDS:
    commands.add_command(_command)


# ---- demo


@commands.command()
@click.option("--figure", type=FigurePath(), default=Path("pvid-demo.png"), help="Where the figure goes.")
@click.option("--seed", default=1, show_default=True, help="Seed of the sensors' noise and of the start.")
@click.option("--bits", default=14, show_default=True, type=click.IntRange(8, 32), help="Resolution of the encoder.")
@click.option("--form", type=click.Choice(["weak", "strong"]), default="weak", show_default=True)
@click.option("--truth", type=click.Choice(["linear", "full"]), default="linear", show_default=True)
def demo(figure: Path, seed: int, bits: int, form: str, truth: str) -> int:
    """Simulates the standard rig and streams it into the firmware on an emulated board; compares every bit."""
    from pvid.cli.demo import play_demo, stage

    on = stage()
    if on.lacking is not None:
        write_stderr(f"{on.lacking}: the firmware runs on {on.where}")
    simulation = simulate(sensors=standard_sensors(bits), truth=truth, seed=seed)  # type: ignore[arg-type]
    run = simulation.run
    standard = RigFile.standard()
    rig = replace(
        standard,
        identifier=replace(standard.identifier, form=form, full_angle=truth == "full"),  # type: ignore[arg-type]
        sensor=replace(standard.sensor, phi_lsb=2 * np.pi / 2**bits),
    )
    cores = ("f32", "q31") if form == "weak" else ("f32",)  # the strong form's twins take a solve a tick
    rigs = [replace(rig, identifier=replace(rig.identifier, core=core)) for core in cores]  # type: ignore[arg-type]
    start = standard_start(seed)
    write_stderr(
        f"standard rig, {truth} equations, {bits}-bit encoder, {run.t[-1]:.0f} s at {run.sample_rate:g} Hz; "
        f"start {', '.join(f'{100 * (s / p - 1):+.0f} %' for s, p in zip(start, simulation.p, strict=True))} off"
    )
    truths = simulation.pendulum.truths
    with progress_bar(f"streaming to {on.target}, comparing with the twins", len(rigs) * len(run.t)) as advance:
        parts = play_demo(on, rigs, run, Native(), start, advance)
    for played in parts:
        _print_result(played.result, rig, truths)
        _print_warning(played.result)
        _print_comparison(played.comparison, f"core {played.result.core} here against its numpy twin")
        playback = played.verdict.playback
        hashed = f", hash {playback.hash:08x}" if played.verdict.equal else ""
        click.echo(f"streamed to {on.where}: {playback.done} ticks, {played.verdict.text} to here{hashed}")
    _write_figure(parts[0].result, figure, truths)
    return DONE if all(played.equal for played in parts) else DIFFERENT


def _write_figure(result: Identification, path: Path, truths: dict[str, float] | None) -> None:
    from pvid.show.figures import (
        convergence,
    )  # matplotlib takes half a second that other commands need not wait for

    convergence(result, path, truth=truths)
    click.echo(f"figure: {path}")


def _print_result(result: Identification, rig: RigFile, truths: dict[str, float] | None = None) -> None:
    table = answer.table(result, truths)
    if table is not None:
        Console().print(table)
    for line in (answer.error_line(result, rig), answer.status_line(result)):
        if line is not None:
            click.echo(line)


def _print_warning(result: Identification) -> None:
    if result.warning is not None:
        write_stderr(f"pvid: warning: {result.warning}")


def _print_comparison(comparison: Comparison, label: str = "C core against the numpy twin") -> None:
    if comparison.equal:
        click.echo(f"{label}: {comparison.ticks} ticks equal in every bit, hash {comparison.twin_hash:08x}")
    else:
        click.echo(f"{label}: DIFFERENT at {comparison.difference}")


# ---- simulate


def _tone(text: str) -> Tone:
    try:
        amplitude, frequency, phase = (float(part) for part in text.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{text!r} is not AMPLITUDE_M,FREQUENCY_HZ,PHASE_RAD") from error
    return Tone(amplitude, frequency, phase)


@commands.command(name="simulate")
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--duration", default=40.0, show_default=True, help="Length [s].")
@click.option("--rate", default=1000.0, show_default=True, help="Sample rate [Hz].")
@click.option("--truth", type=click.Choice(["linear", "full"]), default="full", show_default=True)
@click.option("--bits", default=14, show_default=True, type=click.IntRange(4, 32), help="Encoder resolution.")
@click.option("--exact", is_flag=True, help="Perfect sensors: no quantisation, no noise, no offset.")
@click.option("--noise", type=float, help="White noise of the encoder [LSB].  [default: 0.5]")
@click.option("--zero", default=0.0, show_default=True, help="Offset of the encoder [rad].")
@click.option("--skew", default=0.0, show_default=True, help="Pivot sampled later than the encoder by this [s].")
@click.option("--tone", "tones", multiple=True, metavar="A,F,PHASE", help="Drive tone [m,Hz,rad]; repeatable.")
@click.option(
    "--release",
    nargs=2,
    type=float,
    default=STANDARD_RELEASE,
    show_default=True,
    help="phi1, phi1+phi [rad].",
)
@click.option("--l1", default=STANDARD_PENDULUM.l1, show_default=True, help="[m]")
@click.option("--l2", default=STANDARD_PENDULUM.l2, show_default=True, help="[m]")
@click.option("--rho2", default=STANDARD_PENDULUM.rho2, show_default=True, help="[m]")
@click.option("--gravity", default=STANDARD_PENDULUM.g, show_default=True, help="Gravity [m/s^2].")
@click.option("--tilt", default=0.0, show_default=True, help="Tilt of the plane of motion [rad].")
@click.option(
    "--damping", default=0.0, show_default=True, help="Viscous friction of both joints per unit mass [m^2/s]."
)
@click.option("--seed", default=0, show_default=True)
@click.option("--rig", "rig_out", type=click.Path(path_type=Path), help="Rig file to write.  [default: OUT with .toml]")
def simulate_command(**options: Any) -> int:
    """Simulates a rig into OUT (.csv, .csv.gz, .npz, .parquet) and writes the rig file that goes with it."""
    pendulum = Pendulum(
        l1=options["l1"],
        l2=options["l2"],
        rho2=options["rho2"],
        g=options["gravity"],
        damping1=options["damping"],
        damping2=options["damping"],
    ).tilted(options["tilt"])
    sensors = standard_sensors(options["bits"])
    if options["exact"]:
        sensors = Sensors()
    if options["noise"] is not None:
        sensors = replace(sensors, phi_noise_lsb=options["noise"])
    sensors = replace(sensors, phi_zero=options["zero"], skew_s=options["skew"])
    drive = tuple(_tone(text) for text in options["tones"]) or STANDARD_DRIVE
    simulation = simulate(
        pendulum=pendulum,
        drive=drive,
        sensors=sensors,
        sample_rate=options["rate"],
        duration=options["duration"],
        release=tuple(options["release"]),
        truth=options["truth"],
        seed=options["seed"],
    )
    out: Path = options["out"]
    write_run(out, simulation.run)
    rig_path: Path = options["rig_out"] or rig_path_of(out)
    standard = RigFile.standard()
    rig = replace(
        standard,
        l1=pendulum.l1,
        sample_rate=options["rate"],
        sensor=replace(standard.sensor, phi_lsb=sensors.phi_lsb, y_lsb=sensors.y_lsb),
        # linear equations have no sines to correct
        identifier=replace(standard.identifier, full_angle=options["truth"] == "full"),
    )
    rig.write(rig_path)
    largest = float(np.abs(simulation.run.phi).max())
    write_stderr(f"{out}: {len(simulation.run.t)} samples, |phi| up to {largest:.3f} rad; rig file {rig_path}")
    return DONE


# ---- identify and compare


def _form_options(function: Callable[..., int]) -> Callable[..., int]:
    for option in (
        click.option("--form", type=click.Choice(["weak", "strong"]), help="Form; overrides the rig file."),
        click.option("--law", type=click.Choice(["stationary", "pseudovelocity"]), help="Law; overrides the rig file."),
        columns_option,
        rig_options,
    ):
        function = option(function)
    return function


def _with(rig: RigFile, **overrides: str | None) -> RigFile:
    given = {name: value for name, value in overrides.items() if value is not None}
    return replace(rig, identifier=replace(rig.identifier, **given)) if given else rig  # type: ignore[arg-type]


@commands.command(name="identify")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@_form_options
@click.option("--core", type=click.Choice(["f32", "q31", "f64"]), help="Arithmetic; overrides the rig file.")
@click.option("--on", "target", metavar="TARGET", help="Also compute on an emulator, stream-host or a serial port.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--figure", type=FigurePath(), help="Write a figure of the convergence (png, svg, pdf).")
def identify_command(
    run_path: Path,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: Columns | None,
    law: str | None,
    form: str | None,
    core: str | None,
    target: str | None,
    as_json: bool,
    figure: Path | None,
) -> int:
    """Identifies a recorded or simulated RUN: columns t [s], phi [rad], y [m], or what --columns names.

    A rig file is not needed: --set l1=0.25, the length of rod 1 [m], is enough. Short gaps are interpolated, long ones
    stay empty, a clock that is not uniform is corrected; all of these are reported.

    With --on the run is also streamed to a target, and the result is printed only if the target computed the same
    bits at every tick that it reported and at the end.
    """
    rig = _with(rig_for(run_path, rig_path, settings), law=law, form=form, core=core)
    run = read_input(run_path, rig, columns, whole=rig.identifier.core == "f64")
    given, rig = rig, resolved(rig, run)
    notes = resolution_note(given, rig)
    print_notes(notes)
    native = Native()
    result = _identified(replace(run, notes=(*run.notes, *notes)), rig, native)
    if target is not None:
        from pvid.board.stream_rig import played_samples, stream_rig
        from pvid.board.target import verify

        image = stream_rig(fitted(rig, run), run.sample_rate, run)
        with progress_bar(f"streaming to {target}", len(run.t)) as advance:
            verdict = verify(target, image, native, *played_samples(rig, run), progress=advance)
        write_stderr(f"{target}: {verdict.playback.account}")
        if not verdict.equal:
            write_stderr(f"pvid: {target}: {verdict.text}")
            return DIFFERENT
        result = replace(result, on=target)
    if as_json:
        click.echo(json.dumps(answer.as_json(result)))
    else:
        _print_result(result, rig)
    if figure is not None:
        _write_figure(result, figure, None)
    _print_warning(result)
    if not result.identified:
        write_stderr(f"pvid: nothing identified: {result.verdict}")
    for sentence in result.advice:
        write_stderr(f"pvid: advice: {sentence}")
    return DONE if result.identified else NOTHING_IDENTIFIED


def _identified(run: Run, rig: RigFile, native: Native) -> Identification:
    """The answer with advice; a refusal has the advice in front of its sentence."""
    from pvid.run.advice import advice, advice_on_refusal, behind

    try:
        result = identify(run, rig, native)
    except PvidError as error:
        raise behind(advice_on_refusal(run, rig, native), error) from error
    return replace(result, notes=run.notes, advice=advice(run, rig, result, native))


@commands.command(name="compare")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@_form_options
@click.option("--core", type=click.Choice(["f32", "q31", "all"]), help="Which arithmetic.  [default: the rig file's]")
@click.option("--on", "targets", metavar="TARGET", multiple=True, help="Also there: emulator, serial port, all.")
def compare_command(
    run_path: Path,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: Columns | None,
    law: str | None,
    form: str | None,
    core: str | None,
    targets: tuple[str, ...],
) -> int:
    """Compares the C core with its numpy twin on RUN, after every tick, in every bit: start and tables are those of
    identify.

    With --on the run is streamed to targets, too, and their running hashes are held against the host's.
    """
    from pvid.board.compare_on import Outcome, compare_here, compare_there
    from pvid.board.target import targets_of

    rig = _with(rig_for(run_path, rig_path, settings), form=form)
    run = read_input(run_path, rig, columns)
    rig = fitted(rig, run)
    native = Native()
    own = "q31" if rig.identifier.core == "q31" else "f32"
    outcomes: list[Outcome] = []
    for arithmetic in ["f32", "q31"] if core == "all" else [core or own]:
        for one in [law] if law else ["stationary", "pseudovelocity"]:
            chosen = replace(rig, identifier=replace(rig.identifier, law=one, core=arithmetic))  # type: ignore[arg-type]
            with progress_bar(f"{one} law, {arithmetic}", len(run.t)) as advance:
                outcomes.append(compare_here(chosen, run, native, advance))
            for target in targets_of(targets):
                with progress_bar(f"{one} law, {arithmetic} on {target}", len(run.t)) as advance:
                    outcomes.append(compare_there(target, chosen, run, native, advance))
    table = Table("target", "core", "form", "law", "ticks", "hash", "verdict")
    for outcome in outcomes:
        table.add_row(*outcome.cells)
    Console(width=None if sys.stdout.isatty() else 140).print(table)
    return DONE if all(outcome.equal for outcome in outcomes) else DIFFERENT


# ---- tune


@commands.command(name="tune")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@rig_options
@columns_option
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Rig file to write.  [default: RUN-tuned.toml]")
def tune_command(
    run_path: Path, rig_path: Path | None, settings: tuple[str, ...], columns: Columns | None, out: Path | None
) -> int:
    """Picks the weak form's settings for a recorded RUN: equations (full angles, friction), window, test functions,
    pass band, decimation, forgetting.

    The rig file's own settings are kept unless others predict blocks of the run that are held back better, by more than
    chance explains, or as well and with clearly smaller standard errors. An answer that `identify` gives is never lost.
    Writes a rig file with all settings explicit, with which `identify` gives the answer that is printed.
    """
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

        raise behind(_identified(run, resolved(rig, run), native).advice, error) from error
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
    _print_warning(tuned.answer)
    click.echo(f"rig file: {out}")
    return DONE


# ---- tables for the core


@commands.command(name="link-schema")
def link_schema() -> int:
    """Prints firmware/link/schema.h: what stands in the frames of the serial link."""
    from pvid.link.frames import c_header

    click.echo(c_header(), nl=False)
    return DONE


@commands.command(name="fir-table")
@click.option("--points", default=241, show_default=True, help="Points of the Savitzky-Golay window, odd.")
@click.option("--degree", default=12, show_default=True, help="Degree of its polynomial, 4 to 12.")
@click.option("--difference", is_flag=True, help="Five-point central differences instead.")
@click.option("--stride", default=1, show_default=True, help="Samples between points.")
@click.option("--name", default="fir_bank", show_default=True, help="Name of the array in C.")
@click.option("--check", type=click.Path(path_type=Path), help="Only tell whether this file is what would be printed.")
def fir_table(points: int, degree: int, difference: bool, stride: int, name: str, check: Path | None) -> int:
    """Prints a bank of derivative filters as a C header for pvid_fir_bank_f32."""
    bank = finite_difference(stride) if difference else savitzky_golay(points, degree, stride)
    kind = "--difference" if difference else f"--points {points} --degree {degree}"
    return _print_header(bank_header(bank, name, f"pvid fir-table {kind} --stride {stride} --name {name}"), check)


@commands.command(name="weak-table")
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), required=True, help="The rig file (TOML).")
@click.option("--name", default="weak_tables", show_default=True, help="Name of the design in C.")
@click.option("--check", type=click.Path(path_type=Path), help="Only tell whether this file is what would be printed.")
@click.option("--core", type=click.Choice(["f32", "q31"]), default="f32", show_default=True, help="Which arithmetic.")
@click.option("--run", "run_path", type=click.Path(path_type=Path), help="Tables for the rig that this run shows.")
def weak_table(rig_path: Path, name: str, check: Path | None, core: str, run_path: Path | None) -> int:
    """Prints the weak form's tables for a rig as a C header for pvid_weak_config_f32 or _q31.

    Their sizes follow the modes of the rig file's guess; with --run those that a recorded run shows, as in identify.
    For q31 the whole configuration is printed, and on standard error by how many bits each quantity stays clear of
    overflow at full scale.
    """
    rig = _with(load(rig_path), form="weak")
    shown = f"--rig {rig_path.name}"
    run = None
    if run_path is not None:
        run = read_input(run_path, rig)
        rig = replace(fitted(rig, run), sample_rate=run.sample_rate)
        shown += f" --run {run_path.name}"
    if rig.sample_rate is None:
        raise PvidError(f"{rig_path}: sample_rate is missing, and the tables hang on it")
    if core == "q31":
        config = weak_config_q31(rig, rig.sample_rate) if run is None else config_for_run(rig, run)
        assert isinstance(config, WeakConfigQ31)  # by the form
        margins = ", ".join(f"{name} {bits:.2f}" for name, bits in config.design.margins.items())
        write_stderr(f"bits to spare at full scale: {margins}")
        _print_raised(config.design)
        made_by = f"pvid weak-table --core q31 {shown} --name {name}"
        return _print_header(to_c_header_q31(config, rig.l1, name, made_by), check)
    tables = weak_design_of(rig, rig.sample_rate)
    write_stderr(
        f"taps {tables.taps}, decimation {tables.decimation}, windows of {tables.window} samples "
        f"({tables.window_s:g} s), {tables.functions} test functions; {tables.flash_bytes} bytes of flash; "
        f"{tables.update_rate_hz:.2f} answers a second"
    )
    _print_raised(tables)
    return _print_header(to_c_header(tables, name, f"pvid weak-table {shown} --name {name}"), check)


def _print_raised(design: SizesOfDesign) -> None:
    """On standard error what pvid/config.h must be told, where a design exceeds its defaults."""
    raised = [f"-D{macro}={value}" for macro, value in raised_bounds(design).items()]
    if raised:
        write_stderr(f"build the core with {' '.join(raised)}")


@commands.command(name="strong-table")
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), required=True, help="The rig file (TOML).")
@click.option("--name", default="strong_config", show_default=True, help="Name of the configuration in C.")
@click.option("--check", type=click.Path(path_type=Path), help="Only tell whether this file is what would be printed.")
def strong_table(rig_path: Path, name: str, check: Path | None) -> int:
    """Prints the fixed-point strong form's weights, formats and settings for a rig as a C header.

    On standard error by how many bits each derivative stays clear of overflow at full scale. The float core's weights
    are printed by fir-table.
    """
    rig = load(rig_path)
    if rig.sample_rate is None:
        raise PvidError(f"{rig_path}: sample_rate is missing, and the formats hang on it")
    config = strong_config_q31(rig, rig.sample_rate)
    margins = ", ".join(f"{name} {bits:.2f}" for name, bits in config.design.margins.items())
    write_stderr(f"bits to spare at full scale: {margins}")
    made_by = f"pvid strong-table --rig {rig_path.name} --name {name}"
    return _print_header(strong_header_q31(config, rig.l1, name, made_by), check)


@commands.command(name="design")
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
@click.option("--release", nargs=2, type=float, help="phi1, phi1+phi [rad] that a predicted run starts from, at rest.")
@click.option("--duration", type=float, help="Length to predict for [s].  [default: the run's, else 40]")
@click.option("--json", "as_json", is_flag=True, help="Prints one JSON object.")
def design_command(
    rig_path: Path | None,
    settings: tuple[str, ...],
    run_path: Path | None,
    columns: Columns | None,
    tones: tuple[str, ...],
    release: tuple[float, float] | None,
    duration: float | None,
    as_json: bool,
) -> int:
    """Predicts what the weak form's tables for a rig will give: standard errors, kappa, delay, memory, instructions.

    The rig file holds no drive: it comes from a recorded run, or from tones. The tables themselves are printed by
    weak-table.
    """
    from pvid.run.design_report import report_for_run, report_for_tones

    rig = rig_for(run_path, rig_path, settings)
    if duration is not None and not 0 < duration < float("inf"):
        raise PvidError(f"the duration must be a positive number of seconds, not {duration:g}")
    if run_path is None:
        if columns is not None:
            raise PvidError("--columns is for the run: name it with --run")
        drive = tuple(_tone(text) for text in tones) or STANDARD_DRIVE
        report = report_for_tones(rig, drive, release or STANDARD_RELEASE, duration or 40.0)
    elif tones or release:
        raise PvidError("--run says how the rig was driven: leave --tone and --release out")
    else:
        report = report_for_run(rig, read_input(run_path, rig, columns, whole=True), duration)
    if as_json:
        click.echo(json.dumps(report.as_json()))
        return DONE
    table = Table("parameter", "predicted at", "standard error", "%", title=f"a run of {report.duration:g} s")
    model = rig.mechanism.model
    for name, value in report.value.items():
        share = f"{100 * report.se[name] / abs(value):.2g}" if name != model.offset_name else ""
        label = escape(model.answer(name).name_and_unit)
        table.add_row(label, *with_error(value, report.se[name]), share)
    Console().print(table)
    click.echo(f"kappa {report.kappa:.2g}; noise of a row {report.row_sd:.2g} rad")
    for name, text in report.cost_rows():
        click.echo(f"{name}: {text}")
    return DONE


def _print_header(header: str, check: Path | None) -> int:
    """Prints a generated header, or tells whether the file `check` is the same."""
    if check is None:
        click.echo(header, nl=False)
        return DONE
    try:
        same = check.read_text(encoding="utf-8") == header
    except (OSError, UnicodeDecodeError) as error:
        raise PvidError(f"cannot read {check}: {error}") from error
    click.echo(f"{check}: {'as generated' if same else 'DIFFERENT from what this command generates'}")
    return DONE if same else DIFFERENT


# ---- sizes


@commands.command(name="sizes")
@UPDATE
@click.option("--budget", type=click.Path(path_type=Path, exists=True), help="Write the figures as this file's budget.")
@click.option("--check", type=click.Path(path_type=Path, exists=True), help="Hold the figures against this budget.")
@click.option("--profile", "profiled", metavar="BOARD", help="Where a tick's instructions go on a board, by function.")
def sizes_command(update: Path | None, budget: Path | None, check: Path | None, profiled: str | None) -> int:
    """Flash, RAM, stack and instructions a tick on every board, built and run in its emulator."""
    from pvid.board import sizes

    if profiled is not None:
        if budget is not None or check is not None:
            raise PvidError("--profile has no budget: leave --budget and --check out")
        from pvid.board import boards, profile

        profiles = {form: profile.profile(boards.board(profiled), form) for form in ("strong", "weak")}
        put_table(update, "profile", markdown(profile.HEADER, profile.table_rows(profiles)))
        return DONE
    footprints = {}
    with progress_bar("boards", len(sizes.CONFIGURATIONS)) as advance:
        for done, configuration in enumerate(sizes.CONFIGURATIONS):
            footprints[configuration] = sizes.measure(configuration)[0]
            advance(done + 1)
    put_table(update, "sizes", markdown(sizes.HEADER, sizes.table_rows(footprints)))
    if budget is not None:
        sizes.write_budget(budget, footprints)
    excess = sizes.over_budget(check, footprints) if check is not None else []
    for sentence in excess:
        write_stderr(f"pvid: over budget: {sentence}")
    return DIFFERENT if excess else DONE
