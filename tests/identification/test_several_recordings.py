"""Several recordings of one mechanism: shared parameters, own ones, and what predicts them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, dlsim

from pvid.base.errors import PvidError
from pvid.identification.advice import advice_on
from pvid.identification.analysis import analysed, own_of
from pvid.identification.answer import Analysis
from pvid.identification.judge import judged
from pvid.identification.refinement.adoption import refined_answer
from pvid.identification.refinement.inputs import inputs_of
from pvid.identification.refinement.kernel import kernel_of
from pvid.identification.refinement.problem import problem_of
from pvid.identification.refinement.search import refine
from pvid.identification.road import identified
from pvid.identification.validation import predicted
from pvid.model import Model, sin
from pvid.model.compiled import CompiledModel
from pvid.model.signals import Jet
from pvid.model.together import offsets, with_own
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows
from pvid.rig.columns import Columns
from pvid.rig.mechanism_file import channels_of
from pvid.rig.run import Recording
from pvid.rig.together import joined
from pvid.sim.simulated_run import RigSimulation

RATE = 250.0
NOISE = 4e-4


def spring(coil: bool = False) -> CompiledModel:
    """A mass on a spring whose sensor has an unknown offset; also with a coil, whose force is g times its current."""
    model = Model("mass on a spring")
    F = model.input("F", "N", hold="zoh", reach=20, gain_sd=0)
    x = model.sensor("x", "m", resolution=0, noise=NOISE, reach=0.5, gain_sd=0)
    m, b, k = model.unknown("m", "kg", 0.8), model.unknown("b", "N*s/m", 1.5), model.unknown("k", "N/m", 40.0)
    x0 = model.unknown("x0", "m", 0.0, positive=False, sd=0.05)
    force = F
    if coil:
        force = F + model.unknown("g", "N/A", 3.0) * model.input("i", "A", hold="zoh", reach=5, gain_sd=0)
    model.output("period", "s", 2 * np.pi * (m / k) ** 0.5)
    model.equation(m * x.d(2) + b * x.d() + k * (x - x0) - force)
    return replace(model.compiled("spring"), clock_sd=0.0)


SPRING = spring()


def pushed(seed: int, m: float = 1.0, k: float = 50.0, x0: float = 0.01, n: int = 4000) -> Recording:
    """Random steps of the force, from rest."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-5.0, 5.0], n // 50 + 1), 50)[:n]
    matrices = [[[0, 1], [-k / m, -1 / m]], [[0], [1 / m]], [[1, 0]], [[0]]]
    a, b, c, d, _ = cont2discrete(tuple(np.array(one, np.float64) for one in matrices), 1 / RATE)
    _, x, _ = dlsim((a, b, c, d, 1 / RATE), u)
    return Recording(np.arange(n) / RATE, {"F": u, "x": x[:, 0] + x0 + NOISE * rng.normal(size=n)}, RATE)


def by_coil(one: Recording, g: float = 4.0) -> Recording:
    """The same motion, made by a current."""
    u = one.signals["F"]
    return replace(one, signals={**one.signals, "F": 0 * u, "i": u / g})


def both(first: Recording, second: Recording, model: CompiledModel = SPRING) -> Recording:
    return joined([first, second], ("A", "B"), Columns(channels_of(model)))


def assert_near(answer: Analysis, truth: dict[str, float], most: float = 4.0) -> None:
    """Within so many of its standard errors, none of which hides a failure."""
    for name, value in truth.items():
        one = answer.values[name]
        assert one.value is not None and one.se is not None, name
        assert abs(one.value - value) < most * one.se, name


