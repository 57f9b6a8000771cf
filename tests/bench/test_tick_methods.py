"""The side by side of recursive least squares and the strong form: what it counts, and that a failure shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.tick_methods import BASELINES, VARIANTS, exact_rows, safe_rows, safe_ticks
from pvid.board.replay_image import standard_run
from pvid.core.native import Native
from pvid.settings.f32 import StrongConfig

RUN = standard_run(1000)


@pytest.mark.parametrize("name", [name for name, _ in BASELINES])
def test_a_baseline_is_safe_on_good_rows_and_not_on_wrong_ones(name: str) -> None:
    n, y = exact_rows(RUN)
    assert safe_rows(name, n, y, 20_000) == 20_000
    assert safe_rows(name, n, -y, 20_000) == 0
    assert safe_rows(name, n, np.full_like(y, np.nan), 20_000) == 0


def test_the_strong_form_is_safe_in_every_schedule(native: Native) -> None:
    assert isinstance(RUN.config, StrongConfig)
    for variant in VARIANTS:
        assert safe_ticks(native, variant.of(RUN.config), RUN, 20_000) == 20_000
    blind = replace(RUN.config, estimator=replace(RUN.config.estimator, upper=RUN.config.estimator.start))
    assert safe_ticks(native, replace(blind, l1=10 * blind.l1), RUN, 20_000) < 20_000
