#!/usr/bin/env python3
"""Coverage of the C core and the link by the CMocka programs and the host tests that call the core.

    build/venv/bin/python tools/coverage.py                    builds, runs the tests, prints a table by file
    build/venv/bin/python tools/coverage.py --report --missed  the last run again, with the lines not done

Exits 1 below --at-least per cent of the branches. A test that fails or takes too long is named: what it would have
covered is then missing.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "coverage"
LONGEST = 600  # seconds a file of tests
TESTS = (
    "test_bad_config",
    "test_core_q31",
    "test_differentiation_q31",
    "test_estimator_q31",
    "test_link",
    "test_longevity",
    "test_physical_q31",
    "test_snapshot",
    "test_strong_bits_q31",
    "test_weak_bits",
    "test_weak_bits_q31",
)


def run(*command: str | Path, timeout: float | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(part) for part in command],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=timeout,
    )


def build() -> None:
    flags = "-O0 --coverage -fprofile-update=atomic"
    options = ["-DCMAKE_C_COMPILER=gcc", "-DCMAKE_BUILD_TYPE=None", f"-DCMAKE_C_FLAGS={flags}"]
    for done in (
        run("cmake", "-S", ROOT, "-B", BUILD, "-G", "Ninja", *options),
        run("ninja", "-C", BUILD),
    ):
        if done.returncode != 0:
            raise SystemExit(done.stdout + done.stderr)
    for path in BUILD.rglob("*.gcda"):
        path.unlink()


def run_tests() -> list[str]:
    """Runs them all; returns the names of those that did not pass."""
    failed = []
    if run("ctest", "--test-dir", BUILD, "-R", "^test_").returncode != 0:
        failed.append("the CMocka programs")
    library = str(BUILD / "host" / "native" / "libpvid_native.so")
    for test in TESTS:
        pytest = [sys.executable, "-P", "-m", "pytest", "-c", "host/pyproject.toml", "--rootdir=.", "-q"]
        try:
            done = run(*pytest, f"tests/host/{test}.py", timeout=LONGEST, PVID_NATIVE_LIBRARY=library)
        except subprocess.TimeoutExpired:
            failed.append(test)
            continue
        if done.returncode != 0:
            failed.append(test)
    return failed


def measured() -> dict[str, Any]:
    filters = ["--filter", "firmware/src", "--filter", "firmware/link", "--exclude-unreachable-branches"]
    done = run("gcovr", "-r", ".", "--object-directory", BUILD, *filters, "--json", BUILD / "coverage.json")
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    with (BUILD / "coverage.json").open(encoding="utf-8") as file:
        found: dict[str, Any] = json.load(file)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--report", action="store_true", help="run nothing: what the last run left")
    parser.add_argument("--missed", action="store_true", help="the lines with a branch that was never taken")
    parser.add_argument("--at-least", type=float, default=95.0, metavar="PERCENT")
    given = parser.parse_args()
    if shutil.which("gcovr") is None:
        raise SystemExit("missing: gcovr (Debian's name); ./tools/test installs it")
    failed = []
    if not given.report:
        build()
        failed = run_tests()
    all_taken = all_branches = 0
    print("| file | branches taken | of |\n|---|---:|---:|")
    for file in measured()["files"]:
        branches = [(line["line_number"], branch) for line in file["lines"] for branch in line["branches"]]
        taken = sum(branch["count"] > 0 for _, branch in branches)
        all_taken, all_branches = all_taken + taken, all_branches + len(branches)
        if taken < len(branches):
            print(f"| {file['file']} | {taken} | {len(branches)} |")
            source = (ROOT / file["file"]).read_text(encoding="utf-8").splitlines()
            missed = {number for number, branch in branches if branch["count"] == 0}
            for number in sorted(missed) if given.missed else ():
                print(f"    {number}: {source[number - 1].strip()}")
    share = 100.0 * all_taken / max(all_branches, 1)
    print(f"{all_taken} of {all_branches} branches taken: {share:.1f} %")
    for name in failed:
        print(f"did not pass: {name}")
    return 1 if failed or share < given.at_least else 0


if __name__ == "__main__":
    sys.exit(main())
