"""The integral of a noisy rate walks: its noise is in the weights, and the simulation has it as a coordinate."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

import pvid
from pvid.codegen.refine import refine_functions_of
from pvid.model import Integral, Model, cos
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.rows import Compiled, WeakRows

RATE, SD = 500.0, 0.05
BELT = {"J1": 2e-3, "J2": 5e-3, "k": 8.0, "c": 0.02, "b1": 4e-3, "b2": 6e-3}
UNITS = ("kg*m^2", "kg*m^2", "N*m/rad", "N*m*s/rad", "N*m*s/rad", "N*m*s/rad")


def belt() -> Model:
    model = Model("belt with two tachometers")
    torque = model.input("T", "N*m", hold="zoh", reach=5, gain_sd=0.0)
    w1, w2 = (model.sensor(name, "rad/s", noise=SD, gain_sd=0.0) for name in ("w1", "w2"))
    twist = model.define("a1", "rad", Integral(w1, 1)) - model.define("a2", "rad", Integral(w2, 1))
    J1, J2, k, c, b1, b2 = (model.unknown(name, unit, 1.4 * BELT[name]) for name, unit in zip(BELT, UNITS, strict=True))
    pull = k * twist + c * (w1 - w2)
    model.equation(J1 * w1.d() + pull + b1 * w1 - torque)
    model.equation(J2 * w2.d() - pull + b2 * w2)
    return model


def recorded(seed: int, bearing: float = 0.0) -> dict[str, np.ndarray]:
    """20 s of held torques; `bearing`: so much of b2 from the half of the run on."""
    rng = np.random.default_rng(seed)
    torque = np.repeat(rng.uniform(-1, 1, 200), 50)
    J1, J2, k, c, b1, b2 = BELT.values()
    halves, state = [], np.zeros(3)
    for part, damping in ((slice(0, 5000), b2), (slice(5000, None), b2 + bearing)):
        a = np.array([[-(c + b1) / J1, c / J1, -k / J1], [c / J2, -(c + damping) / J2, k / J2], [1.0, -1.0, 0.0]])
        system = cont2discrete((a, np.array([[1 / J1], [0], [0]]), np.eye(3), np.zeros((3, 1))), 1 / RATE)
        for one in torque[part]:
            halves.append(state)
            state = system[0] @ state + system[1][:, 0] * one
    w1, w2, _ = np.array(halves).T
    noise = SD * rng.standard_normal((2, len(torque)))
    return {"t": np.arange(len(torque)) / RATE, "T": torque, "w1": w1 + noise[0], "w2": w2 + noise[1]}


def of_a_curve() -> CompiledModel:
    """A gain of the integral that varies within a window, and one that does not; a sample is integrated twice."""
    model = Model("gyro")
    w, f = model.sensor("w", "rad/s", noise=SD), model.sensor("f", "m/s^2", noise=SD)
    a, x = model.define("a", "rad", Integral(w, 1)), model.define("x", "m", Integral(f, 2))
    torque = model.input("T", "N*m", hold="sampled")
    A, g, k = model.unknown("A", "kg*m^2", 0.05), model.unknown("g", "N*m", 1.2), model.unknown("k", "N/m", 3.0)
    model.equation(A * w.d() + g * cos(a) - torque)
    model.equation(k * x + model.unknown("m", "kg", 0.3) * f - torque / model.known("r", "m", 1.0))
    return model.compiled("gyro")


def test_the_noise_of_an_integral_is_that_of_its_rows() -> None:
    compiled, n = Compiled(of_a_curve()), 4000
    t, rng = np.arange(n) / RATE, np.random.default_rng(0)
    clean = {"w": 2 * np.cos(3 * t), "f": np.sin(5 * t), "T": np.zeros(n)}
    design = WeakDesign(RATE, 1.0, functions=9, power=6, rate_taps=5)
    exact, theta = WeakRows.of(compiled, clean, design), compiled.parameters.theta(compiled.parameters.guess)
    sums, draws = [np.zeros((9, 9)) for _ in theta], 100
    for _ in range(draws):
        rows = WeakRows.of(
            compiled, {k: x + SD * (k != "T") * rng.standard_normal(n) for k, x in clean.items()}, design
        )
        for kind, th in enumerate(theta):
            change = rows.columns[kind] - exact.columns[kind]
            e = change[:, len(th)] - np.einsum("wjk,j->wk", change[:, : len(th)], th)
            sums[kind] += e.T @ e / (draws * rows.windows)
    for kind, measured in enumerate(sums):
        assert exact.noise.size(kind, theta[kind]) == pytest.approx(np.trace(measured), rel=0.3)
        weights = exact.noise.covariance(kind, theta[kind], kind, theta[kind])
        whitener = np.linalg.inv(np.linalg.cholesky(weights))
        white = np.linalg.eigvalsh(whitener @ measured @ whitener.T)
        # The walk of all windows is in the weights of each: two directions of g cos(a), and of x, are quieter by far.
        assert np.all(white[:2] < 0.25)
        assert np.all(np.abs(white[2:] - 1) < 0.2)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_belt_with_two_tachometers_is_good(seed: int) -> None:
    result = pvid.identify(recorded(seed), model=belt())
    assert result.verdict == "good" and not result.warning
    for name, one in result.parameters.items():
        assert abs(one.value - BELT[name]) < 3 * one.se < 0.3 * BELT[name]
    assert result.unseen and all(one.r2 > 0.99 for one in result.unseen.sensors)


def test_a_bearing_that_changes_is_seen_beside_the_walk() -> None:
    result = pvid.identify(recorded(0, bearing=2 * BELT["b2"]), model=belt())
    assert result.verdict != "good" and "The halves of the run disagree on b2" in str(result.warning)


def test_a_rate_that_is_a_coordinate_has_its_derivative() -> None:
    model = Model("spring of a tachometer")
    w, T = model.sensor("w", "rad/s", noise=0.1), model.input("T", "N*m", hold="zoh")
    a = model.define("a", "rad", Integral(w, 1))
    J, k = model.unknown("J", "kg*m^2", 1e-3), model.unknown("k", "N*m/rad", 0.4)
    model.equation(J * w.d() + k * a - T)
    made = refine_functions_of(model.compiled("spring"))
    assert made.coordinates == ("w", "a") and [str(one) for one in made.inputs] == ["T"]
    m = made.functions["constants"].values(r=np.array([1e-3, 0.4]))["m"]
    found = made.functions["jacobian"].values(m=m, q=np.array([1.0, 2.0]), v=np.zeros(0), u=np.array([0.1]))
    assert found["K"] == pytest.approx([0.0, -400.0, 1.0, 0.0]) and found["a"] == pytest.approx([-700.0, 1.0])
