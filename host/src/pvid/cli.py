"""The command line: `./tools/pvid COMMAND`.

Exit codes: 0 done, 1 a comparison failed, 2 bad input or usage, or output that cannot be written (one sentence),
3 nothing identified, 130 interrupted, 141 the reader of the output has gone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pvid import __version__, answer
from pvid.appearing import write_whole
from pvid.capture import Run, write_run
from pvid.cli_campaign import COMMANDS as CAMPAIGN_COMMANDS
from pvid.cli_input import FigurePath, columns_option, print_notes, read_input, rig_options
from pvid.cli_log import COMMANDS as LOG_COMMANDS
from pvid.compare import Comparison
from pvid.console import BAD_INPUT, DIFFERENT, DONE, INTERRUPTED, NOTHING_IDENTIFIED, progress_bar, tell
from pvid.ctables import bank_header
from pvid.differentiation import finite_difference, savitzky_golay
from pvid.errors import PvidError
from pvid.identify import UNITS, ZERO, Identification, identify
from pvid.native import Native
from pvid.native_q31 import WeakConfigQ31
from pvid.rig import (
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
from pvid.rig_settings import rig_for, rig_path_of
from pvid.rigfile import RigFile, load
from pvid.rounding import with_error
from pvid.run_columns import Columns
from pvid.sensor_steps import resolution_note, resolved
from pvid.setup import weak_design_of
from pvid.setup_q31 import config_for_run, strong_config_q31, weak_config_q31
from pvid.streams import watch
from pvid.strong_header_q31 import strong_header_q31
from pvid.survey import fitted
from pvid.weak_design import to_c_header
from pvid.weak_header_q31 import to_c_header_q31
from pvid.weak_sizing import SizesOfDesign, raised_bounds
from pvid.wording import reason


def main() -> None:
    """Runs a command and turns every refusal into one sentence and its exit code."""
    watch()
    os.environ.pop("MPLBACKEND", None)  # figures are files here, and matplotlib stumbles over a backend it lacks
    try:
        code = commands.main(prog_name="pvid", standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.Abort:
        tell("pvid: interrupted")
        code = INTERRUPTED
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        help_hint = f" (see {context.command_path} --help)" if context is not None else ""
        tell(f"pvid: {error.format_message()}{help_hint}")
        code = BAD_INPUT
    except PvidError as error:
        tell(f"pvid: {error}")
        code = BAD_INPUT
    except OSError as error:
        tell(f"pvid: {'' if error.filename is None else f'{error.filename}: '}{reason(error)}")
        code = BAD_INPUT
    except MemoryError as error:
        told = f" ({reason(error)})" if str(error) else ""
        tell(f"pvid: there is not enough memory{told}: is a length, a rate or a count too large?")
        code = BAD_INPUT
    sys.exit(code if isinstance(code, int) else DONE)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="pvid", message="%(prog)s %(version)s")
def commands() -> None:
    """Identifies the parameters of a mechanism, and proves the C core bit for bit."""


for _command in (*LOG_COMMANDS, *CAMPAIGN_COMMANDS):
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
    from pvid.demo import play_demo, stage

    on = stage()
    if on.lacking is not None:
        tell(f"{on.lacking}: the firmware runs on {on.where}")
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
    tell(
        f"standard rig, {truth} equations, {bits}-bit encoder, {run.t[-1]:.0f} s at {run.sample_rate:g} Hz; "
        f"start {', '.join(f'{100 * (s / p - 1):+.0f} %' for s, p in zip(start, simulation.p, strict=True))} off"
    )
    truths = _truths(simulation.pendulum)
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
    from pvid.figures import (
        convergence,
    )  # matplotlib takes half a second that other commands need not wait for

    convergence(result, path, truth=truths)
    click.echo(f"figure: {path}")


def _truths(pendulum: Pendulum) -> dict[str, float]:
    w, d1, d2 = pendulum.linear
    return {"w": w, "d1": d1, "d2": d2, "g": pendulum.g, "l2": pendulum.l2, "rho2": pendulum.rho2, "c": 0.0}


def _print_result(result: Identification, rig: RigFile, truths: dict[str, float] | None = None) -> None:
    table = answer.table(result, truths)
    if table is not None:
        Console().print(table)
    for line in (answer.error_line(result, rig.sensor.y_gain_sd, rig.l1_sd), answer.status_line(result)):
        if line is not None:
            click.echo(line)


def _print_warning(result: Identification) -> None:
    if result.warning is not None:
        tell(f"pvid: warning: {result.warning}")


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
    tell(f"{out}: {len(simulation.run.t)} samples, |phi| up to {largest:.3f} rad; rig file {rig_path}")
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
        from pvid.stream_rig import played_samples, stream_rig
        from pvid.target import verify

        image = stream_rig(fitted(rig, run), run.sample_rate, run)
        with progress_bar(f"streaming to {target}", len(run.t)) as advance:
            verdict = verify(target, image, native, *played_samples(rig, run), progress=advance)
        tell(f"{target}: {verdict.playback.account}")
        if not verdict.equal:
            tell(f"pvid: {target}: {verdict.text}")
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
        tell(f"pvid: nothing identified: {result.verdict}")
    for sentence in result.advice:
        tell(f"pvid: advice: {sentence}")
    return DONE if result.identified else NOTHING_IDENTIFIED


def _identified(run: Run, rig: RigFile, native: Native) -> Identification:
    """The answer with advice; a refusal has the advice in front of its sentence."""
    from pvid.advice import advice, advice_on_refusal, behind

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
    from pvid.compare_on import Outcome, compare_here, compare_there
    from pvid.target import targets_of

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
    from pvid.tune import STEPS, tune
    from pvid.tune_table import candidates_table

    rig = rig_for(run_path, rig_path, settings)
    run = read_input(run_path, rig, columns)
    native = Native()
    try:
        with progress_bar("tuning", STEPS) as advance:
            tuned = tune(run, rig, native, advance)
    except PvidError as error:
        from pvid.advice import behind

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
    from pvid.link import c_header

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
        tell(f"bits to spare at full scale: {margins}")
        _print_raised(config.design)
        made_by = f"pvid weak-table --core q31 {shown} --name {name}"
        return _print_header(to_c_header_q31(config, rig.l1, name, made_by), check)
    tables = weak_design_of(rig, rig.sample_rate)
    tell(
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
        tell(f"build the core with {' '.join(raised)}")


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
    tell(f"bits to spare at full scale: {margins}")
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
    from pvid.design_report import report_for_run, report_for_tones

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
    for name, value in report.value.items():
        share = f"{100 * report.se[name] / abs(value):.2g}" if name != ZERO else ""
        label = escape(f"{name} [{UNITS[name]}]" if UNITS[name] else name)
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


# ---- bench


@commands.group()
def bench() -> None:
    """Measures what the README and the benchmark pages claim and prints it as tables."""


def _update_readme(readme: Path | None, marker: str, text: str) -> None:
    """Replaces what stands between <!-- marker --> and <!-- /marker -->, or prints it when no file is given."""
    if readme is None:
        click.echo(text)
        return
    old = readme.read_text(encoding="utf-8")
    opening, closing = f"<!-- {marker} -->", f"<!-- /{marker} -->"
    if opening not in old or closing not in old:
        raise PvidError(f"{readme} has no place for this table: the lines {opening} and {closing}")
    head, rest = old.split(opening, 1)
    tail = rest.split(closing, 1)[1]
    write_whole(readme, f"{head}{opening}\n{text}\n{closing}{tail}")
    tell(f"{readme}: table {marker} written")


_UPDATE = click.option(
    "--update",
    type=click.Path(path_type=Path, exists=True),
    help="Write the table into this file's place for it.",
)


@bench.command(name="demo")
@_UPDATE
def bench_demo(update: Path | None) -> int:
    """What the demo prints, as the README shows it."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-P", "-m", "pvid", "demo"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != DONE:
        raise PvidError(f"the demo failed: {(done.stderr or done.stdout).strip()[-300:]}")
    _update_readme(update, "demo", f"```\n{done.stdout.rstrip()}\n```")
    return DONE


