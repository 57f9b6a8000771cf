#!/usr/bin/env python3
"""Mutation check: one operator, sign or constant of the core is changed at a time, and the quick tests have to notice.

    build/venv/bin/python tools/mutate.py                  240 mutants; writes build/mutants.md; a quarter of an hour
    build/venv/bin/python tools/mutate.py --count 10       ten of them; writes nothing
    build/venv/bin/python tools/mutate.py --recorded       of all bits only the running hashes that the tests record

The quick tests are two: what init answers to every edge of every setting (tests/configurations.py), and what
tests/playback_weak.py plays of the weak identifier and its second stage with the generated C of mechanisms, whose bits
the suite compares with the numpy twin; and the
CMocka programs of tests/unit, as they are, then those that take less than a second under clang's address and
undefined-behaviour sanitizers. A crash and a loop without an end are noticed, too. A change that leaves the object code
of every build as it was is no mutant.

A survivor stands in tests/mutants.toml with its reason, or the command fails. `equivalent = true` there says that no
test could see it, and why; such a mutant is left out of the second of the two rates.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import configurations  # noqa: E402 - of tests
import playback_weak  # noqa: E402 - of tests

from pvid.core import sources  # noqa: E402
from pvid.core.headers import HEADERS  # noqa: E402
from pvid.core.native import Native  # noqa: E402
from pvid.settings.bounds import SIZES  # noqa: E402

BUILD = ROOT / "build" / "mutate"
MEMORY = ROOT / "build" / "mutants.json"
REPORT = ROOT / "build" / "mutants.md"
REASONS = ROOT / "tests" / "mutants.toml"
FIRMWARE = sources.FIRMWARE
INCLUDES = [*sources.PUBLIC_INCLUDES, f"-I{FIRMWARE / 'link'}", f"-I{ROOT / 'build'}"]
PRIVATE = sources.SRC.relative_to(FIRMWARE)
LINK = FIRMWARE / "link" / "link.c"
BESIDES = (*(ROOT / "host" / "native").glob("[lr]*.c"), LINK)  # of the shared library, beside the core
OF_WEAK = re.compile(r"^(refine|weak)_|_(refine|weak)_")  # names of files of the weak form and of its second stage
COUNT = 240
RECORDED = "--recorded" in sys.argv  # the workers of a pool read it, too
LONGEST = 60  # seconds of processor time for what takes one
QUICK = 1.0  # seconds that a test may take to be asked under sanitizers as well
WANTED = 0.95

SWAPS = {
    "+": "-",
    "-": "+",
    "+=": "-=",
    "-=": "+=",
    "++": "--",
    "--": "++",
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "&&": "||",
    "||": "&&",
    "<<": ">>",
    ">>": "<<",
    "*": "+",
    "/": "*",
}
TOKEN = re.compile(
    r"(?P<number>(?<![\w.])(?:\d+\.\d*(?:e[-+]?\d+)?f|\d+[uU]?[lL]*)(?![\w.]))"
    r"|(?P<operator><<=|>>=|->|\+\+|--|\+=|-=|<<|>>|<=|>=|==|!=|&&|\|\|| [-+*/<>] |(?<=[(= ])-(?=\w))"
)

# ---- mutants ----


CORE = frozenset(sources.core_sources())


def files_of_core() -> list[Path]:
    """Sources and private headers."""
    return sorted(sources.SRC.glob("*/*.[ch]"), key=lambda path: path.name)


def place(name: str) -> Path:
    """The file of this name: no two have the same."""
    (found,) = (path for path in files_of_core() if path.name == name)
    return found


@cache
def source_text(name: str) -> str:
    """What the file of this name holds."""
    return place(name).read_text(encoding="utf-8")


@dataclass(frozen=True, order=True)
class Mutant:
    """`old` at an offset of a file becomes `new`; the `place`-th such token of its line."""

    file: str
    offset: int
    old: str
    new: str
    place: int

    def text(self) -> str:
        """The file with the change."""
        code = source_text(self.file)
        return code[: self.offset] + self.new + code[self.offset + len(self.old) :]

    def line(self) -> tuple[int, str]:
        """Number and text of its line as it is."""
        code = source_text(self.file)
        start = code.rfind("\n", 0, self.offset) + 1
        return code.count("\n", 0, start) + 1, code[start:].partition("\n")[0].strip()

    def rank(self, seed: int) -> str:
        """Where a draw has it, whatever the other lines are: an edit elsewhere leaves the draw as it was."""
        told = f"{seed} {self.file} {self.line()[1]} {self.old} {self.new} {self.place}"
        return hashlib.sha256(told.encode()).hexdigest()

    def describe(self) -> str:
        """The change in words."""
        return f"{self.file}:{self.line()[0]} {self.old.strip()} -> {self.new.strip()}: {self.line()[1]}"


def blanked(code: str) -> str:
    """The code with comments, preprocessor lines and strings made blank, every offset kept."""
    pattern = r"/\*.*?\*/|//[^\n]*|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*|\"[^\"\n]*\""
    return re.sub(pattern, lambda m: re.sub(r"[^\n]", " ", m[0]), code, flags=re.DOTALL | re.MULTILINE)


def changed(kind: str, token: str) -> str | None:
    """What a token becomes, None if it is left alone."""
    if kind == "number":
        digits = re.match(r"[\d.]+", token)
        assert digits is not None
        if "." in token:
            return f"{float(digits[0]) + 1.0!r}{token[len(digits[0]) :]}"
        return f"{int(digits[0]) + 1}{token[len(digits[0]) :]}"
    bare = token.strip()
    if token == "-":  # a sign
        return ""
    return token.replace(bare, SWAPS[bare]) if bare in SWAPS else None


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Every mutant of a file."""
    code = blanked(path.read_text(encoding="utf-8"))
    seen: dict[tuple[int, str], int] = defaultdict(int)
    for match in TOKEN.finditer(code):
        kind = match.lastgroup
        assert kind is not None
        new = changed(kind, match[0])
        if new is not None:
            key = (code.count("\n", 0, match.start()), match[0])
            seen[key] += 1
            yield Mutant(path.name, match.start(), match[0], new, seen[key])


