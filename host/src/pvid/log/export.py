"""Logs for other programs: CSV, Parquet, NPZ, MCAP, with units in the metadata.

Memory is constant but for NPZ, which holds its arrays while it is written. A file appears whole or not at all.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pvid.base.atomic_write import appearing
from pvid.base.errors import PvidError
from pvid.base.version import __version__
from pvid.log.json_messages import encoded, messages, schema, topic, units
from pvid.log.mechanism import LogMechanism
from pvid.log.reader import LogReader
from pvid.log.rig import hello_of_log, names_of_log
from pvid.log.values import Column, Rows, Tables, Values

_BATCH = 1 << 15  # rows


class Writer(Protocol):
    """Takes rows in, one after the other."""

    def __init__(self, base: Path, files: Mapping[str, Path], tables: Tables) -> None: ...

    @staticmethod
    def suffixes(tables: Tables) -> list[str]: ...

    def write(self, rows: Rows) -> None: ...

    def close(self) -> None: ...


class CsvWriter:
    """A file of each table; numbers as Python writes them, which read back exactly."""

    def __init__(self, base: Path, files: Mapping[str, Path], tables: Tables) -> None:
        self._stack, self._tables = ExitStack(), tables
        self._writers = {}
        for table, columns in tables.items():
            file = self._stack.enter_context(files[f"-{table}.csv"].open("w", newline="", encoding="utf-8"))
            self._writers[table] = csv.writer(file)
            self._writers[table].writerow(columns)
        files["-metadata.json"].write_text(json.dumps(self._metadata(base), indent=1), encoding="utf-8")

    @staticmethod
    def suffixes(tables: Tables) -> list[str]:
        """Endings of what is written."""
        return [*(f"-{table}.csv" for table in tables), "-metadata.json"]

    def _metadata(self, base: Path) -> dict[str, Any]:
        kinds = {"f8": "double", "i8": "long"}

        def described(name: str, column: Column) -> dict[str, Any]:
            kind = kinds.get(column.kind, "string")
            return {"name": name, "datatype": kind, "dc:description": column.what, "unit": column.unit}

        tables = [
            {
                "url": f"{base.name}-{table}.csv",
                "tableSchema": {"columns": [described(name, column) for name, column in columns.items()]},
            }
            for table, columns in self._tables.items()
        ]
        return {"@context": "http://www.w3.org/ns/csvw", "dc:creator": f"pvid {__version__}", "tables": tables}

    def write(self, rows: Rows) -> None:
        """See Writer."""
        columns = [rows.columns[name].tolist() for name in self._tables[rows.table]]
        self._writers[rows.table].writerows(zip(*columns, strict=True))

    def close(self) -> None:
        """See Writer."""
        self._stack.close()


class _Gathered:
    """Rows of each table, until there are enough of them."""

    def __init__(self, tables: Tables) -> None:
        self.tables = tables
        self._parts: dict[str, list[Rows]] = {table: [] for table in tables}
        self._count = dict.fromkeys(tables, 0)

    def add(self, rows: Rows) -> bool:
        """Whether a batch of this table is full."""
        self._parts[rows.table].append(rows)
        self._count[rows.table] += len(rows.columns["t"])
        return self._count[rows.table] >= _BATCH

    def take(self, table: str) -> dict[str, npt.NDArray[Any]]:
        """What was gathered, by column; arrays of length 0 when nothing was."""
        parts, self._parts[table], self._count[table] = self._parts[table], [], 0
        return {
            name: np.concatenate([np.empty(0, column.kind), *(one.columns[name] for one in parts)])
            for name, column in self.tables[table].items()
        }


class ParquetWriter:
    """A file of each table; unit and description are metadata of the columns."""

    def __init__(self, base: Path, files: Mapping[str, Path], tables: Tables) -> None:
        import pyarrow  # 40 ms that other formats need not wait for
        import pyarrow.parquet

        self._arrow, self._parquet = pyarrow, pyarrow.parquet
        self._gathered = _Gathered(tables)
        self._schemas = {table: self._schema(columns) for table, columns in tables.items()}
        self._writers = {
            table: self._parquet.ParquetWriter(files[f"-{table}.parquet"], schema)
            for table, schema in self._schemas.items()
        }

    @staticmethod
    def suffixes(tables: Tables) -> list[str]:
        """Endings of what is written."""
        return [f"-{table}.parquet" for table in tables]

    def _schema(self, columns: Mapping[str, Column]) -> Any:
        arrow = self._arrow
        kinds = {"f8": arrow.float64(), "i8": arrow.int64()}
        fields = [
            arrow.field(
                name, kinds.get(column.kind, arrow.string()), metadata={"unit": column.unit, "description": column.what}
            )
            for name, column in columns.items()
        ]
        return arrow.schema(fields, metadata={"creator": f"pvid {__version__}"})

    def _flush(self, table: str) -> None:
        columns = self._gathered.take(table)
        self._writers[table].write_table(self._arrow.table(columns, schema=self._schemas[table]))

    def write(self, rows: Rows) -> None:
        """See Writer."""
        if self._gathered.add(rows):
            self._flush(rows.table)

    def close(self) -> None:
        """See Writer."""
        for table, writer in self._writers.items():
            self._flush(table)
            writer.close()


class NpzWriter:
    """One file: the samples' columns by their names, the others' as `estimates.w`; "units" is a JSON object."""

    def __init__(self, base: Path, files: Mapping[str, Path], tables: Tables) -> None:
        self._path = files[".npz"]
        self._gathered = _Gathered(tables)

    @staticmethod
    def suffixes(tables: Tables) -> list[str]:
        """Endings of what is written."""
        return [".npz"]

    def write(self, rows: Rows) -> None:
        """See Writer."""
        self._gathered.add(rows)

    def close(self) -> None:
        """See Writer."""
        arrays: dict[str, npt.NDArray[Any]] = {}
        units = {}
        for table, columns in self._gathered.tables.items():
            front = "" if table == "samples" else f"{table}."
            arrays.update({front + name: array for name, array in self._gathered.take(table).items()})
            units.update({front + name: column.unit for name, column in columns.items()})
        with self._path.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays, units=np.array(json.dumps(units)))


class McapWriter:
    """One file: a channel of JSON messages for each table, with a JSON schema that contains the units."""

    def __init__(self, base: Path, files: Mapping[str, Path], tables: Tables) -> None:
        from mcap.writer import Writer as Mcap

        self._file = files[".mcap"].open("wb")
        self._mcap = Mcap(self._file)
        self._mcap.start(profile="", library=f"pvid {__version__}")
        self._channels, self._tables = {}, tables
        self._sequence = 0
        for table, columns in tables.items():
            described = schema(table, columns)
            number = self._mcap.register_schema(described["title"], "jsonschema", encoded(described))
            self._channels[table] = self._mcap.register_channel(topic(table), "json", number, metadata=units(columns))

    @staticmethod
    def suffixes(tables: Tables) -> list[str]:
        """Endings of what is written."""
        return [".mcap"]

    def write(self, rows: Rows) -> None:
        """See Writer."""
        for log_time, message in messages(rows, self._tables):
            self._mcap.add_message(
                self._channels[rows.table], log_time, encoded(message), publish_time=log_time, sequence=self._sequence
            )
            self._sequence = (self._sequence + 1) & 0xFFFFFFFF

    def close(self) -> None:
        """See Writer."""
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._file.close()


FORMATS: dict[str, type[Writer]] = {"csv": CsvWriter, "parquet": ParquetWriter, "mcap": McapWriter, "npz": NpzWriter}


def export_log(log: Path, form: str, base: Path, mechanism: LogMechanism) -> list[Path]:
    """Writes a log as one of FORMATS under the name `base` with the format's endings; returns what was written.

    `mechanism` of the rig: without its constants there are no outputs.

    Raises PvidError when the log cannot be read or a file cannot be written.
    """
    kind = FORMATS[form]
    names = names_of_log(log)
    values = Values(mechanism, hello_of_log(log), refined=() if names is None else names.refined)
    suffixes = kind.suffixes(values.tables)
    try:
        with ExitStack() as stack:
            files = {one: stack.enter_context(appearing(base.with_name(base.name + one))) for one in suffixes}
            writer = kind(base, files, values.tables)
            for record in LogReader(log):
                for rows in values.rows(record):
                    writer.write(rows)
            writer.close()
    except OSError as error:
        raise PvidError(f"cannot write {base}: {error.strerror}") from error
    return [base.with_name(base.name + suffix) for suffix in suffixes]
