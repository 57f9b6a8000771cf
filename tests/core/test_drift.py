"""Parameters that drift along given directions alone: float64 and the C core against the batch problems that they
solve, and a motor whose winding heats."""

from copy import copy
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from weak_rig import assert_equals_the_twin

import pvid
from pvid.base.errors import PvidError
from pvid.codegen.weak_library import weak_native
from pvid.configuration.weak import config_to_identify, samples_of
from pvid.identification.advice import advised
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.core import identify_in_c
from pvid.identification.summary import Made
from pvid.identification.validation import validated
from pvid.model import Model
from pvid.model.compiled import CompiledModel
from pvid.model.report import check_report
from pvid.model.strong import strong_form
from pvid.oracle.weak.drift import Forwards
from pvid.rig.columns import Columns
from pvid.rig.mechanism_file import channels_of
from pvid.rig.run import Recording
from pvid.rig.together import joined
from pvid.show.report import report

Float = npt.NDArray[np.float64]

ALPHA, BETA = 0.0039, 0.0012  # of copper and magnets [1/K]


def test_a_constant_direction_gives_the_least_squares_with_a_random_walk_along_it() -> None:
    """theta_(k+1) = theta_k + D nu_k with the precision keep/(1 - keep) D^T M_k D of nu_k, all at once."""
    rng = np.random.default_rng(1)
    d, keep, sigma, count = np.array([1.0, 0.5, 0.0]), np.exp(-1 / 8), 0.05, 60
    rows = rng.normal(size=(count, 3))
    at = np.array([1.0, 0.8, 0.5]) + 0.002 * np.arange(count)[:, None] * d
    y = np.sum(rows * at, axis=1) + sigma * rng.normal(size=count)
    core = pvid.Estimator(
        lambda p: p, lambda p: np.eye(3), start=[1.0] * 3, start_sd=[1e3] * 3, row_sd=sigma, lower=[-9.0] * 3,
        upper=[9.0] * 3, positive=[False] * 3, rate=8.0, drift=lambda p: d, drift_s=1.0,
    ).add(rows, y)  # fmt: skip
    m, whole, right = np.zeros((3, 3)), np.zeros((2 * count - 1, count + 2)), np.zeros(2 * count - 1)
    for k in range(count):
        if k:
            of_d = m @ d
            whole[count + k - 1, 2 + k] = np.sqrt(d @ of_d * keep / (1 - keep))
            m = m - (1 - keep) * np.outer(of_d, of_d) / (d @ of_d)
        m = m + np.outer(rows[k], rows[k])
        whole[k, :3], whole[k, 3 : 3 + k], right[k] = rows[k], rows[k] @ d, y[k]
    found = np.linalg.lstsq(whole, right, rcond=None)[0]
    best, errors = found[:3] + d * found[3:].sum(), sigma * np.sqrt(np.diag(np.linalg.inv(m)))
    assert np.max(np.abs(core.estimate.p - best) / errors) < 1e-3  # float32
    assert np.max(np.abs(at[-1] - best) / errors) < 4


def heated(seed: int) -> tuple[Float, Float, Float, Float]:
    """t, rows of V = R i + k w, and R and k: 20 s of steps, then 3 A and 60 rad/s with 1 % of ripple; 15 min, 20 Hz."""
    rng, n = np.random.default_rng(seed), 18000
    t: Float = np.arange(n, dtype=np.float64) / 20
    heat = 60 * (1 - np.exp(-t / 240))
    steps = 1.5 * np.sign(np.sin(1.7 * t)) + 0.5 * rng.normal(size=n)
    i = np.where(t < 20, steps, 3 + 0.03 * np.sin(0.9 * t))
    w = np.where(t < 20, 100 * np.sin(0.8 * t) + 60 * np.sin(2.3 * t), 60 + 0.5 * np.sin(0.5 * t))
    truth = np.stack([1.2 * (1 + ALPHA * heat), 0.05 * (1 - BETA * heat)], axis=1)
    v = np.sum(truth * np.stack([i, w], axis=1), axis=1) + 0.02 * rng.normal(size=n)
    measured = np.stack([i + 0.002 * rng.normal(size=n), w + 0.05 * rng.normal(size=n)], axis=1)
    return t, measured, v, truth


