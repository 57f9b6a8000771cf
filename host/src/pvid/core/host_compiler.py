"""The C compiler of this computer, for code that is made while the program runs."""

from __future__ import annotations

import os
import shutil

from pvid.base.errors import PvidError


def host_compiler(what: str) -> str:
    """Path of the one that CC names, else of cc, gcc or clang.

    Parameters
    ----------
    what : needs it, for the message

    Raises
    ------
    PvidError
        When there is none.
    """
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        found = shutil.which(name) if name else None
        if found:
            return found
    raise PvidError(f"{what} needs a C compiler (cc, gcc or clang, or the one that CC names), and there is none")
