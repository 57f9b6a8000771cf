"""An answer predicts another recording: what is left is the sensor's noise, or shows that the mechanism is another."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from program import pvid

from bench.lacking import EFFECTS, recording
from bench.plants import PLANTS
from pvid.api.result import result_of
from pvid.base.errors import PvidError
from pvid.identification.analysis import analysed
from pvid.identification.answer import Analysis
from pvid.identification.road import identified
from pvid.identification.validation import Validation, validated
from pvid.rig.run import Recording

CART = PLANTS["cart"]
DRAG = next(one for one in EFFECTS if (one.plant, one.name) == ("cart", "drag"))


def recorded(seed: int, drag: float = 0.0, samples: int = 4000) -> Recording:
    signals = recording(CART, seed, (DRAG, drag)) if drag else recording(CART, seed)
    return Recording(np.arange(samples) / CART.rate, {name: x[:samples] for name, x in signals.items()}, CART.rate)


@cache
def answer() -> Analysis:
    return analysed(recorded(1), CART.model())


def validation(run: Recording) -> Validation:
    return validated(answer().model, run, answer().found.p, answer().found.design.window_s)


def test_another_run_of_the_same_mechanism_is_predicted_to_the_noise() -> None:
    """White noise of half a step and rounding are twice the rounding alone, which the model has."""
    found = validation(recorded(2))
    (x,) = found.sensors
    assert (x.name, x.unit) == ("x", "m") and found.blocks >= 6
    assert x.of_noise is not None and x.of_noise < 2.5 and x.r2 > 0.999999
    assert "predicts x to 0.0" in found.text and "times the sensor's noise" in found.text


def test_run_of_another_mechanism_is_predicted_worse() -> None:
    (x,) = validation(recorded(2, drag=0.8)).sensors
    assert x.of_noise is not None and x.of_noise > 100 and x.r2 < 0.999


def test_recording_that_is_too_short_for_blocks_is_refused() -> None:
    with pytest.raises(PvidError, match="too short to predict it in 6 blocks of 30 samples"):
        validation(recorded(2, samples=120))


MODEL = '''"""A cart on a spring."""
from pvid.model import Model
model = Model("cart")
F, x = model.input("F", "N", hold="zoh", reach=12, gain_sd=0), model.sensor("x", "m", resolution=1e-5, reach=0.5)
m, c, k = model.unknown("m", "kg", 1), model.unknown("c", "N*s/m", 1), model.unknown("k", "N/m", 60)
x0 = model.unknown("x0", "m", 0, positive=False, sd=0.05)
model.equation(m * x.d(2) + c * x.d() + k * (x - x0) - F)
'''


@pytest.mark.parametrize("plant", ["cart", "lag", "pendulum"])
def test_explained_run_is_predicted_half_by_half_and_keeps_its_estimate(plant: str) -> None:
    own = PLANTS[plant]
    signals = recording(own, 3)
    run = Recording(np.arange(len(next(iter(signals.values())))) / own.rate, signals, own.rate)
    plain, found = (identified(run, own.model(), refine=False, predict=one) for one in (False, True))
    assert plain.is_explained and not plain.prediction and np.array_equal(plain.found.p, found.found.p)
    (shown,) = found.as_json()["prediction"].values()
    assert shown["of_noise"] < 2.5 and shown["r2"] > 0.99


def test_result_predicts_the_sensors_of_a_whole_recording() -> None:
    result, run = result_of(answer()), recorded(2)
    found = result.predict({"t": run.t, **run.signals})
    assert set(found) == {"t", "x"} and found["x"].shape == found["t"].shape == run.t.shape
    assert np.std(found["x"] - run.signals["x"]) < 1e-3 * np.std(run.signals["x"])


def test_command_prints_what_it_predicts_and_has_it_in_the_json(tmp_path: Path) -> None:
    (tmp_path / "cart.py").write_text(MODEL)
    for name, seed in (("a", 1), ("b", 2)):
        one = recorded(seed)
        table = np.stack([one.t, one.signals["F"], one.signals["x"]], 1)
        np.savetxt(tmp_path / f"{name}.csv", table, fmt="%.9g", delimiter=",", header="t,F,x", comments="")
    command = ("identify", tmp_path / "a.csv", "--model", tmp_path / "cart.py", "--validate", tmp_path / "b.csv")
    assert "b.csv: " in pvid(tmp_path, *command).stdout
    found = json.loads(pvid(tmp_path, *command, "--json").stdout)["validation"]
    assert found["sensors"]["x"]["r2"] > 0.999999
    assert "b.csv: the answer predicts x to" in pvid(tmp_path, *command, "--core", "f32").stdout
