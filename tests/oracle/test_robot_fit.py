"""Base parameters from recordings of arms whose torques are those of Newton and Euler."""

import math
import re
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import robot_arms
from robot_models import model_of, truth_of

from pvid.base.errors import PvidError
from pvid.identification.robot import RobotAnswer, answer_of_robot, payload_of, sure
from pvid.model.chain import Chain, Joint, rotation_of
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.robot import LAWS, RobotFit, RobotRun, identify_robot
from pvid.rig.run import Recording

RATE = 500.0
SPATIAL = robot_arms.arm("spatial", seed=5)


def fits(seeds: int, **how: Any) -> list[RobotFit]:
    return [identify_robot(model_of(SPATIAL), robot_arms.log_of(SPATIAL, seed, **how), RATE) for seed in range(seeds)]


def off_by(found: list[RobotFit], values: str) -> Any:
    """In standard errors [runs, p]."""
    truth = truth_of(SPATIAL)
    return np.array([(getattr(one, values) - truth) / np.sqrt(np.diag(one.covariance)) for one in found])


def test_standard_errors_cover_the_truth() -> None:
    found = fits(10)
    off = off_by(found, "p")
    assert not any(one.undetermined.any() for one in found)
    # 210 values, of which the 21 of a run depend on each other: 94.3 % are within 2 and the rms is 1.03.
    assert np.mean(np.abs(off) < 2) > 0.90 and 0.8 < np.sqrt(np.mean(off**2)) < 1.2
    # The errors are those of a fit, not of anything: the twist of the first joint is known to 1 %.
    assert max(np.sqrt(one.covariance[0, 0]) / abs(truth_of(SPATIAL)[0]) for one in found) < 0.01


def _answer(chain: Chain, seed: int, model: CompiledModel, **how: Any) -> RobotAnswer:
    log = robot_arms.log_of(chain, seed, **how)
    return answer_of_robot(Recording(log.pop("t"), log, RATE), model)


def test_a_payload_is_the_difference_of_two_recordings() -> None:
    model, inner = model_of(SPATIAL), SPATIAL.joints[-1].inertial
    assert inner is not None
    mass, centre, about = 0.8, np.array([0.1, 0.05, 0.2]), np.array([0.01, 0.001, 0.002, 0.012, -0.001, 0.008])
    moved = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))[np.triu_indices(3)]
    carried = tuple(np.array(inner) + [mass, *(mass * centre), *(about + moved)])
    chain = Chain((*SPATIAL.joints[:-1], replace(SPATIAL.joints[-1], inertial=carried)), SPATIAL.gravity)
    truth = dict(
        zip(("m", "cx", "cy", "cz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"), [mass, *centre, *about], strict=True)
    )
    off = []
    for seed in range(8):
        found = payload_of(_answer(chain, seed, model), _answer(SPATIAL, seed + 50, model))
        off += [(one.value - truth[name]) / one.se_noise for name, one in found.items() if one.value and one.se_noise]
    assert len(off) == 80  # all ten of each
    assert np.mean(np.abs(off) < 2) > 0.85 and np.sqrt(np.mean(np.square(off))) < 1.3  # of 20 runs: 95 % and 1.04


def test_what_two_motions_do_not_show_of_a_payload_has_no_value() -> None:
    model, empty = model_of(SPATIAL), _answer(SPATIAL, 1, model_of(SPATIAL))
    none = payload_of(empty, _answer(SPATIAL, 2, model))
    assert [name for name, one in none.items() if one.value is not None] == ["m"] and abs(none["m"].value or 0) < 0.01
    one = robot_arms.arm("spatial", seed=5)
    one = Chain(one.joints[:1], one.gravity)
    found = payload_of(_answer(one, 1, model_of(one)), _answer(one, 2, model_of(one)))
    assert all(it.value is None for it in found.values())  # one upright axis: its moment of inertia alone
    lost = replace(empty, fit=replace(empty.fit, undetermined=np.ones(len(empty.fit.p), np.bool_)))
    with pytest.raises(PvidError, match="no payload: the motions determine no common parameter"):
        payload_of(lost, empty)


def test_friction_that_is_soft_near_a_reversal_does_no_harm() -> None:
    off = off_by(fits(10, soft=0.02), "p")
    assert np.mean(np.abs(off) < 2) > 0.90 and 0.8 < np.sqrt(np.mean(off**2)) < 1.2  # 94.8 % and 1.03


