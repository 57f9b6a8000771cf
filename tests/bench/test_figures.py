"""The page of benchmarks: sentences and pictures are those of the tables of results; a table names its command."""

import re
import sys
from pathlib import Path

import pytest
from conftest import ROOT

from bench import claims
from bench.case import Case, counts
from bench.command import CASES, FROZEN
from bench.figures import DATA, IMAGES, PAGE, PARTS, Part, results_of
from pvid.base.errors import PvidError
from pvid.cli.page_table import table_in
from pvid.cli.results import Results, put_results, read_results

sys.path.insert(0, str(ROOT / "tools"))

import pages  # noqa: E402 - of tools

TABLES = sorted(path.stem for path in DATA.glob("*.csv"))
ANEW = "write it anew: ./tools/pvid bench figures"


@pytest.mark.parametrize("part", PARTS, ids=lambda one: one.name)
def test_sentences_and_picture_are_those_of_the_tables(part: Part) -> None:
    assert table_in(PAGE, part.name) == "\n".join(part.sentences()), ANEW
    shown = (IMAGES / f"{part.name}.png").read_bytes()
    assert part.digest.encode() in shown, ANEW
    assert len(shown) < 60_000
    assert part.digest.encode() in part.picture()


def test_a_changed_cell_changes_the_digest(monkeypatch: pytest.MonkeyPatch) -> None:
    part = next(one for one in PARTS if one.name == "missing")
    before = part.digest
    kept = results_of(part.tables[0])
    other = Results(kept.header, [*kept.rows[:-1], ("all", *["1"] * (len(kept.header) - 1))], kept.made)
    monkeypatch.setattr("bench.figures.results_of", lambda name: other)
    assert part.digest != before


@pytest.mark.parametrize("name", TABLES)
def test_a_table_names_the_command_the_commit_and_the_day_that_made_it(name: str) -> None:
    made = results_of(name).made
    assert [*made] in (["command", "commit", "date"], ["command", "commit", "date", "earlier"])
    assert re.fullmatch(r"[0-9a-f]{8,}\+?", made["commit"]) and re.fullmatch(r"20\d\d-\d\d-\d\d", made["date"])
    if name not in {of for one in FROZEN for of in one.tables}:
        pages.parse(made["command"].replace(" FOLDER", " tests"))


def test_every_table_is_on_the_page_and_has_a_command_that_writes_it() -> None:
    linked = re.findall(r"\]\(benchmarks/([\w-]+)\.csv\)", PAGE.read_text(encoding="utf-8"))
    assert sorted(linked) == TABLES
    sizes = (ROOT / "host" / "src" / "pvid" / "cli" / "sizes.py").read_text(encoding="utf-8")
    written = {name for one in CASES for name in one.written} | {name for one in FROZEN for name in one.tables}
    for name in TABLES:
        assert name == "claims" or name in written or re.sub(r"-\d+$", "", name) in written or f'"{name}"' in sizes, (
            name
        )


@pytest.mark.parametrize("one", [one for one in CASES if len(one.options) == 2], ids=lambda one: one.name)
def test_a_table_has_the_columns_that_its_command_writes(one: Case) -> None:
    if [option.name for option in one.options] == ["mechanism", "number"]:
        report = one.run(mechanism=frozenset(), number=1, advance=lambda: None)
        assert tuple(name for name, _, _ in report.tables) == one.written
        for name, header, rows in report.tables:
            assert results_of(name).header == header and list(rows) == []


def test_every_claim_has_a_command_a_page_and_a_test() -> None:
    kept = results_of("claims")
    assert kept.rows == list(claims.rows(CASES, FROZEN)), (
        "write it anew: ./tools/pvid bench claims --data host/docs/benchmarks"
    )
    assert sorted(" ".join(kept.column("tables")).replace(" -", "").split()) == [
        one for one in TABLES if one != "claims"
    ]
    assert all((ROOT / path).exists() for one in FROZEN for path in one.holder.split())
    assert all(kept.column("quoted by")) and "-" not in kept.column("short form")


def test_the_page_is_short() -> None:
    assert len(PAGE.read_text(encoding="utf-8").split()) <= 2500


def test_what_was_written_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["pvid", "bench", "x", "--data", str(tmp_path), "--seeds", "3"])
    put_results(tmp_path, "a", ("name", "R^2, %"), [("b, c", "1"), ('"d"', "")])
    found = read_results(tmp_path / "a.csv")
    assert (found.header, found.rows) == (("name", "R^2, %"), [("b, c", "1"), ('"d"', "")])
    assert found.made["command"] == "./tools/pvid bench x --seeds 3"
    assert found.column("R^2, %") == ["1", ""] and found.where(name="b, c") == [{"name": "b, c", "R^2, %": "1"}]


def test_without_a_folder_a_table_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    put_results(None, *counts("a", [("runs", 3)]))
    assert capsys.readouterr().out == "| what | number |\n|---|---|\n| runs | 3 |\n"


@pytest.mark.parametrize("text", ["", "# command: x\n", "a,b\n1\n"])
def test_what_is_no_table_is_one_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(PvidError, match="is no table of results"):
        read_results(tmp_path / "a.csv")
