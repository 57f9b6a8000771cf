"""No table of measured figures without the command that made it: beside the table, or in its page's introduction."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "host" / "docs").rglob("*.md"))]
_SOURCE = re.compile(r"\btools/|\bpvid bench |\btest_\w+\.py|tests/|<!-- \w")
_FIGURE = re.compile(r"[-+±*]*\d[\d.,e+\-±/ %×]*( ?[a-zA-Z²%]{1,4})?")
_MANY = 0.4  # of the cells: a table of settings or codes has fewer, or one row


def tables_without_a_source(text: str) -> Iterator[str]:
    """First row of each table of figures whose section and whose page's introduction name no command and no test."""
    sections = re.split(r"(?m)^(?=## )", re.sub(r"(?ms)^```.*?^```", "", text))
    introduced = _SOURCE.search(sections[0]) is not None
    for section in sections:
        for table in re.findall(r"(?m)(?:^\|.*\n)+", section):
            rows = table.splitlines()[2:]
            cells = [cell.strip() for row in rows for cell in row.strip("|").split("|")[1:]]
            figures = sum(bool(_FIGURE.fullmatch(cell)) and "." in cell for cell in cells)
            if len(rows) > 1 and figures > _MANY * len(cells) and not introduced and not _SOURCE.search(section):
                yield rows[0]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_table_of_figures_names_what_made_it(page: Path) -> None:
    assert list(tables_without_a_source(page.read_text(encoding="utf-8"))) == []


def test_a_table_without_its_command_is_found() -> None:
    table = "| method | error |\n|---|---|\n| weak | 0.012 |\n| strong | 0.19 % |\n"
    assert list(tables_without_a_source(f"# A\n\n## B\n\n{table}")) == ["| weak | 0.012 |"]
    assert not list(tables_without_a_source(f"# A\n\n## B\n\n    ./tools/pvid bench laws\n\n{table}"))
    assert not list(tables_without_a_source(f"# A\n\nWritten by `./tools/pvid bench laws`.\n\n## B\n\n{table}"))
    assert list(tables_without_a_source(f"# A\n\n## B\n\n    ./tools/pvid bench laws\n\n## C\n\n{table}"))
