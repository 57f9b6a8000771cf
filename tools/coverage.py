#!/usr/bin/env python3
"""Branch coverage of the C core and the link by the quick tests: the CMocka programs, what tests/configurations.py asks
of the shared library, and what compiles the core with the generated C of mechanisms: the tests of MECHANISMS and
tests/playback_weak.py.

    build/venv/bin/python tools/coverage.py

Prints a table by file and the missed branches with their reasons of tests/coverage.toml, and writes the latter to
build/coverage.md. Five minutes of one core. Exits 1 below 95 % of the branches. PVID_ASSERT is compiled out: its other
branch is misuse, and ends the program.
"""

from __future__ import annotations

import itertools
import json
import os
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import playback_weak  # noqa: E402 - of tests

from pvid.core import sources  # noqa: E402
from pvid.settings.bounds import SIZES  # noqa: E402

BUILD = ROOT / "build" / "coverage"
REPORT = ROOT / "build" / "coverage.md"
REASONS = ROOT / "tests" / "coverage.toml"
FIRMWARE = ROOT / "firmware"
COUNTED_FOLDERS = tuple(f"{FIRMWARE / name}{os.sep}" for name in ("src", "link"))
INCLUDES = [*sources.INCLUDES, f"-I{FIRMWARE / 'link'}"]
# the counts of one process: nothing else runs while it does
FLAGS = ["-std=c99", "-O0", "-ffp-contract=off", "-fPIC", "-w", *INCLUDES]
# a function that is inlined even so would count once for each of its callers
COUNTED = ("--coverage", "-Dalways_inline=unused", "-DPVID_ASSERT(condition)=((void)0)")
NATIVE = [*FLAGS, *SIZES, '-DPVID_NATIVE_BUILD="coverage"']
WANTED = 95.0
PYTHONPATH = os.pathsep.join(str(ROOT / folder) for folder in ("host/src", "tests"))
PLAY = "import configurations; from pvid.core.native import Native; configurations.digest(Native())"
PLAY_WEAK = "import playback_weak; [list(one.digests(one.library)) for one in playback_weak.subjects()]"
# The weak form in float32 and fixed point, and the refinement: every shipped mechanism, hostile samples, snapshots.
MECHANISMS = (
    *(f"tests/twin/test_{name}.py" for name in ("weak_f32", "weak_q31", "second_stage", "refinement")),
    *(f"tests/core/test_{name}_q31.py" for name in ("weak_snapshot", "weak_rows", "trust")),
    *(f"tests/twin/test_{name}.py" for name in ("kinds", "kinds_q31", "estimator_q31")),
    *(f"tests/core/test_{name}.py" for name in ("bad_config", "dead_zone", "renewal", "snapshot_weak")),
    "tests/core/test_weak_valid_q31.py",
    "tests/codegen/test_fitted_sizes.py",  # builds for one design
)
# A compiler that counts branches, but not those of a sanitizer; each call has a folder of its own, since objects of
# several builds have one name.
COUNTING = """#!/bin/sh
for one; do
    [ "$one" != -E ] || exec "{gcc}" "$@"
done
for one; do
    shift
    case $one in
    -fsanitize*) ;;
    *) set -- "$@" "$one" ;;
    esac
done
exec "{gcc}" "$@" -O0 {options} -dumpdir "$(mktemp -d "{folder}/XXXXXXXX")/"
"""
# What tests compile and keep, under build/.
KEPT = ("matrix", "cache/models", "cache/plants")
ASIDE = ROOT / "build" / "aside"


@dataclass(frozen=True)
class File:
    """Branches of a file: how many, how many were taken, and the lines of those that were not."""

    name: str
    branches: int
    taken: int
    missed: dict[int, int]


