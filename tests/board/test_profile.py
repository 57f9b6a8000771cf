"""Instructions of a tick by function: their sum is the whole, and the table of results has them as measured."""

import pytest

from bench.figures import results_of
from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.profile import HEADER, Profile, in_blocks, profile, refined, table_rows
from pvid.board.sizes import IN_BLOCKS, REFINED
from pvid.settings.forms import FORMS

BOARD = "mps2-an386"
MOST_OF_A_CALL = 12  # instructions of the main loop between the two readings: arguments, call, the second reading


@pytest.fixture(scope="module")
def profiles() -> dict[str, Profile]:
    board = BOARDS[BOARD]
    return {**{form: profile(board, form) for form in FORMS}, REFINED: refined(board), IN_BLOCKS: in_blocks(board)}


@pytest.mark.parametrize("form", (*FORMS, IN_BLOCKS))
def test_the_functions_add_up_to_the_measured_mean(profiles: dict[str, Profile], form: str) -> None:
    one = profiles[form]
    assert 0 < one.measured - one.total < MOST_OF_A_CALL
    assert min(one.functions.values()) > 0


@pytest.mark.parametrize("form", FORMS)
def test_only_what_a_tick_calls_is_counted(profiles: dict[str, Profile], form: str) -> None:
    names = {name for name, _ in profiles[form].functions}
    own = "kapitza_strong" if form == "strong" else "pvid_weak"
    assert f"{own}_step_f32" in names
    assert not names & {"main", "pvid_port_instructions", "pvid_fnv_estimator_f32", f"{own}_fnv_f32", f"{own}_init_f32"}


def test_the_table_of_results_has_what_is_measured(profiles: dict[str, Profile]) -> None:
    shown, measured = results_of("profile").rows, table_rows(profiles)
    at = HEADER.index("instructions")
    assert [row[:at] for row in shown] == [row[:at] for row in measured]
    assert [int(row[at]) for row in shown] == pytest.approx([int(row[at]) for row in measured], rel=0.02, abs=1)


def test_an_emulator_without_plugins_is_one_sentence() -> None:
    with pytest.raises(PvidError, match="only QEMU"):
        profile(BOARDS["atmega2560"], "strong")
