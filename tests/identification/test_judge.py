"""What an answer predicts: another run, and motion of its own that it was not fitted to."""

import json
from math import tanh
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from runge_kutta import States, motion
from scipy.signal import cont2discrete, dlsim, lfilter

import pvid
from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.judge import judged, with_unseen
from pvid.identification.refinement.inputs import second_derivative_of
from pvid.identification.road import identified
from pvid.identification.sensor_prediction import SensorPrediction
from pvid.identification.validation import Validation, validated
from pvid.model import sgn
from pvid.model.compiled import CompiledModel
from pvid.model.description import Model
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.run import Recording
from pvid.sim.simulated_run import RigSimulation

Float = npt.NDArray[np.float64]


def recording(name: str, seed: int = 0) -> tuple[CompiledModel, Recording, Float]:
    """A run of a shipped rig, and its truth."""
    model = compiled_of(name)
    simulation = RigSimulation.of(model, simulated_rig(name))
    run = simulation.run(seed)
    t = run.pop("t")
    return model, Recording(t, run, simulation.rig.sample_rate), np.asarray(simulation.truth)


@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc", "rigid_body", "cart_pendulum"])
def test_the_truth_predicts_every_sensor_to_its_noise(name: str) -> None:
    model, run, truth = recording(name)
    found = validated(model, run, truth, 1e3 / run.sample_rate)
    assert {one.name for one in found.sensors} <= {one.name for one in model.signals if one.kind == "sensor"}
    for one in found.sensors:
        assert one.of_noise == pytest.approx(1.0, abs=0.15)
        assert one.r2 > 0.99
        rms = np.sqrt(np.mean((found.measured[one.name] - found.simulated[one.name]) ** 2))
        assert rms == pytest.approx(one.rms, rel=1e-6)


def test_poor_prediction_of_an_explained_run_is_a_doubt_where_it_is_more_than_noise() -> None:
    model, run, _ = recording("dc_motor")
    answer = analysed(Recording(run.t[:6000], {name: x[:6000] for name, x in run.signals.items()}, 1000.0), model)
    assert answer.verdict.word == "good"
    good = SensorPrediction("i", "A", 1e-3, 0.01, 1.0)
    noisy, poor = (SensorPrediction("phi", "rad", 1e-3, 0.7, of_noise) for of_noise in (1.2, 8.0))

    def predicted(*sensors: SensorPrediction) -> Validation:
        return Validation(sensors, 1.0, 1, np.zeros(0), {}, {})

    assert with_unseen(answer, predicted(good, noisy)).verdict == answer.verdict
    doubted = with_unseen(answer, predicted(good, poor))
    assert doubted.verdict.word == "not_explained" and doubted.prediction == (good, poor)
    assert "predicts 51 % of phi" in str(doubted.verdict.warning)
    assert {one.word for one in doubted.values.values()} == {"not_explained"}
    assert doubted.as_json()["verdict"] == "not_explained"


def test_a_term_that_no_prediction_misses_is_told_and_one_that_is_missed_is_not() -> None:
    def told(friction: float) -> str:
        t = np.arange(6000) / 500
        force = 4 * np.sin(2 * np.pi * 0.7 * t) + 3 * np.sin(2 * np.pi * 1.9 * t)

        def slope(z: States, f: float) -> States:
            return z[1], (f - 1.7 * z[1] - 82 * z[0] - friction * tanh(z[1] / 1e-3)) / 1.3

        x = motion(slope, (0.0, 0.0), force, 1 / 500, 4)[:, 0]
        x += np.random.default_rng(1).normal(0, 3e-5, 6000)
        model = Model("cart")
        given = model.input("F", "N", hold="zoh", reach=12, gain_sd=0)
        place = model.sensor("x", "m", resolution=0, noise=3e-5, reach=0.5)
        m, c, k = model.unknown("m", "kg", 1), model.unknown("c", "N*s/m", 1), model.unknown("k", "N/m", 60)
        dry = model.unknown("Fc", "N", 0.5)
        model.equation(m * place.d(2) + c * place.d() + k * place + dry * sgn(place.d()) - given)
        answer = identified(Recording(t, {"F": force, "x": x}, 500.0), model.compiled("cart"))
        return " ".join(one.text for one in answer.verdict.reasons)

    assert "Without Fc, motion that was not fitted is predicted as well" in told(0.0)
    assert "Without Fc," not in told(0.2)


def test_a_wrong_parameter_predicts_worse() -> None:
    model, run, truth = recording("dc_motor")
    wrong = truth * np.where(np.arange(len(truth)) == 3, 1.02, 1.0)  # J
    right, other = (validated(model, run, p, 1.0).sensors for p in (truth, wrong))
    assert other[1].rms > 5 * right[1].rms


