"""Every block of README.md and of the site is executed, or listed with a reason and parsed."""

import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import click
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import pages  # noqa: E402 - of tools

from pvid.core.sources import PUBLIC_INCLUDES  # noqa: E402
from pvid.models.mechanisms import path_of  # noqa: E402
from pvid.rig.mechanism_file import MechanismRig  # noqa: E402

SETTINGS = """
#include "pvid/pvid.h"
#include "pvid/refine.h"
extern const pvid_weak_config_f32 kapitza_config_f32;
extern const pvid_refine_config_f32 kapitza_refine_config_f32;
"""
# What the C of a page uses beside its headers: page, declarations.
SURROUNDINGS = {
    "models.md": "#include <stdbool.h>\n#include <pvid/pvid.h>\nvoid use(const float *, const float *);\n",
    "tutorial.md": "#include <pvid/pvid.h>\nfloat force(void);\nfloat place(void);\n"
    "void show(const float *, const float *);\n",
    "firmware.md": SETTINGS + "float read_encoder(void);\nfloat read_pivot(void);\n"
    "void show(const pvid_estimate_f32 *);\n",
    "paper.md": '#include "number/finite_f32.h"\n#include "number/unroll.h"\n#include "solve/cholesky_f32.h"\n'
    "enum { STRONG_P = 4, STRONG_KINDS = 1, STRONG_S = 10, STRONG_INPUTS = 7, STRONG_ATOMS = 6 };\n"
    "typedef struct { float e[STRONG_KINDS]; float g[STRONG_KINDS][STRONG_P]; } strong_gradient_f32;\n",
}
# Pages whose blocks every run of the tests executes; those of the others `./tools/test night`.
SMOKE = ("README.md", "CONTRIBUTING.md")
# Printed once whatever the page; they write nothing that a later command reads.
PURE = {"identify", "tune", "design", "plot", "compare", "models"}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the pages' commands name."""
    folder = tmp_path_factory.mktemp("files")
    pages.prepared(folder)
    return folder


@pytest.fixture(scope="module")
def known() -> dict[tuple[str, ...], pages.Printed]:
    """Commands that were executed on the same files for another page."""
    return {}


def run_once(line: str, folder: Path, full: bool, known: dict[tuple[str, ...], pages.Printed]) -> pages.Printed:
    words = line.split()
    if words[0] != "./tools/pvid" or words[1] not in PURE:
        return pages.executed(line, folder, full)
    named = [folder / word for word in words if (folder / word).is_file()]
    named += [path.with_suffix(".toml") for path in named if path.with_suffix(".toml").is_file()]
    key = (pages.short_form(line), *(path.read_bytes().hex()[-2000:] for path in named))
    if key not in known:
        known[key] = pages.executed(line, folder, full)
    return known[key]


