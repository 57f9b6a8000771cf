"""A report of an error of pvid's own: what somebody needs to find it, and no secret of the command line."""

from __future__ import annotations

import os
import platform
import re
import tempfile
import traceback
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from pvid.base.user_cache import user_cache
from pvid.base.version import __version__

_SECRET = re.compile(r"pass(word|wd|phrase)?|secret|token|credential|api[-_]?key|auth", re.IGNORECASE)
_LOGIN = re.compile(r"(?<=://)[^/@\s]+@")
_PACKAGES = ("numpy", "scipy", "sympy", "click")


def without_secrets(arguments: Sequence[str]) -> list[str]:
    """Arguments of a command with "..." in place of passwords, tokens and logins of addresses."""
    out: list[str] = []
    hidden = False
    for one in arguments:
        name, equals, _ = one.partition("=")
        if hidden:
            out.append("...")
        else:
            out.append(f"{name}=..." if equals and _SECRET.search(name) else _LOGIN.sub("...@", one))
        hidden = one.startswith("-") and not equals and bool(_SECRET.search(one))
    return out


def written(error: BaseException, arguments: Sequence[str]) -> Path | None:
    """The file of a report, in the cache of the user or a temporary folder; None where no file can be written.

    Parameters
    ----------
    arguments : of the command line
    """
    text = "\n".join(
        [
            f"pvid {__version__}",
            f"arguments: {without_secrets(arguments)}",
            f"platform: {platform.platform()}, Python {platform.python_version()}",
            f"packages: {', '.join(f'{name} {_version(name)}' for name in _PACKAGES)}",
            "",
            "".join(traceback.format_exception(error)),
        ]
    )
    for folder in (user_cache(), Path(tempfile.gettempdir())):
        if folder is None:
            continue
        try:
            folder.mkdir(parents=True, exist_ok=True)
            descriptor, name = tempfile.mkstemp(".txt", "pvid-error-", folder)
            with os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace") as file:
                file.write(text)
        except OSError:
            continue
        return Path(name)
    return None


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