def test_two_recordings_determine_what_neither_does() -> None:
    """Without a current nothing shows its force; without another force nothing shows the size of anything."""
    model = spring(coil=True)
    hand, coil = pushed(1), by_coil(pushed(2, x0=-0.02))
    hand = replace(hand, signals={**hand.signals, "i": np.zeros(len(hand))})
    alone = [analysed(one, model).values for one in (hand, coil)]
    assert alone[0]["g"].status == "not_identified" and alone[0]["m"].status == "identified"
    assert all((alone[1][name].se or np.inf) > 0.1 * (alone[1][name].value or 0.0) for name in ("g", "m", "b", "k"))
    together = analysed(both(hand, coil, model), model, own=["x0"])
    assert_near(together, {"m": 1.0, "b": 1.0, "k": 50.0, "g": 4.0, "x0[A]": 0.01, "x0[B]": -0.02})
    for name, value in {"m": 1.0, "k": 50.0, "g": 4.0}.items():
        assert (together.values[name].se or 1.0) < 0.005 * value


def test_twice_the_data_have_smaller_errors() -> None:
    alone = analysed(pushed(3), SPRING)
    together = analysed(both(pushed(3), pushed(4)), SPRING)
    for name in ("m", "b", "k"):
        ratio = (together.values[name].se or 1.0) / (alone.values[name].se or 1.0)
        assert ratio == pytest.approx(0.5**0.5, abs=0.2)  # either run's own error is off by a fifth


def test_own_masses_are_found_and_what_follows_from_them() -> None:
    loaded = both(pushed(3), pushed(4, m=1.3, x0=-0.02))
    answer = analysed(loaded, SPRING, own=own_of(SPRING, loaded, ["m"]))
    assert_near(answer, {"m[A]": 1.0, "m[B]": 1.3, "k": 50.0, "x0[A]": 0.01, "x0[B]": -0.02})
    assert_near(answer, {f"period[{name}]": 2 * np.pi * (m / 50.0) ** 0.5 for name, m in {"A": 1.0, "B": 1.3}.items()})
    assert answer.found.verdict.status == "good"
    assert set(answer.as_json()["recordings"]) == {"A", "B"}
    again, refined, text = refined_answer(answer)
    assert refined is not None and refined.found.converged and text.startswith("refined over")
    assert refined.found.slow_chi2 < 1.5 and refined.halves_differ() < 4
    assert_near(again, {"m[A]": 1.0, "m[B]": 1.3, "k": 50.0, "x0[A]": 0.01, "x0[B]": -0.02}, 3.5)
    alone = refine(analysed(pushed(3), SPRING))
    assert refined.errors["k"] < alone.errors["k"] and refined.errors["m[A]"] < alone.errors["m"]
    assert refined.values["x0[B]"] - refined.values["x0[A]"] == pytest.approx(-0.03, abs=1e-4)


def test_derivatives_by_own_parameters_are_those_of_their_recording() -> None:
    loaded = both(pushed(3), pushed(4, m=1.3))
    model = with_own(SPRING, ["m", "x0"], ["A", "B"])
    p = np.array([1.0, 1.3, 1.0, 50.0, 0.01, 0.02])
    problem, r = problem_of(model, loaded.run, RATE, p)
    cut = problem.cut(400)
    starts = problem.first_starts(cut, r)
    block = problem.block(r, cut, starts, problem.used(cut))
    assert block is not None
    of_first = cut.first < loaded.origins[0].end
    for k, one in enumerate(problem.kernel.made.parameters):
        step = np.zeros(problem.n)
        step[k] = 1e-5
        moved = [problem.simulated(problem.moved(r, sign * step), cut, starts) for sign in (1, -1)]
        slope = (moved[0] - moved[1]) / 2e-5 / problem.measured.sd
        own = block.jacobian[..., problem.kernel.states + k]
        np.testing.assert_allclose(own, slope, atol=1e-6 * max(np.abs(slope).max(), 1.0))
        if one.name.endswith("[A]"):
            assert np.abs(own[of_first]).max() > 0 and not own[~of_first].any()