def followed(seed: int, start: tuple[float, float], drifts: bool, forgetting: float = 0.0) -> Float:
    """Largest part in percent by which R and k are off, RMS behind the first minute."""
    t, rows, v, truth = heated(seed)
    n = 3 if drifts else 2
    core = pvid.Estimator(
        lambda p: p, lambda p: np.eye(n), start=[*start, 0.0][:n], start_sd=[1.0, 0.05, 10.0][:n], row_sd=0.02,
        lower=[0.01, 1e-3, -100.0][:n], upper=[10.0, 1.0, 200.0][:n], positive=[True, True, False][:n], rate=20.0,
        forgetting=forgetting, drift=along_the_heat if drifts else None, drift_s=1.0,
    )  # fmt: skip
    if drifts:
        core.step([0.0, 0.0, 20.0], 0.0)  # the rise of the temperature, which no other row contains, begins at 0
    out = np.empty_like(truth)
    for k in range(len(t)):
        core.step([*rows[k], 0.0][:n], v[k])
        out[k] = [core._state.p[a] for a in range(2)]
    off = (out / truth - 1)[t > 60]
    return np.asarray(100 * np.sqrt(np.mean(off**2, axis=0)))


def along_the_heat(p: Float) -> Float:
    """Of R, k and the rise of the temperature."""
    return np.array([ALPHA * p[0] / (1 + ALPHA * p[2]), -BETA * p[1] / (1 - BETA * p[2]), 1.0])


@pytest.mark.parametrize("start", [(0.6, 0.025), (1.8, 0.025), (1.8, 0.075)])
def test_a_winding_that_heats_by_60_kelvin_is_followed(start: tuple[float, float]) -> None:
    """R and k by 0.2 %, from starts that are 50 % off."""
    assert (followed(0, start, drifts=True) < 0.2).all()


def test_free_parameters_with_the_best_forgetting_follow_it_ten_times_worse() -> None:
    assert (followed(0, (0.6, 0.025), drifts=False, forgetting=20.0) > [2.0, 3.0]).all()


def test_a_drift_of_less_than_four_rows_is_refused() -> None:
    with pytest.raises(PvidError, match="at least four rows: 4 s"):
        pvid.Estimator(
            lambda p: p, start=[1.0] * 3, start_sd=[1.0] * 3, row_sd=1.0, drift=lambda p: np.eye(3)[0], drift_s=1.0
        )


# ---- the weak form, printed for a motor with inductance and inertia


def heating(memory_s: float = 1.0, constants: int = 1) -> CompiledModel:
    model = Model("motor that heats")
    w = model.sensor("w", "rad/s", noise=0.05, reach=300, gain_sd=0)
    i = model.sensor("i", "A", noise=0.005, reach=10, gain_sd=0)
    v = model.input("V", "V", "zoh", reach=24, gain_sd=0)
    of_copper, of_magnets = model.known("alpha", "1/K", ALPHA), model.known("beta", "1/K", BETA)
    r, inductance = model.unknown("R", "ohm", 0.6), model.unknown("L", "H", 1e-3)
    k, j, b = model.unknown("k", "V*s", 0.03), model.unknown("J", "kg*m^2", 1e-4), model.unknown("b", "N*m*s", 1e-4)
    rise = model.unknown("rise", "K", 0.0, positive=False, sd=0.01, low=-40, high=150)
    model.equation(inductance * i.d() + r * i + k * w - v)
    kt = k if constants == 1 else model.unknown("kt", "V*s", 0.03)
    model.equation(j * w.d() + b * w - kt * i)
    rates = {r: of_copper * r / (1 + of_copper * rise), k: -of_magnets * k / (1 - of_magnets * rise), rise: 1}
    if constants == 2:
        model.constraint(k - kt)
        rates[kt] = -of_magnets * kt / (1 - of_magnets * rise)
    model.drift(rates, memory_s)
    return model.compiled("heating")


@cache
def heated_run() -> tuple[Recording, Float]:
    """60 s at 1 kHz of two square waves, exact between the samples but for the heat, which begins at 10 s; R and k."""
    dt, n, inductance, j, b = 1e-3, 60000, 2e-3, 1.5e-4, 2e-4
    t: Float = np.arange(n, dtype=np.float64) * dt
    heat = 60 * (1 - np.exp(-np.maximum(t - 10, 0) / 240))
    truth = np.stack([1.2 * (1 + ALPHA * heat), 0.06 * (1 - BETA * heat)], axis=1)
    v = 6 * np.sign(np.sin(6.9 * t + 0.1)) + 4 * np.sign(np.sin(23.2 * t + 1))
    x = np.zeros((n, 2))
    for k in range(n - 1):
        if k % 100 == 0:
            r, c = truth[min(k + 50, n - 1)]
            a = np.array([[-r / inductance, -c / inductance], [c / j, -b / j]])
            values, vectors = np.linalg.eig(a * dt)
            step = ((vectors * np.exp(values)) @ np.linalg.inv(vectors)).real
            force = np.linalg.solve(a, (step - np.eye(2)) @ [1 / inductance, 0.0])
        x[k + 1] = step @ x[k] + force * v[k]
    rng = np.random.default_rng(0)
    signals = {"w": x[:, 1] + 0.05 * rng.normal(size=n), "i": x[:, 0] + 0.005 * rng.normal(size=n), "V": v}
    return Recording(t, signals, 1 / dt), truth


