#!/usr/bin/env python3
"""Writes tools/requirements.txt anew from host/pyproject.toml: run it after a change there, and for newer versions.

Every package that tools/pvid installs, then those that tools/test adds, each with one version for a Python and the
hashes of its files, for Linux on any processor and Python 3.11 and later. Needs uv (`pip install uv`).
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = ROOT / "host" / "pyproject.toml"
LOCK = ROOT / "tools" / "requirements.txt"
TESTS = "# for the tests alone"  # tools/bootstrap.sh reads up to this line where nothing is tested
_WINDOWS = re.compile(r"os_name == 'nt'|sys_platform == 'win32'")
HEADER = "# Written by tools/lock.py from host/pyproject.toml: do not edit.\n"


def compiled(extras: list[str], *options: str) -> str:
    """What uv resolves for pvid with these extras and the backend that installs it."""
    command = ["uv", "pip", "compile", "--quiet", "--universal", "--python-version", "3.11", "--no-header"]
    command += ["--no-annotate", "--no-emit-index-url", "--no-emit-find-links"]
    command += ["--fork-strategy", "fewest", *options]
    command += [f"--extra={extra}" for extra in extras]
    return subprocess.run(
        [*command, str(PROJECT), "-"], input="flit_core\n", capture_output=True, text=True, check=True
    ).stdout


def pinned(block: str) -> str:
    """name==version, without marker and hashes."""
    return block.split()[0]


def main() -> None:
    everything = compiled(["campaign", "web", "test"], "--generate-hashes", "--upgrade")
    blocks = [one for one in re.findall(r"(?m)^\S.*(?:\n .*)*\n", everything) if not _WINDOWS.search(one)]
    fixed = LOCK.with_suffix(".new")
    fixed.write_text(everything, encoding="utf-8")
    try:
        needed = set(map(pinned, compiled(["campaign", "web"], "--constraint", str(fixed)).splitlines()))
    finally:
        fixed.unlink()
    first = [block for block in blocks if pinned(block) in needed]
    rest = [block for block in blocks if block not in first]
    LOCK.write_text("".join([HEADER, *first, f"{TESTS}\n", *rest]), encoding="utf-8")
    print(f"{LOCK.relative_to(ROOT)}: {len(first)} packages, {len(rest)} more for the tests")


main()
