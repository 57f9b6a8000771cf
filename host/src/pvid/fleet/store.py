"""Rows of a fleet on disk: line by line in a partial file as they come, and at the end in one Parquet file.

A row counts for a recording with the same key (pvid.fleet.row): of a file that has changed there is none.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from pvid.base.atomic_write import appearing
from pvid.base.errors import PvidError
from pvid.base.json_lines import append_json_line, read_json_lines
from pvid.base.wording import in_utf8
from pvid.fleet.row import Row

PARTIAL = ".partial.jsonl"
_SE = "_se"
_PARTS = ("se_apart", "se_noise")  # of the error, a column each behind the value's name
_FIXED = tuple(one.name for one in fields(Row) if one.name not in ("parameters", *_PARTS))
_NEWER = {"predicted", "report", "dated"}  # which older files do not have


class Store:
    """The rows that `out` and, until all are there, a partial file beside it contain.

    Raises PvidError when the name is no .parquet, its folder does not exist, or the file contains something else.

    Parameters
    ----------
    out : the Parquet file
    """

    def __init__(self, out: Path) -> None:
        if out.suffix != ".parquet":
            raise PvidError(f"{out}: rows are written as Parquet; name the file with .parquet")
        if not out.parent.is_dir():
            raise PvidError(f"{out}: there is no folder {out.parent}")
        _arrow()  # that it is not installed is no news for the end
        self.out = out
        self.partial = out.with_suffix(PARTIAL)
        self.rows: dict[str, Row] = {}
        for row in (*read_rows(out), *self._begun()):
            self.rows[row.key] = row

    def _begun(self) -> Iterable[Row]:
        """What the partial file contains."""
        for found in read_json_lines(self.partial):
            try:
                found["parameters"] = {name: tuple(one) for name, one in found["parameters"].items()}
                yield Row(**found)
            except (TypeError, KeyError, AttributeError):
                continue

    def add(self, row: Row) -> None:
        """Keeps a row, in the partial file too; a recording that cannot be read is tried again next time.

        Raises PvidError when it cannot be written.
        """
        if row.key:
            self.rows[row.key] = row
        append_json_line(self.partial, asdict(row))

    def finish(self, rows: Iterable[Row]) -> None:
        """Writes the Parquet file with these rows; the partial file vanishes.

        Raises PvidError when it cannot be written.
        """
        arrow, parquet = _arrow()
        found = list(rows)
        units = {name: unit for row in found for name, (_, _, unit) in row.parameters.items()}
        kinds = {
            "samples": arrow.int64(),
            "identified": arrow.bool_(),
            "began": arrow.float64(),
            "took": arrow.float64(),
            "predicted": arrow.float64(),
        }
        schema = [arrow.field(name, kinds.get(name, arrow.string())) for name in _FIXED]
        for name, unit in units.items():
            about = {b"unit": unit.encode()}
            columns = (name, name + _SE, *(f"{name}_{part}" for part in _PARTS))
            schema += [arrow.field(one, arrow.float64(), metadata=about) for one in columns]
        table = arrow.Table.from_pylist([_flat(row) for row in found], schema=arrow.schema(schema))
        try:
            with appearing(self.out, freely=True) as unfinished:
                parquet.write_table(table, unfinished)
            self.partial.unlink(missing_ok=True)
        except OSError as error:
            raise PvidError(f"{self.out}: cannot be written: {error.strerror}") from error


def _flat(row: Row) -> Mapping[str, Any]:
    flat = {name: in_utf8(one) if isinstance(one := getattr(row, name), str) else one for name in _FIXED}
    for name, (value, se, _) in row.parameters.items():
        flat |= {name: value, name + _SE: se} | {f"{name}_{part}": getattr(row, part).get(name) for part in _PARTS}
    return flat


def read_rows(path: Path) -> list[Row]:
    """The rows of a Parquet file; none where there is no file. Raises PvidError when it is something else."""
    if not path.exists():
        return []
    _, parquet = _arrow()
    try:
        table = parquet.read_table(path)
    except Exception as error:  # pyarrow's own kinds, which cannot be named without importing it
        raise PvidError(f"{path}: exists and is not a Parquet file: choose another name for -o") from error
    if not set(_FIXED) - _NEWER <= set(table.column_names):
        raise PvidError(f"{path}: exists and was not written by pvid batch: choose another name for -o")
    names = [name for name in table.column_names if name not in _FIXED and name + _SE in table.column_names]
    units = {name: (table.schema.field(name).metadata or {}).get(b"unit", b"").decode() for name in names}
    rows = []
    for one in table.to_pylist():
        own = {name: one[name] for name in _FIXED if name in one}
        own["parameters"] = {name: (one[name], one[name + _SE], units[name]) for name in names if one[name] is not None}
        for part in _PARTS:
            own[part] = {name: se for name in names if (se := one.get(f"{name}_{part}")) is not None}
        rows.append(Row(**own))
    return rows


def are_rows(path: Path) -> bool:
    """Whether a file in the folder of recordings was written by a batch, under any name."""
    if path.name.endswith(PARTIAL) or path.suffix != ".parquet":
        return path.name.endswith(PARTIAL)
    _, parquet = _arrow()
    try:
        return set(_FIXED) - _NEWER <= set(parquet.read_schema(path).names)
    except Exception:  # as above: it fails as a recording
        return False


def _arrow() -> tuple[Any, Any]:
    import pyarrow
    import pyarrow.parquet

    return pyarrow, pyarrow.parquet