def ranked(seed: int) -> dict[str, list[Mutant]]:
    """The mutants of every file in the order of a draw."""
    files = files_of_core()
    found = {path.name: sorted(mutants_of(path), key=lambda mutant: mutant.rank(seed)) for path in files}
    return {name: mutants for name, mutants in found.items() if mutants}


def shares(sizes: dict[str, int], count: int) -> dict[str, int]:
    """How many mutants of each file: by their number, and one at least where there are so many."""
    total = sum(sizes.values())
    exact = {name: count * size / total for name, size in sizes.items()}
    given = {name: min(sizes[name], int(share)) for name, share in exact.items()}
    for name in sorted(exact, key=lambda name: (given[name] > 0, given[name] - exact[name], name)):
        if sum(given.values()) < count:
            given[name] += given[name] < sizes[name]
    return given


# ---- builds ----


@dataclass(frozen=True)
class Kit:
    """A compiler and its options; `name` is the folder of what it makes of `sources`."""

    name: str
    compiler: str
    options: tuple[str, ...]
    checks: tuple[str, ...] = ()  # options of the linker as well
    sources: tuple[Path, ...] = (*sources.core_sources(), LINK)

    def compiles(self, target: Path, source: Path, top: Path = FIRMWARE) -> bool:
        """Compiles a file whose private headers are those under `top`."""
        target.parent.mkdir(parents=True, exist_ok=True)
        includes = [*INCLUDES, f"-I{top / PRIVATE}"]
        return ran([self.compiler, *COMMON, *self.options, *self.checks, *includes, "-c", source, "-o", target])

    def links(self, target: Path, objects: list[Path]) -> Path:
        """A shared library."""
        if not ran([self.compiler, *self.checks, "-shared", "-o", target, *objects, "-lm"]):
            raise SystemExit(f"{target.name} does not link with {self.name}")
        return target

    def links_test(self, program: Path, folder: Path) -> bool:
        """A CMocka program of the object beside it, which finds the core's library where it is told to look."""
        test = program.with_suffix(".o")
        return ran([self.compiler, *self.checks, "-o", program, test, f"-L{folder}", "-lpvidcore", "-lcmocka", "-lm"])


