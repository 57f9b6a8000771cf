"""The logs of `pvid bench verify` are those of a board."""

from __future__ import annotations

from pathlib import Path

import field_board
import pytest

from bench.verifying import EVERY, us_a_tick, write_log
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.log.reader import LogReader
from pvid.log.verify import Verifier

TICKS = 4000


@pytest.mark.parametrize("core", ["both stages", "q31"])
def test_a_log_of_the_bench_verifies(tmp_path: Path, core: str) -> None:
    rig = field_board.rig()
    board = MechanismBoardQ31.of_guess(rig) if core == "q31" else MechanismBoard.of_guess(rig, refined=True)
    write_log(board, TICKS, tmp_path / "a.pvlog")
    (stretch,) = Verifier(board).stretches(LogReader(tmp_path / "a.pvlog"))
    checks = 2 if core == "q31" else 3  # an estimate of each stage and a hash
    assert (stretch.verified, stretch.checked) == (TICKS, checks * TICKS // EVERY)
    assert us_a_tick(board, board.recording[:200]) > 1.0