def test_offsets_of_sensors_are_own_and_lengths_are_not() -> None:
    recording = both(pushed(3), pushed(4))
    assert offsets(SPRING) == ("x0",)
    assert own_of(SPRING, recording) == ("x0",) and own_of(SPRING, recording, shared=["x0"]) == ()
    assert own_of(SPRING, recording, ["m"]) == ("m", "x0") and own_of(SPRING, recording, in_c=True) == ()
    assert offsets(compiled_of("dc_motor")) == ("i0",) and offsets(compiled_of("cart_pendulum")) == ("c",)
    assert offsets(compiled_of("battery_2rc")) == ("E",)  # of a voltage that falls with the charge since the start
    assert offsets(compiled_of("two_link_arm")) == ()


@pytest.mark.parametrize(
    ("own", "shared", "in_c", "refusal"),
    [
        (["q"], [], False, "own q: spring has no such unknown; it has m, b, k and x0"),
        ([], ["q"], False, "shared q: spring has no such unknown"),
        (["m"], ["m"], False, "m is both own and shared"),
        (["m"], [], True, "own m: the C core has one value of each parameter"),
    ],
)
def test_a_wrong_own_parameter_is_refused(own: list[str], shared: list[str], in_c: bool, refusal: str) -> None:
    recording = both(pushed(3), pushed(4))
    with pytest.raises(PvidError, match=refusal):
        own_of(SPRING, recording, own, shared, in_c=in_c)


def test_an_own_parameter_of_a_single_recording_is_refused() -> None:
    with pytest.raises(PvidError, match="in several recordings, and there is one"):
        own_of(SPRING, pushed(3), ["m"])


def test_a_parameter_that_differs_is_named_and_each_recording_judged() -> None:
    loaded = both(pushed(3), pushed(4, m=1.3))
    answer = judged(analysed(loaded, SPRING, own=["x0"]))
    assert advice_on(answer) == ("the recordings differ in m: --own m gives each its own",)
    assert set(answer.predicted) == {"A", "B"}
    rms = [one.rms for sensors in answer.predicted.values() for one in sensors]
    assert max(rms) > 10 * NOISE and min(rms) <= answer.prediction[0].rms <= max(rms)
    assert answer.as_json()["recordings"]["B"]["prediction"]["x"]["rms"] == answer.predicted["B"][0].rms


def test_equal_recordings_get_no_advice_on_own_parameters() -> None:
    answer = identified(both(pushed(3), pushed(4)), SPRING, refine=False, own=["x0"])
    assert not answer.advice and answer.found.verdict.status == "good"


def test_another_recording_is_predicted_with_its_own_parameter_fitted() -> None:
    loaded = both(pushed(3), pushed(4, m=1.3))
    answer = analysed(loaded, SPRING, own=["m", "x0"])
    values = {name: one.value for name, one in answer.values.items()}
    found = predicted(answer.model, pushed(5, m=1.15, x0=0.03), values, answer.found.design.window_s)
    assert found.fitted["m"] == pytest.approx(1.15, rel=2e-3) and found.fitted["x0"] == pytest.approx(0.03, abs=1e-4)
    assert found.sensors[0].of_noise == pytest.approx(1.0, abs=0.1) and "its own m of 1.15" in found.text
    other = replace(pushed(5), signals={**pushed(5).signals, "F": pushed(6).signals["F"]})
    wrong = predicted(answer.model, other, values, answer.found.design.window_s)
    assert wrong.sensors[0].of_motion > 0.3  # a mass that is fitted explains no other force