def run(*command: str | Path, **environment: str) -> str:
    """Runs a command from the top; what it says is told where it fails."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise SystemExit(f"{command[0]}: {done.stdout}{done.stderr}")
    return done.stdout


def build() -> list[Path]:
    """The core with counters, as the CMocka programs and the shared library have it; returns the programs."""
    shutil.rmtree(BUILD, ignore_errors=True)
    core = [*sources.core_sources(), FIRMWARE / "link" / "link.c"]
    tests = playback_weak.unit_tests()
    plain = sorted((ROOT / "host" / "native").glob("[lr]*.c"))
    jobs = [(BUILD / "unit" / f"{path.stem}.o", path, [*FLAGS, *COUNTED]) for path in core]
    jobs += [(BUILD / "native" / f"{path.stem}.o", path, [*NATIVE, *COUNTED]) for path in core]
    jobs += [(BUILD / "native" / f"{path.stem}.o", path, NATIVE) for path in plain]
    # a test has the core's inline functions in it
    jobs += [(BUILD / "tests" / f"{path.stem}.o", path, [*FLAGS, *COUNTED]) for path in tests]
    for name in ("unit", "native", "tests"):
        (BUILD / name).mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda job: run("gcc", *job[2], "-c", job[1], "-o", job[0]), jobs))
    library = BUILD / "libnative.so"
    run("gcc", "--coverage", "-shared", "-o", library, *sorted((BUILD / "native").glob("*.o")), "-lm")
    programs = [BUILD / test.stem for test in tests]
    for program in programs:
        of_it = BUILD / "tests" / f"{program.name}.o"
        run("gcc", "--coverage", "-o", program, of_it, *sorted((BUILD / "unit").glob("*.o")), "-lcmocka", "-lm")
    return programs


def put_back() -> None:
    """Builds that were set aside replace those of the counting compiler, also of a run that was ended."""
    for place in KEPT:
        if (ASIDE / place).exists():
            shutil.rmtree(ROOT / "build" / place, ignore_errors=True)
            (ASIDE / place).rename(ROOT / "build" / place)


@contextmanager
def set_aside() -> Iterator[None]:
    """Without the builds of other tests, which would not count, and whose places those that count must not keep."""
    put_back()
    for place in KEPT:
        own = ROOT / "build" / place
        own.mkdir(parents=True, exist_ok=True)
        (ASIDE / place).parent.mkdir(parents=True, exist_ok=True)
        own.rename(ASIDE / place)
    try:
        yield
    finally:
        put_back()


def play_mechanisms() -> None:
    """Runs the tests of mechanisms, and plays their identifiers, with a compiler that counts."""
    tools, counts = BUILD / "bin", BUILD / "counts"
    for folder in (tools, counts):
        folder.mkdir()
    for name in ("gcc", "cc"):
        text = COUNTING.format(gcc=shutil.which(name), options=shlex.join(COUNTED), folder=counts)
        (tools / name).write_text(text, encoding="utf-8")
        (tools / name).chmod(0o755)
    options = ("-c", "host/pyproject.toml", "--rootdir=.", "-q")
    path = os.pathsep.join((str(tools), os.environ["PATH"]))
    given = {"PATH": path, "CC": str(tools / "gcc"), "CCACHE_DISABLE": "1"}
    with set_aside():
        run(sys.executable, "-P", "-m", "pytest", *options, *MECHANISMS, **given)
        run(sys.executable, "-c", PLAY_WEAK, PYTHONPATH=PYTHONPATH, **given)


def counts_of(counters: Path) -> Iterator[tuple[str, int, list[int]]]:
    """File of the core, line and how often each of its branches was taken, of the counters of one object."""
    told = subprocess.run(
        ["gcov", "--branch-probabilities", "--branch-counts", "--json-format", "--stdout", counters.name],
        cwd=counters.parent,
        capture_output=True,
        check=True,
    )
    of_object: dict[str, Any] = json.loads(told.stdout)
    for one in of_object["files"]:
        path = os.path.normpath(os.path.join(of_object["current_working_directory"], one["file"]))
        if path.startswith(COUNTED_FOLDERS):
            for line in one["lines"]:
                yield os.path.relpath(path, ROOT), line["line_number"], [x["count"] for x in line["branches"]]


def measured() -> list[File]:
    """What the counters of all runs say: a branch is the n-th of its line in every build."""
    taken: dict[str, dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
    with ThreadPoolExecutor(2) as pool:
        for found in pool.map(lambda path: list(counts_of(path)), sorted(BUILD.rglob("*.gcda"))):
            for name, line, counts in found:
                before = taken[name][line]
                pairs = itertools.zip_longest(before, counts, fillvalue=0)
                taken[name][line] = [mine + other for mine, other in pairs]
    files = []
    for name, lines in sorted(taken.items()):
        missed = {line: counts.count(0) for line, counts in lines.items() if 0 in counts}
        branches = sum(map(len, lines.values()))
        files.append(File(name, branches, branches - sum(missed.values()), missed))
    return files


def share(files: list[File]) -> float:
    """Per cent of the branches."""
    return 100.0 * sum(file.taken for file in files) / max(sum(file.branches for file in files), 1)


def explained(files: list[File]) -> list[tuple[str, str, int, str]]:
    """Place, line, number and reason of every branch that was missed."""
    with REASONS.open("rb") as file:
        reasons = tomllib.load(file).get("branch", [])
    rows = []
    for one in files:
        source = (ROOT / one.name).read_text(encoding="utf-8").splitlines()
        for number, times in sorted(one.missed.items()):
            line = source[number - 1].strip()
            of_it = [entry["why"] for entry in reasons if one.name.endswith(entry["file"]) and entry["line"] in line]
            rows.append((f"{one.name}:{number}", line, times, of_it[0] if of_it else "unexplained"))
    return rows


def report_of(files: list[File]) -> str:
    """The missed branches as a table."""
    rows = [f"| {place} | `{line}` | {times} | {why} |" for place, line, times, why in explained(files)]
    missed = "\n".join(row.replace("||", "\\|\\|") for row in rows)
    taken, branches = sum(file.taken for file in files), sum(file.branches for file in files)
    return f"""# Branch coverage

{taken} of the {branches} branches of `firmware/src` and `firmware/link` ({share(files):.1f} %)
are taken by the CMocka programs, by what `tests/configurations.py` and `tests/playback_weak.py` play, and by
{len(MECHANISMS)} files of tests that compile the core with a mechanism, as gcov counts them at -O0: every operand of
a `&&` or `||` has two. Other tests do not count. PVID_ASSERT, which ends the program,
was compiled out. Missed:

| where | line | branches | why |
|---|---|---:|---|
{missed}
"""


def main() -> int:
    for program in build():
        run(program)
    run(sys.executable, "-c", PLAY, PYTHONPATH=PYTHONPATH, PVID_NATIVE_LIBRARY=str(BUILD / "libnative.so"))
    play_mechanisms()
    files = measured()
    print("| file | branches taken | of |\n|---|---:|---:|")
    for file in files:
        print(f"| {file.name} | {file.taken} | {file.branches} |")
    for place, line, times, why in explained(files):
        print(f"{place} ({times}): {line} - {why}")
    REPORT.write_text(report_of(files), encoding="utf-8")
    taken, branches = sum(file.taken for file in files), sum(file.branches for file in files)
    print(f"{taken} of {branches} branches: {share(files):.1f} %; {REPORT.relative_to(ROOT)}")
    return 0 if share(files) >= WANTED else 1


if __name__ == "__main__":
    sys.exit(main())
