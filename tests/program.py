"""The command as a user starts it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PVID = (sys.executable, "-P", "-m", "pvid")


def pvid(folder: Path, *arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs `pvid ARGUMENTS` in a folder, in this environment and what is given besides."""
    return subprocess.run(
        [*PVID, *map(str, arguments)],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
