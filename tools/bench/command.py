"""The commands `pvid bench ...`: the registry of what is measured, and one runner of it."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import click

from bench.case import DIFFERS, Case, Frozen, option
from pvid.base.console import DIFFERENT, DONE, progress_bar, write_stderr
from pvid.board.boards import BOARDS
from pvid.cli.page_table import UPDATE, put_table
from pvid.cli.results import DATA, put_results


@click.group()
def bench() -> None:
    """Measures what the README and the benchmark pages claim and prints it as tables."""


def _number(name: str, default: int, about: str = "Runs of each case.") -> tuple[click.Option, ...]:
    of_mechanism = click.Option(["--mechanism"], multiple=True, help="Only this one; may be given again. Default: all.")
    return of_mechanism, option([name, "number"], default, about)


_SEEDS, _ONCE = _number("--seeds", 20), _number("--runs", 1, "Of each image.")
_ACCURACY = ("mechanisms", "mechanisms-chosen", "mechanisms-summary", "mechanisms-two-windows", "imperfections")

CASES = (
    Case(
        "mechanisms",
        "Errors in float64 beside the Cramer-Rao bound, and of imperfect rigs.",
        "mechanisms",
        _ACCURACY,
        _SEEDS,
    ),
    Case(
        "weak",
        "Errors of the weak form in C beside float64, and in fixed point beside float32.",
        "weak",
        options=_SEEDS,
        rows=(
            ("weak", "HEADER", "table"),
            ("weak-q31", "FIXED_HEADER", "fixed_table"),
        ),
    ),
    Case(
        "refine-mechanisms",
        "Both stages in C: errors beside the Cramer-Rao bound.",
        "refine_mechanisms",
        options=_SEEDS,
        rows=(
            ("refine-mechanisms", "HEADER", "refined_rows"),
            ("refine-friction", "IMPERFECT", "friction_rows"),
        ),
    ),
    Case(
        "hard",
        "Coarse sensors, noise, little drive, no motion: what is published, and what is wrong.",
        "hard",
        options=_SEEDS,
        rows=(("hard", "HEADER", "rows"),),
    ),
    Case(
        "standing",
        "Whether published estimates still hold: imperfect motors, clean runs, sensors stuck or unplugged.",
        "standing",
        ("standing-imperfections", "standing-clean", "standing-accidents"),
        (*_SEEDS, option("--seconds", 20, "Of a run."), option("--longest", 120, "Longest accident [s].")),
    ),
    Case(
        "longevity",
        "Millions of ticks of every disturbance, with and without forgetting.",
        "longevity",
        options=_number("--ticks", 1_000_000, "Of each run."),
        rows=(("longevity", "HEADER", "rows"),),
    ),
    Case(
        "missing",
        "Models that lack something: what is warned of, what is named, and what the standard errors contain.",
        "lacking",
        ("missing", "missing-sum", "missing-campaign"),
        (
            option("--clean", 20, "Runs of each plant as it is."),
            option(["--campaign", "count"], 0, "A random sample of all effects alone.", least=0),
            option("--seed", 1, "Of the sample."),
        ),
    ),
    Case(
        "model-boards",
        "The weak form of every mechanism on emulated boards, in both cores: its bits and the cost of a tick.",
        "model_boards",
        ("model-boards",),
        (
            click.Option(
                ["--board"],
                type=click.Choice(list(BOARDS)),
                multiple=True,
                help="Default: one of each instruction set.",
            ),
        ),
    ),
    Case(
        "ticks",
        "The longest tick of mechanisms on a Cortex-M4F: by a search with spoilt samples, and bounded by the code.",
        "ticks",
        ("ticks",),
        (click.Option(["--mechanism"], multiple=True, help="Only this one; may be given again. Default: all."),),
    ),
    Case(
        "robots",
        "Arms of public URDF files with other inertias, moved by MuJoCo: errors beside the Cramer-Rao bound.",
        "robots",
        ("robots",),
        (option("--seeds", 20, "Recordings of each."), click.Option(["--robot"], multiple=True, help="Default: all.")),
    ),
    Case(
        "robot-motion",
        "Motions of robots: none beyond random limits, and errors beside those of a multisine of three times the time.",
        "robot_motion",
        ("robot-limits", "robot-motion"),
        (
            option("--draws", 10_000, "Of limits."),
            option("--turns", 2, "Iterations of the search within them.", least=0),
            option("--seeds", 20, "Recordings of each motion."),
            click.Option(["--joints"], multiple=True, type=click.IntRange(2, 7), default=(3, 6), help="Of the arms."),
        ),
    ),
    Case(
        "fuzz-link",
        "The C side of the serial link under libFuzzer, with sanitizers (needs clang).",
        "fuzz:link_report",
        ("fuzz-link",),
        (option("--runs", 10_000_000),),
    ),
    Case(
        "fuzz-api",
        "Random calls of the C core's public API, with sanitizers (needs clang).",
        "fuzz:api_report",
        ("fuzz-api",),
        (option("--calls", 10_000_000), option("--seed", 1)),
    ),
)

# Measured once: the tables stay, the code is in the history, at the commit in their heads.
FROZEN = (
    Frozen(
        "accidents",
        "Wild, lost, repeated and stuck samples, jumps, drifts: what `identify` makes of them.",
        ("accidents",),
        "tests/identification/test_wild_samples.py tests/cli/test_run_input.py tests/oracle/test_samples.py",
    ),
    Frozen(
        "attack",
        "Mutated rig files, runs and command lines: how many defects they find.",
        ("attack",),
        "tests/cli/test_mutants.py",
    ),
    Frozen(
        "build-choices",
        "What each choice of a build of the weak form takes and gives, on the pendulum's shipped rig.",
        ("build-choices",),
        "tests/codegen/test_fitted_sizes.py tests/board/test_targets.py",
    ),
    Frozen(
        "cell",
        "RC models on a cell that is no RC circuit, simulated by PyBaMM.",
        ("cell",),
        "tests/identification/test_recorded_rigs.py",
    ),
    Frozen(
        "codec",
        "Corrupted frames of every length against both decoders of the serial link.",
        ("codec",),
        "tests/link/test_link.py",
    ),
    Frozen(
        "cycles",
        "Clock cycles of a tick on a real core, CV32E40P, simulated from its RTL by verilator with ideal memory.",
        ("cycles",),
        "tests/board/test_targets.py",  # the instructions of a tick
    ),
    Frozen(
        "recordings",
        "Real rigs of other laboratories: identified from one run, another one predicted, beside the published values.",
        ("recordings", "predictions", "verdicts", "traps"),
        "tests/identification/test_recorded_rigs.py",
    ),
    Frozen(
        "peers",
        "pvid beside SciPy, CasADi, pysindy, PyBOP, MuJoCo, Pinocchio and the textbook, on the same recordings.",
        ("peers",),
        "tests/bench/test_mechanisms.py tests/bench/test_refine_mechanisms.py",
    ),
    Frozen(
        "norm",
        "The strong form with all rows of an instant in one norm, beside rows that are weighted apart.",
        ("strong-norm",),
        "tests/core/test_strong_errors.py",
    ),
    Frozen(
        "starts",
        "From how far off both forms in C converge.",
        ("starts",),
        "tests/core/test_strong_errors.py tests/bench/test_weak.py",
    ),
    Frozen(
        "strong",
        "The strong form in C beside the weak form, with finer and finer encoders.",
        ("strong-sensors",),
        "tests/core/test_strong_errors.py",
    ),
    Frozen(
        "strong-mechanisms",
        "The strong form on boards: its bits, the cost of a tick, recursive least squares beside it.",
        ("strong-mechanisms", "strong-fixed"),
        "tests/board/test_strong_image.py",
    ),
    Frozen(
        "field-log",
        "An hour in the field, shortened in time: the board killed twice, its line closed once, all verified.",
        ("field-log",),
        "tests/log/test_log.py",
    ),
    Frozen(
        "kept-recordings",
        "The real rigs whose recordings are in tests/data/recordings: one part identified, the other one predicted.",
        ("kept-recordings", "kept-predictions", "kept-verdicts"),
        "tests/identification/test_recorded_rigs.py",
    ),
    Frozen(
        "liar",
        "A board that sends false data, against `pvid log` and all readers of its logs; then mutants of frames.",
        ("liar",),
        "tests/log/test_liar.py tests/log/test_untrusted.py",
    ),
    Frozen(
        "log",
        "Frames a minute of processor time through `pvid log`, losses, memory.",
        ("log",),
        "tests/log/test_log.py",
    ),
    Frozen(
        "long",
        "The long forms of the tests: 40 000 ticks, every build and board (`./tools/test night`).",
        ("long",),
        "tools/test",
    ),
    Frozen(
        "random-models",
        "Random rigs the whole road: check, identify in float64 and in C, refine, build, compile, equal bits; and "
        "descriptions without sense, of which each is a report or one sentence.",
        ("random-models", "compile-times", "senseless-models"),
        "tests/identification/test_former_rigs.py tests/model/test_senseless.py tests/codegen/test_random.py",
    ),
    Frozen(
        "verify",
        "What `pvid verify` takes for a long log, of each identifier that a board streams.",
        ("verify",),
        "tests/log/test_witness.py",
    ),
    Frozen(
        "year",
        "A year at 1 kHz, by a tick counter started before each passage of 2^32: log, verify, exports, plot, page.",
        ("year-f32", "year-q31"),
        "tests/log/test_verify.py",
    ),
)


def _add(one: Case) -> None:
    @bench.command(name=one.name, help=one.claim, params=[*one.options])
    @DATA
    def command(data: Path | None, **given: Any) -> int:
        with progress_bar(one.name, None) as shown:
            steps = count(1)
            report = one.run(**given, advance=lambda: shown(next(steps)))
            tables = [(name, header, [tuple(row) for row in rows]) for name, header, rows in report.tables]
        for line in report.said:
            click.echo(line)
        for name, header, rows in tables:
            if rows:
                put_results(data, name, header, rows)
        for fault in report.faults:
            write_stderr(f"pvid: {fault}")
        wrong = report.faults or any(DIFFERS in row for _, _, rows in tables for row in rows)
        return DIFFERENT if wrong else DONE


for _case in CASES:
    _add(_case)


# ---- parts of pages that are written from what is measured ----


@bench.command(name="claims")
@DATA
def bench_claims(data: Path | None) -> int:
    """Which command holds which claim: its tables, the pages that quote them, the test of its short form."""
    from bench import claims

    put_results(data, "claims", claims.HEADER, claims.rows(CASES, FROZEN))
    return DONE


@bench.command(name="demo")
@UPDATE
def bench_demo(update: Path | None) -> int:
    """What the demo prints, as the README shows it."""
    from bench.mechanism_pages import printed_demo

    put_table(update, "demo", f"```\n{printed_demo()}\n```")
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
