"""Refinement in float64: derivatives, the pendulum at large angles with friction and skew, described mechanisms."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from pvid.base.errors import PvidError
from pvid.design.second_derivative import second_derivative
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run import refined_pendulum
from pvid.run.answer import as_json, refinement_line
from pvid.run.engine_identify import identify_by_engine
from pvid.run.refined import GOOD, Cut, Prior
from pvid.run.refined_identify import (
    AGREE,
    BEARABLE,
    LARGEST_SKEW_S,
    _doubts,
    _judged,
    _remarks,
    refined_identification,
)
from pvid.run.refined_inputs import HIGHEST, drive_edge_hz
from pvid.run.refined_kernel import PlayedKernel, kernel_of
from pvid.run.refined_mechanism import RefinedMechanism, refine_mechanism
from pvid.run.refined_pendulum import RefinedPendulum, _without_push, refine_pendulum
from pvid.setup.f32 import NOISE_LSB
from pvid.sim.imperfections import Imperfections
from pvid.sim.pendulum import SLIP, STANDARD_DRIVE, STANDARD_PENDULUM, simulate, standard_sensors
from pvid.sim.simulated_run import PERFECT, SOFT, RigSimulation, simulation_of

Float = npt.NDArray[np.float64]

TRUTH = STANDARD_PENDULUM.linear
DAMPED = replace(STANDARD_PENDULUM, damping1=2e-3, damping2=5e-4)  # [m^2/s]
NAMES = ("w", "d1", "d2")


@cache
def run_of(skew: float = 0.0, duration: float = 20.0) -> Run:
    """The standard rig released at 0.3 rad, with friction, full equations, 16 bits."""
    sensors = replace(standard_sensors(16), phi_zero=0.02, skew_s=skew)
    return simulate(DAMPED, STANDARD_DRIVE, sensors, 1000.0, duration, (0.17, 0.4), "full", 1).run


def rig() -> RigFile:
    standard = RigFile.standard()
    return replace(standard, sensor=replace(standard.sensor, phi_lsb=standard_sensors(16).phi_lsb))


def start(factor: float) -> dict[str, float]:
    return {**dict(zip(NAMES, TRUTH * np.array([factor, 1 / factor, factor]), strict=True)), "c": 0.02}


@cache
def refined(skew: float = 0.0) -> RefinedPendulum:
    return refine_pendulum(run_of(skew), rig(), [start(1.05)], sure=True)


@pytest.mark.parametrize("name", ["kapitza", "dc_motor", "battery_2rc"])
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    """Of the steps as they are computed, to the error of the differences; order 2, order 1, outputs with inputs."""
    kernel = kernel_of(compiled_of(name))
    made, rng = kernel.made, np.random.default_rng(2)
    truth = simulated_rig(name).truth
    r = np.array([truth.get(one.name, 0.1) for one in made.parameters] + [0.5 for _ in made.settings])
    u, du = rng.normal(size=(2, 600, 3, len(made.inputs)))
    first, starts = np.array([0, 200], np.int32), 0.1 * rng.normal(size=(2, kernel.states))
    _, found, _ = kernel.blocks(r, first, 300, 1, 2e-3, u, du, starts)
    assert found is not None
    for column in range(kernel.columns):
        ends = []
        for sign in (1e-5, -1e-5):
            near, begun, driven = r.copy(), starts.copy(), u
            entry = column - kernel.states
            if entry < 0:
                begun[:, column] += sign
            elif made.parameters[entry].name == "tau":
                driven = u + sign * du
            else:
                near[entry] += sign * (r[entry] if made.parameters[entry].log else 1.0)
            ends.append(kernel.blocks(near, first, 300, 1, 2e-3, driven, du, begun, False)[0])
        wanted = (ends[0] - ends[1]) / 2e-5
        near_enough = 0.1 if entry in kernel.widths else 1e-5  # a width's derivative is a difference itself
        np.testing.assert_allclose(found[..., column], wanted, atol=near_enough * np.abs(wanted).max() + 1e-9)


def test_a_pendulum_with_friction_at_0_4_rad_is_refined_to_its_standard_errors() -> None:
    found = refined().found
    errors = found.r[:3] / TRUTH - 1
    se = np.sqrt(np.diag(found.covariance))[:3]
    assert found.converged and 0.9 < found.chi2 < 1.1 and found.slow_chi2 < 1.5
    assert (np.abs(errors) < 3 * se).all() and (np.abs(errors) < 2e-4).all() and (se < 2e-4).all()
    l1 = STANDARD_PENDULUM.l1
    for name, damping in (("k1", DAMPED.damping1), ("k2", DAMPED.damping2)):
        value, error = refined().extras[name]
        assert abs(value - damping / l1**2) < 4 * error < damping / l1**2


def test_gaps_lie_between_the_blocks_and_cost_what_they_cut_out() -> None:
    """Behind a gap of y the motion is another one than that of a drive that is interpolated across it."""
    run = run_of()
    missing = np.zeros(len(run), bool)
    for first in (1500, 9000, 16000):
        missing[first : first + 300] = True
    cut = Run(run.t, np.where(missing, np.nan, run.phi), np.where(missing, np.nan, run.y), run.sample_rate)
    outcome = refine_pendulum(cut, rig(), [start(1.05)], sure=True)
    found, se = outcome.found, np.sqrt(np.diag(outcome.found.covariance))[:3]
    assert found.converged and found.slow_chi2 < 1.5 and len(outcome.problem.stretches) == 4
    assert (np.abs(found.r[:3] / TRUTH - 1) < 3 * se).all()
    assert (se < 1.7 * np.sqrt(np.diag(refined().found.covariance))[:3]).all()
    every = round(run.sample_rate / outcome.problem.measured.rate)
    for first in found.cut.first * every + outcome.first:
        assert not missing[first : first + found.cut.samples * every].any()


def test_wild_samples_and_lost_ones_of_the_drive_leave_no_bias() -> None:
    """A jump of y widened the band of the drive's filter to where it is not exact: w was 0.2 % off, 20 standard errors,
    with residuals like noise."""
    run = run_of()
    y = run.y.copy()
    y[[1000, 7000, 13_000]] += (0.5, -2e-3, 0.05)
    kept = np.delete(np.arange(len(run)), np.arange(10_000, 10_100))
    cut = Run(run.t[: len(kept)], run.phi[kept], y[kept], run.sample_rate)
    outcome = refine_pendulum(cut, rig(), [start(1.05)], sure=True)
    found, se = outcome.found, np.sqrt(np.diag(outcome.found.covariance))[:3]
    assert found.converged and found.slow_chi2 < 1.5
    assert (np.abs(found.r[:3] / TRUTH - 1) < 3 * se).all()
    assert (se < 1.5 * np.sqrt(np.diag(refined().found.covariance))[:3]).all()
    assert outcome.breaks == pytest.approx((10.0,), abs=0.01)
    (sentence,) = _remarks(outcome)
    assert sentence.startswith(
        "y jumps at 9.998 s: lost samples that do not show in t, a repeated buffer, or a changed"
    )


def test_the_drives_band_ends_where_its_noise_begins() -> None:
    """Instants that jitter make more noise in y than its sensor: the band went up to Nyquist's frequency."""
    rate, sensors = 1000.0, standard_sensors(14)
    fastest = max(tone.frequency_hz for tone in STANDARD_DRIVE)
    run = simulate(DAMPED, STANDARD_DRIVE, sensors, rate, 20.0, truth="full").run
    clean = drive_edge_hz(run.y, rate, NOISE_LSB * RigFile.standard().sensor.y_lsb)
    late = np.random.default_rng(0).normal(0.0, 3e-4, len(run.y))
    jittered = run.y + late * np.gradient(run.y) * rate
    assert np.std(jittered - run.y) > 3 * RigFile.standard().sensor.y_lsb
    assert fastest <= clean <= fastest + 0.2
    assert fastest <= drive_edge_hz(jittered, rate, NOISE_LSB * RigFile.standard().sensor.y_lsb) <= fastest + 0.2


