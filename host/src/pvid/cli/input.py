"""Shared by the commands that read a run: options for the rig and the columns, and the corrections of the run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from pvid.base.console import write_stderr
from pvid.base.figure_file import format_of
from pvid.base.replacing import refuse_foreign, replacing

Command = Callable[..., Any]


def rig_options(command: Command) -> Command:
    """Adds --rig and --set: parameters rig_path and settings."""
    rig = click.option(
        "--rig",
        "rig_path",
        type=click.Path(path_type=Path),
        help="The rig file (TOML).  [default: a log's own, or RUN.toml beside RUN.csv]",
    )
    settings = click.option(
        "--set",
        "settings",
        metavar="KEY=VALUE",
        multiple=True,
        help="Sets a key of the rig file, overriding the file: known.l1=0.25 [m] or sensor.phi.resolution=0.0015 "
        "[rad]. Repeatable.",
    )
    return rig(settings(command))


def model_option(command: Command) -> Command:
    """Adds --model: parameter model."""
    return click.option(
        "--model",
        shell_complete=_models_like,
        help="A mechanism of `pvid models` or a model file.  [default: that of the rig file, else the shipped one with "
        "the signals of the columns]",
    )(command)


def _models_like(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The shipped mechanisms, and files."""
    from pvid.models.registry import names

    return [*(CompletionItem(one) for one in names() if one.startswith(incomplete)), CompletionItem(incomplete, "file")]


def columns_option(command: Command) -> Command:
    """Adds --columns: parameter columns."""
    return click.option(
        "--columns",
        metavar="MAP",
        help="Columns of RUN for t and the signals, and their units: t=time_ms:ms,phi=angle_deg:deg,y=h:mm. A number "
        "is the position of the column, from 1; units are s ms us ns min, rad mrad deg rev turn, m cm mm um in, a "
        "number of SI units, or one of these divided (rev/4096) or with opposite sign (-mm).",
    )(command)


def form_options(function: Command) -> Command:
    for option in (
        click.option("--form", type=click.Choice(["weak", "strong"]), help="Form of the identifier.  [default: weak]"),
        click.option(
            "--law",
            type=click.Choice(["stationary", "pseudovelocity"]),
            help="Law of the strong form.  [default: stationary]",
        ),
        columns_option,
        rig_options,
    ):
        function = option(function)
    return function


def listed_names(given: Iterable[str]) -> list[str]:
    """Names of a repeated option with lists of names, each once."""
    return list(dict.fromkeys(name.strip() for one in given for name in one.split(",") if name.strip()))


log_argument = click.argument("log", type=click.Path(path_type=Path))
log_rig = click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="Rig file.  [default: the log's own]")


def force_option(command: Command) -> Command:
    """Adds --force: inside the command any file may be replaced."""
    return click.option(
        "--force",
        is_flag=True,
        is_eager=True,  # before the paths, whose files are refused
        expose_value=False,
        callback=lambda ctx, _, given: ctx.with_resource(replacing()) if given else None,
        help="Replace files that pvid did not write, or that were changed since.",
    )(command)


class NewFile(click.Path):
    """Path of a file to write; what must not be replaced is refused before any computation."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See click."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        refuse_foreign(path)
        return path


class FigurePath(NewFile):
    """Path of a figure to write; its format is checked before any computation."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See click."""
        format_of(Path(os.fsdecode(value)))
        return super().convert(value, param, ctx)


def print_notes(notes: Iterable[str]) -> None:
    """What was done to a run, on standard error."""
    for note in notes:
        write_stderr(f"pvid: input: {note}")
