"""Recordings whose signals do not share every row give the parameters of the mechanism."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import pvid

Float = npt.NDArray[np.float64]

RATE = 500.0
TRUTH = {"m": 1.3, "c": 1.7, "k": 82.0}
MODEL = """
from pvid import Model
model = Model("cart on a spring")
F = model.input("F", "N", hold="zoh", reach=10)
x = model.sensor("x", "m", resolution=1e-5, reach=0.2)
m = model.unknown("m", "kg", 1.0)
c = model.unknown("c", "N*s/m", 1.0)
k = model.unknown("k", "N/m", 100.0)
model.equation(m * x.d(2) + c * x.d() + k * x - F)
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "cart.py"
    path.write_text(MODEL)
    return path


def cart(seed: int, seconds: float = 12.0) -> dict[str, Float]:
    """By the exact solution from step to step of the force."""
    random = np.random.default_rng(seed)
    n = round(seconds * RATE)
    force = np.repeat(random.uniform(-5, 5, n).round(2), random.integers(20, 150, n))[:n]
    m, c, k = TRUTH.values()
    rate = -c / (2 * m)
    omega = np.sqrt(k / m - rate**2)
    dt = 1 / RATE
    turn = np.exp(rate * dt) * np.array(
        [
            [np.cos(omega * dt) - rate / omega * np.sin(omega * dt), np.sin(omega * dt) / omega],
            [-k / m * np.sin(omega * dt) / omega, np.cos(omega * dt) + rate / omega * np.sin(omega * dt)],
        ]
    )
    state, x = np.zeros(2), np.empty(n)
    for step, own in enumerate(force):
        x[step] = state[0]
        rest = np.array([own / k, 0.0])
        state = rest + turn @ (state - rest)
    x = np.asarray(np.rint(x / 1e-5 + 0.5 * random.standard_normal(n)) * 1e-5)
    return {"t": np.asarray(np.arange(n) / RATE), "F": force, "x": np.asarray(x)}


def assert_true(data: dict[str, Float], model: Path) -> pvid.Result:
    found = pvid.identify(data, model=model)
    for name, value in TRUTH.items():
        one = found.parameters[name]
        assert one.value is not None and one.se is not None
        assert abs(one.value - value) < min(3 * one.se, 0.01 * value), name
    assert found.status == "good"
    return found


def blank(data: dict[str, Float], name: str, where: npt.ArrayLike) -> dict[str, Float]:
    changed = data[name].copy()
    changed[np.asarray(where)] = np.nan
    return {**data, name: changed}


@pytest.mark.parametrize("every", [2, 3, 10])
def test_slow_sensor_beside_a_stepping_input(every: int, model: Path) -> None:
    data = cart(every)
    found = assert_true(blank(data, "x", np.arange(data["t"].size) % every != 0), model)
    assert 0.6 < found.details["chi2"] < 2.5  # its noise is that of its own rate


def test_input_logged_on_change(model: Path) -> None:
    data = cart(1)
    assert_true(blank(data, "F", 1 + np.flatnonzero(np.diff(data["F"]) == 0)), model)


def test_blank_cells_here_and_there(model: Path) -> None:
    data = cart(2)
    random = np.random.default_rng(3)
    assert_true(blank(data, "x", 1 + np.flatnonzero(random.random(data["t"].size - 2) < 0.1)), model)