def test_the_pendulum_is_simulated_by_its_full_equations_under_a_measured_pivot(tmp_path: Path) -> None:
    """Its input is the second derivative of what a sensor measures."""
    run, answer = tmp_path / "run.csv", tmp_path / "answer.json"
    assert (
        CliRunner().invoke(commands, ["simulate", str(run), "--duration", "15"], standalone_mode=False).exit_code == 0
    )
    told = CliRunner().invoke(commands, ["identify", str(run), "--json"], standalone_mode=False)
    answer.write_text(told.stdout, encoding="utf-8")
    done = CliRunner().invoke(commands, ["validate", str(run), "--from", str(answer), "--json"], standalone_mode=False)
    phi = json.loads(done.stdout)["sensors"]["phi"]
    assert phi["of_noise"] == pytest.approx(1.0, abs=0.1) and phi["r2"] > 0.999


def test_second_derivative_of_a_signal_with_a_gap() -> None:
    t = np.arange(4000) * 1e-3
    rng = np.random.default_rng(1)
    x = 1e-2 * np.sin(20 * t) + rng.normal(size=t.size) * 1e-6
    x[1500:1600] = np.nan
    found = second_derivative_of(x, 1e3, 1e-6)
    there = np.isfinite(found)
    assert not there[1500:1600].any() and there.sum() > 2500
    assert np.abs(found - -4.0 * np.sin(20 * t))[there].max() < 0.02


def cart(seed: int, disturbance: float) -> tuple[CompiledModel, Recording]:
    """A cart on a spring, m 1.3 kg, c 1.7 N s/m, k 82 N/m, and a force that nobody records [N]: no term is missing."""
    model = Model("cart")
    x, force = model.sensor("x", "m", resolution=1e-5), model.input("F", "N", hold="zoh")
    mass, c, k = model.unknown("m", "kg", 1.0), model.unknown("c", "N*s/m", 1.0), model.unknown("k", "N/m", 60.0)
    model.equation(mass * x.d(2) + c * x.d() + k * x - force)
    rng, rate, count = np.random.default_rng(seed), 500.0, 10_000
    drive = np.repeat(rng.normal(size=count // 50) * 3, 50)
    other = lfilter([1 - 0.98], [1, -0.98], rng.normal(size=count)) * 10 * disturbance
    a, b = np.array([[0, 1], [-82 / 1.3, -1.7 / 1.3]]), np.array([[0], [1 / 1.3]])
    system = cont2discrete((a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1))), 1 / rate)
    place = dlsim((*system[:4], 1 / rate), drive + other)[1][:, 0]
    read = np.round((place + rng.normal(size=count) * 2e-6) / 1e-5) * 1e-5
    return model.compiled("cart"), Recording(np.arange(count) / rate, {"x": read, "F": drive}, rate)


def test_a_run_of_the_sensors_noise_alone_is_not_judged() -> None:
    model, run = cart(3, 0.0)
    answer = analysed(run, model)
    assert answer.found.chi2 < 2.0 and judged(answer) is answer


@pytest.mark.parametrize("seed", range(4))
def test_estimates_that_predict_alike_are_in_the_standard_errors(seed: int) -> None:
    model, run = cart(seed, 0.2)
    usual = analysed(run, model)
    answer = judged(usual)
    assert usual.found.chi2 > 2.0 and answer.prediction
    assert all(0.5 < one.r2 < 0.9999 for one in answer.prediction)
    for name, truth in {"m": 1.3, "c": 1.7, "k": 82.0}.items():
        value, se = answer.values[name].value, answer.values[name].se
        assert value is not None and se is not None and abs(value - truth) < 3 * se
    assert np.all(answer.found.se >= 0.99 * usual.found.se) or not np.array_equal(answer.found.p, usual.found.p)


def test_validate_in_python_and_the_difference_of_two_results(tmp_path: Path) -> None:
    model, run, _ = recording("dc_motor")
    _, other, _ = recording("dc_motor", seed=5)
    data = [{"t": one.t, **one.signals} for one in (run, other)]
    first, second = (pvid.identify(one, model="dc_motor") for one in data)
    found = first.validate(data[1])
    assert [one.name for one in found.sensors] == ["i", "phi"] and found.sensors[0].of_noise == pytest.approx(
        1, abs=0.1
    )
    apart = first.compare(second)
    assert set(apart) == set(model.p_names) and max(map(abs, apart.values())) < 4.5


