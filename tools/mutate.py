#!/usr/bin/env python3
"""Mutation check: one operator, sign or constant of the core is changed at a time, and the tests have to notice.

    build/venv/bin/python tools/mutate.py                  200 mutants, drawn with a fixed seed; writes tests/MUTANTS.md
    build/venv/bin/python tools/mutate.py --count 10       ten of them; writes nothing

A mutant is compiled into the shared library, which plays some seconds of the standard rig and of hostile samples
through both forms in both arithmetics: it is killed when a bit of the record, the estimate or the counters differs from
that of the core as it is (which the tests compare with the numpy twin). One that survives that is linked with every
CMocka program. A crash and a loop without an end are noticed too. A change that leaves the object code as it was is no
mutant.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pvid.native import Native, WeakConfig
from pvid.native_q31 import StrongConfigQ31, StrongIdentifierQ31, WeakConfigQ31, WeakIdentifierQ31
from pvid.rig import simulate, standard_sensors
from pvid.rigfile import RigFile
from pvid.setup import strong_config, weak_config
from pvid.setup_q31 import counts_of, strong_config_q31, weak_config_q31

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "mutate"
PAGE = ROOT / "tests" / "MUTANTS.md"
REASONS = ROOT / "tests" / "mutants.toml"
SOURCES = ROOT / "firmware" / "src"
INCLUDES = [f"-I{ROOT / 'firmware' / name}" for name in ("include", "src", "link")]
FLAGS = ["-std=c99", "-O1", "-ffp-contract=off", "-fno-fast-math", "-fPIC", "-w", *INCLUDES]
NATIVE = [*FLAGS, "-DPVID_MAX_P=6", "-DPVID_MAX_MOMENTS=55", '-DPVID_NATIVE_BUILD="mutant"']
LONGEST = 60  # seconds of processor time for a program that takes one or two
TICKS = 6000

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


@dataclass(frozen=True, order=True)
class Mutant:
    """`old` at an offset of a file becomes `new`."""

    file: str
    offset: int
    old: str
    new: str

    def text(self) -> str:
        code = (SOURCES / self.file).read_text(encoding="utf-8")
        return code[: self.offset] + self.new + code[self.offset + len(self.old) :]

    def line(self) -> tuple[int, str]:
        code = (SOURCES / self.file).read_text(encoding="utf-8")
        number = code.count("\n", 0, self.offset)
        return number + 1, code.splitlines()[number].strip()


def blanked(code: str) -> str:
    """The code with comments, preprocessor lines and strings made blank, every offset kept."""
    pattern = r"/\*.*?\*/|//[^\n]*|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*|\"[^\"\n]*\""
    return re.sub(pattern, lambda m: re.sub(r"[^\n]", " ", m[0]), code, flags=re.DOTALL | re.MULTILINE)


def changed(kind: str, token: str) -> str | None:
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
    code = blanked(path.read_text(encoding="utf-8"))
    for match in TOKEN.finditer(code):
        kind = match.lastgroup
        assert kind is not None
        new = changed(kind, match[0])
        if new is not None:
            yield Mutant(path.name, match.start(), match[0], new)


# ---- builds ----


def compile_to(target: Path, source: Path, flags: list[str]) -> bool:
    command = ["gcc", *flags, "-c", str(source), "-o", str(target)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def baseline() -> None:
    """The objects of the core as it is, of the library's other parts and of the CMocka programs."""
    shutil.rmtree(BUILD, ignore_errors=True)
    jobs = [(BUILD / "native" / f"{path.stem}.o", path, NATIVE) for path in SOURCES.glob("*.c")]
    jobs += [(BUILD / "unit" / f"{path.stem}.o", path, FLAGS) for path in SOURCES.glob("*.c")]
    link = ROOT / "firmware" / "link" / "link.c"
    jobs += [
        (BUILD / "native_rest" / f"{path.stem}.o", path, NATIVE) for path in (ROOT / "host/native").glob("[lr]*.c")
    ]
    jobs += [(BUILD / "native_rest" / "link.o", link, NATIVE), (BUILD / "unit_rest" / "link.o", link, FLAGS)]
    jobs += [(BUILD / "tests" / f"{path.stem}.o", path, FLAGS) for path in (ROOT / "tests/unit").glob("test_*.c")]
    for target, source, flags in jobs:
        target.parent.mkdir(parents=True, exist_ok=True)
        if not compile_to(target, source, flags):
            raise SystemExit(f"{source} does not compile")


