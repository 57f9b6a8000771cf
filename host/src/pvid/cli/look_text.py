"""What `pvid look` prints."""

from __future__ import annotations

import math
import shlex
import sys
from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pvid.base.errors import PvidError
from pvid.base.wording import printable, typed_name, with_unit
from pvid.cli.input import print_notes
from pvid.identification.survey import ColumnFacts, Proposal, Survey, lines_of_a_model, proposals, surveyed
from pvid.model.chain import POSE
from pvid.models.mechanisms import unused_input

_DIGITS = 4
_MOST = 4  # proposals
_FAST = 10.0  # samples a period of the fastest motion: fewer are few


def print_survey(survey: Survey) -> None:
    """Clock, columns, mechanisms and the next command; what was done to read the file, on standard error."""
    recording = survey.recording
    seconds = float(recording.t[-1] - recording.t[0])
    stretches = len(recording.segments)
    clock = f"{len(recording)} samples, {recording.sample_rate:.6g} Hz, {seconds:.6g} s"
    pieces = "" if stretches == 1 else f", in {stretches} stretches between gaps"
    click.echo(f"{survey.path.name}: {clock}{pieces}; time: {printable(survey.names[survey.at])}")
    print_notes(recording.notes)
    Console(width=None if sys.stdout.isatty() else 140).print(_columns(survey))
    click.echo("\n".join(_advice(survey)))


def next_lines(path: Path) -> list[str]:
    """What the columns of a file can be of, and what to type next; none where it is no table."""
    try:
        return _advice(surveyed(path))
    except (PvidError, OSError):
        return []


def _columns(survey: Survey) -> Table:
    table = Table("column", "unit", "from", "to", "in steps of", "moves up to", "")
    for one in survey.facts:
        cells = (printable(one.name), one.unit, _number(one.low), _number(one.high), _number(one.step))
        reaches = "" if one.reaches is None else f"{one.reaches:.2g} Hz"
        table.add_row(*map(escape, cells), reaches, escape("; ".join((*one.remarks, *_slow(one, survey)))))
    return table


def _number(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.{_DIGITS}g}"


def _slow(one: ColumnFacts, survey: Survey) -> tuple[str, ...]:
    """A remark on a motion with few samples in its fastest period."""
    rate = survey.recording.sample_rate
    if one.reaches is None or not one.reaches * _FAST > rate:
        return ()
    return (f"moves fast for {with_unit(rate, 'Hz', _DIGITS)}, or is noise",)


def _advice(survey: Survey) -> list[str]:
    found = proposals(survey)
    file = str(survey.path)
    if not found and not any(one.low < one.high for one in survey.facts):
        return ["Nothing moves in this recording: no mechanism can be found from it, nor identified."]
    names = set(survey.names)
    free = names >= set(POSE)
    if free or names >= {"q1", "tau1"} or names >= {"q1", "i1"}:
        return [
            "By names it is a robot, whose model comes from its URDF or MJCF file (host/docs/robots.md):",
            f"    {typed_name()} model from robot.urdf{' --free-base' if free else ''} -o robot.py",
            f"    {typed_name()} identify {shlex.quote(file)} --model robot.py",
        ]
    if not found:
        return [
            f"No mechanism of the list (`{typed_name()} models`) has these columns. Yours is a model file of ten lines "
            "(host/docs/models.md). Its signals could be, in SI units:",
            *(f"    {line}" for line in lines_of_a_model(survey)),
        ]
    lines = ["By names and units it can be:" if len(found) > 1 else "By names and units it is:"]
    for one in found[:_MOST]:
        lines += [
            f"  {one.title}",
            f"    {one.command(file)}",
            *_constants(one),
            *(f"    {doubt}" for doubt in one.doubts),
        ]
        if unused := unused_input(one.mechanism, survey.names):
            lines.append(f"    but {unused}")
    lines.append("Another mechanism is a model file of ten lines: host/docs/models.md.")
    return lines


def _constants(one: Proposal) -> list[str]:
    if not one.constants:
        return []
    wanted = ", ".join(f"{name} [{unit}]" if unit else name for name, unit in one.constants)
    return [f"    with your own {wanted} in place of VALUE"]
