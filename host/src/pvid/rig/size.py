"""Largest length of a run, by this machine's memory during identification."""

from __future__ import annotations

import contextlib
import importlib
import os
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError

resource: Any = None  # not on Windows
with contextlib.suppress(ImportError):
    resource = importlib.import_module("resource")

MOST_ROWS = 50_000_000  # 14 hours at 1 kHz
BYTES_A_ROW = 160  # of memory while a run is read and identified, measured: 140
_SHARE = 0.8  # of the memory


def most_rows() -> int:
    """Of a run that is read on this machine."""
    if resource is None:
        return MOST_ROWS
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft != resource.RLIM_INFINITY:
        memory = min(memory, soft)
    return min(MOST_ROWS, int(_SHARE * memory) // BYTES_A_ROW)


def refuse_beyond(path: Path, rows: int) -> None:
    """Refuses a file of more rows. Raises PvidError naming the limit."""
    most = most_rows()
    if rows > most:
        why = "no run is that long" if most == MOST_ROWS else "this machine has memory for no more"
        raise PvidError(f"{path} has more than {most} rows of data, and {why}: divide it, or record at a lower rate")
