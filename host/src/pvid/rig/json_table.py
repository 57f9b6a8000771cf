"""Files of JSON: objects after each other, a list of objects or of rows, an object of lists or of objects, names beside
rows; nested objects and lists are columns `motor.i` and `axis[0]`. What a program that was stopped has left is read."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.wording import listed, reason, shown
from pvid.rig.columns import TIME, Columns
from pvid.rig.csv_table import read_csv, text_table
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table
from pvid.rig.text_lines import whole

_ROWS = 1 << 14  # a block
_DATED = 10**8  # s, ms, ... since 1970: an index below it counts rows
_DAMAGED = 0.05  # of the records, which are left out
_BETWEEN = re.compile(r"[\s,]*")  # records
_BRACKETS = re.compile(r'"(?:[^"\\]|\\.)*"|[][{}]')
_CLOSING = {"[": "]", "{": "}"}


def read_json(path: Path, columns: Columns) -> Table:
    """Reads the records of a file as the rows of a table.

    Raises PvidError for whatever is wrong with the file; lines that are no JSON are read as text.
    """
    text, note = whole(path).decode(errors="replace"), ""
    try:
        try:
            found = json.loads(text)
        except ValueError as error:
            found, note = _whole_records(text)
            if not found and text.count("\n", 0, -1):
                return read_csv(path, columns)
            if not found:
                raise PvidError(f"{path} is no JSON: {reason(error)}.") from error
        records = _records(path, found)
    except RecursionError as error:
        raise PvidError(f"{path} is nested too deeply for a recording.") from error
    if not records:
        raise PvidError(f"{path} has no list of records.")
    refuse_beyond(path, len(records))
    rows = [dict(_cells("", one)) for one in records]
    names = list(dict.fromkeys(name for row in rows for name in row))
    last = Counter(name.rpartition(".")[2] for name in names)
    wanted = set(columns.wanted)
    short = [one if one in wanted or last[end] > 1 else end for one in names for end in [one.rpartition(".")[2]]]
    try:
        table = text_table(path, columns, partial(_blocks, names, short, rows), "record")
    except PvidError as error:
        if note:
            error.args = (f"{str(error).rstrip('.')}; {note}.",)
        raise
    return replace(table, notes=(*([note] if note else ()), *table.notes))


def _whole_records(text: str) -> tuple[Any, str]:
    """The records of a list or an object that lacks its end, or of those that stand after each other in a text, and a
    note on what was left out; None where there are none, or too much is no record."""
    opened: list[str] = []
    end, closing = 0, ""
    for one in _BRACKETS.finditer(text):
        if one[0] in _CLOSING:
            opened.append(_CLOSING[one[0]])
        elif opened and one[0] == opened[-1]:
            opened.pop()
            end, closing = one.end(), "".join(reversed(opened))
            if not opened:  # whole: others follow
                break
    if closing:
        try:
            return json.loads(text[:end] + closing), "the file ends within a record, which is left out"
        except ValueError:
            pass
    records: list[Any] = []
    damaged: list[str] = []
    decoder, at = json.JSONDecoder(), 0
    while (at := _between(text, at)) < len(text) and len(damaged) <= 2 + _DAMAGED * len(records):
        try:
            value, end = decoder.raw_decode(text, at)
        except ValueError:
            value, end = None, text.find("\n", at) + 1 or len(text)
        if isinstance(value, Mapping | list):
            records.append(value)
        else:
            damaged.append(text[at:end].strip())
        at = end
    if at < len(text) or len(damaged) > _DAMAGED * len(records):
        return None, ""
    return records, f"left out, no JSON: {len(damaged)} (first: {shown(damaged[0])})" if damaged else ""


def _between(text: str, at: int) -> int:
    found = _BETWEEN.match(text, at)
    return found.end() if found else at


def _records(path: Path, found: Any) -> list[Any]:
    """Those of a list, or of the one that an object holds; of lists beside each other, a record a sample.

    Raises PvidError for an object of several tables.
    """
    while isinstance(found, Mapping) or (isinstance(found, list) and len(found) == 1):
        if isinstance(found, list):
            found = found[0]
            continue
        if records := _of_names(found) or _of_objects(found):
            return records
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


def _of_names(found: Mapping[str, Any]) -> list[Any]:
    """Records of names beside rows or columns, as data frames and databases write them; none where there are none."""
    lists = [one for one in found.values() if isinstance(one, list) and one]
    for names in lists:
        for rows in lists:
            if all(isinstance(one, str) for one in names) and all(_is_row(one, len(names)) for one in rows):
                return _indexed(found.get("index"), (dict(zip(names, row, strict=True)) for row in rows))
    schema, data = found.get("schema"), found.get("data")
    if not isinstance(schema, Mapping) or not isinstance(schema.get("fields"), list):
        return []
    columns = data.get("values") if isinstance(data, Mapping) else None
    if not isinstance(columns, list) or not all(isinstance(one, list) for one in columns):
        return data if isinstance(data, list) else []
    names = [str(one.get("name")) for one in schema["fields"] if isinstance(one, Mapping)]
    return [dict(zip(names, row, strict=False)) for row in zip(*columns, strict=False)]


def _is_row(found: Any, width: int) -> bool:
    return isinstance(found, list) and len(found) == width


def _of_objects(found: Mapping[str, Any]) -> list[Any]:
    """Records of objects with the same keys: the longer side are the samples; none where there are none."""
    objects = [one for one in found.values() if isinstance(one, Mapping)]
    if not 1 < len(objects) == len(found) or any(one.keys() != objects[0].keys() for one in objects):
        return []
    first = objects[0]
    if any(isinstance(one, Mapping | list) for one in first.values()):
        return []
    if len(first) <= len(found):
        return _indexed([*found], objects)
    return _indexed([*first], ({name: one[key] for name, one in found.items()} for key in first))


def _indexed(index: Any, records: Iterable[Mapping[str, Any]]) -> list[Any]:
    """Records with their index as time, where it is no count of rows and no other column is called so."""
    rows = list(records)
    if not _is_row(index, len(rows)) or any(TIME.is_called(name) for name in rows[0]):
        return rows
    if all(str(one).isdecimal() and int(one) < _DATED for one in index):
        return rows
    return [{"t": t, **row} for t, row in zip(index, rows, strict=True)]


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
