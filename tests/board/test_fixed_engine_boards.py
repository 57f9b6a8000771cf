"""The fixed-point weak engine of described mechanisms on emulated boards: the bits of the twin."""

from __future__ import annotations

import pytest

from pvid.board.boards import BOARDS
from pvid.board.mechanism_image_q31 import build_fixed_image, fixed_run, native_hashes, twin_hashes
from pvid.board.replay_image import REPORT_EVERY, play
from pvid.models import mechanisms

TIMEOUT_S = 300.0


@pytest.mark.parametrize(
    ("board", "name"),
    [
        ("virt-rv32imac", "battery_2rc"),  # the pendulum: test_targets.py
        ("microbit", "dc_motor"),  # its short products have less room than those of other cores
        *(pytest.param("mps2-an386", name, marks=pytest.mark.long) for name in mechanisms.names()),
    ],
)
def test_a_board_computes_the_bits_of_the_twin(board: str, name: str) -> None:
    run = fixed_run(name)
    expected = twin_hashes(run)
    image, _ = build_fixed_image(BOARDS[board], run)
    report = play(BOARDS[board], image, TIMEOUT_S)
    assert report.ticks == len(run.counts)
    assert {at: int(expected[at - 1]) for at in report.hashes} == report.hashes
    assert len(report.hashes) == len(run.counts) // REPORT_EVERY
    assert report.hash == int(expected[-1]) == int(native_hashes(run)[-1])