def test_a_skew_is_found_and_costs_no_accuracy() -> None:
    found = refined(1e-3)
    value, error = found.extras["tau"]
    assert abs(abs(value) - 1e-3) < max(4 * error, 5e-6)
    assert (np.abs(found.found.r[:3] / TRUTH - 1) < 3e-4).all()


def test_other_starts_are_tried_where_the_first_one_is_not_sure() -> None:
    wild = {**start(1.0), "w": 12.0, "d1": 20.0, "d2": 3.0}
    found = refine_pendulum(run_of(), rig(), [wild, start(0.9), start(1.1)])
    assert (np.abs(found.found.r[:3] / TRUTH - 1) < 3e-4).all()


def test_dry_friction_is_refined_with_the_speed_at_which_it_is_in_full() -> None:
    """Narrower than the narrowest sign that is tried: with that one, w is .5 % off, and residuals are above noise."""
    rubbing = replace(STANDARD_PENDULUM, dry1=3e-3, dry2=3e-3)  # [m^2/s^2]
    run = simulate(rubbing, STANDARD_DRIVE, standard_sensors(16), 1000.0, 20.0, (0.17, 0.4), "full", 0).run
    outcome = refine_pendulum(run, rig(), [start(1.05)], sure=True)
    found = outcome.found
    errors, se = found.r[:3] / TRUTH - 1, np.sqrt(np.diag(found.covariance))[:3]
    assert found.converged and found.slow_chi2 < 1.5
    assert (np.abs(errors) < 3 * se).all() and (np.abs(errors) < 1e-3).all()
    width, error = outcome.extras["width_a1_1_a2_1"]
    assert abs(width / SLIP - 1) < 0.3 and 0 < error < 0.1 * width  # of tanh(v / SLIP), another law


