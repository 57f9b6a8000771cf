"""A package of `pvid deploy`, built as a user does."""

from __future__ import annotations

import subprocess
from pathlib import Path

STUBS = Path(__file__).with_name("stubs")


def run(*command: str | Path, cwd: Path | None = None) -> str:
    """Standard output of a command that must succeed."""
    done = subprocess.run([str(one) for one in command], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def built(source: Path, tree: Path, *options: str) -> Path:
    """Configures and builds a CMake project."""
    run("cmake", "-S", source, "-B", tree, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug", *options)
    run("ninja", "-C", tree)
    return tree
