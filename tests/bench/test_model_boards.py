"""The bench of every mechanism on every board: one row in part, and that a wrong bit shows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench.model_boards import HEADER, differs, played, row_of, rows
from pvid.board.boards import BOARDS


def test_a_board_of_each_instruction_set_has_a_row_for_each_core() -> None:
    assert {core for _, core in rows()} == {"f32", "q31"} and len(rows()) == 2 * len({one.name for one, _ in rows()})
    others = {one.core for one in BOARDS.values()} - {one.core for one, _ in rows()}
    assert others == {"Cortex-M7F", "ATmega328P"}  # an M4F's instructions; too little memory for any mechanism


@pytest.mark.slow
@pytest.mark.parametrize(
    ("board", "core", "names"),
    [
        ("mps2-an505", "f32", ("furuta",)),
        ("mps3-an547", "q31", ("cart_pendulum",)),
        ("atmega2560", "f32", ("kapitza",)),
    ],
)
def test_a_row_has_the_cost_of_each_mechanism_and_equal_bits(board: str, core: str, names: tuple[str, ...]) -> None:
    row = row_of(BOARDS[board], core, names)  # type: ignore[arg-type]
    assert len(row) == len(HEADER) - 8 + len(names)
    if board == "atmega2560":
        assert row[2:] == ("no float32", "-")
    else:
        assert all(int(cell) > 100 for cell in row[2:-1]) and row[-1] == "equal"


def test_a_wrong_bit_is_found() -> None:
    report, expected = played(BOARDS["mps2-an386"], "cart_pendulum", "f32")
    assert not differs(report, expected)
    assert differs(replace(report, hash=report.hash ^ 1), expected)
    assert differs(replace(report, ticks=report.ticks - 1), expected)
