"""Files of JSON: lines of objects, a list of objects or of rows, or an object of lists; nested objects and lists are
columns `motor.i` and `axis[0]`."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.wording import listed, reason, shown
from pvid.rig.columns import Columns
from pvid.rig.csv_table import read_csv, text_table
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table
from pvid.rig.text_lines import whole

_ROWS = 1 << 14  # a block


def read_json(path: Path, columns: Columns) -> Table:
    """Reads the records of a file as the rows of a table.

    Raises PvidError for whatever is wrong with the file; lines that are no JSON are read as text.
    """
    text = whole(path).decode(errors="replace")
    try:
        records = _records(path, json.loads(text))
    except RecursionError as error:
        raise PvidError(f"{path} is nested too deeply for a recording.") from error
    except ValueError as error:
        lines = [one for one in text.split("\n") if one.strip()]
        if len(lines) < 2:
            raise PvidError(f"{path} is no JSON: {reason(error)}.") from error
        try:
            records = [json.loads(one) for one in lines]
        except ValueError:
            return read_csv(path, columns)
    if not records:
        raise PvidError(f"{path} has no list of records.")
    refuse_beyond(path, len(records))
    rows = [dict(_cells("", one)) for one in records]
    names = list(dict.fromkeys(name for row in rows for name in row))
    last = Counter(name.rpartition(".")[2] for name in names)
    wanted = set(columns.wanted)
    short = [one if one in wanted or last[end] > 1 else end for one in names for end in [one.rpartition(".")[2]]]
    return text_table(path, columns, partial(_blocks, names, short, rows), "record")


def _records(path: Path, found: Any) -> list[Any]:
    """Those of a list, or of the one that an object holds; of lists beside each other, a record a sample.

    Raises PvidError for an object of several tables.
    """
    while isinstance(found, Mapping):
        lists = {name: one for name, one in found.items() if isinstance(one, list)}
        longest = max(map(len, lists.values()), default=0)
        beside = {name: one for name, one in lists.items() if len(one) == longest > 1}
        if len(beside) > 1 and not any(isinstance(one[0], Mapping | list) for one in beside.values()):
            return [dict(zip(beside, row, strict=True)) for row in zip(*beside.values(), strict=True)]
        tables = {name: one for name, one in found.items() if _is_table(one)}
        if len(tables) > 1:
            raise PvidError(f"{path} holds several tables: {listed(map(shown, tables))}; keep the one to read.")
        inner = [*tables.values(), *lists.values(), *(one for one in found.values() if isinstance(one, Mapping))]
        if not inner:
            return [found]
        found = inner[0] if tables else max(inner, key=len)
    return found if isinstance(found, list) else []


def _is_table(found: Any) -> bool:
    """Whether a value has records or lists of samples in it."""
    if isinstance(found, Mapping):
        return any(map(_is_table, found.values())) or sum(isinstance(one, list) for one in found.values()) > 1
    return isinstance(found, list) and len(found) > 1 and isinstance(found[0], Mapping | list)


def _cells(name: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _cells(f"{name}.{key}" if name else str(key), one)
    elif isinstance(value, list):
        for k, one in enumerate(value):
            yield from _cells(f"{name}[{k}]" if name else str(k + 1), one)
    elif isinstance(value, bool):
        yield name, str(int(value))
    else:
        yield name, "" if value is None else str(value)


def _blocks(names: list[str], shown: list[str], rows: list[dict[str, str]]) -> Iterator[bytes]:
    lines = ["\t".join(map(_plain, shown))]
    for row in rows:
        lines.append("\t".join(_plain(row.get(name, "")) for name in names))
        if len(lines) == _ROWS:
            yield ("\n".join(lines) + "\n").encode()
            lines = []
    yield ("\n".join(lines) + "\n").encode()


def _plain(cell: str) -> str:
    return " ".join(cell.split()).replace('"', "'")
