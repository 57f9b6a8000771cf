"""The choice of a design by its predicted errors, and verdicts on inputs that the outputs explain."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.model import Model, sgn
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak import choice
from pvid.oracle.weak.choice import basis_of, lengths, made, power_of, ranked
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.identify import identify, ready
from pvid.oracle.weak.rows import Compiled, WeakRows, record_of
from pvid.oracle.weak.solve import batch
from pvid.oracle.weak.whitener import Whitener, holders
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import RigSimulation, simulation_of

Float = npt.NDArray[np.float64]


def test_the_best_design_by_score_is_near_the_best_by_truth() -> None:
    sim = RigSimulation.of(compiled_of("cart_pendulum"), simulated_rig("cart_pendulum"))
    model = ready(sim.model)
    run = sim.run(0, Imperfections(friction="sharp"))
    tried = ranked(model, run, 1000.0, sim.truth)
    assert [one.score for one in tried] == sorted(one.score for one in tried)
    firm = model.parameters.positive

    def error(design: WeakDesign) -> float:
        off = [
            batch(WeakRows.of(model, sim.run(seed, Imperfections(friction="sharp")), design), sim.truth).p
            for seed in range(5)
        ]
        rms = np.sqrt(np.mean(np.square(np.array(off) / sim.truth - 1), axis=0))
        return float(np.exp(np.mean(np.log(rms[firm]))))

    best, worst = error(tried[0].design), error(tried[-1].design)
    assert best < worst / 2
    # Measured over eight seeds: 0.0037 % for the first, 0.0054 to 0.0061 % for the next three.
    assert best < float(np.mean([error(one.design) for one in tried[1:4]]))


def test_a_score_is_kept_for_the_same_samples_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = RigSimulation.of(compiled_of("furuta"), simulated_rig("furuta"))
    run = {name: x[:4000] for name, x in sim.run().items()}
    design = WeakDesign(1000.0, 1.0, power=power_of(ready(sim.model)))
    monkeypatch.setattr(choice, "_scores", {})
    first = choice.score_of(ready(sim.model), run, design, sim.truth, False)
    assert first is not None
    computed: list[object] = []
    monkeypatch.setattr(choice, "_scored", lambda *asked: computed.append(asked))
    copied = {name: x.copy() for name, x in run.items()}
    assert choice.score_of(ready(sim.model), copied, design, sim.truth.copy(), False) is first and not computed
    name = next(iter(run))
    for model, samples, start, errors in (
        (sim.model, {**run, name: run[name] + 1e-12}, sim.truth, False),
        (sim.model, run, 1.001 * sim.truth, False),
        (sim.model, run, sim.truth, True),
        (compiled_of("cart_pendulum"), run, sim.truth, False),
    ):
        assert choice.score_of(ready(model), samples, design, start, errors) is None
    assert len(computed) == 4


def test_windows_that_are_tried_fill_the_run_and_halve() -> None:
    assert lengths(20_000, 1000.0) == [2.1, 1.1, 0.53, 0.26, 0.13, 0.066]
    assert lengths(14_400, 1.0)[0] == 1500.0
    assert lengths(100, 1000.0) == []


def test_the_power_is_two_above_the_highest_order() -> None:
    assert power_of(ready(compiled_of("dc_motor"))) == 6
    assert power_of(ready(compiled_of("two_mass_drive"))) == 8


def test_sentences_on_impossible_designs() -> None:
    with pytest.raises(PvidError, match="too few for 40 functions"):
        WeakDesign(1000.0, 0.02, 40)
    with pytest.raises(PvidError, match="rate_taps of a design must be odd"):
        WeakDesign(1000.0, 1.0, 12, rate_taps=20)
    with pytest.raises(PvidError, match="soft sign needs a width"):
        WeakDesign(1000.0, 1.0, 12, reversals="soft")


def test_low_rank_whitening_is_that_of_each_windows_covariance() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(7, 7))
    covariance = root @ root.T
    directions = rng.normal(size=(5, 3, 7)) * np.array([1.0, 1e3, 0.0])[:, np.newaxis]
    held = holders(np.repeat(np.arange(5), 3), np.arange(15))
    whitener = Whitener.of_covariance(covariance, 5, directions.reshape(15, 7), held)
    eye = np.broadcast_to(np.eye(7), (5, 7, 7))
    factor = whitener.of(eye).transpose(0, 2, 1)
    total = np.zeros((7, 7))
    for w, u in zip(factor, directions, strict=True):
        whole = covariance + u.T @ u
        assert np.allclose(w @ whole @ w.T, np.eye(7), atol=1e-7)
        total += np.linalg.inv(whole)
    assert np.allclose(whitener.total_inverse(), total, rtol=1e-6, atol=1e-9 * np.max(np.abs(total)))
    assert np.allclose(whitener.back(eye), factor, atol=1e-9)


def wheel() -> Model:
    """A wheel with friction, driven by a torque."""
    model = Model("wheel")
    torque = model.input("torque", "N*m", hold="zoh", reach=5)
    q = model.sensor("q", "rad", resolution=1e-4, reach=10)
    inertia, viscous = model.unknown("inertia", "kg*m^2", 0.1), model.unknown("viscous", "N*m*s", 0.2)
    coulomb = model.unknown("coulomb", "N*m", 0.3)
    model.equation(inertia * q.d(2) + viscous * q.d() + coulomb * sgn(q.d()) - torque)
    return model


def driven(feedback_only: bool) -> dict[str, npt.NDArray[np.float64]]:
    """The wheel under a controller; what moves it is a reference, or a disturbance that nothing records."""
    rng = np.random.default_rng(1)
    n, dt = 10_000, 1e-3
    t = dt * np.arange(n)
    reference = 0.0 * t if feedback_only else np.sin(2 * np.pi * 0.7 * t) + 0.5 * np.sin(2 * np.pi * 2.3 * t)
    push = np.convolve(rng.normal(0, 3.0, n), np.ones(40) / 40, "same") if feedback_only else 0.0 * t
    q, v = np.empty(n), 0.0
    torque = np.empty(n)
    position = 0.3
    for k in range(n):
        q[k] = position
        torque[k] = 20.0 * (reference[k] - position) - 1.0 * v
        v += dt * (torque[k] + push[k] - 0.2 * v - 0.3 * np.sign(v)) / 0.1
        position += dt * v
    return {"torque": torque, "q": np.round((q + rng.normal(0, 5e-5, n)) / 1e-4) * 1e-4}


def heated(feedback: float) -> dict[str, npt.NDArray[np.float64]]:
    """A plate of the first order, whose power is a slow sine, or a thermostat's."""
    rng = np.random.default_rng(2)
    n, dt = 12_000, 0.1
    swing = 30 * np.sin(2 * np.pi * np.arange(n) * dt / 400)
    power, warm = np.empty(n), np.empty(n)
    now = 10.0
    for k in range(n):
        warm[k] = round(16 * (now + rng.normal(0, 0.03))) / 16
        power[k] = 30 - feedback * warm[k] if feedback else 30 + swing[k]
        now += dt * (power[k] - 0.6 * now + (swing[k] if feedback else 0.0)) / 130
    return {"P": power, "T": warm}


