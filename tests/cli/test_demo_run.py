"""`pvid demo MODEL`: both stages and either arithmetic, their twins and a board agree, beside the truth."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ROOT

from pvid.base.console import DONE
from pvid.base.errors import PvidError
from pvid.board.target import HOST_TARGET
from pvid.cli.demo_run import Demonstrated, _line, _strong, _table, demo
from pvid.identification.core import identify_in_c
from pvid.identification.core_refined import refined_in_c
from pvid.identification.values import refined_shifts_of
from pvid.settings.cores import FIXED


@pytest.mark.parametrize("target", [HOST_TARGET, pytest.param("mps2-an386", marks=pytest.mark.night)])
def test_a_mechanism_is_identified_compared_and_streamed(
    target: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demo("battery_2rc", target, "a board", 0, tmp_path / "a.png") == DONE
    told = capsys.readouterr().out
    assert told.count("equal on board, PC and in numpy in every bit (hash ") == 2
    assert told.count("truth ") == 7 and "✗" not in told
    assert re.search(r"First answer after \d{4} s[;.]", told)
    assert ("instructions a sample" in told) == (target != HOST_TARGET)
    assert "14400 samples, " in told and "Integers only (first stage): " in told and "The paper's own form" in told
    assert len(told.splitlines()) <= 10
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_the_readme_shows_what_both_cores_answer_here(capsys: pytest.CaptureFixture[str]) -> None:
    """In either arithmetic, with the hash of all ticks; `./tools/test night` compares the whole demo."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8").split("<!-- demo -->")[1]
    shown = Demonstrated.of("kapitza", seed=1)
    refined, integers = refined_in_c(identify_in_c(shown.answer)), identify_in_c(shown.answer, FIXED.name)
    _table(shown, refined.values)
    for said in (*capsys.readouterr().out.splitlines(), f"hash {refined.hash:08x}", f"hash {integers.hash:08x}"):
        assert said.rstrip() in readme, "./tools/pvid bench demo --update README.md"
    assert f": {_line(shown, integers.values)}; " in readme
    assert _line(shown, _strong(shown, seed=1)) in readme


def test_a_refined_estimate_lacks_what_the_linear_rows_lack_only_beyond_what_they_neglect() -> None:
    model = SimpleNamespace(refinement=SimpleNamespace(equations=("full",)), knowns={}, signals=())
    lacking = SimpleNamespace(shifts=np.array([[0.1, -0.3, 0.3]]))
    found = SimpleNamespace(shifts=lacking.shifts, by_neglect=np.array([0.2, 0.2, 0.2]))
    np.testing.assert_array_equal(refined_shifts_of(model, found), [[0.0, -0.3, 0.3]])  # type: ignore[arg-type]


def test_what_is_not_shipped_is_refused() -> None:
    with pytest.raises(PvidError, match="there is no shipped mechanism own; there are "):
        demo("own", HOST_TARGET, "this machine", 0, Path("a.png"))
    with pytest.raises(PvidError, match=r"two_mass_drive; pvid model simulate own.py simulates a rig of a model file$"):
        demo("own.py", HOST_TARGET, "this machine", 0, Path("a.png"))