@bench.command(name="laws")
@_UPDATE
def bench_laws(update: Path | None) -> int:
    """Both laws on exact derivatives: how many of 40 starts reach 1 % and 0.01 %."""
    from pvid.bench import laws

    with progress_bar("laws", laws.NUMBER_OF_ROWS) as advance:
        rows = [row.cells() for row in laws.laws_table(Native(), advance)]
    _update_readme(update, "laws", _markdown(laws.HEADER, rows))
    return DONE


@bench.command(name="strong")
@_UPDATE
def bench_strong(update: Path | None) -> int:
    """Errors of the strong form by encoder resolution and differentiator."""
    from pvid.bench import strong

    with progress_bar("strong form", len(strong.CASES)) as advance:
        rows = list(strong.strong_table(Native(), advance))
    _update_readme(update, "strong", _markdown(strong.HEADER, rows))
    return DONE


@bench.command(name="weak")
@_UPDATE
def bench_weak(update: Path | None) -> int:
    """Errors of the weak form by encoder and zero, beside the Cramer-Rao bound."""
    from pvid.bench import weak

    with progress_bar("weak form", len(weak.CASES)) as advance:
        rows = list(weak.weak_table(Native(), advance))
    _update_readme(update, "weak", _markdown(weak.HEADER, rows))
    return DONE


