"""The commands `pvid bench ...`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pvid.base.console import DIFFERENT, DONE, progress_bar, write_stderr
from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.cli.page_table import UPDATE, put_table
from pvid.cli.results import DATA, put_counts, put_results
from pvid.core.native import Native
from pvid.core.sources import build_folder
from pvid.settings.enums import Core

if TYPE_CHECKING:
    from bench.recorded_rigs import Rig
    from bench.recordings import Source


@click.group()
def bench() -> None:
    """Measures what the README and the benchmark pages claim and prints it as tables."""


@bench.command(name="demo")
@UPDATE
def bench_demo(update: Path | None) -> int:
    """What the demo prints, as the README shows it."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-P", "-m", "pvid", "demo"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != DONE:
        raise PvidError(f"the demo failed: {(done.stderr or done.stdout).strip()[-300:]}")
    lines = "\n".join(line.rstrip() for line in done.stdout.rstrip().splitlines())
    put_table(update, "demo", f"```\n{lines}\n```")
    return DONE


@bench.command(name="answer")
@UPDATE
def bench_answer(update: Path | None) -> int:
    """What `model simulate` and `identify` print, as the page on mechanisms shows it."""
    from bench.mechanism_pages import printed_answer

    put_table(update, "answer", f"```text\n{printed_answer()}\n```")
    return DONE


@bench.command(name="pages")
@click.argument("names", nargs=-1)
@click.option("--docs", type=click.Path(path_type=Path, exists=True), default="host/docs", show_default=True)
def bench_pages(names: tuple[str, ...], docs: Path) -> int:
    """Writes the pages of the shipped mechanisms: description, rows, verdict, measured against simulated."""
    from bench import mechanism_pages
    from pvid.models import mechanisms

    some = names or mechanisms.names()
    with progress_bar("pages", len(some)) as advance:
        for done, name in enumerate(some, 1):
            mechanism_pages.write_page(docs, name)
            advance(done)
    mechanism_pages.write_gallery(docs)
    return DONE


@bench.command(name="figures")
def bench_figures() -> int:
    """Draws the figures of the page of benchmarks, host/docs/benchmarks.md, and writes its figures in words."""
    from bench.figures import write_page

    write_page()
    return DONE


# ---- tables of cases: a row or some for each mechanism ----

Rows = Iterable[tuple[str, ...]]
Tables = Iterable[tuple[str, tuple[str, ...], Rows]]  # marker on the page, header, rows
Advance = Callable[[], object]
Make = Callable[[tuple[str, ...], int, Advance], Tables]


@dataclass(frozen=True)
class Table:
    """A command that measures mechanisms and writes tables.

    Attributes
    ----------
    number : of runs or ticks: default, what the option `name` is called, and its help
    make : tables from the names of mechanisms, the number and what is called at each step
    usual : mechanisms, where none is named
    """

    name: str
    about: str
    make: Make
    number: tuple[int, str, str] = (20, "--seeds", "Runs of each case.")
    usual: tuple[str, ...] = ()


def _rows(module: str, *tables: tuple[str, str, str]) -> Make:
    """Tables of a module of this folder: marker, name of the header, name of the function of the rows."""

    def make(names: tuple[str, ...], number: int, advance: Advance) -> Tables:
        found = import_module(f"bench.{module}")
        return [
            (marker, getattr(found, header), getattr(found, of)(names, number, advance))
            for marker, header, of in tables
        ]

    return make


