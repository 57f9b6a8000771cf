"""Mutated rig files, runs and command lines against the command line, in this process: what breaks it.

Whatever a user gives, a command ends with one of its exit codes; a refusal is a sentence that begins with "pvid: "; no
exception escapes, no library warns, no answer contains nan or inf, and nothing takes long or much memory.
All is drawn from a seed.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import multiprocessing
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType

from bench.attack_commands import command_line
from bench.attack_files import distorted_run, mutated_run, rig_text, written_runs
from pvid.base.console import BAD_INPUT, DIFFERENT, DONE, NOTHING_IDENTIFIED
from pvid.cli import main as cli
from pvid.rig.file import RigFile
from pvid.rig.run import Run, write_run
from pvid.sim.pendulum import simulate

KINDS = ("rigs", "runs", "commands")
HEADER = (
    "attacked with",
    "mutants",
    "seed",
    "answered",
    "nothing identified",
    "refused",
    "defects",
    "longest, s of processor",
)

LONGEST_S = 60  # of processor time, of one command: the run is a few seconds long
_ASLEEP_S = 900  # of one command that does nothing
_CHUNK = 1000  # mutants that are drawn one behind the other, by one process
_MEMORY = 6 << 30  # of the process [bytes]
_NO_NUMBER = re.compile(r"\b(nan|inf|NaN|Infinity)\b")
_RUN_S, _RATE_HZ = 5.0, 400.0


@dataclass(frozen=True)
class Outcome:
    """What a command did: `code` is None where an exception escaped, which `trace` holds."""

    code: int | None
    out: str
    err: str
    warned: tuple[str, ...]
    trace: str
    lasted_s: float


@dataclass
class Tally:
    """Of the mutants of a kind; a defect is the command, what it did wrong, and the mutant's number."""

    kind: str
    seed: int
    tried: int = 0
    codes: Counter[int | None] = field(default_factory=Counter)
    defects: list[tuple[list[str], str, int]] = field(default_factory=list)
    longest_s: float = 0.0
    slowest: tuple[int, list[str]] = (0, [])

    def add(self, other: Tally) -> None:
        """Takes the mutants of another tally in."""
        self.tried += other.tried
        self.codes += other.codes
        self.defects += other.defects
        if other.longest_s > self.longest_s:
            self.longest_s, self.slowest = other.longest_s, other.slowest

    @property
    def cells(self) -> tuple[str, ...]:
        """In the order of HEADER."""
        told = {"rigs": "rig files", "runs": "runs", "commands": "command lines"}[self.kind]
        counts = (self.codes[DONE] + self.codes[DIFFERENT], self.codes[NOTHING_IDENTIFIED], self.codes[BAD_INPUT])
        return (
            told,
            str(self.tried),
            str(self.seed),
            *map(str, counts),
            str(len(self.defects)),
            f"{self.longest_s:.1f}",
        )


class _Late(BaseException):
    """A command has not ended in time."""


def call(arguments: Sequence[str | Path]) -> Outcome:
    """Runs a command in this process, as `pvid` would in one of its own."""

    def late(signum: int, frame: FrameType | None) -> None:
        raise _Late

    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", errors="backslashreplace") for _ in range(2))
    code: int | None = None
    trace = ""
    before = sys.argv
    handlers = {number: signal.signal(number, late) for number in (signal.SIGALRM, signal.SIGPROF)}
    begun = time.process_time()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            sys.argv = ["pvid", *map(str, arguments)]
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                signal.alarm(_ASLEEP_S)
                signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
                cli.main()
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else DONE
        except _Late:
            trace = f"no end after {LONGEST_S} s"
        except BaseException:  # whatever escapes is what is looked for
            trace = traceback.format_exc()
        finally:
            signal.alarm(0)
            signal.setitimer(signal.ITIMER_PROF, 0)
            for number, handler in handlers.items():
                signal.signal(number, handler)
            sys.argv = before
    lasted = time.process_time() - begun
    return Outcome(code, _text(out), _text(err), tuple(str(one.message) for one in warned), trace, lasted)


def _text(stream: io.TextIOWrapper) -> str:
    stream.seek(0)
    return stream.read()


def complaint(outcome: Outcome) -> str | None:
    """What is wrong with an outcome; None: nothing."""
    if outcome.code is None:
        return outcome.trace.strip().splitlines()[-1]
    if outcome.warned:
        return f"warning: {outcome.warned[0]}"
    if outcome.code not in (DONE, DIFFERENT, BAD_INPUT, NOTHING_IDENTIFIED):
        return f"exit code {outcome.code}"
    lines = outcome.err.splitlines()
    if outcome.code == BAD_INPUT and not (lines and lines[-1].startswith("pvid: ")):
        return f"a refusal without its sentence: {outcome.err[-200:]!r}"
    if outcome.code == DONE and _NO_NUMBER.search(outcome.out):
        return f"no number: {outcome.out[-200:]!r}"
    return None


