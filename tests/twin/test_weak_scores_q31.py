"""The scatter of scores in integers: its twin, whose bits the C has, beside the rule in float64."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid.twin.q31.estimator import Inverse
from pvid.twin.q31.integer import integers
from pvid.twin.q31.scaled import Scaled
from pvid.twin.q31.weak_scores import Scores

Float = npt.NDArray[np.float64]

N_P, ROWS, RATIO = 3, 5, 1 << 24
CORRELATION = np.array([[1, 0.9, -0.3], [0.9, 1, 0.1], [-0.3, 0.1, 1]])
LENGTHS = np.array([6, 0, -5])  # of the diagonal of the inverse: powers of two
UNITS = 2.0 ** (16 - LENGTHS)  # of the scores


class Reference:
    """The rule, as scores_f32.c has it, for a mean square of residuals that stays the same."""

    def __init__(self, least: float) -> None:
        self.least, self.windows = least, 0
        self.before: Float | None = None
        self.same, self.neighbour = np.zeros((2, N_P, N_P))

    def add(self, own: Float) -> None:
        weight = max(2 / (self.windows + 2), self.least)
        self.same += weight * (np.outer(own, own) - self.same)
        if self.before is not None:
            both = np.outer(own, self.before)
            self.neighbour += weight * (both + both.T - self.neighbour)
        self.before = own
        self.windows += 1

    def errors(self, windows: float) -> Float:
        z = CORRELATION * 2.0**LENGTHS
        same, neighbour = (np.einsum("ab,bc,ac->a", z, g, z) for g in (self.same, self.neighbour))
        return np.asarray(2.0**LENGTHS * np.sqrt(windows * (same + np.maximum(neighbour, 0))))


def estimator_of(score: Float, least: float = 0.0) -> Any:
    """What `Scores` reads of an estimator of one lane."""
    exponent = np.frexp(score)[1] - 29
    return SimpleNamespace(
        was_due=True,
        divider=1,
        block=integers([1]),
        retention=integers([min(round(2**31 * (1 - least)), 2**31 - 1)]),
        exponent=integers([0]),
        score=Scaled(integers(np.rint(score * 2.0**-exponent))[:, None], integers(exponent)[:, None]),
    )


def errors_of(scores: Scores, weight: int) -> Float:
    """Standard errors of 0, widened."""
    estimator = estimator_of(np.zeros(N_P))
    length = np.full((N_P, 1), 2**30)
    estimator.inverse = Inverse(length, integers(LENGTHS)[:, None] - 30, np.array([True]))
    candidate = np.zeros(1, [("se", np.int32, (N_P,)), ("correlation", np.int32, (N_P, N_P)), ("weight", np.uint32)])
    candidate["correlation"] = np.rint(CORRELATION * 2**30)
    candidate["weight"] = weight
    scores.widen(candidate, estimator, ROWS)
    return np.asarray(candidate["se"][0], np.float64)


@pytest.mark.parametrize("least", [0.0, 0.05])
@pytest.mark.parametrize("growth", [1.0, 1.01, 0.99])
def test_errors_are_those_of_float64(least: float, growth: float) -> None:
    """Of scores correlated from window to window that grow or fall by seven times; single ones are far larger."""
    random = np.random.default_rng(2)
    scores, reference = Scores(N_P, 1), Reference(least)
    noise = random.normal(size=(201, N_P))
    for k in range(200):
        own = (noise[k] + 0.7 * noise[k + 1]) * UNITS * growth**k * (30.0 if k == 90 else 1.0)
        scores.add(estimator_of(own, least), integers([RATIO]))
        reference.add(own)
        if k > 2:  # a few digits of a standard error are lost in its own integer
            assert np.allclose(errors_of(scores, ROWS * k), reference.errors(k), rtol=0.01, atol=2.0), k


def test_a_window_without_rows_or_neighbour_is_left_out() -> None:
    scores, reference = Scores(N_P, 1), Reference(0.0)
    random = np.random.default_rng(3)
    for k in range(30):
        own = random.normal(size=N_P) * UNITS
        if k % 3 == 1:
            scores.add(estimator_of(own), integers([0]))
            reference.before = None
        else:
            scores.add(estimator_of(own), integers([RATIO]))
            reference.add(own)
    assert scores.windows.tolist() == [20]
    assert np.allclose(errors_of(scores, ROWS * 20), reference.errors(20), rtol=0.01)


def test_windows_far_from_the_solution_are_forgotten_with_the_first_that_is_near() -> None:
    scores, reference = Scores(N_P, 1), Reference(0.0)
    random = np.random.default_rng(4)
    for k in range(20):
        near = k >= 5
        own = random.normal(size=N_P) * UNITS * (1.0 if near else 1000.0)
        scores.add(estimator_of(own), integers([RATIO if near else 21 * RATIO]))
        if near:
            reference.add(own)
    assert scores.windows.tolist() == [15]
    assert np.allclose(errors_of(scores, ROWS * 15), reference.errors(15), rtol=0.01)


def test_scores_of_zero_leave_the_errors() -> None:
    scores = Scores(N_P, 1)
    for _ in range(3):
        scores.add(estimator_of(np.zeros(N_P)), integers([RATIO]))
    assert errors_of(scores, ROWS * 3).tolist() == [0.0] * N_P
    scores.add(estimator_of(UNITS), integers([RATIO]))
    assert (errors_of(scores, ROWS * 4) > 0).all()
