"""What a tool reported is reported again while nothing that it read has changed, and only then."""

import sys
from functools import partial
from pathlib import Path

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import kept as checks  # noqa: E402 - of tools

COMPILER = ("gcc", "-std=c99")


@pytest.fixture
def read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A source with a header."""
    monkeypatch.setattr(checks, "_PLACE", tmp_path / "checks")
    (tmp_path / "a.h").write_text("int a(void);\n", encoding="utf-8")
    source = tmp_path / "a.c"
    source.write_text('#include "a.h"\nint a(void) { return 1; }\n', encoding="utf-8")
    return source


def times_made(*runs: tuple[str | None, ...]) -> int:
    made = []
    for run in runs:
        checks.kept(run, lambda: made.append(1) or "found")  # type: ignore[func-returns-value]
    return len(made)


def test_the_same_source_is_read_once(read: Path) -> None:
    assert times_made(*[("1.0", checks.preprocessed(COMPILER, read))] * 3) == 1
    assert checks.kept(("1.0", checks.preprocessed(COMPILER, read)), lambda: "other") == "found"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.h", "int a(void); /* a contract stands in a comment */\n"),
        ("a.h", "#define B 1\nint a(void);\n"),
        ("a.c", '#include "a.h"\nint a(void) { return 2; }\n'),
    ],
    ids=["comment", "macro", "code"],
)
def test_whatever_changes_it_is_read_again(name: str, text: str, read: Path) -> None:
    before = checks.preprocessed(COMPILER, read)
    read.with_name(name).write_text(text, encoding="utf-8")
    assert times_made(("1.0", before), ("1.0", checks.preprocessed(COMPILER, read))) == 2


def test_another_clone_reads_nothing_again(read: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its paths are those of its own top."""
    clones = [read.parent / name for name in ("one", "two")]
    found = []
    for clone in clones:
        clone.mkdir()
        (clone / "a.h").write_text("int a(void);\n", encoding="utf-8")
        source = clone / "a.c"
        source.write_text('#include "a.h"\n', encoding="utf-8")
        monkeypatch.setattr(checks, "_ROOT", clone)
        text = checks.preprocessed((*COMPILER, f"-I{clone}"), source)
        found.append(checks.kept((str(source), text), partial("{}/a.c:1: warning".format, clones[0])))
    assert found == [f"{clone}/a.c:1: warning" for clone in clones]


def test_another_version_reads_it_again(read: Path) -> None:
    text = checks.preprocessed(COMPILER, read)
    assert times_made(("1.0", text), ("1.1", text)) == 2


def test_a_source_that_is_refused_or_not_proved_is_not_kept(read: Path) -> None:
    read.write_text('#include "nowhere.h"\n', encoding="utf-8")
    assert times_made(*[("1.0", checks.preprocessed(COMPILER, read))] * 2) == 2
    assert checks.kept(("1.0", "text"), lambda: None) is None
    assert checks.kept(("1.0", "text"), lambda: "proved") == "proved"
