"""`pvid validate`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from pvid.base.console import DONE
from pvid.base.errors import PvidError
from pvid.cli.input import columns_option, model_option, rig_options
from pvid.models.registry import names


@click.command(name="validate")
@click.argument("run_path", metavar="RUN", type=click.Path(path_type=Path))
@click.option(
    "--from",
    "answer_path",
    metavar="ANSWER",
    required=True,
    type=click.Path(path_type=Path),
    help="A file with what `identify --json` printed for another run.",
)
@model_option
@rig_options
@columns_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    run_path: Path,
    answer_path: Path,
    model: str | None,
    rig_path: Path | None,
    settings: tuple[str, ...],
    columns: str | None,
    as_json: bool,
) -> int:
    """Says how well the parameters of one identification predict another RUN of the same mechanism.

    Blocks of the run are simulated by the full equations from starts that fit them; what is left of each sensor is
    printed, over its motion and over its noise. An answer that is right predicts a run that it has not seen to little
    more than the noise, whatever warnings it has.
    """
    from pvid.cli.identify_run import recording_of  # loads SymPy
    from pvid.identification.validation import predicted
    from pvid.log.rig_choice import rig_of

    if model is None and answer_path.is_file():
        model = _shipped_in(_answer(answer_path))
    rig = rig_of(run_path, rig_path, settings, model, columns)
    answer = _answer(answer_path)
    recording, compiled = recording_of(run_path, rig, columns, whole=False)
    named = answer.get("model", compiled.name)
    if named != compiled.name:
        raise PvidError(f"{answer_path} is of the mechanism {named}, {run_path} of {compiled.name}: add --model")
    values = {name: one.get("value") for name, one in answer["parameters"].items()}
    found = predicted(compiled, recording, values, answer.get("window_s"))
    if as_json:
        click.echo(json.dumps(found.as_json() | {"model": compiled.name, "input": list(recording.notes)}))
    else:
        click.echo(f"{answer_path} {found.text}")
    return DONE


def _shipped_in(answer: dict[str, Any]) -> str | None:
    """The shipped mechanism that an answer is of; None: it is of a model file, which this call must name."""
    name = answer.get("model")
    return name if name in names() else None


def _answer(path: Path) -> dict[str, Any]:
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise PvidError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise PvidError(f"{path} is not what `pvid identify --json` prints: {error}") from error
    if not isinstance(answer, dict) or not isinstance(answer.get("parameters"), dict):
        raise PvidError(f"{path} has no object `parameters`, as `pvid identify --json` prints it")
    return answer
