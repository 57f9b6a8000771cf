"""Where the instructions of a tick go: every executed one counted in the emulator, by function of the source."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

from pvid.base.errors import PvidError
from pvid.board.boards import BUILD, Board, one_at_a_time, prepare_emulator
from pvid.board.refined_image import build_refined_image
from pvid.board.replay_image import BLOCK, ReplayReport, parse_report
from pvid.board.sizes import STANDARD, refined_replay
from pvid.board.strong_image import build_image, measured_from, standard_run
from pvid.board.weak_image import weak_image
from pvid.core.sources import ROOT
from pvid.settings.enums import Core, Form
from pvid.settings.forms import FORMS

TIMEOUT_S = 300.0
PLUGIN = BUILD / "qemu_profile.so"
LEAST_SHARE = 0.01  # of a tick: functions below it stand in one line together

HEADER = ("form", "function", "file", "instructions", "%")


@dataclass(frozen=True)
class Profile:
    """Instructions a tick, mean over the run, of each function, by (name, source file); and the mean that the image
    itself measured, which has the call in it."""

    functions: dict[tuple[str, str], float]
    measured: float

    @property
    def total(self) -> float:
        """Of all functions."""
        return sum(self.functions.values())


@dataclass(frozen=True)
class _Symbol:
    start: int
    size: int
    name: str
    file: str


def _symbols(board: Board, image: Path) -> list[_Symbol]:
    """Functions of an image by address."""
    command = [f"{board.tool_prefix}nm", "--line-numbers", "--print-size", "--defined-only", str(image)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    entry = re.compile(r"^([0-9a-f]+) ([0-9a-f]+) [tTwW] (\S+)(?:\t(\S+):\d+)?$", re.MULTILINE)
    return sorted(
        (
            _Symbol(int(start, 16), int(size, 16), name, Path(file or "compiler").name)
            for start, size, name, file in entry.findall(listing)
        ),
        key=lambda symbol: symbol.start,
    )


def _build_plugin() -> None:
    source = ROOT / "host" / "native" / "qemu_profile.c"
    if not source.is_file():
        raise PvidError("the instructions of functions are counted in a copy of pvid's repository, not in a package")
    with one_at_a_time(PLUGIN):
        if PLUGIN.exists() and PLUGIN.stat().st_mtime >= source.stat().st_mtime:
            return
        fresh = PLUGIN.with_suffix(".new")
        command = ["gcc", "-std=gnu99", "-O2", "-Wall", "-Wextra", "-fPIC", "-shared", str(source), "-o", str(fresh)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise PvidError(f"the profiling plugin did not build: {done.stderr.strip()[:200]}")
        fresh.replace(PLUGIN)


def _named(symbols: list[_Symbol], name: str) -> _Symbol:
    for symbol in symbols:
        if symbol.name == name:
            return symbol
    raise PvidError(f"the image has no function {name}")


def profile(board: Board, form: Form, core: Core = "f32", model: str = STANDARD) -> Profile:
    """Plays the replay image of the standard run, or in the weak form that of a shipped mechanism, and counts.

    Raises PvidError when the board's emulator is not QEMU or takes no plugins, something does not build, or the image
    fails.
    """
    if board.toolchain == "avr":
        raise PvidError(f"{board.name}: only QEMU counts by function")
    return _counted(board, *_PLAYED[form](board, core, model))


def refined(board: Board) -> Profile:
    """Of both stages of the standard mechanism, the ticks behind the first estimate of the second one.

    Raises PvidError as `profile`.
    """
    run = refined_replay(board)
    return _counted(board, build_refined_image(board, run)[0], "pvid_weak_step_f32", run.weak.measure_from)


def in_blocks(board: Board) -> Profile:
    """Of the weak form of the standard mechanism in float32 with its samples in blocks.

    Raises PvidError as `profile`.
    """
    made = weak_image(board, STANDARD, "f32", blocks=True)
    found = _counted(board, made.image, "pvid_weak_step_block_f32", made.measure_from // BLOCK)
    return replace(found, functions={name: n / BLOCK for name, n in found.functions.items()})


def _strong(board: Board, core: Core, model: str) -> tuple[Path, str, int]:
    """Image, the function that is counted, the first tick that counts."""
    design = standard_run(model)
    step = f"{design.strong.functions.name}_step_f32"
    return build_image(board, design)[0], step, measured_from(len(design.samples), design.config.window)


def _weak(board: Board, core: Core, model: str) -> tuple[Path, str, int]:
    made = weak_image(board, model, core)
    return made.image, f"pvid_weak_step_{core}", made.measure_from


_PLAYED = dict(zip(FORMS, (_weak, _strong), strict=True))


@dataclass(frozen=True)
class Counts:
    """What the plugin counted of an image's calls of a function, and what the image reported.

    Attributes
    ----------
    calls, longest : their number, and the instructions of the longest
    enters : (place of an instruction, function that began behind it)
    all, most : by place of an instruction, how often it was executed, and at most in one call of its function
    report : of the image
    """

    calls: int
    longest: int
    enters: frozenset[tuple[int, int]]
    all: dict[int, int]
    most: dict[int, int]
    report: ReplayReport

    @classmethod
    def of(cls, text: str, report: ReplayReport) -> Counts:
        """From the plugin's file."""
        rows = [line.split() for line in text.splitlines()]
        numbers = {row[0]: int(row[1]) for row in rows[:2]}
        enters = frozenset((int(row[1], 16), int(row[2], 16)) for row in rows[2:] if row[0] == "enters")
        counts = [(int(row[0], 16), int(row[1]), int(row[2])) for row in rows[2:] if row[0] != "enters"]
        every, most = {at: n for at, n, _ in counts}, {at: n for at, _, n in counts}
        return cls(numbers["calls"], numbers["longest"], enters, every, most, report)


