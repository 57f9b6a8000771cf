"""Programs that this one starts: they end with it, however it ends, and Ctrl-C is for this one alone."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from typing import Any


def start(command: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """As Popen with these options. The program is killed when the thread that started it is gone (Linux, setpriv of
    util-linux; elsewhere it stays if this program is killed), and a terminal's Ctrl-C does not reach it."""
    tied = ["setpriv", "--pdeathsig", "KILL", "--"] if shutil.which("setpriv") else []
    return subprocess.Popen([*tied, *command], start_new_session=True, **options)
