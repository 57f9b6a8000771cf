#!/usr/bin/env python3
"""Static analysis of the firmware: gcc -fanalyzer, clang-tidy, cppcheck with its MISRA C:2012 add-on.

    tools/analyse.py            every finding, but for those that firmware/analysis.toml deviates from; exits 1 on one
    tools/analyse.py FILE...    of these sources alone; of a rule with a limit, the findings in lines not yet committed
    tools/analyse.py --quick    clang-tidy gives up a function after a third of its paths, which is three times as fast
    tools/analyse.py --update   writes the numbers of findings into firmware/analysis.toml, too

A deviation names a tool, a rule, a reason, and what it covers: files and a regular expression that the line of the
finding has to match. One that covers nothing any more is an error. So is one of a required rule with more findings than
its `most`, until a person has looked and run --update. build/analysis/deviations.md is the list with all counts.

A source is not read again while nothing that a tool reads has changed: cppcheck keeps its findings itself, those of the
others tools/kept.py keeps.

Ports are read as their processor's compilers read them, the applications as for this machine; Debian's avr-gcc is too
old to have -fanalyzer.
"""

import argparse
import fnmatch
import hashlib
import os
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from kept import kept, preprocessed, version
from units import FIRMWARE, PORTS, ROOT, Unit, applications, chosen, core, demand, ports, take_files

DEVIATIONS = ROOT / "firmware" / "analysis.toml"
FOLDERS = [FIRMWARE / name for name in ("src", "link", "ports", "apps")]
ASSERT = ["-include", "assert.h", "-DPVID_ASSERT(condition)=assert(condition)"]  # tells a tool what a caller owes
BUILD = ROOT / "build" / "analysis"
REPORT = BUILD / "deviations.md"
GCC = {  # by family: the compiler, and what it needs to be told of the processor
    "host": ("gcc",),
    "cortex_m": ("arm-none-eabi-gcc", "-mcpu=cortex-m4"),
    "riscv": ("riscv64-unknown-elf-gcc", "-march=rv32imac", "-mabi=ilp32"),
}
PLATFORMS = {"host": "unix64", "cortex_m": "unix32", "riscv": "unix32", "avr": "avr8"}  # cppcheck's

# cppcheck reads a source once for every set of macros that it or a header chooses by, which takes MISRA's rules half a
# second each. Headers choose alike for every source: all are read with the macros that they choose by themselves, and
# these, which include every header that chooses, once more with all macros.
WHOLE = ("publication.c", "values_q31.c", "weak_step_f32.c")
FEWER_PATHS = ("-Xclang", "-analyzer-config", "-Xclang", "max-nodes=75000")  # of 225000, of each function
UNUSED = ("2.3", "2.4", "2.5")  # MISRA's rules of what a program never uses: of some of the sources they say nothing
PACKAGES = {
    "gcc": "gcc",
    "arm-none-eabi-gcc": "gcc-arm-none-eabi",
    "riscv64-unknown-elf-gcc": "gcc-riscv64-unknown-elf",
    "clang": "clang",
    "clang-tidy": "clang-tidy",
    "cppcheck": "cppcheck",
}


@dataclass(frozen=True, order=True)
class Finding:
    """A tool's message about one line."""

    tool: str
    rule: str
    file: str  # from the top of the repository
    line: int
    text: str

    @property
    def is_new(self) -> bool:
        """In a line that the last commit does not have."""
        return self.source().strip() not in committed(self.file)

    def source(self) -> str:
        lines = (ROOT / self.file).read_text(encoding="utf-8").splitlines()
        return lines[self.line - 1] if 0 < self.line <= len(lines) else ""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.tool} {self.rule}: {self.text}\n    {self.source().strip()}"


