"""What a tool reported of a source, kept by all that it read: the tool's version, its options and the preprocessed
source with its comments. A source of which nothing of that has changed is not read again, in no clone of this user's:
the cache is in XDG_CACHE_HOME or ~/.cache, or in build/cache where nobody may write there. Paths of a clone are kept
from its top.
"""

import hashlib
import os
import subprocess
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from pvid.base.user_cache import user_cache

_ROOT = Path(__file__).resolve().parents[1]
_TOP = "<top of the clone>"
_PLACE = (user_cache() or _ROOT / "build" / "cache") / "checks"


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
    whole = "\0".join(map(str, read)).replace(str(_ROOT), _TOP)
    place = _PLACE / hashlib.sha256(whole.encode()).hexdigest()
    if place.exists():
        return place.read_text(encoding="utf-8").replace(_TOP, str(_ROOT))
    made = make()
    if made is not None:
        _PLACE.mkdir(parents=True, exist_ok=True)
        fresh = place.with_name(f"{place.name}.{os.getpid()}")
        fresh.write_text(made.replace(str(_ROOT), _TOP), encoding="utf-8")
        fresh.replace(place)
    return made
