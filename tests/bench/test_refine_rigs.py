"""Both stages on random rigs: which stage answers, and the table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.campaign.judge import Judgement
from bench.campaign.population import shipped
from bench.campaign.truth import simulate_rig
from bench.refine_rigs import HEADER, Outcome, outcome_of, table_of
from pvid.core.native import Native


def test_a_rig_is_refined_where_its_samples_have_room_for_the_steps() -> None:
    """Of seed 7: rig 25 is refined, with smaller errors than the weak form's; rig 6 has too few samples."""
    refined, coarse = (outcome_of(simulate_rig(Native(), shipped(), 7, index)) for index in (25, 6))
    assert refined.refined is not None and refined.weak is not None and not refined.wrong
    assert refined.refined.relative.max() < refined.weak.relative.max()
    assert not coarse.steps and coarse.refined is None and coarse.weak is not None
    rows = table_of([refined, coarse])
    assert [len(row) for row in rows] == [len(HEADER)] * 3
    assert rows[-1][:8] == ("all", "2", "2", "1", "1", "0", "1", "2")


def test_a_column_without_information_stays_out_of_the_block() -> None:
    """Two frictions that are nearly collinear: with a column that came and went d2 was 5 % off, 6.5 standard errors,
    and most such rigs were not refined."""
    found = outcome_of(simulate_rig(Native(), shipped(), 8, 55))
    assert found.suffices and not found.wrong


def test_a_warning_makes_an_answer_of_the_weak_form_not_wrong() -> None:
    far = Judgement.of(np.full(3, 1.1), np.full(3, 0.01), np.ones(3))
    weak = Outcome("clean", True, None, far, True, False)
    assert weak.wrong and not replace(weak, warned=True).wrong
    assert replace(weak, refined=far, warned=True).wrong  # a refined one has none
