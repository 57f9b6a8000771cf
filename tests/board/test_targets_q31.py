"""The fixed-point core on boards without a floating-point unit: the bits of the host and the twin, at a fifth of the
cost of soft float and less."""

from __future__ import annotations

import numpy as np
import pytest

from pvid.board.boards import BOARDS
from pvid.board.replay_image import ReplayReport, build_image, native_hashes, play, standard_run, twin_hashes
from pvid.core.native import Native

TICKS = 5000
TIMEOUT_S = 300.0  # a stuck emulator ends here


STRONG_TICKS = 1500  # all alike from the 500th on


def played(board: str, core: str, form: str = "weak", divider: int = 1) -> ReplayReport:
    run = standard_run(form, TICKS if form == "weak" else STRONG_TICKS, core, divider)
    image, _ = build_image(BOARDS[board], run)
    return play(BOARDS[board], image, TIMEOUT_S)


@pytest.mark.parametrize("form", ["weak", "strong"])
def test_the_host_computes_the_integers_of_the_twin(form: str, native: Native) -> None:
    replay = standard_run(form, TICKS, "q31")
    assert np.array_equal(native_hashes(replay, native), twin_hashes(replay))


@pytest.mark.parametrize("board", ["microbit", "virt-rv32imac"])
def test_integers_cost_a_fifth_of_soft_float_at_most(board: str) -> None:
    integers, soft_float = played(board, "q31"), played(board, "f32")
    assert 5 * integers.instructions_mean <= soft_float.instructions_mean


# A solve at every fourth row is what a core without a long multiplication can do twice as fast as soft float; where
# there is one, at every row.
@pytest.mark.parametrize(("board", "divider"), [("microbit", 4), ("virt-rv32imac", 1), ("virt-rv32imac", 4)])
def test_the_strong_form_costs_half_of_soft_float_at_most(board: str, divider: int, native: Native) -> None:
    integers, soft_float = (played(board, core, "strong", divider) for core in ("q31", "f32"))
    assert 2 * integers.instructions_mean <= soft_float.instructions_mean
    expected = native_hashes(standard_run("strong", STRONG_TICKS, "q31", divider), native)
    assert integers.hash == int(expected[-1])


def test_the_strong_form_costs_no_more_than_soft_float_at_every_row_of_a_cortex_m0() -> None:
    integers, soft_float = (played("microbit", core, "strong") for core in ("q31", "f32"))
    assert 1.2 * integers.instructions_mean <= soft_float.instructions_mean
