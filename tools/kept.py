"""What a tool reported of a source, kept in build/cache/checks by all that it read: the tool's version, its options and
the preprocessed source with its comments. A source of which nothing of that has changed is not read again.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

_PLACE = Path(__file__).resolve().parents[1] / "build" / "cache" / "checks"


@cache
def version(*command: str) -> str:
    """What a tool prints of its version."""
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def preprocessed(compiler: Sequence[str], source: Path) -> str | None:
    """A source with its comments and macros by compiler and options; None where it is refused."""
    command = [*compiler, "-E", "-C", "-dD", str(source)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    return done.stdout if done.returncode == 0 else None


def kept(read: Sequence[str | None], make: Callable[[], str | None]) -> str | None:
    """make(), or what it returned when the same was read; None, or of a source that is refused, is not kept."""
    if None in read:
        return make()
    place = _PLACE / hashlib.sha256("\0".join(map(str, read)).encode()).hexdigest()
    if place.exists():
        return place.read_text(encoding="utf-8")
    made = make()
    if made is not None:
        _PLACE.mkdir(parents=True, exist_ok=True)
        fresh = place.with_name(f"{place.name}.{os.getpid()}")
        fresh.write_text(made, encoding="utf-8")
        fresh.replace(place)
    return made
