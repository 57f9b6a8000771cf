"""The command as a user starts it."""

import json
import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

PVID = (sys.executable, "-P", "-m", "pvid")
FORKS = Path(__file__).with_name("forks.py")


def pvid(folder: Path, *arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs `pvid ARGUMENTS` in a folder, in this environment and what is given besides; in a process of its own.

    That is a fork of one that has imported pvid and compiled one model, which takes as long as many a command.
    Where something is given besides, which may matter at an import, it is a new one.
    """
    words = [str(one) for one in arguments]
    if environment:
        return subprocess.run(
            [*PVID, *words],
            cwd=folder,
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
    forks = _forks(tuple(sorted(item for item in os.environ.items() if item[0] != "PYTEST_CURRENT_TEST")))
    assert forks.stdin is not None and forks.stdout is not None
    with tempfile.TemporaryDirectory() as place:
        printed = [Path(place) / name for name in ("stdout", "stderr")]
        forks.stdin.write(json.dumps([str(folder), words, *map(str, printed)]) + "\n")
        forks.stdin.flush()
        code = int(forks.stdout.readline())
        stdout, stderr = (path.read_text(encoding="utf-8") for path in printed)
    return subprocess.CompletedProcess(words, code, stdout, stderr)


@cache
def _forks(environment: tuple[tuple[str, str], ...]) -> subprocess.Popen[str]:
    """The process that the others are forks of, in this environment. It ends with this one, which closes its input."""
    command = [sys.executable, "-P", str(FORKS)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, env=dict(environment), stdin=pipe, stdout=pipe, text=True)
