"""Files that appear whole or not at all, and replace only what pvid wrote.

All that a command writes goes through here, but for logs, which replace nothing.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

from pvid.base.replacing import record, refuse_foreign
from pvid.base.wording import in_utf8

_NUMBERS = itertools.count()


@contextlib.contextmanager
def appearing(path: Path, *, freely: bool = False) -> Iterator[Path]:
    """A name beside `path` to write under: it becomes `path` if all goes well, and vanishes if not.

    A device or a pipe is written to, since it cannot be replaced.

    Raises OSError when `path` is a folder, or nothing can be moved there. Raises PvidError when it is a file that pvid
    did not write, or a link: see pvid.base.replacing.

    Parameters
    ----------
    freely : whether any file is replaced: one of a cache, or one that is changed between its markers
    """
    kind = _kind(path)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if kind and not stat.S_ISREG(kind):
        yield path
        return
    if not freely:
        refuse_foreign(path)
    place = Path(os.path.realpath(path))
    # Of a length of its own: a name that is as long as names may be has no room for more.
    temporary = place.with_name(f".{os.getpid()}-{next(_NUMBERS)}.tmp{place.suffix}")
    try:
        yield temporary
        if not freely:
            record(temporary)
        temporary.replace(place)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes, *, freely: bool = False) -> None:
    """Writes a file, text in UTF-8, whole or not at all; one that has this content already stays.

    Raises OSError when it cannot be written. Raises PvidError as `appearing`.
    """
    data = in_utf8(content).encode() if isinstance(content, str) else content
    if _has(path, data):
        return
    with appearing(path, freely=freely) as temporary, temporary.open("wb") as file:
        file.write(data)
        file.flush()
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            os.fsync(file.fileno())


def write_files(folder: Path, files: Mapping[str, str]) -> list[Path]:
    """Writes files of a folder, by their names in it, or none of them where one must not be replaced.

    Raises OSError, PvidError as write_whole.
    """
    paths = [folder / name for name in files]
    for path, text in zip(paths, files.values(), strict=True):
        if not _has(path, in_utf8(text).encode()):
            refuse_foreign(path)
    for path, text in zip(paths, files.values(), strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    return paths


def _has(path: Path, data: bytes) -> bool:
    """Whether a file of this content is there."""
    kind = _kind(path)
    return stat.S_ISREG(kind) and path.stat().st_size == len(data) and path.read_bytes() == data


def _kind(path: Path) -> int:
    """The mode of what is there; 0: nothing."""
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        return 0