@dataclass(frozen=True)
class Deviation:
    """Findings that stay, and why; the fields of analysis.toml."""

    tool: str
    rule: str
    reason: str
    category: str = "required"  # MISRA's: an advisory rule's findings are counted but not limited
    files: tuple[str, ...] = ("firmware/*",)
    line: str = ""  # a regular expression, searched in the finding's line
    most: int = 0  # findings of a required rule

    def covers(self, finding: Finding) -> bool:
        return (
            (self.tool, self.rule) == (finding.tool, finding.rule)
            and any(fnmatch.fnmatch(finding.file, pattern) for pattern in self.files)
            and re.search(self.line, finding.source()) is not None
        )

    def key(self) -> str:
        return " ".join(filter(None, (self.tool, self.rule, ", ".join(self.files), self.line and f"`{self.line}`")))


@cache
def committed(file: str) -> frozenset[str]:
    """The lines of a file in the last commit; none of a new file, and those that it has where there is no commit."""
    there = subprocess.run(["git", "show", f"HEAD:{file}"], cwd=ROOT, capture_output=True, text=True, check=False)
    if there.returncode and "not a git repository" in there.stderr:
        return frozenset(line.strip() for line in (ROOT / file).read_text(encoding="utf-8").splitlines())
    return frozenset(line.strip() for line in there.stdout.splitlines())


def units() -> list[Unit]:
    return core("host") + ports() + applications("host")


