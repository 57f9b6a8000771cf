#!/usr/bin/env python3
"""Every loop ends, and no function calls itself: shown by LLVM's scalar evolution and by the call graph.

    tools/loops.py            exits 1 when a loop is not shown to end and has no reason in tests/loops.toml
    tools/loops.py FILE...    these sources alone

clang turns each source of firmware/ into LLVM's intermediate code, for each machine that it is for, and `opt` derives
from each loop alone how often it runs at most: whatever the arguments, whatever stands in memory. A bound that it finds
holds for every run without undefined behaviour (which Eva and the sanitizers look for). No loop is taken to end:
-fno-finite-loops takes from the compiler the right that C11 gives it, and the tool refuses code that is marked so all
the same. A call by pointer may reach every function whose address is taken, with as many arguments and
a result of the same type. Not looked into: inline assembly, the C library and the compiler's arithmetic.

tests/loops.toml lists the loops that end for another reason, or are not meant to.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

from kept import kept, preprocessed, version
from units import ROOT, Unit, chosen, demand, everything, take_files

LISTED = ROOT / "tests" / "loops.toml"
COMPILE = "-O1 -g -fno-finite-loops -fno-discard-value-names -Xclang -disable-llvm-passes -S -emit-llvm -o -".split()
# Variables into registers, tests to the end of the loop, what does not change out of it: then the count is in sight.
TIDY = "simplifycfg,instcombine,loop-simplify,lcssa"
PASSES = (
    f"function(sroa,early-cse,{TIDY}),function(loop(loop-rotate)),function({TIDY}),function(loop-mssa(licm)),"
    "function(gvn,instcombine,loop-simplify,lcssa,print<scalar-evolution>)"
)


@dataclass(frozen=True, order=True)
class Loop:
    """Where a loop begins."""

    file: str  # from the top of the repository
    line: int

    def source(self) -> str:
        return (ROOT / self.file).read_text(encoding="utf-8").splitlines()[self.line - 1].strip()

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.source()}"


@dataclass(frozen=True)
class Listed:
    """A loop that is not shown to end; the fields of tests/loops.toml."""

    file: str  # a pattern, as the shell's
    line: str  # a regular expression, searched in the line where the loop begins
    reason: str

    def covers(self, loop: Loop) -> bool:
        return fnmatch(loop.file, self.file) and re.search(self.line, loop.source()) is not None


@dataclass
class Found:
    """What one source of one machine holds."""

    ends: set[Loop] = field(default_factory=set)
    open: set[Loop] = field(default_factory=set)
    calls: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))  # "*..." for a call by pointer
    shapes: dict[str, str] = field(default_factory=dict)  # of functions whose address is taken

    @property
    def text(self) -> str:
        """For a file."""
        places = [[(one.file, one.line) for one in sorted(loops)] for loops in (self.ends, self.open)]
        return json.dumps([*places, {name: sorted(called) for name, called in self.calls.items()}, self.shapes])

    @classmethod
    def of(cls, text: str) -> Found:
        """From `text`."""
        ends, opened, calls, shapes = json.loads(text)
        found = cls({Loop(*one) for one in ends}, {Loop(*one) for one in opened}, shapes=shapes)
        found.calls.update({name: set(called) for name, called in calls.items()})
        return found


class Debug:
    """Places in the source, from the intermediate code's metadata."""

    def __init__(self, code: str) -> None:
        self.nodes = dict(re.findall(r"^(!\d+) = (?:distinct )?(!.*)$", code, re.MULTILINE))

    def _value(self, node: str, name: str) -> str | None:
        found = re.search(rf'\b{name}: (?:"([^"]*)"|([^,)]+))', self.nodes[node])
        return (found[1] or found[2]) if found else None

    def place(self, node: str) -> Loop | None:
        """Of a !DILocation; None where it has no line, or lies in a system header."""
        line, scope = self._value(node, "line"), self._value(node, "scope")
        if not self.nodes[node].startswith("!DILocation(") or line in (None, "0") or scope is None:
            return None
        while (file := self._value(scope, "file")) is None:
            scope = self._value(scope, "scope") or ""
        path = Path(self._value(file, "directory") or "", self._value(file, "filename") or "").resolve()
        return Loop(str(path.relative_to(ROOT)), int(line or 0)) if path.is_relative_to(ROOT) else None

    def extent(self, node: str) -> tuple[Loop, Loop] | None:
        """Of the !llvm.loop of a branch: the first two places that it names, where the loop begins and ends."""
        places = [self.place(part) for part in re.findall(r"!\d+", self.nodes[node])[1:]]
        known = [place for place in places if place is not None]
        return (known[0], known[1]) if len(known) > 1 else None

    def extents(self, code: str) -> set[tuple[Loop, Loop]]:
        """Of all loops of the code."""
        found = (self.extent(node) for node in set(re.findall(r"!llvm\.loop (!\d+)", code)))
        return {extent for extent in found if extent is not None}