def test_friction_that_is_soft_at_higher_speeds_is_doubted() -> None:
    without = []
    for seed in range(6):
        found = _answer(SPATIAL, seed, model_of(SPATIAL), soft=0.1)
        values = [found.values[name] for name in found.model.p_names]
        off = np.abs([one.value for one in values] - truth_of(SPATIAL))
        without.append(np.max(off / [math.hypot(one.se_noise or 0.0, one.se_scale or 0.0) for one in values]))
        assert np.max(off / [one.se or 0.0 for one in values]) < 3  # with what soft friction moves them by: 2.5
        first = found.verdict.reasons[0]
        assert first.name == "friction" and first.alarm and "friction that is not dry plus viscous" in first.text
    assert max(without) > 5  # 9.9


@pytest.mark.parametrize(
    ("joint", "size", "law", "text"),
    [
        (3, 0.3, "1", "joint 3 has what the equations lack, 0.3"),
        (2, 4.0, "q", "joint 2 has what the equations lack, 3.9"),
        (1, 0.3, "abs(v)*v", "joint 1 has what the equations lack, 0.3"),
    ],
)
def test_what_a_joint_has_beside_the_equations_is_named_and_in_the_errors(
    joint: int, size: float, law: str, text: str
) -> None:
    """Without it a parameter is 17 to 36 standard errors of noise off."""
    log = robot_arms.log_of(SPATIAL, 0)
    _, q, v, _ = robot_arms.motion(3, 20.0, RATE, 0)
    log[f"tau{joint}"] += size * LAWS[law](q, v)[joint - 1]
    found = answer_of_robot(Recording(log.pop("t"), log, RATE), model_of(SPATIAL))
    values = [found.values[name] for name in found.model.p_names]
    off = np.array([one.value for one in values]) - truth_of(SPATIAL)
    assert np.max(np.abs(off) / [one.se_noise or 0.0 for one in values]) > 15
    assert np.max(np.abs(off) / [one.se or 0.0 for one in values]) < 3
    assert text in " ".join(one.text for one in found.verdict.reasons) and found.verdict.word == "usable"


def _with(seed: int, *effects: tuple[int, float, str]) -> RobotAnswer:
    log = robot_arms.log_of(SPATIAL, seed)
    _, q, v, _ = robot_arms.motion(3, 20.0, RATE, seed)
    for joint, size, law in effects:
        log[f"tau{joint}"] += size * LAWS[law](q, v)[joint - 1]
    return answer_of_robot(Recording(log.pop("t"), log, RATE), model_of(SPATIAL))


TWO = (2, 4.0, "q"), (3, 0.3, "1")


def test_of_two_terms_that_are_missing_each_is_named_with_its_size() -> None:
    """In motions of 1.2 to 2.5 rad; by one of 1.0 rad (seed 1) a spring looks like gravity."""
    found = [_with(seed, *TWO) for seed in (0, 3, 4)]
    off = np.array([[(one.values[name].value or 0.0) for name in one.model.p_names] for one in found])
    off = np.abs(off - truth_of(SPATIAL)) / [[one.se for one in each.values.values()] for each in found]
    assert off.max() < 3
    for one in found:
        sizes = {(term.law, term.joint): term.size for term in sure(one.fit)}
        assert sizes == pytest.approx({("q", 1): 4.0, ("1", 2): 0.3}, rel=0.1)


def _late(log: dict[str, Any], joints: Sequence[int], seconds: float) -> None:
    for k in joints:
        log[f"tau{k}"] = np.interp(log["t"] - seconds, log["t"], log[f"tau{k}"])


def _dead(log: dict[str, Any], whole: Any) -> None:
    log["tau1"] -= np.clip(whole, -0.2, 0.2)


