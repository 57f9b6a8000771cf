"""The bound of a tick: by hand for small functions, and beyond what a search of other samples finds."""

import pytest

from bench.figures import results_of
from bench.ticks import BOARD, HEADER
from pvid.base.errors import PvidError
from pvid.board.longest_tick import longest_tick
from pvid.board.mechanism_image import mechanism_run
from pvid.board.mechanism_image_q31 import fixed_run
from pvid.board.tick_bound import _Block, _functions, _longest_path, _loops, _words
from pvid.settings.enums import Core


@pytest.mark.by_day(2)
@pytest.mark.parametrize("core", ["f32", "q31"])
@pytest.mark.parametrize("name", ["kapitza", "dc_motor", "rigid_body", "two_mass_drive"])  # those of the table
def test_no_tick_of_another_search_is_longer_than_the_bound(name: str, core: Core) -> None:
    """And no loop makes more passes in it: they depend on the design alone."""
    run = mechanism_run(name, long=True) if core == "f32" else fixed_run(name, long=True)
    found, other = longest_tick(BOARD, run), longest_tick(BOARD, run, seed=1)
    assert found.longest <= found.bound and other.longest <= found.bound
    most = {**found.assumed, **found.passes}
    assert not {head: n for head, n in other.passes.items() if n > most[head]}


def test_the_bound_of_a_table_is_beyond_its_search() -> None:
    shown = results_of("ticks")
    assert shown.header == HEADER
    columns = [list(map(int, shown.column(one))) for one in ("searched", "bound", "stack bound")]
    assert all(0 < row[0] <= row[1] < 16 * row[0] and row[2] > 0 for row in zip(*columns, strict=True))


def _of(blocks: dict[int, tuple[int, set[int], bool]]) -> dict[int, _Block]:
    return {at: _Block([at + k for k in range(size)], to, ends) for at, (size, to, ends) in blocks.items()}


def _longest(blocks: dict[int, _Block], passes: dict[int, int], assumed: dict[int, int]) -> int:
    costs = {at: len(block.places) for at, block in blocks.items()}
    return _longest_path(0, blocks, costs, _loops(0, blocks), passes, assumed)


def test_the_longest_path_takes_the_longer_side_and_all_passes() -> None:
    """2 in front; four times the head of 1 and three times 5 or 7; 3 behind."""
    blocks = _of(
        {
            0: (2, {10}, False),
            10: (1, {20, 30, 50}, False),
            20: (5, {10}, False),
            30: (7, {10}, False),
            50: (3, set(), True),
        }
    )
    assert _longest(blocks, {10: 4}, {}) == 2 + 4 * 1 + 3 * 7 + 3
    assert _longest(blocks, {}, {10: 4}) == 2 + 4 * 1 + 3 * 7 + 3


def test_a_triangle_is_counted_once_and_a_loop_that_is_not_reached_does_not_turn() -> None:
    """The inner loop of 0..3 passes has 6 in one call; of two sides with a loop each the longer one counts alone."""
    nested = _of({0: (1, {10}, False), 10: (1, {20, 50}, False), 20: (4, {20, 10}, False), 50: (1, set(), True)})
    assert _longest(nested, {10: 5, 20: 6}, {}) == 1 + 5 + 6 * 4 + 1
    sides = _of({0: (1, {10, 20}, False), 10: (3, {10, 50}, False), 20: (2, {20, 50}, False), 50: (1, set(), True)})
    assert _longest(sides, {10: 4, 20: 5}, {}) == 1 + 4 * 3 + 1


def test_a_loop_that_is_entered_in_its_middle_is_counted() -> None:
    """From 15 into the loop of 10 and 20, past its head."""
    blocks = _of(
        {
            0: (1, {10, 15}, False),
            10: (1, {20}, False),
            15: (30, {20}, False),
            20: (5, {10, 50}, False),
            50: (1, set(), True),
        }
    )
    assert _longest(blocks, {10: 4}, {}) == 1 + 30 + 5 + 4 * (1 + 5) + 1


def test_machine_code_is_read_with_switches_calls_and_conditions() -> None:
    code = """
00000100 <chooses>:
     100:	2c02      	cmp	r4, #2
     102:	d80a      	bhi.n	116 <chooses+0x16>
     104:	e8df f004 	tbb	[pc, r4]
     108:	0302      	.short	0x0302
     10a:	04          	.byte	0x04
     10b:	00          	.byte	0x00
     10c:	bd10      	pop	{r4, pc}
     10e:	4798      	blx	r3
     110:	bf08      	it	eq
     112:	4770      	bxeq	lr
     114:	f000 b804 	b.w	200 <other>
     118:	bd10      	pop	{r4, pc}

00000200 <other>:
     200:	4770      	bx	lr
"""
    with pytest.raises(PvidError, match="a branch without a target"):
        _functions(code.replace("bhi.n\t116 <chooses+0x16>", "bhi.n\tsomewhere"))
    with pytest.raises(PvidError, match="a switch without a table at 104"):
        _functions(code.replace(".short", "nop").replace(".byte", "nop"))
    with pytest.raises(PvidError, match=r"not understood at 10c: ldr.w pc, \[pc, #8\]"):
        _functions(code.replace("pop\t{r4, pc}", "ldr.w\tpc, [pc, #8]", 1))
    (behind,) = [one for one in _functions(code.replace("bx\tlr\n", "nop\n"))[0x200][1].values() if one.ends]
    assert behind.calls == [(0x202, 0x202)]
    name, blocks = _functions(code.replace("116 <chooses+0x16>", "118 <chooses+0x18>"))[0x100]
    assert name == "chooses" and sorted(blocks) == [0x100, 0x104, 0x10C, 0x10E, 0x110, 0x114, 0x118]
    assert blocks[0x104].next == {0x10C, 0x10E, 0x110}  # 0x108 + 2 * (2, 3, 4); the byte behind leads nowhere
    assert blocks[0x10E].calls == [(0x10E, None)] and blocks[0x10E].next == {0x110}
    assert blocks[0x110].ends and blocks[0x110].next == {0x114}
    assert blocks[0x114].ends and blocks[0x114].calls == [(0x114, 0x200)] and not blocks[0x114].next


def test_what_memset_fills_is_that_of_the_functions_reached_not_of_others_of_their_name() -> None:
    code = """
00000100 <prepare>:
     100:	2210      	movs	r2, #16
     102:	f7ff ffff 	bl	300 <memset>

00000200 <prepare>:
     200:	f241 32d0 	movw	r2, #5072	@ 0x13d0
     204:	f7ff ffff 	bl	300 <memset>
"""
    assert list(_words(code, "memset", {0x100})) == [4]
    assert list(_words(code, "memset", {0x100, 0x200})) == [4, 1268]
    assert not list(_words(code, "memmove", {0x100}))
