"""The bench of public robots, on the arm of the tests."""

from pathlib import Path

import pytest

from bench import robots
from pvid.base.errors import PvidError

DATA = Path(__file__).parents[1] / "data/robot"


def test_an_arm_of_a_file_is_answered_near_the_bound(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = (DATA / "arm.urdf").read_text().replace('type="continuous"', 'type="revolute"')
    (tmp_path / "arm.urdf").write_text(text.replace("<limit effort", '<limit lower="-2" upper="2" effort'))
    monkeypatch.setattr(robots, "ROBOTS", {"arm": ("arm.urdf", ())})
    monkeypatch.setattr(robots, "DURATION", 6.0)
    monkeypatch.setattr(robots, "files", lambda: tmp_path)
    found = robots.report((), 2, lambda: None)
    ((_, header, (row,)),) = found.tables
    cells = dict(zip(header, row, strict=True))
    assert not found.faults and cells["answered"] == "2 of 2" and cells["not determined"] == "0"
    assert 0.5 < float(cells["errors over the Cramer-Rao bound, median"]) < 2.0
    assert float(cells["within 2 s.e. %"]) >= 90 and float(cells["worst s.e."]) < 4
    with pytest.raises(PvidError, match="no such robot: arm2; there are arm"):
        robots.report(("arm2",), 1, lambda: None)