BESIDE: dict[str, tuple[Callable[[dict[str, Any], Any, Any], Any], str]] = {  # of rates, and torques of the bodies
    "every torque late": (
        lambda log, v, tau: _late(log, (1, 2, 3), 0.004),
        r"every torque is 0\.00(3|4)\d* s late against the positions: one of a filter and a clock; with that",
    ),
    "one torque late": (
        lambda log, v, tau: _late(log, (3,), 0.004),
        r"the torque of joint 3 is 0\.00(3|4)\d* s late against the positions: one of a filter and a clock; with that",
    ),
    "zero": (
        lambda log, v, tau: log.update(q2=log["q2"] + 0.04),
        r"q2 is 0\.0(3|4)\d* rad too large: its zero is not the file's; with that",
    ),
    "ratio": (
        lambda log, v, tau: log.update(q3=log["q3"] * 1.02),
        r"q3 is (1\.[89]|2\.[01])\d?% larger than in the equations: one of its gear ratio and its counts a turn; with",
    ),
    "load": (
        lambda log, v, tau: log.update(tau2=log["tau2"] + 0.06 * np.abs(tau[1]) * np.sign(v[1])),
        r"the torque of joint 2 has what the equations lack, (5\.[89]|6\.[01])% of the load as dry friction; .*Fc2",
    ),
    "dead band": (
        lambda log, v, tau: _dead(log, tau[0] + 0.5 * v[0] + np.sign(v[0])),
        r"the torque of joint 1 has what the equations lack, 0\.[12]\d* N\*m less than it is on either side of 0: a",
    ),
}


@pytest.mark.parametrize("name", BESIDE)
def test_what_torques_and_encoders_have_beside_the_equations_is_named(name: str) -> None:
    """Without these laws a late torque and the load, 10.8 standard errors off, were silent; the others had other names,
    and were up to 17 off."""
    changed, text = BESIDE[name]
    log = robot_arms.log_of(SPATIAL, 0)
    _, q, v, a = robot_arms.motion(3, 20.0, RATE, 0)
    changed(log, v, robot_arms.torques(SPATIAL, q, v, a))
    found = answer_of_robot(Recording(log.pop("t"), log, RATE), model_of(SPATIAL))
    told = [one.text for one in found.verdict.reasons if one.alarm]
    assert len(told) == 1 and re.match(text, told[0]), told
    values = [found.values[name] for name in found.model.p_names]
    off = np.array([one.value for one in values]) - truth_of(SPATIAL)
    assert np.max(np.abs(off) / [one.se or 0.0 for one in values]) < 3


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_a_torque_with_another_gain_than_the_others_is_an_alarm(joint: int) -> None:
    log = robot_arms.log_of(SPATIAL, 0)
    log[f"tau{joint}"] *= 1.3
    found = answer_of_robot(Recording(log.pop("t"), log, RATE), model_of(SPATIAL))
    told = " ".join(one.text for one in found.verdict.reasons if one.alarm)
    size = re.search(rf"torque of joint {joint} has [^;]*, a gain about (\d+)% above those of the others: one of", told)
    assert size is not None and 15 < float(size[1]) < 35  # to first order: 30, 30 and 21


def test_a_spring_that_looks_like_gravity_is_one_of_what_differs_from_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within 0.5 rad: without the file nothing shows it."""
    whole = robot_arms.motion
    monkeypatch.setattr(
        robot_arms, "motion", lambda *how: tuple(s * x for s, x in zip((1, 0.3, 0.3, 0.3), whole(*how), strict=True))
    )
    text = "one of another body, a spring, a cable and a counterweight, as of "
    found = _with(0, (2, 4.0, "q"))
    size = re.search(text + r"([\d.]+) N\*m/rad at joint 2", " ".join(one.text for one in found.verdict.reasons))
    assert size is not None and float(size[1]) == pytest.approx(4.0, rel=0.2) and found.verdict.word == "usable"
    assert text not in " ".join(one.text for one in _with(0).verdict.reasons)


def test_a_centre_that_the_file_has_on_the_axis_is_no_spring() -> None:
    """hy1 is 0 in the file and 0.02 kg m in truth: a tenth of hx1."""
    upright, inertial = rotation_of((np.pi / 2, 0, 0)), (1.0, 0.2, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.05)
    file = Chain((Joint("a", -1, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), upright, inertial=inertial),))
    moved = (*inertial[:2], 0.02, *inertial[3:])
    log = robot_arms.log_of(replace(file, joints=(replace(file.joints[0], inertial=moved),)), 0, viscous=0.05, dry=0.1)
    found = answer_of_robot(Recording(log.pop("t"), log, RATE), model_of(file))
    assert found.verdict.warning is None and found.values["hy1"].value == pytest.approx(0.02, rel=0.05)


def test_what_is_missing_is_no_payload_and_a_payload_is_not_negative() -> None:
    found = payload_of(_with(3, *TWO), _with(4, *TWO))["m"]
    assert found.value is not None and found.se is not None
    assert abs(found.value) < 3 * found.se and (found.se_model or 0.0) > (found.se_noise or 0.0)
    inner = SPATIAL.joints[-1].inertial
    assert inner is not None
    heavy = Chain(
        (*SPATIAL.joints[:-1], replace(SPATIAL.joints[-1], inertial=(inner[0] + 1, *inner[1:]))), SPATIAL.gravity
    )
    with pytest.raises(PvidError, match="the payload's mass would be -1.* kg: are the recordings with and without"):
        payload_of(_with(1), _answer(heavy, 2, model_of(SPATIAL)))


def test_without_that_no_term_is_named() -> None:
    """And neither of 12 s: by Student's t of fewer windows."""
    assert not any(sure(one) for one in [*fits(6), *fits(6, seconds=12.0)])


