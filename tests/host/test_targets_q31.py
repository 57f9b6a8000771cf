"""The fixed-point core on boards without a floating-point unit: the bits of the host and the twin, at a fifth of the
cost of soft float and less."""

from __future__ import annotations

import numpy as np
import pytest

from pvid.boards import BOARDS
from pvid.native import Native
from pvid.replay_image import ReplayReport, build_image, native_hashes, play, standard_run, twin_hashes

TICKS = 5000
TIMEOUT_S = 300.0  # a stuck emulator ends here


def played(board: str, core: str) -> ReplayReport:
    image, _ = build_image(BOARDS[board], standard_run("weak", TICKS, core))
    return play(BOARDS[board], image, TIMEOUT_S)


def test_the_host_computes_the_integers_of_the_twin(native: Native) -> None:
    replay = standard_run("weak", TICKS, "q31")
    assert np.array_equal(native_hashes(replay, native), twin_hashes(replay))


# Also with a floating-point unit: integers are the same everywhere.
@pytest.mark.parametrize("board", ["microbit", "virt-rv32imac", "mps2-an386"])
def test_a_board_computes_the_integers_of_the_host(board: str, native: Native) -> None:
    report = played(board, "q31")
    expected = native_hashes(standard_run("weak", TICKS, "q31"), native)
    assert report.ticks == TICKS
    assert len(report.hashes) == TICKS // 500
    assert all(value == expected[tick - 1] for tick, value in report.hashes.items())
    assert report.hash == int(expected[-1])


@pytest.mark.parametrize("board", ["microbit", "virt-rv32imac"])
def test_integers_cost_a_fifth_of_soft_float_at_most(board: str) -> None:
    integers, soft_float = played(board, "q31"), played(board, "f32")
    assert 5 * integers.instructions_mean <= soft_float.instructions_mean
