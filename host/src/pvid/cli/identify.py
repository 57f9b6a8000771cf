"""`pvid identify`."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Literal

import click

from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.cli.input import (
    FigurePath,
    NewFile,
    force_option,
    form_options,
    listed_names,
    print_notes,
    read_input,
    with_overrides,
)
from pvid.cli.result import print_result, print_warning, write_figure, write_refined_figure
from pvid.core.native import Native
from pvid.log.mechanism_settings import common_rig
from pvid.log.rig_settings import rig_for
from pvid.rig.sensor_steps import resolution_note, resolved
from pvid.run import answer
from pvid.run.advised import identified
from pvid.settings.engine_cores import FLOAT


@click.command(name="identify")
@click.argument("run_paths", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--model", help="A mechanism of `pvid models` or a model file.  [default: that of the rig file, kapitza]")
@form_options
@click.option("--core", type=click.Choice(["f32", "q31", "f64"]), help="Arithmetic; overrides the rig file.")
@click.option(
    "--weights",
    type=click.Choice(["residuals", "sensors"]),
    help="Of the rows of a described mechanism: an error of the equations, estimated from the residuals, beside the "
    "noise of the sensors; or that noise alone.  [default: residuals]",
)
@click.option(
    "--refine/--no-refine",
    default=None,
    help="Fit the full equations to the whole run, from this answer on: any angle, friction, skew. In float64, or with "
    "--core f32 by the second stage in C.  [default: of the pendulum's weak form, in float64]",
)
@click.option(
    "--on", "target", metavar="TARGET", help="Also compute on TARGET: an emulator, stream-host or a serial port."
)
@click.option(
    "--add",
    metavar="TERM",
    multiple=True,
    help="Of a described mechanism: add a term with one new unknown, as in --add 'equation 2: drag*abs(w)*w', or "
    "change a signal, as in --add 'V: V + drop*sgn(V)', and show the values without it and with it.",
)
@click.option("--write-model", type=NewFile(), help="With --add: write the model file with the terms.")
@click.option(
    "--validate",
    "other",
    metavar="RUN2",
    type=click.Path(path_type=Path),
    help="Of a described mechanism: also say how well the answer predicts RUN2, another run of it.",
)
@click.option(
    "--own",
    metavar="NAME,...",
    multiple=True,
    help="Of several RUNs: parameters with a separate value in each, such as a payload. Offsets of sensors are "
    "separate without this option.",
)
@click.option("--shared", metavar="NAME,...", multiple=True, help="Offsets of sensors with the same value in all RUNs.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--figure", type=FigurePath(), help="Write a figure of the convergence (png, svg, pdf).")
@force_option
def command(
    run_paths: tuple[Path, ...],
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: str | None,
    law: str | None,
    form: str | None,
    core: str | None,
    weights: Literal["residuals", "sensors"] | None,
    refine: bool | None,
    target: str | None,
    add: tuple[str, ...],
    write_model: Path | None,
    other: Path | None,
    own: tuple[str, ...],
    shared: tuple[str, ...],
    as_json: bool,
    figure: Path | None,
) -> int:
    """Identifies the parameters from a recorded or simulated RUN with columns t [s], phi [rad] and y [m].

    --columns maps other names and units. Without a rig file --set l1=0.25, the length of rod 1 [m], is enough. Short
    gaps are interpolated, long gaps stay empty, a non-uniform clock is corrected; each correction is reported.

    With --model, or a rig file with [model], the run is one of another mechanism (host/docs/models.md): its columns are
    t and the signals of the model. It is identified in float64; with --core f32 also by the C core, compiled for it.

    The refinement fits the full equations to the whole run. In float64 its answer replaces that of the weak form where
    its residuals are those of the sensors' noise; the last line says which it is and why. With --core f32 --refine it
    is the second stage of the C core, as on a board, and the answer is its last estimate. --figure shows the measured
    signals against the simulated.

    Several RUNs are identified together: the parameters are those of all, and no window reaches from one into the next.
    They have the same columns and the same sample rate. With --own m, each has its own m: m[A] and m[B] of A.csv and
    B.csv.

    Where an answer names a term that the equations lack, its advice contains the option --add that identifies with it.
    A term without an equation's name in front goes to the equation in which it explains most.

    With --validate the answer is also simulated on another recording with the same columns, in blocks of four windows.
    Fitted are the initial states of each block, and the --own parameters. Printed is the rms error of each sensor's
    prediction, over its motion and over its noise.

    With --on the run is also streamed to a target; the result is printed only if the target's hashes are equal at every
    reported tick and at the end. It is then the answer of the target's form; with --core f32 --refine that of both
    stages.
    """
    if refine and target is not None and core != FLOAT.name:
        raise PvidError(f"the refinement on a target is in float32: --on {target} --refine --core {FLOAT.name}")
    run_path = run_paths[0]
    described = common_rig(run_paths, rig_path, settings, model, len(run_paths) > 1)
    if described is None and refine and core == FLOAT.name:
        file = with_overrides(rig_for(run_path, rig_path, settings), law=law, form=form, core=core)
        described, law = (file, None) if file.identifier.form_traits.publishes else (None, law)
    if described is not None:
        from pvid.cli.mechanism import identify_run  # loads SymPy

        options = {"core": core, "form": form, "law": law, "on": target}
        return identify_run(
            run_paths,
            described,
            columns,
            as_json=as_json,
            figure=figure,
            weights=weights or "residuals",
            refine=bool(refine),
            other=other,
            add=add,
            write_model=write_model,
            own=listed_names(own),
            shared=listed_names(shared),
            **options,
        )
    if add or write_model is not None:
        raise PvidError("--add and --write-model are for a described mechanism, --model")
    if other is not None:
        raise PvidError("--validate is for a described mechanism, --model; here: pvid validate RUN2 --from ANSWER")
    if own or shared:
        raise PvidError("--own and --shared are for several recordings of a described mechanism")
    if weights is not None:
        raise PvidError(f"--weights {weights} is for a described mechanism, --model; the pendulum has its own weights")
    rig = with_overrides(rig_for(run_path, rig_path, settings), law=law, form=form, core=core)
    if target is not None and rig.identifier.core == "f64":
        raise PvidError("targets hold the cores f32 and q31, not f64: use --core f32")
    run = read_input(run_path, rig, columns, whole=not rig.identifier.core_traits.takes_gaps)
    given, rig = rig, resolved(rig, run)
    notes = resolution_note(given, rig)
    print_notes(notes)
    native = Native()
    noted = replace(run, notes=(*run.notes, *notes))
    result = identified(noted, rig, native, refine=refine, streamed=target is not None)
    if target is not None:
        from pvid.board.compare_on import verify_run

        with progress_bar(f"streaming to {target}", len(run.t)) as advance:
            verdict = verify_run(target, rig, run, native, advance)
        write_stderr(f"{target}: {verdict.playback.account}")
        if not verdict.equal:
            write_stderr(f"pvid: {target}: {verdict.text}")
            return DIFFERENT
        result = replace(result, on=target)
    if as_json:
        click.echo(json.dumps(answer.as_json(result)))
    else:
        print_result(result, rig)
    if figure is not None:
        outcome = None if result.refinement is None else result.refinement.outcome
        if outcome is not None:
            write_refined_figure(outcome, figure)
        else:
            write_figure(result, figure, None)
    for sentence in result.remarks:
        write_stderr(f"pvid: note: {sentence}")
    print_warning(result)
    if not result.identified:
        write_stderr(f"pvid: nothing identified: {result.verdict}")
    for sentence in result.advice:
        write_stderr(f"pvid: advice: {sentence}")
    return DONE if result.identified else NOTHING_IDENTIFIED