def test_the_printed_weak_form_follows_the_heat_with_the_bits_of_its_twin() -> None:
    """Commissioned cold, from starts 50 % off; in the end R, k and the rise of the temperature by their errors."""
    hot, truth = heated_run()
    cold = Recording(hot.t[:10000], {name: one[:10000] for name, one in hot.signals.items()}, 1000.0)
    model = heating()
    assert "R, k and rise drift together, with a memory of 1 s." in check_report(model)
    answer = analysed(cold, model)
    assert answer.found.verdict.word == "good"
    config = config_to_identify(model, cold, answer.ranking)
    native = weak_native(model, config.design)
    core = native.identifier_of(config)
    record = core.run_samples(samples_of(config, hot.signals))
    late = hot.t > 15
    off = record.p[late][:, [0, 2]] / truth[late] - 1
    assert (np.sqrt(np.mean(off**2, axis=0)) < 0.002).all()
    assert core.is_published and record.p[-1, 5] == pytest.approx(11.3, abs=0.5)
    assert_equals_the_twin(native, config, samples_of(config, hot.signals)[9000:14000])
    assert identify_in_c(answer).values["R"].value == pytest.approx(1.2, rel=1e-3)


def test_what_follows_no_drift_names_what_does() -> None:
    with pytest.raises(PvidError, match="a drift of its unknowns, .* the weak form in float64 and float32 does"):
        strong_form(heating())


def test_the_memory_must_be_four_half_windows_of_the_core() -> None:
    answer = analysed(cut(heated_run()[0], 8000), heating(memory_s=0.01))
    with pytest.raises(PvidError, match="memory of its drift, 0.01 s, is below the four half windows"):
        identify_in_c(answer)


# ---- float64


def test_the_smoother_solves_the_least_squares_with_a_random_walk() -> None:
    """Of two directions that turn, all windows and steps at once; its errors are those of the normal equations."""
    rng = np.random.default_rng(2)
    windows, n = 30, 4
    rows, y = rng.normal(size=(windows, 3, n)), rng.normal(size=(windows, 3))
    ways, steps = rng.normal(size=(windows, n, 2)), rng.uniform(0.01, 2, (windows - 1, 2))
    s, f = np.einsum("wrp,wrq->wpq", rows, rows), np.einsum("wrp,wr->wp", rows, y)
    own = Forwards.of(0.1 * np.eye(n), np.zeros(n), s, f, ways, steps)
    p, covariance, change = own.smoothed()
    unknowns = n + 2 * (windows - 1)
    to_p = np.zeros((windows, n, unknowns))  # of the first p and all steps
    for w in range(windows):
        to_p[w:, :, :n] = np.eye(n)
        if w + 1 < windows:
            to_p[w + 1 :, :, n + 2 * w : n + 2 * w + 2] = ways[w]
    whole = np.diag(np.concatenate([0.1 * np.ones(n), 1 / steps.ravel()]))
    whole += np.einsum("wpi,wpq,wqj->ij", to_p, s, to_p)
    best = np.linalg.solve(whole, np.einsum("wpi,wp->i", to_p, f))
    spread = np.linalg.inv(whole)
    moved = to_p[-1] - to_p[0]
    assert p == pytest.approx(to_p @ best, abs=1e-9)
    assert covariance == pytest.approx(to_p @ spread @ to_p.transpose(0, 2, 1), abs=1e-9)
    assert change == pytest.approx(np.diag(moved @ spread @ moved.T), abs=1e-9)


