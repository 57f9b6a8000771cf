"""The mechanisms as a table for the terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.markup import escape
from rich.table import Table

from pvid.models.model import Model
from pvid.models.registry import MODELS


def models_table(models: Iterable[Model] = MODELS.values()) -> Table:
    """Of each mechanism channels, constants, parameters and physical parameters, with units."""
    table = Table("mechanism", "kind", "name", "unit", "meaning")
    for model in models:
        table.add_section()
        kinds = (
            ("channel", model.channels),
            ("constant", model.constants),
            ("parameter", model.published),
            ("nuisance", model.parameters[len(model.published) :]),
            ("physical", model.physical),
        )
        table.add_row(escape(model.name), "", "", "", escape(model.title))
        for kind, quantities in kinds:
            for one in quantities:
                table.add_row("", kind, one.name, one.unit, escape(one.meaning))
    return table