def _counted(board: Board, image: Path, entry: str, measure_from: int) -> Profile:
    found = counted(board, image, entry, measure_from)
    return Profile(_by_function(found, _symbols(board, image)), found.report.instructions_mean)


def counted(board: Board, image: Path, entry: str, measure_from: int = 0) -> Counts:
    """Plays a replay image and counts the instructions of the calls of `entry`, from that of tick `measure_from` on.

    Raises PvidError as `profile`.
    """
    prepare_emulator(board)
    _build_plugin()
    symbols = _symbols(board, image)
    main = _named(symbols, "main")
    base = symbols[0].start
    with tempfile.TemporaryDirectory() as folder:
        out, functions = Path(folder) / "counts", Path(folder) / "functions"
        functions.write_text("\n".join(f"{one.start:x}" for one in symbols), encoding="ascii")
        settings = {
            "entry": _named(symbols, entry).start,
            "skip": measure_from,
            "caller": main.start,
            "caller_end": main.start + main.size,
            "base": base,
            "bytes": symbols[-1].start + symbols[-1].size - base,
            "functions": functions,
            "out": out,
        }
        plugin = ",".join([str(PLUGIN), *(f"{name}={value}" for name, value in settings.items())])
        command = [*board.command(image), "-plugin", plugin]
        try:
            done = subprocess.run(
                command, stdin=subprocess.DEVNULL, capture_output=True, timeout=TIMEOUT_S, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise PvidError(f"{board.name}: no end after {TIMEOUT_S:g} s") from error
        if not out.exists():
            said = done.stderr.decode("utf-8", "replace").strip().splitlines()
            raise PvidError(f"{board.emulator} did not count: {said[-1] if said else 'it takes no plugins'}")
        counts = out.read_text(encoding="ascii")
    return Counts.of(counts, parse_report(done.stdout.decode("ascii", "replace").replace("\r", "")))


def _by_function(found: Counts, symbols: list[_Symbol]) -> dict[tuple[str, str], float]:
    total: Counter[tuple[str, str]] = Counter()
    remaining = iter(symbols)
    symbol = next(remaining)
    for address, count in found.all.items():  # by address, as the symbols are
        while address >= symbol.start + symbol.size:
            symbol = next(remaining)
        total[symbol.name, symbol.file] += count
    return {function: count / found.calls for function, count in total.most_common()}


def table_rows(profiles: dict[str, Profile]) -> list[tuple[str, ...]]:
    """Cells of the table, as in HEADER, from profiles by form; each form's last line is what was measured."""
    rows: list[tuple[str, ...]] = []
    for form, one in profiles.items():
        shown = {function: n for function, n in one.functions.items() if n >= LEAST_SHARE * one.measured}
        lines = [(f"`{name}`", f"`{file}`", n) for (name, file), n in shown.items()]
        if len(shown) < len(one.functions):
            lines.append((f"{len(one.functions) - len(shown)} others", "", one.total - sum(shown.values())))
        lines.append(("the call", "`main.c`", one.measured - one.total))
        lines.append(("**all**", "", one.measured))
        rows += [(form, name, file, f"{n:.0f}", f"{100 * n / one.measured:.0f}") for name, file, n in lines]
    return rows
