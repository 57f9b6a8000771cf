"""Which measurement holds which claim: for each case its tables, the pages with them, the test of its short form."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from bench.case import Case, Frozen, columns
from bench.figures import results_of
from pvid.core.sources import ROOT

HEADER = columns("claim | command | tables | quoted by | short form")
_DOCS = ROOT / "host" / "docs"
# Tables of `pvid sizes` and parts of pages, which are no cases of the bench: claim, command, tables, short form.
_OTHERS = (
    (
        "Bytes, RAM, stack and instructions on every board, of every mechanism and by function.",
        "sizes",
        ("sizes", "sizes-models", "profile"),
        "tests/board/test_targets.py",
    ),
    ("A simulated rig is identified on a board, in every bit as on the PC.", "bench demo", (), "tests/cli/test_cli.py"),
    ("What `simulate` and `identify` print.", "bench answer", (), "tests/tools/test_pages.py"),
    ("What each mechanism's page shows.", "bench pages", (), "tests/tools/test_mechanism_pages.py"),
)
_WRITTEN = {"bench demo": ["README.md"], "bench answer": ["models.md"], "bench pages": ["mechanisms/"]}


def files_of(case: Case) -> list[str]:
    """Its tables in host/docs/benchmarks, with the endings that options give them."""
    stems = [path.stem for path in sorted((_DOCS / "benchmarks").glob("*.csv"))]
    return [one for name in case.written for one in stems if re.fullmatch(rf"{name}(-\d+)?", one)]


def quoting(command: str, tables: list[str]) -> list[str]:
    """Pages with a link to one of the tables, or with the command."""
    found = list(_WRITTEN.get(command, []))
    for path in sorted([ROOT / "README.md", ROOT / ".github" / "SECURITY.md", *_DOCS.rglob("*.md")]):
        text = path.read_text(encoding="utf-8")
        linked = any(f"benchmarks/{one}.csv" in text for one in tables)
        if path.name != "changelog.md" and (linked or re.search(rf"pvid {command}\b(?!-)", text)):
            found.append(path.name if path.parent.name != "mechanisms" else "mechanisms/")
    return list(dict.fromkeys(found))


def short_form(place: str) -> str:
    """The test that imports the case's module."""
    module = place.partition(":")[0]
    uses = re.compile(rf"from bench\.{module} import|from bench import [\w, ]*\b{module}\b")
    paths = sorted((ROOT / "tests").glob("*/test_*.py"), key=lambda path: (path.parent.name != "bench", path))
    found: Iterator[Path] = (path for path in paths if uses.search(path.read_text(encoding="utf-8")))
    return next((str(path.relative_to(ROOT)) for path in found), "-")


def rows(cases: tuple[Case, ...], frozen: tuple[Frozen, ...]) -> Iterator[tuple[str, ...]]:
    """As in HEADER."""
    known = [(one.claim, f"bench {one.name}", files_of(one), short_form(one.place)) for one in cases]
    for claim, command, tables, test in [*known, *((a, b, [*c], d) for a, b, c, d in _OTHERS)]:
        yield claim, command, " ".join(tables) or "-", " ".join(quoting(command, tables)), test
    for once in frozen:
        made = results_of(once.tables[0]).made
        command = f"{made['command'].removeprefix('./tools/pvid ')} at {made['commit']}"
        yield once.claim, command, " ".join(once.tables), " ".join(quoting(command, [*once.tables])), once.holder
