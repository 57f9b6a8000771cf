"""What every measurement of the bench is: a case has options and gives a report of tables."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import click

from pvid.base.errors import PvidError

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


def columns(text: str) -> tuple[str, ...]:
    """A header, of headings between bars."""
    return tuple(one.strip() for one in text.split(" | "))


def counts(name: str, numbers: Iterable[tuple[str, int]]) -> Table:
    """The table of one run: what was counted, and the number."""
    return name, ("what", "number"), [(what, str(number)) for what, number in numbers]


def option(name: str | list[str], default: Any, about: str = "", least: int = 1, **more: Any) -> click.Option:
    """An option of a case; a number is at least `least`."""
    kind = {"type": click.IntRange(min=least)} if isinstance(default, int) else {}
    names = [name] if isinstance(name, str) else name
    return click.Option(names, default=default, show_default=True, help=about, **{**kind, **more})


def chosen(
    given: Collection[str], usual: Sequence[str] = (), what: str = "mechanism", among: Sequence[str] = ()
) -> tuple[str, ...]:
    """Those of a case, among all mechanisms unless told; empty: those that are usual
    for it, or all; frozenset(): none.

    Raises PvidError when there is none of a name.
    """
    if not among:
        from pvid.models.mechanisms import names

        among = names()
    if unknown := set(given) - set(among):
        raise PvidError(f"no such {what}: {', '.join(sorted(unknown))}; there are {', '.join(among)}")
    return tuple(given if given or isinstance(given, frozenset) else usual or among)


@dataclass(frozen=True)
class Case:
    """A measurement: `./tools/pvid bench NAME`.

    Attributes
    ----------
    claim : what its tables are evidence of
    place : module of this folder with its `report`, or MODULE:FUNCTION, of the options and `advance`
    tables : that it writes, without the endings that options give them
    rows : in place of a report: tables, their headers' names and those of the functions of their rows, which take
        mechanisms, a number and `advance`
    """

    name: str
    claim: str
    place: str
    tables: tuple[str, ...] = ()
    options: Sequence[click.Parameter] = ()
    rows: tuple[tuple[str, str, str], ...] = ()

    @property
    def written(self) -> tuple[str, ...]:
        """Names of all its tables."""
        return self.tables + tuple(name for name, _, _ in self.rows)

    def run(self, **given: Any) -> Report:
        """Measures."""
        module, _, function = self.place.partition(":")
        found = import_module(f"bench.{module}")
        if not self.rows:
            report: Report = getattr(found, function or "report")(**given)
            return report
        given = {"names": chosen(given.pop("mechanism")), **given}
        return Report(
            [(name, getattr(found, of), getattr(found, rows)(*given.values())) for name, of, rows in self.rows]
        )


@dataclass(frozen=True)
class Frozen:
    """A measurement that is not made again.

    Attributes
    ----------
    name : of its command, at the commit in the heads of its tables
    claim, tables : as those of a case
    holder : the tests of what the claim still promises of the code of today
    """

    name: str
    claim: str
    tables: tuple[str, ...]
    holder: str
