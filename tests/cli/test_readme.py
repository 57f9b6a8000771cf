"""Pages: programs compile and run, commands and options exist, names and figures are right."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner
from conftest import ROOT
from pendulum_plant import STANDARD_PENDULUM, Truth, simulate

from pvid.board import sizes
from pvid.cli.main import commands
from pvid.cli.results import read_results
from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, sources_of
from pvid.rig.mechanism_file import MechanismRig

DOCS = ROOT / "host" / "docs"
README = ROOT / "README.md"
FIRMWARE = DOCS / "firmware.md"
PAGES = [
    *(ROOT / name for name in ("README.md", "firmware/README.md", "host/README.md")),
    *sorted((ROOT / ".github").glob("*.md")),
    *sorted(DOCS.rglob("*.md")),
]
READ_BY_GIT = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split(
    "\n"
)


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(page: Path) -> list[str]:
    """The C programs of a page."""
    return re.findall(r"```c\n(.*?)```", text_of(page), re.DOTALL)


# ---- C


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first of firmware.md, with the files that its command writes for the standard rig."""
    folder = tmp_path_factory.mktemp("program")
    (folder / "example.c").write_text(blocks(FIRMWARE)[0], encoding="utf-8")
    MechanismRig("kapitza", 1000.0, known={"l1": 0.3}).write(folder / "rig.toml")
    written = re.search(r"/\* \./tools/pvid (model build .*) -o kapitza \*/", text_of(FIRMWARE))
    assert written is not None
    command = [sys.executable, "-P", "-m", "pvid", *written[1].split(), "-o", "kapitza"]
    subprocess.run(command, cwd=folder, capture_output=True, check=True)
    sources = [folder / "example.c", folder / "kapitza" / "kapitza_weak_f32.c", *sources_of("f32")]
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    includes = [*INCLUDES, f"-I{folder / 'kapitza'}"]
    subprocess.run(["gcc", *flags, *includes, *map(str, sources), "-o", str(folder / "example"), "-lm"], check=True)
    return folder / "example"


@pytest.mark.parametrize("truth", ["linear", "full"])
def test_program_identifies_the_standard_rig(program: Path, truth: Truth) -> None:
    """The standard errors, 1.1 % of g, contain what the linear equations neglect at this rig's angles."""
    run = simulate(truth=truth).run
    samples = "\n".join(f"{y:.9g} {phi:.9g}" for phi, y in zip(run.phi, run.y, strict=True))
    printed = subprocess.run([str(program)], input=samples, capture_output=True, text=True, check=True).stdout
    numbers = np.array([float(number) for number in re.findall(r"-?\d+\.\d+", printed)])
    assert len(numbers) == 8, printed
    true_values = STANDARD_PENDULUM.linear
    errors, standard_errors = np.abs(numbers[:6:2] - true_values), numbers[1:6:2]
    assert (errors < 4 * standard_errors).all(), printed
    assert (standard_errors < 2e-2 * true_values).all(), printed