COMMON = ("-O1", "-ffp-contract=off", "-fno-fast-math", "-fPIC", "-w")
MUTANT = (*SIZES, '-DPVID_NATIVE_BUILD="mutant"')
NATIVE = Kit("native", "gcc", ("-std=c99", *MUTANT), sources=(*sources.core_sources(), *BESIDES))
PLAIN = Kit("plain", "gcc", ("-std=c99",))
WRAPS = f"-fsanitize-ignorelist={ROOT / 'tests' / 'sanitizers.ignore'}"
CHECKS = "-fsanitize=address,undefined,float-cast-overflow,integer"
SANITIZERS = (Kit("address", "clang", ("-std=c11", WRAPS), (CHECKS, "-fno-sanitize-recover=all")),)


Digests = Callable[[Path], Iterator[tuple[str, str]]]


@cache
def playbacks() -> dict[Kit, Digests]:
    """The builds that are played, and what one shows by variant."""
    found: dict[Kit, Digests] = {}
    if not RECORDED:
        found[NATIVE] = lambda library: iter([("configurations", configurations.digest(Native(library)))])
    for one in playback_weak.subjects():
        folder = one.library.parent
        options = ("-std=c99", *one.definitions, f"-I{folder}", f"-I{ROOT / 'host' / 'native'}")
        kit = Kit(one.name, "gcc", options, sources=(*one.sources, *sorted(folder.glob("*.c"))))
        shutil.copy(folder / HEADERS, emptied(BUILD / kit.name) / HEADERS)
        found[kit] = one.hashes if RECORDED else one.digests
    return found


def emptied(folder: Path) -> Path:
    """A new folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def ran(command: Sequence[str | Path]) -> bool:
    """Whether a command succeeds."""
    return subprocess.run([str(part) for part in command], capture_output=True, check=False).returncode == 0


def made(kit: Kit) -> list[Path]:
    """Objects of the files as they are, in the kit's folder."""
    targets = [BUILD / kit.name / f"{path.stem}.o" for path in kit.sources]
    with ThreadPoolExecutor(2) as pool:
        for source, compiled in zip(kit.sources, pool.map(kit.compiles, targets, kit.sources), strict=True):
            if not compiled:
                raise SystemExit(f"{source} does not compile with {kit.name}")
    return targets


def tests_of(kit: Kit) -> dict[str, float]:
    """Builds the core and the CMocka programs with a kit and runs these; seconds that each takes."""
    folder = BUILD / kit.name
    kit.links(folder / "libpvidcore.so", made(kit))
    seconds = {}
    for test in made(replace(kit, name=f"{kit.name}/tests", sources=tuple(playback_weak.unit_tests()))):
        before = time.monotonic()
        if not kit.links_test(test.with_suffix(""), folder) or not passes(test.with_suffix(""), folder):
            raise SystemExit(f"{test.stem} fails with the core as it is ({kit.name})")
        seconds[test.stem] = time.monotonic() - before
    return seconds


@dataclass(frozen=True)
class Baseline:
    """The core as it is: what its playbacks show, which sources include which header, how long each test takes."""

    digests: dict[Kit, dict[str, str]]
    including: dict[Kit, dict[str, tuple[Path, ...]]]  # with the options of a kit
    seconds: dict[str, float]

    def reached(self, kit: Kit, file: str) -> tuple[Path, ...]:
        """Sources of a kit whose objects a change of a file reaches."""
        if file.endswith(".c"):
            return tuple(path for path in kit.sources if path.name == file)
        return self.including[kit].get(file, ())

    def tests_anew(self, file: str) -> set[str]:
        """CMocka programs that include a file."""
        return {path.stem for path in self.including[TESTS].get(file, ())}

    def nearest_first(self, file: str) -> list[str]:
        """The CMocka programs: those named like the file, then the others, the quick before the slow."""
        stem = re.sub(r"_(f32|q31)$", "", Path(file).stem)
        return sorted(self.seconds, key=lambda test: (stem not in test, self.seconds[test]))