def winding(*guesses: float) -> CompiledModel:
    """V = R i + k w, an algebraic equation."""
    model = Model("winding")
    v = model.sensor("V", "V", noise=0.02, reach=20, gain_sd=0)
    i = model.sensor("i", "A", noise=0.002, reach=10, gain_sd=0)
    w = model.sensor("w", "rad/s", noise=0.05, reach=300, gain_sd=0)
    of_copper, of_magnets = model.known("alpha", "1/K", ALPHA), model.known("beta", "1/K", BETA)
    r, k = (model.unknown(name, unit, guess) for name, unit, guess in zip("Rk", ("ohm", "V*s"), guesses, strict=True))
    rise = model.unknown("rise", "K", 0.0, positive=False, sd=0.01, low=-100, high=200)
    model.equation(r * i + k * w - v)
    rates = {r: of_copper * r / (1 + of_copper * rise), k: -of_magnets * k / (1 - of_magnets * rise), rise: 1}
    model.drift(rates, memory_s=1.0)
    return model.compiled("winding")


@pytest.mark.parametrize("start", [(0.6, 0.025), (1.8, 0.075)])
def test_float64_follows_60_kelvin_from_starts_that_are_50_percent_off(start: tuple[float, float]) -> None:
    t, rows, v, truth = heated(0)
    answer = analysed(Recording(t, {"V": v, "i": rows[:, 0], "w": rows[:, 1]}, 20.0), winding(*start))
    drifted = answer.found.drifted
    assert drifted is not None and answer.found.verdict.word == "good"
    at = np.stack([np.interp(drifted.t, t, one) for one in truth.T], axis=1)
    off = drifted.p[drifted.t > 60, :2] / at[drifted.t > 60] - 1
    assert (np.sqrt(np.mean(off**2, axis=0)) < 0.002).all()
    assert (np.abs(drifted.p[[0, -1], :2] - at[[0, -1]]) < 4 * drifted.se[[0, -1], :2]).all()


def cut(recording: Recording, samples: int) -> Recording:
    return Recording(recording.t[:samples], {name: one[:samples] for name, one in recording.signals.items()}, 1000.0)


@cache
def hot() -> Analysis:
    return analysed(cut(heated_run()[0], 24000), heating())


def test_float64_publishes_where_a_drift_began_where_it_ended_and_how_far_it_went() -> None:
    """And the core, configured by it, agrees on the end."""
    _, truth = heated_run()
    answer = hot()
    assert answer.found.verdict.word == "good" and answer.found.chi2 < 1.1
    course = answer.as_json()["course"]
    rise = 60 * (1 - np.exp(-14 / 240))
    wanted = {"R": truth[[0, 23999], 0], "k": truth[[0, 23999], 1], "rise": np.array([0.0, rise])}
    assert set(course) == set(wanted)
    for name, (start, end) in wanted.items():
        for part, value in (("start", start), ("end", end), ("change", end - start)):
            one = course[name][part]
            assert abs(one["value"] - value) < 4 * one["se"], (name, part)
        assert course[name]["change"]["se"] < 0.1 * abs(end - start)
        assert answer.values[name].value == pytest.approx(course[name]["end"]["value"], rel=1e-4)
    assert "drifted, the values are those of the end: R from 1." in answer.lines[0]
    assert "drift with a memory of 0.0" in answer.method[1]
    core = identify_in_c(answer)
    assert core.published and core.values["R"].value == pytest.approx(truth[23999, 0], rel=2e-3)
    assert answer.found.history.shape == (len(answer.found.times), 6)


@cache
def jumped() -> Analysis:
    """The motor of constants that drift, whose current is off by 0.5 A from 5 s on; gains are known to 1 %."""
    model, run = heating(), cut(heated_run()[0], 12000)
    signals = {**run.signals, "i": run.signals["i"] + 0.5 * (run.t > 5)}
    known_to = tuple(replace(one, gain_sd=0.01) for one in model.signals)
    return analysed(replace(run, signals=signals), replace(model, signals=known_to))


def test_the_history_has_a_value_at_each_window_though_the_course_left_out_others() -> None:
    found = jumped().found
    assert found.drifted is not None
    fewer = replace(found.drifted, ends=found.drifted.ends[::3], so_far=found.drifted.so_far[::3])
    rows = copy(found.fit.rows)
    rows.compiled = copy(rows.compiled)
    rows.compiled.bare = replace(rows.compiled.bare, drifted=fewer)
    history = replace(found, fit=replace(found.fit, rows=rows)).history
    assert history.shape == (len(found.times), 6) and history[::3] == pytest.approx(fewer.so_far)


def test_the_end_of_the_course_has_the_error_of_the_value() -> None:
    answer = jumped()
    for name, one in answer.as_json()["course"].items():
        value = answer.values[name]
        assert (one["end"]["value"], one["end"]["se"]) == pytest.approx((value.value, value.se))
    course = answer.as_json()["course"]["R"]
    assert course["start"]["se"] > 0.01 * course["start"]["value"]  # a gain
    assert course["change"]["se"] < np.hypot(course["start"]["se"], course["end"]["se"])


