"""Both stages with the generated C of a mechanism on an emulated board: the hash of the core on this computer."""

import pytest
from processes import PATIENCE_S

from pvid.board.boards import BOARDS
from pvid.board.refined_image import RefinedRun, build_refined_image, published_run, refined_run
from pvid.board.replay_image import play
from pvid.settings.enums import Reason


@pytest.mark.parametrize(
    ("name", "ticks", "board"),
    [
        ("rigid_body", 4500, "mps2-an386"),  # of order 1, steps of Adams
        ("dc_motor", 3000, "mps2-an386"),  # sharp friction, steps of Runge-Kutta
        pytest.param("dc_motor", 2400, "mps2-an385", marks=pytest.mark.long),  # without a floating point unit
    ],
)
def test_a_board_refines_a_mechanism_with_the_bits_of_this_computer(name: str, ticks: int, board: str) -> None:
    _plays(refined_run(name, ticks, distance=0.1), board)


def test_a_board_refines_the_pendulum_with_dry_friction_and_slant() -> None:
    board = "mps2-an386"
    _plays(published_run("kapitza", 6500, BOARDS[board], ("dry_friction", "slant")), board)


def _plays(run: RefinedRun, board: str) -> None:
    expected = run.native().run_both(run.weak.samples)
    image, _ = build_refined_image(BOARDS[board], run)
    report = play(BOARDS[board], image, PATIENCE_S)
    assert report.hash == int(expected.hash[-1])
    assert {at: int(expected.hash[at - 1]) for at in report.hashes} == report.hashes
    assert Reason.UPDATED in expected.told
    assert 0 < report.instructions_mean < report.instructions_longest
