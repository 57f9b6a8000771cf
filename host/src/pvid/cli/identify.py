"""`pvid identify`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from pvid.base.errors import PvidError
from pvid.cli.input import FigurePath, NewFile, force_option, form_options, listed_names, model_option
from pvid.settings.cores import FLOAT


@click.command(name="identify")
@click.argument("run_paths", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@model_option
@form_options
@click.option(
    "--core", type=click.Choice(["f32", "q31", "f64"]), help="Arithmetic.  [default: f64; of the strong form f32]"
)
@click.option(
    "--weights",
    type=click.Choice(["residuals", "sensors"]),
    help="Of the rows: an error of the equations, estimated from the residuals, beside the noise of the sensors; or "
    "that noise alone.  [default: residuals]",
)
@click.option(
    "--refine/--no-refine",
    default=None,
    help="Fit the full equations to the whole run, from this answer on: any angle, friction, skew. In float64, or with "
    "--core f32 by the second stage in C.  [default: of a model with equations of its own for it]",
)
@click.option(
    "--on", "target", metavar="TARGET", help="Also compute on TARGET: an emulator, stream-host or a serial port."
)
@click.option(
    "--add",
    metavar="TERM",
    multiple=True,
    help="Add a term with one new unknown, as in --add 'equation 2: drag*abs(w)*w', or "
    "change a signal, as in --add 'V: V + drop*sgn(V)', and show the values without it and with it.",
)
@click.option(
    "--write-model",
    type=NewFile(),
    help="With --add: write the model file with the terms. Of a robot: its URDF or MJCF file with the answer.",
)
@click.option(
    "--validate",
    "other",
    metavar="RUN2",
    type=click.Path(path_type=Path),
    help="Also say how well the answer predicts RUN2, another run of the mechanism.",
)
@click.option(
    "--own",
    metavar="NAME,...",
    multiple=True,
    help="Of several RUNs: parameters with a separate value in each, such as a payload. Offsets of sensors are "
    "separate without this option.",
)
@click.option("--shared", metavar="NAME,...", multiple=True, help="Offsets of sensors with the same value in all RUNs.")
@click.option(
    "--without",
    "empty",
    metavar="RUN0",
    type=click.Path(path_type=Path),
    help="Of a robot: RUN0 is without its payload, whose mass, centre and inertia are then identified.",
)
@click.option("--json", "style", flag_value="json", help="Print one JSON object.")
@click.option(
    "--verbose", "style", flag_value="verbose", help="Also print parts of the errors, residuals, windows, hashes."
)
@click.option("--report", type=NewFile(), help="Write a report: one HTML page with the answer in words and pictures.")
@click.option(
    "--figure", type=FigurePath(), help="Write a figure: measured against predicted, convergence (png, svg, pdf)."
)
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
    empty: Path | None,
    own: tuple[str, ...],
    shared: tuple[str, ...],
    style: Literal["json", "verbose"] | None,
    report: Path | None,
    figure: Path | None,
) -> int:
    """Identifies the parameters of a mechanism from a recorded or simulated RUN, whose columns are t [s] and the
    signals of the mechanism.

    Without --model, and where no rig file names one, it is the shipped mechanism that has the signals of the columns.
    Your own one is a model file (host/docs/models.md). --columns maps other names and units; --set known.l1=0.25, or
    l1=0.25, gives a constant. Short gaps are interpolated, long gaps stay empty, a non-uniform clock is corrected; each
    correction is reported.

    The answer is that of the analysis in float64; with --core f32 or q31 that of the C core, compiled for the
    mechanism, beside it.

    The refinement fits the full equations to the whole run. In float64 its answer replaces that of the weak form where
    its residuals are those of the sensors' noise; a line says which it is and why. With --core f32 --refine it is the
    second stage of the C core, as on a board, and the answer is its last estimate. --figure shows the measured signals
    against the simulated.

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
    from pvid.cli.identify_run import Pictures, identify_run  # loads SymPy
    from pvid.identification.summary import Made
    from pvid.log.rig_choice import common_rig

    if refine and target is not None and core != FLOAT.name:
        raise PvidError(f"the refinement on a target is in float32: --on {target} --refine --core {FLOAT.name}")
    rig = common_rig(run_paths, rig_path, settings, model, columns)
    made = Made.by_this_command(run_paths, rig_path, rig, other)
    return identify_run(
        run_paths,
        rig,
        columns,
        style=style or "plain",
        pictures=Pictures(figure, report, made, style == "json"),
        weights=weights or "residuals",
        refine=refine,
        other=other,
        empty=empty,
        add=add,
        write_model=write_model,
        own=listed_names(own),
        shared=listed_names(shared),
        core=core,
        form=form,
        law=law,
        on=target,
    )
