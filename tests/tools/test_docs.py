"""tools/docs.py finds what it is there for: faults planted in a copy of the pages are reported."""

import shutil
import sys
from pathlib import Path

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import docs  # noqa: E402 - of tools

from pvid.rig.mechanism_file import OF_A_SENSOR, OF_THE_IDENTIFIER  # noqa: E402


@pytest.mark.parametrize(
    ("planted", "reported"),
    [("[x](nowhere.md)", "nowhere.md"), ("[x](theory.md#7-nothing)", "#7-nothing"), ("[x](/theory.md)", "absolute")],
)
def test_broken_link_is_reported(planted: str, reported: str, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "host" / "docs", tmp_path / "docs")
    shutil.copy(ROOT / "host" / "mkdocs.yml", tmp_path)
    with (tmp_path / "docs" / "index.md").open("a", encoding="utf-8") as page:
        page.write(f"\n{planted}\n")
    warnings = docs.build_site(tmp_path / "mkdocs.yml", tmp_path / "site")
    assert any(reported in line for line in warnings), warnings


def test_broken_link_outside_the_site_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(docs, "ROOT", tmp_path)
    (tmp_path / "theory.md").write_text("# Theory\n\n## 1. Plant\n", encoding="utf-8")
    page = tmp_path / "README.md"
    page.write_text("[a](theory.md#1-plant) [b](theory.md#2-none) [c](none.md)\n", encoding="utf-8")
    assert list(docs.broken_links(page)) == ["README.md: theory.md#2-none has no such heading", "README.md: no none.md"]


def test_every_key_of_a_rig_file_is_on_its_page() -> None:
    page = (ROOT / "host/docs/rig-file.md").read_text(encoding="utf-8")
    for table, keys in (("identifier", OF_THE_IDENTIFIER), ("sensor.NAME", OF_A_SENSOR)):
        for key in keys:
            assert f"| `[{table}] {key}` |" in page, key