def test_the_quantities_of_a_pass_are_exposed_and_agree_with_one_another() -> None:
    """J, e and R of each block, and the step from them: an oracle for other implementations."""
    outcome = refined()
    problem, found = outcome.problem, outcome.found
    block = problem.block(found.r, found.cut, found.starts, problem.used(found.cut))
    assert block is not None
    stacked = np.concatenate([block.jacobian[0, :, 0], block.error[0]], axis=1)
    np.testing.assert_allclose(block.triangle[0].T @ block.triangle[0], stacked.T @ stacked, rtol=1e-9, atol=1e-6)
    prior = Prior(found.r, np.full(problem.n, 10.0), np.ones(problem.n, bool))
    step, starts, information = problem.step(block, found.r, prior)
    assert np.abs(step / np.sqrt(np.diag(np.linalg.inv(information)))).max() < 0.1
    assert starts.shape == found.starts.shape


@cache
def answers() -> tuple[RigFile, object]:
    return rig(), identify_by_engine(run_of(), rig())


def test_identify_takes_the_refined_answer_where_the_weak_one_is_refused() -> None:
    given, weak = answers()
    found = refined_identification(run_of(), given, weak)  # type: ignore[arg-type]
    assert found.identified and found.refinement.adopted
    values = np.array([found.value[name] for name in NAMES])
    assert (np.abs(values / TRUTH - 1) < 5e-4).all()
    assert all(found.se[name] >= found.parts[name].noise > 0 for name in NAMES)
    shown = as_json(found)["refinement"]
    assert shown["adopted"] and set(shown["parameters"]) == {"k1", "k2", "tau"}
    line = refinement_line(found)
    assert line is not None and "k1 0.02" in line


def played(run: Run, half: float) -> Run:
    """The run through an encoder that follows only when a play of +-half is taken up [rad]."""
    phi = run.phi.copy()
    for k in range(1, len(phi)):
        phi[k] = min(max(phi[k - 1], run.phi[k] - half), run.phi[k] + half)
    return replace(run, phi=phi)


def shaken(run: Run, amplitude: float, hz: float) -> Run:
    """The run with a vibration of the encoder [rad] that no equation has."""
    return replace(run, phi=run.phi + amplitude * np.sin(2 * np.pi * hz * run.t))


def test_a_play_of_the_encoder_is_found_and_costs_no_accuracy() -> None:
    found = refine_pendulum(played(run_of(), 2.5e-3), rig(), [start(1.05)], sure=True)
    value, error = found.extras["play"]
    se = np.sqrt(np.diag(found.found.covariance))[:3]
    errors = found.found.r[:3] / TRUTH - 1
    assert found.found.converged and abs(value - 2.5e-3) < 0.02 * 2.5e-3 and error < 0.02 * 2.5e-3
    assert (np.abs(errors) < 3 * se).all() and (np.abs(errors) < 2e-3).all()