def test_a_jump_that_the_drift_imitates_is_an_alarm_for_what_drifts() -> None:
    answer = jumped()
    reasons = {one.name: one for one in answer.found.verdict.reasons}
    assert reasons["chi2"].alarm and "R, k and rise follow it" in reasons["chi2"].text
    assert "good" not in (answer.values[one].word for one in ("R", "k", "rise"))


def test_the_report_has_the_course_and_says_why_no_motion_is_predicted() -> None:
    page = report(hot(), Made("pvid identify hot.csv"))
    assert "Drifted, the values are those of the end: " in page and "(± standard errors)." in page
    assert "Parameters may drift: one set of values predicts no motion." in page


@pytest.mark.parametrize("constants", [1, 2])
def test_what_only_drifts_is_no_parameter_of_a_prediction(constants: int) -> None:
    """The rise of the temperature is in no equation; both constants of the motor are tied."""
    model, cold = heating(constants=constants), cut(heated_run()[0], 6000)
    truth = {"R": 1.2, "L": 2e-3, "k": 0.06, "kt": 0.06, "J": 1.5e-4, "b": 2e-4, "rise": 0.0}
    p = np.array([truth[one] for one in model.p_names])
    found = [float(one.times_noise) for one in validated(model, cold, p, 0.05).sensors]
    assert found == pytest.approx([1.0, 1.0], abs=0.03)


def test_where_a_drift_cannot_be_followed_the_reasons_are_those_of_parameters_that_stay() -> None:
    run = cut(heated_run()[0], 6000)
    turned = replace(run, signals={**run.signals, "w": -run.signals["w"]})
    answer = advised(analysed(turned, heating()))
    assert any("--columns w=w:-1" in one for one in answer.advice)
    assert "The drift cannot be followed" in (answer.found.verdict.warning or "") and answer.found.drifted is None
    assert len({one.word for one in answer.values.values()} & {"good"}) == 0


def test_several_recordings_have_no_course() -> None:
    whole = heated_run()[0]
    late = replace(cut(whole, 4000), signals={name: one[-4000:] for name, one in whole.signals.items()})
    answer = analysed(joined([cut(whole, 4000), late], ["cold", "hot"], Columns(channels_of(heating()))), heating())
    assert answer.found.drifted is not None and "course" not in answer.as_json()
    assert answer.lines == [
        "parameters may drift: the values are those of the end of the last recording; motion is not predicted"
    ]


def test_what_does_not_drift_has_gone_nowhere() -> None:
    answer = analysed(cut(heated_run()[0], 8000), heating())
    assert answer.lines == ["no drift beyond its error; motion is not predicted"]
    for one in answer.as_json()["course"].values():
        assert abs(one["change"]["value"]) < 4 * one["change"]["se"]
    assert answer.values["R"].value == pytest.approx(1.2, rel=3e-4)


def test_a_drift_keeps_constraints() -> None:
    """Both constants of the motor fall with the heat, and are one."""
    answer = analysed(cut(heated_run()[0], 24000), heating(constants=2))
    drifted = answer.found.drifted
    assert drifted is not None
    k, kt = (answer.model.p_names.index(one) for one in ("k", "kt"))
    assert drifted.p[:, k] == pytest.approx(drifted.p[:, kt], rel=1e-6) and drifted.p[-1, k] < 0.0598


def test_a_drift_that_cannot_be_is_refused() -> None:
    model = Model("refused")
    x = model.sensor("x", "m", noise=1e-3)
    k, d, free = model.unknown("k", "N/m", 1.0), model.unknown("d", "N*s/m", 1.0), model.unknown("free", "K", 1.0)
    model.equation(k * x + d * x.d() + x.d(2) * model.known("m", "kg", 1.0))
    for rates, message in (
        ({k: x}, "contains a signal"), ({x: 1}, "is no unknown"), ({k: 0}, "not all 0"),
        ({k: k, d: k}, "must be alike"),
    ):  # fmt: skip
        with pytest.raises(PvidError, match=message):
            model.drift(rates, 1.0)
    with pytest.raises(PvidError, match="positive time"):
        model.drift({k: k, d: d}, 0.0)
    model.drift({k: k, d: d, free: free}, 1.0)
    with pytest.raises(PvidError, match="give positive=False and its range"):
        model.compiled()
