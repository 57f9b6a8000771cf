"""Standard errors of sums that lost their digits: none is smaller than the sensors allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.board_engine import PUBLISHED, board_of
from bench.pendulum import RIGS, cramer_rao, design_for, model_for
from pvid.settings.enums import Core
from pvid.sim.pendulum import STANDARD_PENDULUM

RIG = replace(RIGS[0], bits=17)
TRUTH = STANDARD_PENDULUM.linear
FAR = TRUTH * np.array([0.65, 0.5, 1.5])


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_a_large_step_leaves_standard_errors(core: Core) -> None:
    """A fine encoder and a guess that is far off: after the first steps nothing is left of the residuals' sum of
    squares in float32. Without a floor under it the core publishes standard errors of exactly 0."""
    board = board_of(model_for(RIG), RIG.signals(0), design_for(RIG), np.append(TRUTH, 0.0), core)
    found = board.answer(RIG.signals(1), np.append(FAR, 0.0))
    of_publications = found.errors[np.isin(found.reasons, PUBLISHED)]
    assert len(of_publications) and (of_publications > 0).all()
    assert (found.se[:3] > 0.5 * cramer_rao(RIG) * TRUTH).all()
