"""Folders of the user's: where images are built if the clone belongs to somebody else, and what clones share."""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from pathlib import Path


def built_under(own: Path) -> Path:
    """`own` where this user may write what is built there, else a folder of the cache: XDG_CACHE_HOME, ~/.cache, or a
    private temporary one."""
    if _may_write(own / "targets"):
        return own
    return private_folder()


def private_folder() -> Path:
    """The folder of pvid in the user's cache, else a temporary one of the user's."""
    return user_cache() or _temporary()


def user_cache() -> Path | None:
    """The folder of pvid in XDG_CACHE_HOME or ~/.cache; None where this user may write to neither."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    caches = [*([Path(given)] if given.startswith("/") else []), _home() / ".cache"]
    return next((cache / "pvid" for cache in caches if _may_write(cache / "pvid")), None)


def _temporary() -> Path:
    place = Path(tempfile.gettempdir()) / f"pvid-{os.getuid()}"
    with contextlib.suppress(FileExistsError):
        place.mkdir(mode=0o700)
    found = place.lstat()
    private = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022
    return place if private else Path(tempfile.mkdtemp(prefix="pvid-"))


def _home() -> Path:
    try:
        return Path.home()
    except RuntimeError:  # a user without a name or a home
        return Path("/nonexistent")


def _may_write(folder: Path) -> bool:
    """Whether there is such a folder for this user, or may be."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return os.access(folder, os.W_OK | os.X_OK) and folder != folder.parent
