"""`pvid identify` of a mechanism with a compiled model."""

from __future__ import annotations

import json
from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pvid.base.console import DONE, NOTHING_IDENTIFIED, write_stderr
from pvid.base.errors import PvidError
from pvid.base.rounding import with_error
from pvid.cli.input import print_notes
from pvid.oracle.fourier.weights import Weights
from pvid.rig.columns import parsed
from pvid.rig.mechanism_file import MechanismRig, channels_of
from pvid.rig.run import is_run, read_recording
from pvid.run.mechanism import MechanismAnswer, identify_mechanism, model_of


def identify_run(
    path: Path,
    rig: MechanismRig,
    columns: str | None,
    *,
    as_json: bool,
    figure: Path | None,
    weights: Weights = "residuals",
    **only_in_c: str | None,
) -> int:
    """Identifies a recording of a described mechanism and prints the answer.

    Parameters
    ----------
    weights : of the rows, as in pvid.oracle.fourier.identify
    only_in_c : options that the C core alone has, by name; a value is refused
    """
    model = model_of(rig)
    for option, value in only_in_c.items():
        if value is not None and (option, value) not in (("core", "f64"), ("form", "weak")):
            raise PvidError(
                f"--{option} {value}: {model.name} is identified in float64 by the weak form; omit --{option}"
            )
    if not is_run(path):
        raise PvidError(f"{path} is no recording: {model.name} is identified from a table of its signals")
    recording = read_recording(path, rig.sample_rate, parsed(columns, channels_of(model)))
    recording.refuse_damaged()
    recording = recording.whole()
    print_notes(recording.notes)
    answer = identify_mechanism(recording, model, weights)
    if as_json:
        click.echo(json.dumps(answer.as_json()))
    else:
        _print(answer)
    if figure is not None:
        from pvid.show.mechanism_figure import convergence  # loads matplotlib

        convergence(answer, figure)
        click.echo(f"figure: {figure}")
    for one in answer.found.verdict.reasons:
        write_stderr(f"pvid: {'warning' if one.alarm and answer.identified else 'note'}: {one.text}")
    if not answer.identified:
        write_stderr("pvid: nothing identified")
        return NOTHING_IDENTIFIED
    return DONE


def _print(answer: MechanismAnswer) -> None:
    found = answer.found
    if answer.identified:
        table = Table(
            "parameter", "estimate", "standard error", "of it noise", title=f"{answer.model.title}: weak form, float64"
        )
        for column in table.columns[1:]:
            column.justify = "right"
        for name, one in answer.values.items():
            assert one.value is not None and one.se is not None and one.se_noise is not None
            label = escape(f"{name} [{one.unit}]" if one.unit else name)
            table.add_row(label, *with_error(one.value, one.se), f"{one.se_noise:.2g}")
        Console().print(table)
    explained = ", ".join(f"{name} {value:.6f}" for name, value in found.r2.items())
    click.echo(
        f"status {found.verdict.status}; chi2 {found.chi2:.2g}; {len(found.times)} windows of "
        f"{found.design.window_s:.3g} s; R^2 {explained}"
    )
