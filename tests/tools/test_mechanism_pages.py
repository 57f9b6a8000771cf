"""The pages of the shipped mechanisms have today's description and report; each has its picture."""

import pytest
from conftest import ROOT

from bench.figures import results_of
from bench.mechanism_pages import ERRORS, command_of, errors_of, gallery, rig_of
from pvid.cli.results import Results
from pvid.model.report import check_report
from pvid.models.mechanisms import compiled_of, names, path_of

DOCS = ROOT / "host" / "docs"


@pytest.mark.parametrize("name", names())
def test_a_page_shows_the_mechanism_as_it_is(name: str) -> None:
    text = (DOCS / "mechanisms" / f"{name}.md").read_text(encoding="utf-8")
    assert path_of(name)[1].read_text(encoding="utf-8").rstrip() in text, "write it anew: ./tools/pvid bench pages"
    assert check_report(compiled_of(name)).rstrip() in text, "write it anew: ./tools/pvid bench pages"
    assert errors_of(results_of(ERRORS), name) in text, "write it anew: ./tools/pvid bench pages"
    assert command_of(compiled_of(name)) in text and rig_of(name) in text, "write it anew: ./tools/pvid bench pages"
    assert (DOCS / "images" / "mechanisms" / f"{name}.png").is_file()


def test_the_rig_is_in_words() -> None:
    assert rig_of("dc_motor").startswith("The rig: a 12 V brush motor with ")


def test_the_gallery_has_every_mechanism() -> None:
    text = (DOCS / "mechanisms" / "gallery.md").read_text(encoding="utf-8")
    assert text == gallery(), "write it anew: ./tools/pvid bench pages"


def test_rows_of_one_mechanism_are_taken_from_the_table() -> None:
    table = Results(("mechanism", "parameter", "RMS %"), [("motor", "R", "0.1"), ("arm", "I1", "0.2")], {})
    assert errors_of(table, "arm").splitlines() == ["| parameter | RMS % |", "|---|---|", "| I1 | 0.2 |"]
    assert errors_of(table, "boat") == ""