def compile_c(block: pages.Block, folder: Path) -> None:
    """Syntax and types, with the headers that the page's commands have written."""
    around = (
        SURROUNDINGS.get(block.page.name, "") if "#include <" not in block.text else ""
    )  # a whole program has its own
    (folder / "page.c").write_text(around + block.text, encoding="utf-8")
    generated = sorted({path.parent for path in folder.rglob("*_design_f32.h")})
    sizes: dict[str, int] = {}
    for path in folder.rglob("*_design_f32.h"):
        for macro, size in re.findall(r"-D(PVID_MAX_\w+)=(\d+)", path.read_text(encoding="utf-8")):
            sizes[macro] = max(int(size), sizes.get(macro, 0))
    command = [
        "gcc",
        "-std=c99",
        "-fsyntax-only",
        "-Wall",
        "-Wextra",
        "-Werror",
        *(f"-D{macro}={size}" for macro, size in sizes.items()),
    ]
    done = subprocess.run(
        [*command, *PUBLIC_INCLUDES, f"-I{ROOT / 'firmware' / 'src'}", *(f"-I{path}" for path in generated), "page.c"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{block}: {done.stderr}"


@pytest.mark.parametrize(
    "page",
    [pytest.param(one, id=str(one), marks=() if one.name in SMOKE else pytest.mark.night) for one in pages.pages()],
)
def test_every_block_of_a_page_is_executed(
    page: Path, files: Path, known: dict[tuple[str, ...], pages.Printed], tmp_path: Path
) -> None:
    blocks = pages.blocks_of(page)
    assert [str(block) for block in blocks if block.kind == "unknown"] == []
    folder = tmp_path / "page"
    if any(block.kind in ("commands", "python", "c") for block in blocks):
        shutil.copytree(files, folder, symlinks=True)
    names: dict[str, object] = {}
    printed = rig = ""
    for place, block in enumerate(blocks):
        full = place + 1 < len(blocks) and blocks[place + 1].kind == "output"
        match block.kind:
            case "commands":
                printed = ""
                for line in pages.commands_of(block):
                    for name in re.findall(r"--rig (\S+)", line):  # what the page shows above it
                        if rig and not (folder / name).exists():
                            (folder / name).write_text(rig, encoding="utf-8")
                    if pages.reason_not_to_execute(line) is None:
                        done = run_once(line, folder, full, known)
                        assert done.code == 0, f"{block}: {line}: {done.text}"
                        printed += done.text + "\n"
                    elif line.startswith("./tools/pvid") and "FOLDER" not in line:  # of recordings not at hand
                        pages.parse(line)
            case "python" if pages.mechanism_page(page):
                assert block.text == path_of(page.stem)[1].read_text(encoding="utf-8").rstrip()
            case "python":
                printed = pages.executed_python(block, folder, names).text
            case "c":
                compile_c(block, folder)
            case "toml":
                MechanismRig.parse(block.text)
                rig = block.text
            case "output":
                missing = list(pages.differences(block.text, printed))
                assert missing == [], f"{block}: tools/pages.py --update {page}\nprinted:\n{printed}"


def test_every_command_of_a_page_is_one() -> None:
    """Its words and options; what it does and prints is for `./tools/test night`."""
    for page in pages.pages():
        for block in pages.blocks_of(page):
            assert block.kind != "unknown", str(block)
            for line in pages.commands_of(block) if block.kind == "commands" else ():
                if line.startswith("./tools/pvid") and not re.search(r"FOLDER|\w\|\w", line):  # a choice of words
                    with suppress(click.exceptions.Exit):  # --help, --version
                        pages.parse(line)


def test_a_reason_and_a_short_form_are_each_used() -> None:
    lines = [line for page in pages.pages() for block in pages.blocks_of(page) for line in pages.commands_of(block)]
    for pattern, why in pages.NOT_EXECUTED:
        assert any(re.search(pattern, line) for line in lines), f"{pattern}: no page has it"
        for name in re.findall(r"test_\w+\.py", why):
            assert list((ROOT / "tests").rglob(name)), f"{pattern}: no {name}"
    for pattern, _, _ in pages.SHORT:
        assert any(re.search(pattern, line) for line in lines), f"{pattern}: no page has it"


def test_the_parser_finds_what_a_page_may_contain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    (tmp_path / "index.md").write_text(
        "text\n\n    ./tools/pvid ports  # a comment\n\n    cd x && cmake --preset y\n\n```text\nshown\n```\n"
        "- a\n\n    mystery\n",
        encoding="utf-8",
    )
    found = pages.blocks_of(Path("index.md"))
    assert [block.kind for block in found] == ["commands", "output", "unknown"]
    assert pages.commands_of(found[0]) == ["./tools/pvid ports", "cd x && cmake --preset y"]


@pytest.mark.parametrize(
    "line", ["./tools/pvid nothing", "./tools/pvid bench weak --no-such-option", "./tools/pvid log"]
)
def test_a_command_that_is_only_parsed_is_refused_if_it_is_wrong(line: str) -> None:
    with pytest.raises(click.ClickException):
        pages.parse(line)


@pytest.mark.parametrize(
    ("shown", "printed", "missing"),
    [
        ("a 1.00 b\nc", "x\na 1.01 b\nc", []),
        ("a 1.00", "a 1.20", ["a 1.00"]),
        ("a\n...\nb", "a\nmuch\nb", []),
        ("b\na", "a\nb", ["a"]),
        ("hash 0ad5fff7", "hash 1ad5fff7", []),
        ("status good", "status warning", ["status good"]),
    ],
)
def test_what_was_not_printed_is_found(shown: str, printed: str, missing: list[str]) -> None:
    assert list(pages.differences(shown, printed)) == missing
