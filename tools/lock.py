#!/usr/bin/env python3
"""Writes tools/requirements.txt anew from host/pyproject.toml: run it after a change there, and for newer versions.

First uv, which installs the others, then what they are built with where there is no wheel, then every package that
tools/pvid installs, then what it adds for parquet, mcap and campaigns, then what tools/test adds: each with its version
and the hashes of its files, for Linux on any processor and Python 3.11 and later. Run it by the Python of build/venv.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = ROOT / "host" / "pyproject.toml"
LOCK = ROOT / "tools" / "requirements.txt"
# Lines between which tools/bootstrap.sh takes what it installs at a time.
BUILD, USE, MORE, TESTS = (
    "# to build with",
    "# to use pvid",
    "# for parquet, mcap and campaigns",
    "# for the tests alone",
)
USED_EXTRAS = ["models", "page", "plot", "serial"]
MORE_EXTRAS = ["cluster", "excel", "foxglove", "hdf5", "mcap", "parquet", "robot", "ros"]
INSTALLER, BUILDERS = "uv", ("setuptools",)
_WINDOWS = re.compile(r"os_name == 'nt'|sys_platform == 'win32'")
HEADER = "# Written by tools/lock.py from host/pyproject.toml: do not edit.\n"


def compiled(extras: list[str], *options: str) -> str:
    """What uv resolves for pvid with these extras and the backend that installs it."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--universal", "--no-header"]
    command += ["--python-version", "3.11"]
    command += ["--no-annotate", "--no-emit-index-url", "--no-emit-find-links"]
    command += ["--fork-strategy", "fewest", *options]
    command += [f"--extra={extra}" for extra in extras]
    return subprocess.run(
        [*command, str(PROJECT), "-"],
        input="\n".join((INSTALLER, *BUILDERS)),
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def pinned(block: str) -> str:
    """name==version, without marker and hashes."""
    return block.split()[0]


def main() -> None:
    everything = compiled([*USED_EXTRAS, *MORE_EXTRAS, "test"], "--generate-hashes", "--upgrade")
    blocks = [one for one in re.findall(r"(?m)^\S.*(?:\n .*)*\n", everything) if not _WINDOWS.search(one)]
    fixed = LOCK.with_suffix(".new")
    fixed.write_text(everything, encoding="utf-8")
    try:
        first, second = (
            set(map(pinned, compiled(extras, "--constraint", str(fixed)).splitlines()))
            for extras in (USED_EXTRAS, [*USED_EXTRAS, *MORE_EXTRAS])
        )
    finally:
        fixed.unlink()
    installer = [block for block in blocks if block.startswith(f"{INSTALLER}==")]
    builders = [block for block in blocks if block.startswith(tuple(f"{one}==" for one in BUILDERS))]
    rest = [block for block in blocks if block not in (*installer, *builders)]
    used = [block for block in rest if pinned(block) in first]
    more = [block for block in rest if pinned(block) in second - first]
    tests = [block for block in rest if pinned(block) not in second]
    parts = [HEADER, *installer, f"{BUILD}\n", *builders, f"{USE}\n", *used, f"{MORE}\n", *more, f"{TESTS}\n", *tests]
    LOCK.write_text("".join(parts), encoding="utf-8")
    counts = (
        f"{len(builders)} + {len(used)} packages, {len(more)} for parquet, mcap and campaigns, {len(tests)} for tests"
    )
    print(f"{LOCK.relative_to(ROOT)}: {counts}")


main()
