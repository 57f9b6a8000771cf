"""The step of a sensor, found in what it recorded."""

import numpy as np
import pytest

from pvid.models.mechanisms import compiled_of
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.rig.sensor_steps import resolution_of, with_resolutions

T = np.arange(0.0, 15.0, 1 / 500)
SWING = np.sin(5 * T) + 0.3 * np.sin(17 * T + 1)


def recorded(step: float, size: float, noise: float = 0.5) -> np.ndarray:
    """A swing as an encoder reads it, its grid anywhere."""
    random = np.random.default_rng(1)
    return np.asarray(step * np.round(size * SWING / step + noise * random.standard_normal(T.size) + 0.3) + 0.1)


@pytest.mark.parametrize("bits", [10, 12, 14, 16, 18])
@pytest.mark.parametrize("size", [0.02, 0.1, 0.5])
def test_the_step_is_found(bits: int, size: float) -> None:
    step = 2 * np.pi / 2**bits
    assert resolution_of(recorded(step, size)) == pytest.approx(step, rel=1e-6)
    assert resolution_of(recorded(step, size, noise=0.0)) == pytest.approx(step, rel=1e-6)


def test_the_step_is_found_behind_decimals_of_text() -> None:
    step = 2 * np.pi / 2**14
    for decimals in (4, 5, 6):  # at 4 the decimals are a quarter of a step
        assert resolution_of(np.round(recorded(step, 0.1), decimals)) == pytest.approx(step, rel=1e-3)
    assert resolution_of(np.round(recorded(step, 0.1), 3)) == pytest.approx(1e-3)  # nothing finer is in the file


def test_the_step_is_found_in_degrees_and_in_float32() -> None:
    step = 2 * np.pi / 2**12
    assert resolution_of(np.degrees(recorded(step, 0.1))) == pytest.approx(360 / 2**12, rel=1e-6)
    assert resolution_of(recorded(step, 0.1).astype(np.float32)) == pytest.approx(step, rel=1e-5)


def test_values_that_lie_anywhere_have_no_step() -> None:
    random = np.random.default_rng(2)
    for n in (300, 7500):
        for _ in range(5):
            assert resolution_of(random.standard_normal(n)) is None
    assert resolution_of(0.1 * SWING) is None
    assert resolution_of([0, 1, 2, 3, 1e6, 1e6 + 0.37, 2e6, 2e6 + 1, 2e6 + 2]) is None  # far from one another
    assert resolution_of((0.1 * SWING).astype(np.float32)) is None


def test_too_few_values_have_no_step() -> None:
    for values in ([], [0.1], [0.0] * 100, [0.0, 0.1, 0.2] * 30, [np.nan, np.inf] * 10):
        assert resolution_of(values) is None


def test_values_that_are_not_numbers_are_left_out() -> None:
    values = recorded(0.01, 0.5)
    values[::7] = np.nan
    values[::11] = np.inf
    assert resolution_of(values) == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05])
@pytest.mark.parametrize("size", [0.1, 1.0, 30.0])
def test_interpolated_samples_do_not_show_another_step(size: float, share: float) -> None:
    """Of a fast encoder each level is seen once, as those of interpolated samples are."""
    step = 2 * np.pi / 2**12
    for seed in range(3):
        values = recorded(step, size)
        random = np.random.default_rng(seed)
        filled = random.choice(np.arange(1, T.size - 1), max(1, int(share * T.size)), replace=False)
        halves = (values[filled - 1] + values[filled + 1]) / 2
        values[filled] = halves
        assert resolution_of(values) == pytest.approx(step, rel=1e-3)
        values[filled[::2]] += random.uniform(-0.5, 0.5, filled[::2].size) * step
        assert resolution_of(values) == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize(("name", "sensor"), [("kapitza", "phi"), ("cart_pendulum", "a")])
def test_a_step_that_the_rig_does_not_give_is_the_recordings(name: str, sensor: str) -> None:
    step, model = 2 * np.pi / 2**13, MechanismRig(name).applied(compiled_of(name))
    signals = {one.name: np.zeros_like(T) for one in model.signals} | {sensor: recorded(step, 0.1)}
    noted, found = with_resolutions(Recording(T, signals, 500.0), model)
    assert found.signal(sensor).resolution == float(f"{step:.4g}")
    said = f"{sensor} moves in steps of 0.000767 rad: taken as its resolution, which is not given"
    assert noted.notes == (said,)
    given = MechanismRig(name, sensor={sensor: {"resolution": 1e-4}}).applied(model)
    assert with_resolutions(Recording(T, signals, 500.0), given)[1] is given
    own = model.signal(sensor).resolution
    for other in (np.degrees(recorded(0.01, 1.0)), 0.1 * SWING, recorded(own, 0.1)):  # too coarse, none, the model's
        assert with_resolutions(Recording(T, {**signals, sensor: other}, 500.0), model)[1] is model
