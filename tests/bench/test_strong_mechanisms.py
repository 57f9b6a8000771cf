"""The bench of the strong form of described mechanisms: one row, and that a wrong bit shows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench.strong_mechanisms import FIXED_HEADER, HEADER, ON, comparison_of, fixed_row_of, row_of
from pvid.board.strong_image import play_on_board


@pytest.mark.night
@pytest.mark.slow
def test_a_row_has_the_cost_of_each_board_and_equal_bits() -> None:
    row = row_of("rigid_body")
    assert len(row) == len(HEADER) and row[0] == "rigid_body" and row[HEADER.index("bits")] == "equal"
    means = [int(cell.split(" / ")[0]) for cell in row[3 : 3 + len(ON)]]
    assert means[0] * 5 < min(means[1:])  # soft float


@pytest.mark.night
@pytest.mark.slow
def test_without_a_floating_point_unit_a_tick_of_integers_is_cheaper() -> None:
    row = fixed_row_of("battery_2rc")
    assert len(row) == len(FIXED_HEADER) and row[-1] == "equal"
    means = [int(cell.split(" / ")[0]) for cell in row[3 : 3 + len(ON)]]
    assert max(means[1:]) < 5 * means[0]


def test_a_wrong_hash_is_found() -> None:
    run = comparison_of("rigid_body", 600)
    report = play_on_board("mps2-an386", run)
    assert report.differs_at(run.hashes) is None
    assert replace(report, hash=report.hash ^ 1).differs_at(run.hashes) == report.ticks
    assert replace(report, hashes={500: report.hashes[500] ^ 1}).differs_at(run.hashes) == 500
