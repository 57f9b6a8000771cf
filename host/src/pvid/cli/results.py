"""Results as data: tables in CSV files whose first lines, `# command: ...`, contain what made them and when."""

from __future__ import annotations

import csv
import io
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import click

from pvid.base.atomic_write import write_whole
from pvid.base.console import write_stderr
from pvid.base.errors import PvidError
from pvid.cli.page_table import markdown
from pvid.core.sources import ROOT

DATA = click.option(
    "--data",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    help="Write each table as a CSV file into this folder (those of the documentation: host/docs/benchmarks).",
)


@dataclass(frozen=True)
class Results:
    """A table: its header, its rows of cells as text, and what made it: command, commit, date."""

    header: tuple[str, ...]
    rows: list[tuple[str, ...]]
    made: dict[str, str]

    def column(self, name: str) -> list[str]:
        """The cells below the first heading of this name."""
        at = self.header.index(name)
        return [row[at] for row in self.rows]

    def where(self, **cells: str) -> list[dict[str, str]]:
        """Rows with these cells, by heading."""
        some = [dict(zip(self.header, row, strict=True)) for row in self.rows]
        return [row for row in some if all(row[name] == cell for name, cell in cells.items())]


def read_results(path: Path) -> Results:
    """A table that `put_results` wrote.

    Raises PvidError when a row has another number of cells than the header, or the file has no header.
    """
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("# ")]
    made = dict(line.removeprefix("# ").split(": ", 1) for line in comments)
    header, *rows = [tuple(row) for row in csv.reader(lines[len(comments) :])] or [()]
    if not header or any(len(row) != len(header) for row in rows):
        raise PvidError(f"{path} is no table of results")
    return Results(header, rows, made)


def put_results(folder: Path | None, name: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Writes the table NAME.csv into the folder; prints it, as Markdown, where there is none."""
    cells = [tuple(row) for row in rows]
    made = {"command": _command(), "commit": _commit(), "date": f"{datetime.now(UTC):%Y-%m-%d}"}
    if folder is None:
        click.echo(markdown(tuple(header), cells))
        return
    text = io.StringIO()
    for key, value in made.items():
        text.write(f"# {key}: {value}\n")
    csv.writer(text, lineterminator="\n").writerows([header, *cells])
    write_whole(folder / f"{name}.csv", text.getvalue(), freely=True)
    write_stderr(f"{folder / name}.csv written")


def _command() -> str:
    """This process's, without the folder of its results."""
    words = sys.argv[1:]
    if "--data" in words:
        at = words.index("--data")
        words = words[:at] + words[at + 2 :]
    return shlex.join(["./tools/pvid", *words])


def _commit() -> str:
    """Of the repository, `+` behind it where files differ from it."""
    command = ["git", "describe", "--always", "--exclude=*", "--abbrev=8", "--dirty=+"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "none"
