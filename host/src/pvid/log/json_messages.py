"""Rows of a log as JSON objects with a JSON schema, for MCAP files and for Foxglove's live server.

A table is a topic, `/samples`. Foxglove's page on custom encodings has it so: schema "jsonschema" of an object,
messages "json". The schema has each column's unit and meaning.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from pvid.log.values import Column, Rows, Tables

_KINDS = {"f8": "number", "i8": "integer"}


def topic(table: str) -> str:
    """Of a table's messages."""
    return f"/{table}"


def schema(table: str, columns: Mapping[str, Column]) -> dict[str, Any]:
    """JSON schema of a table's messages; its title is the schema's name."""
    properties = {
        name: {"type": _KINDS.get(column.kind, "string"), "description": column.what, "unit": column.unit}
        for name, column in columns.items()
        if name != "log_time"
    }
    return {"title": f"pvid.{table}", "type": "object", "properties": properties}


def units(columns: Mapping[str, Column]) -> dict[str, str]:
    """Of the columns that have one, for the metadata of a topic."""
    used = ((name, column.unit) for name, column in columns.items() if name != "log_time")
    return {name: unit for name, unit in used if unit not in ("", "1")}


def messages(rows: Rows, tables: Tables) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yields (time [ns], message) of each row. NaN is left out of a message: JSON has none."""
    names = [name for name in tables[rows.table] if name != "log_time"]
    times = rows.columns["log_time"].tolist()
    for log_time, *row in zip(times, *(rows.columns[name].tolist() for name in names), strict=True):
        yield log_time, {name: value for name, value in zip(names, row, strict=True) if value == value}


def encoded(message: Mapping[str, Any]) -> bytes:
    """UTF-8 of a message."""
    return json.dumps(message).encode()
