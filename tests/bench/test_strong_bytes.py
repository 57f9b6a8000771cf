"""Where the bytes of the strong form go: every part has some, none swallows the others; a small build is small."""

from __future__ import annotations

from bench.strong_bytes import TEXT_HEADER, measured, state_rows, text_rows


def test_every_member_of_the_state_has_bytes_and_they_add_up() -> None:
    *parts, whole = [int(size) for _, size in state_rows()]
    assert sum(parts) == whole and min(parts) > 0
    assert max(parts) < 0.55 * whole  # the sums are half of the state


def test_every_part_of_the_code_has_bytes_and_they_add_up() -> None:
    rows = text_rows()
    split = [title for title, *_ in rows].index("**all of the core**")
    for column in range(1, len(TEXT_HEADER)):
        parts = [int(row[column]) for row in rows[:split]]
        whole = int(rows[split][column])
        assert sum(parts) == whole
        assert sum(size > 0 for size in parts) >= len(parts) - 2  # one arithmetic has no part of the other
        assert max(parts) < 0.4 * whole


def test_a_small_build_has_a_solve_at_every_row_in_10_kB() -> None:
    fast, small = measured("f32"), measured("f32", {"PVID_SMALL": "1"})
    assert small.report.hash == fast.report.hash
    assert small.parts.total() <= 10_000
    assert small.report.instructions_mean <= 720
