"""The mechanisms as a table for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.markup import escape
from rich.table import Table

from pvid.model.compiled import Known, Output, Signal, Unknown
from pvid.models.mechanisms import described, names
from pvid.models.model import Model, Quantity
from pvid.models.registry import MODELS

Described = Signal | Known | Unknown | Output


def models_table(models: Iterable[Model] = MODELS.values(), mechanisms: Iterable[str] | None = None) -> Table:
    """Of each mechanism channels, constants, parameters and physical parameters, with units.

    Parameters
    ----------
    models : those that the C core identifies
    mechanisms : names of those that a model file describes; None: the shipped ones that are not among `models`
    """
    table = Table("mechanism", "kind", "name", "unit", "meaning")
    for model in models:
        kinds: tuple[tuple[str, Sequence[Quantity]], ...] = (
            ("channel", model.channels),
            ("constant", model.constants),
            ("parameter", model.published),
            ("nuisance", model.parameters[len(model.published) :]),
            ("physical", model.physical),
        )
        _head(table, model.name, model.title)
        for kind, quantities in kinds:
            for one in quantities:
                table.add_row("", kind, one.name, one.unit, escape(one.meaning))
    for name in mechanisms if mechanisms is not None else (one for one in names() if one not in MODELS):
        description = described(name)
        _head(table, name, description.title)
        described_kinds: tuple[tuple[str, Sequence[Described]], ...] = (
            ("channel", description.signals),
            ("constant", description.knowns),
            ("parameter", description.unknowns),
            ("physical", description.outputs),
        )
        for kind, ones in described_kinds:
            for entry in ones:
                table.add_row("", kind, entry.name, entry.unit, _remark(entry))
    return table


def _head(table: Table, name: str, title: str) -> None:
    table.add_section()
    table.add_row(escape(name), "", "", "", escape(title))


def _remark(one: Described) -> str:
    """Value of a constant, kind of a signal."""
    if isinstance(one, Known):
        return f"{one.value:g}"
    if isinstance(one, Signal):
        return one.kind if one.kind == "input" or not one.driven else "sensor of what the drive imposes"
    return f"guess {one.guess:g}" if isinstance(one, Unknown) else escape(str(one.value))
