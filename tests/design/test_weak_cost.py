"""The weak form must not break a loop at a window's end: no tick costs more than three times the mean one."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cost import build
from bench.spread import PERIOD, measure
from pvid.base.errors import PvidError


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("level", ["-O2", "-O3"])
def test_the_longest_tick_is_within_three_means(tmp_path: Path, compiler: str, level: str) -> None:
    spread = measure(build(tmp_path, compiler, level))
    assert spread.ratio <= 3.0, (spread.mean, spread.longest)


def test_every_period_costs_the_same(tmp_path: Path) -> None:
    """The schedule repeats to the instruction, whatever the samples (a fold of the sums comes at every window)."""
    spread = measure(build(tmp_path), periods=3)
    first, second, third = (sum(spread.ticks[i * PERIOD : (i + 1) * PERIOD]) for i in range(3))
    # a slice of the ring may stand across its end: a second run of the loop, at another place each time
    assert max(first, second, third) - min(first, second, third) < 0.01 * first


def test_a_binary_that_fails_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(PvidError, match="ticks failed"):
        measure(tmp_path / "no-such-binary")