def linked(target: Path, folder: str, replaced: Path | None) -> Path:
    """The shared library with one object replaced by its mutant."""
    objects = [path for path in (BUILD / folder).glob("*.o") if replaced is None or path.name != replaced.name]
    objects += (BUILD / f"{folder}_rest").glob("*.o")
    command = ["gcc", "-shared", "-o", str(target), *map(str, objects), *([str(replaced)] if replaced else []), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    return target


# ---- bits ----


@dataclass(frozen=True)
class Samples:
    phi: Any
    y: Any
    phi_counts: Any
    y_counts: Any
    configurations: list[Any]


def samples() -> Samples:
    """Six seconds of the standard rig with some samples that nobody should send."""
    rig = RigFile.standard()
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=TICKS / 1000, seed=1).run
    phi_counts, y_counts = counts_of(rig, run)
    phi, y = run.phi.copy(), run.y.copy()
    phi[2901], y[2902], phi[2903], y[2904] = np.nan, np.inf, 3e30, -1e9
    phi_counts, y_counts = phi_counts.copy(), y_counts.copy()
    phi_counts[2901], y_counts[2902] = 2**31 - 1, -(2**31)
    return Samples(phi, y, phi_counts, y_counts, configurations())


def configurations() -> list[Any]:
    """Both forms and arithmetics under several settings."""
    rig = RigFile.standard()

    def of(**settings: Any) -> RigFile:
        return replace(rig, identifier=replace(rig.identifier, **settings))

    found: list[Any] = [
        weak_config(of(full_angle=True), 1000.0),
        weak_config(of(forgetting_s=8.0, law="pseudovelocity"), 1000.0),
        weak_config_q31(of(forgetting_s=8.0), 1000.0),
        weak_config_q31(of(law="pseudovelocity", zero=False), 1000.0),
    ]
    for differentiator, law in (("finite-difference", "stationary"), ("savitzky-golay", "pseudovelocity")):
        settings = {"form": "strong", "differentiator": differentiator, "law": law, "forgetting_s": 1.0}
        found.append(replace(strong_config(of(**settings), 1000.0), drive_min=0.0))
        fine = replace(of(**settings), sensor=replace(rig.sensor, phi_lsb=standard_sensors(20).phi_lsb))
        found.append(replace(strong_config_q31(fine, 1000.0), drive_min=0))
    return found


def core_of(native: Native, config: Any) -> tuple[Any, bool]:
    """The identifier, and whether it takes counts."""
    if isinstance(config, WeakConfigQ31):
        return WeakIdentifierQ31(native, config), True
    if isinstance(config, StrongConfigQ31):
        return StrongIdentifierQ31(native, config), True
    return (native.weak(config) if isinstance(config, WeakConfig) else native.strong(config)), False


def digest(library: Path, given: Samples) -> str:
    """What every identifier recorded, estimated and counted, as one number."""
    native = Native(library)
    told = hashlib.sha256()
    for config in given.configurations:
        core, counts = core_of(native, config)
        phi, y = (given.phi_counts, given.y_counts) if counts else (given.phi, given.y)
        record = core.run(phi, y)
        for name in ("p", "sums", "reason", "published"):
            if hasattr(record, name):
                told.update(np.ascontiguousarray(getattr(record, name)).tobytes())
        told.update(core.assess().tobytes())
        told.update(repr(sorted(core.counters.items())).encode())
        told.update(f"{core.running_hash}".encode())
    told.update(f"{native.arithmetic_faults()}".encode())
    return told.hexdigest()


