"""Workbooks of spreadsheets (.xlsx): the table is found as in a text file."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.packages import lacking
from pvid.base.wording import listed, reason, shown
from pvid.rig.columns import Columns
from pvid.rig.csv_table import text_table
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table

_BLOCK_ROWS = 1 << 14
_WHITE = str.maketrans("\t\r\n", "   ")


def read_excel(path: Path, columns: Columns) -> Table:
    """Reads the first sheet that has the columns.

    Raises PvidError for whatever is wrong with the file, in its first sheet where none has the columns.
    """
    try:
        import openpyxl
    except ImportError as error:
        raise lacking(f"{path}: a workbook", "openpyxl") from error
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    except Exception as error:  # zipfile, XML parsers and openpyxl raise many kinds on damaged files
        raise PvidError(f"{path} is not a readable workbook: {reason(error)}.") from error
    try:
        first: PvidError | None = None
        for sheet in book.worksheets:
            try:
                refuse_beyond(path, sheet.max_row or 0)
                table = text_table(path, columns, lambda sheet=sheet: _blocks(sheet), "row")  # type: ignore[misc]
            except PvidError as error:
                first = first or error
                continue
            if first is None:
                return table
            note = (
                f"the table is in sheet {shown(sheet.title)} of {listed(shown(one.title) for one in book.worksheets)}"
            )
            return Table(path, table.t, table.signals, table.columns, table.place, (note, *table.notes))
        raise first or PvidError(f"{path} has no sheet.")
    finally:
        book.close()


def _blocks(sheet: Any) -> Iterator[bytes]:
    lines = []
    for row in sheet.iter_rows(values_only=True):
        lines.append("\t".join(map(_text, row)))
        if len(lines) == _BLOCK_ROWS:
            yield ("\n".join(lines) + "\n").encode()
            lines = []
    if lines:
        yield ("\n".join(lines) + "\n").encode()


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, int | float):
        return repr(cell)
    if isinstance(cell, datetime.datetime | datetime.time):
        return cell.isoformat(timespec="microseconds")
    if isinstance(cell, datetime.timedelta):
        return repr(cell.total_seconds())
    return str(cell).translate(_WHITE).replace('"', "'")
