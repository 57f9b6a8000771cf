"""Where the bytes of the strong form go: every part has some, and none swallows the others."""

from __future__ import annotations

import pytest

from bench.strong_bytes import state_rows, text_rows


@pytest.mark.parametrize("rows", [text_rows, state_rows])
def test_every_part_has_bytes_and_they_add_up(rows: object) -> None:
    assert callable(rows)
    *parts, whole = [int(size) for _, size in rows()]
    assert sum(parts) == whole and min(parts) > 0
    assert max(parts) < 0.55 * whole  # the sums are half of the state
