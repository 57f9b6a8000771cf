"""Robots on emulated boards: bits of the host, instructions, memory."""

from dataclasses import replace

import numpy as np
import pytest
from robot_models import ARMS, made

from pvid.board.boards import BOARDS
from pvid.board.replay_image import play
from pvid.board.robot_image import build_robot_image
from pvid.codegen.files_robot import RobotFiles
from pvid.codegen.robot_library import RobotNative
from pvid.settings.enums import Reason


@pytest.mark.parametrize(
    ("arm", "board", "mean", "longest", "kilobytes"),
    # A tenth above what is measured; the longest of 3 joints is to stay below 4 000, that of 7 below 20 000.
    [("spatial", "mps2-an386", 2_860, 4_000, 13), ("panda", "mps2-an500", 7_900, 20_000, 75)],
)
def test_a_robot_on_a_board_has_the_bits_of_the_host(
    arm: str, board: str, mean: int, longest: int, kilobytes: int
) -> None:
    target = BOARDS[board]
    if target.missing:
        pytest.skip(f"{', '.join(target.missing)} missing")
    model, design, samples = made(arm, 0)
    # Estimates are published at once.
    design = replace(design, start_sd=1e3 * design.start_sd, noise_sd=0.1 * design.noise_sd)
    samples = samples[: {"spatial": 5, "panda": 3}[arm] * int(ARMS[arm])].copy()
    samples[600, 0] = np.nan
    samples[200:500, 0] = samples[200, 0]  # a rest
    reason, hashes = RobotNative(model, design).run(samples)
    assert Reason.UPDATED in reason
    report = play(target, build_robot_image(target, RobotFiles(model, "a test", design), samples)[0], 120.0)
    assert report.hash == int(hashes[-1])
    assert report.instructions_mean < mean and report.instructions_longest < longest
    assert report.state_bytes + report.stack_used < 1000 * kilobytes
