"""The trust of the fixed-point weak engine: what it publishes, what it holds back, and float32's verdicts beside it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from weak_rig import assert_same

from bench.board_engine import PUBLISHED, Answer, FixedBoard
from bench.hard import CASES, TRUTH, Case
from pvid.settings.enums import Core, Reason
from pvid.sim.pendulum import standard_start
from pvid.twin.printed import PrintedTwin

VERDICTS = (*PUBLISHED, Reason.HELD_NOT_EXCITED, Reason.HELD_SINGULAR, Reason.HELD_UNCERTAIN)

SEEDS = 2
DURATION_S = 20.0
SETTLED = 12  # windows


def case(label: str) -> Case:
    return next(one for one in CASES if one.label == label)


@lru_cache
def played(label: str, seed: int, core: Core = "q31") -> Answer:
    one = case(label)
    run = one.run(seed, duration=DURATION_S)
    return one.board(core).answer({"phi": run.phi, "y": run.y}, np.append(standard_start(seed), 0.0))


def verdicts(found: Answer) -> list[Reason]:
    """Those of the windows, in their order."""
    return [Reason(int(one)) for one in found.reasons if one in VERDICTS]


@pytest.mark.parametrize(
    "label",
    [
        "no drive, free swing",
        "no drive, no motion",
        "drive, no motion",
        "drive x0.03, 14 bits",
        "slow mode only, one tone, 14 bits",
        "slow mode only, 14 bits",
        "fast mode only, 14 bits",
    ],
)
def test_estimate_without_information_is_not_published(label: str) -> None:
    for seed in range(SEEDS):
        found = played(label, seed)
        assert not found.published
        assert (found.se[:3] > 0.4 * found.p[:3]).all()  # the start's, which may be half wrong


@pytest.mark.parametrize(
    "label", ["encoder of 14 bits", "start x0.05, angle up to 14 LSB, 14 bits", "drive x0.1, 14 bits"]
)
def test_sufficient_data_are_published_with_errors(label: str) -> None:
    for seed in range(SEEDS):
        found = played(label, seed)
        assert found.published
        # 18 numbers within 4 standard errors: 6e-5 of such numbers lie beyond
        assert (np.abs(found.p[:3] - TRUTH) < 4 * found.se[:3]).all()


@pytest.mark.parametrize("label", ["full equations, 0.107 rad, 14 bits", "friction of 0.0001 m^2/s, 14 bits"])
def test_another_mechanism_raises_the_alarm(label: str) -> None:
    for seed in range(SEEDS):
        found = played(label, seed)
        assert not found.published or found.alarm


@pytest.mark.parametrize(
    "label", ["encoder of 14 bits", "full equations, 0.107 rad, 14 bits", "drive x0.03, 14 bits", "drive, no motion"]
)
def test_the_verdicts_are_those_of_float32(label: str) -> None:
    """Window by window once p has settled: from a poor start fixed point repeats its first steps, float32 does not."""
    for seed in range(SEEDS):
        fixed, floating = (played(label, seed, core) for core in ("q31", "f32"))
        one, other = verdicts(fixed), verdicts(floating)
        assert len(one) == len(other) > 20
        apart = [pair for pair in zip(one[SETTLED:], other[SETTLED:], strict=True) if pair[0] != pair[1]]
        # Equations that do not fit keep moving p, by about the step above which it has not converged: rounding decides.
        assert len(apart) <= (1 if one[-1] == Reason.MISFIT else 0)
        assert all(set(pair) == {Reason.HELD_UNCERTAIN, Reason.MISFIT} for pair in apart)
        assert (fixed.published, fixed.alarm) == (floating.published, floating.alarm)


def test_published_estimate_changes_only_when_trusted() -> None:
    found = played("full equations, 0.107 rad, 14 bits", 0)
    changed = 1 + np.flatnonzero((found.history[1:] != found.history[:-1]).any(axis=1))
    assert len(changed) and np.isin(found.reasons[changed], PUBLISHED).all()
    assert np.array_equal(found.history[-1], found.p)


@pytest.mark.parametrize(
    "label",
    [
        "drive x0.03, 14 bits",
        "drive, no motion",
        "slow mode only, 14 bits",
        "full equations, 0.107 rad, 14 bits",
    ],
)
def test_the_twin_has_the_same_integers_where_it_is_hard(label: str) -> None:
    """8 s: windows that are held, steps back to a refuge, an alarm. What is published is compared as well."""
    one, start = case(label), np.append(standard_start(3), 0.0)
    run, board = one.run(3, duration=8.0), one.board("q31")
    assert isinstance(board, FixedBoard)
    readings = board.samples({"phi": run.phi, "y": run.y})
    identifier = board.identifier(start)
    twin = PrintedTwin(identifier.sources, board.config_from(start))
    assert_same(identifier.run_samples(readings), twin.run(readings))
    for name in ("se", "correlation"):
        assert np.ravel(identifier.estimate[name]).tolist() == list(getattr(twin.estimate, name)), name
