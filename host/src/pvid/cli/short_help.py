"""The help of a command on one screen: an example, what it does, the options that most people need."""

from __future__ import annotations

import inspect
import re
import textwrap

import click

MOST_LINES = 20
_WIDTH = 80
_USUAL = (
    "--model --columns --set --out --report --run --for --duration --drive --validate --json --core --refine --on"
).split()

EXAMPLES = {  # of commands whose own text has none
    "demo": "pvid demo",
    "look": "pvid look run.csv",
    "simulate": "pvid simulate run.csv",
    "identify": "pvid identify run.csv --model dc_motor --columns t=time:ms,i=current:mA",
    "validate": "pvid validate other.csv --from run.json",
    "tune": "pvid tune run.csv --set l1=0.25",
    "plot": "pvid plot run.csv -o run.png",
    "log": "pvid log /dev/ttyUSB0 run.pvlog",
    "ports": "pvid ports",
    "view": "pvid view run.pvlog",
    "export": "pvid export run.pvlog --to csv",
    "layout": "pvid layout run.pvlog --for plotjuggler -o run.xml",
    "sizes": "pvid sizes mps2-an386",
    "design": "pvid design --model dc_motor --run run.csv",
    "tables": "pvid tables --form fir --points 21",
    "schema": "pvid schema",
    "models": "pvid models",
    "deploy": "pvid deploy dc_motor --run run.csv --for arduino -o motor",
    "compare": "pvid compare run.csv --core f32",
    "verify": "pvid verify run.pvlog",
    "model check": "pvid model check motor.py",
    "model predict": "pvid model predict motor.py --duration 20",
    "model simulate": "pvid model simulate motor.py run.csv",
    "model build": "pvid model build motor.py --run run.csv -o motor",
    "model from": "pvid model from arm.urdf -o arm.py",
}


def with_short_help(command: click.Command) -> click.Command:
    """The same command, whose --help has 20 lines at most and whose --help-all has all; of a group, its commands."""
    if isinstance(command, click.Group):
        for inner in command.commands.values():
            with_short_help(inner)
        return command
    if any("--help-all" in one.opts for one in command.params):
        return command
    whole = command.get_help

    def show_all(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        if value and not ctx.resilient_parsing:
            click.echo(whole(ctx), color=ctx.color)
            ctx.exit()

    command.params.append(
        click.Option(["--help-all"], is_flag=True, is_eager=True, expose_value=False, hidden=True, callback=show_all)
    )
    command.get_help = lambda ctx: _short(command, ctx, whole(ctx))  # type: ignore[method-assign]
    return command


def _short(command: click.Command, ctx: click.Context, whole: str) -> str:
    examples, text = _parts(command)
    if known := EXAMPLES.get(ctx.command_path.partition(" ")[2]):
        usage, _, below = whole.partition("\n")
        examples, whole = [known], f"{usage}\n\n  {known}\n{below}"
    if whole.count("\n") < MOST_LINES:
        return whole
    head = [f"Usage: {ctx.command_path} {' '.join(command.collect_usage_pieces(ctx))}", ""]
    head += [f"  {one}" for one in examples] + [""] * bool(examples)
    head += textwrap.wrap(_first_sentence(text), _WIDTH, initial_indent="  ", subsequent_indent="  ") + [""]
    shown = sorted(_options(command), key=_place)
    rest = MOST_LINES - len(head) - 3
    names = [_typed(one) for one in shown]
    width = max(map(len, names[:rest]), default=0)
    lines = [f"  {name:<{width}}  {_line(one, _WIDTH - width - 4)}" for name, one in zip(names, shown, strict=True)]
    more = f"; {len(lines) - rest} more" if len(lines) > rest else ""
    tail = ["", f"All of it{more}: {ctx.command_path} --help-all"]
    return "\n".join([*head, "Options:", *lines[:rest], *tail])


def _parts(command: click.Command) -> tuple[list[str], str]:
    """The examples of a docstring, and its first paragraph of other text."""
    paragraphs = [one.strip("\b\n ") for one in inspect.cleandoc(command.help or "").split("\n\n")]
    of_examples = next((one for one in paragraphs if one.startswith("pvid ")), "")
    text = next((one for one in paragraphs if not one.startswith("pvid ")), "")
    return [line.strip() for line in of_examples.splitlines()], text


def _first_sentence(text: str) -> str:
    return re.split(r"(?<=[.;])\s", " ".join(text.split()), maxsplit=1)[0].removesuffix(";")


def _place(option: click.Option) -> int:
    return min((_USUAL.index(one) for one in option.opts if one in _USUAL), default=len(_USUAL))


def _options(command: click.Command) -> list[click.Option]:
    return [one for one in command.params if isinstance(one, click.Option) and not one.hidden]


def _typed(option: click.Option) -> str:
    names = ", ".join(sorted(option.opts, key=len)) + "".join(f" / {one}" for one in option.secondary_opts)
    kind = "" if option.is_flag else option.make_metavar(click.Context(click.Command("pvid")))
    return f"{names} {kind if len(kind) < 20 else '...'}".rstrip()


def _line(option: click.Option, width: int) -> str:
    """The first sentence, or as many of its clauses as fit; else as many words."""
    text = _first_sentence(option.help or "")
    clauses = [text[: one.start()] for one in re.finditer(r"[,:;]? \(|[,:;] ", text)]
    whole = next((one for one in (text, *reversed(clauses)) if len(one) <= width), None)
    return textwrap.shorten(text, width, placeholder=" ...") if whole is None else whole