def test_noise_of_the_encoders_biases_and_the_bias_is_taken_off() -> None:
    found = fits(10, bits=14, blur=1.0, noise=0.002)
    biased, unbiased = (np.mean(off_by(found, one), axis=0) for one in ("uncorrected", "p"))
    assert np.sqrt(np.mean(biased**2)) > 0.5  # standard errors: 0.61; the mean of ten runs has one of 0.3 by chance
    assert np.sqrt(np.mean(unbiased**2)) < 0.4  # 0.24
    assert np.mean(np.abs(off_by(found, "p")) < 2) > 0.90


def test_what_leans_on_a_direction_that_noise_hides_has_no_value() -> None:
    """12 bits with noise of three counts: hy2 of the last motion was 5.4 standard errors off."""
    found = fits(6, bits=12, blur=3.0)
    hidden = np.array([one.undetermined for one in found])
    assert 0.3 < hidden.mean() < 0.7 and hidden[-1][list(found[-1].run.model.p_names).index("hy2")]
    assert np.max(np.abs(off_by(found, "p")[~hidden])) < 3  # 1.8
    assert not any(one.undetermined.any() for one in fits(3, bits=12, blur=0.3))


def test_the_polynomials_take_nothing_of_a_fast_motion() -> None:
    """They were as long as noise hides what they take: inertias were 6 standard errors off."""
    found = fits(6, stops=0.5)
    assert {one.design.taps for one in found} <= {29, 31, 33, 35} and {one.design.taps for one in fits(2)} == {61}
    off = off_by(found, "p")
    assert np.mean(np.abs(off) < 2) > 0.93 and np.sqrt(np.mean(off**2)) < 1.2  # 99 % and 0.95; they were 86 % and 1.5


def test_torques_of_unseen_motion_are_predicted_to_their_noise() -> None:
    fit = fits(1)[0]
    other = RobotRun(fit.run.model, robot_arms.log_of(SPATIAL, 77), RATE)
    for measured, predicted in fit.predicted(other, np.array([fit.p, np.zeros(len(fit.p))])):
        left = measured[:, np.newaxis] - predicted
        r2 = 1 - left.var(axis=-1) / measured.var(axis=-1)[:, np.newaxis]
        assert (r2[:, 0] > 0.99).all() and (abs(r2[:, 1]) < 1e-9).all()  # the noise alone leaves 0.9996


def test_gaps_are_no_motion() -> None:
    log = robot_arms.log_of(SPATIAL, 3)
    log["q2"][4000:4040] = np.nan
    whole, cut = (identify_robot(model_of(SPATIAL), one, RATE) for one in (robot_arms.log_of(SPATIAL, 3), log))
    assert cut.windows < whole.windows
    off = (cut.p - whole.p) / np.sqrt(np.diag(whole.covariance))
    assert np.max(np.abs(off)) < 2  # a part of the windows is not there


def _still(log: dict[str, Any]) -> None:
    log["q2"] = 0.3 + 1e-4 * np.random.default_rng(0).normal(size=len(log["q2"]))


def _short(size: int) -> Callable[[dict[str, Any]], None]:
    return lambda log: log.update({name: one[:size] for name, one in log.items()})


