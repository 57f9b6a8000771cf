"""The command line: `./tools/pvid COMMAND`.

Exit codes: 0 done, 1 a comparison failed, 2 bad input or usage, or output that cannot be written (one sentence),
3 nothing identified, 4 a parameter of a fleet changed, 70 an error of pvid's own (a report is written), 130
interrupted, 141 the output was closed by its reader.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec

import click
from click.shell_completion import CompletionItem

from pvid.base.console import BAD_INPUT, DONE, INTERRUPTED, OWN_ERROR, write_stderr
from pvid.base.errors import PvidError, UnknownMechanismError
from pvid.base.freed_memory import keep_freed
from pvid.base.output import watch
from pvid.base.packages import PACKAGES, installing
from pvid.base.version import __version__
from pvid.base.wording import reason, shown, typed_name
from pvid.cli.short_help import with_short_help

GROUPS: Mapping[str, Mapping[str, str]] = {
    "Identify": {
        "demo": "Identify a simulated rig in the firmware on an emulated board.",
        "look": "Say what is in a recording, which mechanism it can be, and what to type next.",
        "simulate": "Simulate a rig and write its run and rig file.",
        "identify": "Identify the parameters from a recorded or simulated run.",
        "validate": "Say how well an answer predicts another run.",
        "tune": "Show the designs of the weak form for a recorded run.",
        "plot": "Draw a report of a log or a run.",
        "batch": "Identify many runs and logs in parallel; one row each, and a page of what changed.",
        "watch": "Identify the recordings of a folder as they come, and say what changed.",
    },
    "Boards": {
        "log": "Record a board's samples and estimates.",
        "ports": "List the serial ports of this machine and the emulated boards.",
        "view": "Show a log on the live page.",
        "export": "Convert a log to csv, parquet, mcap or npz.",
        "layout": "Write the plots of a log as a layout file for PlotJuggler or Foxglove.",
        "sizes": "Measure flash, RAM, stack and instructions on every emulated board.",
    },
    "Design": {
        "design": "Predict standard errors for a rig.",
        "tables": "Print the constant tables of the C core.",
        "schema": "Print the C header of the serial link's frames.",
    },
    "Models": {
        "models": "List the mechanisms with their channels, parameters and units.",
        "model": "Check, predict, simulate or build a mechanism of your own or of the list.",
        "deploy": "Write a mechanism with its rig for Arduino, PlatformIO, ESP-IDF, Zephyr, CMake or CubeMX.",
    },
    "Prove": {
        "compare": "Compare the C core with its numpy twin, bit for bit.",
        "verify": "Recompute a log with the numpy twin, bit for bit.",
        "bench": "Measure accuracy, robustness and cost.",
    },
}
_ELSEWHERE = {
    "schema": ("pvid.cli.tables", "schema"),
    "bench": ("bench.command", "bench"),
    "watch": ("pvid.cli.batch", "watch"),
}
_IN_A_CLONE = ("bench",)
# Packages that not every installation has, with the extra of pvid that brings them.


def main() -> None:
    """Runs a command and turns every refusal into one sentence and its exit code."""
    watch()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: threads wait for each other, on all cores
    keep_freed()
    os.environ.pop("MPLBACKEND", None)  # figures are files here; a backend that is not installed would fail
    try:
        code = commands.main(prog_name=typed_name(), complete_var="_PVID_COMPLETE", standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        code = DONE
    except click.NoSuchOption as error:
        from pvid.cli.rig_keys import setting_for  # the rig file's keys, which only this needs

        del (error.possibilities or [])[1:]  # the nearest one; click sorts them by letters
        write_stderr(f"pvid: {setting_for(error) or _usage(error)}")
        code = BAD_INPUT
    except (click.exceptions.Abort, KeyboardInterrupt):
        write_stderr("pvid: interrupted")
        code = INTERRUPTED
    except click.ClickException as error:
        write_stderr(f"pvid: {_usage(error)}")
        code = BAD_INPUT
    except PvidError as error:
        write_stderr(f"pvid: {error}")
        if isinstance(error, UnknownMechanismError):
            from pvid.cli.look_text import next_lines  # loads SymPy

            for line in next_lines(error.path):
                write_stderr(line)
        code = BAD_INPUT
    except OSError as error:
        write_stderr(f"pvid: {'' if error.filename is None else f'{error.filename}: '}{reason(error)}")
        code = BAD_INPUT
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module in PACKAGES:
            write_stderr(f"pvid: this needs the Python package {PACKAGES[module]}: {installing(module)}")
            code = BAD_INPUT
        else:
            code = _own_error(error)
    except MemoryError as error:
        detail = f" ({reason(error)})" if str(error) else ""
        write_stderr(f"pvid: not enough memory{detail}: is a length, a rate or a count too large?")
        code = BAD_INPUT
    except Exception as error:
        code = _own_error(error)
    sys.exit(code if isinstance(code, int) else DONE)


def _own_error(error: Exception) -> int:
    """One sentence on an error that nobody foresaw, with the file of its report."""
    from pvid.base.crash_report import written  # rarely needed

    report = written(error, sys.argv[1:])
    where = "no file for its report could be written" if report is None else f"please send the report {report}"
    write_stderr(f"pvid: an error of pvid's own ({type(error).__name__}), not of your input: {where}")
    return OWN_ERROR


def _usage(error: click.ClickException) -> str:
    """The sentence of a wrong command line, and where its help is."""
    context = getattr(error, "ctx", None)
    text = " ".join(error.format_message().split())  # click lists choices by lines and tabs
    return text + (f" (see {context.command_path} --help)" if context is not None else "")


class Commands(click.Group):
    """The commands in groups; a command's module is imported when it is used. bench and campaign need a clone."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        absent = () if find_spec("bench") else _IN_A_CLONE
        return [name for group in GROUPS.values() for name in group if name not in absent]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.list_commands(ctx):
            return None
        module, attribute = _ELSEWHERE.get(cmd_name, (f"pvid.cli.{cmd_name}", "command"))
        return with_short_help(getattr(import_module(module), attribute))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As of click, which proposes names of commands that it holds; these are imported when they are used."""
        name, present = args[0], self.list_commands(ctx)
        if not name.startswith("-") and name not in present and not ctx.resilient_parsing:
            near = get_close_matches(name, present, n=1, cutoff=0.5)
            ctx.fail(f"there is no command {shown(name)}" + (f": did you mean {near[0]}?" if near else ""))
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The commands with their lines, none of which is imported for that."""
        lines = {name: line for group in GROUPS.values() for name, line in group.items()}
        names = [name for name in self.list_commands(ctx) if name.startswith(incomplete)]
        return [CompletionItem(name, help=lines[name]) for name in names] or super().shell_complete(ctx, incomplete)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        present = self.list_commands(ctx)
        width = max(map(len, present))
        for title, group in GROUPS.items():
            rows = [(name.ljust(width), line) for name, line in group.items() if name in present]
            with formatter.section(title):
                formatter.write_dl(rows)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="pvid", message="%(prog)s %(version)s")
def commands() -> None:
    """Identifies the parameters of a mechanism from its motion, on a PC and on microcontrollers, with equal bits.

    \b
    pvid demo                                           see it work
    pvid identify RUN.csv                               your recording
    pvid identify RUN.csv --model MODEL --set l1=0.25   that of a mechanism, with a constant
    """