def run(command: list[str], stdin: str = "") -> subprocess.CompletedProcess[str]:
    done = subprocess.run(command, input=stdin, capture_output=True, text=True, check=False, cwd=ROOT)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}\n{done.stderr}")
    return done


def functions(code: str) -> dict[str, str]:
    """Bodies by name, first line and all."""
    found = re.finditer(r"^define [^\n]*?@([\w.$]+)\(.*?^\}$", code, re.MULTILINE | re.DOTALL)
    return {match[1]: match[0] for match in found}


def bounded(said: str) -> dict[str, dict[str, bool]]:
    """Of every function, by name: the loops' first blocks, and whether there is a most that they run."""
    found: dict[str, dict[str, bool]] = {}
    for part in said.split("Determining loop execution counts for: @")[1:]:
        name, counts = part.split("\n", 1)
        heads = re.findall(r"^Loop %(\S+): ", counts, re.MULTILINE)
        ending = set(re.findall(r"^Loop %(\S+): max backedge-taken count is ", counts, re.MULTILINE))
        found[name.strip()] = {head: head in ending for head in heads}
    return found


def place_of(body: str, head: str, debug: Debug, written: set[tuple[Loop, Loop]]) -> Loop | None:
    """Where the loop that begins with this block stands: as the branch back to it says, or, where that was lost, the
    innermost of the written loops around its first instruction."""
    back = re.findall(rf"^  br .*label %{re.escape(head)}(?:,| ).*!llvm\.loop (!\d+)", body, re.MULTILINE)
    for node in back:
        extent = debug.extent(node)
        if extent is not None:
            return extent[0]
    block = re.search(rf"^{re.escape(head)}:.*\n((?:  .*\n)*)", body, re.MULTILINE)
    places = (debug.place(node) for node in re.findall(r"^  %.*!dbg (!\d+)", block[1] if block else "", re.MULTILINE))
    for place in places:
        around = [begin for begin, end in written if place is not None and begin <= place <= end]
        if around:
            return max(around)
    return None


def shape_of(before: str, arguments: str) -> str:
    """The type of a function's result, which ends what stands before its name, and the number of its arguments."""
    result = re.sub(r"\b(addrspace\(\d+\)|\w+\(\d*\))", "", before).strip()
    depth, commas = 0, 0
    for character in arguments:
        depth += character in "([{<"
        depth -= character in ")]}>"
        commas += character == "," and depth == 0
    count = commas + 1 if arguments.strip() else 0
    return f"{result.split()[-1]}/{count}"


def inside_parentheses(text: str) -> str:
    """What stands between the first parenthesis and its own end."""
    depth = 0
    start = text.index("(")
    for at in range(start, len(text)):
        depth += (text[at] == "(") - (text[at] == ")")
        if depth == 0:
            return text[start + 1 : at]
    return text[start + 1 :]


def read_calls(code: str, bodies: dict[str, str], file: str, found: Found) -> None:
    """The calls of each function; a static one has its file with its name."""
    static = set(re.findall(r"^define internal [^\n]*?@([\w.$]+)\(", code, re.MULTILINE))

    def named(name: str) -> str:
        return f"{file}:{name}" if name in static else name

    shape: dict[str, str] = {}
    for match in re.finditer(r"^(?:define|declare) (.*?)@([\w.$]+)(\(.*)$", code, re.MULTILINE):
        shape[match[2]] = shape_of(match[1], inside_parentheses(match[3]))
    outside = re.sub(r"^(?:define|declare) .*$|^![^\n]*$|^attributes .*$", "", code, flags=re.MULTILINE)
    for name, body in bodies.items():
        found.calls.setdefault(named(name), set())
        for line in body.splitlines()[1:]:
            call = re.match(r"\s+(?:%[\w.]+ = )?(?:tail |musttail |notail )?call (.*)$", line)
            target = re.search(r"([@%])([\w.$-]+)\(", call[1]) if call and " asm " not in f" {call[1]}" else None
            if call is None or target is None:
                continue
            if target[1] == "@":
                if not target[2].startswith("llvm."):
                    found.calls[named(name)].add(named(target[2]))
            else:
                arguments = inside_parentheses(call[1][target.end() - 1 :])
                found.calls[named(name)].add(f"*{shape_of(call[1][: target.start()], arguments)}")
    for match in re.finditer(r"(call [^\n]*?)?@([\w.$]+)(\()?", outside):
        if match[2] in shape and not match[2].startswith("llvm.") and not (match[1] and match[3]):
            found.shapes[named(match[2])] = shape[match[2]]


