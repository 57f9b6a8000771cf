"""The search of a refinement: starts, blocks, extras, gaps and jumps of the drive, for several mechanisms."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from pendulum_plant import SLIP, STANDARD_PENDULUM
from refinements import (
    DAMPED,
    ISOLATED,
    PENDULUM,
    answer_of,
    changed,
    errors_of,
    errors_over_se,
    pendulum_model,
    pendulum_run,
    played,
    refined_of,
    run_of,
    subject,
)

from pvid.base.errors import PvidError
from pvid.identification.refinement import problems as refined_problems
from pvid.identification.refinement.adoption import refined_answer
from pvid.identification.refinement.fit import Prior
from pvid.identification.refinement.friction import without_push
from pvid.identification.refinement.problems import Problems
from pvid.identification.refinement.search import TOO_LONG, refine
from pvid.identification.refinement.starts import starts_of
from pvid.identification.values import outputs_at
from pvid.rig.run import Recording

DRIVEN = ("kapitza", "isolator")  # by the second derivative of a sensor
BY_STEPS = ("dc_motor", "heated_plate", "free_pendulum")  # of an input, or of nothing


def test_a_pendulum_with_friction_at_0_4_rad_is_refined_to_its_standard_errors() -> None:
    refined = refined_of("kapitza")
    errors, se = errors_of(refined, PENDULUM)
    assert refined.found.converged and 0.9 < refined.found.chi2 < 1.1 and refined.found.slow_chi2 < 1.5
    assert (np.abs(errors) < 3 * se).all() and (np.abs(errors) < 2e-4).all() and (se < 2e-4).all()
    l1 = STANDARD_PENDULUM.l1
    for name, damping in (("k1", DAMPED.damping1), ("k2", DAMPED.damping2)):
        value, error = refined.extras[name]
        assert abs(value - damping / l1**2) < 4 * error < damping / l1**2


@pytest.mark.parametrize("name", BY_STEPS)
def test_a_first_fit_of_noise_is_all(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a start that is 5 % off to its standard errors."""

    def none(*_: object) -> None:
        raise AssertionError("a search over several starts")

    monkeypatch.setattr("pvid.identification.refinement.search.Problems", none)
    found = refine(answer_of(name))
    assert found.found.converged and found.found.slow_chi2 < 1.3
    assert (np.abs(errors_over_se(found, subject(name))) < 3).all()


