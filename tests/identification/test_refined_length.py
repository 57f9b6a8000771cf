"""Which length of block a refinement in float64 takes, and how far it widens a friction."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.refinement import problem as refinement
from pvid.identification.refinement.adoption import refined_answer
from pvid.identification.refinement.fit import Cut, Prior, Problem, Refined, refined
from pvid.identification.refinement.problem import longest_that_fits, problem_of
from pvid.rig.run import Recording
from pvid.sim.simulated_run import simulation_of


def outcome(samples: int, slow: float, converged: bool = True) -> Refined:
    nothing = np.zeros((1, 1))
    cut = Cut(np.zeros(1, np.int32), samples)
    return Refined(np.ones(1), nothing, nothing, 1.0, slow, converged, 1, cut, nothing, 1.0, 1e3)


@pytest.mark.parametrize(
    ("slow", "converged", "taken"), [(1.05, True, 900), (3.25, True, 300), (1.02, False, 300), (9.0, False, 300)]
)
def test_the_longest_block_that_fits_is_taken(slow: float, converged: bool, taken: int) -> None:
    """Along a long block the steps at reversals are too coarse, or the search ends without an outcome."""
    assert longest_that_fits((outcome(300, 1.05), outcome(900, slow, converged))).cut.samples == taken
    assert longest_that_fits((outcome(300, 7.0), outcome(900, slow, converged))).cut.samples == 900


def answer_of(name: str) -> Analysis:
    simulation = simulation_of(name)
    run = simulation.run(1)
    rate = simulation.rig.sample_rate
    recording = Recording(np.arange(len(run["x" if "x" in run else "V"])) / rate, run, rate)
    return analysed(recording, simulation.model)


@pytest.mark.parametrize(("name", "adopted"), [("cart_pendulum", True), ("dc_motor", False)])
def test_short_blocks_that_alone_fit_are_the_answer_where_their_errors_are_smaller(
    name: str, adopted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_long_blocks(problem: Problem, prior: Prior, lengths: Any, before: Refined | None = None) -> Refined:
        found = refined(problem, prior, lengths, before=before)
        return found if before is None else replace(found, converged=False)

    monkeypatch.setattr(refinement, "refined", without_long_blocks)
    weak = answer_of(name)
    answer, found, text = refined_answer(weak)
    assert found is not None and found.found.converged
    assert text.startswith("refined over 14 blocks") if adopted else "shorter ones have larger standard errors" in text
    assert (answer is weak) != adopted


@pytest.mark.parametrize(("growth", "count"), [(10.0, 1), (1.2, 4), (0.5, 4)])
def test_signs_are_widened_no_further_than_they_explain_the_run(
    growth: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of these searches takes seconds, and the widest ones explain a sharp friction 1e5 times as badly."""
    simulation = simulation_of("dc_motor")
    model, run = simulation.model, simulation.run(1)
    p = np.array([simulation.rig.truth[name] for name in model.p_names])
    problem, r = problem_of(model, run, simulation.rig.sample_rate, p)
    widths: list[float] = []

    def worse(self: Problem, r: Any, prior: Any, cut: Any, starts: Any, use: Any, **given: Any) -> Refined:
        widths.append(float(r[self.kernel.widths][0]))
        return replace(found, r=r, sum_of_squares=growth ** len(widths) * 1e3)

    monkeypatch.setattr(Problem, "searched", worse)
    monkeypatch.setattr(refinement, "softened", lambda problem, prior, found, use: (found, prior))
    found = replace(outcome(300, 30.0), r=r)
    refinement.softer(problem, refinement.prior_about(problem, r), found)
    assert len(widths) == count
