"""`pvid design` and `pvid tune` of a mechanism with a compiled model."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pvid.base.atomic_write import write_whole
from pvid.base.console import DIFFERENT, DONE, NOTHING_IDENTIFIED, progress_bar, working, write_stderr
from pvid.base.errors import PvidError
from pvid.base.replacing import refuse_foreign
from pvid.base.rounding import with_error
from pvid.base.wording import listed
from pvid.configuration.design_report import DesignReport, designs_tried, report_for_recording, report_for_rig
from pvid.identification.answer import Analysis
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.choice import Scored
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.cores import CORES
from pvid.settings.refine import RefineConfig

if TYPE_CHECKING:
    from pvid.board.design_cost import Asked, Cost

_SHOWN = 12  # designs of a table


def print_design(
    model: CompiledModel, recording: Recording | None, asked: Asked | None = None, *, as_json: bool
) -> int:
    """The identifier's design for a recording, or for the simulated rig, its predicted errors, and its cost on a board.

    Parameters
    ----------
    asked : the costs to measure; None: none

    Returns
    -------
    The exit code.
    """
    report = report_for_rig(model) if recording is None else report_for_recording(model, recording)
    if not as_json:
        _print_report(report)
    costs = [] if asked is None else _measured(asked, model, recording)
    if not all(one.equal for one in costs):
        write_stderr(f"pvid: {costs[0].asked.board.name}: its hashes are not those of this computer")
        return DIFFERENT
    if as_json:
        click.echo(json.dumps(report.as_json() | ({"cost": [one.as_json() for one in costs]} if asked else {})))
    elif costs:
        _print_costs(costs)
    return DONE if report.chosen.known else NOTHING_IDENTIFIED


def print_motion(rig: MechanismRig, duration: float | None, out: Path | None, *, other: bool, as_json: bool) -> int:
    """Designs a motion of a robot, prints the errors that it gives, and writes it as CSV and C.

    Parameters
    ----------
    other : a recording, a drive or a board was named too, which is refused

    Returns
    -------
    The exit code.
    """
    from pvid.configuration.robot_motion import designed_motion
    from pvid.deploy.motion import motion_header, motion_table

    model = rig.compiled()
    if model.chain is None:
        raise PvidError(f"{model.name} is no robot, whose motion --out writes: omit it")
    if other:
        raise PvidError("`design` makes a robot's motion itself: omit --run, --tone and --on")
    if out is None or duration is None:
        raise PvidError("the motion of a robot needs its length and a file to write: --duration 20 -o motion.csv")
    header = out.with_suffix(".h")
    if header == out:
        raise PvidError(f"{out} is the name of the motion in C: name the table, {out.with_suffix('.csv').name}")
    refuse_foreign(header)
    with working("designing a motion"):
        motion = designed_motion(model, duration, rig.sample_rate or 1000.0)
        fit = motion.predicted()
    command = f"pvid design --model {model.name}.py --duration {duration:g} -o {out.name}"
    write_whole(out, motion_table(motion))
    write_whole(header, motion_header(motion, out.stem, command))
    errors = np.sqrt(np.diag(fit.covariance))
    used = {name: one for name, one in motion.used.items() if one is not None}
    end = NOTHING_IDENTIFIED if fit.undetermined.all() else DONE
    if as_json:
        listing = {
            one.name: {"file": one.guess, "se": None if lost else float(error), "unit": one.unit}
            for one, error, lost in zip(model.unknowns, errors, fit.undetermined, strict=True)
        }
        click.echo(json.dumps({"parameters": listing, "used": used, "gain": motion.gain, "duration_s": duration}))
        return end
    table = Table("parameter", "in the file", "standard error", title=f"a motion of {duration:g} s")
    for one, error, lost in zip(model.unknowns, errors, fit.undetermined, strict=True):
        shown = ("", "not determined") if lost else with_error(one.guess, float(error))
        table.add_row(escape(f"{one.name} [{one.unit}]"), *shown)
    Console().print(table)
    click.echo(f"errors of a multisine within the same limits: {motion.gain:.2g} times as large (geometric mean)")
    parts = [f"{100 * one:.0f} % of the {name}" for name, one in used.items() if name != "box"]
    click.echo(f"largest use of a limit: {listed(parts)}" + ("; within the box" if "box" in used else ""))
    click.echo(f"{out}, {header}: {model.title}, {len(model.chain.joints)} joints, {motion.rate:g} ticks a second")
    return end


def _measured(asked: Asked, model: CompiledModel, recording: Recording | None) -> list[Cost]:
    """The costs on a board; why there is no second stage, and what is wrong with a cost, on standard error."""
    from pvid.board.design_cost import CostedDesign

    if recording is None:
        design = CostedDesign.of_shipped_rig(asked, model)
    else:
        design = CostedDesign.of_recording(asked, model, recording)
    if design.no_refinement is not None:
        write_stderr(f"pvid: no refinement in C: {design.no_refinement}")
    images: list[RefineConfig | None] = design.images(asked)
    costs: list[Cost] = []
    with progress_bar(f"measuring on {asked.board.name}", len(images)) as advance:
        for refine in images:
            try:
                costs.append(design.cost(asked, refine))
            except PvidError as error:
                if refine is None:
                    raise
                write_stderr(f"pvid: {_stages(refine)}: {error}")
            advance(len(costs))
    return costs


def _print_costs(costs: list[Cost]) -> None:
    from pvid.board.replay_image import BLOCK

    asked, rate = costs[0].asked, costs[0].sample_rate
    unit = "clock cycles" if asked.board.toolchain == "avr" else "instructions"
    title = f"{asked.board.name} ({asked.board.core}), {CORES[asked.core].words}: {unit} of a tick, and bytes"
    table = Table(title=title)
    figures = ("mean", "longest") if asked.clock_mhz is None else ("mean", "%", "longest", "%")
    for heading in ("", *figures, "state", "stack", "code", "tables", "first s", "replayed s"):
        table.add_column(heading, justify="right" if heading else "left")
    for one in costs:
        found = one.footprint
        counts = [str(found.mean), str(found.longest)]
        shares = [f"{100 * share:.3g}" for share in one.shares or ()]
        table.add_row(
            _stages(one.refine),
            *(cell for pair in zip(counts, shares, strict=True) for cell in pair) if shares else counts,
            str(found.data + found.bss),
            str(found.stack_bound),
            str(found.text + found.arithmetic),
            str(found.tables),
            "-" if one.first_s is None else f"{one.first_s:.3g}",
            f"{one.ticks / one.sample_rate:.3g}",
        )
    Console(width=None if sys.stdout.isatty() else 120).print(table)
    click.echo("RAM: state and stack; flash: code and tables; longest: of all replayed ticks; first: estimate")
    if asked.clock_mhz is not None:
        what = "" if asked.board.toolchain == "avr" else ", one instruction a cycle"
        click.echo(f"%: of the {1000 / rate:.3g} ms between samples at {asked.clock_mhz:g} MHz{what}")
    for one in costs:
        if one.most is not None:
            click.echo(
                f"longest tick of the first stage, whatever the samples: {one.most.bound} {unit} by its code, "
                f"{one.most.longest} found by a search with spoilt samples"
            )
        if one.in_blocks is not None:
            mean, longest = one.in_blocks.mean, one.in_blocks.longest
            click.echo(f"in blocks of {BLOCK} samples: {mean} {unit} a sample, {longest} in the longest block")
        if one.shares is not None and one.shares[1] > 1:
            write_stderr(
                f"pvid: warning: {_stages(one.refine)}: the longest tick takes longer than from sample to sample"
            )
        if one.first_s is None:
            write_stderr(
                f"pvid: warning: {_stages(one.refine)}: no estimate within the replayed {one.ticks / rate:.3g} s"
            )


def _stages(refine: RefineConfig | None) -> str:
    """In words, with the settings of the second stage that decide about the longest tick."""
    return "weak form" if refine is None else f"both, jobs {refine.jobs}, rests {refine.rests}"


def _print_report(report: DesignReport) -> None:
    table = Table("parameter", "predicted at", "standard error", title=f"a run of {report.duration:g} s")
    for one, value, error in zip(report.model.unknowns, report.chosen.p, report.chosen.error, strict=True):
        table.add_row(
            escape(f"{one.name} [{one.unit}]" if one.unit else one.name), *with_error(float(value), float(error))
        )
    Console().print(table)
    for name, text in report.facts():
        click.echo(f"{name}: {text}")
    if not report.chosen.known:
        write_stderr("pvid: the run does not determine every parameter with this design: see identify")


def print_tuning(model: CompiledModel, recording: Recording, reference: Analysis | None = None) -> int:
    """The designs that were tried on a recording, the best first, and the identifier's own.

    Parameters
    ----------
    reference : an answer from which the distance of each design's estimate is shown

    Returns
    -------
    The exit code.
    """
    tried, for_core = designs_tried(model, recording)
    table = Table(title=f"{model.title}: predicted errors, the geometric mean over the parameters")
    headings = ("", "window s", "functions", "decimation", "derivatives ms", "expected error %", "chi2")
    for heading in headings if reference is None else (*headings, "distance / error"):
        table.add_column(heading, justify="right")
    for place, one in enumerate(tried[:_SHOWN]):
        table.add_row("analysis" if place == 0 else "", *_cells(one), *_distance(model, one, reference))
    table.add_row("C core", *_cells(for_core), *_distance(model, for_core, reference))
    Console(width=None if sys.stdout.isatty() else 120).print(table)
    click.echo(
        f"{len(tried)} designs tried; identify chooses these by itself, model build {model.name} --run prints the C "
        "core's tables"
    )
    return DONE if for_core.known else NOTHING_IDENTIFIED


def _distance(model: CompiledModel, one: Scored, reference: Analysis | None) -> tuple[str, ...]:
    """Of a design's estimate from the reference: RMS over the parameters, in its expected errors."""
    if reference is None:
        return ()
    known = np.array([reference.values[name].value for name in model.p_names], float)
    return (f"{float(np.sqrt(np.mean(((one.p - known) / one.error) ** 2))):.2g}",)


def _cells(one: Scored) -> tuple[str, ...]:
    design = one.design
    return (
        f"{design.window_s:.4g}",
        str(design.functions),
        str(design.decimation),
        f"{1000 * design.rate_taps / design.sample_rate:.3g}",
        f"{100 * one.score:.2g}" if one.known else "not identified",
        f"{one.chi2:.2g}",
    )
