"""Which files pvid replaces: those that it wrote, as long as nobody has changed them.

A file is pvid's if its size and SHA-256 are in the list of what was written from this account (in the cache), or if it
has the banner of a generated file, a figure or a page, which also holds on other machines. Any other file is somebody's
work, and stays; so does what a link leads to. `replacing` (on the command line `--force`) lifts the rule.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import stat
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.base.user_cache import private_folder

CREATOR = "pvid"  # in the metadata of figures and pages
_BANNER = re.compile(
    rb"(?:Generated|Made) by `pvid "  # C, Python, CMake, pages
    rb'|<meta name="generator" content="pvid"'
    rb"|tEXtSoftware\0pvid"  # PNG
    rb"|<dc:title>pvid</dc:title>"  # SVG
    rb"|/Creator \(pvid\)"  # PDF
    rb'|"dc:creator": "pvid '  # CSV on the Web
    rb"|\x89MCAP0.{13,17}pvid ",
    re.DOTALL,
)
_ENDS = 1 << 12  # bytes at both ends of a file, among which its banner is
_LIST = "written"
_MOST = 1 << 20  # bytes of the list, some 20 000 files; then the older half is dropped
_forced: ContextVar[bool] = ContextVar("forced", default=False)


@contextlib.contextmanager
def replacing(everything: bool = True) -> Iterator[None]:
    """Inside, any file may be replaced."""
    token = _forced.set(everything or _forced.get())
    try:
        yield
    finally:
        _forced.reset(token)


def refuse_foreign(path: Path) -> None:
    """PvidError where `path` is a file that pvid did not write, or that was changed since, or a link to a file."""
    if _forced.get():
        return
    try:
        found = path.stat()
    except FileNotFoundError:
        found = None
    ordinary = found is None or stat.S_ISREG(found.st_mode)
    if ordinary and path.is_symlink() and path.parent != Path("/dev"):  # /dev/stdout is one
        raise PvidError(
            f"{path} is a link to {os.readlink(path)}: name that file, or write through the link by --force"
        )
    if found is not None and ordinary and found.st_size and not _is_own(path, found.st_size):
        raise PvidError(
            f"{path} is not replaced: pvid did not write it, or it was changed since; name another file, or add --force"
        )


def record(path: Path) -> None:
    """Takes a file into the list of what pvid wrote; without a list (a full disk) it counts as somebody's later."""
    with contextlib.suppress(OSError):
        place = private_folder() / _LIST
        place.parent.mkdir(parents=True, exist_ok=True)
        entry = _entry(path, path.stat().st_size).encode()
        with place.open("ab") as file:
            file.write(entry)
            full = file.tell() > _MOST
        if full:
            kept = place.read_bytes()[-_MOST // 2 :].partition(b"\n")[2]
            fresh = place.with_name(f"{_LIST}-{os.getpid()}")
            fresh.write_bytes(kept)
            fresh.replace(place)


def _is_own(path: Path, size: int) -> bool:
    with path.open("rb") as file:
        head = file.read(_ENDS)
        file.seek(max(0, size - _ENDS))
        if _BANNER.search(head) or _BANNER.search(file.read(_ENDS)):
            return True
    with contextlib.suppress(OSError):
        listed = (private_folder() / _LIST).read_text(encoding="ascii")
        return f"\n{size} " in f"\n{listed}" and _entry(path, size) in listed
    return False


def _entry(path: Path, size: int) -> str:
    with path.open("rb") as file:
        return f"{size} {hashlib.file_digest(file, 'sha256').hexdigest()[:32]}\n"
