"""Rows that came in at a poor start, and do not fit where p has settled since, fade."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from bench.board_weak import BoardWeak, FixedBoard, FloatBoard
from bench.hard import CASES, board, simulation_for
from pvid.sim.simulated_run import RigSimulation

SECONDS = 30
RENEWAL = 0.2


@cache
def rig() -> RigSimulation:
    return simulation_for("kapitza", CASES[0])


def poor() -> npt.NDArray[np.float64]:
    return np.asarray(rig().truth * np.array([0.6, 1.6, 0.6, 1.0]))


def in_float32(renewal: float) -> FloatBoard:
    made = board("kapitza", "f32", 1.0)
    assert isinstance(made, FloatBoard)
    return replace(made, config=replace(made.config, trust=replace(made.config.trust, renewal=renewal)))


def in_fixed_point(renewal: float) -> FixedBoard:
    made = board("kapitza", "q31", 1.0)
    assert isinstance(made, FixedBoard)
    trust = replace(made.weak.config.trust, renewal=round(renewal * 2**16))
    return replace(made, weak=replace(made.weak, config=replace(made.weak.config, trust=trust)))


@pytest.mark.parametrize("board_with", [in_float32, in_fixed_point])
def test_rows_that_do_not_fit_where_p_went_are_forgotten(board_with: Callable[[float], BoardWeak]) -> None:
    """30 s at 14 bits whose encoder is off by a twentieth of the angle in the first 3 s."""
    run = {name: x[: 1000 * SECONDS] for name, x in rig().run(3).items()}
    phi = run["phi"].copy()
    phi[:3000] *= 1 + 0.05 * np.sin(2 * np.pi * 1.7 * np.arange(3000) / 1000)
    found = [board_with(renewal).answer(run | {"phi": phi}, poor()) for renewal in (0.0, RENEWAL)]
    kept, renewed = (float(np.abs(one.p[:3] / rig().truth[:3] - 1).max()) for one in found)
    assert all(one.published for one in found)
    # what is left of the disturbed seconds is a hundredth; the run's own noise is good for 2e-4
    assert kept > 1e-3
    assert renewed < 4e-4