def run(command: list[str]) -> str:
    # cppcheck starts `python3` once a file: this one, not a wrapper that first looks for an interpreter
    own = {**os.environ, "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=own)
    return done.stdout + done.stderr


def located(tool: str, output: str, pattern: str) -> set[Finding]:
    """Finds with the groups file, line, rule and text of pattern; lines elsewhere (notes, system headers) are not."""
    found = set()
    for match in re.finditer(pattern, output, re.MULTILINE):
        path = (ROOT / match["file"]).resolve()
        if path.is_relative_to(FIRMWARE):
            at = str(path.relative_to(ROOT))
            found.add(Finding(tool, match["rule"], at, int(match["line"]), match["text"]))
    return found


def asserts(unit: Unit) -> list[str]:
    """Not for a port, which is read as it stands: the host's says itself what it asks of the C library."""
    return [] if PORTS in unit.source.parents else ASSERT


def gcc(unit: Unit) -> set[Finding]:
    if unit.machine not in GCC:
        return set()
    for_it = [*GCC[unit.machine], *unit.common, "-O2", "-fanalyzer", "-Wall", "-Wextra", *asserts(unit)]

    def made() -> str:
        output = run([*for_it, "-c", str(unit.source), "-o", "/dev/null"])
        if re.search(r"(?<!\w)error:", output):
            raise SystemExit(f"gcc does not compile {unit.name}:\n{output}")
        return output

    output = kept([version(for_it[0], "--version"), *for_it, preprocessed(for_it, unit.source)], made) or ""
    return located(
        "gcc", output, r"^(?P<file>[^\s:]+):(?P<line>\d+):\d+: warning: (?P<text>.*) \[(?P<rule>-W[^\]]+)\]$"
    )


def clang_tidy(unit: Unit, quick: bool) -> set[Finding]:
    options = [*unit.options, *asserts(unit), *(FEWER_PATHS if quick else ())]

    def made() -> str:
        output = run(["clang-tidy", "--quiet", str(unit.source), "--", *options])
        if re.search(r"(?<!\w)error:", output):
            raise SystemExit(f"clang-tidy does not read {unit.name}:\n{output}")
        return output

    checks = (ROOT / ".clang-tidy").read_text(encoding="utf-8")
    source = preprocessed(["clang", *options], unit.source)
    output = kept([version("clang-tidy", "--version"), checks, *options, source], made) or ""
    return located(
        "clang-tidy", output, r"^(?P<file>/[^:]+):(?P<line>\d+):\d+: warning: (?P<text>.*) \[(?P<rule>[^\]]+)\]$"
    )


def cppcheck(alike: list[Unit], whole: bool = False) -> set[Finding]:
    """Of sources with the same options; whole: with the macros that headers choose by, too.

    MISRA's rules have the tool's name "misra": their texts are not free, so that a number is all there is.
    """
    first = alike[0]
    options = [option for option in first.common if option.startswith(("-I", "-D"))]
    # cppcheck keeps a file's findings while its preprocessed text stays; lines of comments in headers are not in it.
    headers = "\n".join(path.read_text(encoding="utf-8") for path in sorted(FIRMWARE.rglob("*.h")))
    folder = BUILD / hashlib.sha256("\n".join([first.machine, *options, str(whole), headers]).encode()).hexdigest()[:8]
    folder.mkdir(parents=True, exist_ok=True)
    checks = [
        "--std=c99",
        "--enable=warning,style,performance,portability",
        "--inline-suppr",
        "--addon=misra",
        "--quiet",
        f"--platform={PLATFORMS[first.machine]}",
        f"-j{os.cpu_count() or 1}",
    ]
    checks += ["-UPVID_CONFIG_HEADER"]  # the name of a user's header; cppcheck would invent a value for it
    if not whole and not any(option.startswith("-D") for option in options):  # with definitions it reads once anyhow
        checks += ["--force", f"--config-exclude={FIRMWARE}/"]
    checks += [f"--cppcheck-build-dir={folder}"]
    template = "--template={file}:{line}:{id}:{message}"
    output = run(["cppcheck", *checks, template, *options, *(str(unit.source) for unit in alike)])
    found = located("cppcheck", output, r"^(?P<file>/[^:]+):(?P<line>\d+):(?P<rule>[\w.-]+):(?P<text>.*)$")
    prefix = "misra-c2012-"
    return {
        Finding("misra", f.rule.removeprefix(prefix), f.file, f.line, "see the rule")
        if f.rule.startswith(prefix)
        else f
        for f in found
    }


def with_all_macros(alike: list[Unit]) -> set[Finding]:
    """Of those of WHOLE among sources with the same options."""
    these = [unit for unit in alike if unit.source.name in WHOLE]
    found = cppcheck(these, whole=True) if these else set()
    return {one for one in found if one.rule not in UNUSED}


def all_findings(among: list[Unit], quick: bool) -> list[Finding]:
    groups: dict[tuple[str, ...], list[Unit]] = defaultdict(list)
    for unit in among:
        groups[unit.options].append(unit)
    with ThreadPoolExecutor(2) as pool:
        jobs = [pool.submit(cppcheck, alike) for alike in sorted(groups.values(), key=len, reverse=True)]
        jobs += [pool.submit(with_all_macros, alike) for alike in groups.values()]
        jobs += [pool.submit(clang_tidy, unit, quick) for unit in among]
        jobs += [pool.submit(gcc, unit) for unit in among]
        return sorted(set().union(*(job.result() for job in jobs)))


def deviations() -> list[Deviation]:
    with DEVIATIONS.open("rb") as file:
        entries = tomllib.load(file)["deviation"]
    return [Deviation(**{**entry, "files": tuple(entry.get("files", ["firmware/*"]))}) for entry in entries]


def row_of(deviation: Deviation, count: int) -> str:
    where = (
        ""
        if deviation.files == ("firmware/*",)
        else ", ".join(name.removeprefix("firmware/") for name in deviation.files)
    )
    line = f"`{deviation.line}`".replace("|", "\\|") if deviation.line else ""
    scope = " ".join(filter(None, (where, line))) or "everywhere"
    reason = " ".join(deviation.reason.split())
    kind = f" ({deviation.category})" if deviation.tool == "misra" else ""
    return f"| {deviation.tool} {deviation.rule}{kind} | {count} | {scope} | {reason} |"


def with_counts(text: str, counts: list[int | None]) -> str:
    """analysis.toml with `most` of each deviation set to its count; None: without one."""
    head, *blocks = text.split("[[deviation]]\n")
    for number, (block, count) in enumerate(zip(blocks, counts, strict=True)):
        block = re.sub(r"(?m)^most = \d+\n", "", block)
        if count is not None:
            block = re.sub(r"(?m)^(rule = .*\n)", rf"\g<1>most = {count}\n", block, count=1)
        blocks[number] = block
    return "[[deviation]]\n".join([head, *blocks])


def report_of(used: list[tuple[Deviation, int]]) -> str:
    order = sorted(used, key=lambda pair: (pair[0].tool != "misra", pair[0].tool, natural(pair[0].rule)))
    in_place = run(["grep", "-rnE", "MISRA deviation|cppcheck-suppress|NOLINT", *map(str, FOLDERS)]).splitlines()
    in_place = [line.replace(f"{ROOT}/", "") for line in in_place]
    places = "".join(
        f"- `{where.rsplit(':', 1)[0]}`\n" for where in (":".join(line.split(":", 2)[:2]) + ":" for line in in_place)
    )
    required = sum(count for entry, count in used if entry.tool == "misra" and entry.category == "required")
    advisory = sum(count for entry, count in used if entry.tool == "misra" and entry.category == "advisory")
    head = f"""# Static analysis: what is deviated from, and why

`tools/analyse.py`, a layer of `./tools/test`, runs gcc's -fanalyzer, clang-tidy (the checks of `.clang-tidy`) and
cppcheck with its MISRA C:2012 add-on over the core, the link, the ports and the applications of `firmware`. Whatever is
found fails the test, but for the deviations below. A number in the second column cannot grow unnoticed where
the rule is required. cppcheck's add-on checks most of the decidable rules; this is no claim of compliance.

{required} findings of MISRA's required rules and {advisory} of its advisory ones stay:

| rule | findings | where | why it stays |
|---|---:|---|---|
"""
    rows = "\n".join(row_of(deviation, count) for deviation, count in order)
    return f"{head}{rows}\n\nMarked in place:\n\n{places}"


def natural(rule: str) -> tuple[float, float, str]:
    match = re.fullmatch(r"(\d+)\.(\d+)", rule)
    return (float(match[1]), float(match[2]), "") if match else (0.0, 0.0, rule)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--update", action="store_true", help="write the numbers of findings into firmware/analysis.toml"
    )
    parser.add_argument("--quick", action="store_true", help="clang-tidy follows a third of the paths of a function")
    take_files(parser)
    given = parser.parse_args()
    update, files = given.update, set(given.files)
    if update and files:
        parser.error("--update is for all of them")
    among = chosen(units(), files, parser)
    demand(PACKAGES)

    findings = [one for one in all_findings(among, given.quick) if not files or one.rule not in UNUSED]
    known = deviations()
    faults = [str(finding) for finding in findings if not any(entry.covers(finding) for entry in known)]
    counted = [(entry, sum(entry.covers(finding) for finding in findings)) for entry in known]
    faults += [
        f"{DEVIATIONS.name}: {entry.key()} covers nothing; take it out"
        for entry, count in counted
        if count == 0 and (not files or set(entry.files) <= files)
    ]
    if update:
        counts = [None if entry.category == "advisory" else count for entry, count in counted]
        DEVIATIONS.write_text(with_counts(DEVIATIONS.read_text(encoding="utf-8"), counts), encoding="utf-8")
    for entry, count in counted:
        covered_now = [finding for finding in findings if entry.covers(finding)]
        new = [finding for finding in covered_now if finding.is_new]
        if not update and entry.category != "advisory" and (count > entry.most or (files and new)):
            found = "\n".join(f"  {finding}" for finding in new or covered_now)
            says = f"{DEVIATIONS.name} says {entry.most}; fix it, or look and --update"
            what = f"{count} findings" if count > entry.most else f"{len(new)} in lines that are not committed"
            faults.append(f"{entry.key()}: {what}, {says}\n{found}")
    if not files:
        REPORT.write_text(report_of(counted), encoding="utf-8")
    print("\n".join(faults))
    covered = sum(count for _, count in counted)
    print(
        f"Found {len(faults)} faults"
        if faults
        else f"All checks passed! {covered} findings deviated from, see {DEVIATIONS.name}"
    )
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