def test_derivatives_with_a_play_are_those_of_finite_differences() -> None:
    """But for the few samples at which the encoder begins or ceases to follow."""
    kernel = PlayedKernel(kernel_of(compiled_of("kapitza")), "rad")
    names = [one.name for one in kernel.made.parameters]
    values = dict(zip(NAMES, TRUTH, strict=True)) | {
        "l1": STANDARD_PENDULUM.l1,
        "play": 4e-3,
        "k1": 0.02,
    }
    r = np.array([values.get(name, 0.0) for name in (*names, *kernel.made.settings)])
    starts, first = np.array([[0.1, 0.25, 0.3, -0.2]]), np.zeros(1, np.int32)
    u = np.zeros((1500, 3, 1))
    z, found, _ = kernel.blocks(r, first, 1500, 1, 1e-3, u, u, starts)
    assert found is not None and 0.05 < np.mean(np.diff(z[0, :, 0]) == 0) < 0.5
    for name in ("w", "d1", "d2", "k1", "c", "play"):
        place, ends = names.index(name), []
        unit = r[place] if kernel.made.parameters[place].log else 1.0
        for sign in (1e-6, -1e-6):
            near = r.copy()
            near[place] += sign * unit
            ends.append(kernel.blocks(near, first, 1500, 1, 1e-3, u, u, starts, False)[0])
        wanted = ((ends[0] - ends[1]) / 2e-6)[..., 0].ravel()
        far = np.abs(found[0, :, 0, kernel.states + place] - wanted) > 1e-5 * np.abs(wanted).max()
        assert far.mean() < 0.02, name


