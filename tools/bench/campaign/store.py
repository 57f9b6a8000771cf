"""Records of a campaign on disk: line by line in a partial file as they come, and at the end in one Parquet file.

A record belongs to a key, which changes with the population, the settings and the code; those of another key are not
taken for results.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import pvid
from bench.campaign.judge import COLUMNS, Record
from pvid.base.atomic_write import appearing
from pvid.base.errors import PvidError
from pvid.base.json_lines import append_json_line, read_json_lines
from pvid.core.headers import default_library

_KEY = "key"


@lru_cache(maxsize=1)
def code_version() -> str:
    """Sixteen digits that change with any source of the package and of tools/bench."""
    digest = hashlib.sha256()
    for package in (Path(pvid.__file__).resolve().parent, Path(__file__).resolve().parents[1]):
        for path in sorted((*package.rglob("*.py"), *package.rglob("*.toml"))):
            digest.update(str(path.relative_to(package)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def core_version() -> str:
    """Sixteen digits that change with the build of the C core."""
    return hashlib.sha256(default_library().read_bytes()).hexdigest()[:16]


class Store:
    """The records of one campaign, in `out` and, until it is complete, in a partial file beside it.

    Parameters
    ----------
    out
        The Parquet file.
    key
        Of the campaign.
    """

    def __init__(self, out: Path, key: str) -> None:
        if out.suffix != ".parquet":
            raise PvidError(f"{out}: results are written as Parquet; name the file with .parquet")
        if not out.parent.is_dir():
            raise PvidError(f"{out}: there is no folder {out.parent}")
        self.out = out
        self.partial = out.with_suffix(".partial.jsonl")
        self.key = key
        self._arrow, self._parquet = _arrow()
        self.records: dict[int, Record] = {}
        self.foreign = 0
        for record in (*self._complete(), *read_json_lines(self.partial)):
            self._take(record)

    def _take(self, keyed: dict[str, Any]) -> None:
        if keyed.get(_KEY) == self.key and set(keyed) == {*COLUMNS, _KEY}:
            record = {name: keyed[name] for name in COLUMNS}
            self.records[int(keyed["rig"])] = record
        else:
            self.foreign += 1

    def _complete(self) -> list[dict[str, Any]]:
        if not self.out.exists():
            return []
        try:
            rows: list[dict[str, Any]] = self._parquet.read_table(self.out).to_pylist()
        except Exception as error:  # pyarrow's own kinds, which cannot be named without importing it
            raise PvidError(f"{self.out}: exists and is not a Parquet file: choose another name for -o") from error
        if not all(_KEY in row for row in rows):
            raise PvidError(f"{self.out}: exists and is not a campaign's result: choose another name for -o")
        return rows

    def add(self, record: Record) -> None:
        """Keeps a record, in the partial file too."""
        append_json_line(self.partial, {_KEY: self.key, **{name: record[name] for name in COLUMNS}})
        self.records[int(str(record["rig"]))] = record

    def chosen(self, rigs: Iterable[int]) -> list[Record]:
        """The records of these rigs."""
        return [self.records[rig] for rig in rigs]

    def finish(self, rigs: Iterable[int]) -> list[Record]:
        """Writes the Parquet file with the records of these rigs, and returns them; the partial file vanishes."""
        records = self.chosen(rigs)
        kinds = {int: self._arrow.int64(), float: self._arrow.float64(), bool: self._arrow.bool_()}
        schema = self._arrow.schema(
            [(_KEY, self._arrow.string())]
            + [(name, kinds.get(kind, self._arrow.string())) for name, kind in COLUMNS.items()]
        )
        table = self._arrow.Table.from_pylist([{_KEY: self.key, **record} for record in records], schema=schema)
        try:
            with appearing(self.out, freely=True) as unfinished:
                self._parquet.write_table(table, unfinished)
            self.partial.unlink(missing_ok=True)
        except OSError as error:
            raise PvidError(f"{self.out}: cannot be written: {error.strerror}") from error
        return records


def _arrow() -> tuple[Any, Any]:
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise PvidError("a campaign needs the Python package pyarrow, which is not installed") from error