def test_an_answer_without_a_value_or_of_another_mechanism_is_refused(tmp_path: Path) -> None:
    model, run, truth = recording("dc_motor")
    answer = {"model": "furuta", "parameters": {}}
    (tmp_path / "a.json").write_text(json.dumps(answer), encoding="utf-8")
    columns = [run.t, *(run.signals[name] for name in ("V", "i", "phi"))]
    np.savetxt(tmp_path / "run.csv", np.transpose(columns), delimiter=",", header="t,V,i,phi", comments="")
    arguments = ["validate", str(tmp_path / "run.csv"), "--from", str(tmp_path / "a.json"), "--model", "dc_motor"]
    with pytest.raises(PvidError, match="is of the mechanism furuta"):
        CliRunner().invoke(commands, arguments, standalone_mode=False, catch_exceptions=False)
    answer = {"parameters": {name: {"value": None if name == "L" else 1.0} for name in model.p_names}}
    (tmp_path / "a.json").write_text(json.dumps(answer), encoding="utf-8")
    with pytest.raises(PvidError, match="L of dc_motor has no value there"):
        CliRunner().invoke(commands, arguments, standalone_mode=False, catch_exceptions=False)


def process_of_one_step(seed: int, slow_noise: float) -> tuple[CompiledModel, Recording]:
    """A process of first order, 66 s slow, sampled at 10 Hz for 430 s, whose input steps once; the surface moves."""
    rng, rate, count = np.random.default_rng(seed), 10.0, 4300
    model = Model("level")
    u = model.input("u", "V", hold="zoh", reach=10)
    h = model.sensor("h", "m", resolution=1e-4, reach=1)
    K, T = model.unknown("K", "m/V", 3.0), model.unknown("T", "s", 50.0)
    h0 = model.unknown("h0", "m", -10.0, positive=False, sd=10)
    model.equation(T * h.d() + h - K * u - h0)
    drive = np.where(np.arange(count) < 60, 5.0, 5.5)
    level = lfilter([0.0, -np.expm1(-1 / (rate * 66.0))], [1.0, -np.exp(-1 / (rate * 66.0))], 4.5 * (drive - 5.0)) + 2.0
    waves = lfilter([1.0], [1.0, -0.9], rng.normal(size=count)) * slow_noise
    read = np.round((level + waves) / 2e-3) * 2e-3
    return model.compiled("level"), Recording(np.arange(count) / rate, {"h": read, "u": drive}, rate)


@pytest.mark.parametrize("seed", range(2))
def test_one_step_of_a_slow_process_gives_its_time_constant(seed: int) -> None:
    model, run = process_of_one_step(seed, 0.03)
    answer = identified(run, model)
    assert isinstance(answer, Analysis)
    found = answer.found
    assert len(found.times) != len(found.history_times) == len(found.history)  # another fit is published
    T = answer.values["T"]
    assert T.value is not None and T.se is not None
    assert abs(T.value - 66.0) < min(3 * T.se, 0.2 * 66.0)  # windows of 5 s show 0.3 s


def pushed_pendulum(seed: int, size: float) -> Recording:
    """A pendulum without dry friction, pushed by something slow that nobody recorded."""
    rng, rate, count = np.random.default_rng(seed), 500.0, 2500
    push, step, q, v, read = lfilter([0.02], [1, -0.98], rng.normal(size=count)) * size, 1 / 2000.0, -2.3, -3.0, []
    for now in push:
        read.append(q)
        for _ in range(4):
            v += step * (now - 120 * np.sin(q) - 0.4 * v)
            q += step * v
    return Recording(np.arange(count) / rate, {"q": np.round(np.array(read) / 1.6e-3) * 1.6e-3}, rate)


@pytest.mark.parametrize("size", [20.0, 60.0])
def test_a_search_that_ran_to_0_does_not_withhold_what_predicts_the_motion(size: float) -> None:
    usual = analysed(pushed_pendulum(2, size), compiled_of("free_pendulum"))
    answer = judged(usual)
    assert not usual.found.fit.settled and not usual.identified
    w2 = answer.values["w2"]
    assert answer.status == "warning" and all(one.r2 > 0.99 for one in answer.prediction)
    assert w2.value is not None and w2.se is not None and abs(w2.value - 120.0) < 3 * w2.se < 0.1 * 120.0
    assert answer.values["c"].value is None
    assert {"not_settled", "undetermined"} <= {one.name for one in answer.verdict.reasons}


def test_a_prediction_that_runs_away_has_words_and_no_digits() -> None:
    away = SensorPrediction("i", "A", 1e17, 1e18, 8.7e19)
    assert str(away) == "i not at all (the simulated motion leaves the measured one without bounds)"
    assert away.times_noise == "more than 10000"
    assert SensorPrediction("i", "A", 0.1, 0.5, 312.4).times_noise == "312"