def compile_as_cpp(source: str, standard: str, folder: Path) -> None:
    (folder / "example.cpp").write_text(source, encoding="utf-8")
    declared = (
        '#include "pvid/weak.h"\n#define KAPITZA_WEAK_SAMPLES 2\n#define KAPITZA_WEAK_P 4\n'
        'extern "C" const pvid_weak_config_f32 kapitza_config_f32;\n'
    )
    (folder / "kapitza_design_f32.h").write_text(declared, encoding="utf-8")
    command = ["g++", f"-std={standard}", "-fsyntax-only", "-Wall"]
    includes = [*PUBLIC_INCLUDES, f"-I{folder}"]
    done = subprocess.run([*command, *includes, str(folder / "example.cpp")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("standard", ["c++14", "c++20"])
def test_program_is_cpp_too(standard: str, tmp_path: Path) -> None:
    compile_as_cpp(blocks(FIRMWARE)[0], standard, tmp_path)


def test_examples_of_both_stages_and_of_an_interrupt_compile(tmp_path: Path) -> None:
    stubs = (
        '#include "pvid/pvid.h"\nfloat read_encoder();\nfloat read_pivot();\nvoid show(const pvid_estimate_f32 *);\n'
    )
    _, both, interrupt = blocks(FIRMWARE)
    compile_as_cpp(stubs + interrupt, "c++20", tmp_path)
    settings = (
        '#include "pvid/refine.h"\n#include "kapitza_design_f32.h"\n'
        'extern "C" const pvid_refine_config_f32 kapitza_refine_config_f32;\n'
    )
    compile_as_cpp(settings + both, "c++20", tmp_path)


# ---- the command line


def commands_shown() -> Iterator[tuple[Path, list[str]]]:
    """The words behind ./tools/pvid of every command that a page shows, in a block or between backquotes."""
    for page in PAGES:
        text = text_of(page).split("<!-- demo -->")[0]
        for line in re.findall(r"(?m)^ {4,}\./tools/pvid (.*)$", text) + re.findall(r"`\./tools/pvid ([^`]*)`", text):
            yield page, shlex.split(line, comments=True)


def test_commands_and_options_exist() -> None:

    shown = list(commands_shown())
    assert len(shown) > 40
    for page, words in shown:
        command: click.Command = commands
        context = click.Context(command)
        words = [word for word in words if word not in ("|", ">")]
        while isinstance(command, click.Group) and words and not words[0].startswith("-") and words[0] != "X":
            found = command.get_command(context, words[0])
            assert found is not None, f"{page}: {' '.join(words)}"
            command, words = found, words[1:]
        names = [[*parameter.opts, *parameter.secondary_opts] for parameter in command.params]
        known = {option for some in names for option in some} | {"--help"}
        asked = {word.split("=")[0] for word in words if word.startswith("--")}
        assert asked <= known, f"{page}: {' '.join(words)}"


# ---- names


def enumerators(header: str, enumeration: str) -> list[str]:
    """Names of the enumerators of a type in a public header."""
    source = re.sub(r"/\*.*?\*/", "", text_of(ROOT / "firmware" / "include" / "pvid" / header), flags=re.DOTALL)
    found = re.search(rf"typedef enum \{{([^}}]*)\}} {enumeration};", source)
    assert found is not None
    return re.findall(r"\bPVID_\w+", found.group(1))


@pytest.mark.parametrize(
    ("header", "enumeration"),
    [("status.h", "pvid_reason"), ("snapshot_slots.h", "pvid_snapshot_status"), ("record.h", "pvid_record_status")],
)
def test_every_enumerator_has_its_remedy(header: str, enumeration: str) -> None:
    text = text_of(DOCS / "reasons.md")
    names = enumerators(header, enumeration)
    assert len(names) > 8
    assert [name for name in names if f"`{name}`" not in text] == []


def code_spans() -> Iterator[tuple[Path, str]]:
    for page in PAGES:
        if page.name != "changelog.md":
            for span in re.findall(r"`([^`\n]+)`", re.sub(r"(?ms)^```.*?^```", "", text_of(page))):
                yield page, span


def test_identifiers_and_files_that_pages_name_exist() -> None:
    sources = [name for name in READ_BY_GIT if name.endswith((".c", ".h", ".py", ".txt", ".cmake", ".in"))]
    tree = "\n".join(text_of(ROOT / name) for name in sources if (ROOT / name).exists())
    words = set(re.findall(r"\w+", tree))
    files = {name.rsplit("/", 1)[-1] for name in READ_BY_GIT}
    missing = []
    for page, span in code_spans():
        for name in re.findall(r"\b(?:pvid|PVID)_\w+\b(?!\*)", span):
            if name not in words and not name.endswith("_"):
                missing.append(f"{page.relative_to(ROOT)}: {name}")
        for name in re.findall(r"[\w/.-]+\.(?:c|h|py|toml|cmake|md)\b", span):
            known = name.rsplit("/", 1)[-1] in files or re.match(
                r"(run|rig|run-tuned|main|RUN|link|motor\w*|my_motor|own|cart|dc_motor\w*|kapitza_\w*|pvid_NAME|NAME_\w+|test_NAME)\b",
                name,
            )
            if not known:
                missing.append(f"{page.relative_to(ROOT)}: {name}")
        for name in re.findall(r"^(?:firmware|host|tests|tools)/[\w/.-]+", span):
            if not (ROOT / name.removesuffix("/NAME")).exists():
                missing.append(f"{page.relative_to(ROOT)}: {name}")
    assert missing == []


def test_cited_sections_of_the_theory_exist() -> None:
    headings = set(re.findall(r"(?m)^## (\d)\. ", text_of(DOCS / "theory.md")))
    equations = set(re.findall(r"(?m)^    \((\d+)\)  ", text_of(DOCS / "theory.md")))
    assert headings == set("123456")
    assert equations == {str(number) for number in range(1, 13)} - {"3"}  # (3), the ties, is in a sentence
    wrong = []
    for name in READ_BY_GIT:
        if not name.endswith((".c", ".h", ".py", ".toml")):
            continue
        text = text_of(ROOT / name) if (ROOT / name).exists() else ""
        for cited in re.findall(r"theory\.md,? (?:section )?(\d+)", text):
            if cited not in headings:
                wrong.append(f"{name}: section {cited}")
        for cited in re.findall(r"theory\.md \((\d+)\)", text):
            if cited not in equations | {"3"}:
                wrong.append(f"{name}: equation {cited}")
    assert wrong == []


def test_sources_cite_pages_that_exist() -> None:
    pages = {name.rsplit("/", 1)[-1] for name in READ_BY_GIT if name.endswith(".md")}
    pages |= {"deviations.md", "mutants.md"}  # written to build/
    pages |= {"NAME.md"}  # of a mechanism
    wrong = []
    for name in READ_BY_GIT:
        if not name.endswith((".c", ".h", ".py", ".toml", ".txt")) or not (ROOT / name).exists():
            continue
        if name == "tests/tools/test_docs.py":  # plants links that lead nowhere
            continue
        for cited in re.findall(r"\b[\w-]+\.md\b", text_of(ROOT / name)):
            if cited not in pages:
                wrong.append(f"{name}: {cited}")
    assert wrong == []


# ---- figures


def test_the_costs_are_what_their_command_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the budget, with which tests/board/test_targets.py compares what is measured."""
    budget = sizes.budgeted(ROOT / "tests" / "budget.toml")
    monkeypatch.setattr(sizes, "measure", lambda one: (budget[one], None))
    page = tmp_path / "README.md"
    page.write_text(re.sub(r"\| \d+ / \d+ \| \d+", "| 1 / 2 | 3", text_of(FIRMWARE)), encoding="utf-8")
    assert text_of(page).count("| 1 / 2 | 3") == 7
    CliRunner().invoke(commands, ["sizes", "--update", str(page)], standalone_mode=False, catch_exceptions=False)
    assert text_of(page) == text_of(FIRMWARE), "./tools/pvid sizes --update host/docs/firmware.md"


def test_the_table_of_sizes_is_that_of_the_budget() -> None:
    """Which tests/board/test_targets.py compares with what is measured."""
    budget = sizes.budgeted(ROOT / "tests" / "budget.toml")
    kept = read_results(ROOT / "host" / "docs" / "benchmarks" / "sizes.csv").rows
    anew = "./tools/pvid sizes --budget tests/budget.toml --data host/docs/benchmarks, ./tools/pvid bench figures"
    assert sorted(kept) == sorted(sizes.table_rows(budget)), anew


def test_readme_is_short_and_begins_with_what_a_reader_runs() -> None:
    text = text_of(README)
    assert len(text.split()) <= 700
    order = ["./tools/pvid demo", "pvid look", "pvid identify recorded", "import pvid", "model check", "pvid deploy"]
    places = [text.index(one) for one in order]
    assert places == sorted(places) and text[: places[0]].count("\n") < 20


def test_the_pages_are_at_most_30000_words() -> None:
    """Without programs, commands, what they print, the changelog, and what is made from the code."""
    pages = [page for page in PAGES if page.parent.name not in (".github", "mechanisms")]
    read = [text_of(page) for page in pages if page.name not in ("api-python.md", "changelog.md")]
    prose = [re.sub(r"(?ms)^( *)```.*?^\1```|^ {4}[^\n]*", "", text) for text in read]
    assert sum(len(text.split()) for text in prose) <= 30_000