def test_where_residuals_are_noise_blocks_grow() -> None:
    """Each block has a start of its own to find: with fewer of them the noise leaves smaller standard errors."""
    run = simulate(DAMPED, STANDARD_DRIVE, standard_sensors(14), 1000.0, 20.0, (0.05, 0.12), "full", 1).run
    outcome = refine_pendulum(run, RigFile.standard(), [start(1.05)], sure=True)
    found, problem = outcome.found, outcome.problem
    prior = Prior(found.r, np.full(problem.n, 10.0), np.diag(found.covariance) > 0)
    cut = problem.cut(problem.longest // 9)
    starts = problem.starts_along(found.r, found, cut)
    in_blocks = problem.searched(found.r, prior, cut, starts, problem.used(cut))
    assert len(found.cut.first) < 4
    assert (np.diag(found.noise)[:3] < 0.9 * np.diag(in_blocks.noise)[:3]).all()
    assert (np.abs(found.r[:3] / TRUTH - 1) < 3 * np.sqrt(np.diag(found.covariance)[:3])).all()


def test_the_weak_answer_stands_where_the_sensor_is_not_that_of_the_model() -> None:
    """A vibration of the encoder: residuals far above the noise, and the answer says so."""
    given, weak = answers()
    found = refined_identification(shaken(run_of(), 5e-3, 1.7), given, weak)  # type: ignore[arg-type]
    assert not found.refinement.adopted and found.value == weak.value  # type: ignore[attr-defined]
    assert "slow residuals" in found.refinement.text or "converge" in found.refinement.text


def test_where_the_weak_form_has_no_answer_residuals_above_noise_give_one_with_a_warning() -> None:
    """A small vibration: both halves give the same parameters, within standard errors that contain the residuals."""
    given, weak = answers()
    held = replace(weak, trusted_s=None)  # type: ignore[type-var]
    found = refined_identification(shaken(run_of(), 6e-5, 1.7), given, held)  # type: ignore[arg-type]
    outcome = found.refinement.outcome.found
    assert found.identified and found.refinement.adopted and GOOD < outcome.slow_chi2 < BEARABLE
    assert found.warning is not None and "times the variance" in found.warning
    values, se = (np.array([one[name] for name in NAMES]) for one in (found.value, found.se))
    assert (np.abs(values - TRUTH) < 3 * se).all()
    assert (se > 1.5 * np.sqrt(np.diag(outcome.noise)[:3]) * TRUTH).all()


def test_a_run_whose_halves_differ_has_no_answer() -> None:
    """The drive's sensor drifts by 6 %: w of the second half is larger, and the residuals do not show by how much."""
    given, weak = answers()
    run = run_of()
    drifting = replace(run, y=run.y * (1 + 0.06 * np.clip((run.t - 5.0) / 10.0, 0.0, 1.0)))
    found = refined_identification(drifting, given, replace(weak, trusted_s=None))  # type: ignore[type-var, arg-type]
    assert not found.refinement.adopted and not found.identified
    assert found.refinement.outcome.halves_differ().max() > AGREE


def test_another_friction_that_explains_the_run_as_well_is_a_reason_to_hold() -> None:
    """Of two fits one in the valley of the other: the standard errors of either are those of its own place."""
    given, weak = answers()
    outcome = refined()
    assert outcome.rivalry is None and replace(outcome, rivals=(outcome.found,)).rivalry is None
    sd = np.sqrt(outcome.found.covariance[2, 2])
    far = replace(outcome.found, r=outcome.found.r * np.where(np.arange(len(outcome.found.r)) == 2, 1 + 6 * sd, 1.0))
    rivalled = replace(outcome, rivals=(outcome.found, far))
    assert rivalled.rivals_differ()[2] == pytest.approx(6 / np.sqrt(2), rel=0.01)
    adopted, text = _judged(rivalled, weak)  # type: ignore[arg-type]
    assert not adopted and "other parameters explain" in text
    assert _judged(outcome, weak)[0]  # type: ignore[arg-type]


def test_a_refined_answer_is_doubted_where_the_weak_one_and_its_residuals_contradict_it() -> None:
    _, weak = answers()
    outcome = refined()
    far = replace(weak, trusted_s=1.0, value={**weak.value, "d2": 1.5 * TRUTH[2]}, se={**weak.se, "d2": 0.1})  # type: ignore[type-var, attr-defined]
    noisy = replace(outcome, found=replace(outcome.found, slow_chi2=2.0))
    (sentence,) = _doubts(noisy, far)  # type: ignore[arg-type]
    assert "differ in d2 by -33.3 %" in sentence
    assert not list(_doubts(outcome, far))  # type: ignore[arg-type]


def test_a_delay_that_may_stand_for_another_error_is_doubted() -> None:
    _, weak = answers()
    found = refined(1e-3)
    assert not list(_doubts(found, weak))  # type: ignore[arg-type]
    r = np.where(np.array([*found.names, "l1"]) == "tau", 2 * LARGEST_SKEW_S, found.found.r)
    (sentence,) = _doubts(replace(found, found=replace(found.found, r=r)), weak)  # type: ignore[arg-type]
    assert "a delay of 10 ms" in sentence


def test_a_refinement_ends_where_its_budget_is_spent(monkeypatch: pytest.MonkeyPatch) -> None:
    """By default at some minutes: without it a stiff guess of a long run takes half an hour."""
    given, weak = answers()
    monkeypatch.setattr(refined_pendulum, "_WORK", 1e5)
    found = refined_identification(run_of(), given, replace(weak, trusted_s=None))  # type: ignore[type-var, arg-type]
    assert not found.identified and not found.refinement.adopted
    assert refined_pendulum.TOO_LONG in found.refinement.text


def test_a_parameter_that_nothing_determines_has_no_finite_standard_error() -> None:
    outcome = refined()
    problem, found = outcome.problem, outcome.found
    free = np.ones(problem.n, bool)
    nothing = np.zeros_like(problem.used(found.cut))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        blind = problem.searched(
            found.r, Prior(found.r, np.full(problem.n, np.inf), free), found.cut, found.starts, nothing, most=1
        )
    assert np.isinf(np.diag(blind.covariance)).all() and np.isinf(np.diag(blind.noise)).all()


def test_a_run_that_is_too_short_says_so() -> None:
    run = run_of()
    short = replace(run, t=run.t[:200], phi=run.phi[:200], y=run.y[:200])
    with pytest.raises(PvidError, match="too short|like the run"):
        refine_pendulum(short, rig(), [start(1.0)], sure=True)


def refined_rig(
    simulation: RigSimulation, seed: int = 0, imperfections: Imperfections = PERFECT
) -> tuple[RefinedMechanism, Float]:
    """6000 samples of a rig, from a start 3 % off, and the errors of its parameters in their standard errors."""
    model, truth = simulation.model, simulation.truth
    p = truth * np.where([one.positive for one in model.unknowns], 1.03, 1.0)
    signals = {name: values[:6000] for name, values in simulation.run(seed, imperfections).items()}
    found = refine_mechanism(model, signals, simulation.rig.sample_rate, p, 1.0)
    z = [(found.values[name] - truth[k]) / found.errors[name] for k, name in enumerate(model.p_names)]
    return found, np.array(z)


def test_sharp_friction_of_a_motor_is_refined_to_its_standard_errors() -> None:
    simulation = simulation_of("dc_motor")
    found, z = refined_rig(simulation)
    assert found.found.converged and found.found.slow_chi2 < 1.5
    friction = simulation.truth[simulation.model.p_names.index("Tc")]
    assert np.abs(z).max() < 4 and abs(found.values["Tc"] / friction - 1) < 5e-3


def test_sharp_friction_of_two_joints_does_not_bias() -> None:
    """By the width of its sign: with steps four times as long, two parameters are 4 standard errors off."""
    found, z = refined_rig(simulation_of("two_link_arm"), 2)
    assert found.found.converged and np.abs(z).max() < 3.5


def test_soft_friction_of_a_motor_is_refined_with_its_width() -> None:
    """tanh(v / width), which is not the law that is assumed."""
    simulation = simulation_of("dc_motor")
    found, z = refined_rig(simulation, imperfections=SOFT)
    assert found.found.converged and found.found.slow_chi2 < GOOD and np.abs(z).max() < 4
    (width,) = found.problem.kernel.widths
    assert found.found.r[width] == pytest.approx(simulation.rig.friction_width, rel=0.3)


def test_the_second_derivative_is_exact_in_its_band_and_quiet_beyond() -> None:
    rate, edge = 1000.0, 8.0
    front = second_derivative(rate, edge)
    t = np.arange(6000) / rate
    for hz in (0.5, 3.0, 7.5):
        times, found = front.apply(np.sin(2 * np.pi * hz * t), rate)
        wanted = -((2 * np.pi * hz) ** 2) * np.sin(2 * np.pi * hz * times)
        assert np.abs(found - wanted).max() < 2e-4 * (2 * np.pi * edge) ** 2
    for edge_hz in (2.0, 8.0, 60.0, HIGHEST * rate):
        assert second_derivative(rate, edge_hz).worst < 2e-5
    _, noise = front.apply(np.random.default_rng(0).normal(size=60_000), rate)
    white = np.sqrt(3 * 2.0**4) * rate**2 / np.sqrt(5)  # a plain second difference has sqrt(6) rate^2
    assert noise.std() < 1e-2 * white


def test_a_friction_that_would_push_is_held_at_0() -> None:
    """One that a search has made negative by more than its standard error."""
    outcome = refined()
    problem, found = outcome.problem, outcome.found
    place = outcome.names.index("k1")
    pushing = replace(found, r=np.where(np.arange(len(found.r)) == place, -0.05, found.r))
    held = _without_push(problem, Prior(found.r, np.full(problem.n, 10.0), np.diag(found.covariance) > 0), pushing)
    assert held.r[place] == 0 and held.covariance[place, place] == 0
    assert _without_push(problem, Prior(found.r, np.full(problem.n, 10.0), np.ones(problem.n, bool)), found) is found


def test_a_motion_that_runs_away_ends_a_pass() -> None:
    outcome = refined()
    problem, found = outcome.problem, outcome.found
    use = problem.used(found.cut)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert problem.block(found.r, found.cut, found.starts * 1e120, use) is None


def test_blocks_fill_the_run() -> None:
    cut = Cut.of([(0, 1000)], 260)
    assert cut.samples == 250 and cut.first.tolist() == [0, 250, 500, 750]


def test_blocks_fill_the_stretches_between_gaps() -> None:
    cut = Cut.of([(0, 1000), (1100, 1600), (1700, 1800)], 260)
    assert cut.samples == 250 and cut.first.tolist() == [0, 250, 500, 750, 1100, 1350]
    cut = Cut.of([(0, 400), (500, 799), (900, 1199)], 290)  # as blocks of 400 they would leave two stretches out
    assert cut.samples == 200 and cut.first.tolist() == [0, 200, 500, 900]