def campaign(
    kinds: Sequence[str],
    mutants: int,
    seed: int,
    processes: int,
    progress: Callable[[int], None] | None = None,
    keep: Path | None = None,
    done: Path | None = None,
) -> list[Tally]:
    """Tries `mutants` of each kind, in chunks, in several processes; a tally of each kind.

    Parameters
    ----------
    done
        File of finished chunks, a line each: those in it are counted and left out, the others are added.
    """
    tallies = {kind: Tally(kind, seed) for kind in kinds}
    chunks: list[Chunk] = [
        (kind, min(_CHUNK, mutants - first), seed, first) for first in range(0, mutants, _CHUNK) for kind in kinds
    ]
    known = {} if done is None else _finished(done)
    for chunk in chunks:
        if chunk in known:
            tallies[chunk[0]].add(known[chunk])
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # matrices of a few rows: more threads only wait for one another
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context, max_tasks_per_child=1) as pool:
        running = {pool.submit(_chunk, *chunk, keep): chunk for chunk in chunks if chunk not in known}
        for one in as_completed(running):
            tally = one.result()
            tallies[tally.kind].add(tally)
            if done is not None:
                _append_finished(done, running[one], tally)
            if progress is not None:
                progress(sum(each.tried for each in tallies.values()))
    return list(tallies.values())


Chunk = tuple[str, int, int, int]  # kind, mutants, seed, number of the first


def _finished(path: Path) -> dict[Chunk, Tally]:
    """Tallies of the chunks in a file; none without it."""
    found = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        kind, mutants, seed, first, codes, defects, longest_s, slowest = json.loads(line)
        found[kind, mutants, seed, first] = Tally(
            kind, seed, mutants, Counter(dict(codes)), [tuple(one) for one in defects], longest_s, tuple(slowest)
        )
    return found


def _append_finished(path: Path, chunk: Chunk, tally: Tally) -> None:
    with path.open("a") as file:
        line = [*chunk, list(tally.codes.items()), tally.defects, tally.longest_s, tally.slowest]
        file.write(json.dumps(line) + "\n")


def _chunk(kind: str, mutants: int, seed: int, first: int, keep: Path | None) -> Tally:
    with tempfile.TemporaryDirectory(prefix="pvid-attack-") as folder:
        return attack(kind, mutants, seed, Path(folder), first, keep)


def attack(kind: str, mutants: int, seed: int, folder: Path, first: int = 0, keep: Path | None = None) -> Tally:
    """Tries mutants of a kind in a folder, in this process.

    Parameters
    ----------
    kind
        One of KINDS.
    folder
        Empty, and written to at will.
    first
        Number of the first mutant: others are drawn with another one.
    keep
        Where files that broke something go; they are dropped otherwise.
    """
    draw = random.Random(f"{kind} {seed} {first}")
    tally = Tally(kind, seed)
    with _at_most(_MEMORY), contextlib.chdir(folder):
        run = simulate(duration=_RUN_S, sample_rate=_RATE_HZ, seed=seed).run
        write_run("run.csv", run)
        replace(RigFile.standard(), sample_rate=_RATE_HZ).write("run.toml")
        next_one = {"rigs": _rigs, "runs": _runs, "commands": _commands}[kind]
        for number, (arguments, mutant) in enumerate(itertools.islice(next_one(draw, run), mutants), first):
            outcome = call(arguments)
            tally.tried += 1
            tally.codes[outcome.code] += 1
            if outcome.lasted_s > tally.longest_s:
                tally.longest_s, tally.slowest = outcome.lasted_s, (number, arguments)
            wrong = complaint(outcome)
            if wrong is not None:
                tally.defects.append((arguments, wrong, number))
                if mutant is not None and keep is not None:
                    keep.mkdir(parents=True, exist_ok=True)
                    (keep / f"{kind}-{seed}-{number}{mutant.suffix}").write_bytes(mutant.read_bytes())
    return tally


_Mutants = Iterator[tuple[list[str], Path | None]]


def _rigs(draw: random.Random, run: Run) -> _Mutants:
    """Command and rig file."""
    rig = Path("rig.toml")
    commands = (
        ["design", "--rig", "rig.toml", "--duration", "4"],
        ["tables", "--rig", "rig.toml"],
        ["tables", "--core", "q31", "--rig", "rig.toml"],
        ["tables", "--form", "strong", "--rig", "rig.toml"],
        ["identify", "run.csv", "--rig", "rig.toml"],
        ["identify", "run.csv", "--rig", "rig.toml", "--json"],
        ["identify", "run.csv", "--rig", "rig.toml", "--core", "q31"],
        ["identify", "run.csv", "--rig", "rig.toml", "--form", "strong"],
    )
    while True:
        rig.write_bytes(rig_text(draw))
        yield list(draw.choice(commands)), rig


def _runs(draw: random.Random, run: Run) -> _Mutants:
    """Command and run."""
    originals = written_runs(run, Path())
    while True:
        if draw.random() < 0.5:
            mutant = Path("mutant.csv")
            mutant.write_bytes(distorted_run(run, draw))
        else:
            suffix = draw.choice(list(originals))
            mutant = Path(f"mutant{suffix}")
            mutant.write_bytes(mutated_run(originals[suffix], draw))
        yield ["identify", str(mutant), "--rig", "run.toml", "--json"], mutant


def _commands(draw: random.Random, run: Run) -> _Mutants:
    """Command lines, none twice; what they wrote is removed."""
    keep, drawn = {"run.csv", "run.toml"}, set()
    while True:
        line = command_line(draw)
        if tuple(line) in drawn:
            continue
        drawn.add(tuple(line))
        yield line, None
        for path in Path().iterdir():
            if path.name not in keep and path.is_file():
                path.unlink()


@contextlib.contextmanager
def _at_most(memory: int) -> Iterator[None]:
    """Bounds the memory of this process [bytes] for the context."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (memory, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