REFUSED: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "a joint is missing": (lambda log: log.pop("tau3"), "the run has no column tau3 [N*m], which robot needs"),
    "a joint rests": (_still, "q2 is nowhere clear of a standstill for a window of 1 s: move this joint faster"),
    "no sample": (_short(100), "the run has no 122 samples without a gap: record longer"),
    "few windows": (_short(700), "the run has fewer than 8 windows of 0.5 s: record longer"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_recording_that_shows_nothing_is_refused(name: str) -> None:
    change, sentence = REFUSED[name]
    log = robot_arms.log_of(SPATIAL, 0)
    change(log)
    with pytest.raises(PvidError, match=re.escape(sentence)):
        identify_robot(model_of(SPATIAL), log, RATE)


def test_a_log_that_needs_more_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """And a log that is cut as the sentence proposes fits: the peak is what was allowed, and no small part of it."""
    monkeypatch.setattr("pvid.oracle.weak.robot._MOST_BYTES", 1.2e7)
    log = robot_arms.log_of(SPATIAL, 0, seconds=60.0)
    with pytest.raises(PvidError, match="60 s of 3 joints need more than 0.012 GB of memory: cut the log to ") as told:
        identify_robot(model_of(SPATIAL), log, RATE)
    size = int(int(str(told.value).split()[-2]) * RATE)
    fits(1)  # imports are no part of it
    tracemalloc.start()
    identify_robot(model_of(SPATIAL), {name: one[:size] for name, one in log.items()}, RATE)
    assert 0.7 < tracemalloc.get_traced_memory()[1] / 1.2e7 < 1.3  # 1.1 with the samples
    tracemalloc.stop()


def test_a_log_without_a_window_predicts_nothing() -> None:
    log, other = robot_arms.log_of(SPATIAL, 0), robot_arms.log_of(SPATIAL, 77)
    answer = answer_of_robot(Recording(log.pop("t"), log, RATE), model_of(SPATIAL))
    other["q2"][130::131] = np.nan
    with pytest.raises(PvidError, match=r"a prediction needs a stretch of \S+ s without a gap: record longer"):
        answer.predicts(Recording(other.pop("t"), other, RATE))


def test_a_slow_clock_is_refused() -> None:
    with pytest.raises(PvidError, match="50 samples a second are too few for a robot: 100 or more"):
        identify_robot(model_of(SPATIAL), robot_arms.log_of(SPATIAL, 0), 50.0)


def test_a_joint_at_a_constant_rate_has_no_inertia(monkeypatch: pytest.MonkeyPatch) -> None:
    def steady(*given: Any) -> Any:
        t, q, v, a = sines(*given)
        q[0], v[0], a[0] = 0.7 * t, 0.7, 0.0
        return t, q, v, a

    sines = robot_arms.motion
    monkeypatch.setattr(robot_arms, "motion", steady)
    found = identify_robot(model_of(SPATIAL), robot_arms.log_of(SPATIAL, 0), RATE)
    lost = [name for name, one in zip(found.run.model.p_names, found.undetermined, strict=True) if one]
    assert lost == ["Izz1_R", "Fv1", "Fc1"]  # of a rate that does not change, friction is viscous as well as dry


def test_what_a_fit_does_not_determine_has_no_value(monkeypatch: pytest.MonkeyPatch) -> None:
    log = robot_arms.log_of(SPATIAL, 0)
    fit, recording = fits(1)[0], Recording(log.pop("t"), log, RATE)
    first = np.arange(len(fit.p)) == 0
    for changed, name, sentence in (
        (replace(fit, undetermined=first), "undetermined", "the motion does not determine Izz1_R"),
        (replace(fit, undetermined=first | True), "not_identified", "the motion determines no parameter"),
        (replace(fit, apart=10.0 * first), "halves", "the two halves of the recording disagree about Izz1_R"),
    ):
        monkeypatch.setattr("pvid.identification.robot.identify_robot", lambda *_, one=changed: one)
        answer = answer_of_robot(recording, fit.run.model)
        assert [one.name for one in answer.verdict.reasons] == [name]
        assert answer.verdict.reasons[0].text.startswith(sentence)
        assert (answer.values["Izz1_R"].value is None) == (name != "halves")
        assert answer.identified == (name != "not_identified")