@pytest.mark.parametrize(("name", "stretches"), [("isolator", 4), ("dc_motor", 4), ("free_pendulum", 1)])
def test_gaps_of_a_drive_lie_between_the_blocks_and_cost_what_they_cut_out(name: str, stretches: int) -> None:
    """Behind a gap of the drive the motion is another one than that of a drive that is interpolated across it; a free
    motion goes on across the gap."""
    run, of = run_of(name), subject(name)
    missing = np.zeros(len(run), bool)
    for first in (3, 8, 13):
        missing[first * len(run) // 16 :][: len(run) // 27] = True
    cut = changed(run, **{key: np.where(missing, np.nan, one) for key, one in run.signals.items()})
    outcome, whole = refine(answer_of(name, cut)), refined_of(name)
    assert outcome.found.converged and outcome.found.slow_chi2 < 1.5
    assert len(outcome.problem.stretches) == stretches
    assert (np.abs(errors_over_se(outcome, of)) < 3.5).all()
    assert all(outcome.errors[one] < 1.7 * whole.errors[one] for one in of.model.p_names)
    every = round(run.sample_rate / outcome.problem.measured.rate)
    if stretches > 1:
        for first in outcome.found.cut.first * every:
            assert not missing[first : first + outcome.found.cut.samples * every].any()


def test_wild_samples_and_lost_ones_of_the_drive_leave_no_bias() -> None:
    """A jump of the drive widened the band of its filter to where it is not exact: a parameter was 0.2 % off, 20
    standard errors, with residuals like noise."""
    run = run_of("isolator")
    b = run.signals["b"].copy()
    b[[400, 2800, 5200]] += (0.5, -2e-3, 0.05)
    kept = np.delete(np.arange(len(run)), np.arange(4000, 4040))
    cut = Recording(run.t[: len(kept)], {"x": run.signals["x"][kept], "b": b[kept]}, run.sample_rate)
    answer, outcome, _ = refined_answer(answer_of("isolator", cut))
    assert outcome is not None
    assert outcome.found.converged and outcome.found.slow_chi2 < 1.5
    assert (np.abs(errors_over_se(outcome, subject("isolator"))) < 3).all()
    assert all(outcome.errors[one] < 1.5 * refined_of("isolator").errors[one] for one in ISOLATED)
    assert outcome.breaks == pytest.approx((8.0,), abs=0.01)
    assert answer.recording.notes[-1].startswith("b jumps at ")
    assert "lost samples that do not show in t, a repeated buffer, or a changed offset" in answer.recording.notes[-1]


def test_the_delay_of_a_frame_that_is_read_early_is_positive_and_costs_no_accuracy() -> None:
    refined = refined_of("isolator", 1e-3)
    value, error = refined.extras["tau"]
    assert abs(value - 1e-3) < max(4 * error, 5e-6)
    assert (np.abs(errors_over_se(refined, subject("isolator"))) < 3.5).all()


@pytest.mark.parametrize("name", [*DRIVEN, "heated_plate"])
def test_other_starts_are_tried_where_the_first_one_leads_nowhere(name: str) -> None:
    """Of a weak form that determines nothing, and is off by a factor of 30."""
    of = subject(name)
    lost = answer_of(name, factor=30.0, lacking=of.model.p_names)
    assert (np.abs(errors_over_se(refine(lost), of)) < 3.5).all()


def test_dry_friction_is_refined_with_the_speed_at_which_it_is_in_full() -> None:
    """Narrower than the narrowest sign that is tried: with that one, w is .5 % off, and residuals are above noise."""
    rubbing = replace(STANDARD_PENDULUM, dry1=3e-3, dry2=3e-3)  # [m^2/s^2]
    outcome = refine(answer_of("kapitza", pendulum_run(of=rubbing, seed=0)))
    errors, se = errors_of(outcome, PENDULUM)
    assert outcome.found.converged and outcome.found.slow_chi2 < 1.5
    assert (np.abs(errors) < 3 * se).all() and (np.abs(errors) < 1e-3).all()
    width, error = outcome.extras["width_a1_1_a2_1"]
    assert abs(width / SLIP - 1) < 0.3 and 0 < error < 0.1 * width  # of tanh(v / SLIP), another law


@pytest.mark.parametrize(("name", "sensor", "half"), [("isolator", "x", 1e-4), ("dc_motor", "phi", 1e-2)])
def test_a_play_of_a_sensor_is_found_and_costs_no_accuracy(name: str, sensor: str, half: float) -> None:
    run, of = run_of(name), subject(name)
    outcome = refine(answer_of(name, changed(run, **{sensor: played(run.signals[sensor], half)})))
    ((value, error),) = [x for extra, x in outcome.extras.items() if extra in ("play", f"play_{sensor}")]
    assert outcome.found.converged and abs(value - half) < 0.02 * half and error < 0.02 * half
    assert (np.abs(errors_over_se(outcome, of)) < 3.5).all()


def test_where_residuals_are_noise_blocks_grow() -> None:
    """Each block has a start of its own to find: with fewer of them the noise leaves smaller standard errors."""
    outcome = refine(replace(answer_of("kapitza", pendulum_run(0.0, 14, (0.05, 0.12))), model=pendulum_model(14)))
    found, problem = outcome.found, outcome.problem
    prior = Prior(found.r, np.full(problem.n, 10.0), np.diag(found.covariance) > 0)
    cut = problem.cut(problem.longest // 9)
    starts = problem.starts_along(found.r, found, cut)
    in_blocks = problem.searched(found.r, prior, cut, starts, problem.used(cut))
    main = list(outcome.main)
    errors, se = errors_of(outcome, PENDULUM)
    assert len(found.cut.first) < 4
    assert (np.diag(found.noise)[main] < 0.9 * np.diag(in_blocks.noise)[main]).all()
    assert (np.abs(errors) < 3 * se).all()


def test_a_refinement_ends_where_its_budget_is_spent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it a stiff guess of a long recording takes half an hour."""
    monkeypatch.setattr(refined_problems, "_WORK", 10)
    monkeypatch.setattr(refined_problems, "_WORK_BEYOND", 10)
    answer, _, text = refined_answer(answer_of("kapitza", lacking=("w", "d1", "d2", "c")))
    assert TOO_LONG in text and all(one.value is None or one.se is not None for one in answer.values.values())


@pytest.mark.parametrize("name", [*DRIVEN, *BY_STEPS])
def test_a_recording_that_is_too_short_is_refused_in_a_sentence(name: str) -> None:
    run = run_of(name)
    short = Recording(run.t[:60], {key: one[:60] for key, one in run.signals.items()}, run.sample_rate)
    with pytest.raises(PvidError, match="too short|like the recorded|the run has 60 samples and a block"):
        refine(answer_of(name, short))


def test_a_friction_that_would_push_is_held_at_0() -> None:
    """One that a search has made negative by more than its standard error."""
    outcome, weak = refined_of("kapitza"), answer_of("kapitza")
    every = Problems(
        weak.model, weak.recording.run, 1000.0, list(starts_of(weak.model, weak.found, weak.recording.run)), 1.0
    )
    problem, found = outcome.problem, outcome.found
    assert every.frictions(problem) == ["k1", "k2"]
    place = outcome.names.index("k1")
    pushing = replace(found, r=np.where(np.arange(len(found.r)) == place, -0.05, found.r))
    prior = Prior(found.r, np.full(problem.n, 10.0), np.diag(found.covariance) > 0)
    held = without_push(every, problem, prior, pushing)
    assert held.r[place] == 0 and held.covariance[place, place] == 0
    assert without_push(every, problem, prior, found) is found


def test_starts_scale_what_a_user_guesses() -> None:
    """The lengths of the pendulum, whose parameters no other length has; the parameters of the motor themselves."""
    weak = answer_of("kapitza")
    first, *guesses = starts_of(weak.model, weak.found, weak.recording.run)
    assert (first == weak.found.p).all() and len(guesses) == 9
    lengths = [outputs_at(weak.model, p) for p in guesses]
    for name in ("l2", "rho2"):
        scales = sorted(one[name] / lengths[0][name] for one in lengths)
        assert scales == pytest.approx([0.45] * 3 + [1.0] * 3 + [2.2] * 3, rel=1e-6)
    assert len({(round(one["l2"], 6), round(one["rho2"], 6)) for one in lengths}) == 9
    assert all(one["g"] == pytest.approx(lengths[0]["g"]) for one in lengths)
    assert guesses[0][3] == pytest.approx(float(np.median(weak.recording.signals["phi"])))
    found = answer_of("dc_motor")
    motor = found.model
    _, *guesses = starts_of(motor, found.found, found.recording.run)
    positive = subject("dc_motor").positive
    ratios = np.array(guesses)[:, positive] / np.array([one.guess for one in motor.unknowns])[positive]
    assert len(guesses) == 9 and set(np.unique(ratios.round(9))) == {0.45, 1.0, 2.2}
    assert (np.abs(np.prod(ratios, axis=0) - 0.45**3 * 2.2**3) < 1e-9).all()  # each thrice at each


@pytest.mark.parametrize("name", [*DRIVEN, *BY_STEPS])
def test_a_parameter_that_nothing_determines_has_no_finite_standard_error(name: str) -> None:
    outcome = refined_of(name)
    problem, found = outcome.problem, outcome.found
    free = np.ones(problem.n, bool)
    nothing = np.zeros_like(problem.used(found.cut))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        blind = problem.searched(
            found.r, Prior(found.r, np.full(problem.n, np.inf), free), found.cut, found.starts, nothing, most=1
        )
    assert np.isinf(np.diag(blind.covariance)).all() and np.isinf(np.diag(blind.noise)).all()


@pytest.mark.parametrize("name", [*DRIVEN, *BY_STEPS])
def test_a_motion_that_runs_away_ends_a_pass(name: str) -> None:
    outcome = refined_of(name)
    problem, found = outcome.problem, outcome.found
    use = problem.used(found.cut)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert problem.block(found.r, found.cut, found.starts * 1e120, use) is None


@pytest.mark.parametrize("name", [*DRIVEN, "heated_plate", "free_pendulum"])
def test_the_quantities_of_a_pass_are_exposed_and_agree_with_one_another(name: str) -> None:
    """J, e and R of each block, and the step from them: an oracle for other implementations."""
    outcome = refined_of(name)
    problem, found = outcome.problem, outcome.found
    block = problem.block(found.r, found.cut, found.starts, problem.used(found.cut))
    assert block is not None
    stacked = np.column_stack([block.jacobian[0].reshape(-1, block.jacobian.shape[-1]), block.error[0].ravel()])
    np.testing.assert_allclose(block.triangle[0].T @ block.triangle[0], stacked.T @ stacked, rtol=1e-9, atol=1e-6)
    prior = Prior(found.r, np.full(problem.n, 10.0), np.ones(problem.n, bool))
    step, starts, information = problem.step(block, found.r, prior)
    assert np.abs(step / np.sqrt(np.diag(np.linalg.inv(information)))).max() < 0.1
    assert starts.shape == found.starts.shape
