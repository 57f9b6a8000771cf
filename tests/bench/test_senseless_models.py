"""Descriptions without sense, in short: a report or one sentence, never a traceback."""

from __future__ import annotations

import random

from bench.senseless_models import described, run


def test_every_description_without_sense_is_reported_or_refused_in_one_sentence() -> None:
    tally = run(range(40))
    assert tally.tracebacks == []
    assert tally.count["refused"] > 10


def test_a_seed_describes_the_same_model_again() -> None:
    for seed in (0, 2, 3, 5):
        one, other = (described(random.Random(seed)) for _ in range(2))
        assert [each.expression for each in one.equations] == [each.expression for each in other.equations]
