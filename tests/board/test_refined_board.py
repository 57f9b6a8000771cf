"""Both stages with the generated C of a mechanism on an emulated board: the hash of the core on this computer."""

from __future__ import annotations

from pvid.board.boards import BOARDS
from pvid.board.refined_image import build_refined_image, refined_run
from pvid.board.replay_image import play
from pvid.settings.enums import Reason

TIMEOUT_S = 60.0


def test_a_board_refines_a_first_order_model_with_the_bits_of_this_computer() -> None:
    run = refined_run("rigid_body", 4500, distance=0.1)
    expected = run.native().run_both(run.weak.samples)
    image, _ = build_refined_image(BOARDS["mps2-an386"], run)
    report = play(BOARDS["mps2-an386"], image, TIMEOUT_S)
    assert report.hash == int(expected.hash[-1])
    assert {at: int(expected.hash[at - 1]) for at in report.hashes} == report.hashes
    assert Reason.UPDATED in expected.told
    assert 0 < report.instructions_mean < report.instructions_longest
