"""The bench of every mechanism on every board: one row in part, and that a wrong bit shows."""

from dataclasses import replace

import numpy as np
import pytest

from bench.figures import results_of
from bench.model_boards import HEADER, USUAL, differs, reason_for_no_figure, row_of, rows
from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.replay_image import ReplayReport


def test_a_board_of_each_instruction_set_has_a_row_for_each_core() -> None:
    assert {core for _, core in rows()} == {"f32", "q31"} and len(rows()) == 2 * len({one.name for one, _ in rows()})
    others = {one.core for one in BOARDS.values()} - {one.core for one, _ in rows()}
    assert others == {"Cortex-M7F", "ATmega328P"}  # an M4F's instructions; too little memory for any mechanism


@pytest.mark.night
@pytest.mark.slow
@pytest.mark.parametrize(
    ("board", "core", "names"),
    [
        pytest.param("mps2-an505", "f32", ("furuta",), marks=pytest.mark.long),
        pytest.param("mps3-an547", "q31", ("cart_pendulum",), marks=pytest.mark.long),
        ("atmega2560", "f32", ("kapitza",)),
        ("atmega2560", "q31", ("furuta", "rigid_body")),  # variables; the samples, an array above 32 767 bytes
    ],
)
def test_a_row_has_the_cost_of_each_mechanism_and_equal_bits(board: str, core: str, names: tuple[str, ...]) -> None:
    row = row_of(BOARDS[board], core, names)  # type: ignore[arg-type]
    assert len(row) == len(HEADER) - 8 + len(names)
    if board == "atmega2560":
        assert row[2:] == (*["no float32" if core == "f32" else "no room"] * len(names), "-")
    else:
        assert all(int(cell) > 100 for cell in row[2:-1]) and row[-1] == "equal"


def test_a_wrong_bit_is_found() -> None:
    expected = np.arange(7, 1007, dtype=np.uint32)
    report = ReplayReport(1000, 1006, {500: 506, 1000: 1006}, 199.7, 780.0, 600, 16384, 4536, 632)
    assert not differs(report, expected)
    assert differs(replace(report, hash=1), expected)
    assert differs(replace(report, hashes={500: 505}), expected)
    assert differs(report, expected[:-1])


@pytest.mark.parametrize("fault", ["the build failed: error: x", "the image stopped", "float32 is not installed"])
def test_a_fault_is_no_reason_for_a_missing_figure(fault: str) -> None:
    with pytest.raises(PvidError, match=fault):
        reason_for_no_figure(PvidError(f"mps2-an386: {fault}"))


def test_the_table_of_results_has_every_row_and_equal_bits() -> None:
    kept = results_of("model-boards")
    assert kept.header == HEADER
    assert [row[:2] for row in kept.rows] == [(f"{board.core} ({board.name})", core) for board, core in rows(USUAL)]
    for row in kept.rows:
        played_cells = [cell for cell in row[2:-1] if not cell.startswith("no ")]
        assert row[-1] == ("equal" if played_cells else "-") and all(int(cell) > 100 for cell in played_cells)
        assert len(played_cells) == len(row) - 3 or row[0].startswith("ATmega")