@bench.command(name="tune")
@_UPDATE
def bench_tune(update: Path | None) -> int:
    """Errors against the truth with the default settings and with those that `tune` picks, on several rigs."""
    from pvid.bench import tuning

    with progress_bar("tuning", len(tuning.CASES) * tuning.SEEDS) as advance:
        rows = list(tuning.tuning_table(Native(), advance))
    _update_readme(update, "tune", _markdown(tuning.HEADER, rows))
    return DONE


@bench.command(name="cost")
@_UPDATE
def bench_cost(update: Path | None) -> int:
    """Instructions a tick by stage, by callgrind, beside recursive least squares (needs valgrind)."""
    from pvid.bench import cost

    with tempfile.TemporaryDirectory() as folder:
        costs = {level: cost.stage_costs(cost.build(Path(folder), level=level)) for level in ("-O2", "-O3")}
        state_bytes = cost.state_bytes(Path(folder))
    _update_readme(update, "cost", cost.as_markdown(costs, state_bytes))
    return DONE


@bench.command(name="design-cost")
@click.option("--update", is_flag=True, help="Write the coefficients that `pvid design` computes with.")
def bench_design_cost(update: bool) -> int:
    """Instructions of the weak form over a grid of designs beside the formula of `pvid design` (needs valgrind)."""
    from pvid import weak_cost
    from pvid.bench import design_cost

    with progress_bar("designs", len(design_cost.GRID)) as advance:
        spreads = design_cost.measured_grid(advance)
    mean, longest = design_cost.fit(spreads) if update else weak_cost.coefficients()
    if update:
        write_whole(weak_cost.COEFFICIENTS_FILE, design_cost.as_toml(mean, longest))
        tell(f"{weak_cost.COEFFICIENTS_FILE.name} written")
    click.echo(_markdown(design_cost.HEADER, design_cost.rows(spreads, mean, longest)))
    return DONE


@bench.command(name="hard")
@_UPDATE
def bench_hard(update: Path | None) -> int:
    """Noise until the answer fails, little motion or drive, one mode, friction, large angles: 40 runs a case."""
    from pvid.bench import hard

    with progress_bar("hard cases", len(hard.CASES) * hard.SEEDS) as advance:
        rows = list(hard.hard_table(Native(), progress=advance))
    _update_readme(update, "hard", _markdown(hard.HEADER, rows))
    return DONE


