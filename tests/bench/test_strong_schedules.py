"""The bench of the strong form's schedules in its short form: 3 of 40 seeds."""

from __future__ import annotations

from bench.strong_schedules import SAMPLINGS, errors, rms, shares
from bench.tick_methods import VARIANTS
from pvid.core.native import Native


def test_a_schedule_moves_the_estimate_by_a_thirtieth_of_its_error(native: Native) -> None:
    found = errors(native, SAMPLINGS[0], seeds=3)
    assert (rms(found[VARIANTS[0]]) > 1e-3).all()  # the form's own error: 3.5, 8.3 and 8.6 %
    exact, *others = shares(found).values()
    assert (exact == 0).all()
    for one in others:
        assert 0 < one.max() < 1 / 30
