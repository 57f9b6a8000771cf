"""Fuzzers of the C code with sanitizers: libFuzzer on the link, random calls of the core's public API."""

from __future__ import annotations

import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from bench.case import Advance, Report, counts
from pvid.base.errors import PvidError
from pvid.core.sources import FIRMWARE, INCLUDES, PUBLIC_INCLUDES, ROOT, core_sources, source

LINK = FIRMWARE / "link"
FUZZ = ROOT / "tests" / "fuzz"
_COMPILER = ("clang", "-std=c99", "-g", "-O1", "-fno-sanitize-recover=all")


def fuzz_link(folder: Path, runs: int, seed: int = 1) -> int:
    """Builds tests/fuzz/fuzz_link.c in `folder` and runs it `runs` times; returns how many runs it reports.

    Raises PvidError when clang is missing, it does not build, or an input breaks the codec; the input is kept in
    `folder`.
    """
    binary = folder / "fuzz_link"
    sources = [LINK / "link.c", source("crc32.c"), FUZZ / "fuzz_link.c"]
    build = [*_COMPILER, "-fsanitize=fuzzer,address,undefined", f"-I{LINK}", *PUBLIC_INCLUDES]
    _run("the link", folder, [*build, *map(str, sources), "-o", str(binary)])
    limits = [f"-runs={runs}", f"-seed={seed}", "-max_len=1200", "-timeout=10", f"-artifact_prefix={folder}/"]
    limits += ["-rss_limit_mb=0", "-malloc_limit_mb=64"]  # a child's peak memory begins at that of its parent
    found = re.search(r"^Done (\d+) runs", _run("the link", folder, [str(binary), *limits]).stderr, re.MULTILINE)
    return int(found.group(1)) if found else 0


@dataclass(frozen=True)
class ApiCalls:
    """What tests/fuzz/fuzz_api.c did, none of it wrong."""

    calls: int  # of step
    inits: int
    accepted: int  # inits
    snapshots: int  # restores that were tried
    restored: int
    sound: int  # runs of garbage under sound settings
    published: int  # of those

    @property
    def counts(self) -> tuple[tuple[str, int], ...]:
        """What was tried and seen, by name."""
        return (
            ("calls of step", self.calls),
            ("calls of init", self.inits),
            ("of these accepted", self.accepted),
            ("restores of a snapshot", self.snapshots),
            ("restores accepted", self.restored),
            ("runs of garbage with valid settings", self.sound),
            ("of these with an estimate published", self.published),
        )


def fuzz_api(folder: Path, calls: int, seed: int = 1) -> ApiCalls:
    """Builds tests/fuzz/fuzz_api.c with the core in `folder` and lets it make so many calls.

    Raises PvidError when clang is missing, it does not build, a sanitizer reports something or what must hold does not.
    """
    binary = folder / "fuzz_api"
    ignored = f"-fsanitize-ignorelist={ROOT / 'tests' / 'sanitizers.ignore'}"
    sanitizers = ["-fsanitize=address,undefined,float-cast-overflow,integer", ignored, "-Wno-pass-failed"]
    build = [*_COMPILER, *sanitizers, *INCLUDES, f"-I{folder}"]
    pendulum = folder / "pendulum"
    _run("the core", folder, [str(ROOT / "tools" / "pvid"), "model", "build", "kapitza", "-o", str(pendulum)])
    sources = [FUZZ / "fuzz_api.c", FUZZ / "pendulum_q31.c", *pendulum.glob("kapitza_weak_*.c"), *core_sources()]
    _run("the core", folder, [*build, *map(str, sources), "-lm", "-o", str(binary)])
    done = _run("the core", folder, [str(binary), str(calls), str(seed)])
    figures = dict(re.findall(r"(\w+) (\d+)", done.stdout.splitlines()[0]))
    return ApiCalls(**{name: int(figures[name]) for name in ApiCalls.__dataclass_fields__})


def _run(what: str, folder: Path, command: list[str]) -> subprocess.CompletedProcess[str]:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise PvidError("clang is not installed: it comes with ./tools/test") from error
    if done.returncode != 0:
        said = (done.stdout + done.stderr).strip()
        raise PvidError(f"fuzzing {what} failed in {folder}: {said[-500:]}")
    return done


def link_report(runs: int, advance: Advance) -> Report:
    """See bench.case."""
    folder = Path(tempfile.mkdtemp(prefix="pvid-fuzz-"))  # an input that breaks the link stays there
    return Report([counts("fuzz-link", (("inputs", fuzz_link(folder, runs)), ("failures", 0)))])


def api_report(calls: int, seed: int, advance: Advance) -> Report:
    """See bench.case."""
    with tempfile.TemporaryDirectory(prefix="pvid-fuzz-") as folder:
        return Report([counts("fuzz-api", fuzz_api(Path(folder), calls, seed).counts)])