@bench.command(name="longevity")
@click.option("--ticks", type=click.IntRange(50_000), help="Of each run. Default: 10^7; 10^6 held out or on a board.")
@click.option("--scenario", "chosen", multiple=True, help="Only this one; may be given again. Default: all.")
@click.option(
    "--columns", "columns", multiple=True, help="Likewise: weak, strong, weak-q31, strong-q31, strong-fine, peers."
)
@click.option("--processes", default=2, show_default=True, type=click.IntRange(1, 64), help="At a time.")
@click.option("--held-out", is_flag=True, help="Disturbances of other sizes, times, seeds and drives.")
@click.option("--on", "board", metavar="BOARD", help="In this emulator, hash for hash with this machine: mps2-an386.")
@_UPDATE
def bench_longevity(
    ticks: int | None,
    chosen: tuple[str, ...],
    columns: tuple[str, ...],
    processes: int,
    held_out: bool,
    board: str | None,
    update: Path | None,
) -> int:
    """Millions of ticks of every disturbance, beside textbook and UD recursive least squares (needs gcc).

    What is done is kept in build/longevity, for the present core: the next call goes on from there.
    """
    from pvid.bench import longevity_tables as kept
    from pvid.bench import longevity_target
    from pvid.bench.longevity import COLUMNS, OURS
    from pvid.bench.longevity_signals import HELD_OUT, SCENARIOS
    from pvid.boards import board as board_of

    for name, given, known in (("scenario", chosen, SCENARIOS), ("column", columns, COLUMNS)):
        unknown = set(given) - set(known)
        if unknown:
            raise PvidError(f"no such {name}: {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    scenarios = chosen or tuple(SCENARIOS)
    if board is not None:
        runs = longevity_target.combinations(scenarios, columns or OURS)
        with tempfile.TemporaryDirectory() as folder, progress_bar("longevity", len(runs)) as advance:
            rows = longevity_target.run_missing_on(board_of(board), ticks or 1_000_000, runs, Path(folder), advance)
        _update_readme(update, "longevity-board", _markdown(longevity_target.HEADER, rows))
        return DONE if all(row[-1] == "equal" for row in rows) else DIFFERENT
    if held_out:
        ticks = ticks or kept.HELD_OUT_TICKS
        tasks = kept.tasks_of((one for one in HELD_OUT if one.kind in scenarios), columns or OURS, ticks)
    else:
        ticks = ticks or kept.TICKS
        tasks = kept.tasks_of((SCENARIOS[name] for name in scenarios), columns or COLUMNS, ticks)
    with tempfile.TemporaryDirectory() as folder, progress_bar("longevity", len(tasks)) as advance:
        kept.run_missing(tasks, Path(folder), processes, advance)
    for marker, header, rows in [kept.held_out_table(ticks)] if held_out else kept.tables(ticks):
        if rows:
            _update_readme(update, marker, _markdown(header, rows))
    return DONE


@bench.command(name="noise")
@_UPDATE
def bench_noise(update: Path | None) -> int:
    """Bias by the noise inside the weak form's rows, as it is and with that noise taken off, in float64."""
    from pvid.bench import noise

    with progress_bar("noise in the rows", len(noise.CASES)) as advance:
        rows = list(noise.noise_table(Native(), progress=advance))
    _update_readme(update, "noise", _markdown(noise.HEADER, rows))
    return DONE


@bench.command(name="reading")
@_UPDATE
def bench_reading(update: Path | None) -> int:
    """Processor time and memory of reading runs of ten minutes at 1 kHz and of 10^7 samples."""
    from pvid.bench import reading

    _update_readme(update, "reading", _markdown(reading.HEADER, list(reading.reading_table())))
    return DONE


@bench.command(name="fuzz-link")
@click.option("--runs", default=10_000_000, show_default=True, type=click.IntRange(min=1))
def bench_fuzz_link(runs: int) -> int:
    """The C side of the serial link under libFuzzer, with sanitizers (needs clang)."""
    from pvid.bench.fuzz import fuzz_link

    folder = Path(tempfile.mkdtemp(prefix="pvid-fuzz-"))
    click.echo(f"{fuzz_link(folder, runs)} inputs, none broke the codec")
    return DONE


@bench.command(name="fuzz-api")
@click.option("--calls", default=10_000_000, show_default=True)
@click.option("--seed", default=1, show_default=True)
def bench_fuzz_api(calls: int, seed: int) -> int:
    """Random calls of the C core's public API, with sanitizers (needs clang)."""
    from pvid.bench.fuzz import fuzz_api

    with tempfile.TemporaryDirectory(prefix="pvid-fuzz-") as folder:
        click.echo(fuzz_api(Path(folder), calls, seed).text)
    return DONE


@bench.command(name="codec")
@click.option("--frames", default=1_000_000, show_default=True, type=click.IntRange(min=1))
def bench_codec(frames: int) -> int:
    """Corrupted frames of every length against both decoders of the serial link."""
    from pvid.bench.codec import corrupt

    with progress_bar("corrupted frames", frames) as advance:
        tally = corrupt(frames, Native(), progress=advance)
    click.echo(
        f"{tally.frames} corrupted frames, C and Python alike: {tally.wrong} let through wrong; of the good frames "
        f"behind them the first was lost {tally.lost_first} times, the second {tally.lost_second} times"
    )
    return DIFFERENT if tally.wrong or tally.lost_second else DONE


@bench.command(name="log")
@click.option("--frames", default=200_000, show_default=True, type=click.IntRange(min=1000))
def bench_log(frames: int) -> int:
    """Frames a minute of processor time through `pvid log`, losses, memory."""
    from pvid.bench.field import throughput

    seen = throughput(frames)
    click.echo(
        f"{seen.frames} of {frames} frames, {seen.lost} lost; {seen.cpu_s:.1f} s of processor time, "
        f"{60 * seen.frames / seen.cpu_s:.0f} frames a minute of it; resident memory {seen.early_kb} kB after a "
        f"quarter, {seen.late_kb} kB at the end"
    )
    return DONE if seen.frames == frames and not seen.lost else DIFFERENT


@bench.command(name="liar")
@_UPDATE
@click.option("--mutants", default=100_000, show_default=True, help="Frames changed at random.")
@click.option("--only", metavar="BEHAVIOUR", multiple=True, help="A behaviour named in the table; repeatable.")
def bench_liar(update: Path | None, mutants: int, only: tuple[str, ...]) -> int:
    """A board that sends false data, against `pvid log` and all readers of its logs; then mutants of frames."""
    from pvid.bench import liar
    from pvid.bench.liar_mutants import mutate
    from pvid.bench.lies import BEHAVIOURS

    if unknown := [name for name in only if name not in BEHAVIOURS]:
        raise PvidError(f"there is no behaviour {', '.join(unknown)}")
    chosen = [BEHAVIOURS[name] for name in only] or list(BEHAVIOURS.values())
    performances = []
    with tempfile.TemporaryDirectory() as folder:
        with progress_bar("lies", len(chosen)) as advance:
            for behaviour in chosen:
                performances.append(one := liar.perform(behaviour, Path(folder)))
                for fault in one.faults:
                    click.echo(f"{behaviour.name}: {fault}", err=True)
                advance(len(performances))
        with progress_bar("mutants", mutants) as advance:
            tally = mutate(mutants, Path(folder), progress=advance)
    for fault in tally.faults:
        click.echo(fault, err=True)
    faults = sum(len(one.faults) for one in performances)
    _update_readme(update, "liar", _markdown(liar.HEADER, [one.cells() for one in performances]))
    runs = sum(len(one.codes) for one in performances)
    summary = (
        f"{len(performances)} behaviours, {runs} runs of a command: {faults} defects, at most "
        f"{max((one.peak_kb for one in performances), default=0) / 1024:.0f} MB of memory, at most "
        f"{max((one.late_s for one in performances), default=0):.1f} s late. {tally.mutants} mutants in {tally.logs} "
        f"logs: {len(tally.faults)} defects."
    )
    _update_readme(update, "liar-summary", summary)
    return DIFFERENT if faults or tally.faults else DONE


@bench.command(name="attack")
@click.option("--mutants", default=33_400, show_default=True, type=click.IntRange(min=1), help="Of each kind.")
@click.option("--seed", default=1, show_default=True, help="Of the mutants.")
@click.option("--only", type=click.Choice(["rigs", "runs", "commands"]), multiple=True, help="May be given again.")
@click.option("--processes", default=2, show_default=True, type=click.IntRange(1, 64), help="At a time.")
@click.option("--keep", type=click.Path(path_type=Path, file_okay=False), help="Folder for files that caused a defect.")
@_UPDATE
def bench_attack(
    mutants: int, seed: int, only: tuple[str, ...], processes: int, keep: Path | None, update: Path | None
) -> int:
    """Runs mutated rig files, runs and command lines, and counts defects."""
    from pvid.bench.attack import HEADER, KINDS, campaign

    kinds = only or KINDS
    with progress_bar("mutants", mutants * len(kinds)) as advance:
        tallies = campaign(kinds, mutants, seed, processes, advance, keep and keep.resolve())
    for tally in tallies:
        for arguments, wrong, number in tally.defects:
            tell(f"{tally.kind}, mutant {number}: {' '.join(arguments)}: {wrong}")
    _update_readme(update, "attack", _markdown(HEADER, [tally.cells for tally in tallies]))
    return DIFFERENT if any(tally.defects for tally in tallies) else DONE


@bench.command(name="field-log")
@click.option("--on", "target", default="mps2-an386", show_default=True, help="Emulator, or stream-host.")
@click.option(
    "--samples", default=3_600_000, show_default=True, type=click.IntRange(min=10_000), help="An hour at 1 kHz."
)
@click.option("--out", type=click.Path(path_type=Path), default=Path("field-log.pvlog"), show_default=True)
def bench_field_log(target: str, samples: int, out: Path) -> int:
    """An hour in the field, shortened in time: the board killed twice, its line closed once, every segment verified."""
    from pvid.bench.field import field_log
    from pvid.logverify import Verdict

    with progress_bar("verifying", samples) as advance:
        account, stretches = field_log(target, samples, out, advance)
    verdict = Verdict()
    for stretch in stretches:
        click.echo(stretch.text)
        verdict.add(stretch)
    click.echo(verdict.text)
    click.echo(account.text)
    whole = len(verdict.good) == len(account.segments) and not verdict.different and not account.missing_samples
    return DONE if whole else DIFFERENT


@bench.command(name="year")
@click.option("--on", "target", default="mps2-an386", show_default=True, help="Emulator, or stream-host.")
@click.option("--core", default="f32", show_default=True, type=click.Choice(["f32", "q31"]))
@click.option("--form", default="weak", show_default=True, type=click.Choice(["weak", "strong"]))
@click.option("--samples", default=20_000, show_default=True, help="At each passage.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("year.pvlog"), show_default=True)
def bench_year(target: str, core: str, form: str, samples: int, out: Path) -> int:
    """A year at 1 kHz, by a tick counter started before each passage of 2^32: log, verify, exports, plot, page."""
    from pvid.bench.year import emulated_year, passages_of_a_year, rig_of

    if out.exists():
        raise PvidError(f"{out} exists")
    rig = rig_of(core, form)
    passages = tuple(range(1, 1 + passages_of_a_year(rig.sample_rate or 0.0)))
    with progress_bar("verifying", None) as advance:
        year = emulated_year(target, passages, samples, out, rig, advance)
    click.echo(f"{year.passages} passages of 2^32 ticks; {year.verdict.text}")
    click.echo(year.account.text)
    for sentence in year.faults:
        click.echo(f"pvid: {sentence}", err=True)
    return DIFFERENT if year.faults or not year.verdict.verified else DONE


@bench.command(name="side-by-side")
@_UPDATE
def bench_side_by_side(update: Path | None) -> int:
    """Every method on the same data: both forms, a Kalman filter, output error (counts need valgrind)."""
    from pvid.bench import cost, side_by_side

    with tempfile.TemporaryDirectory() as folder:
        counted = {one.stage: one.instructions for one in cost.stage_costs(cost.build(Path(folder)))}
    with progress_bar("side by side", side_by_side.NUMBER_OF_ROWS) as advance:
        rows = list(side_by_side.side_by_side(Native(), instructions=counted, progress=advance))
    _update_readme(update, "side-by-side", _markdown(side_by_side.HEADER, rows))
    return DONE


# ---- sizes


@commands.command(name="sizes")
@_UPDATE
@click.option("--budget", type=click.Path(path_type=Path, exists=True), help="Write the figures as this file's budget.")
@click.option("--check", type=click.Path(path_type=Path, exists=True), help="Hold the figures against this budget.")
@click.option("--profile", "profiled", metavar="BOARD", help="Where a tick's instructions go on a board, by function.")
def sizes_command(update: Path | None, budget: Path | None, check: Path | None, profiled: str | None) -> int:
    """Flash, RAM, stack and instructions a tick on every board, built and run in its emulator."""
    from pvid import sizes

    if profiled is not None:
        if budget is not None or check is not None:
            raise PvidError("--profile has no budget: leave --budget and --check out")
        from pvid import boards, profile

        profiles = {form: profile.profile(boards.board(profiled), form) for form in ("strong", "weak")}
        _update_readme(update, "profile", _markdown(profile.HEADER, profile.table_rows(profiles)))
        return DONE
    footprints = {}
    with progress_bar("boards", len(sizes.CONFIGURATIONS)) as advance:
        for done, configuration in enumerate(sizes.CONFIGURATIONS):
            footprints[configuration] = sizes.measure(configuration)[0]
            advance(done + 1)
    _update_readme(update, "sizes", _markdown(sizes.HEADER, sizes.table_rows(footprints)))
    if budget is not None:
        sizes.write_budget(budget, footprints)
    excess = sizes.over_budget(check, footprints) if check is not None else []
    for sentence in excess:
        tell(f"pvid: over budget: {sentence}")
    return DIFFERENT if excess else DONE


def _markdown(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])