def digest_apart(library: Path, given: Samples) -> str:
    """The digest, from a process of its own: a mutant may crash, or never end."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        devnull = os.open(os.devnull, os.O_WRONLY)
        os.dup2(devnull, 2)
        text = "failed"
        try:
            text = digest(library, given)
        finally:
            os.write(writer, text.encode())
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    return text


# ---- verdicts ----


def killed_by_unit_tests(folder: Path, mutant: Mutant) -> str | None:
    stem = Path(mutant.file).stem
    replaced = folder / "unit.o"
    source = folder / mutant.file
    if not compile_to(replaced, source, FLAGS):
        return None
    core = [str(path) for path in (BUILD / "unit").glob("*.o") if path.stem != stem]
    core += [str(path) for path in (BUILD / "unit_rest").glob("*.o")]
    for test in sorted((BUILD / "tests").glob("*.o")):
        program = folder / "test"
        command = ["gcc", "-o", str(program), str(test), *core, str(replaced), "-lcmocka", "-lm"]
        if subprocess.run(command, capture_output=True, check=False).returncode != 0:
            return test.stem
        limited = ["prlimit", f"--cpu={LONGEST}", str(program)]
        if subprocess.run(limited, capture_output=True, check=False).returncode != 0:
            return test.stem
    return None


def verdict(job: tuple[Mutant, Samples, str]) -> tuple[Mutant, str | None]:
    """What killed it, "no mutant" when it does not compile or compiles to the same code, None when it lives."""
    mutant, given, expected = job
    folder = BUILD / f"work-{os.getpid()}"
    folder.mkdir(exist_ok=True)
    source = folder / mutant.file
    source.write_text(mutant.text(), encoding="utf-8")
    stem = Path(mutant.file).stem
    replaced = folder / f"{stem}.o"
    try:
        if not compile_to(replaced, source, NATIVE):
            return mutant, "no mutant"
        original = BUILD / "native" / f"{stem}.o"
        if code_of(replaced) == code_of(original):
            return mutant, "no mutant"
        library = linked(folder / f"{hashlib.sha256(repr(mutant).encode()).hexdigest()[:16]}.so", "native", replaced)
        if digest_apart(library, given) != expected:
            return mutant, "bits"
        return mutant, killed_by_unit_tests(folder, mutant)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def code_of(path: Path) -> bytes:
    """Code and data of an object, without the name of its source."""
    stripped = path.with_suffix(".stripped")
    subprocess.run(["objcopy", "--strip-unneeded", "--remove-section=.comment", str(path), str(stripped)], check=True)
    return stripped.read_bytes()


def drawn(count: int, seed: int) -> list[Mutant]:
    everything = sorted(m for path in SOURCES.glob("*.c") for m in mutants_of(path))
    return random.Random(seed).sample(everything, min(2 * count, len(everything)))


def why(mutant: Mutant) -> str:
    """The reason that mutants.toml gives for a survivor, by its file, line and change."""
    if not REASONS.exists():
        return ""
    with REASONS.open("rb") as file:
        entries = tomllib.load(file).get("survivor", [])
    line = mutant.line()[1]
    for entry in entries:
        same = (entry["file"], entry["old"], entry["new"]) == (mutant.file, mutant.old.strip(), mutant.new.strip())
        if same and entry["line"] in line:
            return str(entry["why"])
    return ""


def page_of(results: list[tuple[Mutant, str | None]], seed: int) -> str:
    alive = [mutant for mutant, by in results if by is None]
    by_bits = sum(by == "bits" for _, by in results)
    killed = len(results) - len(alive)
    rows = []
    for mutant in sorted(alive):
        number, line = mutant.line()
        change = f"`{mutant.old.strip()}` to `{mutant.new.strip()}`"
        rows.append(f"| {mutant.file}:{number} | `{line}` | {change} | {why(mutant)} |")
    table = "\n".join(row.replace("||", "\\|\\|") for row in rows)
    return f"""<!-- Written by tools/mutate.py; the reasons are those of tests/mutants.toml. -->
# Mutation check

{len(results)} mutants of `firmware/src`, seed {seed}: {killed} killed ({100 * killed / len(results):.1f} %),
{by_bits} of them by the bits of a few seconds of data and the others by a CMocka program. The suite proper (every
build against the twin over 40 000 ticks, every field of a configuration out of range, oracles, snapshots) was not
asked. Those that lived:

| where | line | change | why |
|---|---|---|---|
{table}
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=0, help="mutants; without it 200, and the page is written")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    count = given.count or 200
    baseline()
    inputs = samples()
    expected = digest_apart(linked(BUILD / "baseline.so", "native", None), inputs)
    if expected == "failed" or expected != digest_apart(BUILD / "baseline.so", inputs):
        raise SystemExit("the core as it is does not give the same bits twice")
    results: list[tuple[Mutant, str | None]] = []
    with ProcessPoolExecutor(2) as pool:
        for mutant, by in pool.map(verdict, [(m, inputs, expected) for m in drawn(count, given.seed)], chunksize=1):
            if by == "no mutant" or len(results) == count:
                continue
            results.append((mutant, by))
            number, line = mutant.line()
            print(
                f"{by or 'LIVES':24} {mutant.file}:{number} {mutant.old.strip()} -> {mutant.new.strip()}: {line}",
                flush=True,
            )
            if len(results) == count:
                pool.shutdown(wait=False, cancel_futures=True)
                break
    killed = sum(by is not None for _, by in results)
    if not given.count:
        PAGE.write_text(page_of(results, given.seed), encoding="utf-8")
    print(f"{killed} of {len(results)} mutants killed")
    return 0 if killed >= 0.95 * len(results) else 1


if __name__ == "__main__":
    sys.exit(main())
