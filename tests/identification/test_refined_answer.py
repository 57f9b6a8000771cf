"""When a refinement is the answer, what it makes of parameters that the weak form lacks, and what is doubted."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from own_mechanisms import own_recording
from refinements import (
    ISOLATED,
    answer_of,
    changed,
    errors_over_se,
    isolator_run,
    played,
    refined_of,
    refined_small,
    run_of,
    shaken,
    subject,
)

from pvid.identification.answer import Analysis, Refinement
from pvid.identification.reading import aligned
from pvid.identification.refinement.adoption import (
    AGREE,
    BEARABLE,
    LARGEST_SKEW_S,
    _doubts,
    _not_adopted,
    refined_answer,
)
from pvid.identification.refinement.fit import GOOD
from pvid.identification.refinement.problem import RefinedMechanism
from pvid.identification.refinement.scales import scales_of
from pvid.identification.refinement.search import refine
from pvid.identification.road import judged_by_prediction
from pvid.oracle.weak.verdict import Reason, Verdict
from pvid.rig.run import Recording

NOTHING = Verdict((Reason("not_identified", "The run does not determine the parameters: for a test."),))


def unknown(name: str, recording: Recording | None = None) -> Analysis:
    """An answer in which nothing is identified."""
    answer = answer_of(name, recording, lacking=subject(name).model.p_names)
    return replace(answer, found=replace(answer.found, verdict=NOTHING))


# Mechanisms by what they may have beside their parameters.
EXTRAS = {
    "kapitza": {"k1", "k2", "tau"},
    "isolator": {"tau"},
    "heated_plate": set[str](),
    "free_pendulum": set[str](),
    "dc_motor": set[str](),
}


@pytest.mark.parametrize(
    ("name", "lacking"), [("isolator", "c"), ("free_pendulum", "w2"), *((name, "") for name in EXTRAS)]
)
def test_what_a_refinement_determines_is_identified(name: str, lacking: str) -> None:
    """Though the weak form does not, one parameter or all, and of the reasons none is left that it does not."""
    of, weak = subject(name), unknown(name)
    if lacking:
        text, weak = f"The run does not determine {lacking}: for a test.", answer_of(name, lacking=(lacking,))
        judged = Verdict((Reason("undetermined", text, of=(lacking,)),))
        weak = replace(weak, found=replace(weak.found, verdict=judged))
    answer, refined, text = refined_answer(weak)
    assert refined is not None and answer is not weak and text.startswith("refined over")
    assert answer.identified and answer.found.verdict.warning is None
    for one in of.model.p_names:
        value = answer.values[one]
        assert value.status == "identified" and value.value is not None and value.se is not None
        assert abs(value.value - of.truth[one]) < 3.5 * value.se
    shown = Refinement(True, text, refined).as_json()
    assert shown["blocks"] == len(refined.found.cut.first) and shown["slow_chi2"] < 1.5
    assert set(shown["parameters"]) == EXTRAS[name] and all(one["se"] > 0 for one in shown["parameters"].values())


# A sensor, and a frequency within the motion.
SHAKEN = {"isolator": ("x", 1.7), "free_pendulum": ("q", 1.7), "heated_plate": ("T", 0.02)}


def vibrating(name: str, of_noise: float) -> Recording:
    """A vibration of the sensor, as a factor of the standard deviation of its noise."""
    sensor, hz = SHAKEN[name]
    return shaken(run_of(name), sensor, of_noise * subject(name).model.signal(sensor).sd, hz)


@pytest.mark.parametrize("name", SHAKEN)
def test_the_weak_answer_stands_where_the_sensor_is_not_that_of_the_model(name: str) -> None:
    """Residuals far above the noise, and the text has their size."""
    weak = answer_of(name, vibrating(name, 10.0))
    answer, _, text = refined_answer(weak)
    assert answer is weak and "slow residuals" in text and "the weak form's answer stands" in text


@pytest.mark.parametrize(("name", "of_noise"), [("isolator", 1.0), ("free_pendulum", 1.0), ("heated_plate", 3.0)])
def test_where_the_weak_form_has_no_answer_residuals_above_noise_give_one_with_a_warning(
    name: str, of_noise: float
) -> None:
    """A small vibration: both halves give the same parameters, within standard errors that contain the residuals."""
    answer, refined, _ = refined_answer(unknown(name, vibrating(name, of_noise)))
    assert refined is not None and GOOD < refined.found.slow_chi2 < BEARABLE and answer.identified
    assert "times the variance" in (answer.found.verdict.warning or "")
    assert (np.abs(errors_over_se(refined, subject(name))) < 3).all()
    main, found = list(refined.main), refined.found
    assert (np.diag(found.covariance)[main] > 1.5**2 * np.diag(found.noise)[main]).all()


def _isolator(name: str, factor: float) -> Recording:
    return isolator_run(of={**ISOLATED, name: factor * ISOLATED[name]})


@pytest.mark.parametrize(
    ("of", "other"),
    [
        ("isolator", partial(_isolator, "k", 1.002)),
        ("isolator", partial(_isolator, "c", 1.02)),
        ("heated_plate", partial(own_recording, "heated_plate", h=1.02)),
        ("heated_plate", partial(own_recording, "heated_plate", C=1.01)),
    ],
)
def test_a_recording_whose_halves_differ_has_no_answer(of: str, other: Callable[[], Recording]) -> None:
    """A parameter of the second half is larger, and the residuals do not show by how much, or are noise."""
    run, signals = run_of(of), other().signals
    half, lost = len(run) // 2, np.full(10, np.nan)
    joined = {one: np.r_[x[: half - 5], lost, signals[one][half + 5 :]] for one, x in run.signals.items()}
    answer, refined, text = refined_answer(unknown(of, changed(run, **joined)))
    assert refined is not None and not answer.identified and "nothing is identified" in text
    assert "the halves of the recording differ by" in text and refined.halves_differ() > AGREE


@pytest.mark.parametrize("name", ["heated_plate", "dc_motor"])
def test_halves_that_cannot_be_compared_are_a_doubt(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of parameters that the weak form does not determine; its own are confirmed by it."""
    outcome = refined_of(name)
    monkeypatch.setattr(RefinedMechanism, "halves_differ", lambda _: np.inf)
    assert _not_adopted(unknown(name), outcome) is None
    assert any("nothing confirms" in one.text and one.alarm for one in _doubts(unknown(name), outcome))
    assert not any("nothing confirms" in one.text for one in _doubts(answer_of(name), outcome))


