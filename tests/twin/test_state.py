"""The state of the compiled core, taken over by the twin at any tick."""

import re
from collections.abc import Callable
from typing import Any

import field_board
import numpy as np
import pytest

from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.strong_board import StrongBoard
from pvid.core.weak_native import RefinedIdentifier

FOLLOWED = 120  # ticks


@pytest.mark.parametrize(
    "made",
    [
        lambda: MechanismBoard.of_guess(field_board.rig()),
        lambda: MechanismBoard.of_guess(field_board.rig(), refined=True),
        lambda: MechanismBoardQ31.of_guess(field_board.rig()),
        lambda: StrongBoard.of_guess(field_board.rig()),
    ],
    ids=["weak f32", "both stages", "weak q31", "strong f32"],
)
def test_the_twin_goes_on_from_the_state_of_the_core_at_any_tick(made: Callable[[], Any]) -> None:
    board = made()
    frame = board.configure(1, 100, 100)
    core, twin = board.core_of(frame), board.twin_of(frame)
    run = core.run_both if isinstance(core, RefinedIdentifier) else core.run_samples
    random, first, stretches = np.random.default_rng(1), 0, 0
    samples = np.concatenate([board.recording[:8000]] * 2)
    while first < 9000:
        skipped = first + int(random.integers(1, 400))
        run(samples[first:skipped])
        twin.take_over(core.placed, core.running_hash)
        first = skipped + FOLLOWED
        found = twin.run(samples[skipped:first])
        np.testing.assert_array_equal(run(samples[skipped:first]).hash, found.hash)
        assert np.array_equal(np.asarray(twin.estimate.p, core.estimate["p"].dtype), core.estimate["p"])
        assert core.counters == twin.counters
        stretches += 1
    assert stretches > 20 and core.counters["updates"] > 5


def test_a_pointer_into_the_state_of_the_core_is_one_into_that_of_the_twin() -> None:
    """Within a solve and an assessment; a new twin, none of whose pointers has been set yet."""
    board = MechanismBoard.of_guess(field_board.rig())
    frame = board.configure(1, 100, 100)
    core, pointed = board.core_of(frame), []
    core.run_samples(board.recording[:1990])
    for tick in range(1990, 2150, 5):
        twin = board.twin_of(frame)
        twin.take_over(core.placed, core.running_hash)
        solve = twin.state.finish.work.solve
        assert solve.estimate in (None, twin.state.finish.candidate)
        assert solve.noise is None or solve.noise is twin.state.finish.candidate.covariance
        pointed.append((solve.noise is None, solve.estimate is None))
        found = twin.run(board.recording[tick : tick + 40])
        np.testing.assert_array_equal(core.run_samples(board.recording[tick : tick + 5]).hash, found.hash[:5])
        expected = board.core_of(frame).run_samples(board.recording[: tick + 40]).hash[tick:]
        np.testing.assert_array_equal(found.hash, expected)
    assert {(True, True), (False, True), (True, False)} <= set(pointed)


@pytest.mark.parametrize(
    "made",
    [
        lambda: MechanismBoard.of_guess(field_board.rig(), refined=True),
        lambda: MechanismBoardQ31.of_guess(field_board.rig()),
    ],
    ids=["both stages", "weak q31"],
)
def test_every_public_function_of_an_identifier_is_printed(made: Callable[[], Any]) -> None:
    """Also those that `step` does not reach: CONTRIBUTING.md promises that the twin needs no line for them."""
    board = made()
    frame = board.configure(1, 100, 100)
    core, twin = board.core_of(frame), board.twin_of(frame)
    names = {name for name in dir(core.native.library) if re.fullmatch(r"pvid_(weak|refine)_\w+", name)}
    assert len(names) >= 6
    assert names <= set(vars(twin.module))
