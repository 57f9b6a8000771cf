"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import stat
from collections.abc import Iterator
from pathlib import Path

_NUMBERS = itertools.count()


@contextlib.contextmanager
def appearing(path: Path) -> Iterator[Path]:
    """A name beside `path` to write under: it becomes `path` if all goes well, and vanishes if not.

    A link stays and what it leads to is replaced; a device or a pipe is written to, since it cannot be replaced.

    Raises
    ------
    OSError
        When `path` is a folder, or nothing can be moved there.
    """
    kind = _kind(path)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if kind and not stat.S_ISREG(kind):
        yield path
        return
    place = Path(os.path.realpath(path))
    # Of a length of its own: a name that is as long as names may be has no room for more.
    temporary = place.with_name(f".{os.getpid()}-{next(_NUMBERS)}.tmp")
    try:
        yield temporary
        temporary.replace(place)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes a file, text in UTF-8, whole or not at all.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    with appearing(path) as temporary, temporary.open("wb") as file:
        file.write(data)
        file.flush()
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            os.fsync(file.fileno())


def _kind(path: Path) -> int:
    """The mode of what is there; 0: nothing."""
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        return 0
