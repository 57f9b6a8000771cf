#!/usr/bin/env python3
"""Writes tools/requirements.txt anew from host/pyproject.toml: run it after a change there, and for newer versions.

First what the others are built with where there is no wheel, then every package that tools/pvid installs, then those
that tools/test adds: each with its version and the hashes of its files, for Linux on any processor and Python 3.11 and
later. Needs uv (`pip install uv`).
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = ROOT / "host" / "pyproject.toml"
LOCK = ROOT / "tools" / "requirements.txt"
# Lines between which tools/bootstrap.sh takes what it installs at a time.
USE, TESTS = "# to use pvid", "# for the tests alone"
BUILDERS = ("flit-core", "setuptools")
_WINDOWS = re.compile(r"os_name == 'nt'|sys_platform == 'win32'")
HEADER = "# Written by tools/lock.py from host/pyproject.toml: do not edit.\n"


def compiled(extras: list[str], *options: str) -> str:
    """What uv resolves for pvid with these extras and the backend that installs it."""
    command = ["uv", "pip", "compile", "--quiet", "--universal", "--python-version", "3.11", "--no-header"]
    command += ["--no-annotate", "--no-emit-index-url", "--no-emit-find-links"]
    command += ["--fork-strategy", "fewest", *options]
    command += [f"--extra={extra}" for extra in extras]
    return subprocess.run(
        [*command, str(PROJECT), "-"], input="\n".join(BUILDERS), capture_output=True, text=True, check=True
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
    builders = [block for block in blocks if block.startswith(tuple(f"{one}==" for one in BUILDERS))]
    used = [block for block in blocks if pinned(block) in needed and block not in builders]
    tests = [block for block in blocks if block not in builders and block not in used]
    LOCK.write_text("".join([HEADER, *builders, f"{USE}\n", *used, f"{TESTS}\n", *tests]), encoding="utf-8")
    print(f"{LOCK.relative_to(ROOT)}: {len(builders)} + {len(used)} packages, {len(tests)} more for the tests")


main()
