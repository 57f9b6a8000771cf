"""A lock on a file that is being written: one writer at a time, and readers are free."""

from __future__ import annotations

import contextlib
import importlib
from pathlib import Path
from typing import Any

from pvid.base.errors import PvidError

fcntl: Any = None  # not on Windows, whose locks would keep readers out as well
with contextlib.suppress(ImportError):
    fcntl = importlib.import_module("fcntl")


def lock(descriptor: int, path: Path) -> None:
    """Keeps other writers of pvid out until the descriptor is closed, be it by the end of the process.

    Where the system or the file system has no such locks (Windows, some network folders), nothing is locked.

    Raises PvidError when another process writes the file.
    """
    if fcntl is None:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise PvidError(f"{path} is being recorded by another `pvid log`: record to another file") from error
    except OSError:  # not on this file system
        return
