"""Where the bytes of the strong form go: every part has some, none swallows the others; and the limits of all."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench.strong_bytes import BOARD, TEXT_HEADER, measured, state_rows, text_rows
from bench.tick_methods import VARIANTS, smoothed_run
from pvid.board.boards import BOARDS
from pvid.board.replay_image import build_image, play, standard_run
from pvid.board.sizes import TICKS, TIMEOUT_S
from pvid.settings.f32 import StrongConfig


def test_every_member_of_the_state_has_bytes_and_they_add_up() -> None:
    *parts, whole = [int(size) for _, size in state_rows()]
    assert sum(parts) == whole and min(parts) > 0
    assert max(parts) < 0.6 * whole  # the sums are more than half of the state


def test_every_part_of_the_code_has_bytes_and_they_add_up() -> None:
    rows = text_rows()
    split = [title for title, *_ in rows].index("**all of the core**")
    for column in range(1, len(TEXT_HEADER)):
        parts = [int(row[column]) for row in rows[:split]]
        whole = int(rows[split][column])
        assert sum(parts) == whole
        assert sum(size > 0 for size in parts) >= len(parts) - 2  # one arithmetic has no part of the other
        assert max(parts) < 0.4 * whole


def test_one_build_keeps_all_limits_of_bytes_and_instructions() -> None:
    """Text and state of an image of the strong form, and a tick of each schedule, gate and verdict on."""
    run = standard_run(TICKS)
    assert isinstance(run.config, StrongConfig) and run.config.gate.sigmas > 0
    images = [build_image(BOARDS[BOARD], replace(run, config=one.of(run.config)))[0] for one in VARIANTS]
    exact, lazy, staged = [play(BOARDS[BOARD], image, TIMEOUT_S) for image in images]
    text = measured("f32").parts.total()
    assert text <= 10_000
    assert max(one.state_bytes for one in (exact, lazy, staged)) <= 820
    assert exact.instructions_mean <= 1200
    assert lazy.instructions_mean <= 720
    assert staged.instructions_mean <= 560 and staged.instructions_longest <= 950


def test_a_savitzky_golay_bank_of_315_samples_takes_few_instructions_and_bytes() -> None:
    """On a Cortex-M4F, whole tick: 9 000 instructions and 3.3 kB with a tap for each sample."""
    runs = (smoothed_run(2000), smoothed_run(2000, "q31"))
    of_float, of_integers = [play(BOARDS[BOARD], build_image(BOARDS[BOARD], run)[0], TIMEOUT_S) for run in runs]
    assert of_float.instructions_mean <= 250 and of_float.state_bytes <= 1100
    assert of_integers.instructions_mean <= 900 and of_integers.state_bytes <= 1200


@pytest.mark.parametrize(
    ("target", "divider", "most"),
    [("mps2-an386", 1, 4500), ("mps2-an385", 1, 4500), ("microbit", 1, 16_500), ("microbit", 8, 8000)],
)
def test_fixed_point_keeps_its_limits_without_a_floating_point_unit(target: str, divider: int, most: int) -> None:
    """Instructions a tick in the mean, a solve at every row or every eighth, and 1.2 kB of state."""
    report = play(BOARDS[target], build_image(BOARDS[target], standard_run(TICKS, "q31", divider))[0], TIMEOUT_S)
    assert report.instructions_mean <= most
    assert report.state_bytes <= 1200