TESTS = replace(PLAIN, name="plain/tests", sources=tuple(playback_weak.unit_tests()))


def headers_of(kit: Kit, source: Path) -> set[str]:
    """The private headers that a source includes, also by way of others."""
    includes = [*INCLUDES, f"-I{FIRMWARE / PRIVATE}"]
    command = [kit.compiler, *kit.options, *includes, "-MM", str(source)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    private = {str(path) for path in files_of_core()}
    return {Path(word).name for word in told.split() if word in private and word.endswith(".h")}


def including(kit: Kit) -> dict[str, tuple[Path, ...]]:
    """The sources of a kit that include each private header."""
    found: dict[str, list[Path]] = defaultdict(list)
    with ThreadPoolExecutor(2) as pool:
        for path, headers in zip(kit.sources, pool.map(lambda one: headers_of(kit, one), kit.sources), strict=True):
            for header in headers:
                found[header].append(path)
    return {name: tuple(paths) for name, paths in found.items()}


def baseline() -> Baseline:
    """Builds the core as it is and the CMocka programs; runs them once."""
    shutil.rmtree(BUILD, ignore_errors=True)
    playbacks.cache_clear()
    digests = {}
    for kit in playbacks():
        library = kit.links(BUILD / kit.name / "libbaseline.so", made(kit))
        digests[kit] = digests_apart(kit, library, None)
        if not digests[kit] or digests[kit] != digests_apart(kit, library, None):
            raise SystemExit(f"the core as it is does not give the same bits twice ({kit.name})")
    for one in playback_weak.subjects():
        own = next(shown for kit, shown in digests.items() if kit.name == one.name)
        if own != dict((one.hashes if RECORDED else one.digests)(one.library)):
            raise SystemExit(f"{one.name}: other bits than those of the library of pvid")
    kits = (*playbacks(), PLAIN, TESTS)
    return Baseline(digests, {kit: including(kit) for kit in kits}, tests_of(PLAIN))


# ---- verdicts ----


def passes(program: Path, folder: Path) -> bool:
    """Runs a CMocka program with the core of a folder, for a bounded time."""
    command = ["prlimit", f"--cpu={LONGEST}", str(program)]
    environment = {**os.environ, "LD_LIBRARY_PATH": str(folder)}
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    return done.returncode == 0


def digests_apart(kit: Kit, library: Path, expected: dict[str, str] | None) -> dict[str, str]:
    """What a library shows, by variant, from a process of its own: a mutant may crash, or never end. Ends at the first
    that is not what is expected, when something is."""
    shows = playbacks()[kit]
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        with os.fdopen(writer, "w") as pipe:
            try:
                for name, shown in shows(library):
                    pipe.write(f"{name}\t{shown}\n")
                    if expected is not None and shown != expected[name]:
                        break
            finally:
                pipe.flush()
                os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        lines = pipe.read().splitlines()
    os.waitpid(child, 0)
    return dict(line.split("\t") for line in lines if line.count("\t") == 1)


def first_difference(shown: dict[str, str], expected: dict[str, str]) -> str | None:
    """The first variant whose digest is another, or missing."""
    for name, digest in expected.items():
        if shown.get(name) != digest:
            return f"{name}: {'bits' if name in shown else 'no answer'}"
    return None


def code_of(path: Path) -> bytes:
    """Code and data of an object, without the name of its source."""
    stripped = path.with_suffix(f".{os.getpid()}")
    subprocess.run(["objcopy", "--strip-unneeded", "--remove-section=.comment", path, stripped], check=True)
    return stripped.read_bytes()


@contextmanager
def workshop(mutant: Mutant) -> Iterator[Path]:
    """A folder with the core's sources, one of them changed."""
    folder = BUILD / f"work-{os.getpid()}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    try:
        for path in files_of_core():
            target = folder / path.relative_to(FIRMWARE)
            target.parent.mkdir(parents=True, exist_ok=True)
            if path.name == mutant.file:
                target.write_text(mutant.text(), encoding="utf-8")
            else:
                target.symlink_to(path)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def changed_library(kit: Kit, mutant: Mutant, base: Baseline, folder: Path, name: str) -> tuple[Path, bool] | None:
    """The core's library with the mutant in it, and whether its code is another; None if it does not compile."""
    # sanitizers see what the plain build does
    reached = base.reached(kit if kit in base.including else PLAIN, mutant.file)
    replaced = [folder / kit.name / f"{path.stem}.o" for path in reached]
    changed = [folder / path.relative_to(FIRMWARE) if path in CORE else path for path in reached]
    if not all(kit.compiles(*pair, folder) for pair in zip(replaced, changed, strict=True)):
        return None
    differs = any(code_of(path) != code_of(BUILD / kit.name / path.name) for path in replaced)
    stems = {path.stem for path in reached}
    kept = [BUILD / kit.name / f"{path.stem}.o" for path in kit.sources if path.stem not in stems]
    (folder / kit.name).mkdir(exist_ok=True)
    return kit.links(folder / kit.name / name, sorted(kept) + replaced), differs


def killed_by_bits(mutant: Mutant, base: Baseline, folder: Path) -> str | None:
    """The first variant of a playback that is another; "no mutant" when no build's code is, or it does not compile."""
    kits = sorted(playbacks(), key=lambda kit: (kit is NATIVE) == bool(OF_WEAK.search(mutant.file)))
    differs = False
    for kit in (*kits, *([PLAIN] if RECORDED else [])):
        if not base.reached(kit, mutant.file):
            continue
        library = changed_library(kit, mutant, base, folder, f"{mutant.rank(0)[:16]}.so")
        if library is None:
            return "no mutant"
        if library[1]:
            differs = True
            if kit is PLAIN:  # it is not played
                continue
            if kit is not NATIVE:
                (library[0].with_name(HEADERS)).symlink_to(BUILD / kit.name / HEADERS)
            shown = first_difference(digests_apart(kit, library[0], base.digests[kit]), base.digests[kit])
            if shown is not None:
                return shown
    return None if differs else "no mutant"


def killed_by_tests(kit: Kit, mutant: Mutant, base: Baseline, folder: Path) -> str | None:
    """The first CMocka program that fails; those that include a changed header are built anew."""
    library = changed_library(kit, mutant, base, folder, "libpvidcore.so")
    if library is None:
        raise SystemExit(f"does not compile with {kit.name}: {mutant.describe()}")
    anew = base.tests_anew(mutant.file)
    for test in base.nearest_first(mutant.file):
        if kit is not PLAIN and base.seconds[test] > QUICK:
            continue
        program = BUILD / kit.name / "tests" / test
        if test in anew:
            program = folder / kit.name / test
            source = ROOT / "tests" / "unit" / f"{test}.c"
            built = kit.compiles(program.with_suffix(".o"), source, folder)
            if not built or not kit.links_test(program, library[0].parent):
                raise SystemExit(f"{test} does not compile with {kit.name}: {mutant.describe()}")
        if not passes(program, library[0].parent):
            return test if kit is PLAIN else f"{test} ({kit.name})"
    return None


def verdict(job: tuple[Mutant, Baseline]) -> str | None:
    """What killed it, "no mutant" when it does not compile or compiles to the same code, None when it lives."""
    mutant, base = job
    with workshop(mutant) as folder:
        return killed_by_bits(mutant, base, folder) or killed_by_tests(PLAIN, mutant, base, folder)


def verdict_under_sanitizers(job: tuple[Mutant, Baseline]) -> str | None:
    """The same for one that has lived so far."""
    mutant, base = job
    with workshop(mutant) as folder:
        for kit in SANITIZERS:
            killer = killed_by_tests(kit, mutant, base, folder)
            if killer is not None:
                return killer
    return None


Judge = Callable[[tuple[Mutant, Baseline]], str | None]


class Memory:
    """Who was killed before, in a file: asked again is only who lived, or whose source has changed since. Tests are
    added to, so that a kill stays one; builds, too, so that what compiles to the same code is asked again."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        kept = path.read_text(encoding="utf-8") if path is not None and path.exists() else "{}"
        self._killers: dict[str, str] = json.loads(kept)

    @staticmethod
    def _key(mutant: Mutant) -> str:
        return hashlib.sha256(f"{mutant.file} {mutant.text()}".encode()).hexdigest()

    def killer(self, mutant: Mutant) -> str | None:
        """What killed it; None if it is to be asked."""
        return self._killers.get(self._key(mutant))

    def keep(self, mutant: Mutant, by: str | None) -> None:
        """A verdict."""
        if by is not None and by != "no mutant" and self._path is not None:
            self._killers[self._key(mutant)] = by
            self._path.write_text(json.dumps(self._killers, indent=0), encoding="utf-8")


def campaign(
    count: int, seed: int, sanitizers: tuple[Kit, ...] = SANITIZERS, memory: Path | None = None
) -> list[tuple[Mutant, str | None]]:
    """Draws until there are so many mutants, and judges them; prints each."""
    base = baseline()
    known = Memory(memory)
    waiting = ranked(seed)
    wanted = shares({name: len(mutants) for name, mutants in waiting.items()}, count)
    results: list[tuple[Mutant, str | None]] = []

    def judge(asked: Judge, mutants: list[Mutant]) -> Iterator[str | None]:
        before = [known.killer(mutant) for mutant in mutants]
        fresh = pool.map(asked, [(one, base) for one, by in zip(mutants, before, strict=True) if by is None])
        for mutant, by in zip(mutants, before, strict=True):
            found = by or next(fresh)
            if by is None:
                known.keep(mutant, found)
            yield found

    with ProcessPoolExecutor(2) as pool:
        while True:
            drawn = [waiting[name].pop(0) for name, n in wanted.items() for _ in range(min(n, len(waiting[name])))]
            if not drawn:
                break
            for mutant, by in zip(drawn, judge(verdict, drawn), strict=True):
                if by != "no mutant":
                    wanted[mutant.file] -= 1
                    results.append((mutant, by))
                    print(f"{by or 'lives so far':40} {mutant.describe()}", flush=True)
        alive = [mutant for mutant, by in results if by is None]
        if not alive or not sanitizers:
            return results
        for kit in sanitizers:
            tests_of(kit)
        second = dict(zip(alive, judge(verdict_under_sanitizers, alive), strict=True))
    for mutant, by in second.items():
        print(f"{by or 'LIVES':40} {mutant.describe()}", flush=True)
    return [(mutant, by or second.get(mutant)) for mutant, by in results]


# ---- reasons and the report ----


@dataclass(frozen=True)
class Reason:
    """Why a mutant lives, from mutants.toml; place 0: every such token of the line."""

    file: str
    line: str
    old: str
    new: str
    why: str
    equivalent: bool = False
    place: int = 0

    def is_of(self, mutant: Mutant) -> bool:
        """Whether it speaks of this mutant."""
        same = (self.file, self.old, self.new) == (mutant.file, mutant.old.strip(), mutant.new.strip())
        return same and self.line in mutant.line()[1] and self.place in (0, mutant.place)


def reasons() -> list[Reason]:
    """All of mutants.toml."""
    with REASONS.open("rb") as file:
        return [Reason(**entry) for entry in tomllib.load(file).get("survivor", [])]


def reason_for(mutant: Mutant, known: list[Reason]) -> Reason | None:
    """The reason given for a survivor."""
    return next((reason for reason in known if reason.is_of(mutant)), None)


@dataclass(frozen=True)
class Tally:
    """What came of a campaign."""

    mutants: int
    killed: int
    by_bits: int
    equivalent: list[tuple[Mutant, Reason]]
    others: list[tuple[Mutant, Reason | None]]

    @property
    def rate(self) -> float:
        """Killed of those that could be."""
        return self.killed / max(self.mutants - len(self.equivalent), 1)


def tally(results: list[tuple[Mutant, str | None]]) -> Tally:
    """Counts, and what is known of the survivors."""
    known = reasons()
    alive = [(mutant, reason_for(mutant, known)) for mutant, by in sorted(results) if by is None]
    return Tally(
        mutants=len(results),
        killed=sum(by is not None for _, by in results),
        by_bits=sum(by is not None and not by.startswith("test_") for _, by in results),
        equivalent=[(mutant, reason) for mutant, reason in alive if reason is not None and reason.equivalent],
        others=[(mutant, reason) for mutant, reason in alive if reason is None or not reason.equivalent],
    )


def row(mutant: Mutant, reason: Reason | None) -> str:
    number, line = mutant.line()
    why = "unexplained" if reason is None else reason.why
    change = f"`{mutant.old.strip()}` to `{mutant.new.strip()}`"
    return f"| {mutant.file}:{number} | `{line}` | {change} | {why} |".replace("||", "\\|\\|")


def table(rows: list[str]) -> str:
    return "\n".join(["| where | line | change | why |", "|---|---|---|---|", *rows]) if rows else "None."


def report_of(results: list[tuple[Mutant, str | None]], seed: int) -> str:
    """Rates and survivors."""
    told = tally(results)
    files = len({mutant.file for mutant, _ in results})
    could = told.mutants - len(told.equivalent)
    return f"""# Mutation check

{told.mutants} mutants of the {files} files of `firmware/src`, drawn with seed {seed}, by each
file's number of them: one operator, sign or constant changed. {told.killed} were killed:
{100 * told.killed / told.mutants:.1f} % of all, and {100 * told.rate:.1f} % of the {could} that are not
equivalent. {told.by_bits} of them by the bits of a few seconds of data
(`tests/configurations.py`, `tests/playback_weak.py`), the others by a CMocka program. The slower tests (every build
against the twin over 40 000 ticks, oracles, accuracy) were not asked.

## Survivors that a test could kill

{table([row(*one) for one in told.others])}

## Equivalent mutants

No input within what the headers allow shows a difference:

{table([row(*one) for one in told.equivalent])}
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=0, help=f"mutants; without it {COUNT}, and the report is written")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--recorded", action="store_true", help="of all bits the recorded running hashes alone")
    parser.add_argument("--restart", action="store_true", help="ask those again, too, that were killed before")
    given = parser.parse_args()
    if not ran([ROOT / "tools" / "pvid", "model", "build", "kapitza", "-o", ROOT / "build" / "pendulum"]):
        raise SystemExit("pvid model build kapitza fails")
    if given.restart:
        MEMORY.unlink(missing_ok=True)
    results = campaign(given.count or COUNT, given.seed, memory=None if RECORDED else MEMORY)
    told = tally(results)
    if not given.count and not RECORDED:
        REPORT.write_text(report_of(results, given.seed), encoding="utf-8")
    print(
        f"{told.killed} of {told.mutants} mutants killed, {len(told.equivalent)} equivalent: "
        f"{100 * told.rate:.1f} % of those that could be"
    )
    unexplained = [mutant for mutant, reason in told.others if reason is None]
    for mutant in unexplained:
        print(f"no reason in {REASONS.name}: {mutant.describe()}")
    return 1 if unexplained or told.rate < WANTED else 0


if __name__ == "__main__":
    sys.exit(main())