@pytest.mark.parametrize("name", ["isolator", "free_pendulum"])
def test_another_fit_that_explains_the_recording_as_well_is_a_reason_to_hold(name: str) -> None:
    """Of two fits one in the valley of the other: the standard errors of either are those of its own place."""
    outcome, weak = refined_of(name), answer_of(name)
    assert outcome.rivals_differ() == 0 and replace(outcome, rivals=(outcome.found,)).rivals_differ() == 0
    sd = np.sqrt(outcome.found.covariance[0, 0])  # of a logarithm
    far = replace(outcome.found, r=outcome.found.r * np.where(np.arange(len(outcome.found.r)) == 0, 1 + 6 * sd, 1.0))
    rivalled = replace(outcome, rivals=(outcome.found, far))
    assert rivalled.rivals_differ() == pytest.approx(6 / np.sqrt(2), rel=0.01)
    assert "other parameters explain" in (_not_adopted(weak, rivalled) or "")
    assert _not_adopted(weak, outcome) is None


@pytest.mark.parametrize(("name", "wrong"), [("isolator", "c"), ("heated_plate", "h")])
def test_a_refined_answer_is_doubted_where_the_weak_one_and_its_residuals_contradict_it(name: str, wrong: str) -> None:
    outcome, weak, of = refined_of(name), answer_of(name, factor=1.0), subject(name)
    p = of.p * np.where(np.array(of.model.p_names) == wrong, 1.5, 1.0)
    far = replace(weak, found=replace(weak.found, p=p, se=0.02 * np.abs(p)))
    noisy = replace(outcome, found=replace(outcome.found, slow_chi2=2.0))
    (reason,) = _doubts(far, noisy)
    assert f"differ in {wrong} by -33." in reason.text and reason.alarm
    assert not list(_doubts(far, outcome))


