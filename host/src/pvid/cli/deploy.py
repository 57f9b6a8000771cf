"""`pvid deploy`: the identifier of a mechanism and its rig as a package of an ecosystem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pvid.base.console import DONE, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.cli.input import columns_option, force_option
from pvid.cli.rig_design import analysis_of, model_of_rig, recorded
from pvid.settings.cores import CORES, FIXED, FLOAT

if TYPE_CHECKING:
    from pvid.configuration.excitation import Excitation
    from pvid.deploy.deployment import Deployment
    from pvid.model.compiled import CompiledModel
    from pvid.oracle.weak.design import Reversals
    from pvid.rig.mechanism_file import MechanismRig
    from pvid.settings.enums import Core
    from pvid.settings.refine import RefineConfig

_DEFAULT = FLOAT.name
_TARGETS = ("arduino", "platformio", "esp-idf", "zephyr", "cmake", "cubemx", "amalgamation")


@click.command(name="deploy")
@click.argument("model", metavar="MODEL")
@click.option("--for", "target", required=True, type=click.Choice(_TARGETS), help="The ecosystem.")
@click.option("-o", "--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder to write.")
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="Rig file, whose values are the model's.")
@click.option("--run", "run_path", type=click.Path(path_type=Path), help="A recording of the rig, for its design.")
@columns_option
@click.option("--core", type=click.Choice(list(CORES)), default=_DEFAULT, show_default=True, help="Arithmetic.")
@click.option("--functions", type=click.IntRange(4, 64), help="Test functions of the design.  [default: chosen]")
@click.option(
    "--ram", type=click.IntRange(1), help="Most RAM of the first stage [bytes]: fewer test functions if needed."
)
@click.option(
    "--ticks",
    type=click.IntRange(1),
    help="Most instructions of a tick of the first stage on a Cortex-M4F: fewer test functions if needed. Needs "
    "pvid's repository, arm-none-eabi-gcc and QEMU.",
)
@force_option
def command(
    model: str,
    target: str,
    out: Path,
    rig_path: Path | None,
    run_path: Path | None,
    columns: str | None,
    core: Core,
    functions: int | None,
    ram: int | None,
    ticks: int | None,
) -> int:
    """Writes MODEL with the tables of a rig as an Arduino, PlatformIO, ESP-IDF, Zephyr, CMake or CubeMX package.

    OUT gets the sources of the C core with the smallest sizes that hold the rig, its configuration, an example that
    identifies a recorded motion, and a README. `--for amalgamation` writes two files to copy.

    The rig is that of --run, a recording, or the shipped rig of a shipped mechanism.

    Where the rig file has the limits of a commissioning, [excitation], the package contains one: an excitation within
    these limits, designed for the least standard errors, its identification and its check (NAME_commission.h). It needs
    no recording: without --run the design is made from a simulation at the guesses.
    """
    from pvid.deploy.targets import write_package

    if columns is not None and run_path is None:
        raise PvidError("--columns needs --run")
    given = [f"--rig {rig_path.name}"] if rig_path is not None else []
    given += [f"--run {run_path.name}"] if run_path is not None else []
    given += [f"--columns {columns}"] if columns is not None else []
    given += [f"--core {core}"] if core != _DEFAULT else []
    given += [f"--functions {functions}"] if functions is not None else []
    given += [f"--ram {ram}"] if ram is not None else []
    given += [f"--ticks {ticks}"] if ticks is not None else []
    title = " ".join(["pvid deploy", Path(model).name, f"--for {target}", *given])
    is_integer = CORES[core] is FIXED
    made_with = _deployments(model, rig_path, run_path, columns, is_integer, title, bounded=ticks is not None)
    made = _within(ram, ticks, functions, made_with)
    paths = write_package(made, target, out)
    if made.playback.held is not None:
        seconds = len(made.playback.counts) / made.sample_rate
        write_stderr(
            f"note: the example replays the first {seconds:.3g} s of the recording and prints no estimate: "
            f"{made.playback.held.text}. `pvid identify --core {core}` names the cause: too little motion, or a "
            "parameter that may be 0, without which a model file of your own is answered"
        )
    write_stderr(f"{out}: {len(paths)} files; start with {out / 'README.md'}")
    return DONE


def _within(
    ram: int | None, ticks: int | None, functions: int | None, made_with: Callable[[int | None], Deployment]
) -> Deployment:
    """The deployment, with the most test functions that fit into so many bytes and instructions of a tick."""
    from pvid.deploy.memory import state_bytes

    def tried(number: int | None) -> tuple[Deployment, str]:
        """The deployment, and what is too large of it."""
        made = made_with(number)
        if ram is not None:
            size = state_bytes(made)
            if size is None:
                raise PvidError("--ram needs a C compiler on this computer")
            if size > ram:
                return made, f"--ram {ram}: with the fewest test functions the first stage takes {size} bytes"
        if ticks is not None and made.most is not None and made.most.bound > ticks:
            return made, (
                f"--ticks {ticks}: with the fewest test functions a tick takes up to {made.most.bound} instructions by "
                f"its code, and {made.most.longest} in a search"
            )
        return made, ""

    chosen, excess = tried(functions)
    if not excess:
        return chosen
    fits, least, most = None, 4, chosen.sizes["PVID_MAX_FUNCTIONS"] - 1
    while least <= most:
        middle = (least + most) // 2
        made, beyond = tried(middle)
        if beyond:
            most, excess = middle - 1, beyond
        else:
            fits, least = made, middle + 1
    if fits is None:
        raise PvidError(excess)
    number, before = (one.sizes["PVID_MAX_FUNCTIONS"] for one in (fits, chosen))
    limits = [f"{ram} bytes"] if ram is not None else []
    limits += [f"{ticks} instructions a tick"] if ticks is not None else []
    what = " and ".join(limits)
    write_stderr(f"note: {number} test functions in place of {before}, for {what}: the standard errors grow")
    if chosen.is_refined and not fits.is_refined:
        write_stderr("note: with them the second stage has no estimate of the recorded motion, which it has without")
    return fits


def _deployments(
    model: str,
    rig_path: Path | None,
    run_path: Path | None,
    columns: str | None,
    is_integer: bool,
    title: str,
    *,
    bounded: bool,
) -> Callable[[int | None], Deployment]:
    """The deployment by its number of test functions, None: chosen; `bounded`: with the most that a tick takes."""
    from pvid.board.boards import BOARDS
    from pvid.board.longest_tick import longest_tick
    from pvid.board.mechanism_image import MechanismRun, run_of_samples
    from pvid.board.mechanism_image_q31 import FixedRun
    from pvid.codegen.weak_sizes import refuse_too_many_unknowns
    from pvid.configuration.refine import full_motion_of, refine_design, refine_for_simulated_rig
    from pvid.configuration.weak import (
        config_for_recording,
        config_for_rig_like_the_shipped,
        samples_of,
        simulated_run_of,
    )
    from pvid.configuration.weak_q31 import weak_q31_for_recording, weak_q31_for_rig_like_the_shipped
    from pvid.deploy.deployment import Most
    from pvid.deploy.of_rig import deployment_f32, deployment_q31
    from pvid.models.mechanisms import names as names_of_shipped
    from pvid.oracle.weak.edges import with_edges

    def with_most(made: Deployment, run: Callable[[], MechanismRun | FixedRun]) -> Deployment:
        if not bounded:
            return made
        found = longest_tick(BOARDS["mps2-an386"], run())
        return replace(made, most=Most(found.bound, found.longest, found.stack))

    compiled, rig = model_of_rig(model, rig_path, run_path)
    refuse_too_many_unknowns(compiled)
    excitation = None if rig is None or not rig.excitation else _excitation(compiled, rig, is_integer)
    if run_path is not None or excitation is not None:
        recording = excitation.recording if excitation is not None else None
        if run_path is not None:
            recording = recorded(compiled, rig, run_path, columns)
        assert recording is not None
        compiled = with_edges(compiled, recording.signals, recording.sample_rate)
        answer = None if run_path is None else analysis_of(compiled, recording)
        found = None if answer is None else answer.found
        warnings = () if answer is None else tuple(one.text for one in answer.doubts if one.alarm)
        signs: Reversals = "averaged" if run_path is not None else "decided"

        def of_recording(functions: int | None) -> Deployment:
            if is_integer:
                weak = weak_q31_for_recording(compiled, recording, functions, found=found)
                made = replace(deployment_q31(weak, recording.signals, title), warnings=warnings)
                return with_most(made, lambda: FixedRun(weak, weak.counts_of(recording.signals), 0))
            config = config_for_recording(compiled, recording, functions, reversals=signs, found=found)
            refine = _noted(lambda: refine_design(compiled, config, recording.signals))
            made = deployment_f32(compiled, config, recording.signals, title, refine, excitation)
            samples = samples_of(config, recording.signals)
            return with_most(replace(made, warnings=warnings), lambda: run_of_samples(compiled, config, samples))

        return of_recording
    if model not in names_of_shipped():
        raise PvidError(f"{model} has no shipped rig to make a design for: give a recording of yours with --run")
    run = simulated_run_of(compiled)[0]

    def of_shipped_rig(functions: int | None) -> Deployment:
        if is_integer:
            weak = weak_q31_for_rig_like_the_shipped(compiled, functions)
            return with_most(deployment_q31(weak, run, title), lambda: FixedRun(weak, weak.counts_of(run), 0))
        config = config_for_rig_like_the_shipped(compiled, functions)
        refine = _noted(lambda: refine_for_simulated_rig(compiled, config))
        made = deployment_f32(compiled, config, full_motion_of(compiled), title, refine)
        return with_most(made, lambda: run_of_samples(compiled, config, samples_of(config, run)))

    return of_shipped_rig


def _excitation(compiled: CompiledModel, rig: MechanismRig, is_integer: bool) -> Excitation:
    """The excitation of a commissioning, designed within the limits of the rig file."""
    from pvid.codegen.weak import weak_functions_of
    from pvid.configuration.excitation import MOST_DRIVES, designed

    if is_integer:
        raise PvidError("a commissioning needs float32: leave --core q31 out, or [excitation] of the rig file")
    if rig.sample_rate is None:
        raise PvidError("the sample rate of the commissioning is missing: sample_rate = 2000  # Hz, in the rig file")
    with progress_bar("drives", MOST_DRIVES) as advance:
        return designed(
            compiled, rig.excitation, rig.sample_rate, samples=weak_functions_of(compiled).samples, progress=advance
        )


def _noted(made: Callable[[], RefineConfig]) -> RefineConfig | None:
    """Settings of the second stage; None, with a note on the reason, where a board cannot have it."""
    try:
        return made()
    except PvidError as error:
        write_stderr(f"note: no second stage: {error}")
        return None
