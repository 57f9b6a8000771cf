"""`pvid design` and `pvid tune` of a mechanism with a compiled model."""

from __future__ import annotations

import json
import sys

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pvid.base.console import DONE, NOTHING_IDENTIFIED, write_stderr
from pvid.base.rounding import with_error
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.choice import Scored
from pvid.rig.run import Recording
from pvid.run.mechanism_design import EngineReport, designs_tried, report_for_recording, report_for_rig

_SHOWN = 12  # designs of a table


def print_design(model: CompiledModel, recording: Recording | None, *, as_json: bool) -> int:
    """The engine's design for a recording, or for the simulated rig, and its predicted errors.

    Returns
    -------
    The exit code.
    """
    report = report_for_rig(model) if recording is None else report_for_recording(model, recording)
    if as_json:
        click.echo(json.dumps(report.as_json()))
    else:
        _print_report(report)
    return DONE if report.chosen.known else NOTHING_IDENTIFIED


def _print_report(report: EngineReport) -> None:
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


def print_tuning(model: CompiledModel, recording: Recording) -> int:
    """The designs that were tried on a recording, the best first, and the engine's own.

    Returns
    -------
    The exit code.
    """
    tried, engine = designs_tried(model, recording)
    table = Table(title=f"{model.title}: predicted errors, the geometric mean over the parameters")
    for heading in ("", "window s", "functions", "decimation", "derivatives ms", "expected error %", "chi2"):
        table.add_column(heading, justify="right")
    for place, one in enumerate(tried[:_SHOWN]):
        table.add_row("analysis" if place == 0 else "", *_cells(one))
    table.add_row("C core", *_cells(engine))
    Console(width=None if sys.stdout.isatty() else 120).print(table)
    click.echo(
        f"{len(tried)} designs tried; identify chooses these by itself, model build {model.name} --run prints the C "
        "core's tables"
    )
    return DONE if engine.known else NOTHING_IDENTIFIED


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
