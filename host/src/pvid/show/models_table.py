"""The mechanisms as a table for the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from pvid.model.compiled import Known, Output, Signal, Unknown
from pvid.models.mechanisms import described, names

Described = Signal | Known | Unknown | Output


def models_table() -> Table:
    """Of each shipped mechanism channels, constants, parameters and outputs, with units."""
    table = Table("mechanism", "kind", "name", "unit", "meaning")
    for name in names():
        description = described(name)
        table.add_section()
        table.add_row(escape(name), "", "", "", escape(description.title))
        kinds: tuple[tuple[str, Sequence[Described]], ...] = (
            ("channel", description.signals),
            ("constant", description.knowns),
            ("parameter", description.unknowns),
            ("physical", description.outputs),
        )
        for kind, ones in kinds:
            for entry in ones:
                table.add_row("", kind, entry.name, entry.unit, _remark(entry))
    return table


def _remark(one: Described) -> str:
    """Value of a constant, kind of a signal."""
    if isinstance(one, Known):
        return f"{one.value:g}"
    if isinstance(one, Signal):
        return one.kind if one.kind == "input" or not one.driven else "sensor of what the drive imposes"
    return f"guess {one.guess:g}" if isinstance(one, Unknown) else escape(str(one.value))
