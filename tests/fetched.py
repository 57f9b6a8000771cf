"""What tests fetch once, into build/fetched."""

import shutil
from collections.abc import Callable
from pathlib import Path

from filelock import FileLock

from pvid.core.sources import build_folder

PLACE = build_folder() / "fetched"


def once(name: str, make: Callable[[Path], None]) -> Path:
    """The folder of that name, made whole or not at all. It is renamed in the end: of an environment of Python
    bin/python works afterwards, and no other program of its bin."""
    made = PLACE / name
    PLACE.mkdir(parents=True, exist_ok=True)
    with FileLock(PLACE / f".{name}.lock"):
        if not made.exists():
            fresh = PLACE / f"{name}.new"
            shutil.rmtree(fresh, ignore_errors=True)
            fresh.mkdir()
            make(fresh)
            fresh.rename(made)
    return made