def read(unit: Unit) -> Found:
    """Of a source, anew where it has changed."""
    versions = (version("clang", "--version"), version("opt", "--version"), Path(__file__).read_text(encoding="utf-8"))
    source = preprocessed(["clang", *unit.options], unit.source)
    text = kept([*versions, str(unit.source), *unit.options, source], lambda: _read(unit).text)
    assert text is not None, "_read ends the program where clang refuses a source"
    return Found.of(text)


def _read(unit: Unit) -> Found:
    code = run(["clang", *unit.options, *COMPILE, str(unit.source)]).stdout
    done = run(["opt", "-S", f"-passes={PASSES}", "-o", "-"], code)
    if "mustprogress" in code + done.stdout:
        raise SystemExit(f"{unit.name}: loops are taken to end")
    found = Found()
    debug = Debug(done.stdout)
    written = Debug(code).extents(code)
    bodies = functions(done.stdout)
    for name, loops in bounded(done.stderr).items():
        for head, ends in loops.items():
            place = place_of(bodies[name], head, debug, written)
            if place is None:
                raise SystemExit(f"{unit.name}: where is the loop at {head} of {name}?")
            (found.ends if ends else found.open).add(place)
    lost = {begin for begin, _ in written} - found.ends - found.open
    if lost:
        raise SystemExit(f"{unit.name}: not looked at: {', '.join(map(str, lost))}")
    read_calls(code, functions(code), str(unit.source.relative_to(ROOT)), found)
    return found


def cycles(all_found: list[Found]) -> list[str]:
    """Functions that reach themselves."""
    calls: dict[str, set[str]] = defaultdict(set)
    shapes: dict[str, set[str]] = defaultdict(set)
    for found in all_found:
        for caller, called in found.calls.items():
            calls[caller] |= called
        for name, shape in found.shapes.items():
            shapes[shape].add(name)
    for caller, called in calls.items():
        pointers = {one for one in called if one.startswith("*")}
        calls[caller] = (called - pointers).union(*(shapes[one[1:]] for one in pointers))
    found_cycles = []
    for start in sorted(calls):
        reached: set[str] = set()
        ahead = list(calls[start])
        while ahead:
            one = ahead.pop()
            if one not in reached:
                reached.add(one)
                ahead += calls.get(one, ())
        if start in reached:
            found_cycles.append(start)
    return found_cycles


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    take_files(parser)
    files = set(parser.parse_args().files)
    demand({"clang": "clang", "opt": "llvm"})
    units = chosen(everything(), files, parser)
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(read, units))
    with LISTED.open("rb") as file:
        listed = [Listed(**entry) for entry in tomllib.load(file).get("loop", [])]
    unproved = set().union(*(one.open for one in found))
    loops = unproved.union(*(one.ends for one in found))
    faults = [
        f"{loop}\n    is not shown to end"
        for loop in sorted(unproved)
        if not any(entry.covers(loop) for entry in listed)
    ]
    faults += [
        f"{LISTED.name}: {entry.file} `{entry.line}` covers no loop that is open; take it out"
        for entry in listed
        if not files and not any(entry.covers(loop) for loop in unproved)
    ]
    machines = {unit.machine for unit in units}
    for machine in sorted(machines):
        of_it = [one for one, unit in zip(found, units, strict=True) if unit.machine == machine]
        faults += [f"{name} calls itself, perhaps by way of others ({machine})" for name in cycles(of_it)]
    print("\n".join(faults))
    functions_read = len(set().union(*(one.calls for one in found)))
    print(
        f"Found {len(faults)} faults"
        if faults
        else f"All checks passed! {len(loops) - len(unproved)} loops end by their own bound, {len(unproved)} for a "
        f"reason of {LISTED.name}; no recursion in {functions_read} functions"
    )
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
