"""The scatter of scores in integers, printed from its C, beside the rule in float64."""

from functools import cache
from types import ModuleType

import numpy as np
import numpy.typing as npt
import pytest

from pvid.core.sources import FOLDERS, sources_of
from pvid.twin.printer.program import printed_module

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


@cache
def core() -> ModuleType:
    sources = [one for one in sources_of("q31") if one.parent.name in ("weak", "solve", "number", "judge")]
    return printed_module(sources, FOLDERS, {}, ["pvid_weak_scores_add_q31", "pvid_weak_scores_widen_q31"])


class Scores:
    """pvid_weak_scores_q31 of a printed core, with an estimator; least: forgetting between two windows."""

    def __init__(self, least: float = 0.0) -> None:
        module = core()
        self.state, self._estimator = module.pvid_weak_scores_q31(), module.pvid_estimator_q31()
        self._estimator.model = module.pvid_model_q31(n_p=N_P)
        self._estimator.divider = self._estimator.information.block = 1
        self._estimator.information.retention = min(round(2**31 * (1 - least)), 2**31 - 1)

    def add(self, score: Float, ratio: int = RATIO) -> None:
        """A window with this score and residual variance over its expectation [Q24]."""
        solve, exponent = core().pvid_estimator_solve_q31(), np.frexp(score)[1] - 29
        solve.score[:N_P] = [int(one) for one in np.rint(score * 2.0**-exponent)]
        solve.score_exponent[:N_P] = exponent.tolist()
        core().pvid_weak_scores_add_q31(self.state, self._estimator, solve, ratio)

    def skip(self) -> None:
        """A window without rows."""
        self.state.known = False

    def errors(self, weight: int) -> Float:
        """Standard errors of 0, widened."""
        assessment, estimate = core().pvid_estimator_solve_q31(), core().pvid_estimate_q31(weight=weight)
        for root, length in zip(assessment.part.inverse.root, LENGTHS.tolist(), strict=False):
            root.r, root.e = 2**30, length + 1 + core().pvid_unit_bits_q31(N_P)
        size = int(len(estimate.correlation) ** 0.5)
        for a, row in enumerate(np.rint(CORRELATION * 2**30).astype(int).tolist()):
            estimate.correlation[a * size : a * size + N_P] = row
        core().pvid_weak_scores_widen_q31(self.state, self._estimator, assessment, ROWS, 0, N_P, estimate)
        return np.array(estimate.se[:N_P], np.float64)


@pytest.mark.parametrize("least", [0.0, 0.05])
@pytest.mark.parametrize("growth", [1.0, 1.01, 0.99])
def test_errors_are_those_of_float64(least: float, growth: float) -> None:
    """Of scores correlated from window to window that grow or fall by seven times; single ones are far larger."""
    random = np.random.default_rng(2)
    scores, reference = Scores(least), Reference(least)
    noise = random.normal(size=(201, N_P))
    for k in range(200):
        own = (noise[k] + 0.7 * noise[k + 1]) * UNITS * growth**k * (30.0 if k == 90 else 1.0)
        scores.add(own)
        reference.add(own)
        if k > 2:  # a few digits of a standard error are lost in its own integer
            assert np.allclose(scores.errors(ROWS * k), reference.errors(k), rtol=0.01, atol=2.0), k


def test_a_window_without_rows_or_neighbour_is_left_out() -> None:
    scores, reference = Scores(), Reference(0.0)
    random = np.random.default_rng(3)
    for k in range(30):
        own = random.normal(size=N_P) * UNITS
        if k % 3 == 1:
            scores.skip()
            reference.before = None
        else:
            scores.add(own)
            reference.add(own)
    assert scores.state.windows == 20
    assert np.allclose(scores.errors(ROWS * 20), reference.errors(20), rtol=0.01)


def test_windows_far_from_the_solution_are_forgotten_with_the_first_that_is_near() -> None:
    scores, reference = Scores(), Reference(0.0)
    random = np.random.default_rng(4)
    for k in range(20):
        near = k >= 5
        own = random.normal(size=N_P) * UNITS * (1.0 if near else 1000.0)
        scores.add(own, RATIO if near else 21 * RATIO)
        if near:
            reference.add(own)
    assert scores.state.windows == 15
    assert np.allclose(scores.errors(ROWS * 15), reference.errors(15), rtol=0.01)


def test_scores_of_zero_leave_the_errors() -> None:
    scores = Scores()
    for _ in range(3):
        scores.add(np.zeros(N_P))
    assert scores.errors(ROWS * 3).tolist() == [0.0] * N_P
    scores.add(UNITS)
    assert (scores.errors(ROWS * 4) > 0).all()
