#!/usr/bin/env python3
"""Branch coverage of the C core and the link by the quick tests: the CMocka programs, what tests/configurations.py asks
of the shared library, and what compiles the core with the generated C of mechanisms: the tests of MECHANISMS and
tests/playback_weak.py.

    build/venv/bin/python tools/coverage.py

Prints gcovr's table by file and the missed branches with their reasons of tests/coverage.toml; build/coverage/html has
the sources with all counts. Six minutes of one core. Exits 1 below 95 % of the branches. PVID_ASSERT is compiled out:
its other branch is misuse, and ends the program.
"""

import json
import os
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import playback_weak  # noqa: E402 - of tests

from pvid.core import sources  # noqa: E402
from pvid.settings.bounds import SIZES  # noqa: E402

BUILD = ROOT / "build" / "coverage"
REPORT = BUILD / "html" / "index.html"
REASONS = ROOT / "tests" / "coverage.toml"
FIRMWARE = ROOT / "firmware"
INCLUDES = [*sources.INCLUDES, f"-I{FIRMWARE / 'link'}", f"-I{ROOT / 'build'}"]
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
    *(f"tests/twin/test_{name}.py" for name in ("weak_f32", "weak_q31", "second_stage")),
    *(f"tests/core/test_{name}_q31.py" for name in ("weak_snapshot", "weak_rows", "trust")),
    *(f"tests/core/test_{name}.py" for name in ("kinds", "kinds_q31", "refinement")),
    *(f"tests/core/test_{name}.py" for name in ("bad_config", "dead_zone", "renewal", "snapshot_weak")),
    *(f"tests/core/test_{name}.py" for name in ("constraints", "drift", "rebase", "record")),
    *(f"tests/core/test_{name}.py" for name in ("core_q31", "dropped_calls", "equation_error", "standard_errors")),
    *(f"tests/{name}.py" for name in ("twin/test_commissioning", "deploy/test_commission", "codegen/test_robot_core")),
    "tests/board/test_block.py",  # samples in blocks
    "tests/codegen/test_fitted_sizes.py",  # builds for one design
    *(f"tests/codegen/test_strong_{name}.py" for name in ("model", "model_q31")),  # the printed strong form
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
    run(ROOT / "tools" / "pvid", "model", "build", "kapitza", "-o", ROOT / "build" / "pendulum")  # of the tests in C
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


def play_mechanisms() -> None:
    """Runs the tests of mechanisms, and plays their identifiers, with a compiler that counts; what it has compiled is
    kept under its own name (host_compiler.build_of)."""
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
    run(sys.executable, "-P", "-m", "pytest", *options, *MECHANISMS, **given)
    run(sys.executable, "-c", PLAY_WEAK, PYTHONPATH=PYTHONPATH, **given)


def report() -> dict[str, Any]:
    """What gcovr makes of the counters of all runs: prints a table by file, writes the sources with their branches."""
    counts = BUILD / "counts.json"
    REPORT.parent.mkdir()
    of_core = ("--root", ROOT, "--filter", "firmware/(src|link)/")
    # of generated sources, which are gone: the core's own functions in their objects count all the same
    gone = [f"--gcov-ignore-errors={error}" for error in ("no_working_dir_found", "source_not_found")]
    told = ("--merge-mode-functions=separate", "--json", counts, "--txt", "-", "--txt-metric=branch")
    print(run(sys.executable, "-m", "gcovr", "-j", "2", *of_core, *gone, *told, "--html-details", REPORT, BUILD))
    found: dict[str, Any] = json.loads(counts.read_text(encoding="utf-8"))
    return found


def explained(files: list[dict[str, Any]]) -> Iterator[str]:
    """Place, number, text and reason of every line that has missed branches."""
    reasons = tomllib.loads(REASONS.read_text(encoding="utf-8"))
    for file in files:
        name = file["file"]
        source = (ROOT / name).read_text(encoding="utf-8").splitlines()
        of_it = [one for end, lines in reasons.items() if name.endswith(end) for one in lines.items()]
        for line in file["lines"]:
            number, missed = line["line_number"], sum(one["count"] == 0 for one in line["branches"])
            text = source[number - 1].strip()
            if missed:
                why = next((why for part, why in of_it if part in text), "unexplained")
                yield f"{name}:{number} ({missed}): {text} - {why}"


def main() -> int:
    for program in build():
        run(program)
    run(sys.executable, "-c", PLAY, PYTHONPATH=PYTHONPATH, PVID_NATIVE_LIBRARY=str(BUILD / "libnative.so"))
    play_mechanisms()
    files = report()["files"]
    print("\n".join(explained(files)))
    counts = [branch["count"] for file in files for line in file["lines"] for branch in line["branches"]]
    taken = 100.0 * sum(count > 0 for count in counts) / len(counts)
    print(f"{taken:.1f} % of {len(counts)} branches; {REPORT.relative_to(ROOT)}")
    return 0 if taken >= WANTED else 1


if __name__ == "__main__":
    sys.exit(main())