def test_a_delay_that_may_stand_for_another_error_is_doubted() -> None:
    found, weak = refined_of("isolator", 1e-3), answer_of("isolator")
    assert not list(_doubts(weak, found))
    place = found.names.index("tau")
    r = np.where(np.arange(len(found.found.r)) == place, 2 * LARGEST_SKEW_S, found.found.r)
    (reason,) = _doubts(weak, replace(found, found=replace(found.found, r=r)))
    assert "a delay of 10 ms between the samples of b" in reason.text and reason.name == "skew"


def with_scales(refined: RefinedMechanism, **known_sd: float) -> RefinedMechanism:
    """The refinement of a model with errors of gains, constants and the clock of 1 %."""
    made = refined.problem.kernel.made
    signals = tuple(replace(one, gain_sd=0.01) for one in made.model.signals)
    knowns = tuple(replace(one, sd=known_sd.get(one.name, 0.0) * one.value) for one in made.model.knowns)
    kernel = refined.problem.kernel
    own = object.__new__(type(kernel))
    own.__dict__.update(kernel.__dict__)
    own.made = replace(made, model=replace(made.model, signals=signals, knowns=knowns, clock_sd=0.01))
    problem = object.__new__(type(refined.problem))
    problem.__dict__.update(refined.problem.__dict__)
    problem.kernel = own
    return replace(refined, problem=problem)


def test_a_wrong_scale_moves_a_refined_estimate_as_the_equations_have_it() -> None:
    """With y or 1/l1 read 1 % too large w is 1 % too large, d1 1 % and d2 2 % too small; with time 1 % too short,
    frequencies and stiffness are 1 and 2 % too large."""
    pendulum = with_scales(refined_small(), l1=0.01)
    moved = scales_of(pendulum) / subject("kapitza").p
    assert moved.shape == (4, 4)  # l1, gains of y and phi, the clock
    np.testing.assert_allclose(moved[1, :3], [0.01, -0.01, -0.02], rtol=0.05)
    np.testing.assert_allclose(moved[0, :3], [-0.01, 0.01, 0.02], rtol=0.05)
    np.testing.assert_allclose(moved[3, :3], [0.02, 0.0, 0.0], atol=3e-3)


def test_a_scale_moves_a_refined_estimate_by_what_a_refinement_of_scaled_samples_finds() -> None:
    run, refined = run_of("isolator"), refined_of("isolator")
    found = scales_of(with_scales(refined))
    moved = refine(answer_of("isolator", changed(run, b=1.01 * run.signals["b"])))
    apart = [moved.values[name] - refined.values[name] for name in ("c", "k")]
    np.testing.assert_allclose(found[0, :2], apart, rtol=0.15)
    truth = subject("isolator").truth
    np.testing.assert_allclose(found[-1, :2], [0.01 * truth["c"], 0.02 * truth["k"]], rtol=0.05)  # of the clock


def test_a_refined_answer_predicts_with_the_extras_that_it_needs() -> None:
    """A play of the sensor: the equations of the weak form alone predict its readings to fifty times the noise."""
    run = run_of("isolator")
    late = changed(run, x=played(run.signals["x"], 5e-4))
    answer, refined, text = refined_answer(answer_of("isolator", late))
    assert refined is not None and "play" in refined.extras
    (sensor,) = judged_by_prediction(replace(answer, refinement=Refinement(True, text, refined))).prediction
    assert sensor.of_noise is not None and sensor.of_noise < 5


def test_a_delay_is_advised_as_the_rig_file_has_it() -> None:
    """A recording that is moved by it has none left."""
    run = run_of("isolator", 2e-3)
    (sentence,) = refined_answer(answer_of("isolator", run))[0].advice
    assert sentence.startswith("b is read 2 ms earlier than the other sensors: --set sensor.b.delay=-0.002 ")
    model = subject("isolator").model
    signals = tuple(replace(one, delay=-2e-3 if one.name == "b" else 0.0) for one in model.signals)
    moved = aligned(run, replace(model, signals=signals))
    assert refine(answer_of("isolator", moved)).values["tau"] == pytest.approx(0.0, abs=1e-4)
    assert not refined_answer(answer_of("isolator"))[0].advice
