"""Noise in the regressors looks like motion: one tone does not determine mass and stiffness, and nothing is missing."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import pvid
from pvid.model import Model

TRUTH = {"m": 1.0, "k": 50.0, "c": 1.0}
RATE, SD = 500.0, 1e-4


@cache
def cart(step: float = 0.0) -> Model:
    """With counts of so many metres, or noise."""
    model = Model("cart")
    force = model.input("F", "N", hold="zoh")
    x = model.sensor("x", "m", resolution=step) if step else model.sensor("x", "m", noise=SD)
    m, k, c = (
        model.unknown(name, unit, 1.5 * TRUTH[name]) for name, unit in zip("mkc", ("kg", "N/m", "N*s/m"), strict=True)
    )
    model.equation(m * x.d(2) + c * x.d() + k * x - force)
    return model


def recorded(seed: int, of_resonance: float, second: float, until: float = 40.0) -> dict[str, np.ndarray]:
    """10 s after the transient of a held force: a tone, and until then [s] a second one of so many newtons."""
    m, k, c = TRUTH.values()
    t = np.arange(int(40 * RATE)) / RATE
    rate = of_resonance * np.sqrt(k / m)
    force = np.sin(rate * t) + second * np.sin(2.3 * rate * t) * (t < until)
    b, a, _ = cont2discrete(([1.0], [m, c, k]), 1 / RATE)
    run = {"t": t, "F": force, "x": lfilter(b[0], a, force)}
    run = {name: x[int(30 * RATE) :] for name, x in run.items()}
    return run | {"x": run["x"] + SD * np.random.default_rng(seed).standard_normal(len(run["t"]))}


@pytest.mark.parametrize("of_resonance", [0.7, 1.0, 1.5])
@pytest.mark.parametrize("seed", [0, 1])
def test_one_tone_determines_the_damping_alone(seed: int, of_resonance: float) -> None:
    result = pvid.identify(recorded(seed, of_resonance, 0.0), model=cart())
    assert set(result.parameters) == {"c"}
    assert abs(result["c"].value - TRUTH["c"]) < 3 * result["c"].se
    with pytest.raises(KeyError, match="the run does not determine m: the standard error of m is"):
        result["m"]
    assert "m" not in result and list(result) == ["c"]
    assert "does not determine" in str(result.warning) and "not identifiable together" in str(result.warning)


@pytest.mark.by_day(2)
@pytest.mark.parametrize(("of_resonance", "counts"), [(1.0, 40), (1.5, 100), (1.0, 100), (0.7, 100)])
def test_one_tone_of_counts_does_not_show_that_there_is_no_spring(of_resonance: float, counts: int) -> None:
    """Their error repeats with the tone."""
    run = recorded(0, of_resonance, 0.0)
    x = run["x"] - SD * np.random.default_rng(0).standard_normal(len(run["t"]))
    step = float(np.ptp(x)) / counts
    result = pvid.identify({**run, "x": np.rint(x / step + 0.4) * step}, model=cart(step))
    for name in set(result.parameters) & {"m", "k"}:
        one = result[name]
        assert one.verdict == "not_explained" or abs(one.value - TRUTH[name]) < 4 * one.se


@pytest.mark.parametrize("seed", [0, 1])
def test_a_second_tone_of_a_twentieth_determines_all(seed: int) -> None:
    result = pvid.identify(recorded(seed, 1.0, 0.05), model=cart())
    assert result.verdict == "good" and set(result.parameters) == set(TRUTH)
    for name, one in result.parameters.items():
        assert abs(one.value - TRUTH[name]) < 3 * one.se < 0.1 * TRUTH[name]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_half_of_the_run_with_one_tone_alone_does_not_contradict_the_other(seed: int) -> None:
    result = pvid.identify(recorded(seed, 1.0, 0.3, until=35.0), model=cart())
    assert result.verdict == "good" and result.warning is None


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_term_does_not_take_over_what_the_noise_hides(seed: int) -> None:
    """Noise is a tenth of the information: F without a dead band, whose column is free of noise."""
    run = recorded(seed, 0.8, 1.0)
    noise = SD * np.random.default_rng(seed).standard_normal(len(run["t"]))
    x = 3e-3 * (run["x"] - noise) + noise
    result = pvid.identify({**run, "F": 3e-3 * run["F"], "x": x}, model=cart())
    assert result.warning is None and result.missing is None and set(result.parameters) == set(TRUTH)
    assert all(abs(one.value - TRUTH[name]) < 3 * one.se for name, one in result.parameters.items())