def _of_mechanisms(names: tuple[str, ...], seeds: int, advance: Advance) -> Tables:
    from bench import mechanisms

    return mechanisms.tables(names, seeds, seeds // 4, lambda _: advance())


_ONCE = (1, "--runs", "Of each image.")
TABLES = (
    Table("mechanisms", "Errors in float64 beside the Cramer-Rao bound, and of imperfect rigs.", _of_mechanisms),
    Table(
        "weak",
        "Errors of the weak form in C beside float64, and in fixed point beside float32.",
        _rows("weak", ("weak", "HEADER", "table"), ("weak-q31", "FIXED_HEADER", "fixed_table")),
    ),
    Table(
        "refine-mechanisms",
        "Both stages in C: errors beside the Cramer-Rao bound.",
        _rows(
            "refine_mechanisms",
            ("refine-mechanisms", "HEADER", "refined_rows"),
            ("refine-friction", "IMPERFECT", "friction_rows"),
        ),
    ),
    Table(
        "hard",
        "Coarse sensors, noise, little drive, no motion: what is published, and what is wrong.",
        _rows("hard", ("hard", "HEADER", "rows")),
    ),
    Table(
        "accidents",
        "Wild, lost, repeated and stuck samples, jumps, drifts: what `identify` makes of them.",
        _rows("accidents", ("accidents", "HEADER", "rows")),
        (2, "--seeds", "Runs of each case."),
        ("kapitza", "rigid_body"),
    ),
    Table(
        "longevity",
        "Millions of ticks of every disturbance, with and without forgetting.",
        _rows("longevity", ("longevity", "HEADER", "rows")),
        (1_000_000, "--ticks", "Of each run."),
    ),
    Table(
        "verify",
        "What `pvid verify` takes for a long log, of each identifier that a board streams.",
        _rows("verifying", ("verify", "HEADER", "rows")),
        (3_600_000, "--ticks", "Of each log."),
        ("kapitza", "dc_motor", "furuta", "battery_2rc"),
    ),
    Table(
        "compare-methods",
        "Weak form, strong form, output error and pysindy's weak form (needs pysindy).",
        _rows("methods", ("compare-methods", "HEADER", "rows")),
        (3, "--seeds", "Runs of each case."),
    ),
    Table(
        "strong-mechanisms",
        "The strong form on boards: its bits and the cost of a tick.",
        _rows("strong_mechanisms", ("strong-mechanisms", "HEADER", "rows")),
        _ONCE,
    ),
    Table(
        "strong-fixed",
        "The same of the strong form in fixed point.",
        _rows("strong_mechanisms", ("strong-fixed", "FIXED_HEADER", "fixed_rows")),
        _ONCE,
    ),
)


def _add_table(one: Table) -> None:
    default, option, about = one.number

    @bench.command(name=one.name, help=one.about)
    @click.option("--mechanism", "chosen", multiple=True, help="Only this one; may be given again. Default: all.")
    @click.option(option, "number", default=default, show_default=True, type=click.IntRange(min=1), help=about)
    @DATA
    def command(chosen: tuple[str, ...], number: int, data: Path | None) -> int:
        from pvid.models.mechanisms import names

        if unknown := set(chosen) - set(names()):
            raise PvidError(f"no such mechanism: {', '.join(sorted(unknown))}; there are {', '.join(names())}")
        some = chosen or one.usual or tuple(names())
        with progress_bar(one.name, None) as advance:
            done = count(1)
            made = one.make(some, number, lambda: advance(next(done)))
            tables = [(marker, header, list(rows)) for marker, header, rows in made]
        for marker, header, rows in tables:
            if rows:
                put_results(data, marker, header, rows)
        return DONE


for _table in TABLES:
    _add_table(_table)


# ---- commands of their own ----


@bench.command(name="cycles")
@click.option("--processes", default=2, show_default=True, type=click.IntRange(1, 64), help="At a time.")
@DATA
def bench_cycles(processes: int, data: Path | None) -> int:
    """Clock cycles of a tick on a real core, CV32E40P, simulated from its RTL by verilator with ideal memory."""
    from bench import cycles

    with progress_bar("images", cycles.STEPS) as advance:
        done = iter(range(1, cycles.STEPS + 1))
        rows = list(cycles.cycle_rows(processes, lambda: advance(next(done))))
    put_results(data, "cycles", cycles.HEADER, rows)
    return DIFFERENT if any(row[-1] != "equal" for row in rows) else DONE


@bench.command(name="missing")
@click.option("--clean", default=20, show_default=True, type=click.IntRange(min=1), help="Runs of each plant as it is.")
@click.option(
    "--campaign", "count", default=0, type=click.IntRange(min=0), help="A random sample of all effects alone."
)
@click.option("--seed", default=1, show_default=True, help="Of the sample.")
@DATA
def bench_missing(clean: int, count: int, seed: int, data: Path | None) -> int:
    """Models that lack something: what is warned of, what is named, and what the standard errors contain."""
    from bench import lacking

    if count:
        found = []
        with progress_bar("missing", count) as advance:
            for case in lacking.campaign(count, seed):
                found += [one for one in [lacking.told(case, seed)] if one is not None]
                advance(case.number + 1)
        put_results(data, f"missing-campaign-{seed}", lacking.CAMPAIGN, lacking.campaign_cells(found))
        return DONE
    rows = []
    with progress_bar("missing", lacking.ROWS) as advance:
        for done, row in enumerate(lacking.outcomes(clean), 1):
            rows.append(row)
            advance(done)
    put_results(data, "missing", lacking.HEADER, [row.cells() for row in rows])
    put_counts(data, "missing-sum", lacking.summary(rows))
    return DONE


@bench.command(name="cell")
@click.option("--write", "folder", type=click.Path(path_type=Path, exists=True, file_okay=False))
@DATA
def bench_cell(folder: Path | None, data: Path | None) -> int:
    """RC models on a cell that is no RC circuit; --write makes its records (needs PyBaMM)."""
    from bench import cell

    if folder is not None:
        for path in cell.write(folder):
            write_stderr(f"{path} written")
        return DONE
    put_results(data, "cell", cell.HEADER, [one.cells() for one in cell.outcomes()])
    return DONE


@bench.command(name="build-choices")
@DATA
def bench_build_choices(data: Path | None) -> int:
    """What each choice of a build of the weak form takes and gives, on the pendulum's shipped rig."""
    from bench import build_choices

    with progress_bar("builds", len(build_choices.CHOICES)) as advance:
        rows = list(build_choices.rows_of(progress=advance))
    put_results(data, "build-choices", build_choices.HEADER, rows)
    return DONE


@bench.command(name="model-boards")
@click.option(
    "--board",
    "boards",
    type=click.Choice(list(BOARDS)),
    multiple=True,
    help="May be given again; by default one board of each instruction set.",
)
@DATA
def bench_model_boards(boards: tuple[str, ...], data: Path | None) -> int:
    """The weak form of every mechanism on emulated boards, in both cores: its bits and the cost of a tick."""
    from bench import model_boards

    names = boards or model_boards.USUAL
    with progress_bar("boards", len(model_boards.rows(names))) as advance:
        rows = list(model_boards.rows_of(names, advance))
    put_results(data, "model-boards", model_boards.HEADER, rows)
    return DIFFERENT if any(row[-1] == "DIFFERENT" for row in rows) else DONE


def _verdict(faults: Sequence[str]) -> int:
    """The exit code, with a line for each fault."""
    for fault in faults:
        write_stderr(f"pvid: {fault}")
    return DIFFERENT if faults else DONE


def _cut(sources: Sequence[Source], origin: Path, folder: Path) -> int:
    """Writes the pieces of recordings."""
    from bench import recordings

    for source in sources:
        for path in recordings.write_source(source, origin, folder):
            write_stderr(f"{path} written")
    return DONE


def _put_rigs(rigs: Sequence[Rig], data: Path | None, prefix: str = "") -> None:
    """The tables of recorded rigs."""
    from bench import recorded_rigs

    for name, header, rows_of in (
        ("recordings", recorded_rigs.HEADER, recorded_rigs.value_rows),
        ("predictions", recorded_rigs.PREDICTIONS, recorded_rigs.prediction_rows),
        ("verdicts", recorded_rigs.VERDICTS, recorded_rigs.verdict_rows),
    ):
        put_results(data, prefix + name, header, [row for rig in rigs for row in rows_of(rig)])


@bench.command(name="kept-recordings")
@click.option("--cut", "archives", type=click.Path(path_type=Path, exists=True, file_okay=False))
@DATA
def bench_kept_recordings(archives: Path | None, data: Path | None) -> int:
    """Likewise, the real rigs whose recordings are in tests/data/recordings.

    --cut writes the pieces anew from the unpacked archives ARCHIVES/NAME-VERSION of the packages that hold them.
    """
    from bench import kept_recordings, recorded_rigs, recordings

    if archives is not None:
        return _cut(kept_recordings.KEPT, archives, recordings.MECHANISMS)
    rigs = list(recorded_rigs.rigs(recordings.MECHANISMS, kept_recordings.KEPT))
    _put_rigs(rigs, data, "kept-")
    faults = [fault for rig in rigs for fault in recorded_rigs.missed(rig)]
    return _verdict(faults)


@bench.command(name="recordings")
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--cut", "checkouts", type=click.Path(path_type=Path, exists=True, file_okay=False))
@DATA
def bench_recordings(folder: Path, checkouts: Path | None, data: Path | None) -> int:
    """Real rigs that others recorded: identified from one run, another one predicted, beside the published values.

    FOLDER holds the pieces; --cut writes them there from checkouts of the repositories that hold the recordings.
    """
    from bench import recorded_rigs, recordings

    if checkouts is not None:
        return _cut(recordings.SOURCES, checkouts, folder)
    rigs = list(recorded_rigs.rigs(folder))
    _put_rigs(rigs, data)
    traps = [row for rig in rigs for row in recorded_rigs.trap_rows(rig.source, folder)]
    put_results(data, "traps", recorded_rigs.TRAPS, traps)
    faults = [fault for rig in rigs for fault in recorded_rigs.missed(rig)]
    faults += [
        f"{row[0]}: the run {row[1]} does not raise its alarm" for row in traps if row[1] not in row[2].split(", ")
    ]
    return _verdict(faults)


@bench.command(name="reading")
@DATA
def bench_reading(data: Path | None) -> int:
    """Processor time and memory of reading runs of ten minutes at 1 kHz and of 10^7 samples."""
    from bench import reading

    put_results(data, "reading", reading.HEADER, list(reading.reading_table()))
    return DONE


@bench.command(name="fuzz-link")
@click.option("--runs", default=10_000_000, show_default=True, type=click.IntRange(min=1))
@DATA
def bench_fuzz_link(runs: int, data: Path | None) -> int:
    """The C side of the serial link under libFuzzer, with sanitizers (needs clang)."""
    from bench.fuzz import fuzz_link

    folder = Path(tempfile.mkdtemp(prefix="pvid-fuzz-"))
    put_counts(data, "fuzz-link", (("inputs", fuzz_link(folder, runs)), ("failures", 0)))
    return DONE


@bench.command(name="fuzz-api")
@click.option("--calls", default=10_000_000, show_default=True)
@click.option("--seed", default=1, show_default=True)
@DATA
def bench_fuzz_api(calls: int, seed: int, data: Path | None) -> int:
    """Random calls of the C core's public API, with sanitizers (needs clang)."""
    from bench.fuzz import fuzz_api

    with tempfile.TemporaryDirectory(prefix="pvid-fuzz-") as folder:
        put_counts(data, "fuzz-api", fuzz_api(Path(folder), calls, seed).counts)
    return DONE


@bench.command(name="codec")
@click.option("--frames", default=1_000_000, show_default=True, type=click.IntRange(min=1))
@DATA
def bench_codec(frames: int, data: Path | None) -> int:
    """Corrupted frames of every length against both decoders of the serial link."""
    from bench.codec import corrupt

    with progress_bar("corrupted frames", frames) as advance:
        tally = corrupt(frames, Native(), progress=advance)
    counts = (
        ("corrupted frames", tally.frames),
        ("accepted with wrong content", tally.wrong),
        ("first good frame behind lost", tally.lost_first),
        ("second good frame behind lost", tally.lost_second),
    )
    put_counts(data, "codec", counts)
    return DIFFERENT if tally.wrong or tally.lost_second else DONE


@bench.command(name="log")
@click.option("--frames", default=200_000, show_default=True, type=click.IntRange(min=1000))
@DATA
def bench_log(frames: int, data: Path | None) -> int:
    """Frames a minute of processor time through `pvid log`, losses, memory."""
    from bench.field import throughput

    seen = throughput(frames)
    counts = (
        ("frames of 16 samples", seen.frames),
        ("lost", seen.lost),
        ("frames in a minute of processor time", round(60 * seen.frames / seen.cpu_s)),
        ("resident memory after a quarter, kB", seen.early_kb),
        ("at the end, kB", seen.late_kb),
    )
    put_counts(data, "log", counts)
    return DONE if seen.frames == frames and not seen.lost else DIFFERENT


@bench.command(name="liar")
@DATA
@click.option("--mutants", default=100_000, show_default=True, help="Frames changed at random.")
@click.option("--only", metavar="BEHAVIOUR", multiple=True, help="A behaviour named in the table; repeatable.")
def bench_liar(data: Path | None, mutants: int, only: tuple[str, ...]) -> int:
    """A board that sends false data, against `pvid log` and all readers of its logs; then mutants of frames."""
    from bench import liar
    from bench.liar_mutants import mutate
    from bench.lies import BEHAVIOURS

    if unknown := [name for name in only if name not in BEHAVIOURS]:
        raise PvidError(f"there is no behaviour {', '.join(unknown)}")
    chosen = [BEHAVIOURS[name] for name in only] or list(BEHAVIOURS.values())
    performances = []
    with tempfile.TemporaryDirectory() as folder:
        with progress_bar("lies", len(chosen)) as advance:
            for behaviour in chosen:
                performances.append(one := liar.perform(behaviour, Path(folder)))
                for fault in one.faults:
                    click.echo(f"{behaviour.name}: {fault}", err=True)
                advance(len(performances))
        with progress_bar("mutants", mutants) as advance:
            tally = mutate(mutants, Path(folder), progress=advance)
    for fault in tally.faults:
        click.echo(fault, err=True)
    faults = sum(len(one.faults) for one in performances)
    counts = (
        ("behaviours", len(performances)),
        ("runs of a command", sum(len(one.codes) for one in performances)),
        ("mutants of frames", tally.mutants),
        ("defects", faults + len(tally.faults)),
        ("largest memory of the logger, kB", max(one.peak_kb for one in performances)),
        ("latest end of the logger, ms", round(1000 * max(one.late_s for one in performances))),
    )
    put_counts(data, "liar", counts)
    return DIFFERENT if faults or tally.faults else DONE


@bench.command(name="attack")
@click.option("--mutants", default=33_400, show_default=True, type=click.IntRange(min=1), help="Of each kind.")
@click.option("--seed", default=1, show_default=True, help="Of the mutants.")
@click.option("--only", type=click.Choice(["rigs", "runs", "commands"]), multiple=True, help="May be given again.")
@click.option("--processes", default=2, show_default=True, type=click.IntRange(1, 64), help="At a time.")
@click.option("--keep", type=click.Path(path_type=Path, file_okay=False), help="Folder for files that caused a defect.")
@click.option(
    "--done",
    type=click.Path(path_type=Path, dir_okay=False),
    help="File of finished chunks: a run that was stopped continues behind them.",
)
@DATA
def bench_attack(
    mutants: int,
    seed: int,
    only: tuple[str, ...],
    processes: int,
    keep: Path | None,
    done: Path | None,
    data: Path | None,
) -> int:
    """Runs mutated rig files, runs and command lines, and counts defects."""
    from bench.attack import HEADER, KINDS, campaign

    kinds = only or KINDS
    with progress_bar("mutants", mutants * len(kinds)) as advance:
        tallies = campaign(kinds, mutants, seed, processes, advance, keep and keep.resolve(), done)
    for tally in tallies:
        for arguments, wrong, number in tally.defects:
            write_stderr(f"{tally.kind}, mutant {number}: {' '.join(arguments)}: {wrong}")
    put_results(data, "attack", HEADER, [tally.cells for tally in tallies])
    return DIFFERENT if any(tally.defects for tally in tallies) else DONE


@bench.command(name="field-log")
@click.option("--on", "target", default="mps2-an386", show_default=True, help="Emulator, or stream-host.")
@click.option(
    "--samples", default=3_600_000, show_default=True, type=click.IntRange(min=10_000), help="An hour at 1 kHz."
)
@click.option("--out", type=click.Path(path_type=Path), default=Path("field-log.pvlog"), show_default=True)
@DATA
def bench_field_log(target: str, samples: int, out: Path, data: Path | None) -> int:
    """An hour in the field, shortened in time: the board killed twice, its line closed once, every segment verified."""
    from bench.field import field_log
    from pvid.log.verify import Verdict

    with progress_bar("verifying", samples) as advance:
        account, stretches = field_log(target, samples, out, advance)
    verdict = Verdict()
    for stretch in stretches:
        click.echo(stretch.text)
        verdict.add(stretch)
    click.echo(verdict.text)
    click.echo(account.text)
    counts = (
        ("samples recorded", account.samples),
        ("missing between them", account.missing_samples),
        ("taken while the line was closed", account.unheard),
        ("estimates and hashes compared", verdict.checked),
        ("different", verdict.different),
    )
    put_counts(data, "field-log", counts)
    whole = len(verdict.good) == len(account.segments) and not verdict.different and not account.missing_samples
    return DONE if whole else DIFFERENT


@bench.command(name="year")
@click.option("--on", "target", default="mps2-an386", show_default=True, help="Emulator, or stream-host.")
@click.option("--core", default="f32", show_default=True, type=click.Choice(["f32", "q31"]))
@click.option("--samples", default=20_000, show_default=True, help="At each passage.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("year.pvlog"), show_default=True)
@DATA
def bench_year(target: str, core: Core, samples: int, out: Path, data: Path | None) -> int:
    """A year at 1 kHz, by a tick counter started before each passage of 2^32: log, verify, exports, plot, page."""
    from bench.year import emulated_year, passages_of_a_year
    from pvid.rig.mechanism_file import MechanismRig

    if out.exists():
        raise PvidError(f"{out} exists")
    rig = MechanismRig("kapitza", 1000.0, known={"l1": 0.3})
    passages = tuple(range(1, 1 + passages_of_a_year(1000.0)))
    with progress_bar("verifying", None) as advance:
        year = emulated_year(target, passages, samples, out, rig, core, advance)
    click.echo(year.verdict.text)
    click.echo(year.account.text)
    for sentence in year.faults:
        click.echo(f"pvid: {sentence}", err=True)
    counts = (
        ("passages of 2^32 ticks", year.passages),
        ("samples verified", year.verdict.verified),
        ("faults", len(year.faults)),
    )
    put_counts(data, f"year-{core}", counts)
    return DIFFERENT if year.faults or not year.verdict.verified else DONE


@bench.command(name="long")
@DATA
@click.option("--only", metavar="ROOM", multiple=True, help="A folder of tests/; repeatable.")
def bench_long(data: Path | None, only: tuple[str, ...]) -> int:
    """The long forms of the tests: 40 000 ticks, every build and board, mutants (an hour)."""
    from bench import long

    rows = long.long_table(only)
    put_results(data, "long", long.HEADER, rows)
    return DONE if all(row[-1] == "passed" for row in rows) else DIFFERENT


@bench.command(name="random-models")
@DATA
@click.option("--count", default=2000, show_default=True, type=click.IntRange(min=1), help="Of rigs.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Of the first rig.")
@click.option("--resume", is_flag=True, help="Go on behind the rigs of an earlier run of this seed on this code.")
def bench_random_models(data: Path | None, count: int, seed: int, resume: bool) -> int:
    """Random rigs the whole road: check, identify in float64 and in C, refine, build, compile, equal bits; and
    descriptions without sense, of which each is a report or one sentence."""
    from bench import random_models, senseless_models

    kept = build_folder() / f"random-models-{seed}.jsonl"
    if not resume:
        kept.unlink(missing_ok=True)
    with progress_bar("rigs", count) as advance:
        found = random_models.roads(range(seed, seed + count), kept, advance)
    put_results(data, "random-models", random_models.HEADER, random_models.table_of(found))
    put_results(data, "compile-times", random_models.COMPILE_HEADER, random_models.compile_times())
    senseless = senseless_models.run(range(seed, seed + 2 * count))
    put_results(data, "senseless-models", senseless_models.HEADER, [senseless.row()])
    failures = [f"rig {one.seed} ({one.kind}): {failure}" for one in found for failure in one.failures]
    failures += [f"description {number}: {error}" for number, error in senseless.tracebacks]
    return _verdict(failures)