@pytest.mark.parametrize("feedback", [0.0, 2.0])
def test_the_law_of_a_mechanism_of_the_first_order_is_no_feedback(feedback: float) -> None:
    """Its input is a law of the output and its rate by its own equation."""
    model = Model("plate")
    power = model.input("P", "W", hold="zoh", reach=60)
    warm = model.sensor("T", "K", resolution=0.0625, reach=100)
    capacity, loss = model.unknown("C", "J/K", 100.0), model.unknown("h", "W/K", 0.5)
    model.equation(capacity * warm.d() + loss * warm - power)
    found = identify(model.compiled("plate"), heated(feedback), 10.0)
    assert ("feedback" in [one.name for one in found.verdict.reasons if one.alarm]) == (feedback > 0)
    if not feedback:
        assert np.all(np.abs(found.p - [130.0, 0.6]) < 4 * found.se)


def test_a_torque_that_is_a_law_of_the_angle_is_named_as_feedback() -> None:
    model = wheel().compiled("wheel")
    design = WeakDesign(1000.0, 1.0, 8)
    bad = identify(model, driven(feedback_only=True), 1000.0, design=design)
    assert "feedback" in [one.name for one in bad.verdict.reasons if one.alarm]
    good = identify(model, driven(feedback_only=False), 1000.0, design=design)
    assert "feedback" not in [one.name for one in good.verdict.reasons]


@pytest.mark.parametrize("name", KINDS)
def test_what_a_changed_signal_leaves_alone_is_taken_from_the_run_before(name: str) -> None:
    """Columns of a run with one other signal: as of a model that has seen no run before."""
    simulation = simulation_of(name)
    run = {key: x[:4000] for key, x in simulation.run(1).items()}
    changed = [run | {key: x * (1 + 1e-2 * np.sin(np.arange(x.size)))} for key, x in run.items()]
    design = basis_of(ready(simulation.model), simulation.rig.sample_rate)

    def columns(model: Compiled, of: dict[str, Float]) -> list[Float]:
        return record_of(model, of, design).columns(design.test_functions)

    model = Compiled(simulation.model)
    rows = WeakRows.of(model, run, design)
    assert model.channels.last is rows.record
    for one in (run, *changed):
        for found, alone in zip(columns(model, one), columns(Compiled(simulation.model), one), strict=True):
            np.testing.assert_allclose(found, alone, rtol=0, atol=1e-12 * np.max(np.abs(alone)))
    of_run = columns(model, run)
    assert any(not np.array_equal(a, b) for one in changed for a, b in zip(columns(model, one), of_run, strict=True))


def test_another_filter_of_the_rates_leaves_nothing_of_the_run_before_behind() -> None:
    """Its ends are others: the record has other steps."""
    simulation = simulation_of("furuta")
    run = {key: x[:4000] for key, x in simulation.run(1).items()}
    model, design = Compiled(simulation.model), basis_of(ready(simulation.model), simulation.rig.sample_rate)
    WeakRows.of(model, run, design)
    other = replace(design, rate_taps=31, rate_degree=4)
    found = record_of(model, run, other).columns(other.test_functions)
    alone = record_of(Compiled(simulation.model), run, other).columns(other.test_functions)
    assert all(np.array_equal(a, b) for a, b in zip(found, alone, strict=True))


def test_of_designs_alike_where_the_equations_err_the_least_smoothed_is_chosen() -> None:
    """A smoothed rate blurs the reversals of a dry friction, which no score shows."""
    design = WeakDesign(1000.0, 0.2, 12, 6, rate_taps=101, rate_degree=6)

    def scored(score: float, known: bool = True, **changes: float) -> choice.Scored:
        return choice.Scored(made(design, **changes), score, np.ones(1), 1e4, np.ones(1), known)

    best, alike = scored(1.0), scored(1.03, rate_taps=21, rate_degree=3)
    others = [
        scored(1.2, rate_taps=11, rate_degree=2),
        scored(1.01, rate_taps=15, rate_degree=2, window_s=0.4),
        scored(1.01, rate_taps=15, rate_degree=2, known=False),
    ]
    assert choice._least_smoothed([best, alike, *others]) is alike
    assert choice._least_smoothed([best, *others]) is best