def test_a_mechanism_without_an_input_has_a_start_in_each_recording() -> None:
    model = Model("free pendulum")
    th = model.sensor("th", "rad", resolution=0, noise=1e-3, reach=2, gain_sd=0)
    w, b = model.unknown("w", "1/s^2", 20.0), model.unknown("b", "1/s", 0.2)
    c = model.unknown("c", "rad", 0.0, positive=False, sd=0.2)
    model.equation(th.d(2) + b * th.d() + w * sin(th - c))
    compiled = model.compiled("free")
    t = np.arange(2500) / 100.0

    def swing(angle: float, zero: float, seed: int) -> Recording:
        exact = solve_ivp(
            lambda _, x: [x[1], -0.1 * x[1] - 25.0 * np.sin(x[0])], (0, t[-1]), [angle, 0], t_eval=t, rtol=1e-9
        )
        noise = 1e-3 * np.random.default_rng(seed).normal(size=t.size)
        return Recording(t, {"th": exact.y[0] + zero + noise}, 100.0)

    run = both(swing(1.0, 0.05, 1), swing(0.4, -0.1, 2), compiled)
    answer = analysed(run, compiled, own=own_of(compiled, run))
    truth = {"w": 25.0, "b": 0.1, "c[A]": 0.05, "c[B]": -0.1}
    assert_near(answer, truth)
    assert_near(refined_answer(answer)[0], truth)


def test_an_algebraic_equation_has_own_parameters() -> None:
    """A motor without inductance, with one load and then another."""
    model = Model("motor without inductance")
    v = model.input("v", "V", hold="zoh", reach=12, gain_sd=0)
    i = model.sensor("i", "A", resolution=0, noise=5e-3, reach=10, gain_sd=0)
    s = model.sensor("s", "rad/s", resolution=0, noise=0.05, reach=200, gain_sd=0)
    r, k = model.unknown("R", "ohm", 1.0), model.unknown("k", "N*m/A", 0.04)
    j, b = model.unknown("J", "kg*m^2", 2e-4), model.unknown("b", "N*m*s", 2e-4)
    model.equation(r * i + k * s - v)
    model.equation(j * s.d() + b * s - k * i)
    compiled = model.compiled("motor")

    def turned(inertia: float, resistance: float, seed: int, n: int = 3000) -> Recording:
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.uniform(-10, 10, n // 40), 40)
        decay = (1e-4 + 0.05**2 / resistance) / inertia
        gain = 0.05 / resistance / inertia
        speed = np.zeros(n)
        for at in range(n - 1):
            speed[at + 1] = speed[at] * np.exp(-decay / 500) + gain / decay * (1 - np.exp(-decay / 500)) * u[at]
        current = (u - 0.05 * speed) / resistance  # just behind each jump of the voltage
        noisy = {"i": current + 5e-3 * rng.normal(size=n), "s": speed + 0.05 * rng.normal(size=n)}
        return Recording(np.arange(n) / 500.0, {"v": u, **noisy}, 500.0)

    run = both(turned(1e-4, 1.2, 1), turned(3e-4, 1.5, 2), compiled)
    answer = analysed(run, compiled, own=["R", "J"])
    assert_near(answer, {"R[A]": 1.2, "R[B]": 1.5, "J[A]": 1e-4, "J[B]": 3e-4, "k": 0.05, "b": 1e-4})


def test_an_integral_since_the_start_begins_with_each_recording() -> None:
    model = compiled_of("battery_2rc")
    simulation = RigSimulation.of(model, simulated_rig("battery_2rc"))
    parts = [Recording(run.pop("t"), run, simulation.rig.sample_rate) for run in map(simulation.run, (1, 2))]
    run = both(parts[0], parts[1], model)
    u, _ = inputs_of(model, kernel_of(model).made, run.run, run.sample_rate, 1)
    place = kernel_of(model).made.inputs.index(Jet("z"))
    for own, part in zip(run.origins, parts, strict=True):
        alone, _ = inputs_of(model, kernel_of(model).made, part.signals, part.sample_rate, 1)
        inner = slice(2, len(part) - 2)  # the cubics at the ends have other neighbours
        np.testing.assert_allclose(u[own.first : own.end, 0, place][inner], alone[:, 0, place][inner], rtol=1e-9)
    answer = analysed(run, model, own=own_of(model, run))
    assert_near(answer, dict(zip(model.p_names[:-1], simulation.truth, strict=False)))
    grid = answer.found.fit.rows.record.grid
    assert len(grid.parts) == 2 and isinstance(answer.found.fit.rows, WeakRows) and ready(answer.model).within
