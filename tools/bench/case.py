"""What every measurement of the bench is: a case has options and gives a report of tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import click

Advance = Callable[[], None]  # called at each step
Table = tuple[str, Sequence[str], Iterable[Sequence[str]]]  # name of the file, header, rows of cells
DIFFERS = "DIFFERENT"  # a cell: bits are not those that they must be


@dataclass(frozen=True)
class Report:
    """What a case gave.

    Attributes
    ----------
    tables : one without rows is not written
    faults : what must not be, a sentence each
    said : other lines for the terminal
    """

    tables: Sequence[Table] = ()
    faults: Sequence[str] = ()
    said: Sequence[str] = ()


def counts(name: str, numbers: Iterable[tuple[str, int]]) -> Table:
    """The table of one run: what was counted, and the number."""
    return name, ("what", "number"), [(what, str(number)) for what, number in numbers]


def option(name: str | list[str], default: Any, about: str = "", least: int = 1, **more: Any) -> click.Option:
    """An option of a case; a number is at least `least`."""
    kind = {"type": click.IntRange(min=least)} if isinstance(default, int) else {}
    names = [name] if isinstance(name, str) else name
    return click.Option(names, default=default, show_default=True, help=about, **{**kind, **more})


@dataclass(frozen=True)
class Case:
    """A measurement: `./tools/pvid bench NAME`.

    Attributes
    ----------
    claim : what its tables are evidence of, as pages have it
    run : of the options by name and `advance`, which is called at each step
    tables : that it writes, without the endings that options give them
    short : of tests/: its short form
    """

    name: str
    claim: str
    run: Callable[..., Report]
    tables: tuple[str, ...]
    options: Sequence[click.Parameter] = ()
    short: str = ""
